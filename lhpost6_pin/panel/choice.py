"""The choice of a program: the one before is unloaded, the chosen one is checked, then loaded; nothing runs meanwhile.

    unload -> (done) -> check, in a thread -> load -> (done)

Each step waits for the answer of the one before. What is refused on the way leaves no program, except that a program
which runs is neither unloaded nor replaced.
"""

from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from typing import Any

from ..core.errors import ControllerError
from .client import Client
from .engine import Status
from .orders import Orders, pressed
from .programs import Program

__all__ = ["Choice"]

_WAIT = {"run", "setpoint", "span", "scale", "raise", "park"}
"""Orders that run what is loaded, or change what the check assumes."""
_CANCEL = {"stop", "trip", "pressure"}


class Choice:
    """The last choice of a program; `send` sends an order of a client to the controller.

    Attributes: name of what is being checked or loaded, None if nothing is; client who chose it.
    """

    def __init__(self, orders: Orders, work: Executor, send: Callable[[Client, dict[str, Any]], None]) -> None:
        """Begin without one."""
        self._orders, self._work, self._send = orders, work, send
        self._number = 0
        self._check: Future[tuple[dict[str, Any], Program]] | None = None
        self._program: Program | None = None  # that is being loaded
        self._message: Mapping[str, Any] = {}
        self.name: str | None = None
        self.client: Client | None = None

    def begin(self, client: Client, message: Mapping[str, Any], status: Status | None) -> None:
        """Choose a program in place of the one before and of any that is being checked.

        Raises ControllerError without pressure.
        """
        pressed(status)
        self.drop()
        self._number += 1
        self._message, self.client = message, client
        self.name = str(message.get("name") or message.get("wave") or "the program")
        self._send(client, {"do": "unload", "number": self._number, "what": ""})

    def admit(self, do: str) -> None:
        """Raise ControllerError for what has to wait for the check; orders that stop the table cancel it."""
        if self.name is not None and do in _WAIT:
            raise ControllerError(f"{self.name} is being checked; wait")
        if do in _CANCEL:
            self.cancel()

    def cancel(self) -> None:
        """Forget a choice that is not checked yet; what has been checked is loaded, and does not run by itself."""
        if self._program is None:
            self.drop()

    def drop(self) -> None:
        """Forget the choice, as at the end of a session."""
        if self._check is not None:
            self._check.cancel()
        self._check = self._program = self.name = self.client = None

    def done(self, order: Mapping[str, Any], status: Status | None) -> None:
        """Go on after an order of the controller, in the state that it made."""
        if order["do"] == "unload":
            self._orders.program = None
        if self.name is None or order.get("number") != self._number:
            return
        if order["do"] == "unload":
            self._check = self._work.submit(self._orders.choose, self._message, status, self._number)
        elif order["do"] == "load":
            self._orders.program = self._program
            self.drop()

    def refused(self, order: Mapping[str, Any]) -> None:
        """Forget a choice that the controller refused."""
        if order["do"] in ("unload", "load") and order.get("number") == self._number:
            self.drop()

    def look(self) -> None:
        """Load what has been checked, or inform the client why it cannot be."""
        if self._check is None or self.client is None or not self._check.done():
            return
        check, client, self._check = self._check, self.client, None
        error = check.exception()
        if error is None:
            order, self._program = check.result()
            self._send(client, order)
        else:
            self.drop()
            client.explain(error)

"""The other processes of a panel as its page's process holds them: started, spoken to without waiting, ended."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing import get_context
from typing import Any

from ..machine.machine import Machine
from .worker import Setup, control, serve_plant

__all__ = ["ControlProcess", "PlantProcess"]

_SPAWN = get_context("spawn")  # a copy of a process with threads may hang
_PATIENCE = 5.0  # [s] for a process to end by itself


class _Process:
    """A process with a pipe, which ends when the pipe is closed."""

    def __init__(self, target: Callable[..., None], *args: Any) -> None:
        self._pipe, there = _SPAWN.Pipe()
        self._process = _SPAWN.Process(target=target, args=(there, *args), daemon=True)
        self._process.start()
        there.close()

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process.is_alive()

    def close(self) -> None:
        """End it."""
        self._pipe.close()
        self._process.join(_PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


class PlantProcess(_Process):
    """A plant of the panel's own behind the link; attribute `address`, host and port."""

    def __init__(self, machine: Machine, faults: Sequence[str], pace: float) -> None:
        """Start it, and wait until it listens; `faults` it offers to a trainer."""
        super().__init__(serve_plant, machine, faults, pace)
        self.address: tuple[str, int] = self._pipe.recv()


class ControlProcess(_Process):
    """The controller's process."""

    def __init__(self, setup: Setup) -> None:
        """Start it, and wait until it is ready."""
        super().__init__(control, setup)
        self._pipe.recv()
        self._pipe.send(None)

    def order(self, order: dict[str, Any]) -> None:
        """Send an order."""
        with suppress(OSError):
            self._pipe.send(order)

    def news(self) -> list[tuple[str, Any]]:
        """Messages that have come: status, done, refusal, lost, ended."""
        found = []
        with suppress(EOFError, OSError):
            while self._pipe.poll():
                found.append(self._pipe.recv())
                self._pipe.send(None)
        return found

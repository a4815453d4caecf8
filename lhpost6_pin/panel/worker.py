"""The processes behind a panel: the controller in real time, and a plant of its own to command."""

import os
import select
import signal
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..control.settings import ControllerSettings
from ..core.errors import LhpostError, LinkError, SimulationError
from ..core.files import models_folder
from ..core.names import SAMPLE_RATE
from ..interfaces.link import LinkClient, LinkMode, PlantState, Reading, ServedPlant, make_faults, open_socket, serve
from ..interfaces.link.clock import SECOND, undisturbed
from ..interfaces.link.remote import refuse_other_machine
from ..machine.machine import Machine
from ..machine.parameters import Parameters, load_parameters
from ..mechanics.equilibrium import find_equilibrium, parked_pose
from ..mechanics.plant import make_plant
from .engine import Engine, Status
from .programs import Program, Recorded
from .ring import Ring
from .rows import Rows

__all__ = ["Setup", "come_first", "control", "panel_numbers", "program_of", "rows_of", "serve_plant"]

_IDLE = 0.1  # [s] between looks at orders
_POLL = 150e-6  # [s] of polling for the sensors of a plant that catches up
_POLLED = 20e-6  # [s] of polling before a deadline of the plant's, which leaves the processor to the page's drawing
_HURRIED = 0.9 * SECOND / SAMPLE_RATE  # [ns] between its samples
_SILENCE = 1.0  # [s] without sensors until the link is lost
_PATIENCE = 1.0  # [s] that a plant of its own waits for a command before its controller counts as dead
_OFTEN, _SELDOM = 64, 4  # samples between looks at orders, and such looks between those at what is to be shown
_KEEP = 2048  # samples between signs of life to a server that is not commanded
_MOST_UNANSWERED = 4  # samples that are answered, of those that came meanwhile; older ones are missed
_MOST_UNSEEN = 16  # messages to the page that it has not taken, from which on the next ones wait


class Setup(NamedTuple):
    """What the controller is made of."""

    machine: Machine
    settings: ControllerSettings
    ring: Path
    pace: float = 1.0  # of the plant's clock


class _Link:
    """Messages to the page's process, which are never waited for: those that find no room are sent later."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe, self._unseen = pipe, 0
        self._later: list[tuple[str, Any]] = []
        self.orders: list[Mapping[str, Any]] = []

    def report(self, kind: str, content: Any) -> None:
        self._later.append((kind, content))

    def look(self, seconds: float = 0.0) -> None:
        """Take orders, and send what there is room for; raises EOFError once the page's process has ended."""
        while select.select([self._pipe], [], [], seconds)[0]:  # its own poll takes ten times as long
            taken = self._pipe.recv()
            seconds = 0.0
            if taken is None:
                self._unseen -= 1
            else:
                self.orders.append(taken)
        while self._later and self._unseen < _MOST_UNSEEN:
            self._pipe.send(self._later.pop(0))
            self._unseen += 1


def panel_numbers() -> Parameters:
    """Numbers of `models/procedures/panel.toml`."""
    return load_parameters(models_folder() / "procedures" / "panel.toml")


def rows_of(machine: Machine) -> Rows:
    """Layout of a machine's rows."""
    return Rows(len(machine.actuators), len(machine.struts))


def control(pipe: Connection, setup: Setup) -> None:
    """Run the controller until the other end of the pipe is closed."""
    _first(setup.pace)
    link = _Link(pipe)
    controller = _Controller(setup, link)
    with suppress(EOFError, OSError):
        while True:
            controller.turn()


class _Controller:
    """The loop of the controller's process."""

    def __init__(self, setup: Setup, link: _Link) -> None:
        self._setup, self._link = setup, link
        self._plant = make_plant(setup.machine)
        self._rest = find_equilibrium(self._plant)
        self._rows, self._numbers = rows_of(setup.machine), panel_numbers()
        self._ring = Ring(setup.ring, self._rows.width)
        self._engine: Engine | None = None
        self._client: LinkClient | None = None
        self._reading: Reading | None = None
        self._shown: Status | None = None
        self._offered: dict[str, bool] = {}
        self._kept = 0
        link.report("ready", None)

    def turn(self) -> None:
        """Wait for orders, or run a session while there is one."""
        self._link.look(_IDLE)
        self._obey()
        if self._client is not None:
            with undisturbed():
                self._session(self._client)

    def _session(self, client: LinkClient) -> None:
        """Answer sensors until the session ends."""
        assert self._engine is not None
        silent, answered, looks, poll, stamp = 0.0, 0, 0, 0.0, 0
        self._answer(client, self._engine)
        while self._client is client:
            commanded = self._engine.pressure == "high"
            readings = client.wait(_IDLE if commanded else 0.02, poll)
            if readings:
                catches_up = 0 < readings[-1].stamp - stamp < len(readings) * _HURRIED / self._setup.pace
                poll, stamp = _POLL if catches_up else 0.0, readings[-1].stamp
            for reading in readings[-_MOST_UNANSWERED:]:
                silent, self._reading = 0.0, reading
                self._answer(client, self._engine)
                answered += 1
            if readings:
                if answered < _OFTEN and readings[-1].state == PlantState.RUNNING:
                    continue
            elif commanded:
                silent += _IDLE
                if silent >= _SILENCE:
                    self._link.report("lost", "the server does not answer any more")
                    self._end()
                    return
            else:
                client.keep()
            answered, looks = 0, looks + 1
            self._look(looks % _SELDOM == 0 or not readings)

    def _answer(self, client: LinkClient, engine: Engine) -> None:
        assert self._reading is not None
        command = engine.answer(self._reading)
        if command is not None:
            client.send(command)
        elif self._reading.state == PlantState.RUNNING or (
            engine.pressure == "high" and self._reading.sample - self._kept > _KEEP
        ):
            client.keep()  # a plant of the panel's own waits for commands until it knows that none come
            self._kept = self._reading.sample
        self._ring.write(engine.row)
        engine.prepare()

    def _look(self, show: bool = True) -> None:
        """Take orders and, if it is to be, show the state."""
        if show:
            self._show()
        self._link.look()
        self._obey()

    def _show(self) -> None:
        if self._engine is None or self._client is None:
            return
        status = self._engine.status
        if status != self._shown:
            self._shown = status
            self._link.report("status", status)
        if self._client.faults != self._offered:
            self._offered = dict(self._client.faults)
            self._link.report("faults", self._offered)

    def _obey(self) -> None:
        while self._link.orders:
            order = self._link.orders.pop(0)
            try:
                self._do(order)
            except (LhpostError, KeyError, TypeError, ValueError) as error:  # the rest: an order that no page sends
                self._link.report("refusal", (order, str(error)))
            else:
                self._show()  # before: whoever learns that an order is done has the state that it made
                self._link.report("done", order)

    def _do(self, order: Mapping[str, Any]) -> None:
        if order["do"] == "pressure" and order["to"] != "high":
            if order["to"] == "off":
                if self._engine is not None:
                    self._engine.order(order)
                self._end()
                return
            if self._client is None:
                self._begin(str(order["host"]), int(order["port"]))
                return
        if order["do"] == "fault":
            if self._client is None:
                raise SimulationError("the pressure is off; set it low first")
            if str(order["name"]) not in self._client.faults:
                raise SimulationError(f"the server offers no fault {order['name']}")
            self._client.switch(str(order["name"]), bool(order["on"]))
            return
        if self._engine is None:
            raise SimulationError("the pressure is off; set it low, then high")
        before = self._engine.commanding
        self._engine.order(order, program_of(order))
        if self._engine.commanding and not before and self._client is not None:
            self._answer(self._client, self._engine)  # a plant that waits for its first command sends nothing

    def _begin(self, host: str, port: int) -> None:
        client = LinkClient(host, port, tries=10, pressures=True)
        try:
            refuse_other_machine(client, self._setup.machine)
            if client.mode == LinkMode.LOCK_STEP:
                raise LinkError("the server runs in lock-step; start it with --mode real-time")
        except LinkError:
            client.close()
            raise
        self._client, self._reading, self._kept = client, client.reading, 0
        self._shown = None
        self._engine = Engine(self._plant, self._rest, self._setup.settings, self._numbers, self._rows)
        self._client.ask_faults()
        self._answer(self._client, self._engine)  # the state is that of the first sample, not of none

    def _end(self) -> None:
        """End the session."""
        if self._client is not None:
            self._client.close()
            self._link.report("ended", None)
        self._client = self._engine = self._shown = None


def _first(pace: float) -> None:
    """In real time come before other processes; Ctrl-C is for the page's process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if pace >= 1.0:
        come_first()


def come_first() -> None:
    """Let this process come before others where the system allows it."""
    with suppress(AttributeError, OSError):  # another system, or no right to it
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(os.sched_get_priority_min(os.SCHED_RR)))


def program_of(order: Mapping[str, Any]) -> Program | None:
    """The program that an order brings: a wave, or the name of a motion with the file of its rows."""
    if order["do"] != "load":
        return None
    if "wave" in order:
        wave: Program = order["wave"]
        return wave
    rows = np.load(order["file"], mmap_mode="r")
    return Recorded(str(order["name"]), *rows)


def serve_plant(pipe: Connection, machine: Machine, faults: Sequence[str], pace: float) -> None:
    """Serve a plant in real time, times `pace`, until the other end of the pipe is closed; sends its address first.

    The platen is parked where the machine says how low.
    """
    _first(pace)
    plant = make_plant(machine)
    rest = find_equilibrium(plant, None if machine.platen.parked is None else parked_pose(machine))
    served = ServedPlant(plant, rest, LinkMode.REAL_TIME, faults=make_faults(machine, faults))
    stop = threading.Event()

    def wait() -> None:
        with suppress(EOFError, OSError):
            pipe.recv()
        stop.set()

    threading.Thread(target=wait, daemon=True).start()
    with open_socket(port=0) as sock:
        pipe.send(sock.getsockname())
        serve(sock, served, stop=stop, pace=pace, patience=_PATIENCE, polled=_POLLED)
    os._exit(0)

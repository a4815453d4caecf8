"""The state of a panel between its browsers and the controller: clients, orders, recordings, the journal."""

import re
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.errors import ControllerError, LhpostError
from ..data.records import save_record
from ..data.sensors import SensorSet
from ..data.served_samples import ANSWERED, PLANT_STATE
from ..simulation.simulated_campaign import SensorErrors, as_sensed
from .choice import Choice
from .client import Client
from .engine import Status
from .journal import Journal
from .link_state import link_state
from .lost_operators import LostOperators
from .orders import Orders, pressed
from .processes import ControlProcess, PlantProcess
from .program_end import ProgramEnd
from .recording import Recording, record_of_rows
from .ring import RingReader
from .timekeeping import Timekeeping
from .worker import Setup, panel_numbers, rows_of

__all__ = ["OPERATOR_ONLY", "Options", "Session"]

OPERATOR_ONLY = {"pressure", "raise", "park", "setpoint", "span", "scale", "generator", "motion", "run", "hold", "stop"}
OPERATOR_ONLY |= {"reset", "interlock", "record"}
"""Orders that only the operator may give; anybody may trip the table."""


class Options(NamedTuple):
    """What a panel may be opened with."""

    server: tuple[str, int] | None = None  # of a plant elsewhere
    faults: Sequence[str] = ()  # that the panel's own plant offers
    pace: float = 1.0  # of its clock
    sensors: SensorSet | None = None  # through which recordings are made; None: without noise


class Session:
    """A panel: its clients, the controller's process, and the plant's, unless a server elsewhere is driven.

    Attributes: clients by number; operator, one of them or None; status of the controller, None while the pressure is
    off; journal; recording, writing and recordings, the one that goes on, names of those whose files are being written,
    and files; choice of a program; news of the link: off, on or lost; time, how well the plant's clock is kept.
    """

    def __init__(
        self,
        setup: Setup,
        folder: Path,
        work: Executor,
        facts: Mapping[str, Any],
        options: Options,
    ) -> None:
        """Start the processes; `facts` go into the attributes of records."""
        self._setup, self._folder, self._work, self._facts = setup, folder, work, dict(facts)
        self._options, server = options, options.server
        self.machine, self._numbers = setup.machine, panel_numbers()
        self._own = None if server else work.submit(PlantProcess, setup.machine, options.faults, options.pace)
        self.layout = rows_of(setup.machine)
        self._controls = 0
        self._start_control()
        self.clients: dict[str, Client] = {}
        self.operator: Client | None = None
        self.status: Status | None = None
        self.journal = Journal(folder / "journal.jsonl")
        self.recording: Recording | None = None
        self.writing: list[str] = []
        self.recordings: list[str] = []
        self._end_of_program, self._lost = ProgramEnd(), LostOperators()
        self.link, self.time = "off", Timekeeping(self.layout, options.pace)
        self.server = "of its own" if server is None else f"{server[0]}:{server[1]}"
        self._orders = Orders(setup.machine, self._numbers, setup.ring.parent)
        self.choice = Choice(self._orders, work, self._send)
        self._low: tuple[Client, Future[dict[str, Any]]] | None = None
        self.faults: dict[str, bool] = {}

    def _start_control(self) -> None:
        """Start the controller's process, with a ring of its own."""
        self._controls += 1
        ring = self._setup.ring.with_name(f"ring-{self._controls}")
        self._control = ControlProcess(self._setup._replace(ring=ring))
        self._ring = RingReader(ring, self.layout.width)

    def close(self) -> None:
        """End the processes; a recording is saved."""
        try:
            if self.recording is not None:
                self._save(self.recording)
        finally:
            self.recording = None
            self._control.close()
            if self._own is not None:
                self._own.result().close()

    # ------------------------------------------------------------------------------------- clients
    def join(self, client: Client) -> None:
        """Take a browser in."""
        self.clients[client.number] = client

    def leave(self, client: Client) -> None:
        """Let a browser go; a program that its operator leaves running is stopped."""
        self.clients.pop(client.number, None)
        if self.operator is not client:
            return
        self.operator = None
        self.choice.cancel()
        status = self.status
        running = status.program if status is not None and status.state in ("running", "holding") else None
        self.journal.note(
            client.name, "left the panel" + (" in mid-run: its program is ordered to stop" if running else "")
        )
        self._lost.add(client.key, self.journal.entries[-1]["time"], running)
        for other in self.clients.values():  # the same page may have come back before its loss was noticed
            self._notify_lost(other)
        if self.status is not None:  # also of a program that has been run since
            self._send(client, {"do": "stop", "what": ""})

    def _notify_lost(self, client: Client) -> None:
        """Notify the page of an operator who lost the connection, and with it the controls."""
        stated = self._lost.take(client.key, self.operator.name if self.operator else None)
        if stated is not None:
            client.notify(stated)

    def role(self, client: Client) -> str:
        """Role of a client."""
        return "operator" if client is self.operator else "watcher"

    # ------------------------------------------------------------------------------------- orders
    def take(self, client: Client, message: Mapping[str, Any]) -> None:
        """Do what a browser wants, or refuse it with the reason. Never raises for what a browser may send."""
        try:
            self._take(client, dict(message))
        except (LhpostError, KeyError, TypeError, ValueError) as error:
            client.explain(error)

    def _take(self, client: Client, message: dict[str, Any]) -> None:
        do = str(message["do"])
        if do == "name":
            client.name = re.sub(r"\s+", " ", str(message["name"])).strip()[:40] or client.name
            return
        if do == "join":
            client.key = str(message["key"])[:64]
            self._notify_lost(client)
            return
        if do == "take":
            if self.operator not in (None, client):
                raise ControllerError("another has the controls; ask for their release")
            self.operator = client
            self.journal.note(client.name, "takes the controls")
            return
        if do == "release":
            if self.operator is client:
                self.operator = None
                self.journal.note(client.name, "releases the controls")
            return
        if do in OPERATOR_ONLY and client is not self.operator:
            raise ControllerError("watchers do not drive; take the controls first")
        if do == "record":
            self._record(client, bool(message["on"]), str(message.get("name", "")))
            return
        if do in ("generator", "motion"):
            self.choice.begin(client, message, self.status)
            return
        self.choice.admit(do)
        if do == "pressure" and message["to"] == "low":  # a process that starts takes its time
            self._low = client, self._work.submit(self._begin)
        else:
            self._send(client, self._orders.of(do, message, self.status))

    def _send(self, client: Client, order: dict[str, Any]) -> None:
        self._control.order({**order, "by": client.number, "who": client.name})

    def _send_prepared(self) -> None:
        """Send the orders that threads have prepared; here, since a pipe is no place for two threads."""
        if self._low is not None and self._low[1].done():
            (client, prepared), self._low = self._low, None
            error = prepared.exception()
            if error is None:
                self._send(client, prepared.result())
            else:
                client.explain(error)
        self.choice.look()

    def _begin(self) -> dict[str, Any]:
        """Order to begin a session; a plant of the panel's own is started where there is none."""
        address = self._options.server
        if address is None:
            assert self._own is not None
            if not self._own.result().alive:
                self._own = self._work.submit(PlantProcess, self.machine, self._options.faults, self._options.pace)
            address = self._own.result().address
        return {"do": "pressure", "to": "low", "host": address[0], "port": address[1], "what": "sets the pressure low"}

    # ------------------------------------------------------------------------------------- recordings
    def _record(self, client: Client, on: bool, name: str) -> None:
        if on:
            if self.recording is not None:
                raise ControllerError("a recording runs already; end it first")
            pressed(self.status)
            self.recording = Recording(self._free_name(name))
            if self.status is not None and self.status.trip:
                self.recording.trip(self.status.tripped_at, self.status.trip)
            self.journal.note(client.name, f"begins the recording {self.recording.name}")
        elif self.recording is not None:
            done, self.recording = self.recording, None
            self.journal.note(client.name, f"ends the recording {done.name}, {done.seconds:.1f} s")
            self.writing.append(done.name)
            saved = self._work.submit(self._save, done)
            saved.add_done_callback(lambda future: self._saved(client, done.name, future))

    def _saved(self, client: Client, name: str, done: "Future[str]") -> None:
        self.writing.remove(name)
        error = done.exception()
        if error is not None:
            client.refuse(str(error))

    def _save(self, recording: Recording) -> str:
        status = self.status
        facts = {**self._facts, "test": recording.name, "title": recording.name}
        facts |= {"scale": status.scale if status else 1.0, "trouble": recording.trouble or "none"}
        record = record_of_rows(recording.rows(), self.layout, self.machine, facts)
        if self._options.sensors is not None:
            rate, rng = self._numbers.number("recording.rate"), np.random.default_rng()
            errors = SensorErrors({}, {}, {})
            record = as_sensed(record.drop_vars([ANSWERED, PLANT_STATE]), self._options.sensors, errors, rate, rng)
        path = self._folder / f"{recording.name}.nc"
        save_record(record, path, single=True)
        self.recordings.append(str(path))
        return str(path)

    def _free_name(self, name: str) -> str:
        """A name for a recording that no file has, nor one that is being written."""
        wanted = re.sub(r"[^\w.-]+", "_", name).strip("._") or "test"
        number, found = 1, wanted if name else "test-1"
        while found in self.writing or (self._folder / f"{found}.nc").exists():
            number += 1
            found = f"{wanted}-{number}"
        return found

    # ------------------------------------------------------------------------------------- what is new
    def look(self) -> Array:
        """Take the controller's messages and its new rows (n, width), which are returned."""
        for kind, content in self._control.news():
            self._handle(kind, content)
        if not self._control.alive:
            self._handle("lost", "the controller's process ended; another is started")
            self._start_control()
        self._send_prepared()
        rows = self._ring.read()
        if len(rows):
            self.time.add(rows)
            self._end_of_program.pass_samples(rows[:, 0], self.layout.of(rows, "program_time")[:, 0])
        if (ended := self._end_of_program.take()) is not None:
            self.journal.note("program", ended)
        if self.recording is not None:
            self.recording.add(rows)
        return rows

    def link_state(self) -> dict[str, Any]:
        """State of the link, as the page shows it."""
        return link_state(self.link, self.time, self.server, self._own is not None, self._numbers)

    def _end(self) -> None:
        """Without a session there is no state, and no program."""
        self.status = self._orders.program = None
        self._end_of_program.show(None)
        self.choice.drop()

    def _handle(self, kind: str, content: Any) -> None:
        if kind == "status":
            if content.trip and (self.status is None or not self.status.trip):
                self.journal.note("interlock", f"trip: {content.trip}")
                if self.recording is not None:
                    self.recording.trip(content.tripped_at, content.trip)
            self.status, self.link = content, "on"
            self._end_of_program.show(content)
        elif kind == "done":
            if content["what"]:
                self.journal.note(content["who"], content["what"])
            if content["do"] == "stop":
                self._end_of_program.stop(content["who"])
            self.choice.done(content, self.status)
        elif kind == "refusal":
            order, why = content
            self.choice.refused(order)
            number = order.get("by")
            for client in [self.clients[number]] if number in self.clients else self.clients.values():
                client.refuse(why)
        elif kind == "faults":
            self.faults = content
        elif kind == "lost":
            self.journal.note("link", content)
            self.link = "lost"
            self._end()
        elif kind == "ended":
            self._end()
            self.link = "off" if self.link == "on" else self.link

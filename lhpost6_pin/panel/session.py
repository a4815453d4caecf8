"""What a panel knows and does between its browsers and the controller: seats, orders, recordings, the journal."""

import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import numpy as np

from ..core.arrays import Array
from ..core.errors import ControllerError, LhpostError
from ..core.names import AXES, SAMPLE_RATE
from ..data.motion_files import motion_of
from ..data.records import save_record
from ..interfaces.link import PlantState
from ..mechanics.plant import make_plant
from ..motions import make_target
from .demand import check_program
from .engine import Status
from .journal import Journal
from .processes import ControlProcess, PlantProcess
from .programs import Program, Recorded, make_wave
from .recording import Recording, record_of_rows
from .ring import RingReader
from .worker import Setup, panel_numbers, rows_of

__all__ = ["OPERATOR_ONLY", "Seat", "Session"]

OPERATOR_ONLY = {"pressure", "raise", "park", "setpoint", "span", "scale", "generator", "motion", "run", "hold", "stop"}
OPERATOR_ONLY |= {"reset", "interlock", "record"}
"""Orders that only the operator may give; anybody may trip the table."""


class Seat:
    """A browser: its number, the name of who sits there, and how it is told that an order was refused."""

    def __init__(self, number: str, refuse: Callable[[str], None]) -> None:
        """Sit down as a watcher."""
        self.number, self.name, self.refuse = number, f"guest {number}", refuse


class Session:
    """A panel: its seats, the controller's process, and the plant's, unless a server elsewhere is driven.

    Attributes: seats by number; operator, one of them or None; status of the controller, None while the pressure is
    off; journal; recording and recordings, the files of those that ended; news of the link.
    """

    def __init__(
        self,
        setup: Setup,
        folder: Path,
        server: tuple[str, int] | None,
        work: Executor,
        facts: Mapping[str, Any],
        faults: Sequence[str] = (),
        pace: float = 1.0,
    ) -> None:
        """Start the processes; `server` is one elsewhere, `facts` go into the attributes of records."""
        self._setup, self._folder, self._server, self._work, self._facts = setup, folder, server, work, dict(facts)
        self.machine, self._plant, self._numbers = setup.machine, make_plant(setup.machine), panel_numbers()
        self._own = None if server else work.submit(PlantProcess, setup.machine, faults, pace)
        self.layout = rows_of(setup.machine)
        self._controls = 0
        self._start_control()
        self.seats: dict[str, Seat] = {}
        self.operator: Seat | None = None
        self.status: Status | None = None
        self.journal = Journal(folder / "journal.jsonl")
        self.recording: Recording | None = None
        self.recordings: list[str] = []
        self.link, self.answered, self.missed, self._newest = "off", 0, 0, -1
        self.holds, self._held = 0, False
        self.server = "of its own" if server is None else f"{server[0]}:{server[1]}"
        self.counts: dict[str, Any] = {"late": 0.0, "samples": 0, "holds": 0}
        self._program: Program | None = None
        self._offered, self.faults = tuple(faults), dict[str, bool]()
        self._pace = pace
        self._motions: set[str] = set()

    def _start_control(self) -> None:
        """Start the controller's process, with a ring of its own."""
        self._controls += 1
        ring = self._setup.ring.with_name(f"ring-{self._controls}")
        self._control = ControlProcess(self._setup._replace(ring=ring))
        self._ring = RingReader(ring, self.layout.width)

    def close(self) -> None:
        """End the processes; a recording is saved."""
        if self.recording is not None:
            self._save(self.recording)
            self.recording = None
        self._control.close()
        if self._own is not None:
            self._own.result().close()

    # ------------------------------------------------------------------------------------- seats
    def sit(self, seat: Seat) -> None:
        """Take a browser in."""
        self.seats[seat.number] = seat

    def leave(self, seat: Seat) -> None:
        """Let a browser go; a program that its operator leaves running is stopped."""
        self.seats.pop(seat.number, None)
        if self.operator is not seat:
            return
        self.operator = None
        running = self.status is not None and self.status.state in ("running", "holding")
        self.journal.note(seat.name, "left the panel" + (" in mid-run: the program is stopped" if running else ""))
        if running:
            self._control.order({"do": "stop", "by": seat.number, "who": seat.name, "what": ""})

    def role(self, seat: Seat) -> str:
        """Role of a seat."""
        return "operator" if seat is self.operator else "watcher"

    # ------------------------------------------------------------------------------------- orders
    def take(self, seat: Seat, message: Mapping[str, Any]) -> None:
        """Do what a browser wants, or refuse it with the reason. Never raises for what a browser may send."""
        try:
            self._take(seat, dict(message))
        except LhpostError as error:
            seat.refuse(str(error))
        except (KeyError, TypeError, ValueError) as error:
            seat.refuse(f"the page sent what the panel does not understand: {error!r}; load the page again")

    def _take(self, seat: Seat, message: dict[str, Any]) -> None:
        do = str(message["do"])
        if do == "name":
            seat.name = re.sub(r"\s+", " ", str(message["name"])).strip()[:40] or seat.name
            return
        if do == "take":
            if self.operator not in (None, seat):
                raise ControllerError("another has the controls; ask for their release")
            self.operator = seat
            self.journal.note(seat.name, "takes the controls")
            return
        if do == "release":
            if self.operator is seat:
                self.operator = None
                self.journal.note(seat.name, "releases the controls")
            return
        if do in OPERATOR_ONLY and seat is not self.operator:
            raise ControllerError("watchers do not drive; take the controls first")
        if do == "record":
            self._record(seat, bool(message["on"]), str(message.get("name", "")))
            return
        order = self._order(do, message)
        if isinstance(order, Future):
            order.add_done_callback(lambda done: self._send_later(seat, done))
        else:
            self._send(seat, order)

    def _send(self, seat: Seat, order: dict[str, Any]) -> None:
        self._control.order({**order, "by": seat.number, "who": seat.name})

    def _send_later(self, seat: Seat, done: "Future[dict[str, Any]]") -> None:
        """In a thread of the executor: orders need no more than the pipe."""
        error = done.exception()
        if error is None:
            self._send(seat, done.result())
        else:
            seat.refuse(str(error))

    def _order(self, do: str, message: dict[str, Any]) -> "dict[str, Any] | Future[dict[str, Any]]":
        """The controller's order of a message."""
        if do == "pressure" and message["to"] == "low":
            return self._work.submit(self._low)
        if do == "pressure":
            return {"do": do, "to": str(message["to"]), "what": f"sets the pressure {message['to']}"}
        if do in ("setpoint", "span"):
            return self._six(do, str(message["axis"]), float(message["value"]))
        if do == "scale":
            return self._scale(float(message["value"]))
        if do == "generator":
            return self._wave(message)
        if do == "motion":
            return self._work.submit(self._motion, str(message["name"]), message.get("axes"), float(message["scale"]))
        if do == "interlock":
            limit = f" limit {100.0 * float(message['limit']):g} %" if "limit" in message else ""
            on = f" {'on' if message['on'] else 'off'}" if "on" in message else ""
            return {**message, "what": f"sets the interlock {message['name']}:{limit}{on}"}
        if do == "fault":
            where = str(message.get("where", "all"))
            name = str(message["name"]) if where == "all" else f"{message['name']}@{where}"
            what = f"switches the fault {name} {'on' if message['on'] else 'off'}"
            return {"do": do, "name": name, "on": bool(message["on"]), "what": what}
        words = {"raise": "raises the platen", "park": "parks the platen", "run": "runs the program", "reset": "resets"}
        words |= {"hold": "holds the program", "stop": "stops the program", "trip": "trips the table"}
        if do not in words:
            raise ControllerError(f"no order {do!r}")
        return {"do": do, "what": words[do]}

    def _six(self, do: str, axis: str, value: float) -> dict[str, Any]:
        """A setpoint or span of one axis, within what the table can do."""
        status, at = self._pressed(), AXES.index(axis)
        limit = self.machine.limits.displacement[at] if at in self._plant.axes else 0.0
        if not abs(value) <= limit:
            raise ControllerError(f"{do} of {axis} is {value:g}; the displacement limit is {limit:g}")
        values = np.array(getattr(status, do))
        values[at] = value
        if self._program is not None and self._program.by_span:
            wanted = {"span": np.array(status.span), "setpoint": np.array(status.setpoint), do: values}
            check_program(self._plant, self._program, wanted["span"], wanted["setpoint"])
        return {"do": do, "values": values.tolist(), "what": f"sets the {do} of {axis} to {value:g} {_unit(axis)}"}

    def _scale(self, value: float) -> dict[str, Any]:
        status = self._pressed()
        if self._program is not None and not self._program.by_span:
            check_program(self._plant, self._program, np.full(6, value), np.array(status.setpoint))
        return {"do": "scale", "value": value, "what": f"sets the scale of the motion to {value:g}"}

    def _wave(self, message: Mapping[str, Any]) -> dict[str, Any]:
        """A wave on axes that have a span."""
        status = self._pressed()
        axes = tuple(AXES.index(str(axis)) for axis in message["axes"])
        given = {key: float(message[key]) for key in ("cycles", "to", "duration") if message.get(key) is not None}
        highest = self._numbers.number("generator.highest")
        wave = make_wave(
            str(message["wave"]), axes=axes, frequency=float(message["frequency"]), highest=highest, **given
        )
        still = [AXES[k] for k in axes if status.span[k] == 0.0]
        if still:
            raise ControllerError(f"the span of {', '.join(still)} is zero; set one first")
        check_program(self._plant, wave, np.array(status.span), np.array(status.setpoint))
        self._program = wave
        return {"do": "load", "wave": wave, "what": f"loads {wave.name} on {', '.join(AXES[k] for k in axes)}"}

    def _motion(self, name: str, axes: str | None, scale: float) -> dict[str, Any]:
        """A motion by name, or from a file, as rows in a file of this session."""
        status = self._pressed()
        own = None if self.machine.motion == "free" else self.machine.motion
        target = make_target(motion_of(name, [], **{}), axes=axes or own, rate=float(SAMPLE_RATE))
        program = Recorded(target.reference.motion, target.displacement, target.velocity, target.acceleration)
        check_program(self._plant, program, np.full(6, scale), np.array(status.setpoint))
        file = self._setup.ring.parent / f"motion-{len(self._motions)}.npy"
        np.save(file, np.stack([target.displacement, target.velocity, target.acceleration]))
        self._motions.add(str(file))
        self._program = program
        what = f"loads {program.name} at scale {scale:g}"
        return {"do": "load", "file": str(file), "name": program.name, "scale": scale, "what": what}

    def _pressed(self) -> Status:
        if self.status is None:
            raise ControllerError("the pressure is off; set it low, then high")
        return self.status

    def _low(self) -> dict[str, Any]:
        """Order to begin a session; a plant of the panel's own is started where there is none."""
        address = self._server
        if address is None:
            assert self._own is not None
            if not self._own.result().alive:
                self._own = self._work.submit(PlantProcess, self.machine, self._offered, self._pace)
            address = self._own.result().address
        return {"do": "pressure", "to": "low", "host": address[0], "port": address[1], "what": "sets the pressure low"}

    # ------------------------------------------------------------------------------------- recordings
    def _record(self, seat: Seat, on: bool, name: str) -> None:
        if on:
            if self.recording is not None:
                raise ControllerError("a recording runs already; end it first")
            self._pressed()
            self.recording = Recording(self._free_name(name))
            self.journal.note(seat.name, f"begins the recording {self.recording.name}")
        elif self.recording is not None:
            done, self.recording = self.recording, None
            self.journal.note(seat.name, f"ends the recording {done.name}, {done.seconds:.1f} s")
            saved = self._work.submit(self._save, done)
            saved.add_done_callback(lambda future: self._saved(seat, future))

    def _saved(self, seat: Seat, done: "Future[str]") -> None:
        error = done.exception()
        if error is not None:
            seat.refuse(str(error))

    def _save(self, recording: Recording) -> str:
        status = self.status
        facts = {**self._facts, "test": recording.name, "title": recording.name}
        facts |= {"scale": status.scale if status else 1.0, "trouble": (status and status.trip) or "none"}
        record = record_of_rows(recording.rows(), self.layout, self.machine, facts)
        path = self._folder / recording.name / "record.nc"
        path.parent.mkdir(parents=True, exist_ok=True)
        save_record(record, path, single=True)
        self.recordings.append(str(path))
        return str(path)

    def _free_name(self, name: str) -> str:
        """A name for a recording that no file has."""
        wanted = re.sub(r"[^\w.-]+", "_", name).strip("._") or "test"
        number, found = 1, wanted if name else "test-1"
        while (self._folder / found).exists():
            number += 1
            found = f"{wanted}-{number}"
        return found

    # ------------------------------------------------------------------------------------- what is new
    def look(self) -> Array:
        """Take the controller's messages and its new rows (n, width), which are returned."""
        for kind, content in self._control.news():
            self._heed(kind, content)
        if not self._control.alive:
            self._heed("lost", "the controller's process ended; another is started")
            self._start_control()
        rows = self._ring.read()
        if len(rows):
            self._count(rows)
        if self.recording is not None:
            self.recording.add(rows)
        return rows

    def _count(self, rows: Array) -> None:
        """Count samples that the controller answered, those that it missed, and safe holds."""
        samples = rows[:, 0].astype(int)
        steps = np.diff(samples, prepend=self._newest if samples[0] > self._newest >= 0 else samples[0])
        self.answered += int(np.count_nonzero(steps > 0))
        self.missed += int((steps[steps > 1] - 1).sum())
        self._newest = int(samples[-1])
        state = rows[:, 1] == PlantState.HOLD
        self.holds += int(np.count_nonzero(state[1:] & ~state[:-1])) + int(state[0] and not self._held)
        self._held = bool(state[-1])

    def _heed(self, kind: str, content: Any) -> None:
        if kind == "status":
            if content.trip and (self.status is None or not self.status.trip):
                self.journal.note("interlock", f"trip: {content.trip}")
            self.status, self.link = content, "on"
        elif kind == "done":
            if content["what"]:
                self.journal.note(content["who"], content["what"])
            if content["do"] == "load" and "scale" in content:
                self._control.order({"do": "scale", "value": content["scale"], "who": content["who"], "what": ""})
        elif kind == "refusal":
            number, why = content
            for seat in [self.seats[number]] if number in self.seats else self.seats.values():
                seat.refuse(why)
        elif kind == "faults":
            self.faults = content
        elif kind == "lost":
            self.journal.note("link", content)
            self.link = "lost"
            self.status = self._program = None
        elif kind == "ended":
            self.status = self._program = None
            self.link = "off" if self.link == "on" else self.link


def _unit(axis: str) -> str:
    return "m" if axis in AXES[:3] else "rad"

"""The controller of a driven table, sample by sample: without sockets, clocks and processes.

Orders come as plain entries (`orders`); a sample is answered with a command, or with None where the table is not to be
commanded: before high pressure, and after a trip, when the server goes to its safe hold by itself.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..control.controller import Controller, make_controller
from ..control.loop import step_packed
from ..control.settings import ControllerSettings
from ..control.tables import make_scratch
from ..core.arrays import Array
from ..core.errors import ControllerError
from ..core.names import SAMPLE_RATE
from ..data.metrics import QUANTITIES
from ..interfaces.link import PlantState, Reading
from ..interfaces.link.clock import SECOND
from ..machine.parameters import Parameters
from ..mechanics.equilibrium import Equilibrium
from ..mechanics.plant import Plant
from .drive import Drive
from .interlocks import INTERLOCKS, Interlocks, Measured, measured_motion
from .moves import Moved
from .programs import Program
from .reference import Reference
from .rows import PRESSURES, Rows

__all__ = ["Engine", "Status"]


class Status(NamedTuple):
    """What a panel shows of the controller beside the rows of samples."""

    pressure: str  # low or high
    platen: str  # parked, moving, raised, or held where it stopped
    trip: str  # empty: none
    program: str | None
    state: str
    duration: float | None
    setpoint: tuple[float, ...]
    span: tuple[float, ...]
    scale: float
    limits: tuple[float, ...]  # as `INTERLOCKS`
    on: tuple[bool, ...]
    where: tuple[str, ...]
    number: int = 0  # of the choice that loaded the program
    tripped_at: int = 0  # sample of the trip, if any
    base: tuple[float, ...] = (0.0,) * 6  # setpoint about which a program would run [m, rad]
    barred: tuple[str, str] = ("", "")  # why interlocks forbid to raise and to park from rest; empty: they do not


class Engine:
    """Controller, reference and interlocks of one session with a plant."""

    def __init__(
        self,
        plant: Plant,
        rest: Equilibrium,
        settings: ControllerSettings,
        numbers: Parameters,
        rows: Rows,
    ) -> None:
        """Prepare the controller; it begins at low pressure."""
        self._controller: Controller = make_controller(plant, rest, settings)
        self._packed = plant.tables.packed, self._controller.tables.packed
        self._interlocks = Interlocks(self._controller, rest, numbers)
        self._rows, self._parked = rows, plant.machine.platen.parked
        limits = plant.machine.limits
        free = np.isin(np.arange(6), plant.axes)
        self._speed = np.where(free, limits.velocity, np.inf)
        self._speed[self._speed == 0.0] = np.inf
        self._margin = numbers.number("raised.tolerance")
        self._tolerance = self._margin * max(limits.displacement[2], 1e-3)
        self._places = {"raised": np.zeros(6), "parked": np.array([0.0, 0.0, self._parked or 0.0, 0.0, 0.0, 0.0])}
        self._reference = Reference(Drive(numbers, self._speed, np.zeros(6)), self._controller.drive_for)
        self.pressure, self.trip, self._tripped_at = "low", "", 0
        self._number = 0
        self._place, self._lifted, self._state = "raised", True, PlantState.WAITING
        self._memory, self._scratch = self._controller.init(), make_scratch(plant).packed
        self._command = rest.spool.copy()
        self._last = 0
        self._now = Measured.of(np.concatenate([np.zeros(18), rest.force]))
        self._row = np.full(rows.width, np.nan)
        self._answered: tuple[Reading, Moved | None] | None = None  # of which the row is not filled yet

    @property
    def commanding(self) -> bool:
        """Whether the plant is commanded."""
        return self.pressure == "high" and not self.trip

    # ------------------------------------------------------------------------------------- orders
    def order(self, order: Mapping[str, Any], program: Program | None = None) -> None:
        """Do what a driver wants, from the next sample on that is not computed yet; a trip acts at once.

        Raises ControllerError with the reason for what cannot be done now.
        """
        self._reference.changed()
        do = str(order.get("do"))
        actions: dict[str, Callable[[Mapping[str, Any]], None]] = {
            "pressure": self._pressure,
            "raise": lambda _: self._lift("raised"),
            "park": lambda _: self._lift("parked"),
            "setpoint": self._setpoint,
            "span": lambda o: self._drive.set_span(_with_axis(self._drive.span, o), self._next),
            "scale": lambda o: self._drive.set_scale(float(o["value"]), self._next),
            "unload": lambda _: self._load(None, {}),
            "load": lambda o: self._load(program, o),
            "run": self._run,
            "hold": self._hold,
            "stop": lambda _: None if self._free else self._drive.stop(self._next),
            "trip": lambda o: self.trip_by(f"by {o.get('who', 'the operator')}, at {self._last / SAMPLE_RATE:.3f} s"),
            "reset": self._reset,
            "interlock": self._interlock,
        }
        if do not in actions:
            raise ControllerError(f"no order {do!r}")
        actions[do](order)

    def trip_by(self, reason: str) -> None:
        """Stop commanding, and end the program; the first reason stays."""
        if not self.trip and self.pressure == "high":
            if self.platen == "moving":
                self._place = "held"
            self.trip, self._tripped_at = reason, self._last
            self._reference.changed()
            self._drive.take_over(self._now.displacement, self._last)

    def _pressure(self, order: Mapping[str, Any]) -> None:
        to = str(order["to"])
        if to == "high":
            _refuse(bool(self.trip), "the table has tripped; reset it first")
            if self.pressure != "high":
                barrier = self._interlocks.barrier(self._start, np.zeros(6), 0.0)
                _refuse(bool(barrier), barrier)
                self._start_at_place()
                self._place = self._standing
        elif self.pressure == "high" and not self.trip:
            _refuse(not self._free, "a program runs; stop it first")
            _refuse(self._parked is not None and self.platen != "parked", "the platen is not parked; park it first")
        self.pressure = to

    def _lift(self, place: str) -> None:
        self._ready()
        _refuse(self._parked is None, "this table is not parked: it stands in its zero position")
        _refuse(not self._free, "a program runs; stop it first")
        barrier = self._barrier(place)
        _refuse(bool(barrier), barrier)
        self._place, self._lifted = place, False
        self._drive.move_setpoint(self._places[place], self._next)

    def _barrier(self, place: str) -> str:
        """Why interlocks forbid to go from here to a place; empty: they do not, or there is no such place."""
        if self._parked is None:
            return ""
        to, now = self._places[place], self._start
        largest = np.maximum(np.abs(to), np.abs(now))
        return self._interlocks.barrier(largest, self._drive.approach_velocity(to, now), self._margin)

    def _setpoint(self, order: Mapping[str, Any]) -> None:
        self._ready(raised=True)
        self._drive.move_setpoint(_with_axis(self._drive.setpoint, order), self._next)

    def _load(self, program: Program | None, order: Mapping[str, Any]) -> None:
        _refuse(not self._free, "a program runs; stop it first")
        self._drive.load(program, order.get("scale"))
        self._number = 0 if program is None else int(order.get("number", 0))

    def _run(self, order: Mapping[str, Any]) -> None:
        """Run what is loaded, which is to be the choice that the order names if it names one."""
        self._ready(raised=True)
        program = self._drive.program
        if program is None:
            raise ControllerError("no program; choose a wave of the function generator or a motion")
        other = order.get("number", self._number) != self._number
        _refuse(other, f"another program is loaded meanwhile: {program.name}; choose again")
        self._drive.run(self._next)

    def _hold(self, _: Mapping[str, Any]) -> None:
        _refuse(self._free, "nothing runs")
        self._drive.hold(self._next)

    def _reset(self, _: Mapping[str, Any]) -> None:
        _refuse(not self.trip, "nothing has tripped")
        _refuse(self._state == PlantState.TRIPPED, "the plant has stopped; set the pressure off, and start again")
        at = self._interlocks.look(self._now, np.zeros(len(self._command)))
        if at is not None:
            why = self._interlocks.reason(at, self._last / SAMPLE_RATE)
            raise ControllerError(f"still {why}; {self._interlocks.remedy(at, self._margin)}")
        self.trip = ""
        self._start_at_place()
        if self._place != "raised":  # on from here only by another order
            self._place = self._standing
        held = self._place != "raised"
        self._drive.move_setpoint(self._start if held else self._drive.setpoint, self._last)

    def _interlock(self, order: Mapping[str, Any]) -> None:
        at = INTERLOCKS.index(str(order["name"]))
        limit = float(order.get("limit", self._interlocks.limit[at]))
        _refuse(not 0.0 < limit < np.inf, f"a limit of {limit:g}; give a share of capacity above zero")
        self._interlocks.limit[at] = limit
        self._interlocks.on[at] = bool(order.get("on", self._interlocks.on[at]))

    @property
    def _next(self) -> int:
        """First sample whose reference is not computed yet."""
        return max(self._reference.end, self._last + 1)

    @property
    def _drive(self) -> Drive:
        return self._reference.drive

    @property
    def _free(self) -> bool:
        """Whether no program runs."""
        return self._drive.state(self._last).state == "stopped"

    def _ready(self, raised: bool = False) -> None:
        _refuse(self.pressure != "high", "the pressure is not high; raise it first")
        _refuse(bool(self.trip), "the table has tripped; reset it first")
        stands = "held where it stopped" if self._place == "held" else "parked"
        _refuse(raised and self._place != "raised", f"the platen is {stands}; raise it first")

    def _start_at_place(self) -> None:
        """Take the platen over where it is."""
        place = self._start
        self._memory = self._controller.init_at(place, self._now.force)
        self._drive.take_over(place, self._last)
        self._interlocks.begin()
        self._reference.clear()

    @property
    def _start(self) -> Array:
        """Where the free axes of the platen are (6,) [m, rad]."""
        return np.where(np.isfinite(self._speed), self._now.displacement, 0.0)

    @property
    def _standing(self) -> str:
        """Where a platen that is not moved stands: parked, raised, or held where it stopped on the way."""
        if self._near(self._parked):
            return "parked"
        return "raised" if self._place == "raised" else "held"

    def _near(self, height: float | None) -> bool:
        return height is not None and bool(abs(self._now.displacement[2] - height) < self._tolerance)

    @property
    def platen(self) -> str:
        """Whether the platen is parked, raised, moving from one to the other, or held where it stopped."""
        if self.trip:
            return "parked" if self._near(self._parked) else "held"
        if self.pressure != "high" or self._place == "held":
            return self._standing
        settled = self._drive.state(self._last).settled
        if self._place == "parked":
            return "parked" if settled and self._near(self._parked) else "moving"
        self._lifted = self._lifted or settled
        return "raised" if self._lifted else "moving"

    # ------------------------------------------------------------------------------------- samples
    def answer(self, reading: Reading) -> Array | None:
        """Command (n_actuators,) of the sample that has been read; None: it is not commanded."""
        sample = reading.sample
        self._last, self._state, now = sample, reading.state, measured_motion(reading)
        self._now = now
        if reading.state == PlantState.TRIPPED:
            self.trip_by("the plant stopped: an actuator reached the end of its stroke, or the run diverged")
        command = wanted = None
        if self.commanding:
            wanted, k, inputs = self._reference.at(sample)
            if (at := self._interlocks.look(now, self._command)) is not None:
                self.trip_by(self._interlocks.reason(at, sample / SAMPLE_RATE))
                wanted = None
            else:
                command = np.empty(len(self._command))
                step_packed(k, inputs, *reading.sensors, *self._packed, self._memory, self._scratch, command)
                self._command = command
        else:  # to be shown; nothing is commanded that could saturate
            self._interlocks.look(now, np.zeros(len(self._command)))
        self._answered = reading, wanted
        return command

    def prepare(self) -> None:
        """Compute what the next sample needs and can be known before it: to be called between two samples."""
        if self.commanding:
            self._reference.prepare(self._last + 1)

    @property
    def row(self) -> Array:
        """Row of the sample that was answered last (`rows`), filled when it is first read: the command goes first."""
        if self._answered is not None:
            self._fill(*self._answered)
            self._answered = None
        return self._row

    @property
    def status(self) -> Status:
        """State at the last sample."""
        drive, look, platen = self._drive.state(self._last), self._interlocks, self.platen
        moves = not self.commanding or platen == "moving" or not self._free
        return Status(
            self.pressure,
            platen,
            self.trip,
            drive.program,
            drive.state,
            drive.duration,
            tuple(map(float, self._drive.setpoint)),
            tuple(map(float, self._drive.span)),
            self._drive.scale,
            tuple(map(float, look.limit)),
            tuple(map(bool, look.on)),
            tuple(look.where(i) for i in range(len(INTERLOCKS))),
            self._number,
            self._tripped_at,
            tuple(map(float, self._drive.setpoint if self._place == "raised" else self._places["raised"])),
            ("", "") if moves else (self._barrier("raised"), self._barrier("parked")),
        )

    def _fill(self, reading: Reading, wanted: Moved | None) -> None:
        row, places, now = self._row, self._rows.places, self._now
        row[:4] = reading.sample, int(reading.state), self._drive.state(self._last).time, reading.stamp / SECOND
        for name, measured, reference in zip(QUANTITIES, now[:3], wanted or now[:3], strict=True):
            row[places[f"platen_{name}"]], row[places[f"reference_{name}"]] = measured, reference
        row[places["shares"]] = self._interlocks.shares
        row[places["actuator_displacement"]] = reading.sensors.displacement
        row[places["actuator_force"]] = now.force
        row[places["spool_command"]] = self._command
        if reading.pressures is not None:
            for name, values in zip(PRESSURES, reading.pressures, strict=True):
                row[places[name]] = values


def _with_axis(values: Array, order: Mapping[str, Any]) -> Array:
    """Values (6,) with that of the axis that an order changes."""
    changed = values.copy()
    changed[int(order["axis"])] = float(order["value"])
    return changed


def _refuse(wrong: bool, why: str) -> None:
    if wrong:
        raise ControllerError(why)

"""Interlocks: demand over capacity of a driven table, sample by sample, and the limits at which it trips.

Displacement, velocity and acceleration of the platen by axis over the machine's limits; force of each actuator beyond
rest over what remains of its range; moment of all actuators about the level axes, beyond rest, at N over the capacity
along that axis; time during which a spool command is at its limit without a break, over the time stated.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from ..control.controller import Controller
from ..core.arrays import Array
from ..core.compiled import compiled, copy_scaled
from ..core.names import AXES, SAMPLE_RATE
from ..interfaces.link import Reading
from ..machine.parameters import Parameters
from ..mechanics.actuator_forces import axis_capacity, force_range, wrench_at_bearings
from ..mechanics.equilibrium import Equilibrium
from ..mechanics.spatial import from_body, rpy_rate, rpy_to_matrix
from .page_units import in_page_units, place_unit

__all__ = ["INTERLOCKS", "Interlocks", "Measured", "measured_motion"]

INTERLOCKS = ("displacement", "velocity", "acceleration", "force", "overturning", "saturation")
"""Names of the interlocks, in the order of a row's shares."""

_PER = {"displacement": "", "velocity": "/s", "acceleration": "/s^2"}


class Measured(NamedTuple):
    """Motion of the platen at C (6,) each, Euler angles, and force of the actuators (n,), in SI."""

    displacement: Array
    velocity: Array
    acceleration: Array
    force: Array
    numbers: Array  # (18 + n,) all of them

    @classmethod
    def of(cls, numbers: Array) -> Self:
        """Measured by its numbers."""
        return cls(numbers[:6], numbers[6:12], numbers[12:18], numbers[18:], numbers)


def measured_motion(reading: Reading) -> Measured:
    """What sensors and the motion of the interface say of the platen."""
    sensors = reading.sensors
    numbers = np.empty(18 + len(sensors.force))
    _measure(reading.interface, sensors.acceleration, sensors.force, numbers)
    return Measured.of(numbers)


@compiled
def _measure(interface, acceleration, force, out):
    """Fill `Measured.numbers`; the velocity as `instant.motion_at` computes it from pose and twist."""
    frame = np.empty((3, 3))
    rpy_to_matrix(interface[3:6], frame)
    copy_scaled(1.0, interface[:6], out[:6])
    out[6], out[7], out[8] = from_body(frame, interface[6:9])
    out[9], out[10], out[11] = rpy_rate(frame, interface[9:12])
    copy_scaled(1.0, acceleration, out[12:18])
    copy_scaled(1.0, force, out[18:])


@compiled
def _look(now, command, tables, full, longest, run, shares, worst):
    """Fill the shares (6,) and the places (6,) of the largest of a sample: motion (18,) and force (n,) in `now`."""
    per, rest, rise, fall, moment, turn = tables
    for i in range(3):
        shares[i] = -1.0
        for k in range(6):
            share = abs(now[6 * i + k]) * per[i, k]
            if share > shares[i]:
                shares[i], worst[i] = share, k
    n = rest.size
    shares[3] = shares[4] = shares[5] = -1.0
    roll = pitch = 0.0
    for j in range(n):
        beyond = now[18 + j] - rest[j]
        share = beyond * rise[j] if beyond > 0.0 else -beyond * fall[j]
        if share > shares[3]:
            shares[3], worst[3] = share, j
        roll += moment[0, j] * beyond
        pitch += moment[1, j] * beyond
        run[j] = run[j] + 1.0 if abs(command[j]) >= full else 0.0
        if run[j] / longest > shares[5]:
            shares[5], worst[5] = run[j] / longest, j
    for k in range(2):
        total = roll if k == 0 else pitch
        share = total / turn[0, k] if total > 0.0 else -total / turn[1, k]
        if share > shares[4]:
            shares[4], worst[4] = share, k


class Interlocks:
    """Limits of a table that is driven.

    Attributes: limit, share of capacity at which each trips, and on, whether it does; both (6,) as `INTERLOCKS`.
    shares (6,), the largest demand over capacity of the last sample, and where it is.
    """

    def __init__(self, controller: Controller, rest: Equilibrium, numbers: Parameters) -> None:
        """Take the capacities of a plant; raises as `axis_capacity` does."""
        plant = controller.plant
        limits, free = plant.machine.limits, np.isin(np.arange(6), plant.axes)
        stated = np.array([limits.displacement, limits.velocity, limits.acceleration])
        with np.errstate(divide="ignore"):
            per = np.where(free & (stated > 0.0), 1.0 / stated, 0.0)  # (3, 6)
        self._capacity = stated
        span = force_range(plant)
        rise = 1.0 / np.maximum(span.most - rest.force, 1.0)
        fall = 1.0 / np.maximum(rest.force - span.least, 1.0)
        along = axis_capacity(plant)
        at_b = controller.jacobian @ controller.lever  # (n, 6): leg rates per twist at B
        moment = wrench_at_bearings(plant, at_b)[:, 3:5].T  # (2, n) moments at N per force
        turn = np.array([along.rise[3:5], along.fall[3:5]])
        turn[turn == 0.0] = np.inf
        self._tables = per, rest.force, rise, fall, moment, turn
        self._names = plant.machine.actuator_names
        self._spool = controller.settings.spool_limit
        self._longest = numbers.number("interlock.saturation") * SAMPLE_RATE
        self._run = np.zeros(plant.spools)  # samples at the limit
        self.limit = np.full(len(INTERLOCKS), numbers.number("interlock.limit"))
        self.on = np.ones(len(INTERLOCKS), bool)
        self.shares, self._worst = np.zeros(len(INTERLOCKS)), np.zeros(len(INTERLOCKS), int)

    def begin(self) -> None:
        """Forget the commands so far."""
        self._run[:] = 0.0

    def look(self, now: Measured, command: Array) -> int | None:
        """Number of an interlock whose limit is passed, or None; command (n,) is the last one."""
        full, state = self._spool - 1e-9, (self._run, self.shares, self._worst)
        _look(now.numbers, command, self._tables, full, self._longest, *state)
        over = (self.shares > self.limit) & self.on
        return int(over.argmax()) if over.any() else None

    def barrier(self, displacement: Array, velocity: Array, margin: float) -> str:
        """Why an intended motion would trip, and what to do first; empty if it would not.

        Largest magnitudes of the motion by axis (6,) [m, rad] and [m/s, rad/s]; `margin`: share of capacity [1] by
        which what is measured may be beyond them.
        """
        for i, largest in enumerate((displacement, velocity)):
            shares = np.abs(largest) * self._tables[0][i]
            at = int(shares.argmax())
            needed = float(shares[at]) + margin
            if shares[at] == 0.0 or not self.on[i] or self.limit[i] >= needed:
                continue
            name = INTERLOCKS[i]
            unit = place_unit(AXES[at]) + _PER[name]
            return (
                f"{name} of {AXES[at]} would reach {in_page_units(float(abs(largest[at])), unit, 4)}, "
                f"{100.0 * shares[at]:.1f} % of capacity, and the interlock trips at {100.0 * self.limit[i]:g} %; "
                f"{_raised(name, needed)} first"
            )
        return ""

    def remedy(self, i: int, margin: float) -> str:
        """The limit at which an interlock would not trip on the last sample; `margin` as in `barrier`."""
        return _raised(INTERLOCKS[i], float(self.shares[i]) + margin)

    def where(self, i: int) -> str:
        """Axis or actuator of an interlock's largest share."""
        at = int(self._worst[i])
        if i < 3:
            return AXES[at]
        return AXES[3 + at] if INTERLOCKS[i] == "overturning" else self._names[at]

    def reason(self, i: int, time: float) -> str:
        """Why an interlock trips, in words and the units of the page."""
        name, at, share = INTERLOCKS[i], int(self._worst[i]), float(self.shares[i])
        what = f"{name} of {self.where(i)} at {100.0 * share:.1f} % of capacity, limit {100.0 * self.limit[i]:g} %"
        if i < 3:
            unit, bound = place_unit(AXES[at]) + _PER[name], float(self._capacity[i, at])
            value, limit = (in_page_units(x * bound, unit, 4) for x in (share, float(self.limit[i])))
            what = f"{name} of {self.where(i)} {value}, limit {limit}"
        return f"{what}, at {time:.3f} s"


def _raised(name: str, needed: float) -> str:
    """Advice to raise an interlock's limit to a share of capacity."""
    return f"raise the {name} limit to at least {math.ceil(100.0 * needed - 1e-9)} %"

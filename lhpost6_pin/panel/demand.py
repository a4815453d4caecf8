"""Demand of a program over the capacity of a table, before it runs."""

import numpy as np

from ..core.arrays import Array
from ..core.names import AXES, SAMPLE_RATE
from ..core.rounding import rounded_down
from ..mechanics.plant import Plant
from ..motions import Reference, Target
from ..simulation.motion_limits import check_motion_limits
from .page_units import PAGE_UNITS, in_page_units, place_unit
from .programs import Program

__all__ = ["check_program"]

_CYCLES, _LONGEST = 3.0, 60.0
"""Of a wave without an end, so many of its cycles, and at most so long [s]."""


def check_program(plant: Plant, program: Program, gain: Array, setpoint: Array) -> None:
    """Check the motion of a program times `gain` (6,) about a setpoint (6,) at full rate of its clock.

    Raises OutOfRangeError naming the limits that it exceeds, in the units of the page, and what fits: the scale of a
    motion, as of its field, or the spans of a wave. What the page cannot change is no remedy.
    """
    seconds = program.duration or _LONGEST
    frequency = getattr(program, "frequency", None)
    if program.duration is None and frequency:
        seconds = min(_LONGEST, _CYCLES / frequency)
    time = np.arange(int(np.ceil(seconds * SAMPLE_RATE)) + 1) / SAMPLE_RATE
    moved = program.at(time)
    axes = tuple((axis, axis) for axis in AXES)
    scale = 1.0 if program.by_span else float(np.abs(gain).max())
    reference = Reference(program.name, "panel", scale, axes, 0.0, 0.0, 0.0)
    rows = (setpoint + gain * moved.value, gain * moved.rate, gain * moved.acceleration)

    def spans(scale: float) -> str:
        """Largest spans, in their proportion, that a scale leaves of those given."""
        sizes = [
            f"{axis} {in_page_units(rounded_down(abs(scale * g), 3), place_unit(axis))}"
            for axis, g, moving in zip(AXES, gain, np.any(moved.value, axis=0), strict=True)
            if g != 0.0 and moving
        ]
        return f"span{'s' * (len(sizes) > 1)} that would fit: {', '.join(sizes)}"

    size = spans if program.by_span else None
    check_motion_limits(plant, Target(time, *rows, reference), PAGE_UNITS, remedies=False, size=size)

"""What in a finished run is not physical, or near its end: empty chambers, lost contact, strokes at their ends."""

import logging
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.extremes import extremes
from ..machine.components import Actuator
from ..mechanics.plant import Plant
from ..mechanics.pose import leg_displacements, platen_motion
from ..mechanics.strokes import stroke_ends
from .divergence import scheme_divergence
from .simulate import Run

__all__ = ["EmptyChambers", "pressure_trouble", "run_doubts", "with_pressure_trouble"]

log = logging.getLogger(__name__)

_REMEDY = (
    "what follows is not physical: scale the motion down, move the specimen towards the centre, or {more}, which keeps "
    "pressures above that of vapour"
)
_WITHOUT = 'add the effect "cavitation" of the library'
_WITH = 'raise "share" of its effect "cavitation"'


class _Chamber(NamedTuple):
    """A chamber of a plant."""

    actuator: Actuator
    name: str  # A or B
    place: int  # of its pressure among the hidden states
    vapour: float  # pressure at which its oil cavitates [Pa]; 0 without the effect

    @property
    def bears(self) -> bool:
        """Whether its actuator is not held to the platen: it cannot pull."""
        return self.actuator.mount == "bearing"

    def __str__(self) -> str:
        return f"chamber {self.name} of {self.actuator.name}"


class _Low(NamedTuple):
    """A chamber whose pressure fell below a level."""

    chamber: _Chamber
    time: float  # first [s]
    least: float  # [Pa]


def with_pressure_trouble(run: Run, label: str = "") -> Run:
    """The run, with its `pressure_trouble`, which is logged; it stands before trouble that the run has already.

    label: name of the run, with which the warning begins. Pressures of a run that its scheme made diverge say nothing;
    such a run may not have stopped.
    """
    first = None if run.diverged else _first_empty(run)
    if first is None:
        return run
    named = f"{label}: the run" if label else "the run"
    if run.trouble is None and (why := scheme_divergence(run.plant, run.scheme, run.steps_per_second, first.time)):
        log.warning("%s %s", named, why)
        return replace(run, trouble=why, diverged=True)
    trouble = _unphysical(first.chamber, first.time)
    log.warning("%s %s", named, trouble)
    return replace(run, trouble=trouble if run.trouble is None else f"{trouble}; then: {run.trouble}")


def pressure_trouble(run: Run) -> str:
    """From when on and why a run is not physical, as a chamber's pressure fell below zero; empty if none did.

    Oil bears no tension: it cavitates, and a bearing actuator with an empty chamber loses contact with the platen.
    """
    first = _first_empty(run)
    return "" if first is None else _unphysical(first.chamber, first.time)


def _first_empty(run: Run) -> _Low | None:
    """The chamber whose pressure fell below zero first."""
    return min(_lowest(run, 0.0), key=lambda one: one.time, default=None)


class EmptyChambers:
    """The same of a plant that runs sample by sample: its `trouble`, empty until a pressure falls below zero."""

    def __init__(self, plant: Plant) -> None:
        """Watch all chambers of a plant."""
        self.trouble, self._chambers = "", list(_chambers(plant))
        self._places = np.array([chamber.place for chamber in self._chambers], int)

    def look(self, z: Array, time: float) -> bool:
        """Whether hidden states z (n_states,) at a time [s] are the first with an empty chamber."""
        if self.trouble or not (empty := z[self._places] < 0.0).any():
            return False
        self.trouble = _unphysical(self._chambers[int(empty.argmax())], time)
        return True


def _unphysical(chamber: _Chamber, at: float) -> str:
    """Trouble of a chamber that was first empty at a time [s]."""
    name = chamber.actuator.name
    lifts = f", and {name} would lose contact with the platen (uplift)" if chamber.bears else ""
    what = f"became unphysical at {at:.4f} s: {chamber} fell below zero pressure: its oil would cavitate{lifts}"
    return f"{what}; {_REMEDY.format(more=_WITH if chamber.vapour else _WITHOUT)}"


def run_doubts(run: Run, elongation: Array | None = None) -> list[str]:
    """Remarks on a run: chambers below the return pressure, strokes that reached their ends.

    elongation (n, n_actuators): of the actuators in this run [m], where it is known.
    """
    low, found = float(run.plant.supply[1]), []
    for chamber, at, least in _lowest(run, low):
        bound = f"the return pressure of {low / 1e6:.3g} MPa"
        if least < 0.0:
            at, bound = _first_below(run, chamber, 0.0), "zero"
        found.append(f"{chamber} fell to {least / 1e6:.3g} MPa, below {bound}, first at {at:.3f} s")
        if 0.0 <= least < chamber.vapour:
            lifts = f", and {chamber.actuator.name}, which cannot pull, hardly bears on the platen" * chamber.bears
            found[-1] += f"; its oil cavitates below {chamber.vapour / 1e6:.3g} MPa{lifts}"
    if elongation is None:
        legs, _ = leg_displacements(run.plant, platen_motion(run.plant, run.q, run.v, run.a).displacement)
        elongation = legs[:, : run.plant.spools]
    for end in stroke_ends(run.plant, run.time, elongation):
        actuator = next(a for a in run.plant.machine.actuators if a.name == end.actuator)
        bumper = "its elastic bumper, whose numbers are assumed, acts there"
        found.append(f"{end}; {bumper}" if actuator.bumper_travel else str(end))
    return found


def _lowest(run: Run, level: float) -> list[_Low]:
    """Chambers that fell below a level [Pa]."""
    least, found = extremes(run.z).min(axis=0), []
    if np.isnan(least).any():
        least = np.fmin.reduce(run.z, axis=0)
    for chamber in _chambers(run.plant):
        if least[chamber.place] < level:
            found.append(_Low(chamber, _first_below(run, chamber, level), float(least[chamber.place])))
    return found


def _first_below(run: Run, chamber: _Chamber, level: float) -> float:
    """Time [s] at which a chamber first fell below a level [Pa]."""
    return float(run.time[int((run.z[:, chamber.place] < level).argmax())])


def _chambers(plant: Plant) -> Iterator[_Chamber]:
    """All chambers of a plant's actuators."""
    rows, oil = plant.rows[plant.tables.actuators], plant.actuators
    for i, (actuator, row) in enumerate(zip(plant.machine.actuators, rows, strict=True)):
        vapour = float(oil.vapour_pressure[i]) if oil.voids[i] else 0.0
        for k, name in enumerate("AB" if actuator.area_b is not None else "A"):
            yield _Chamber(actuator, name, int(row["state"]) + k, vapour)

"""What in a finished run is not physical, or near its end: empty chambers, lost contact, strokes at their ends."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..core.arrays import Array
from ..machine.components import Actuator
from ..mechanics.plant import Plant
from ..mechanics.pose import platen_motion
from ..mechanics.strokes import stroke_ends
from .simulate import Run

__all__ = ["EmptyChambers", "run_doubts", "with_pressure_trouble"]

REMEDY = (
    "what follows is not physical: scale the motion down, move the specimen towards the centre, or add the effect "
    '"cavitation" of the library, which keeps pressures above that of vapour'
)


def with_pressure_trouble(run: Run) -> Run:
    """The run, with trouble if a chamber's pressure fell below zero: oil bears no tension.

    A bearing actuator with an empty chamber loses contact with the platen. Chambers of an actuator with the effect
    `cavitation` are exempt. A run that has trouble already is returned as it is.
    """
    if run.trouble is not None:
        return run
    found = [(at, name, chamber) for name, chamber, at, _, voids in _lowest(run, 0.0) if not voids]
    return replace(run, trouble=_said(run.plant, *min(found))) if found else run


class EmptyChambers:
    """The same of a plant that runs sample by sample: its `trouble`, empty until a pressure falls below zero."""

    def __init__(self, plant: Plant) -> None:
        """Watch the chambers of a plant whose actuators lack the effect `cavitation`."""
        self.plant, self.trouble = plant, ""
        self._chambers = [(a.name, chamber, place) for a, chamber, place, voids in _chambers(plant) if not voids]
        self._places = np.array([place for _, _, place in self._chambers], int)

    def look(self, z: Array, time: float) -> bool:
        """Whether hidden states z (n_states,) at a time [s] are the first with an empty chamber."""
        if self.trouble or not (empty := z[self._places] < 0.0).any():
            return False
        name, chamber, _ = self._chambers[int(empty.argmax())]
        self.trouble = _said(self.plant, time, name, chamber)
        return True


def _said(plant: Plant, at: float, name: str, chamber: str) -> str:
    actuator = next(a for a in plant.machine.actuators if a.name == name)
    contact = f", and {name} would lose contact with the platen" if actuator.mount == "bearing" else ""
    what = f"became unphysical at {at:.4f} s: chamber {chamber} of {name} fell below zero pressure{contact}"
    return f"{what}; {REMEDY}"


def run_doubts(run: Run) -> list[str]:
    """Remarks on a run: chambers below the return pressure, strokes that reached their ends."""
    low, found = float(run.plant.supply[1]), []
    for name, chamber, at, pressure, _ in _lowest(run, low):
        if pressure >= 0.0:
            found.append(
                f"chamber {chamber} of {name} fell to {pressure / 1e6:.3g} MPa, below the return pressure of "
                f"{low / 1e6:.3g} MPa, first at {at:.3f} s"
            )
    displacement = platen_motion(run.plant, run.q, run.v, run.a).displacement
    for end in stroke_ends(run.plant, run.time, displacement):
        actuator = next(a for a in run.plant.machine.actuators if a.name == end.actuator)
        bumper = "its elastic bumper, whose numbers are assumed, acts there"
        found.append(f"{end}; {bumper}" if actuator.bumper_travel else str(end))
    return found


def _lowest(run: Run, level: float) -> list[tuple[str, str, float, float, bool]]:
    """Chambers that fell below a level: actuator, chamber, first time [s], least pressure [Pa], cavitation modelled."""
    found = []
    for actuator, chamber, place, voids in _chambers(run.plant):
        pressure = run.z[:, place]
        below = pressure < level
        if below.any():
            first, least = float(run.time[int(below.argmax())]), float(np.nanmin(pressure))
            found.append((actuator.name, chamber, first, least, voids))
    return found


def _chambers(plant: Plant) -> Iterator[tuple[Actuator, str, int, bool]]:
    """Chambers: actuator, A or B, place of the pressure among hidden states, and whether cavitation is modelled."""
    rows = plant.rows[plant.tables.actuators]
    for actuator, row, voids in zip(plant.machine.actuators, rows, plant.actuators.voids, strict=True):
        for i, chamber in enumerate("AB" if actuator.area_b is not None else "A"):
            yield actuator, chamber, int(row["state"]) + i, bool(voids)

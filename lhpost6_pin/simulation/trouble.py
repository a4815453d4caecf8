"""What in a finished run is not physical, or near its end: empty chambers, lost contact, strokes at their ends."""

from dataclasses import replace

import numpy as np

from ..mechanics.pose import platen_motion
from ..mechanics.strokes import stroke_ends
from .simulate import Run

__all__ = ["run_doubts", "with_pressure_trouble"]

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
    if not found:
        return run
    at, name, chamber = min(found)
    actuator = next(a for a in run.plant.machine.actuators if a.name == name)
    contact = f", and {name} would lose contact with the platen" if actuator.mount == "bearing" else ""
    what = f"became unphysical at {at:.4f} s: chamber {chamber} of {name} fell below zero pressure{contact}"
    return replace(run, trouble=f"{what}; {REMEDY}")


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
    plant, found = run.plant, []
    for actuator, row, voids in zip(
        plant.machine.actuators, plant.rows[plant.tables.actuators], plant.actuators.voids, strict=True
    ):
        for i, chamber in enumerate("AB" if actuator.area_b is not None else "A"):
            pressure = run.z[:, row["state"] + i]
            below = pressure < level
            if below.any():
                first, least = float(run.time[int(below.argmax())]), float(np.nanmin(pressure))
                found.append((actuator.name, chamber, first, least, bool(voids)))
    return found

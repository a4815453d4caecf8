"""A specimen on the table: remarks before a run, names of its joints, and their excursions."""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from .plant import Plant
from .rigid_body import platen_body

__all__ = ["SpecimenJoint", "joints_beyond", "specimen_doubts", "specimen_joints", "specimen_mass"]
__all__ += ["specimen_positions"]


class SpecimenJoint(NamedTuple):
    """One coordinate of a specimen's free joints."""

    name: str  # of the URDF's joint; with a number where it has several
    unit: str  # "m", "rad", or "1" of a quaternion
    places: tuple[int, ...]  # in the plant's q; cosine and sine where the joint turns without end
    lower: float  # limits of the URDF, infinite where it has none
    upper: float


def specimen_joints(plant: Plant) -> list[SpecimenJoint]:
    """Return the coordinates of the free joints of a plant's specimen, in the order of the plant's q."""
    model, found = plant.model, []
    for index in range(2, model.njoints):  # 0 is the world, 1 the platen
        name, first, size = str(model.names[index]), int(model.idx_qs[index]), int(model.nqs[index])
        kind = str(model.joints[index].shortname())
        if model.nvs[index] == 1:
            low, high = -np.inf, np.inf
            if size == 1:
                low, high = (float(x[first]) for x in (model.lowerPositionLimit, model.upperPositionLimit))
            unit = "m" if kind.startswith("JointModelP") else "rad"
            found.append(SpecimenJoint(name, unit, tuple(range(first, first + size)), low, high))
        else:  # planar or floating
            units = ("m", "m", "m", "1", "1", "1", "1") if size == 7 else ("m", "m", "1", "1")
            for k, unit in enumerate(units):
                found.append(SpecimenJoint(f"{name}[{k}]", unit, (first + k,), -np.inf, np.inf))
    return found


def specimen_positions(plant: Plant, q: Array) -> Array:
    """Return positions (n, joints) [m or rad] of `specimen_joints` at configurations (n, nq); angles do not wrap."""
    columns = []
    for joint in specimen_joints(plant):
        part = q[:, list(joint.places)]
        columns.append(part[:, 0] if len(joint.places) == 1 else np.unwrap(np.arctan2(part[:, 1], part[:, 0])))
    return np.column_stack(columns) if columns else np.zeros((len(q), 0))


def specimen_doubts(plant: Plant) -> list[str]:
    """Remarks on a specimen: its weight, its place, and what its URDF has that is not simulated."""
    machine, model = plant.machine, plant.model
    specimen = machine.specimen
    if specimen is None:
        return []
    found = []
    weight = specimen_mass(plant) * machine.platen.gravity
    if "table_2_2.payload" in machine.parameters:
        most = machine.parameters.number("table_2_2.payload")
        if weight > most:
            found.append(f"{specimen.name} weighs {weight / 1e6:.3g} MN, more than the payload of {most / 1e6:.3g} MN")
    across = zip(specimen.position[:2], machine.platen.size[:2], strict=True)
    if any(abs(x) > 0.5 * size for x, size in across):
        at = ", ".join(f"{x:g}" for x in specimen.position)
        size = " by ".join(f"{x:g}" for x in machine.platen.size[:2])
        found.append(f"{specimen.name} stands at {at} m, beside the platen, which is {size} m about C")
    ends = zip(model.names, model.idx_vs, model.nvs, strict=True)
    if rubbing := [name for name, at, size in list(ends)[2:] if np.any(model.friction[at : at + size])]:
        names = ", ".join(map(str, rubbing))
        found.append(f"{specimen.name}: friction of {names} is in its URDF and not simulated; only damping is")
    return found


def joints_beyond(plant: Plant, time: Array, q: Array) -> list[str]:
    """Return which joints passed the limits of their URDF, how far and when, in a run: time (n,) [s], q (n, nq)."""
    found, positions = [], specimen_positions(plant, q)
    for joint, x in zip(specimen_joints(plant), positions.T, strict=True):
        past = np.maximum(x - joint.upper, joint.lower - x)
        k = int(np.argmax(past))
        if past[k] > 0.0:
            span = f"{joint.lower:.3g} to {joint.upper:.3g} {joint.unit}"
            where = f"{x[k]:.3g} {joint.unit} at {time[k]:.2f} s"
            found.append(
                f"specimen joint {joint.name} went to {where}, beyond {span}; a URDF's limits are no stops here"
            )
    return found


def specimen_mass(plant: Plant) -> float:
    """Mass of the specimen [kg]: what the model has beyond the bare table's, and the weight of a coupled one."""
    own = float(sum(i.mass for i in plant.model.inertias)) - float(platen_body(plant.machine)[0].mass)
    return own - float(plant.rest_external[2]) / plant.machine.platen.gravity

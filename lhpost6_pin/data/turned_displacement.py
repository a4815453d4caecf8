"""Axes of the measured displacement of the platen that are turned: several other channels contradict the one.

Witnesses of an axis are velocity and acceleration of the platen, the lengths of the actuators and their forces; each
agrees with the displacement, contradicts it, or tells nothing. All lengths together are one witness, and so are all
forces: a convention turns them all at once. The displacement is called turned where at least two contradict it and none
agrees. The record with that axis turned back is what other checks then judge: what follows from it is not a finding.
"""

from collections.abc import Collection, Iterator, Sequence

import numpy as np
import xarray as xr

from ..core.names import AXES
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..mechanics.plant import make_plant
from ..mechanics.pose import kinematic_jacobian, leg_displacements
from .channels import MOTION
from .layout_faults import RecordFinding
from .motion_pairs import motion_gains
from .rests import rest_numbers
from .turned_signs import TURN_IT, turned_signs

__all__ = ["turned_displacement"]

_DISPLACEMENT, _LENGTHS = MOTION[0], "actuator_displacement"

_Verdict = tuple[bool, str]  # whether a witness agrees with the displacement, and its channels


def turned_displacement(record: xr.Dataset, machine: Machine | None) -> tuple[list[RecordFinding], xr.Dataset]:
    """An error for every turned axis of `platen_displacement`, and the record with these turned back.

    Without a `machine` only velocity and acceleration are heard. The record, of sound layout, stays as it is.
    """
    if _DISPLACEMENT not in record:
        return [], record
    numbers, heard = rest_numbers(), dict[int, list[_Verdict]]()
    for k, verdict in (*_rates(record), *_lengths(record, machine, numbers)):
        heard.setdefault(k, []).append(verdict)
    against = [k for k, verdicts in sorted(heard.items()) if not any(agrees for agrees, _ in verdicts)]
    if machine is not None and against:
        for k in against:
            heard[k] += _forces(record, machine, k, [other for other in against if other != k])
    least = numbers.number("displacement.witnesses")
    turned = {
        k: [channels for _, channels in heard[k]]
        for k in against
        if len(heard[k]) >= least and not any(agrees for agrees, _ in heard[k])
    }
    findings = [
        RecordFinding("error", f"{_DISPLACEMENT}[{AXES[k]}]", None, f"is turned against {', '.join(names)}", TURN_IT)
        for k, names in turned.items()
    ]
    return findings, _turned_back(record, turned)


def _turned_back(record: xr.Dataset, axes: Collection[int]) -> xr.Dataset:
    """The record with the sign of these axes of the displacement exchanged."""
    if not axes:
        return record
    sign = np.where(np.isin(np.arange(len(AXES)), list(axes)), -1.0, 1.0)
    return record.assign({_DISPLACEMENT: record[_DISPLACEMENT].copy(data=record[_DISPLACEMENT].values * sign)})


def _rates(record: xr.Dataset) -> Iterator[tuple[int, _Verdict]]:
    """Axis and verdict of velocity and acceleration, where coherent with the derivative of displacement."""
    own = tuple((k, k) for k in range(len(AXES)))
    for order in (1, 2):
        for (k, _), gain in motion_gains(record, 0, order, own).items():
            if gain is not None:
                yield k, (gain > 0.0, f"{MOTION[order]}[{AXES[k]}]")


def _lengths(record: xr.Dataset, machine: Machine | None, numbers: Parameters) -> Iterator[tuple[int, _Verdict]]:
    """Axis and verdict of the lengths, regressed on what each axis of the displacement contributes to them."""
    if machine is None or _LENGTHS not in record:
        return
    plant = make_plant(machine)
    rows, pose, lengths = kinematic_jacobian(plant), record[_DISPLACEMENT].values, record[_LENGTHS].values
    curved = leg_displacements(plant, pose)[0][:, : plant.spools] - pose @ rows.T
    pose, lengths = (x - x.mean(axis=0) for x in (pose, lengths - curved))
    both, cross = pose.T @ pose, np.einsum("tk,ti,ik->k", pose, lengths, rows, optimize=True)
    moved = [k for k in range(len(AXES)) if both[k, k] > 0.0]
    normal, whole = ((rows.T @ rows) * both)[np.ix_(moved, moved)], float(np.sum(lengths**2))
    gains, left = _fit(normal, cross[moved], whole)
    tolerance, share = numbers.number("displacement.gain"), numbers.number("displacement.explained")
    for n, k in enumerate(moved):
        rest = [m for m in range(len(moved)) if m != n]
        without = _fit(normal[np.ix_(rest, rest)], cross[moved][rest], whole)[1]
        if without - left >= share * without > 0.0 and abs(abs(gains[n]) - 1.0) <= tolerance:
            acts = np.abs(rows[:, k]) >= 0.5 * np.abs(rows[:, k]).max()
            names = ", ".join(np.array(machine.actuator_names)[acts])
            yield k, (gains[n] > 0.0, f"{_LENGTHS}[{names}]")


def _fit(normal: np.ndarray, cross: np.ndarray, whole: float) -> tuple[np.ndarray, float]:
    """Least squares from the normal matrix (p, p): coefficients (p,), and the squares left of the `whole`."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    found = scale * (np.linalg.pinv(scale[:, None] * normal * scale) @ (scale * cross))
    return found, max(whole - float(found @ cross), 0.0)


def _forces(record: xr.Dataset, machine: Machine, axis: int, others: Sequence[int]) -> Iterator[_Verdict]:
    """Verdict of the forces: of those that oppose the motion by one sign of `axis` only; `others` are turned back."""
    back = _turned_back(record, others)
    as_it_is, turned = (
        {finding.channel for finding in turned_signs(one, machine)} for one in (back, _turned_back(back, [axis]))
    )
    if as_it_is > turned or turned > as_it_is:
        yield turned > as_it_is, _together(as_it_is ^ turned)


def _together(channels: Collection[str]) -> str:
    """Channels by variable, as in `actuator_force[H1, H2]`."""
    labels: dict[str, list[str]] = {}
    for channel in sorted(channels):
        name, _, label = channel.rstrip("]").partition("[")
        labels.setdefault(name, []).append(label)
    return ", ".join(f"{name}[{', '.join(each)}]" for name, each in labels.items())

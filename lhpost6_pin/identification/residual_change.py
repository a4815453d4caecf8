"""Change of residuals with a plant or a test: only the equations are evaluated in which something differs.

A derivative by differences changes one law of fifty, or one sensor. The wrench is linear in forces, so its change is
that of the rows of the effect table that differ; flows are those of the actuators that differ. Where more than that
differs, the residuals are evaluated anew and subtracted. Both agree to rounding (tests/test_residual_change.py).
"""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array, Mask
from ..effects.registry import actuator_rows
from ..laws.supply import varies
from ..mechanics.plant import Plant, RowKey
from ..mechanics.required_wrench import floor_wrench
from .prepare import MeasuredTest, actuator_forces
from .residual_kernels import wrench_residual
from .residuals import RESIDUALS, Path, Residuals, evaluate_residuals, oil_balance

__all__ = ["Evaluated", "change_of"]


class Evaluated(NamedTuple):
    """Residuals of a test with a plant, and the path of its motion."""

    plant: Plant
    test: MeasuredTest
    path: Path
    residuals: Residuals


def change_of(
    before: Evaluated, plant: Plant, test: MeasuredTest, path: Path, only: tuple[str, ...] = RESIDUALS
) -> Residuals:
    """Residuals with another plant or sensors less those `before`; those not in `only`, or not there, have no columns.

    path is that of `follow` for this plant and test.
    """
    found = dict.fromkeys(RESIDUALS, np.zeros((test.samples, 0)))
    fully = {kind for kind in only if getattr(before.residuals, kind).shape[1]}
    if path.ports is before.path.ports:
        if "wrench" in fully and (wrench := _wrench(before, plant, test, path)) is not None:
            found["wrench"] = wrench
        if "flow" in fully and (flow := _flow(before, plant, test, path)) is not None:
            found["flow"] = flow
    if "servo" in fully and (servo := _servo(before, plant, test)) is not None:
        found["servo"] = servo
    fully -= {kind for kind, change in found.items() if change.shape[1]}
    if fully:
        after = evaluate_residuals(plant, test, tuple(fully), path=path)
        found |= {kind: getattr(after, kind) - getattr(before.residuals, kind) for kind in fully}
    return Residuals(**found)


def _wrench(before: Evaluated, plant: Plant, test: MeasuredTest, path: Path) -> Array | None:
    """Change of the wrench residual (n, 6); None where friction under load makes it nonlinear in forces."""
    if plant.feels_load or before.plant.feels_load:
        return None
    force, was = (actuator_forces(p.machine, t.channels) for p, t in ((plant, test), (before.plant, before.test)))
    if force is None or was is None:
        return None
    required = np.zeros_like(path.required)
    if path.required is not before.path.required:
        required = path.required - before.path.required
    if "floor_acceleration" in test.channels:
        required = required + floor_wrench(plant, test.channels["floor_acceleration"])
        required -= floor_wrench(before.plant, before.test.channels["floor_acceleration"])
    own, old = (p.rows["spool"] < 0 for p in (plant, before.plant))
    more, less = own & _without(plant.keys, before.plant.keys), old & _without(before.plant.keys, plant.keys)
    out = wrench_residual(plant, path.ports, required, path.z, force - was, plant.rows[more])
    if less.any():
        nothing = np.zeros_like(required), before.path.z, np.zeros_like(force), before.plant.rows[less]
        out -= wrench_residual(before.plant, before.path.ports, *nothing)
    return out


def _servo(before: Evaluated, plant: Plant, test: MeasuredTest) -> Array | None:
    """Change of the servo residual (n, n_actuators); None where commands or their way to the spools differ."""
    commands = test.channels["spool_command"], before.test.channels["spool_command"]
    if commands[0] is not commands[1] or not np.array_equal(plant.command_path, before.plant.command_path):
        return None
    return test.channels["spool_position"] - before.test.channels["spool_position"]


def _without(keys: Sequence[RowKey], known: Sequence[RowKey]) -> Mask:
    """Which keys are not among those known, each of which accounts for one."""
    there, out = Counter(known), np.ones(len(keys), bool)
    for i, key in enumerate(keys):
        if there[key] > 0:
            there[key] -= 1
            out[i] = False
    return out


def _flow(before: Evaluated, plant: Plant, test: MeasuredTest, path: Path) -> Array | None:
    """Change of the flow residual (n, n_chambers) of the actuators that differ; None where more than they does."""
    own, old = (actuator_rows(p.rows) for p in (plant, before.plant))
    alone = "chamber_pressure_a" in test.channels and "spool_position" in test.channels
    if not alone or varies(plant.supply) or plant.supply != before.plant.supply or len(own) != len(old):
        return None
    pairs = list(zip(own.tolist(), old.tolist(), strict=True))
    changed = np.array([plant.keys[i] != before.plant.keys[j] for i, j in pairs])
    changed |= plant.rows["modified"][own] != before.plant.rows["modified"][old]
    double = np.isin(plant.machine.actuator_names, plant.machine.double_acting)
    for name in ("chamber_pressure_a", "chamber_pressure_b", "spool_position"):
        of = double if name == "chamber_pressure_b" else np.ones_like(double)
        for some, was in ((test.channels, before.test.channels), (test.rates, before.test.rates)):
            if name in some and some[name] is not was[name]:
                changed[of] |= (some[name] != was[name]).any(axis=0)
    if not changed.any():
        return np.zeros_like(before.residuals.flow)
    balance = oil_balance(plant, test, path, some=changed)
    assert balance is not None
    used = balance.chamber[changed].ravel()
    columns = np.isin(np.arange(balance.flow.shape[1]), used[used >= 0])
    return np.where(columns, balance.flow - before.residuals.flow, 0.0)

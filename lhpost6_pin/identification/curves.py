"""The curves of friction and of valves along a measured test: measured, and by the model at the same instants.

Friction is what the measured balance of forces leaves beside inertia, weight, struts and actuators of the model, which
is the model's friction plus its residual; the flow of a valve is that which the measured motion and pressures take, the
model's plus its residual. Both come from the residuals' own equations (`residuals`): there are no others here.
"""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.names import AXES
from ..effects.registry import law_of
from ..mechanics.plant import Plant
from .inverse_dynamics import with_loads
from .prepare import MeasuredTest, actuator_forces
from .residual_kernels import row_wrenches
from .residuals import OilBalance, Path, Residuals, oil_balance

__all__ = ["FrictionCurve", "ValveCurve", "friction_curves", "valve_curves"]

MOVES = 0.1
"""Peak velocity of a direction over that of the fastest from which its friction is shown."""

LEAST_DROP = 0.05
"""Share of half the supply pressure below which a pressure drop tells nothing of a valve's opening."""


class FrictionCurve(NamedTuple):
    """Friction along one direction, n samples; positive against a positive velocity."""

    displacement: Array  # (n,) [m]
    velocity: Array  # (n,) [m/s]
    measured: Array  # (n,) [N]
    modelled: Array  # (n,) [N]


class ValveCurve(NamedTuple):
    """Flow of one actuator's valve, n samples, as the velocity that it gives an actuator without load."""

    spool: Array  # (n,) position, or command after the valve's delay and lag [1]
    measured: Array  # (n,) [m/s]
    modelled: Array  # (n,) [m/s]


def friction_curves(plant: Plant, test: MeasuredTest, path: Path, residuals: Residuals) -> dict[str, FrictionCurve]:
    """Friction along each direction, x, y, z, in which a test moves; none where no forces were measured.

    Without the samples at which noise hides the direction of slip (`friction_march`).
    """
    force = actuator_forces(plant.machine, test.channels)
    axes = plant.axes[plant.axes < 3]
    if force is None or not residuals.wrench.shape[1] or not axes.size:
        return {}
    kinds = (law_of(row) for row in plant.rows)
    dry = [not (law.takes_spool or law.acts_on_gas or law.follows_motion) for law in kinds]
    z = with_loads(plant, path.ports, path.required, path.z, force)
    modelled = -row_wrenches(plant, path.ports, z, plant.rows[dry]).sum(axis=1)
    measured = modelled - residuals.wrench
    known = slice(None) if test.weight is None else test.weight > 0.5
    peak = np.abs(test.motion.velocity[:, axes]).max(axis=0)
    shown = axes[peak >= MOVES * peak.max()]
    columns = (test.motion.displacement, test.motion.velocity, measured, modelled)
    return {AXES[k]: FrictionCurve(*(x[known, k] for x in columns)) for k in shown}


def valve_curves(plant: Plant, test: MeasuredTest, path: Path) -> dict[str, ValveCurve]:
    """Flow of every actuator's valve; none where pressures, or both spools and commands, were not measured.

    Flow into each chamber over its area, at a pressure drop of half the supply's in place of the one at that instant;
    of two chambers half the difference. Without the samples whose pressure drop is near zero.
    """
    oil = oil_balance(plant, test, path)
    if oil is None:
        return {}
    low = plant.machine.hydraulics.return_pressure
    found = {}
    for i, actuator in enumerate(plant.machine.actuators):
        ends = ((oil.chamber[i, 0], actuator.area_a), (oil.chamber[i, 1], -(actuator.area_b or 0.0)))
        sides = [_unloaded(oil, column, low) / area for column, area in ends if column >= 0]
        measured, modelled = np.mean(sides, axis=0)
        known = np.isfinite(measured) & np.isfinite(modelled)
        found[actuator.name] = ValveCurve(oil.spool[known, i], measured[known], modelled[known])
    return found


def _unloaded(oil: OilBalance, column: int, low: float) -> Array:
    """Flow into a chamber (2, n) [m3/s], measured and modelled, at a drop of half the supply's pressure.

    low is the return pressure [Pa]. Not-a-number where hardly any pressure drives the flow.
    """
    half, pressure = 0.5 * (oil.supply - low), oil.pressure[:, column]
    modelled = oil.valve[:, column]
    flow = np.stack([modelled + oil.flow[:, column], modelled])
    share = np.where(flow > 0.0, oil.supply - pressure, pressure - low) / half
    return np.asarray(flow / np.sqrt(np.where(share > LEAST_DROP, share, np.nan)))

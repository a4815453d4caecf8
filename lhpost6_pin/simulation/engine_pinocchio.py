"""The per-step engine: compiled stages around pin.aba and pin.integrate; the default, and the fused engine's oracle.

Joints of a specimen are part of the same model and the same ABA. Moving parts of the legs as bodies are a second model
(`leg_model`), chosen once a run.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from ..core.arrays import Array
from ..core.compiled import INTEGER, MATRIX, SCALAR, VECTOR, compiled_inline, entry_point
from ..core.names import SCHEMES
from ..mechanics.derivatives import rates_at
from ..mechanics.leg_model import Dynamics, make_dynamics
from ..mechanics.plant import Plant
from ..mechanics.schemes import DQ, TAU, V_SEEN, A, V, dexp_inverse, kick, open_step, staggered_stage
from ..mechanics.tables import unpack_tables
from ..mechanics.workspace import Workspace, unpack_workspace

__all__ = ["STAGGERED_TYPES", "Stepper", "make_stepper", "staggered_packed"]

Stepper = Callable[[Workspace, Array], int]
"""Advance a workspace over the model steps of one controller sample, spool (n_steps, nu); returns the stage status."""

_SLOW = 1e-3
"""Decay of a joint's velocity over a step below which a series gives theta to rounding."""


def make_stepper(plant: Plant, scheme: str, dt: float, forward: Dynamics | None = None) -> Stepper:
    """Stepper of a scheme for steps of dt [s]; requires `evaluate_derivatives` on the workspace beforehand.

    forward: accelerations of q, v and torque, in place of the plant's `make_dynamics`.
    """
    if scheme == SCHEMES[0]:
        return _semi_implicit(plant, dt, forward)
    kinds = {"euler": _euler, "rk4": _rk4}
    return kinds[scheme](plant, dt, forward or make_dynamics(plant))


@compiled_inline
def staggered_packed(q, dt, packed, buffer, window, step):  # type: ignore[no-untyped-def]
    """`staggered_stage` of a step of a sample with tables, workspace and spools packed, which are cheaper to pass."""
    return staggered_stage(q, dt, unpack_tables(packed), unpack_workspace(buffer), window[step])


STAGGERED_TYPES = VECTOR, SCALAR, VECTOR, VECTOR, MATRIX, INTEGER
"""Types of the arguments of `staggered_packed`."""


def _semi_implicit(plant: Plant, dt: float, forward: Dynamics | None) -> Stepper:
    model, packed, integrate = plant.model, plant.tables.packed, pin.integrate
    seen, armature = _joint_drag(plant, dt)
    damped = forward is None and bool(seen.any())
    accelerate = forward or make_dynamics(plant, armature if damped else None)
    staggered = entry_point(staggered_packed, STAGGERED_TYPES)
    close = kick if forward else entry_point(kick, (MATRIX, VECTOR, SCALAR))
    start = entry_point(open_step, (MATRIX, SCALAR))

    def advance(ws: Workspace, spool: Array) -> int:
        motion, buffer = ws.motion, ws.buffer
        dq, v_seen, tau = motion[DQ], motion[V_SEEN], motion[TAU]
        start(motion, dt)  # no change after a kick
        q, status = ws.q, 0
        for step in range(len(spool)):
            q = integrate(model, q, dq)
            status = staggered(q, dt, packed, buffer, spool, step)
            if status:
                break
            close(motion, accelerate(q, v_seen, tau + seen * motion[A] if damped else tau), dt)
        ws.q[:] = q
        return status

    return advance


def _joint_drag(plant: Plant, dt: float) -> tuple[Array, Array]:
    """Damping D of a specimen's joints made implicit, which is stable at any step: dt/2 D, and an armature (nv,).

    The stage's torque has -D (V_MID + dt/2 A) with the last A; wanted is M a = tau - D (V_MID + theta dt a). theta is
    exponentially fitted: 1/2 for a slow decay, 1 for one far faster than the step, exact for a joint alone.
    """
    model, damping = plant.model, plant.tables.damping
    data = model.createData()
    decay = dt * damping * np.diag(pin.computeMinverse(model, data, pin.neutral(model)))
    fast = np.maximum(decay, _SLOW)
    theta = np.where(decay < _SLOW, 0.5 + decay / 12.0, -1.0 / np.expm1(-fast) - 1.0 / fast)
    return 0.5 * dt * damping, theta * dt * damping


def _euler(plant: Plant, dt: float, accelerate: Dynamics) -> Stepper:
    model = plant.model

    def advance(ws: Workspace, spool: Array) -> int:
        motion, z = ws.motion, ws.z
        for held in spool:
            motion[V_SEEN] = motion[V]
            status = rates_at(plant, ws, ws.q, ws.z, held)
            if status:
                return status
            motion[A] = accelerate(ws.q, motion[V], motion[TAU])
            ws.q[:] = pin.integrate(model, ws.q, dt * motion[V])
            motion[V] += dt * motion[A]
            z += dt * ws.zd
        return 0

    return advance


def _local_rate(model: Any, n_platen: int, q0: Array, q: Array, moved: Array, v: Array) -> Array:
    """Rate of the local coordinates `moved` from q0 to q at the velocity v.

    The platen's six by `dexp_inverse`: pin.dDifference loses eight digits at steps of 1e-4 to 5e-3 rad (4.1.0).
    """
    out = v.copy()
    if n_platen == 6:
        dexp_inverse(moved[:6], v[:6], out[:6])
    if v.size > n_platen:
        out[n_platen:] = (pin.dDifference(model, q0, q, pin.ArgumentPosition.ARG1) @ v)[n_platen:]
    return out


def _rk4(plant: Plant, dt: float, accelerate: Dynamics) -> Stepper:
    model, n_platen = plant.model, plant.axes.size

    def advance(ws: Workspace, spool: Array) -> int:
        motion, q0 = ws.motion, ws.q
        for held in spool:
            v0, z0 = motion[V].copy(), ws.z.copy()
            sums = [np.zeros_like(v0), np.zeros_like(v0), np.zeros_like(z0)]
            step, dv, dz = np.zeros_like(v0), np.zeros_like(v0), np.zeros_like(z0)
            for reach, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
                q = pin.integrate(model, q0, reach * dt * step)
                v, z = v0 + reach * dt * dv, z0 + reach * dt * dz
                motion[V_SEEN] = v
                status = rates_at(plant, ws, q, z, held)
                if status:
                    return status
                step = _local_rate(model, n_platen, q0, q, reach * dt * step, v)
                dv, dz = accelerate(q, v, motion[TAU]), ws.zd
                if reach == 0.0:
                    motion[A] = dv
                for total, rate in zip(sums, (step, dv, dz), strict=True):
                    total += weight / 6.0 * rate
                dz = dz.copy()
            q0[:] = pin.integrate(model, q0, dt * sums[0])
            motion[V] = v0 + dt * sums[1]
            ws.z[:] = z0 + dt * sums[2]
        return 0

    return advance

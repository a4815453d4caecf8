"""The plant linearised about a state, and its oil-column modes."""

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from ..core.arrays import Array
from ..core.names import AXES
from ..machine.machine import Machine
from .derivatives import evaluate_derivatives
from .equilibrium import find_equilibrium
from .plant import Plant, State, make_plant
from .schemes import A, V
from .workspace import make_workspace

__all__ = ["SPOOL_STEP", "LinearPlant", "OilColumnMode", "linearize", "oil_column_modes"]

# Finite-difference steps: small against every scale of the machine, large against rounding.
_POSE_STEP, _VELOCITY_STEP, _PRESSURE_STEP, SPOOL_STEP = 1e-6, 1e-6, 1e2, 1e-6
_MOVES = 0.1  # of the axis that moves most in a mode, from which on another moves, too
_MODE_STEP = 1e-2  # of modal states, in which the plant is linear


@dataclass(frozen=True)
class LinearPlant:
    """dx/dt = A x + B u about a state; x = (local pose (nv), velocity (nv), hidden states), u the spools."""

    A: Array
    B: Array
    nv: int


@dataclass(frozen=True)
class OilColumnMode:
    """An oscillation: frequency [Hz], damping ratio [1], the platen axis that moves most at C, and all that move."""

    frequency: float
    damping: float
    axis: str
    axes: tuple[str, ...]  # that move by a tenth of it or more, turns over half the platen's diagonal


def linearize(plant: Plant, state: State, spool: Array) -> LinearPlant:
    """Continuous-time Jacobians of a plant by central differences, at rest (v = 0) or nearly so."""
    nv, nz, nu = plant.model.nv, len(plant.states), plant.spools
    ws = make_workspace(plant, state)
    pressure = np.array(["pressure" in name for name in plant.states])
    size = np.concatenate(
        [np.full(nv, _POSE_STEP), np.full(nv, _VELOCITY_STEP), np.where(pressure, _PRESSURE_STEP, _POSE_STEP)]
    )
    if plant.modes.size:
        size[-2 * plant.modes.size :] = _MODE_STEP

    def rates(x: Array, u: Array) -> Array:
        ws.q[:] = pin.integrate(plant.model, state.q, x[:nv])
        ws.motion[V] = state.v + x[nv : 2 * nv]
        ws.z[:] = state.z + x[2 * nv :]
        evaluate_derivatives(plant, ws, u)
        return np.concatenate([ws.motion[V], ws.motion[A], ws.zd])

    n = 2 * nv + nz
    a, b = np.zeros((n, n)), np.zeros((n, nu))
    for k in range(n):
        step = np.zeros(n)
        step[k] = size[k]
        a[:, k] = (rates(step, spool) - rates(-step, spool)) / (2.0 * size[k])
    for k in range(nu):
        step = np.zeros(nu)
        step[k] = SPOOL_STEP
        b[:, k] = (rates(np.zeros(n), spool + step) - rates(np.zeros(n), spool - step)) / (2.0 * SPOOL_STEP)
    return LinearPlant(a, b, nv)


def oil_column_modes(machine: Machine, *, undamped: bool = True, loaded: bool = False) -> tuple[OilColumnMode, ...]:
    """Modes of the platen on its oil columns in the control zero-position, slowest first, valves closed.

    undamped leaves out leakage, friction and viscous damping. A specimen is left off, or `loaded` as one rigid body.
    """
    specimen = replace(machine.specimen, locked=True) if loaded and machine.specimen else None
    bare = replace(machine, specimen=specimen)
    if undamped:
        kinds = {c.kind for c in machine.components}
        names = ("leakage", "viscous", "seal_friction", "pad_friction")
        bare = bare.with_params({f"{k}.{n}": 0.0 for k in kinds for n in names if f"{k}.{n}" in machine.parameters})
    plant = make_plant(bare)
    rest = find_equilibrium(plant)
    linear = linearize(plant, rest.state, rest.spool)
    values, vectors = np.linalg.eig(linear.A)
    rho = plant.body[0]["rho_c"]
    lengths = np.linalg.norm([machine.platen.size])  # makes turns comparable with displacements
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag < 1.0:
            continue
        twist = np.zeros(6, complex)
        twist[plant.axes] = vector[: linear.nv]
        at_c = np.concatenate([twist[:3] + np.cross(twist[3:], rho), twist[3:] * lengths / 2.0])
        size, moved = abs(value), np.abs(at_c)
        axes = tuple(axis for axis, x in zip(AXES, moved, strict=True) if x >= _MOVES * moved.max())
        most = AXES[int(np.argmax(moved))]
        found.append(OilColumnMode(float(size / (2 * np.pi)), float(-value.real / size), most, axes))
    return tuple(sorted(found, key=lambda m: m.frequency))

"""Fixed-base modes of a specimen on the platen (Craig-Bampton), coupled exactly through conjugate momenta.

A mode with circular frequency w, damping d = 2 zeta w and participation G (6,) of the platen's twist nu at B (linear
first, platen axes; mass-normalised) has the relative coordinate eta and the momentum p = eta' + G nu:

    eta' = p - G nu
    p'   = -w^2 eta - d eta' + G_lin g_b                                   g_b gravity in platen axes
    (M - sum G G^T) nu' = tau - bias + sum G (w^2 eta + d eta' - G_lin g_b) + (0, (sum G_lin eta) x g_b)

M is the mass of platen and specimen as one rigid body. Reactions depend on states alone, so that the coupling is exact
and stable at any ratio of masses. Energy: (p^2 + w^2 eta^2) / 2 - eta G_lin g_b a mode, with (M - sum G G^T) of the
platen; dissipation eta' D eta'. Gyroscopic forces of the motion relative to the platen and the change of the inertia
with eta are neglected: the platen turns by little. Damping that couples modes is a full matrix D in place of d.
Source: Craig and Bampton, AIAA Journal 6 (1968) 1313, with the momentum as state.

Modal states are the last 2 n of the plant's hidden states: all eta [m sqrt(kg)], then all p.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.arrays import Array
from ..core.compiled import compiled, compiled_inline
from ..machine.specimen_forms import Modes

__all__ = ["MODE", "ModalMotion", "add_modal_wrench", "advance_modes", "modal_motion", "modal_rates", "modal_states"]
__all__ += ["fastest_mode", "modal_tables", "rest_of_modes"]

MODE = np.dtype(
    [
        ("stiffness", np.float64),  # w^2 [1/s2]
        ("damping", np.float64),  # diagonal of D [1/s]
        ("participation", np.float64, (6,)),  # G of the twist at B in platen axes, linear first [sqrt(kg), sqrt(kg) m]
    ]
)

_SWEEPS = 2
"""Jacobi sweeps for damping that couples modes; their error, (d dt / 2)^3, is below that of the scheme."""


def modal_tables(modes: Modes | None, participation: Array) -> tuple[NDArray[np.void], Array]:
    """Table of modes, and what of the damping couples them (n * n,), empty if nothing does; participation at B."""
    if modes is None:
        return np.zeros(0, MODE), np.zeros(0)
    table = np.zeros(len(modes.frequency), MODE)
    table["stiffness"], table["damping"] = modes.frequency**2, np.diag(modes.damping)
    table["participation"] = participation
    coupling = modes.damping - np.diag(np.diag(modes.damping))
    return table, coupling.ravel() if coupling.any() else np.zeros(0)


def fastest_mode(modes: NDArray[np.void], inverse: Array) -> float:
    """Highest circular frequency [rad/s] of modes on the free platen, whose reduced inverse mass is (6, 6); 0 if none.

    Coupled to the platen alone, w^2 becomes the eigenvalues of W (1 + G M_r^-1 G^T) W.
    """
    if not modes.size:
        return 0.0
    w, part = np.sqrt(modes["stiffness"]), modes["participation"]
    coupled = w[:, None] * (np.eye(len(w)) + part @ inverse @ part.T) * w
    return float(np.sqrt(np.linalg.eigvalsh(coupled)[-1]))


def modal_states(count: int) -> tuple[str, ...]:
    """Names of the modal states of so many modes, in order."""
    return tuple(f"specimen.mode_{i + 1}.{state}" for state in ("displacement", "momentum") for i in range(count))


def rest_of_modes(modes: NDArray[np.void], gravity: Array) -> Array:
    """Modal states (2 n,) at rest under gravity (3,) [m/s2] in platen axes: w^2 eta = G_lin g_b, p = 0."""
    sag = modes["participation"][:, :3] @ gravity / modes["stiffness"]
    return np.concatenate([sag, np.zeros_like(sag)])


class ModalMotion(NamedTuple):
    """Modes along a run of n samples."""

    displacement: Array  # (n, n_modes) eta [m sqrt(kg)]
    velocity: Array  # (n, n_modes) eta'
    acceleration: Array  # (n, n_modes) eta''
    reaction: Array  # (n, 6) wrench on the platen at B in platen axes [N, N m], beyond the specimen as a rigid body
    energy: Array  # (n,) beyond the rigid body's, kinetic, elastic and of weight [J]
    dissipation: Array  # (n,) [W]


def modal_motion(
    modes: NDArray[np.void], coupling: Array, z: Array, twist: Array, rate: Array, gravity: Array
) -> ModalMotion:
    """Modes along a run: z (n, n_states); twist and its rate (n, 6) at B, gravity (n, 3), in platen axes."""
    n, part = len(modes), modes["participation"]
    eta, momentum = z[:, z.shape[1] - 2 * n : z.shape[1] - n], z[:, z.shape[1] - n :]
    velocity = momentum - twist @ part.T
    damping = np.diag(modes["damping"]) + (coupling.reshape(n, n) if coupling.size else 0.0)
    drag, weight = velocity @ damping.T, gravity @ part[:, :3].T
    load = modes["stiffness"] * eta + drag - weight
    reaction = (load + rate @ part.T) @ part
    reaction[:, 3:] += np.cross(eta @ part[:, :3], gravity)
    kinetic = 0.5 * (momentum**2 - (twist @ part.T) ** 2)
    energy = (kinetic + 0.5 * modes["stiffness"] * eta**2 - eta * weight).sum(axis=1)
    return ModalMotion(eta, velocity, -load - rate @ part.T, reaction, energy, (velocity * drag).sum(axis=1))


@compiled
def add_modal_wrench(modes, coupling, gravity, frame, z, work):
    """Add the modes' reaction to rows 6 and 7 of frame, the wrench at B in platen axes; work (4, n) is scratch.

    Leaves eta' in work[0] and the load w^2 eta + D eta' - G_lin g_b in work[1], as `modal_rates` needs them.
    """
    n = modes.size
    at, on = z.size - 2 * n, z.size - n
    v0, v1, v2 = frame[4, 0], frame[4, 1], frame[4, 2]
    w0, w1, w2 = frame[5, 0], frame[5, 1], frame[5, 2]
    g0, g1, g2 = -gravity * frame[2, 0], -gravity * frame[2, 1], -gravity * frame[2, 2]
    for i in range(n):
        mode = modes[i]
        g = mode.participation
        rate = z[on + i] - (g[0] * v0 + g[1] * v1 + g[2] * v2 + g[3] * w0 + g[4] * w1 + g[5] * w2)
        work[0, i] = rate
        work[1, i] = mode.stiffness * z[at + i] + mode.damping * rate - (g[0] * g0 + g[1] * g1 + g[2] * g2)
    if coupling.size > 0:
        _add_product(coupling, work[0], 1.0, work[1])
    f0 = f1 = f2 = m0 = m1 = m2 = s0 = s1 = s2 = 0.0
    for i in range(n):
        g = modes[i].participation
        load, eta = work[1, i], z[at + i]
        f0 += g[0] * load
        f1 += g[1] * load
        f2 += g[2] * load
        m0 += g[3] * load
        m1 += g[4] * load
        m2 += g[5] * load
        s0 += g[0] * eta
        s1 += g[1] * eta
        s2 += g[2] * eta
    frame[6, 0] += f0
    frame[6, 1] += f1
    frame[6, 2] += f2
    frame[7, 0] += m0 + s1 * g2 - s2 * g1
    frame[7, 1] += m1 + s2 * g0 - s0 * g2
    frame[7, 2] += m2 + s0 * g1 - s1 * g0


@compiled_inline
def _add_product(matrix, vector, factor, out):
    """Add factor times a symmetric matrix (n * n,) times a vector to out (n,), column by column."""
    n = vector.size
    for j in range(0, n - 1, 2):  # two columns at a time: half the reads and writes of `out`
        one, two = matrix[j * n : (j + 1) * n], matrix[(j + 1) * n : (j + 2) * n]
        by, beside = factor * vector[j], factor * vector[j + 1]
        for i in range(n):
            out[i] += one[i] * by + two[i] * beside
    if n % 2:
        last, by = matrix[(n - 1) * n :], factor * vector[n - 1]
        for i in range(n):
            out[i] += last[i] * by


@compiled
def modal_rates(modes, z, work, zd):
    """Euler, RK4: rates of the modal states, from what `add_modal_wrench` leaves in work."""
    n = modes.size
    for i in range(n):
        zd[z.size - 2 * n + i] = work[0, i]
        zd[z.size - n + i] = -work[1, i]


@compiled
def advance_modes(modes, coupling, gravity, frame, dt, z, work):
    """Semi-implicit: modal states over a step by the implicit midpoint rule, with the twist of mid-step in frame.

    The rule keeps the energy of undamped modes and is stable for any w dt. frame holds the rotation at the step's end:
    gravity in platen axes is taken half a step back. work (4, n) is scratch.
    """
    n, half = modes.size, 0.5 * dt
    at, on = z.size - 2 * n, z.size - n
    v0, v1, v2 = frame[4, 0], frame[4, 1], frame[4, 2]
    w0, w1, w2 = frame[5, 0], frame[5, 1], frame[5, 2]
    e0, e1, e2 = -gravity * frame[2, 0], -gravity * frame[2, 1], -gravity * frame[2, 2]
    g0, g1, g2 = e0 + half * (w1 * e2 - w2 * e1), e1 + half * (w2 * e0 - w0 * e2), e2 + half * (w0 * e1 - w1 * e0)
    for i in range(n):
        mode = modes[i]
        g = mode.participation
        base = g[0] * v0 + g[1] * v1 + g[2] * v2 + g[3] * w0 + g[4] * w1 + g[5] * w2
        push = g[0] * g0 + g[1] * g1 + g[2] * g2 - mode.stiffness * z[at + i]
        work[1, i] = z[on + i] - base + half * push
        work[2, i] = base
        work[0, i] = work[1, i] / (1.0 + half * (mode.damping + half * mode.stiffness))
    if coupling.size > 0:
        for _ in range(_SWEEPS):
            for i in range(n):
                work[3, i] = work[1, i]
            _add_product(coupling, work[0], -half, work[3])
            for i in range(n):
                work[0, i] = work[3, i] / (1.0 + half * (modes[i].damping + half * modes[i].stiffness))
    for i in range(n):
        z[at + i] += dt * work[0, i]
        z[on + i] = 2.0 * (work[0, i] + work[2, i]) - z[on + i]

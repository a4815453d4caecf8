"""Matrices of a structure fixed at its base, as any finite-element program writes them, converted to modes.

    M u'' + C u' + K u = -M R nu'            u relative to the base, R (n, 6) its motion for a unit twist of the base
    K phi = w^2 M phi, phi M phi = 1:        Gamma = Phi^T M R, D = Phi^T C Phi

Degrees of freedom without mass follow statically. Modes left out move with the base: their mass stays with the rigid
body, M_rigid - Gamma^T Gamma.
"""

from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.errors import ParameterError
from .specimen_forms import Modes

__all__ = ["Matrices", "modes_of"]

_SYMMETRIC = 1e-6
"""Share of the largest entry by which a matrix may differ from its transpose, as printed numbers do."""
_WITHOUT_MASS = 1e-13
"""Share of the largest 1 / w^2 below which a mode is one without mass."""
_COUPLED = 1e-9
"""Share of the largest damping below which what couples modes is rounding."""


class Matrices(NamedTuple):
    """Mass, stiffness, damping (n, n) and influence of the base's twist (n, 6); SI."""

    mass: Array
    stiffness: Array
    damping: Array | None  # None: of the ratio below
    influence: Array
    ratio: Array | None = None  # (n_modes,) or one for all [1]


def modes_of(given: Matrices, highest: float, where: str) -> Modes:
    """Modes up to a frequency [rad/s], shapes those of all degrees of freedom; raises ParameterError naming a matrix.

    Requires symmetric matrices, a positive definite stiffness, mass and damping that are not negative.
    """
    from scipy.linalg import eigh

    n = len(given.stiffness)
    for name in ("stiffness", "mass", "damping"):
        matrix = getattr(given, name)
        if matrix is None:
            continue
        if matrix.shape != (n, n):
            raise ParameterError(f"{where}: {name} has shape {matrix.shape}; it should be {(n, n)} as the stiffness")
        if np.abs(matrix - matrix.T).max() > _SYMMETRIC * np.abs(matrix).max():
            i, j = np.unravel_index(np.argmax(np.abs(matrix - matrix.T)), matrix.shape)
            raise ParameterError(f"{where}: {name} is not symmetric: entries {i + 1}, {j + 1} and {j + 1}, {i + 1}")
        least = float(np.linalg.eigvalsh(matrix)[0])
        if least < -_SYMMETRIC * np.abs(matrix).max():
            raise ParameterError(f"{where}: {name} has the negative eigenvalue {least:.4g}; correct it")
    if given.influence.shape != (n, 6):
        raise ParameterError(f"{where}: influence has shape {given.influence.shape}; it should be {(n, 6)}")
    mass, stiffness = (0.5 * (m + m.T) for m in (given.mass, given.stiffness))
    try:
        values, vectors = eigh(mass, stiffness)  # 1 / w^2, so that degrees of freedom without mass do no harm
    except np.linalg.LinAlgError:
        raise ParameterError(
            f"{where}: stiffness is not positive definite; it should be that of the structure fixed at its base"
        ) from None
    moving = values > _WITHOUT_MASS * max(values[-1], 0.0)
    if not moving.any():
        raise ParameterError(f"{where}: mass is zero; without mass there is no mode")
    frequency = 1.0 / np.sqrt(values[moving][::-1])
    shape = vectors[:, moving][:, ::-1] * frequency
    kept = frequency <= highest
    if not kept.any():
        raise ParameterError(
            f"{where}: highest_frequency {highest / (2 * np.pi):.4g} Hz is below all modes, the first of "
            f"{frequency[0] / (2 * np.pi):.4g} Hz; without modes state [mass] alone"
        )
    frequency, shape = frequency[kept], shape[:, kept]
    return Modes(frequency, _damping(given, frequency, shape, where), shape.T @ mass @ given.influence, shape)


def _damping(given: Matrices, frequency: Array, shape: Array, where: str) -> Array:
    if given.damping is not None:
        projected = shape.T @ (0.5 * (given.damping + given.damping.T)) @ shape
        across = projected - np.diag(np.diag(projected))
        small = np.abs(across).max() <= _COUPLED * np.abs(projected).max()
        return np.asarray(projected - across if small else projected)
    ratio = np.zeros(1) if given.ratio is None else given.ratio
    if len(ratio) not in (1, len(frequency)):
        raise ParameterError(f"{where}: damping_ratio has {len(ratio)} numbers; give one, or {len(frequency)}")
    return np.diag(2.0 * ratio * frequency)

"""Friction states along a measured motion whose samples are too far apart for its presliding.

Between two samples dt apart a motion with acceleration a turns back within a dt^2 / 8. Where that is not small against
a friction's yield slip, the state after a reversal depends on the motion between the samples. The path is then refined
by cubic Hermite interpolation of the slip with its measured rate, and the state of a sample is the mean over one
interval about it: friction that jumps between samples has no value at one of them that a low-passed record shows.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from ..core.arrays import Array
from ..effects.registry import law_of, parameters_of, states_of
from ..mechanics.plant import Plant
from ..mechanics.port_path import PortPath
from .inverse_dynamics import march_states
from .prepare import MeasuredTest

__all__ = ["march_finely", "sliding", "substeps"]

SHAKEN = 0.1
"""Noise of a displacement over a friction's yield slip from which it shakes presliding: 0.05 on the LHPOST6."""

KNOWN = 3.0
"""Noise of a displacement by which a platen must travel from sample to sample for its slip to be known."""

TAPER = 3
"""Samples over which the weight rises beside a stretch of unknown slip."""

COARSE, FINE, MOST = 0.1, 0.02, 16
"""Turn-back over yield slip from which a path is refined, to which it is, and substeps at most."""


def march_finely(
    plant: Plant,
    path: PortPath,
    dt: float,
    rows: Sequence[np.void],
    start: Array | None = None,
    *,
    averaged: bool = True,
) -> Iterator[tuple[np.void, Array]]:
    """Rows with their hidden states (n, k) along a path of n samples, from `start` (n_states,) or zero.

    Not `averaged`, refined states are those at the samples.
    """
    steps = [substeps(row, path, dt) for row in rows]
    for count in sorted(set(steps)):
        some = [row for row, own in zip(rows, steps, strict=True) if own == count]
        way = path if count == 1 else _refined(path, dt, count)
        marched = march_states(plant, way, dt / count, start, rows=np.array(some, plant.rows.dtype))
        if count > 1:
            marched = _thinned(marched, count, averaged)
        for row in some:
            yield row, marched[:, states_of(row)]


def sliding(plant: Plant, test: MeasuredTest) -> Array | None:
    """Weight (n,) of a test's wrench residual: zero where noise hides which way the platen slips, one where it slides.

    Friction's state then depends on slips below the displacement's noise. None where no yield slip is that small.
    """
    if test.path is None:
        return None
    rubbing = [parameters_of(row) for row in plant.rows if law_of(row).friction_memory]
    least = min((p.yield_slip for p in rubbing if hasattr(p, "yield_slip")), default=np.inf)
    axes = plant.axes[plant.axes < 3]
    noise = np.abs(test.motion.displacement - test.path)[:, axes].max(axis=0, initial=0.0)
    if not np.any(noise > SHAKEN * least):
        return None
    travel = np.abs(test.motion.velocity[:, axes]) * test.dt
    unknown = np.all(travel < KNOWN * noise, axis=1).astype(float)
    kernel = np.hanning(2 * TAPER + 1)[1:-1]
    return np.asarray(1.0 - np.minimum(np.convolve(unknown, kernel, "same"), 1.0))


def substeps(row: np.void, path: PortPath, dt: float) -> int:
    """Steps into which an interval is divided for a row: one unless its friction yields within a turn-back."""
    slip = getattr(parameters_of(row), "yield_slip", 0.0) if law_of(row).friction_memory else 0.0
    if slip <= 0.0:
        return 1
    turn = float(np.sqrt(np.mean(np.diff(path.rate[:, row["port"]]) ** 2))) * dt / 8.0
    return 1 if turn < COARSE * slip else min(MOST, int(np.ceil(np.sqrt(turn / (FINE * slip)))))


def _refined(path: PortPath, dt: float, count: int) -> PortPath:
    """The path at `count` times as many steps; columns and rotations, which no state needs, are left out."""
    from scipy.interpolate import CubicHermiteSpline

    n = len(path.s)
    t, fine = np.arange(n) * dt, np.arange((n - 1) * count + 1) * (dt / count)
    gone = CubicHermiteSpline(t, np.cumsum(path.slip, axis=0), path.rate)
    at = CubicHermiteSpline(t, path.s, path.rate)
    slip = np.diff(gone(fine), axis=0, prepend=0.0)
    slip[0] = 0.0
    return PortPath(at(fine), at(fine, 1), slip, path.column[:0], path.turn[:0])


def _thinned(z: Array, count: int, averaged: bool) -> Array:
    """States (n, k) at the samples of those at every substep: the mean over one interval about each, or the value."""
    if not averaged:
        return z[::count]
    half = count // 2
    padded = np.concatenate([np.repeat(z[:1], half, axis=0), z, np.repeat(z[-1:], half, axis=0)])
    total = np.cumsum(np.concatenate([np.zeros((1, z.shape[1])), padded]), axis=0)
    width = 2 * half + 1
    return ((total[width:] - total[:-width]) / width)[::count]

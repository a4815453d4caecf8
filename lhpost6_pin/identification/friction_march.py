"""Friction states along a measured motion whose samples are too far apart for its presliding.

Between two samples dt apart a motion with acceleration a turns back within a dt^2 / 8. Where that is not small against
a friction's yield slip, the state after a reversal depends on the motion between the samples. The path is then refined
by cubic Hermite interpolation of the slip with its measured rate, and the state of a sample is the mean over one
interval about it: friction that jumps between samples has no value at one of them that a low-passed record shows.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..core.arrays import Array
from ..effects.registry import law_of, states_of
from ..machine.components import Actuator, Strut
from ..machine.machine import Machine
from ..mechanics.plant import Plant
from ..mechanics.port_path import PortPath
from .inverse_dynamics import march_states
from .prepare import MeasuredTest

__all__ = ["least_yield", "made_fine", "march_finely"]

SHAKEN = 0.1
"""Noise of a displacement over a friction's yield slip from which it shakes presliding: 0.05 on the LHPOST6."""

KNOWN = 3.0
"""Noise of a displacement by which a platen must travel from sample to sample for its slip to be known."""

TAPER = 3
"""Samples over which the weight rises beside a stretch of unknown slip."""

FINE, SMALLEST, MOST = 0.02, 0.1, 16
"""Turn-back over yield slip to which a path is refined, yield slip over the stated one, and substeps at most."""


def march_finely(
    plant: Plant, path: PortPath, test: MeasuredTest, rows: Sequence[np.void], start: Array | None = None
) -> Iterator[tuple[np.void, Array]]:
    """Rows with their hidden states (n, k) along a path of a test's n samples, from `start` (n_states,) or zero."""
    steps = [test.substeps if law_of(row).friction_memory else 1 for row in rows]
    for count in sorted(set(steps)):
        some = [row for row, own in zip(rows, steps, strict=True) if own == count]
        way = path if count == 1 else _refined(path, test.dt, count)
        marched = march_states(plant, way, test.dt / count, start, rows=np.array(some, plant.rows.dtype))
        if count > 1:
            marched = _thinned(marched, count)
        for row in some:
            yield row, marched[:, states_of(row)]


def made_fine(plant: Plant, test: MeasuredTest) -> MeasuredTest:
    """The test with substeps and weight where noise shakes presliding; as it is where no yield slip is that small.

    A yield slip may turn out smaller than stated: by its uncertainty; substeps are those of a tenth of that.
    """
    least = min((least_yield(plant.machine, c) for c in plant.machine.components), default=np.inf)
    weight = _sliding(plant, test, least)
    if weight is None:
        return test
    turn = float(np.sqrt(np.mean(np.diff(test.motion.velocity[:, plant.axes], axis=0) ** 2))) * test.dt / 8.0
    count = int(np.ceil(np.sqrt(turn / (FINE * SMALLEST * least))))
    return replace(test, weight=weight, substeps=min(max(count, 1), MOST))


def least_yield(machine: Machine, component: Actuator | Strut) -> float:
    """Yield slip [m] that a component's friction may have: the stated one less two deviations, as a factor."""
    least = np.inf
    for key in ("seal_yield", "pad_yield"):
        paths = (f"{component.name}.{key}", f"{component.kind}.{key}")
        for path in (path for path in paths if path in machine.parameters):
            stated, sd = machine.parameters.number(path), machine.parameters[path].sd
            least = min(least, stated**2 / (stated + 2.0 * (sd if isinstance(sd, float) else 0.0)))
    return least


def _sliding(plant: Plant, test: MeasuredTest, least: float) -> Array | None:
    """Weight (n,) of a test's wrench residual: zero where noise hides which way the platen slips, one where it slides.

    Friction's state then depends on slips below the displacement's noise. None where the `least` yield slip [m] is
    large against it.
    """
    if test.path is None:
        return None
    axes = plant.axes[plant.axes < 3]
    noise = np.abs(test.motion.displacement - test.path)[:, axes].max(axis=0, initial=0.0)
    if not np.any(noise > SHAKEN * least):
        return None
    travel = np.abs(test.motion.velocity[:, axes]) * test.dt
    unknown = np.all(travel < KNOWN * noise, axis=1).astype(float)
    kernel = np.hanning(2 * TAPER + 1)[1:-1]
    return np.asarray(1.0 - np.minimum(np.convolve(unknown, kernel, "same"), 1.0))


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


def _thinned(z: Array, count: int) -> Array:
    """States (n, k) of samples by those of every substep: the mean over one interval about each."""
    half = count // 2
    padded = np.concatenate([np.repeat(z[:1], half, axis=0), z, np.repeat(z[-1:], half, axis=0)])
    total = np.cumsum(np.concatenate([np.zeros((1, z.shape[1])), padded]), axis=0)
    width = 2 * half + 1
    return ((total[width:] - total[:-width]) / width)[::count]

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
from ..core.compiled import compiled
from ..effects.registry import law_of
from ..machine.components import Actuator, Strut
from ..machine.machine import Machine
from ..mechanics.plant import MovingRow, Plant
from ..mechanics.port_path import PortPath
from .inverse_dynamics import march_states
from .prepare import MeasuredTest

__all__ = ["least_yield", "made_fine", "march_finely", "refined", "thinned"]

SHAKEN = 0.1
"""Noise of a displacement over a friction's yield slip from which it shakes presliding: 0.05 on the LHPOST6."""

KNOWN = 3.0
"""Noise of a displacement by which a platen must travel from sample to sample for its slip to be known."""

TAPER = 3
"""Samples over which the weight rises beside a stretch of unknown slip."""

FINE, SMALLEST, MOST = 0.02, 0.1, 16
"""Turn-back over yield slip to which a path is refined, yield slip over the stated one, and substeps at most."""


def march_finely(
    plant: Plant, path: PortPath, test: MeasuredTest, rows: Sequence[MovingRow], start: Array | None = None
) -> Iterator[tuple[tuple[object, ...], Array]]:
    """Keys of rows with their states (n, k) along a path of a test's n samples, from `start` (n_states,) or zero."""
    steps = [test.substeps if law_of(one.row).friction_memory else 1 for one in rows]
    for count in sorted(set(steps)):
        some = [one for one, own in zip(rows, steps, strict=True) if own == count]
        way = path if count == 1 else refined(path, test.dt, count)
        marched = march_states(
            plant, way, test.dt / count, start, rows=np.array([one.row for one in some], plant.rows.dtype)
        )
        if count > 1:
            marched = thinned(marched, count)
        for one in some:
            yield one.key, marched[:, one.states]


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
    noise = np.abs(test.motion.displacement - test.path)[test.settled :, axes].max(axis=0, initial=0.0)
    if not np.any(noise > SHAKEN * least):
        return None
    travel = np.abs(test.motion.velocity[:, axes]) * test.dt
    unknown = np.all(travel < KNOWN * noise, axis=1).astype(float)
    kernel = np.hanning(2 * TAPER + 1)[1:-1]
    return np.asarray(1.0 - np.minimum(np.convolve(unknown, kernel, "same"), 1.0))


def refined(path: PortPath, dt: float, count: int) -> PortPath:
    """The path (n samples, dt [s] apart) at `count` times as many steps, by cubic Hermite interpolation.

    Columns and rotations, which no state needs, are left out.
    """
    m = (len(path.s) - 1) * count + 1
    at, rate, slip = (np.zeros((m, path.s.shape[1])) for _ in range(3))
    fine = PortPath(at, rate, slip, path.column[:0], path.turn[:0])
    _refine(path, fine, dt, count)
    return fine


@compiled
def _refine(path, fine, dt, count):
    basis, rates = np.zeros((count + 1, 3)), np.zeros((count + 1, 3))
    for j in range(count + 1):
        u = j / count
        basis[j] = u * u * (3.0 - 2.0 * u), u * (1.0 - u) ** 2 * dt, u * u * (u - 1.0) * dt
        rates[j] = 6.0 * u * (1.0 - u) / dt, (1.0 - u) * (1.0 - 3.0 * u), u * (3.0 * u - 2.0)
    slips = basis[1:] - basis[:-1]
    fine.s[0], fine.rate[0] = path.s[0], path.rate[0]
    for p in range(path.s.shape[1]):
        for i in range(path.s.shape[0] - 1):
            at, slip, first, last = path.s[i, p], path.slip[i + 1, p], path.rate[i, p], path.rate[i + 1, p]
            gone = path.s[i + 1, p] - at
            for j in range(1, count + 1):
                k = i * count + j
                b, r, d = basis[j], rates[j], slips[j - 1]
                fine.s[k, p] = at + b[0] * gone + b[1] * first + b[2] * last
                fine.rate[k, p] = r[0] * gone + r[1] * first + r[2] * last
                fine.slip[k, p] = d[0] * slip + d[1] * first + d[2] * last


def thinned(z: Array, count: int) -> Array:
    """States (n, k) of samples by those of every substep: the mean over one interval about each."""
    out = np.zeros(((len(z) - 1) // count + 1, z.shape[1]))
    _average(np.ascontiguousarray(z), count, out)
    return out


@compiled
def _average(z, count, out):
    half = count // 2
    for i in range(out.shape[0]):
        for k in range(z.shape[1]):
            total = 0.0
            for j in range(i * count - half, i * count + half + 1):
                total += z[min(max(j, 0), z.shape[0] - 1), k]
            out[i, k] = total / (2 * half + 1)

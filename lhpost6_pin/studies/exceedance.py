"""Probability of exceeding a limit against the scale of a motion, and the scale at which it reaches a stated risk.

Every machine of an ensemble runs at every scale; its demand over capacity reaches one at its critical scale,
interpolated linearly between the two about it, or in proportion to the scale from the lower one where it grows by less
than that: there valves saturate before the upper one. Their distribution is a fragility curve: the share of critical
scales up to a scale estimates the probability of exceedance there (Wilson intervals), and their quantiles are the
scales of given risk (distribution-free intervals of order statistics). Intervals are those of independent draws; of a
Latin hypercube or a Sobol sequence they are somewhat too wide.
"""

from typing import Literal, NamedTuple

import numpy as np

from ..core.arrays import Array
from .quantities import DECIDING

__all__ = ["ANY", "Exceedance", "critical_scales", "exceedance", "exceedances"]

ANY = "any limit"
"""The first of the deciding limits that were evaluated, or a run in trouble, such as one that stopped on the way."""

Where = Literal["within", "at or below the smallest run", "beyond the largest run", "unknown"]
"""Where the scale of a risk is, of those that were run."""


class Exceedance(NamedTuple):
    """Exceedance of one limit."""

    limit: str
    critical: Array  # (n,) scale at which each machine reaches it, rising; infinity: beyond the largest run
    share: Array  # (s,) of machines at or beyond it at each scale
    low: Array  # (s,) of its interval
    high: Array  # (s,)
    risk_scale: float  # at which the share is `level`; infinity: beyond the largest run
    risk_low: float  # of its interval; 0: with so few machines it has no lower bound
    risk_high: float
    where: Where  # the scale of that share
    risk_after: float = 0.0  # the scale run before it, where that of the risk is known to lie between both only; else 0


def critical_scales(use: Array, scales: Array) -> Array:
    """Scales (n,) at which demand over capacity `use` (s, n) at `scales` (s,), rising, first reaches one.

    The first scale where that is beyond already; infinity where none is; not-a-number where a demand before is missing.
    """
    beyond = use >= 1.0
    first = np.where(beyond.any(axis=0), beyond.argmax(axis=0), len(scales))
    found = np.full(use.shape[1], np.inf)
    for i, k in enumerate(first):
        if np.isnan(use[:k, i]).any():
            found[i] = np.nan
        elif k == 0:
            found[i] = scales[0]
        elif k < len(scales):
            before, after = use[k - 1, i], use[k, i]
            part = (1.0 - before) / (after - before) if np.isfinite(after) else 1.0
            found[i] = scales[k - 1] + part * (scales[k] - scales[k - 1])
            if 1.0 < after < np.inf and before > 0.0:  # a clipped command is at most one: the upper scale
                found[i] = min(found[i], scales[k - 1] / before)
    return found


def exceedance(limit: str, critical: Array, scales: Array, *, level: float, confidence: float) -> Exceedance:
    """Exceedance of one limit by critical scales (n,) at `scales` (s,), rising; machines without one are left out."""
    from scipy.stats import binom, binomtest

    critical = np.sort(critical[~np.isnan(critical)])
    n = len(critical)
    if n == 0:
        blank = np.full(len(scales), np.nan)
        return Exceedance(limit, critical, blank, blank, blank, np.nan, np.nan, np.nan, "unknown")
    counts = np.array([int(np.sum(critical <= scale)) for scale in scales])
    ends = [binomtest(int(k), n).proportion_ci(confidence, method="wilson") for k in counts]
    tail = 0.5 * (1.0 - confidence)
    at = float(critical[max(1, int(np.ceil(level * n))) - 1])
    first, last = int(binom.ppf(tail, n, level)), int(binom.ppf(1.0 - tail, n, level)) + 1
    where: Where = "beyond the largest run" if np.isinf(at) else "within"
    before = scales[(scales < at) & np.isin(at, scales)]  # reached at a scale that was run, not interpolated: saturated
    return Exceedance(
        limit,
        critical,
        counts / n,
        np.array([one.low for one in ends]),
        np.array([one.high for one in ends]),
        at,
        float(critical[first - 1]) if first >= 1 else 0.0,
        float(critical[last - 1]) if last <= n else float("inf"),
        "at or below the smallest run" if at <= scales[0] else where,
        float(before[-1]) if len(before) else 0.0,
    )


def exceedances(
    use: Array, trouble: Array, limits: tuple[str, ...], scales: Array, *, level: float, confidence: float
) -> tuple[Exceedance, ...]:
    """Exceedance of any limit, then of each deciding one that some run has, by rising scale of that risk.

    use (s, n, limits) at `scales` (s,), rising; trouble (s, n): runs with trouble are beyond some limit. The critical
    scale of any limit is the least of a machine's, trouble counting from the scale at which it was found.
    """
    deciding = [k for k, limit in enumerate(limits) if limit in DECIDING]
    known = [k for k in deciding if not np.isnan(use[..., k]).all()]
    critical = {limits[k]: critical_scales(use[..., k], scales) for k in known}
    found = [exceedance(limit, own, scales, level=level, confidence=confidence) for limit, own in critical.items()]
    troubled = np.where(trouble.any(axis=0), scales[trouble.argmax(axis=0)], np.nan)
    first = np.fmin.reduce([*critical.values(), troubled])  # not-a-number only where nothing is known
    found.sort(key=lambda one: (one.risk_scale, -float(np.nansum(one.share))))
    return exceedance(ANY, first, scales, level=level, confidence=confidence), *found

"""Ends of a displacement motion that is not at rest there: its velocity jumps where the target's rest joins it.

Of such a motion the target has a pulse of acceleration at the join, bounded by the low-pass alone, which is no part of
the motion and may be many times its own.
"""

from typing import NamedTuple

import numpy as np

from .motion import AXES

__all__ = ["Join", "join_warning", "sharp_joins"]

_INSIGNIFICANT = 1e-3  # of the largest acceleration of its kind, up to which a pulse is rounding


class Join(NamedTuple):
    """An end of a motion on one axis where the target accelerates more than in the motion; SI."""

    axis: str
    starts: bool  # else ends
    displacement: float  # of the motion's first or last sample [m, rad]
    velocity: float  # there [m/s, rad/s]
    time: float  # on the target's clock [s]
    peak: float  # of the target about the join [m/s^2, rad/s^2]
    own: float  # largest between the joins


def sharp_joins(
    channels: np.ndarray,
    time_step: float,
    acceleration: np.ndarray,
    rate: float,
    *,
    lead: int,
    reach: int,
    excess: float,
) -> list[Join]:
    """Ends of a motion at which its target accelerates `excess` times as much as in the motion, worst first.

    channels (m, 6) of the motion [m, rad], time_step [s]; acceleration (n, 6) of the target at `rate` [1/s], with
    `lead` samples before and after the motion. The pulse is within `reach` samples of a join; in a motion of less than
    two reaches it cannot be told from the motion.
    """
    ends = lead, len(acceleration) - 1 - lead
    size = np.abs(acceleration)
    inside = size[ends[0] + reach : ends[1] - reach + 1]
    if not len(inside):
        return []
    own = inside.max(axis=0)
    least = _INSIGNIFICANT * np.repeat([own[:3].max(), own[3:].max()], 3)
    found = []
    for end, starts in zip(ends, (True, False), strict=True):
        peak = size[max(end - reach, 0) : end + reach + 1].max(axis=0)
        first, second = (0, 1) if starts else (-2, -1)
        speed, place = (channels[second] - channels[first]) / time_step, channels[0 if starts else -1]
        found += [
            Join(AXES[k], starts, float(place[k]), float(speed[k]), end / rate, float(peak[k]), float(own[k]))
            for k in np.flatnonzero((peak > excess * own) & (peak > least) & (speed != 0.0))
        ]
    return sorted(found, key=lambda join: -join.peak)


def join_warning(name: str, joins: list[Join]) -> str:
    """A sentence on the sharpest join of translations, else of rotations, the axes of all, and the remedy."""
    worst = next((join for join in joins if AXES.index(join.axis) < 3), joins[0])
    unit = "m" if AXES.index(worst.axis) < 3 else "rad"
    others = [f"{one.axis} at its {'start' if one.starts else 'end'}" for one in joins if one is not worst]
    also = f" (also {', '.join(others)})" if others else ""
    what, where = ("starts", "before") if worst.starts else ("ends", "after")
    return (
        f"{name}: {worst.axis} {what} at {worst.velocity:.3g} {unit}/s and {worst.displacement:.3g} {unit}, not at "
        f"rest{also}. Where it joins the rest {where} it, at t = {worst.time:.3f} s, the target reaches "
        f"{worst.peak:.3g} {unit}/s^2, in the motion itself {worst.own:.3g} {unit}/s^2. Begin and end the motion at "
        "rest, or lead it in and out with --taper SECONDS"
    )

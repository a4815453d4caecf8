"""Whether the effects found leave residual unexplained: more than noise, and than what errors in their form explain."""

from collections.abc import Sequence

import numpy as np

from ..core.arrays import Complex, Mask
from ..identification.calibration.friction_forms import own_suffices
from .acceptance import form_share, squares_by_column
from .search_state import AddedEffect, Search, fitted_machine

__all__ = ["forces_explained", "leaves_much", "more_than_noise", "remainders"]


LITTLE = 0.1
"""Squares, over those of noise, of which no share is taken."""


def more_than_noise(found: Search) -> bool:
    """Whether the residual exceeds noise by more than errors in the form of the effects found explain."""
    limit, doubt = (found.numbers.number(f) for f in ("verdict.unexplained", "accept.doubt"))
    for kind in found.problem.kinds:
        families = [one.candidate.family for one in found.added if kind in one.candidate.family.shows_in]
        share = max((form_share(f, found.numbers) for f in families), default=found.numbers.number("verdict.rest"))
        rows = found.problem.rows(kind) & ~_impacted(found)
        if not rows.any() or (kind == "wrench" and forces_explained(found)):
            continue
        first, last = ([r[:, rows] for r in tests] for tests in (found.refit.normal.residual, found.residual))
        misfit = float(np.mean([np.mean(np.abs(r) ** 2) for r in last]))
        if misfit > limit and _excess(last, doubt) > share * _excess(first, doubt):
            return True
    return False


def remainders(found: Search) -> dict[str, float]:
    """Share of the squares beyond noise that the effects found leave, by kind of residual; none where there were none.

    Compared with the refit without effects.
    """
    doubt, out = found.numbers.number("accept.doubt"), {}
    for kind in found.problem.kinds:
        rows = found.problem.rows(kind)
        if not rows.any():
            continue
        first, last = ([r[:, rows] for r in tests] for tests in (found.refit.normal.residual, found.residual))
        before = _beyond(first, doubt)
        if before > LITTLE * sum(r.size for r in first):
            out[kind] = max(_beyond(last, doubt), 0.0) / before
    return out


def _impacted(found: Search) -> Mask:
    """Columns (c,) of actuators with play identified from lengths: impacts are faster than the sampling rate."""
    names, columns = found.problem.machine.actuator_names, np.zeros(sum(found.problem.widths), bool)
    for one in found.added:
        for name in one.candidate.components if one.from_lengths else ():
            columns |= found.problem.rows_of_actuator(names.index(name))
    return columns


def _beyond(residual: Sequence[Complex], doubt: float) -> float:
    """Squares of whitened residuals beyond `doubt` times noise; negative where there is less."""
    return sum(float(np.sum(np.abs(r) ** 2)) for r in residual) - doubt * sum(r.size for r in residual)


def _excess(residual: Sequence[Complex], doubt: float) -> float:
    """The same, at least `LITTLE` of noise."""
    return max(_beyond(residual, doubt), LITTLE * sum(r.size for r in residual))


def forces_explained(found: Search) -> bool:
    """Whether a machine on guides explains its measured forces but for what friction varies by from stroke to stroke.

    All friction acts along one axis or two there, and no law has exactly its form: noise is no measure of that.
    """
    problem = found.problem
    if problem.machine.motion == "free" or not problem.rows("wrench").any():
        return False
    return own_suffices(problem, fitted_machine(found.solution), found.calibration)


def leaves_much(added: AddedEffect, kept: Sequence[AddedEffect], found: Search) -> bool:
    """Whether an effect leaves much of the residual unexplained in the columns where it explains most.

    Compared with what all effects `kept` explain there, each to the share that the error in its form may leave.
    """
    limit, doubt = (found.numbers.number(f) for f in ("verdict.unexplained", "accept.doubt"))
    where = (added.fall > 0.1 * added.fall.max()) & ~_impacted(found)
    if forces_explained(found):
        where &= ~found.problem.rows("wrench")
    fall = [np.maximum(one.fall, 0.0)[where].sum() for one in kept]
    of_form = sum(form_share(one.candidate.family, found.numbers) * f for one, f in zip(kept, fall, strict=True))
    left = squares_by_column(found.residual)[where]
    noise = float(sum(len(r) for r in found.residual) * left.size)
    return bool(left.sum() > limit * noise and left.sum() - doubt * noise > of_form)

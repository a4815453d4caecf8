"""Joint fits: a candidate fitted together with all parameters and sensor errors, from several starts."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.errors import ParameterError
from ..core.progress import Progress, split
from ..identification.calibration.fit import objective_at
from ..identification.calibration.free_parameters import FreeParameter
from ..identification.calibration.normal_equations import bounds_of
from ..identification.calibration.problem import Problem
from .candidates import Candidate
from .scores import Score
from .search_state import Scored, Search

__all__ = ["JointFit", "fit_from_rival", "fit_jointly", "refined", "with_candidate"]


def refined(found: Search, progress: Progress) -> Search:
    """The search with derivatives evaluated again, until that changes little: what is left looks like an effect.

    Those by unknowns in which residuals are not nearly linear. It keeps its numbers where a fit from them ends higher.
    """
    for part in split(progress, int(found.numbers.number("fit.refinements"))):
        first, second = split(part, 2)
        here = found.moved(found.solution.x, found.problem.bent, first)
        again = here.solved(found.problem, here.solution.x, second, first=here.solution.normal)
        fall = here.objective - again.objective
        if fall <= 0.0:
            here.solution.normal.released()
            return here
        found = again
        if fall < found.numbers.number("fit.refined"):
            break
    return found


class JointFit(NamedTuple):
    """The best of a candidate's joint fits."""

    search: Search
    starts: int  # fits up to it


def fit_jointly(found: Search, one: Scored, progress: Progress, best: JointFit | None = None) -> JointFit:
    """The search with a candidate fitted jointly with all parameters, from its linear estimate.

    Where that ends higher than without the candidate, it also begins with all else moved as estimated, which may end
    with sensors' errors at their bounds, and with all derivatives evaluated at its steps. Where the residual stays
    large, it is fitted from the stated parameters, too, since a missing effect may have biased them out of reach; and
    from other shapes that explain nearly as much. From as many starts as the `best` rival so far required; then no more
    where that leaves little, and this one is far behind it.
    """
    n = found.numbers.number
    near = [s for s in found.rounds[-1].scored if s.gain >= n("accept.near") * one.gain]
    others = [s for s in near if s.candidate.of_one_form(one.candidate) and s.candidate != one.candidate]
    starts = [(one, False), (one, True), *((other, False) for other in others[: int(n("accept.shapes"))])]
    fits: list[Search] = []
    for (start, afresh), part in zip(starts, split(progress, len(starts)), strict=True):
        fit = _fit_from(found, start, part, afresh=afresh)
        if fit.objective >= found.objective and not fits:  # derivatives reused are too far off
            fit = min(
                (fit, *(_fit_from(found, start, part, **how) for how in ({"moved": True}, {"reused": False}))),
                key=lambda one: one.objective,
            )
        fits.append(fit)
        if best is not None and len(fits) < best.starts:
            continue
        if fits[-1].power < n("accept.settled"):
            break
        if best is not None and best.search.power < n("accept.settled"):
            far = n("accept.far") * (found.objective - best.search.objective)
            if fits[-1].objective - best.search.objective > far:
                break
    place = min(range(len(fits)), key=lambda i: fits[i].objective)
    return JointFit(fits[place], place + 1)


def fit_from_rival(found: Search, one: Scored, rival: Scored, fitted: Search, progress: Progress) -> Search | None:
    """The search with a candidate fitted jointly from the numbers of a fitted rival; None if it has others.

    Of two families that differ in one respect, such as an inertia upright, the one may stop far from what the other,
    which has a number more, has found.
    """
    problem, candidate, prefix = fitted.problem, one.candidate, f"{rival.candidate.name}."
    pairs = zip(problem.parameters, fitted.solution.x, strict=False)
    values = {p.name.removeprefix(prefix): p.at(float(x)) for p, x in pairs if p.name.startswith(prefix)}
    if not values or any(s.name not in values for s in candidate.amplitudes):
        return None
    own = replace(candidate, shape=tuple((name, values.get(name, value)) for name, value in candidate.shape))
    wanted = np.clip([values[s.name] for s in own.amplitudes], *own.bounds)
    amplitudes, place = tuple(wanted.tolist()), dict(zip(problem.names, fitted.solution.x, strict=True))
    others = np.array([place[name] for name in found.problem.names])
    start = with_candidate(found.problem, own, amplitudes, own.fit_parameters(amplitudes, found.numbers), others)
    return found.solved(*start, progress, settled=True)


def _fit_from(
    found: Search, one: Scored, progress: Progress, *, afresh: bool = False, moved: bool = False, reused: bool = True
) -> Search:
    """The search with a candidate fitted jointly, from the present solution or from the stated parameters (`afresh`).

    Or from the present solution with all unknowns `moved` as the linear estimate moves them, if that explains more.
    Derivatives by everything else are `reused`: mostly accurate enough to compare candidates. The search as it is where
    a fit comes so near to numbers that make no machine that it has no derivatives.
    """
    problem, candidate, start = found.problem, one.candidate, found.solution.at
    if candidate.release:
        kind = "known" if problem.names.index(candidate.release) < len(problem.parameters) else "sensor"
        problem = problem.with_free(candidate.release, found.numbers.number(f"fit.{kind}_free"))
    else:
        far = found.power >= found.numbers.number("accept.settled")
        strengths = found.numbers.vector("accept.strengths") if far else (1.0,)
        amplitudes, start = _best_start(found, candidate, one.score, strengths, afresh=afresh, moved=moved)
        own = candidate.fit_parameters(amplitudes, found.numbers)
        problem, start = with_candidate(problem, candidate, amplitudes, own, start)
    # derivatives that change much with an effect: for one of the oil, those by numbers of oil and valves
    flows = [*(k.shows_in == ("flow",) for k in problem.parameters), *(u.alone[1] >= 0 for u in problem.unknowns)]
    near = np.array(flows) & ("flow" in candidate.family.shows_in)
    try:
        return found.solved(problem, np.zeros_like(start) if afresh else start, progress, settled=reused, near=near)
    except ParameterError:  # a step for a derivative leaves no machine
        return found


def _best_start(
    found: Search, candidate: Candidate, one: Score, strengths: Sequence[float], *, afresh: bool, moved: bool
) -> tuple[tuple[float, ...], Array]:
    """Amplitudes (q,) of a candidate, and all other unknowns (p,), with which it explains most.

    Of the linear estimate times the factor of some, and of that with all else `moved` as it estimates: without that a
    residual may first grow in bands that then count as noise. Far from the optimum the estimate may be several times
    too small or too large. Where none of them makes a machine, zero; typical sizes where residuals are not linear in
    the amplitudes.
    """
    at, least = found.solution.at, np.inf
    zero = [0.0 if candidate.family.linear else s.typical for s in candidate.amplitudes]
    starts = [(factor, np.zeros_like(at) if afresh else at) for factor in strengths]
    if moved and len(one.change) == len(at):  # not of a candidate that was scored beside other effects
        low, high = bounds_of(found.problem, found.calibration)
        there = at + one.change * found.problem.prior
        starts.append((1.0, np.clip(there, np.minimum(low, at), np.maximum(high, at))))
    best = tuple(zero), starts[0][1]
    for factor, x in starts:
        tried = tuple(np.clip(factor * one.amplitude, *candidate.bounds).tolist())
        value = objective_at(*with_candidate(found.problem, candidate, tried, (), x))
        if value < least:
            best, least = (tried, x), value
    return best


def with_candidate(
    problem: Problem, candidate: Candidate, amplitudes: tuple[float, ...], own: Sequence[FreeParameter], x: Array
) -> tuple[Problem, Array]:
    """The problem with a candidate in the machine and its parameters in the fit; and x (p,) with zeros for these."""
    machine = candidate.on(problem.machine, amplitudes)
    more = problem.with_machine(machine, (*problem.parameters, *own))
    return more, np.insert(x, len(problem.parameters), np.zeros(len(own)))

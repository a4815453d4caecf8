"""The search: refit, screen the library, add a candidate that passes, refit everything jointly, and repeat.

A candidate passes if it gains enough, also in cross-validation, and explains enough of the residual beyond noise. Of
those that pass, the one (or two) that explains most in a joint fit with all parameters and sensor errors is added.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..core.progress import Progress, between, split
from ..identification.calibration.expected_scatter import noise_at
from ..identification.calibration.fit import solve
from ..identification.calibration.normal_equations import NoiseBias, NormalEquations
from ..identification.calibration.problem import Problem
from ..machine.parameters import Parameters
from .acceptance import gate, share_explained
from .candidates import Candidate
from .contest import best_of, loss_without, removed
from .estimates import is_absorbed, moved_together
from .joint_fit import refined
from .screening import is_confused, left_by_form, score_pairs, screen
from .search_state import Linearisation, Scored, Search, best_per_family, linearise

__all__ = ["refit", "search", "without_effect"]


def refit(
    problem: Problem, begin: NormalEquations, numbers: Parameters, calibration: Parameters, progress: Progress
) -> Search:
    """Start of a search: parameters and sensor errors fitted to a campaign, without any effect.

    begin are its normal equations where all unknowns are zero. The residual is then weighed by the noise at the fitted
    parameters: soft oil, for instance, amplifies it in the flows. And what friction holds at the start of tests is as
    theirs: how long, depends on yield slips.
    """
    zero = np.zeros(len(problem.prior))
    first = solve(problem, calibration, zero, between(progress, 0.0, 0.85), first=begin, frugal=True)
    normal = first.normal.restarted(problem.plant_at(first.x))
    normal = normal.reweighed(noise_at(problem, zero), noise_at(normal.problem, first.x))
    part = between(progress, 0.85, 1.0)
    solution = solve(normal.problem, calibration, first.x, part, normal, frugal=True, settled=True)
    return Search(normal.problem, solution, solution, numbers, calibration)


def search(found: Search, keep: Callable[[Search], None], progress: Progress) -> tuple[Search, Linearisation]:
    """Search the library for missing effects, from a refit or from the state of an interrupted search.

    Returns the search and its linearisation. keep is called with the search whenever an effect is added.
    """
    most = int(found.numbers.number("accept.effects"))
    parts = split(progress, 2 * (most + 1))
    for k in range(len(found.rounds), most + 1):
        linear = linearise(found.solution, found.calibration, replicas=True)
        found = replace(found, rounds=(*found.rounds, screen(found, linear, parts[2 * k])))
        first, second = split(parts[2 * k + 1], 2)
        more = (_more_effects(found, linear, first) or _screened_as_stated(found, second)) if k < most else None
        if more is None:
            break
        del linear  # as large as the next one
        found = more.restarted(lambda share: None)
        keep(found)
    fewer = _pruned(found)
    if fewer.solution is not found.solution:
        linear = linearise(fewer.solution, found.calibration)
    found = fewer
    progress(1.0)
    return found, linear


def _screened_as_stated(found: Search, progress: Progress) -> Search | None:
    """The search with one more effect screened about the stated numbers; None if none passes there either.

    Without an effect that is missing, a refit may end far off, where no small addition of it would help. It is added if
    its joint fit explains enough of what that refit leaves beyond noise. None, too, where it leaves little.
    """
    n, problem, known = found.numbers.number, found.problem, found.solution.normal
    if found.power < n("accept.settled"):
        return None
    stated, (first, *more, screening, adding) = np.zeros(len(problem.prior)), split(progress, 3 + len(problem.replicas))
    normal = NormalEquations(problem, stated, first, known, problem.bent)
    normal = normal.less(NoiseBias(normal, stated, more, known))
    solution = found.solution._replace(x=stated, at=stated, normal=normal, residual=normal.residual)
    linear = linearise(solution, found.calibration, replicas=True)
    screened = screen(replace(found, solution=solution), linear, screening)
    passed = [one for one in screened.scored if not (one.refused or one.candidate.release)]
    added = _add(replace(found, rounds=(*found.rounds[:-1], screened)), passed, adding)
    if added is None:
        return None
    return added if _share_explained(found, added) >= n("accept.closure") else None


def _pruned(found: Search) -> Search:
    """The search without superfluous effects.

    Others added since explain the same, or one only led the fit to parameters that do as well without it.
    """
    fewer: dict[tuple[str, ...], Search] = {}
    for one in found.added:
        fewer[found.less(one.candidate)] = less = without_effect(found, one.candidate)
        if less.objective - found.objective + one.from_lengths < gate(one.candidate.family, found.numbers):
            return _pruned(refined(less, lambda share: None))
    return replace(found, without=fewer)


def without_effect(found: Search, candidate: Candidate) -> Search:
    """The search without one of its effects, everything else refitted unless that explains less."""
    if (known := found.without.get(found.less(candidate))) is not None:
        return known
    problem, start = removed(found, candidate)
    less = found.solved(problem, start, lambda share: None, settled=True)
    as_it_was = less.moved(start, np.zeros(len(start), bool), lambda share: None)
    if as_it_was.objective < less.objective:  # equations corrected for noise have their root elsewhere
        less = as_it_was
    return replace(less, added=tuple(one for one in found.added if one.candidate.name != candidate.name))


def _more_effects(found: Search, linear: Linearisation, progress: Progress) -> Search | None:
    """The search with one more effect, or with two where no one does as well; None if nothing is to be added."""
    n, scored = found.numbers.number, found.rounds[-1].scored
    passed = [one for one in scored if not one.refused]
    more = _add(found, passed, between(progress, 0.0, 0.6)) if passed else None
    for one in (_leading(found), _taken_up(found)):
        if more is None and one is not None:
            more = _proven_in_full(found, one, between(progress, 0.6, 0.7))
    strong = [one for one in scored if one.score.gain >= n("accept.look") and not one.candidate.release]
    few = best_per_family(strong, named=True)[: int(n("accept.paired"))]
    beyond = sorted((one.gain - gate(one.candidate.family, found.numbers) for one in few), reverse=True)
    hopeless = len(few) < 2 or beyond[0] + beyond[1] < 0.0
    full = len(found.added) + 2 > n("accept.effects")
    if hopeless or full or (more is not None and more.power < n("accept.settled")):
        return more
    first = score_pairs(found, linear, [one.candidate for one in few])[0]
    names = {few[i].candidate.family.named for i in first.places}
    if first.refused or (more is not None and more.added[-1].candidate.family.named in names):
        return more
    two = [
        replace(few[i], score=replace(few[i].score, amplitude=a))
        for i, a in zip(first.places, first.amplitudes, strict=True)
    ]
    return _better(found, more, two, between(progress, 0.7, 1.0))


def _better(found: Search, more: Search | None, two: Sequence[Scored], progress: Progress) -> Search | None:
    """The search with one more effect, or with two others if each of them is worth its threshold."""
    both = found
    for one, part in zip(two, split(progress, 2), strict=True):
        # one in the other's place may be added already
        there = {added.candidate.name for added in both.added}
        rivals = [o for o in (one, *_in_its_place(both, one)) if o.candidate.name not in there]
        both = (best_of(both, rivals, part, least=-np.inf) if rivals else None) or both
        if more is not None and _as_well(found, more, both):
            both = more
    gates, new = [gate(one.candidate.family, found.numbers) for one in two], both.added[len(found.added) :]
    new = tuple(replace(added, gain=loss_without(both, added.candidate)) for added in new)
    worth = all(added.gain >= gate(added.candidate.family, found.numbers) for added in new)
    if found.objective - both.objective < sum(gates) or not worth:
        return more
    both = replace(both, added=(*found.added, *new))
    return both if more is None or more.objective - both.objective >= max(gates) else more


def _as_well(found: Search, more: Search, first: Search) -> bool:
    """Whether the best single effect explains as much as the first of a pair: it won a contest on all components."""
    new = first.added[len(found.added) :]
    return len(new) == 1 and more.objective < first.objective < more.objective + new[0].apart


def _leading(found: Search) -> Scored | None:
    """The candidate that leads by far in cross-validation, but is refused: its linear estimate may be too far off."""
    n = found.numbers.number
    best = best_per_family([one for one in found.rounds[-1].scored if not one.candidate.release], named=True)
    best.sort(key=lambda one: -one.score.held_out.sum())
    if not best or not best[0].refused:
        return None
    first, family = best[0], best[0].candidate.family
    others = [o for o in best[1:] if o.candidate.family.named not in family.confused_with]
    second = others[0].score.held_out.sum() if others else 0.0
    least = max(n("accept.lead") * gate(family, found.numbers), n("accept.ahead") * second)
    return first if first.score.held_out.sum() > least else None


def _taken_up(found: Search) -> Scored | None:
    """The best candidate that masses moved together may have taken up (`moved_together`), if it is worth a look."""
    moved, least = moved_together(found), found.numbers.number("accept.look")
    some = (one for one in found.rounds[-1].scored if not one.candidate.release and one.gain >= least)
    return next((one for one in some if is_absorbed(one.candidate, moved)), None)


def _proven_in_full(found: Search, one: Scored, progress: Progress) -> Search | None:
    """The search with a leading candidate, if its joint fit explains enough of the residual beyond noise.

    Or gains far more than its threshold: held-out tests then decide (`withdrawal`). Not so of a family
    confusable with another form of friction, of which a large residual has always some to gain. Beside a far stronger
    effect on the same components, whose form may leave as much, it must explain a good part of what that leaves, with
    the same amplitude in all tests.
    """
    n = found.numbers.number
    more = best_of(found, [one, *_in_its_place(found, one)], progress)
    if more is None:
        return None
    best, share = more.added[-1], _share_explained(found, more)
    if best.gain < left_by_form(found, best.candidate):
        own = next(o for o in found.rounds[-1].scored if o.candidate == best.candidate)
        consistent = (
            own.score.held_out.min() > 0.0 and own.score.held_out.sum() >= n("accept.consistent") * own.score.gain
        )
        return more if consistent and share >= n("accept.most") and not is_confused(found, best.candidate) else None
    far = n("accept.lead") * gate(best.candidate.family, found.numbers)
    closes = share >= n("accept.closure")
    return more if closes or (best.gain >= far and not best.candidate.family.confusable) else None


def _share_explained(found: Search, more: Search) -> float:
    """Share of the log-likelihood beyond noise that the effect added last explains, in the column explained best."""
    family = more.added[-1].candidate.family
    return share_explained(found.problem, found.residual, more.residual, family, found.numbers)


def _in_its_place(found: Search, one: Scored, *, confused: bool = False) -> list[Scored]:
    """The best candidates of other families on the same components with nearly the same gain, not added yet.

    Or, of families confused with its own, with a good part of that gain, or not linear in their amplitudes.
    """
    near = found.numbers.number("accept.confused" if confused else "accept.near") * one.gain
    taken = {one.candidate.family.name, *(a.candidate.family.name for a in found.added)}
    known = [o for o in found.rounds[-1].scored if not o.candidate.release]
    some = [o for o in known if o.gain >= near or (confused and not o.candidate.family.linear)]
    if confused:
        some = [o for o in some if o.candidate.family.named in one.candidate.family.confused_with]
    there = best_per_family([o for o in some if o.candidate.components == one.candidate.components])
    rivals = [o for o in there if o.candidate.family.name not in taken]
    return rivals[: int(found.numbers.number("accept.rivals")) - 1]


def _add(found: Search, passed: Sequence[Scored], progress: Progress) -> Search | None:
    """Add the best candidate: the first of each family with nearly the largest gain is fitted jointly.

    Of those that explain the campaign equally well the simplest is kept. Where none of them passes after its joint fit,
    those next in gain are tried; None if none of these does either.
    """
    n, waiting = found.numbers.number, best_per_family(passed)
    for part in split(progress, int(n("accept.batches"))):
        near = n("accept.near") * waiting[0].gain if waiting else 0.0
        rivals = _of_few_names([one for one in waiting if one.gain >= near], int(n("accept.rivals")))
        if not rivals:
            return None
        waiting = [one for one in waiting if one not in rivals]
        rivals = _on_more_components(found, _with_confused(found, rivals))
        if (best := best_of(found, rivals, part)) is not None:
            return best
    return None


def _of_few_names(ranked: Sequence[Scored], count: int) -> list[Scored]:
    """Those of the first `count` families that a verdict reports, in each of their forms."""
    names = list(dict.fromkeys(one.candidate.family.named for one in ranked))[:count]
    return [one for one in ranked if one.candidate.family.named in names]


def _with_confused(found: Search, rivals: Sequence[Scored]) -> list[Scored]:
    """Candidates, and those confused with one of them that gain a good part on its components; by falling gain.

    Of two that explain alike, one may be refused by a hair, or its family be there on other components: joint fits
    decide, of fewer than twice as many candidates. And of those whose residuals are not linear in their amplitudes,
    whatever they gain to first order: a mass off the centre shows by its products of inertia, which are of second.
    """
    every = list(rivals)
    for one in rivals:
        every += [other for other in _in_its_place(found, one, confused=True) if other not in every]
    most = max(2 * int(found.numbers.number("accept.rivals")) - 1, len(rivals))
    ranked = enumerate(sorted(every, key=lambda one: -one.gain))
    return [one for i, one in ranked if i < most or not one.candidate.family.linear]


def _on_more_components(found: Search, rivals: Sequence[Scored]) -> list[Scored]:
    """Candidates, and each one's family on more components that gains nearly as much, where the residual is large.

    Shapes at their starts are far off there: a mass that sways along one axis seems to explain as much as along two.
    """
    if found.power < found.numbers.number("accept.settled"):
        return list(rivals)
    every, near = list(rivals), found.numbers.number("accept.near")
    for one in rivals:
        more = (o for o in found.rounds[-1].scored if one.candidate.is_part_of(o.candidate))
        wider = next((o for o in more if o.gain >= near * one.gain), None)
        if wider is not None and wider not in every:
            every.append(wider)
    return every

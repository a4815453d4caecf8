"""Effects that a search has added and that are no findings.

An effect is none whose size is at its bound, or that does not close the gap on tests that were not searched; nor is one
that may be another form of friction, where the report's friction on its components has run to its bound. On guides,
where few sensors leave much to be confused, it is none either with any of its numbers at a bound, if it cannot be
distinguished from zero, or if it is no more than what the form of friction may be off by; there effects are removed one
by one, with everything else refitted. A platform on legs is judged with all effects in place, but of two that pass for
each other the second without the first; an effect that cannot be distinguished from zero is none there beside a far
stronger one.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from ..core.arrays import Array
from ..identification.calibration.problem import Problem
from .acceptance import rows_shown, share_explained, squares_by_column
from .balances import HeldOut, gain_on, residual_at
from .estimates import Estimate, absorbing, amplitude_of, at_bounds, deviations, estimates_of, is_absorbed, owns
from .screening import is_confused
from .search import without_effect
from .search_state import AddedEffect, Search, fitted_machine
from .searched_range import within_search

__all__ = ["Why", "Withdrawn", "lowers_squares", "withdraw_effects"]

FRICTION = ("seal_friction", "pad_friction")
"""Keys of the report's dry friction."""

Why = Literal["at_bound", "zero", "own_form", "friction", "held_out"]


class Withdrawn(NamedTuple):
    """An effect that was added and is no finding."""

    name: str  # of the effect
    family: str
    why: Why  # own number at its bound; zero in its interval; small beside friction; in its place; held-out tests
    numbers: tuple[str, ...] = ()  # those at their bounds
    gain: float = float("nan")  # of log-likelihood on the held-out tests


def withdraw_effects(found: Search, held: Problem | None) -> tuple[Search, tuple[Withdrawn, ...]]:
    """Effects that are no findings, and the search, on guides without them; `held` are the held-out tests.

    These judge where legs are within the range that was searched (`searched_range`).
    """
    held = held and within_search(found, held)
    if found.problem.machine.motion == "free":
        return found, tuple(_doubtful(found, held))
    gone: list[Withdrawn] = []
    while (first := next(_doubtful(found, held), None)) is not None:
        gone.append(first)
        (one,) = (one for one in found.added if one.candidate.name == first.name)
        found = without_effect(found, one.candidate)
    return found, tuple(gone)


def _doubtful(found: Search, held: Problem | None) -> Iterator[Withdrawn]:
    """Effects that are no findings, once each: by their own numbers, then by held-out tests, by rising gain."""
    remaining = []
    bounded, estimates = at_bounds(found), estimates_of(found, deviations(found))
    for one in sorted(found.added, key=lambda one: one.gain):
        if (why := _by_estimate(found, one, bounded, estimates)) is not None:
            yield why
        else:
            remaining.append(one)
    if held is None or not remaining:
        return
    original, after = (residual_at(held, at) for at in (found.refit, found.solution))
    for one in remaining:
        if (why := _by_held_out(found, one, held, original, after)) is not None:
            yield why
            if is_confused(found, one.candidate):
                # of two that pass for each other neither is needed beside the other: the next is judged without it
                found = without_effect(found, one.candidate)
                after = residual_at(held, found.solution)


def _by_estimate(
    found: Search, one: AddedEffect, bounded: Sequence[str], estimates: Mapping[str, Estimate]
) -> Withdrawn | None:
    """Why an effect's own numbers reject it, if they do; `bounded` are the unknowns at a bound."""
    name, family, size = one.candidate.name, one.candidate.family, amplitude_of(one)
    guided = found.problem.machine.motion != "free"
    if at_bound := tuple(other for other in bounded if other == size or (guided and owns(one, other))):
        return Withdrawn(name, family.named, "at_bound", at_bound)
    if family.confusable and (ran := _own_friction(found, one, bounded)):
        return Withdrawn(name, family.named, "friction", ran)
    amplitude = estimates[size]
    if amplitude.low <= 0.0 <= amplitude.high and not one.candidate.release and (guided or _is_small(found, one)):
        return Withdrawn(name, family.named, "zero")
    if guided and family.confusable and amplitude.unit == "N" and abs(amplitude.value) < _form_error(found, one):
        return Withdrawn(name, family.named, "own_form")
    return None


def _is_small(found: Search, one: AddedEffect) -> bool:
    """Whether an effect gains little beside another: what the form of that one leaves may look like it."""
    others = (other.gain for other in found.added if other is not one)
    return one.gain < found.numbers.number("verdict.beside") * max(others, default=0.0)


def _own_friction(found: Search, one: AddedEffect, bounded: Sequence[str]) -> tuple[str, ...]:
    """Numbers of the report's friction on the components of an effect that ran to their bounds, which it replaces.

    Those common to all components of a kind: the effect is then this friction, in another form.
    """
    kinds = {c.kind for c in found.problem.machine.components if c.name in one.candidate.components}
    return tuple(name for kind in kinds for key in FRICTION if (name := f"{kind}.{key}") in bounded)


def _form_error(found: Search, one: AddedEffect) -> float:
    """Force [N] by which the form of friction may be off on the components of an effect."""
    machine = fitted_machine(found.solution)
    friction = [actuator.seal_friction for actuator in machine.actuators if actuator.name in one.candidate.components]
    return found.numbers.number("verdict.own_form") * min(friction, default=0.0)


def _by_held_out(found: Search, one: AddedEffect, held: Problem, original: HeldOut, after: HeldOut) -> Withdrawn | None:
    """Whether held-out tests reject an effect: it does not close the gap there.

    original is their residual before any effect, `after` that of the search's solution. The effect is compared with
    everything else refitted without it, in the residuals that its family shows in. It must gain there more than
    scatters by noise, sqrt(2 expected), and a share of what is expected of it, or as much as no form of another does;
    and lower the squares in some column by a share of those before any effect. Not so where parameters run to their
    bounds without it, where it explains half of what is beyond noise there, or where it gains most of what is
    expected, and is one of two of a family or explains a good part of that. Where nothing is beyond noise without it,
    no form of another effect can pass for it, and any gain speaks for it: with it the gain has mean `expected`,
    without it -expected. One that the held-out tests do not excite, with an expected gain within chance, stays, unless
    it loses more than by chance there, and than a small share of its gain. On a table with one actuator these two do
    not hold: every test excites it, and few sensors leave much to be confused.
    """
    if one.candidate.release and one.candidate.release in {u.name for u in found.problem.unknowns}:
        return None  # a sensor's error
    n, single = found.numbers.number, len(found.problem.machine.actuators) == 1
    less = without_effect(found, one.candidate)
    before = residual_at(held, less.solution)
    family = one.candidate.family
    rows = rows_shown(held, family)
    gain, expected = gain_on(held, before, after, rows)
    withdrawn = Withdrawn(one.candidate.name, family.named, "held_out", gain=gain)
    if not single and expected <= n("accept.chance"):
        return withdrawn if gain < -max(n("accept.chance"), n("accept.idle") * one.gain) else None
    share = share_explained(held, before.whitened, after.whitened, family, found.numbers)
    if not single and np.isnan(share):
        return withdrawn if gain < 0.0 else None
    if gain < max(np.sqrt(2.0 * expected), min(n("accept.held_out") * expected, n("accept.proven"))):
        return withdrawn
    first, old, new = (squares_by_column(at.whitened)[rows] for at in (original, before, after))
    if lowers_squares(first, old, new, n("accept.of_first")) or is_absorbed(one.candidate, absorbing(less)):
        return None
    as_expected = gain >= n("accept.expected") * expected
    if share >= n("accept.half") or (as_expected and (_is_one_of_two(found, one) or share >= n("accept.most"))):
        return None
    return withdrawn


def _is_one_of_two(found: Search, one: AddedEffect) -> bool:
    """Whether another effect of the same family was added, on other components."""
    return any(other is not one and other.candidate.family.name == one.candidate.family.name for other in found.added)


def lowers_squares(first: Array, before: Array, after: Array, share: float) -> bool:
    """Whether squares by column (c,) fall in one of them by at least a share of the `first` ones."""
    return bool(np.any(before - after >= share * first))

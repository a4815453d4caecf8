"""Effects that a search has added and that are no findings, withdrawn one by one with everything else refitted.

An effect is withdrawn that has a number at its bound, that cannot be told from zero, that is no more than what the form
of friction may be off by, or that does not close the gap on tests that were not searched.
"""

from typing import Literal, NamedTuple

import numpy as np

from ..core.arrays import Array
from ..identification.calibration.problem import Problem
from ..identification.residuals import kinds_shown
from .acceptance import squares_by_column
from .balances import gain_on, residual_at
from .estimates import amplitude_of, at_bounds, estimates_of, owns
from .search import without_effect
from .search_state import AddedEffect, Search, fitted_machine

__all__ = ["Why", "Withdrawn", "lowers_squares", "withdraw_effects"]

Why = Literal["at_bound", "zero", "own_form", "held_out"]


class Withdrawn(NamedTuple):
    """An effect that was added and is no finding."""

    family: str
    why: Why  # a number at its bound; zero within its interval; too small beside friction; gain on held-out tests
    numbers: tuple[str, ...] = ()  # those at their bounds
    gain: float = float("nan")  # of log-likelihood on the held-out tests


def withdraw_effects(found: Search, held: Problem | None) -> tuple[Search, tuple[Withdrawn, ...]]:
    """The search without its effects that are no findings, and why each is none; `held` are the held-out tests."""
    gone: list[Withdrawn] = []
    while (weakest := _by_estimate(found) or _by_held_out(found, held)) is not None:
        one, why = weakest
        gone.append(why)
        found = without_effect(found, one.candidate)
    return found, tuple(gone)


def _by_estimate(found: Search) -> tuple[AddedEffect, Withdrawn] | None:
    """The effect of least gain that its own numbers reject."""
    bounded, estimates = at_bounds(found), estimates_of(found)
    for one in sorted(found.added, key=lambda one: one.gain):
        family, amplitude = one.candidate.family.named, estimates[amplitude_of(one)]
        if at_bound := tuple(name for name in bounded if owns(one, name)):
            return one, Withdrawn(family, "at_bound", at_bound)
        if not one.candidate.release and amplitude.low <= 0.0 <= amplitude.high:
            return one, Withdrawn(family, "zero")
        if one.candidate.family.confusable and amplitude.unit == "N" and abs(amplitude.value) < _form_error(found, one):
            return one, Withdrawn(family, "own_form")
    return None


def _form_error(found: Search, one: AddedEffect) -> float:
    """Force [N] by which the form of friction may be off on the components of an effect, of a platen on guides."""
    machine = fitted_machine(found.solution)
    if machine.motion == "free":
        return 0.0
    friction = [actuator.seal_friction for actuator in machine.actuators if actuator.name in one.candidate.components]
    return found.numbers.number("verdict.own_form") * min(friction, default=0.0)


def _by_held_out(found: Search, held: Problem | None) -> tuple[AddedEffect, Withdrawn] | None:
    """The effect of least gain that does not close the gap on held-out tests.

    Each effect is compared with everything else refitted without it, in the residuals that its family shows in. It must
    gain there a share of what is expected of it, and more than that scatters by noise, sqrt(2 expected); and lower the
    squares in some column by a share of those before any effect. One that the held-out tests do not excite, with an
    expected gain within chance, stays, but not on a table with one actuator, which every test excites.
    """
    if held is None or not found.added:
        return None
    single = len(found.problem.machine.actuators) == 1
    n, original, after = found.numbers.number, residual_at(held, found.refit), residual_at(held, found.solution)
    for one in sorted(found.added, key=lambda one: one.gain):
        if one.candidate.release and one.candidate.release in {u.name for u in found.problem.unknowns}:
            continue  # a sensor's error
        before = residual_at(held, without_effect(found, one.candidate).solution)
        kinds = kinds_shown(one.candidate.family.shows_in, held.tests[0].channels)
        rows = np.any([held.rows(kind) for kind in kinds if kind in held.kinds], axis=0)
        gain, expected = gain_on(held, before, after, rows)
        first, old, new = (squares_by_column(part.whitened)[rows] for part in (original, before, after))
        lower = lowers_squares(first, old, new, n("accept.of_first"))
        least = max(np.sqrt(2.0 * expected), n("accept.held_out") * expected)
        if (single or expected > n("accept.chance")) and (not lower or gain < least):
            return one, Withdrawn(one.candidate.family.named, "held_out", gain=gain)
    return None


def lowers_squares(first: Array, before: Array, after: Array, share: float) -> bool:
    """Whether squares by column (c,) fall in one of them by at least a share of the `first` ones."""
    return bool(np.any(before - after >= share * first))

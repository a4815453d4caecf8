"""An effect found, as a verdict states it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from scipy.special import chdtrc

from ..machine.library import find_family
from .estimates import Estimate

__all__ = ["Alternative", "EffectFinding", "alternatives_of", "p_value_of"]


@dataclass(frozen=True)
class EffectFinding:
    """An effect found."""

    family: str
    components: tuple[str, ...]
    parameters: dict[str, Estimate]
    gain: float  # log-likelihood; of a parameter far off, half the square of its distance
    p_value: float
    rivals: tuple[str, ...] = ()  # families that explain the campaign equally well
    form: str = ""  # entry of the library, where a family has several forms
    alternatives: tuple["Alternative", ...] = ()  # itself and all families fitted in its place, by falling probability

    @property
    def kind(self) -> str:
        """What it and its rivals have in common; empty where they are of different kinds, or of none."""
        kinds = {find_family(name).kind for name in (self.family, *self.rivals)}
        return kinds.pop() if len(kinds) == 1 else ""

    @property
    def probability(self) -> float:
        """Of its family among those fitted in its place; 1 without any."""
        return next((one.probability for one in self.alternatives if one.family == self.family), 1.0)


class Alternative(NamedTuple):
    """A family fitted in an effect's place."""

    family: str
    probability: float  # among those fitted


def alternatives_of(behind: Mapping[str, float], apart: float) -> tuple[Alternative, ...]:
    """Probabilities of families by the log-likelihood that each is `behind`, best forms of each.

    The likelihood is tempered: families within `apart` explain a campaign equally well, since no real law is exactly
    that of the library. A family that far behind has odds of one to twenty.
    """
    temper = max(apart, 1.0) / math.log(20.0)
    weight = {name: math.exp(-max(value, 0.0) / temper) for name, value in behind.items()}
    whole = sum(weight.values())
    found = [Alternative(name, value / whole) for name, value in weight.items()]
    return tuple(sorted(found, key=lambda one: -one.probability))


def p_value_of(gain: float, numbers: int, tried: int) -> float:
    """Chance that one of `tried` candidates with so many numbers gains as much where nothing is there."""
    return min(1.0, float(chdtrc(numbers, 2.0 * gain)) * tried)

"""Play in an actuator's swivel: the rod runs ahead of the platen by as much as its pin is loose.

    delta(f) = j f / sqrt(f^2 + f_0^2)        rod ahead of the platen [m], by the force through the pin

f [N] force of the oil on the rod, positive when it lengthens the actuator; j [m] half the play; f_0 [N] force that
closes most of it: flanks of pin and bush meet gradually. The rod takes up the play whenever its force changes sign, and
the chambers feel that as a stroke of their own.
Stored energy: j f_0 (1 - f_0 / sqrt(f^2 + f_0^2)), the integral of f d(delta).
Source: derived here; contact of a pin in a bush, rod without mass.
"""

import math
from typing import Annotated, NamedTuple

from ..core.compiled import compiled
from .contract import Law

__all__ = ["LAW", "Play", "play_energy", "play_slope", "play_travel"]


class Play(NamedTuple):
    """Parameters."""

    half_play: Annotated[float, "m"]
    closing_force: Annotated[float, "N"]


LAW = Law(Play, modifies="oil", fields=("play", "play_force"))


@compiled
def play_travel(force: float, play: float, closing: float) -> float:
    """Rod ahead of the platen [m] under a force [N]; play [m] half of what is loose, closing [N]."""
    return play * force / math.sqrt(force * force + closing * closing)


@compiled
def play_slope(force: float, play: float, closing: float) -> float:
    """d(delta)/df [m/N] of the same."""
    share = closing * closing / (force * force + closing * closing)
    return play * share * math.sqrt(share) / closing


@compiled
def play_energy(force: float, play: float, closing: float) -> float:
    """Energy that the flanks hold under a force [N], in joules."""
    return play * closing * (1.0 - closing / math.sqrt(force * force + closing * closing))

"""Figure of a battery: how strong an effect must be to be named, and how far stated probabilities hold."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib
from docs.figures import FAINT, INK, PAPER, PLAIN, STYLE
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lhpost6_pin.core.files import write_whole

from .scoring import Share, wilson

__all__ = ["draw_curves"]

FOUND = "#0B6E99"


def draw_curves(strength: Mapping[str, Share], reliable: Mapping[str, Share], path: Path) -> None:
    """Write the strength curve and the reliability of names as SVG; keys are ranges in words, such as `1 to 2`."""
    with matplotlib.rc_context(STYLE), write_whole(path) as beside:
        figure = Figure(figsize=(10.0, 4.2), layout="constrained")
        left, right = figure.subplots(1, 2)
        _shares(left, {words: share for words, share in strength.items() if share.of})
        left.set(title="Hidden effects that were named", xlabel="gap of the effect over sensor noise")
        for place, words in enumerate(reliable):
            low, high = (100.0 * float(edge) for edge in words.split(" to "))
            label = "stated probability" if place == 0 else None
            right.bar(place, high - low, 0.7, low, color=FAINT, alpha=0.35, label=label)
        _shares(right, reliable)
        right.set(title="Names that were right", xlabel="stated probability of the name")
        right.legend(loc="lower right", bbox_to_anchor=(1.0, 0.19), frameon=False)
        figure.savefig(beside, format="svg", metadata=PLAIN, facecolor=PAPER)


def _shares(axes: Axes, shares: Mapping[str, Share]) -> None:
    """Shares in per cent with their 95 % Wilson intervals and counts, a place for each."""
    for place, share in enumerate(shares.values()):
        low, high = (100.0 * edge for edge in wilson(*share))
        axes.plot((place, place), (low, high), color=FOUND, lw=2.0)
        axes.plot(place, 100.0 * share.hits / share.of, "o", color=FOUND, ms=8)
        axes.text(place, -14.0, f"{share.hits}\nof {share.of}", ha="center", va="center", fontsize=10, color=INK)
    short = [words.replace(" to ", "–").replace("above", ">") for words in shares]
    axes.set_xticks(range(len(shares)), short, fontsize=10)
    axes.set(xlim=(-0.6, len(shares) - 0.4), ylim=(-24.0, 104.0), ylabel="share [%]", yticks=range(0, 101, 20))
    axes.grid(axis="y", color=FAINT, alpha=0.25)

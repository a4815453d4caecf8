"""Scores of a battery: what was named, what was missed, and how sure these shares are."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

__all__ = ["Share", "score", "wilson"]

Label = Mapping[str, Any]
Answer = Mapping[str, Any]  # a verdict.json


class Share(NamedTuple):
    """So many of so many, with the 95 % Wilson interval of the share."""

    hits: int
    of: int

    @property
    def text(self) -> str:
        """In words: share, interval, counts."""
        if self.of == 0:
            return "no case"
        low, high = wilson(self.hits, self.of)
        return f"{100 * self.hits / self.of:.0f} % ({100 * low:.0f} to {100 * high:.0f}), {self.hits} of {self.of}"


def wilson(hits: int, of: int, z: float = 1.96) -> tuple[float, float]:
    """Interval of a share by Wilson's score."""
    share, square = hits / of, z * z / of
    middle = (share + square / 2) / (1 + square)
    half = z / (1 + square) * math.sqrt(share * (1 - share) / of + square / of / 4)
    return middle - half, middle + half


def families(one: Answer | Label) -> list[str]:
    """Families of the effects, in order."""
    return [effect["family"] for effect in one["effects"]]


def reach(label: Label) -> float:
    """Gap of the strongest effect over the floor; where only means shift, their offset."""
    return max((max(e["gap"], e["offset"]) for e in label["effects"]), default=0.0)


def score(cases: Sequence[tuple[Label, Answer]]) -> dict[str, Share | float]:
    """Metrics by name; cases pair labels with verdicts."""

    def share(of: Callable[[Label], bool], hit: Callable[[Label, Answer], bool]) -> Share:
        some = [(label, answer) for label, answer in cases if of(label)]
        return Share(sum(hit(label, answer) for label, answer in some), len(some))

    def sort(*names: str) -> Callable[[Label], bool]:
        return lambda label: label["sort"] in names

    def known(label: Label) -> bool:
        return label["sort"] in ("one", "two", "three") and reach(label) >= 1.0

    def exact(label: Label, answer: Answer) -> bool:
        return set(families(label)) == set(families(answer))

    def right_components(label: Label, answer: Answer) -> bool:
        named = {e["family"]: set(e["components"]) for e in answer["effects"]}
        return all(named[e["family"]] == set(e["components"]) for e in label["effects"] if e["family"] in named)

    def only_what_is_there(label: Label, answer: Answer) -> bool:
        """What no test was meant to move may be told from its traces all the same."""
        return set(families(answer)) <= {decoy["family"] for decoy in label["decoys"]}

    closures = [
        gap["closure"]
        for label, answer in cases
        if known(label) and answer["effects"]
        for phase in answer["closure"].values()
        for gap in phase.values()
        if gap["closure"] is not None
    ]
    named = [(label, answer) for label, answer in cases if answer["effects"]]
    false = sum(len(set(families(answer)) - set(families(label))) for label, answer in named)
    return {
        "false name on nulls": share(sort("null", "absorbable", "sensor"), lambda _, a: bool(a["effects"])),
        "verdict right on nulls": share(sort("null", "absorbable"), lambda label, a: a["verdict"] in label["accept"]),
        "sensor found": share(sort("sensor"), lambda _, a: a["verdict"] == "sensor"),
        "family first": share(known, lambda label, a: families(a)[:1] != [] and families(a)[0] in families(label)),
        "exact set, one effect": share(lambda x: known(x) and x["sort"] == "one", exact),
        "exact set, two effects": share(lambda x: known(x) and x["sort"] == "two", exact),
        "exact set, three effects": share(lambda x: known(x) and x["sort"] == "three", exact),
        "components right where named": share(known, right_components),
        "none of the above, named": share(sort("unknown"), lambda _, a: bool(a["effects"])),
        "none of the above, flagged": share(sort("unknown"), lambda _, a: a["verdict"] == "unexplained"),
        "unexcited, nothing else named": share(sort("unexcited"), only_what_is_there),
        "false among all names": Share(false, sum(len(families(answer)) for _, answer in named)),
        "median closure on held-out tests": sorted(closures)[len(closures) // 2] if closures else math.nan,
        "held-out tests that got worse": Share(sum(c < -0.02 for c in closures), len(closures)),
    }

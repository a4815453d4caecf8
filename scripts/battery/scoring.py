"""Scores of a battery: what was named, what was missed, and how sure these shares are."""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from statistics import median
from typing import Any, NamedTuple

__all__ = [
    "Share",
    "families",
    "misses",
    "named_what_is_there",
    "reach",
    "reliability",
    "score",
    "shows",
    "strength_curve",
    "wilson",
]

Label = Mapping[str, Any]
Answer = Mapping[str, Any]  # a verdict.json


STRENGTHS = (0.0, 0.5, 1.0, 2.0, 4.0, 10.0, 100.0, math.inf)
"""Edges of the strength curve: gap over the floor."""


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
    return max(0.0, middle - half), min(1.0, middle + half)


def families(one: Answer | Label) -> list[str]:
    """Families of the effects, in order."""
    return [effect["family"] for effect in one["effects"]]


def reach(label: Label) -> float:
    """Gap of the strongest effect over the floor; where only means shift, their offset."""
    return max((max(e["gap"], e["offset"]) for e in label["effects"]), default=0.0)


def named_what_is_there(label: Label, answer: Answer) -> bool:
    """Whether all that was named is hidden in a case: what no test was meant to move may be told from its traces."""
    hidden = (*label["effects"], *label["decoys"]) if label["sort"] == "unexcited" else label["effects"]
    return set(families(answer)) <= {effect["family"] for effect in hidden}


def strength_curve(cases: Sequence[tuple[Label, Answer]]) -> dict[str, Share]:
    """How many of the known effects were named, alone or beside others, by the gap of each over the floor."""
    hidden = [
        (max(effect["gap"], effect["offset"]), effect["family"] in families(answer))
        for label, answer in cases
        if label["sort"] in ("one", "two", "three")
        for effect in label["effects"]
    ]
    curve = {}
    for low, high in pairwise(STRENGTHS):
        hits = [hit for gap, hit in hidden if low <= gap < high]
        words = f"{low:g} to {high:g}" if math.isfinite(high) else f"above {low:g}"
        curve[words] = Share(sum(hits), len(hits))
    return curve


SHOWS = 0.1
"""What an effect adds to a phase, over noise, from which it shows there."""

OF_SPOOLS = ("transport_delay", "spool_lag")
"""Families that do not show where spools are measured: neither in inverse dynamics nor in the open loop."""


def shows(label: Label, phase: str) -> bool:
    """Whether an effect of a case shows in a phase by more than a tenth of the noise.

    Inverse dynamics compares wrenches and the struts' gas, both loops what oil and supply do, too. A label of a
    one-axis case states no figures by channel: its effect's own gap counts in every phase.
    """
    if any("owns" not in effect for effect in label["effects"]):
        return reach(label) > SHOWS
    felt = (
        ("acceleration", "gas") if phase == "inverse dynamics" else ("acceleration", "gas", "pressure_rate", "supply")
    )
    seen = [e for e in label["effects"] if phase == "closed loop" or e["family"] not in OF_SPOOLS]
    return any(effect["owns"].get(name, 0.0) > SHOWS for effect in seen for name in felt)


RELIABILITY = (0.0, 0.5, 0.7, 0.9, 0.99, 1.01)
"""Edges of the stated probability of a name in the table of its reliability."""


def reliability(cases: Sequence[tuple[Label, Answer]]) -> dict[str, Share]:
    """How many of the names given were right, by their stated probability."""
    named = [
        (effect.get("probability", 1.0), effect["family"] in families(label))
        for label, answer in cases
        for effect in answer["effects"]
        if label["sort"] != "unexcited"
    ]
    return {
        f"{low:g} to {min(high, 1.0):g}": Share(sum(hits), len(hits))
        for low, high in pairwise(RELIABILITY)
        if (hits := [hit for chance, hit in named if low <= chance < high])
    }


def misses(label: Label, answer: Answer) -> list[tuple[str, float, str]]:
    """Hidden effects that were not named: family, gap over the floor, and why, by the last round of the search."""
    found = []
    for effect in label["effects"] if label["sort"] in ("one", "two", "three") else ():
        family = effect["family"]
        if family in families(answer):
            continue
        gone = [f"withdrawn: {w['why']}" for w in answer.get("withdrawn", ()) if w["family"] == family]
        seen = [c for one in answer.get("considered", ()) for c in one if c["family"] == family]
        last = [f"{c['refused'] or 'passes, but another fits as well'} (gain {c['gain']:.0f})" for c in seen[-1:]]
        blind = ["not testable with the sensors that were left"] * (family in answer.get("not_testable", ()))
        why = (gone or last or blind or ["no gain"])[0]
        found.append((family, max(effect["gap"], effect["offset"]), why))
    return found


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

    gaps = [
        [
            gap
            for phase, tests in answer["closure"].items()
            for gap in tests.values()
            if gap["closure"] is not None and shows(label, phase)
        ]
        for label, answer in cases
        if known(label) and answer["effects"]
    ]
    placed = [  # effects of the platen and the supply have one place only
        set(effect["components"]) == set(one["components"])
        for label, answer in cases
        if known(label)
        for effect in label["effects"]
        for one in answer["effects"]
        if effect["components"] and one["family"] == effect["family"]
    ]
    closures = [gap["closure"] for some in gaps for gap in some]
    widest = [max(some, key=lambda gap: gap["refitted"])["closure"] for some in gaps if some]
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
        "components right where named": Share(sum(placed), len(placed)),
        "none of the above, named": share(sort("unknown"), lambda _, a: bool(a["effects"])),
        "none of the above, flagged": share(sort("unknown"), lambda _, a: a["verdict"] == "unexplained"),
        "unexcited, nothing else named": share(sort("unexcited"), named_what_is_there),
        "false among all names": Share(false, sum(len(families(answer)) for _, answer in named)),
        "median closure on held-out tests": median(closures) if closures else math.nan,
        "the same where a case's gap is widest": median(widest) if widest else math.nan,
        "held-out tests that got worse": Share(sum(c < -0.02 for c in closures), len(closures)),
    }

"""The verdict on a search: one word, the effects identified, and the parameters and sensors that differ.

A fitted parameter within 3 sigma of its prior counts as calibration; beyond that it is reported as an effect of its
family (seven times the leakage: worn seals).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from ..identification.calibration.scale import Scale, ratios
from ..machine.parameters import Parameters
from .acceptance import form_share
from .estimates import Estimate, amplitude_of, at_bounds, covariance_of, estimates_of, interval_reach, owns, sums_of
from .fading import Fading
from .finding import EffectFinding, alternatives_of, p_value_of
from .localise import Spot, worst_spots
from .outlying import outlying_parameters
from .residual_function import ResidualFunction
from .search_state import AddedEffect, Search
from .sensor_findings import SensorFault
from .unexplained import leaves_much, more_than_noise, remainders
from .withdrawal import Withdrawn

__all__ = ["SensorFinding", "Verdict", "Word", "judge", "reject_effects"]

Functions = Sequence[ResidualFunction]
MASS = "added_mass"  # family of masses beyond their priors
Word = Literal["none", "parameters_only", "sensor", "named", "ambiguous", "unexplained", "not_testable"]


@dataclass(frozen=True)
class SensorFinding:
    """A sensor that is off beyond the range of the sensors' file."""

    name: str
    family: str
    estimate: Estimate
    stated: float  # largest error that the sensors' file allows; of a delay, of both groups together
    reference: str = ""  # group of channels that a delay is relative to


@dataclass(frozen=True)
class Verdict:
    """What a search has found."""

    word: Word
    effects: tuple[EffectFinding, ...]
    changed: dict[str, Estimate]  # parameters that differ from what the machine file states, within calibration
    sensors: tuple[SensorFinding, ...]
    residual_function: ResidualFunction | None  # of the effect that was not identified
    untestable: tuple[str, ...]  # families that this campaign could not show, at typical size
    nearest: tuple[str, ...] = ()  # families nearest to the effect that was not identified
    where: tuple[Spot, ...] = ()  # where most of the unexplained residual is, by falling share
    withdrawn: tuple[Withdrawn, ...] = ()  # effects that were added and are no findings
    bounded: tuple[str, ...] = ()  # unknowns at a bound, which are no estimates
    scale: Scale | None = None  # that nothing measured fixes
    ratios: Mapping[str, Estimate] = field(default_factory=dict)  # to that scale, of what was estimated
    sums: Mapping[tuple[str, str], Estimate] = field(default_factory=dict)  # of unknowns that have no interval alone
    remainder: Mapping[str, float] = field(default_factory=dict)  # of the squares beyond noise, by kind of residual
    fading: tuple[Fading, ...] = ()  # forces that were taken for elastic ones


def judge(
    found: Search,
    beside: Functions,
    replacing: Functions,
    faults: Sequence[SensorFault],
    withdrawn: tuple[Withdrawn, ...],
    fading: tuple[Fading, ...] = (),
) -> Verdict:
    """The verdict on a search.

    beside are residual functions fitted in addition to the effects, replacing those fitted in their place, both by
    falling gain; faults are of sensors whose records were corrected before; `withdrawn` effects are no findings, though
    they may be in the search; those `fading` are not what they were taken for.
    """
    problem, x, numbers, calibration = found.problem, found.solution.x, found.numbers, found.calibration
    own = tuple(f"{one.candidate.name}." for one in found.added)
    covariance = covariance_of(found)
    sd = np.sqrt(np.diag(covariance))
    estimates = estimates_of(found, sd)
    released = tuple(
        SensorFinding(u.name, one.candidate.family.named, estimates[u.name], float(np.sqrt(3.0) * u.sd))
        for u in problem.unknowns
        for one in found.added
        if one.candidate.release == u.name
    )
    reach = interval_reach(numbers.number("verdict.probability"))
    sensors = (*(_of_fault(f, reach) for f in faults), *released)
    known = {one.name for one in sensors}
    late = [d for d in problem.delays if d.beyond(calibration.number("report.deviations"))]
    behind = (SensorFault("delay", d.group, "", d.delay, "s", d.deviation, d.stated, d.reference) for d in late)
    removed = tuple(_of_fault(f, reach) for f in behind if f.name not in known)  # no part of the verdict's word
    rescaled = _rescaled(found)
    gone = {one.name for one in withdrawn}
    unproven = {one.name for one in withdrawn if one.why == "held_out"}
    others = {s.name for s in released} | rescaled | unproven
    kept = [one for one in found.added if one.candidate.name not in others]
    sure = np.abs(x) > interval_reach(1.0 - numbers.number("verdict.chance") / len(problem.parameters)) * sd
    material = np.abs(x) > calibration.number("report.material") * problem.stated
    differs = {p.name for i, p in enumerate(problem.parameters) if sure[i] and material[i]}
    differs -= {name for name in differs if name.startswith(own) or name in problem.free}
    differs |= {amplitude_of(one) for one in found.added if one.candidate.name in rescaled}
    changed = {name: estimate for name, estimate in estimates.items() if name in differs}
    function, rejected = reject_effects(kept, beside, replacing, numbers)
    rejected |= {one.candidate.name for one in kept if not one.from_lengths and leaves_much(one, kept, found)}
    fading = tuple(one for one in fading if one.candidate.name not in gone)
    rejected |= {one.candidate.name for one in fading}
    bounded = at_bounds(found)
    drifting = any(fault.kind == "drift" for fault in faults)  # of a sensor, or of its mount
    unexplained = function is not None or bool(rejected) or drifting or more_than_noise(found)
    nearest = tuple(one.candidate.family.named for one in kept if one.candidate.name in rejected)
    outlying = tuple(outlying_parameters(found, sd, estimates, gone))
    identified = [_of_added(one, estimates) for one in kept if one.candidate.name not in rejected | gone]
    effects = _merged([*identified, *outlying])
    left = found.bare if gone and not effects and more_than_noise(found.bare) else found
    if left is not found:  # what was withdrawn explains nothing, and without it the model does not either
        unexplained, nearest = True, tuple(one.family for one in withdrawn)
    changed = {name: one for name, one in changed.items() if not any(name in other.parameters for other in outlying)}
    hidden, testable = _untestable(found)
    blind = len(hidden) > numbers.number("verdict.blind") * (len(hidden) + testable)
    word: Word = "not_testable" if blind else "parameters_only" if changed else "none"
    if unexplained:
        word = "unexplained"
    elif effects:
        word = "ambiguous" if any(e.rivals for e in effects) else "named"
    elif sensors:
        word = "sensor"
    tested = {family for one in found.added for family in (one.candidate.family.named, *one.forms)}
    hidden = tuple(name for name in hidden if name not in tested)  # by a fit of its own, whatever a screening shows
    spots = tuple(worst_spots(problem, left.residual)) if unexplained else ()
    kept_own = tuple(f"{one.candidate.name}." for one in found.added if one.candidate.name not in gone)
    listed = changed | {name: estimate for name, estimate in estimates.items() if name.startswith(kept_own)}
    scaled = ratios(problem.scale, ((n, e.unit, e.value, e.low, e.high) for n, e in listed.items() if n not in bounded))
    return Verdict(
        *(word, effects, changed, (*sensors, *removed), function, hidden, nearest, spots, withdrawn, bounded),
        scale=problem.scale,
        ratios={name: Estimate(*ratio) for name, ratio in scaled.items()},
        remainder=remainders(found) if effects else {},
        fading=fading,
        sums={names: total for names, total in sums_of(found, covariance).items() if set(names) & set(changed)},
    )


def _rescaled(found: Search) -> set[str]:
    """Masses added or released from their priors where only their ratio to a stated number is known, by name.

    What has changed is that ratio: the number may be wrong, or the mass.
    """
    scale = found.problem.scale
    names = {one.candidate.name for one in found.added if one.candidate.family.named == MASS}
    return names if scale is not None and scale.unit else set()


def _untestable(found: Search) -> tuple[tuple[str, ...], int]:
    """Families of which no candidate's typical size is significant; and how many others there are."""
    clear: dict[str, bool] = {}
    for one in found.rounds[-1].scored:
        if not one.candidate.release:
            name, typical = one.candidate.family.named, one.candidate.amplitudes[0].typical
            significant = bool(one.score.sd[0] * found.numbers.number("verdict.clear") < typical)
            clear[name] = clear.get(name, False) or significant
    hidden = tuple(name for name, significant in clear.items() if not significant)
    return hidden, len(clear) - len(hidden)


def _of_added(added: AddedEffect, estimates: Mapping[str, Estimate]) -> EffectFinding:
    candidate = added.candidate
    own = {name.removeprefix(f"{candidate.name}."): value for name, value in estimates.items() if owns(added, name)}
    return EffectFinding(
        family=candidate.family.named,
        components=candidate.components,
        parameters=own,
        gain=added.gain,
        p_value=p_value_of(added.gain, len(own), added.tried),
        rivals=tuple(dict.fromkeys(one.candidate.family.named for one in added.rivals)),
        form=candidate.family.name,
        alternatives=alternatives_of(_behind(added), added.apart),
    )


def _behind(added: AddedEffect) -> dict[str, float]:
    """Log-likelihood by which the best form of each family fitted in an effect's place is behind it."""
    behind: dict[str, float] = {}
    for one in added.contest:
        name = one.candidate.family.named
        behind[name] = min(behind.get(name, np.inf), one.behind)
    return behind


def _of_fault(fault: SensorFault, reach: float) -> SensorFinding:
    low, high = (fault.value + side * reach * fault.deviation for side in (-1.0, 1.0))
    estimate = Estimate(fault.value, fault.unit, low, high)
    return SensorFinding(fault.name, fault.family, estimate, fault.stated, fault.reference)


def _merged(effects: Sequence[EffectFinding]) -> tuple[EffectFinding, ...]:
    """Findings of one family from parameters of several kinds as one."""
    merged: dict[str, EffectFinding] = {}
    for one in effects:
        key = one.family if "." in next(iter(one.parameters), "") else f"{one.family} {one.components}"
        if (first := merged.get(key)) is not None:
            one = replace(
                first,
                components=tuple(dict.fromkeys((*first.components, *one.components))),
                parameters={**first.parameters, **one.parameters},
                gain=first.gain + one.gain,
                p_value=min(first.p_value, one.p_value),
                rivals=tuple(name for name in first.rivals if name in one.rivals),  # each kind excludes others
            )
        merged[key] = one
    return tuple(merged.values())


def reject_effects(
    kept: Sequence[AddedEffect],
    beside: Functions,
    replacing: Functions,
    numbers: Parameters,
) -> tuple[ResidualFunction | None, set[str]]:
    """The residual function that is reported, and the effects that it rejects.

    A function fitted in place of all forces that were added rejects them if it explains far more. One fitted in
    addition rejects those that it outweighs; where it is small against an effect found there, it is attributed to the
    form of that effect and not reported.
    """
    n = numbers.number

    def first(functions: Functions) -> ResidualFunction | None:
        """The significant function that gains most, if it passes cross-validation."""
        least, validated = n("left.gain"), n("accept.held_out") * n("left.gain")
        found = (o for o in functions if min(o.gain, o.beyond) > least and o.held_out.sum() > validated)
        return next(found, None)

    forces = [one for one in kept if "wrench" in one.candidate.family.shows_in]
    better, function = first(replacing), first(beside)
    if forces and better is not None and better.gain > n("left.better") * sum(one.gain for one in forces):
        return better, {one.candidate.name for one in forces}
    if function is None:
        return None, set()
    legs, rejected = set(function.components), set()
    for one in forces:
        there = set(one.candidate.components)
        share = form_share(one.candidate.family, numbers) if legs <= there else n("verdict.elsewhere")
        if function.gain < share * one.gain:
            return None, set()
        if function.gain > (n("accept.again") if legs & there else 1.0) * one.gain:
            rejected.add(one.candidate.name)
    return function, rejected

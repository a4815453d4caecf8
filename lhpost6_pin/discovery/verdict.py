"""The verdict on a search: one word, the effects identified, and the parameters and sensors that differ.

A fitted parameter within 3 sigma of its prior counts as calibration; beyond that it is reported as an effect of its
family (seven times the leakage: worn seals).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import chi2, norm

from ..core.arrays import Complex, Mask
from ..identification.calibration.problem import Problem
from ..machine.parameters import Parameters
from .acceptance import squares_by_column
from .localise import Spot, worst_spots
from .residual_function import ResidualFunction
from .search_state import AddedEffect, Search
from .sensor_findings import SensorFault

__all__ = ["Estimate", "EffectFinding", "SensorFinding", "Verdict", "Word", "judge", "reject_effects"]

Word = Literal["none", "parameters_only", "sensor", "named", "ambiguous", "unexplained", "not_testable"]


@dataclass(frozen=True)
class Estimate:
    """A number with its interval."""

    value: float
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class EffectFinding:
    """An effect found."""

    family: str
    components: tuple[str, ...]
    parameters: dict[str, Estimate]
    gain: float  # log-likelihood; of a parameter far off, half the square of its distance
    p_value: float
    rivals: tuple[str, ...] = ()  # families that explain the campaign alike
    form: str = ""  # entry of the library, where a family has several forms


@dataclass(frozen=True)
class SensorFinding:
    """A sensor that is off beyond its stated range."""

    name: str
    family: str
    estimate: Estimate
    stated: float  # largest error that the sensors' file allows


@dataclass(frozen=True)
class Verdict:
    """What a search has found."""

    word: Word
    effects: tuple[EffectFinding, ...]
    changed: dict[str, Estimate]  # parameters that differ from what the machine file states, within calibration
    sensors: tuple[SensorFinding, ...]
    residual_function: ResidualFunction | None  # of the effect that was not identified
    untestable: tuple[str, ...]  # families that this campaign could not show, at typical size
    nearest: tuple[str, ...] = ()  # families in the model that come nearest to what was not identified
    where: tuple[Spot, ...] = ()  # where most of the unexplained residual is, by falling share


def judge(
    found: Search, left: Sequence[ResidualFunction], instead: Sequence[ResidualFunction], faults: Sequence[SensorFault]
) -> Verdict:
    """The verdict on a search.

    left are residual functions fitted beside the effects, instead those fitted in place of them, both by falling gain;
    faults are of sensors whose records were corrected before.
    """
    problem, x, numbers, calibration = found.problem, found.solution.x, found.numbers, found.calibration
    count, added = len(problem.parameters), [a.candidate for a in found.added]
    own = np.array([k.name.startswith(tuple(f"{c.name}." for c in added)) for k in problem.parameters])
    floor = calibration.number("fit.floor") * problem.stated
    floor[:count][own] = 0.0  # their priors are flat
    by_lengths = tuple(f"{a.candidate.name}." for a in found.added if a.from_lengths)
    for i, parameter in enumerate(problem.parameters):
        if parameter.name.startswith(by_lengths):
            floor[i] = numbers.number("lengths.form") * (parameter.value if parameter.form == "shift" else 1.0)
    covariance = np.linalg.inv(found.solution.normal.posterior(problem.prior))
    sd = np.sqrt(np.diag(covariance) + floor**2)
    reach = float(norm.ppf(0.5 + 0.5 * numbers.number("verdict.probability")))

    def estimate(i: int) -> Estimate:
        if i >= count:
            error = problem.unknowns[i - count]
            return Estimate(float(x[i]), error.unit, float(x[i] - reach * sd[i]), float(x[i] + reach * sd[i]))
        parameter = problem.parameters[i]
        low, high = sorted(parameter.at(float(x[i] + side * reach * sd[i])) for side in (-1.0, 1.0))
        return Estimate(parameter.at(float(x[i])), parameter.unit, low, high)

    released = tuple(
        SensorFinding(u.name, c.family.named, estimate(i), float(np.sqrt(3.0) * u.sd))
        for i, u in enumerate(problem.unknowns, start=count)
        for c in added
        if c.release == u.name
    )
    sensors = (*(_of_fault(f, reach) for f in faults), *released)
    kept = [one for one in found.added if one.candidate.name not in {s.name for s in released}]
    changed = {}
    for i, parameter in enumerate(problem.parameters):
        sure = abs(x[i]) > calibration.number("report.deviations") * sd[i]
        material = abs(x[i]) > calibration.number("report.material") * problem.stated[i]
        if sure and material and not own[i] and parameter.name not in problem.free:
            changed[parameter.name] = estimate(i)
    free, rejected = reject_effects(kept, left, instead, numbers)
    rejected |= {one.candidate.name for one in kept if not one.from_lengths and _leaves_much(one, found)}
    drifting = any(fault.kind == "drift" for fault in faults)  # of a sensor, or of what it is mounted on
    unexplained = free is not None or bool(rejected) or drifting or _more_than_noise(found)
    nearest = tuple(one.candidate.family.named for one in kept if one.candidate.name in rejected)
    effects = _merged([_of_added(one, problem, estimate) for one in kept if one.candidate.name not in rejected])
    hidden, testable = _untestable(found)
    blind = len(hidden) > numbers.number("verdict.blind") * (len(hidden) + testable)
    word: Word = "not_testable" if blind else "parameters_only" if changed else "none"
    if unexplained:
        word = "unexplained"
    elif effects:
        word = "ambiguous" if any(e.rivals for e in effects) else "named"
    elif sensors:
        word = "sensor"
    spots = tuple(worst_spots(problem, found.residual)) if unexplained else ()
    return Verdict(word, effects, changed, sensors, free, hidden, nearest, spots)


def _untestable(found: Search) -> tuple[tuple[str, ...], int]:
    """Families of which no candidate's typical size is significant; and how many others there are."""
    clear: dict[str, bool] = {}
    for one in found.rounds[-1].scored:
        if not one.candidate.release:
            shape, name = one.candidate.amplitudes[0], one.candidate.family.named
            significant = bool(one.score.sd[0] * found.numbers.number("verdict.clear") < shape.typical)
            clear[name] = clear.get(name, False) or significant
    hidden = tuple(name for name, significant in clear.items() if not significant)
    return hidden, len(clear) - len(hidden)


def _of_added(added: AddedEffect, problem: Problem, estimate: Callable[[int], Estimate]) -> EffectFinding:
    candidate = added.candidate
    values = {
        name.removeprefix(f"{candidate.name}."): estimate(i)
        for i, name in enumerate(problem.names)
        if name == candidate.release or name.startswith(f"{candidate.name}.")
    }
    return EffectFinding(
        family=candidate.family.named,
        components=candidate.components,
        parameters=values,
        gain=added.gain,
        p_value=min(1.0, float(chi2.sf(2.0 * added.gain, len(values))) * added.tried),
        rivals=tuple(dict.fromkeys(one.candidate.family.named for one in added.rivals)),
        form=candidate.family.name,
    )


def _of_fault(fault: SensorFault, reach: float) -> SensorFinding:
    low, high = (fault.value + side * reach * fault.deviation for side in (-1.0, 1.0))
    return SensorFinding(fault.name, fault.family, Estimate(fault.value, fault.unit, low, high), fault.stated)


def _merged(effects: Sequence[EffectFinding]) -> tuple[EffectFinding, ...]:
    """Findings of one family from parameters of several kinds as one."""
    merged: dict[str, EffectFinding] = {}
    for one in effects:
        key = one.family if "." in next(iter(one.parameters), "") else f"{one.family} {one.components}"
        first = merged.get(key)
        merged[key] = (
            one
            if first is None
            else replace(
                first,
                components=tuple(dict.fromkeys((*first.components, *one.components))),
                parameters={**first.parameters, **one.parameters},
                gain=first.gain + one.gain,
                p_value=min(first.p_value, one.p_value),
                rivals=tuple(
                    name for name in first.rivals if name in one.rivals
                ),  # either kind excludes a rival of both
            )
        )
    return tuple(merged.values())


def _more_than_noise(found: Search) -> bool:
    """Whether the residual exceeds noise, and what the form of the effects found may leave."""
    limit, share, doubt = (found.numbers.number(f) for f in ("verdict.unexplained", "verdict.rest", "accept.doubt"))
    for kind in found.problem.kinds:
        rows = found.problem.rows(kind) & ~_impacted(found)
        if not rows.any():
            continue
        first, last = ([r[:, rows] for r in tests] for tests in (found.refit.normal.residual, found.residual))
        misfit = float(np.mean([np.mean(np.abs(r) ** 2) for r in last]))
        if misfit > limit and _excess(last, doubt) > share * _excess(first, doubt):
            return True
    return False


def _impacted(found: Search) -> Mask:
    """Columns (c,) of actuators with play identified from lengths: impacts are faster than the sampling rate."""
    names, columns = found.problem.machine.actuator_names, np.zeros(sum(found.problem.widths), bool)
    for one in found.added:
        for name in one.candidate.components if one.from_lengths else ():
            columns |= found.problem.rows_of_actuator(names.index(name))
    return columns


def _excess(residual: Sequence[Complex], doubt: float) -> float:
    """Squares of whitened residuals beyond `doubt` times noise; at least a tenth of noise."""
    count = sum(r.size for r in residual)
    return max(sum(float(np.sum(np.abs(r) ** 2)) for r in residual) - doubt * count, 0.1 * count)


def _leaves_much(added: AddedEffect, found: Search) -> bool:
    """Whether an effect leaves much of the residual in the columns where it explained most: a wrong name."""
    limit, share, doubt = (found.numbers.number(f) for f in ("verdict.unexplained", "verdict.rest", "accept.doubt"))
    where = (added.fall > 0.1 * added.fall.max()) & ~_impacted(found)
    left = squares_by_column(found.residual)[where]
    noise = float(sum(len(r) for r in found.residual) * left.size)
    return bool(left.sum() > limit * noise and left.sum() - doubt * noise > share * added.fall[where].sum())


def reject_effects(
    kept: Sequence[AddedEffect],
    left: Sequence[ResidualFunction],
    instead: Sequence[ResidualFunction],
    numbers: Parameters,
) -> tuple[ResidualFunction | None, set[str]]:
    """The residual function that is reported, and the effects that it rejects.

    A function fitted in place of all forces that were added rejects them if it explains far more. One fitted beside
    them rejects those that it outweighs; where it is small against an effect found there, it is attributed to the form
    of that effect and not reported.
    """
    n = numbers.number
    share, least = n("accept.held_out"), n("left.gain")

    def first(functions: Sequence[ResidualFunction]) -> ResidualFunction | None:
        """The significant function that gains most, if it passes cross-validation."""
        found = (o for o in functions if min(o.gain, o.beyond) > least and o.held_out.sum() > share * least)
        return next(found, None)

    forces = [one for one in kept if "wrench" in one.candidate.family.shows_in]
    better, free = first(instead), first(left)
    if forces and better is not None and better.gain > n("left.better") * sum(one.gain for one in forces):
        return better, {one.candidate.name for one in forces}
    if free is None:
        return None, set()
    legs, rejected = set(free.components), set()
    for one in forces:
        there = set(one.candidate.components)
        if free.gain < n("verdict.rest" if legs <= there else "verdict.elsewhere") * one.gain:
            return None, set()
        if free.gain > (n("accept.again") if legs & there else 1.0) * one.gain:
            rejected.add(one.candidate.name)
    return free, rejected

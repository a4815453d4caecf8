"""The verdict: which word a search's outcome deserves, and what it names.

An effect is one that the search has added; or a parameter so far from what the machine file states, beyond calibration,
that it stands for a mechanism of its own (seven times the leakage: worn seals).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from ..identification.calibration.problem import Problem
from ..machine.parameters import Parameters
from .acceptance import squares_by_column
from .localise import Spot, worst_spots
from .residual_function import ResidualFunction
from .search_state import AddedEffect, Search
from .sensor_findings import SensorFault

__all__ = ["Estimate", "EffectFinding", "SensorFinding", "Verdict", "Word", "judge", "reject_effects"]

Array = NDArray[np.float64]
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
    residual_function: ResidualFunction | None  # what has no name
    untestable: tuple[str, ...]  # families that this campaign could not show, of typical size
    nearest: tuple[str, ...] = ()  # families in the model that come nearest to what has no name
    where: tuple[Spot, ...] = ()  # where most of what has no name is, by falling share


def judge(
    found: Search,
    left: Sequence[ResidualFunction],
    instead: Sequence[ResidualFunction],
    faults: Sequence[SensorFault],
    calibration: Parameters,
    numbers: Parameters,
) -> Verdict:
    """The verdict on a search.

    left are free functions fitted to what is left, instead those fitted in place of all effects, both by falling gain;
    faults are of sensors that were put right before.
    """
    problem, x, added = found.problem, found.solution.x, [a.candidate for a in found.added]
    count = len(problem.parameters)
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
    errors = {s.name for s in released}
    sensors = (*(_of_fault(f, reach) for f in faults), *released)
    kept = [one for one in found.added if one.candidate.name not in errors]
    effects = [_of_added(one, problem, estimate) for one in kept]
    changed = {}
    for i, parameter in enumerate(problem.parameters):
        sure = abs(x[i]) > calibration.number("report.deviations") * sd[i]
        material = abs(x[i]) > calibration.number("report.material") * problem.stated[i]
        if sure and material and not own[i] and parameter.name not in problem.free:
            changed[parameter.name] = estimate(i)
    free, doubted = reject_effects(kept, left, instead, numbers)
    doubted |= {one.candidate.name for one in kept if not one.from_lengths and _leaves_much(one, found, numbers)}
    drifting = any(fault.kind == "drift" for fault in faults)  # of a sensor, or of what it is mounted on
    unnamed = free is not None or bool(doubted) or drifting or _more_than_noise(found, numbers)
    nearest = tuple(e.family for e, one in zip(effects, kept, strict=True) if one.candidate.name in doubted)
    effects = [e for e, one in zip(effects, kept, strict=True) if one.candidate.name not in doubted]
    hidden, told = _untestable(found, numbers)
    blind = len(hidden) > numbers.number("verdict.blind") * (len(hidden) + told)
    named = _merged(effects)
    word = _word(named, changed, sensors, unnamed, blind)
    spots = tuple(worst_spots(problem, found.residual)) if word == "unexplained" else ()
    return Verdict(word, named, changed, sensors, free, hidden, nearest, spots)


def _untestable(found: Search, numbers: Parameters) -> tuple[tuple[str, ...], int]:
    """Families of which no candidate's typical size stands clear of its deviation; and how many are not so."""
    clear: dict[str, bool] = {}
    for one in found.rounds[-1].scored:
        if not one.candidate.release:
            shape, name = one.candidate.amplitudes[0], one.candidate.family.named
            told = bool(one.score.sd[0] * numbers.number("verdict.clear") < shape.typical)
            clear[name] = clear.get(name, False) or told
    hidden = tuple(name for name, told in clear.items() if not told)
    return hidden, len(clear) - len(hidden)


def _of_added(added: AddedEffect, problem: Problem, estimate: Callable[[int], Estimate]) -> EffectFinding:
    candidate = added.candidate
    values = {}
    for i, name in enumerate(problem.names):
        if name == candidate.release or name.startswith(f"{candidate.name}."):
            values[name.removeprefix(f"{candidate.name}.")] = estimate(i)
    chance = float(chi2.sf(2.0 * added.gain, len(values)))
    return EffectFinding(
        family=candidate.family.named,
        components=candidate.components,
        parameters=values,
        gain=added.gain,
        p_value=min(1.0, chance * added.tried),
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
        if key in merged:
            first = merged[key]
            components = tuple(dict.fromkeys((*first.components, *one.components)))
            values = {**first.parameters, **one.parameters}
            rivals = tuple(name for name in first.rivals if name in one.rivals)  # one mechanism, told by either kind
            chance = min(first.p_value, one.p_value)
            gain = first.gain + one.gain
            merged[key] = replace(
                first, components=components, parameters=values, gain=gain, p_value=chance, rivals=rivals
            )
        else:
            merged[key] = one
    return tuple(merged.values())


def _more_than_noise(found: Search, numbers: Parameters) -> bool:
    """Whether more is left than noise, and than the form of the effects found."""
    limit, share = numbers.number("verdict.unexplained"), numbers.number("verdict.rest")
    doubt, heard = numbers.number("accept.doubt"), ~_hammered(found)
    for kind in found.problem.kinds:
        rows = found.problem.rows(kind) & heard
        if not rows.any():
            continue
        first, last = ([r[:, rows] for r in rest] for rest in (found.refit.normal.residual, found.residual))
        misfit = float(np.mean([np.mean(np.abs(r) ** 2) for r in last]))
        if misfit > limit and _excess(last, doubt) > share * _excess(first, doubt):
            return True
    return False


def _hammered(found: Search) -> NDArray[np.bool_]:
    """Columns (c,) of actuators with play that the lengths tell: their pins hammer faster than records show."""
    names, columns = found.problem.machine.actuator_names, np.zeros(sum(found.problem.widths), bool)
    for one in found.added:
        for name in one.candidate.components if one.from_lengths else ():
            columns |= found.problem.rows_of_actuator(names.index(name))
    return columns


def _excess(rest: Sequence[NDArray[np.complex128]], doubt: float) -> float:
    """Squares of whitened residuals beyond what may be noise; no less than a tenth of noise."""
    count = sum(r.size for r in rest)
    return max(sum(float(np.sum(np.abs(r) ** 2)) for r in rest) - doubt * count, 0.1 * count)


def _leaves_much(added: AddedEffect, found: Search, numbers: Parameters) -> bool:
    """Whether much is left of what an effect should have explained, where it explained most of it: a wrong name."""
    limit, rest = numbers.number("verdict.unexplained"), numbers.number("verdict.rest")
    where = (added.fall > 0.1 * added.fall.max()) & ~_hammered(found)
    left = squares_by_column(found.residual)[where]
    noise = float(sum(len(r) for r in found.residual) * left.size)
    excess = left.sum() - numbers.number("accept.doubt") * noise
    return bool(left.sum() > limit * noise and excess > rest * added.fall[where].sum())


def reject_effects(
    kept: Sequence[AddedEffect],
    left: Sequence[ResidualFunction],
    instead: Sequence[ResidualFunction],
    numbers: Parameters,
) -> tuple[ResidualFunction | None, set[str]]:
    """What has no name, and the effects that are therefore no right names.

    A free function that explains far more than all forces that were added takes their place; one that is left beside
    them doubts those that it outweighs, but where it is little of an effect found there it is only the form of that.
    """
    forces = [one for one in kept if "wrench" in one.candidate.family.shows_in]
    better, free = _first(instead, numbers), _first(left, numbers)
    if forces and better is not None and better.gain > numbers.number("left.better") * sum(one.gain for one in forces):
        return better, {one.candidate.name for one in forces}
    if free is None or any(_its_form(free, one, numbers) for one in forces):
        return None, set()
    return free, {one.candidate.name for one in forces if _outweighed(one, free, numbers)}


def _its_form(free: ResidualFunction, one: AddedEffect, numbers: Parameters) -> bool:
    """Whether what has no name is so little of an effect found, there or elsewhere, that it is the form of that."""
    there = set(free.components) <= set(one.candidate.components)
    return free.gain < numbers.number("verdict.rest" if there else "verdict.elsewhere") * one.gain


def _outweighed(one: AddedEffect, free: ResidualFunction, numbers: Parameters) -> bool:
    """Whether what has no name explains more than this name, or much of it where it acts: then it is part of that."""
    there = bool(set(one.candidate.components) & set(free.components))
    return free.gain > (numbers.number("accept.again") if there else 1.0) * one.gain


def _first(left: Sequence[ResidualFunction], numbers: Parameters) -> ResidualFunction | None:
    """The free function that gains most, if it gains enough, beyond doubt and on tests that it was not fitted on."""
    share, least = numbers.number("accept.held_out"), numbers.number("left.gain")
    return next((o for o in left if min(o.gain, o.beyond) > least and o.held_out.sum() > share * least), None)


def _word(
    effects: Sequence[EffectFinding], changed: object, sensors: Sequence[SensorFinding], unnamed: bool, blind: bool
) -> Word:
    if unnamed:
        return "unexplained"
    if effects:
        return "ambiguous" if any(e.rivals for e in effects) else "named"
    if sensors:
        return "sensor"
    if blind:
        return "not_testable"
    return "parameters_only" if changed else "none"

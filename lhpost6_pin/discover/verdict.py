"""The verdict: which word a search's outcome deserves, and what it names.

An effect is one that the search has added; or a parameter so far from what the machine file states, beyond calibration,
that it stands for a mechanism of its own (seven times the leakage: worn seals).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from ..calibration import Knob
from ..parameters import Parameters
from .left import Left
from .search import Added, Search, excess_by_kind

__all__ = ["Estimate", "Finding", "SensorFinding", "Verdict", "Word", "judge"]

Array = NDArray[np.float64]
Word = Literal["none", "parameters_only", "sensor", "named", "ambiguous", "unexplained", "not_testable"]

_FAMILY_OF = {
    "leakage": "piston_leakage",
    "flow": "flow_curve_error",
    "flow_curve": "flow_curve_error",
    "bulk_modulus": "entrained_air",
    "chamber_a": "dead_volume",
    "chamber_b": "dead_volume",
    "viscous": "local_viscous",
    "pad_friction": "bearing_friction",
    "polytropic_index": "gas_heat_transfer",
    "mass": "added_mass",
    "inertia": "inertia_coupling",
}
"""Family that a parameter belongs to when it is far off."""

_SENSOR_FAMILY = {
    "platen_acceleration": "accelerometer_error",
    "platen_velocity": "accelerometer_error",
    "platen_displacement": "length_sensor_error",
    "actuator_force": "pressure_sensor_error",
    "chamber_pressure_a": "pressure_sensor_error",
    "chamber_pressure_b": "pressure_sensor_error",
    "strut_pressure": "pressure_sensor_error",
    "spool_position": "spool_null_bias",
    "supply_pressure": "pressure_sensor_error",
}
"""Family of a gain or an offset beyond its range."""


@dataclass(frozen=True)
class Estimate:
    """A number with its interval."""

    value: float
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class Finding:
    """An effect found."""

    family: str
    components: tuple[str, ...]
    parameters: dict[str, Estimate]
    gain: float  # log-likelihood; of a parameter far off, half the square of its distance
    p_value: float
    rivals: tuple[str, ...] = ()  # families that explain the campaign alike


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
    effects: tuple[Finding, ...]
    changed: dict[str, Estimate]  # parameters that differ from what the machine file states, within calibration
    sensors: tuple[SensorFinding, ...]
    left: Left | None  # what has no name


def judge(found: Search, left: Sequence[Left], calibration: Parameters, numbers: Parameters) -> Verdict:
    """The verdict on a search; `left` are free functions fitted to what is left, by falling gain."""
    problem, x = found.problem, found.solution.x
    known = np.array([not k.name.startswith(tuple(f"{a.candidate.name}." for a in found.added)) for k in problem.knobs])
    floor = calibration.number("fit.floor") * problem.prior
    floor[: len(known)][~known] = 0.0  # their priors are flat
    covariance = np.linalg.inv(found.solution.normal.posterior(problem.prior))
    sd = np.sqrt(np.diag(covariance) + floor**2)
    reach = float(norm.ppf(0.5 + 0.5 * numbers.number("verdict.probability")))

    def estimate(i: int, knob: Knob) -> Estimate:
        low, high = sorted(knob.at(float(x[i] + side * reach * sd[i])) for side in (-1.0, 1.0))
        return Estimate(knob.at(float(x[i])), knob.unit, low, high)

    effects = [_of_added(added, problem.knobs, estimate, numbers) for added in found.added]
    changed: dict[str, Estimate] = {}
    limit, material = numbers.number("verdict.parameter"), calibration.number("report.material")
    for i, knob in enumerate(problem.knobs):
        if not known[i]:
            continue
        distance = abs(x[i]) / problem.prior[i]
        family = _FAMILY_OF.get(knob.name.split(".")[-1].split("[")[0])
        if distance > limit and family:
            effects.append(_of_parameter(found, knob, family, estimate(i, knob), float(distance)))
        elif abs(x[i]) > calibration.number("report.deviations") * sd[i] and distance > material:
            changed[knob.name] = estimate(i, knob)
    sensors = _sensors(found, sd, reach, numbers)
    free = _first(left, numbers)
    unnamed = free is not None or _more_than_noise(found, numbers)
    return Verdict(_word(effects, changed, sensors, unnamed), _merged(effects), changed, sensors, free)


def _of_added(
    added: Added, knobs: Sequence[Knob], estimate: Callable[[int, Knob], Estimate], numbers: Parameters
) -> Finding:
    candidate = added.candidate
    values = {}
    for i, knob in enumerate(knobs):
        if knob.name.startswith(f"{candidate.name}."):
            values[knob.name.removeprefix(f"{candidate.name}.")] = estimate(i, knob)
    chance = float(chi2.sf(2.0 * added.gain, len(values)))
    apart = numbers.number("accept.apart")
    rivals = tuple(c.candidate.family.name for c in added.contest[1:] if c.behind < apart)
    return Finding(
        candidate.family.name, candidate.components, values, added.gain, min(1.0, chance * added.tried), rivals
    )


def _of_parameter(found: Search, knob: Knob, family: str, value: Estimate, distance: float) -> Finding:
    kind = knob.name.split(".")[0]
    names = tuple(c.name for c in found.problem.machine.components if c.kind == kind) or (kind,)
    chance = 2.0 * float(norm.sf(distance))
    return Finding(family, names, {knob.name: value}, 0.5 * distance**2, min(1.0, chance * len(found.problem.knobs)))


def _merged(effects: Sequence[Finding]) -> tuple[Finding, ...]:
    """Findings of one family from parameters of several kinds as one."""
    merged: dict[str, Finding] = {}
    for one in effects:
        key = one.family if "." in next(iter(one.parameters), "") else f"{one.family} {one.components}"
        if key in merged:
            first = merged[key]
            components = tuple(dict.fromkeys((*first.components, *one.components)))
            values = {**first.parameters, **one.parameters}
            merged[key] = Finding(
                one.family, components, values, first.gain + one.gain, min(first.p_value, one.p_value)
            )
        else:
            merged[key] = one
    return tuple(merged.values())


def _sensors(found: Search, sd: Array, reach: float, numbers: Parameters) -> tuple[SensorFinding, ...]:
    problem, first = found.problem, len(found.problem.knobs)
    findings = []
    for i, unknown in enumerate(problem.unknowns, start=first):
        value, stated = float(found.solution.x[i]), float(np.sqrt(3.0) * unknown.sd)
        if abs(value) > numbers.number("verdict.sensor") * stated and abs(value) - stated > 3.0 * sd[i]:
            family = "channel_delay" if unknown.kind == "delay" else _SENSOR_FAMILY[unknown.channel]
            interval = Estimate(value, unknown.unit, value - reach * float(sd[i]), value + reach * float(sd[i]))
            findings.append(SensorFinding(unknown.name, family, interval, stated))
    return tuple(findings)


def _more_than_noise(found: Search, numbers: Parameters) -> bool:
    """Whether more is left than noise, and than the form of the effects found."""
    limit, rest = numbers.number("verdict.unexplained"), numbers.number("verdict.rest")
    first = excess_by_kind(found.problem, found.refit.normal.rest)
    last = excess_by_kind(found.problem, found.rest)
    return any(found.misfit(kind) > limit and excess > rest * first[kind] for kind, excess in last.items())


def _first(left: Sequence[Left], numbers: Parameters) -> Left | None:
    """The free function that gains most, if it gains enough on tests that it was not fitted on."""
    share = numbers.number("accept.held_out")
    return next((o for o in left if o.gain > numbers.number("left.gain") and o.held_out.sum() > share * o.gain), None)


def _word(effects: Sequence[Finding], changed: object, sensors: Sequence[SensorFinding], unnamed: bool) -> Word:
    if unnamed:
        return "unexplained"
    if effects:
        return "ambiguous" if any(e.rivals for e in effects) else "named"
    if sensors:
        return "sensor"
    return "parameters_only" if changed else "none"

"""Sections of a calibration report: parameters, sensors, residuals, information per test, correlation."""

import math
from collections.abc import Sequence

import numpy as np

from ...identification.calibration import Calibration
from ...identification.calibration.calibration_summary import (
    command_note,
    contradiction_summary,
    correlation_summary,
    cut_strokes,
    delay_summary,
    interval_summary,
    range_summary,
)
from ...identification.calibration.result import beyond, contradictions, far, stated_range, verdict_on
from ...identification.residuals import RESIDUALS
from .calibrate_plots import (
    INTERVAL,
    PROBABILITY,
    forest_figure,
    half_interval,
    information_blocks,
    subset_block,
)
from .page import Block, Table, details, number
from .scales import percent, signed

__all__ = [
    "change_of",
    "correlation_blocks",
    "group_blocks",
    "misfit_blocks",
    "misfit_table",
    "parameter_blocks",
    "parameter_table",
    "sensor_blocks",
    "sensor_table",
    "test_blocks",
]

LISTED = 15  # rows of a table before the rest is folded away
MARKS = {"at its bound": "! at its bound", "changed": "◆ changed"}
KINDS = {"wrench": "wrench at C", "flow": "oil flow", "gas": "gas law", "force": "force against pressure"}


# ---------------------------------------------------------------------------------------- parameters and sensors
def parameter_table(calibration: Calibration) -> Table:
    """Return nominal values and estimates of all parameters; what they say beyond the priors is in `test_blocks`."""
    deviations = far(calibration)
    rows = []
    for i, parameter in enumerate(calibration.parameters):
        low, high = calibration.interval(i, PROBABILITY)
        verdict = verdict_on(calibration, i)
        hardly = verdict == "unchanged" and abs(deviations[i]) > calibration.limit
        verdict_words = "hardly changed" if hardly else MARKS.get(verdict, verdict)
        rows.append(
            (
                parameter.name,
                f"{verdict_words} ({number(float(deviations[i]), 2)})",
                _plain(parameter.value),
                _plain(parameter.at(float(calibration.estimate[i]))),
                f"{_plain(low)} to {_plain(high)}" if calibration.converged else "none",
                parameter.unit,
                change_of(calibration, i),
            )
        )
    header = ("Parameter", "Verdict (deviations)", "Nominal", "Estimate", INTERVAL, "Unit", "Change")
    return Table("All parameters", header, rows)


def parameter_blocks(calibration: Calibration) -> list[Block]:
    """Return estimates and priors of all parameters as figure and table."""
    informed, material = (calibration.numbers.number(f"report.{n}") for n in ("informed", "material"))
    how = (
        "At its bound: the limit of the fit, from its prior or from an unbuildable machine. "
        f"Changed: identifiable (predicted deviation below {informed:g} of the prior's), and more than "
        f"{calibration.limit:g} predicted deviations and {material:g} prior deviations from nominal. Hardly changed: "
        "less than the latter. Unchanged: identifiable, and less. Not informed: the tests hardly narrow it, and where "
        "it moved it followed others. In brackets: predicted deviations from nominal. A height is the mean over the "
        "components of its kind, which move together."
    )
    tables = (parameter_table(calibration), *ratio_tables(calibration))
    notes = filter(None, [interval_summary(calibration), command_note(calibration)])
    return [forest_figure(calibration), how, *notes, *tables, *cut_strokes(calibration)]


def ratio_tables(calibration: Calibration) -> list[Table]:
    """Return the ratios that can be identified, where nothing measured fixes a scale."""
    each = calibration.ratios()
    if calibration.scale is None or not each:
        return []
    rows = [(name, _plain(r.value), r.unit, f"{_plain(r.low)} to {_plain(r.high)}") for name, r in each.items()]
    return [Table(f"Ratios to {calibration.scale.name}", ("Parameter", "Ratio", "Unit", INTERVAL), rows)]


def sensor_table(calibration: Calibration, *, significant: bool = True) -> Table:
    """Return the significant errors of the sensors, or the others, the most significant first."""
    first, deviations, outside = len(calibration.parameters), far(calibration), beyond(calibration)
    ranges, half = stated_range(calibration), half_interval(1.0) * calibration.sd
    rows = []
    for i in sorted(range(first, len(calibration.prior)), key=lambda i: -abs(deviations[i])):
        if outside[i] != significant:
            continue
        unknown, value = calibration.unknowns[i - first], float(calibration.estimate[i])
        scale, unit = {"gain": (100.0, "%"), "delay": (1e3, "ms")}.get(unknown.kind, (1.0, unknown.unit))
        interval = number(scale * float(half[i]), 2) if calibration.converged else "none"
        share, ratio = percent(abs(value) / float(ranges[i])), float(calibration.sd[i] / calibration.prior[i])
        numbers = number(float(deviations[i]), 2), number(ratio, 2)
        rows.append((unknown.name, number(scale * value), interval, unit, share, *numbers))
    header = ("Error", "Estimate", f"Half {INTERVAL}", "Unit", "Of its range", "Deviations", "Predicted over prior")
    return Table("Significant errors" if significant else "Other errors", header, rows)


def sensor_blocks(calibration: Calibration) -> list[Block]:
    """Return the errors of the sensors, the most significant first."""
    off, others = (sensor_table(calibration, significant=which) for which in (True, False))
    how = (
        "measured(t) = (1 + gain) true(t − delay) + offset. Delays are against the motion of the platen. Calibrated "
        "parameters are corrected for these errors, which the override file does not contain. "
        f"{len(off.rows)} of {len(calibration.unknowns)} errors are significant (beyond {calibration.limit:g} "
        f"predicted deviations), {range_summary(calibration)}. {delay_summary(calibration)}"
    )
    rest = [details(f"The other {len(others.rows)}", others)] if others.rows else []
    return [how, *([off] if off.rows else []), *rest]


# ------------------------------------------------------------------------------------------- residuals and tests
def misfit_table(calibration: Calibration) -> Table:
    """Return the misfit of every test before and after."""
    before, after = calibration.misfit_before, calibration.misfit_after
    kinds = np.flatnonzero(np.isfinite(after).any(axis=0))
    rows = [
        (test, *(f"{number(float(old[k]))} → {_judged(calibration, float(new[k]))}" for k in kinds))
        for test, old, new in zip(calibration.tests, before, after, strict=True)
    ]
    return Table("Misfit before → after", ("Test", *(KINDS[RESIDUALS[k]] for k in kinds)), rows)


def misfit_blocks(calibration: Calibration) -> list[Block]:
    """Return the misfit of every test before and after."""
    how = (
        "Mean square of the residuals relative to sensor noise (1), with machine and sensors as given and as "
        "calibrated. Wrench: inertia, weight and friction against forces of actuators and struts. Oil flow: continuity "
        "of every chamber. Gas law: strut pressures against lengths. Force: load cells against chamber pressures. "
        f"! marks values above {calibration.noise_alone:g}."
    )
    return [how, misfit_table(calibration)]


def test_blocks(calibration: Calibration) -> list[Block]:
    """Return the information of each test alone."""
    count, p = len(calibration.parameters), len(calibration.prior)
    how = (
        "Predicted deviation from a single test over that of the prior: 1 is no information, 0.1 a tenfold reduction. "
        "Sensor errors are estimated simultaneously."
    )
    blocks: list[Block] = [how, *information_blocks(calibration, range(count))]
    if p > count:
        blocks.append(details("Errors of the sensors", *information_blocks(calibration, range(count, p))))
    return blocks


def group_blocks(calibration: Calibration) -> list[Block]:
    """Return the estimates by groups of residuals, contradictions first."""
    found = contradictions(calibration)
    rows = []
    for one in found:
        alone, joint, unit = one.values(calibration)
        name = calibration.names[one.unknown]
        rows.append((name, one.subset, _plain(alone), _plain(joint), unit, number(one.deviations, 2)))
    how = (
        f"{contradiction_summary(calibration)} Many more than expected by chance indicate an incomplete equation. "
        "Noise shared by residuals is removed in the order wrench, flow, gas law, force: later groups contain a "
        "little of the earlier ones. Simulation drives the plant open loop by the recorded spools and compares platen "
        "velocity and chamber pressures, with sensor errors fixed at the joint estimate; noise of the recorded spools "
        "biases it beyond its predicted deviations, so its limit is wider."
    )
    header = ("Unknown", "Group", "Group alone", "Joint", "Unit", "Deviations")
    blocks: list[Block] = [how]
    if rows:
        blocks += _folded("Groups that contradict the joint estimate", header, rows)
    return [*blocks, subset_block(calibration)]


def correlation_blocks(calibration: Calibration) -> list[Block]:
    """Return the strongly correlated pairs of unknowns."""
    pairs = calibration.correlated_pairs()
    limit = calibration.numbers.number("report.alike")
    if not pairs:
        return [f"No two unknowns are correlated by {limit:g} or more."]
    own = {parameter.name for parameter in calibration.parameters}
    how = (
        f"{correlation_summary(calibration)} Pairs correlated by {limit:g} or more: their sum (negative correlation) "
        "or difference (positive), in prior deviations, is determined much better than either alone."
    )
    blocks: list[Block] = [how]
    captions = {2: "Between parameters", 1: "Between a parameter and a sensor", 0: "Between sensors"}
    for count, caption in captions.items():
        rows = [(a, b, signed(r, 4)) for a, b, r in pairs if (a in own) + (b in own) == count]
        listed = LISTED if count else 0  # pairs of sensors are all collapsed
        blocks += _folded(caption, ("One", "Other", "Correlation"), rows, listed) if rows else []
    return blocks


def _folded(caption: str, header: Sequence[str], rows: Sequence[Sequence[object]], listed: int = LISTED) -> list[Block]:
    """A table; rows after the first `listed` are collapsed."""
    blocks: list[Block] = [Table(caption, header, rows[:listed])] if listed else []
    if len(rows) > listed:
        more = f"{len(rows) - listed} more" if listed else f"{caption}: {len(rows)} pairs"
        blocks.append(details(more, Table(f"{caption}, {more}" if listed else caption, header, rows[listed:])))
    return blocks


# --------------------------------------------------------------------------------------------------------- words
def _judged(calibration: Calibration, misfit: float) -> str:
    return f"{number(misfit)}{' !' * (misfit > calibration.noise_alone)}"


def _plain(value: float) -> str:
    """A number in the unit of the machine file, with as many digits as a calibration can give."""
    if not math.isfinite(value):
        return "none"
    mantissa, _, power = f"{value:.4e}".partition("e")
    plain = f"{float(f'{value:.5g}'):,.10g}" if -4 <= int(power) < 8 else f"{float(mantissa):g}e{int(power)}"
    return plain.replace("-", "−")


def change_of(calibration: Calibration, i: int) -> str:
    """Change of parameter i from nominal, signed: relative, or in its unit."""
    parameter, coordinate = calibration.parameters[i], float(calibration.estimate[i])
    if parameter.form != "shift":
        change = parameter.at(coordinate) / parameter.value - 1.0
        return f"{'+' * (change > 0)}{percent(change)}"
    return f"{'+' * (coordinate > 0)}{number(coordinate)}\N{NO-BREAK SPACE}{parameter.unit}"

"""Sections of a calibration report: parameters, sensors, residuals, information per test, correlation."""

from collections.abc import Sequence

import numpy as np

from ...identification.calibration import Calibration
from ...identification.calibration.calibration_summary import (
    contradiction_summary,
    correlation_summary,
    cut_strokes,
    range_summary,
)
from ...identification.calibration.verdicts import beyond, contradictions, far, stated_range, verdict_on
from ...identification.residuals import RESIDUALS
from .calibrate_plots import INTERVAL, PROBABILITY, forest_block, half_interval, information_blocks, subset_block
from .page import Markup, details, number, paragraph, table
from .run_motion import percent

__all__ = [
    "correlation_blocks",
    "change_of",
    "group_blocks",
    "parameter_blocks",
    "misfit_blocks",
    "sensor_blocks",
    "test_blocks",
]

LISTED = 15  # rows of a table before the rest is folded away
KINDS = {"wrench": "wrench at C", "flow": "oil flow", "gas": "gas law", "force": "force against pressure"}


# ---------------------------------------------------------------------------------------- parameters and sensors
def parameter_blocks(calibration: Calibration) -> list[Markup]:
    """Return estimates and priors of all parameters as figure and table."""
    outside = far(calibration)
    informed, material = (calibration.numbers.number(f"report.{n}") for n in ("informed", "material"))
    rows = []
    for i, parameter in enumerate(calibration.parameters):
        low, high = calibration.interval(i, PROBABILITY)
        rows.append(
            (
                parameter.name,
                _marked(calibration, i),
                _plain(parameter.value),
                _plain(parameter.at(float(calibration.estimate[i]))),
                parameter.unit,
                change_of(calibration, i),
                number(float(outside[i]), 2),
                number(float(calibration.sd[i] / calibration.prior[i]), 2),
                f"{_plain(low)} to {_plain(high)}" if calibration.converged else "none",
            )
        )
    how = (
        "At its bound: the limit of the fit, from its prior or from an unbuildable machine. "
        f"Changed: more than {calibration.limit:g} predicted deviations and {material:g} prior deviations from "
        f"nominal. Unchanged: less, and identifiable (predicted deviation below {informed:g} of the prior's). Not "
        "informed: mostly the prior. A height is the mean over the components of its kind, which move together."
    )
    header = ("Parameter", "Verdict", "Nominal", "Estimate", "Unit", "Change", "Deviations")
    heads = (*header, "Predicted over prior", INTERVAL)
    cut = map(paragraph, cut_strokes(calibration))
    return [forest_block(calibration), paragraph(how), table("All parameters", heads, rows), *cut]


def sensor_blocks(calibration: Calibration) -> list[Markup]:
    """Return the errors of the sensors, the most significant first."""
    first, outside = len(calibration.parameters), beyond(calibration)
    order = sorted(range(first, len(calibration.prior)), key=lambda i: -abs(far(calibration)[i]))
    rows = [_sensor_row(calibration, i) for i in order]
    differ = sum(bool(outside[i]) for i in order)
    how = paragraph(
        "measured(t) = (1 + gain) true(t − delay) + offset. Delays are against the motion of the platen. Calibrated "
        "parameters are corrected for these errors, which the override file does not contain. "
        f"{differ} of {len(order)} errors are significant (beyond {calibration.limit:g} predicted deviations), "
        f"{range_summary(calibration)}."
    )
    header = ("Error", "Estimate", f"Half {INTERVAL}", "Unit", "Of its range", "Deviations", "Predicted over prior")
    caption = "Significant errors"
    blocks = [how]
    if differ:
        blocks.append(table(caption, header, rows[:differ]))
    if differ < len(rows):
        blocks.append(details(f"The other {len(rows) - differ}", table("Other errors", header, rows[differ:])))
    return blocks


def _sensor_row(calibration: Calibration, i: int) -> tuple[str, ...]:
    unknown = calibration.unknowns[i - len(calibration.parameters)]
    scale, unit = {"gain": (100.0, "%"), "delay": (1e3, "ms")}.get(unknown.kind, (1.0, unknown.unit))
    return (
        unknown.name,
        number(scale * float(calibration.estimate[i])),
        number(scale * half_interval(float(calibration.sd[i])), 2) if calibration.converged else "none",
        unit,
        percent(abs(float(calibration.estimate[i])) / float(stated_range(calibration)[i])),
        number(float(far(calibration)[i]), 2),
        number(float(calibration.sd[i] / calibration.prior[i]), 2),
    )


# ------------------------------------------------------------------------------------------- residuals and tests
def misfit_blocks(calibration: Calibration) -> list[Markup]:
    """Return the misfit of every test before and after."""
    before, after = calibration.misfit_before, calibration.misfit_after
    kinds = [k for k in range(after.shape[1]) if np.isfinite(after[:, k]).any()]
    rows = [
        (test, *(f"{number(float(before[t, k]))} → {_judged(calibration, float(after[t, k]))}" for k in kinds))
        for t, test in enumerate(calibration.tests)
    ]
    how = (
        "Mean square of the residuals relative to sensor noise (1), with machine and sensors as given and as "
        "calibrated. Wrench: inertia, weight and friction against forces of actuators and struts. Oil flow: continuity "
        "of every chamber. Gas law: strut pressures against lengths. Force: load cells against chamber pressures. "
        f"! marks values above {calibration.noise_alone:g}."
    )
    header = ("Test", *(KINDS[RESIDUALS[k]] for k in kinds))
    return [paragraph(how), table("Misfit before → after", header, rows)]


def test_blocks(calibration: Calibration) -> list[Markup]:
    """Return the information of each test alone."""
    count, p = len(calibration.parameters), len(calibration.prior)
    how = paragraph(
        "Predicted deviation from a single test over that of the prior: 1 is no information, 0.1 a tenfold reduction. "
        "Sensor errors are estimated simultaneously."
    )
    blocks = [how, *information_blocks(calibration, range(count))]
    if p > count:
        blocks.append(details("Errors of the sensors", *information_blocks(calibration, range(count, p))))
    return blocks


def group_blocks(calibration: Calibration) -> list[Markup]:
    """Return the estimates by groups of residuals, contradictions first."""
    found = contradictions(calibration)
    rows = []
    for one in found:
        i = one.unknown
        subset = next(s for s in calibration.subsets if s.name == one.subset)
        unit = calibration.parameters[i].unit if i < len(calibration.parameters) else _unit(calibration, i)
        alone, together = (_plain(_value(calibration, i, float(x[i]))) for x in (subset.estimate, calibration.estimate))
        rows.append((calibration.names[i], one.subset, alone, together, unit, number(one.deviations, 2)))
    how = paragraph(
        f"{contradiction_summary(calibration)} Many more than expected by chance indicate an incomplete equation. "
        "Noise shared by residuals is removed in the order wrench, flow, gas law, force: later groups contain a "
        "little of the earlier ones. Simulation drives the plant open loop by the recorded spools and compares platen "
        "velocity and chamber pressures, with sensor errors fixed at the joint estimate; noise of the recorded spools "
        "biases it beyond its predicted deviations, so its limit is wider."
    )
    header = ("Unknown", "Group", "Group alone", "Joint", "Unit", "Deviations")
    blocks = [how]
    if rows:
        blocks += _folded("Groups that contradict the joint estimate", header, rows)
    return [*blocks, subset_block(calibration)]


def correlation_blocks(calibration: Calibration) -> list[Markup]:
    """Return the strongly correlated pairs of unknowns."""
    pairs = calibration.alike()
    limit = calibration.numbers.number("report.alike")
    if not pairs:
        return [paragraph(f"No two unknowns are correlated by {limit:g} or more.")]
    own = {parameter.name for parameter in calibration.parameters}
    how = paragraph(
        f"{correlation_summary(calibration)} Pairs correlated by {limit:g} or more: their sum (negative correlation) "
        "or difference (positive), in prior deviations, is determined much better than either alone."
    )
    groups = (
        ("Between parameters", [(a, b, *r) for a, b, *r in pairs if a in own and b in own], LISTED),
        ("Between a parameter and a sensor", [(a, b, *r) for a, b, *r in pairs if (a in own) != (b in own)], LISTED),
        ("Between sensors", [(a, b, *r) for a, b, *r in pairs if a not in own and b not in own], 0),  # all collapsed
    )
    blocks = [how]
    for caption, found, listed in groups:
        rows = [(a, b, f"{r:+.4f}".replace("-", "−")) for a, b, r in found]
        blocks += _folded(caption, ("One", "Other", "Correlation"), rows, listed) if rows else []
    return blocks


def _folded(
    caption: str, header: Sequence[str], rows: Sequence[Sequence[object]], listed: int = LISTED
) -> list[Markup]:
    """A table; rows after the first `listed` are collapsed."""
    blocks = [table(caption, header, rows[:listed])] if listed else []
    if len(rows) > listed:
        more = f"{len(rows) - listed} more" if listed else f"{caption}: {len(rows)} pairs"
        blocks.append(details(more, table(f"{caption}, {more}" if listed else caption, header, rows[listed:])))
    return blocks


# --------------------------------------------------------------------------------------------------------- words
def _judged(calibration: Calibration, misfit: float) -> str:
    return f"{number(misfit)}{' !' * (misfit > calibration.noise_alone)}"


def _marked(calibration: Calibration, i: int) -> str:
    verdict = verdict_on(calibration, i)
    return {"at its bound": "! at its bound", "changed": "◆ changed"}.get(verdict, verdict)


def _plain(value: float) -> str:
    """A number in the unit of the machine file, with as many digits as a calibration can give."""
    mantissa, _, power = f"{value:.4e}".partition("e")
    plain = f"{float(f'{value:.5g}'):,.10g}" if -4 <= int(power) < 8 else f"{float(mantissa):g}e{int(power)}"
    return plain.replace("-", "−")


def _value(calibration: Calibration, i: int, coordinate: float) -> float:
    return calibration.parameters[i].at(coordinate) if i < len(calibration.parameters) else coordinate


def _unit(calibration: Calibration, i: int) -> str:
    return calibration.unknowns[i - len(calibration.parameters)].unit


def change_of(calibration: Calibration, i: int) -> str:
    """Change of parameter i from nominal, signed: relative, or in its unit."""
    parameter, coordinate = calibration.parameters[i], float(calibration.estimate[i])
    if parameter.form == "factor":
        return f"{'+' * (coordinate > 0)}{percent(coordinate)}"
    return f"{'+' * (coordinate > 0)}{number(coordinate)}\N{NO-BREAK SPACE}{parameter.unit}"

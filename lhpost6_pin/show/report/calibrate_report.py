"""The report of a calibration: estimates of machine parameters and sensor errors from a campaign."""

from pathlib import Path

import numpy as np

from ...data.campaign import skipped_summary
from ...identification.calibration import Calibration
from ...identification.calibration.calibration_summary import chance, friction_summary, range_summary
from ...identification.calibration.result import beyond, changed_parameters, contradictions, out_of_range, verdict_on
from ...identification.calibration.scale import scale_summary
from .calibrate_sections import (
    change_of,
    correlation_blocks,
    group_blocks,
    misfit_blocks,
    parameter_blocks,
    sensor_blocks,
    test_blocks,
)
from .control_blocks import load_of, numbers_used
from .curve_plots import curve_blocks
from .friction_section import friction_blocks
from .page import Block, Headline, Level, Page, Section, bullet_list, number, save_page

__all__ = ["write_calibrate_report"]

NAMED = 3  # parameters that the verdict names


def write_calibrate_report(calibration: Calibration, path: Path | str, command: str = "") -> Path:
    """Write the self-contained HTML report of a calibration to `path` and return the path."""
    verdict, level = _verdict(calibration)
    count, tests = len(calibration.parameters), len(calibration.tests)
    page = Page(
        kind="Calibration",
        title=f"{calibration.machine.name} calibrated by {calibration.campaign}",
        purpose=(
            f"Find {count} parameters of {load_of(calibration.machine)}, and {len(calibration.unknowns)} errors of its "
            f"sensors, from {tests} test{'s' * (tests != 1)}: {', '.join(calibration.tests)}."
        ),
        verdict=verdict,
        level=level,
        headlines=_headlines(calibration),
        sections=[
            Section("parameters", "Parameters", parameter_blocks(calibration)),
            Section("sensors", "Errors of the sensors", sensor_blocks(calibration)),
            Section("misfit", "Residuals", misfit_blocks(calibration)),
            Section("curves", "Friction and valves", curve_blocks(calibration.curves, calibration.machine)),
            Section("friction", "Friction", friction_blocks(calibration)),
            Section("information", "Information per test", test_blocks(calibration)),
            Section("subsets", "Estimates by group of residuals", group_blocks(calibration)),
            Section("alike", "Parameter correlation", correlation_blocks(calibration)),
            Section("assumptions", "Assumptions and numbers used", _assumptions(calibration)),
        ],
        command=command,
    )
    return save_page(page, path)


def _verdict(calibration: Calibration) -> tuple[str, Level]:
    count, changed = len(calibration.parameters), changed_parameters(calibration)
    informed = int(np.sum(calibration.informed[:count]))
    rounds = f"{calibration.rounds} round{'s' * (calibration.rounds != 1)}"
    sentences = [
        f"The fit converged after {rounds}."
        if calibration.converged
        else f"The fit did not converge in {rounds}: estimates are those of the last round, without intervals.",
        f"{informed} of {count} parameters are identifiable.",
    ]
    if changed:
        most = ", ".join(f"{calibration.names[i]} ({change_of(calibration, i)})" for i in changed[:NAMED])
        more = f"{'most significantly ' * (len(changed) > NAMED)}{most}"
        differ = "differs" if len(changed) == 1 else "differ"
        sentences.append(f"{len(changed)} {differ} from nominal: {more}.")
    else:
        sentences.append("No parameter differs from nominal.")
    before, after = (float(np.nanmax(m)) for m in (calibration.misfit_before, calibration.misfit_after))
    level: Level = "good"
    bounded, wrong = _bounded(calibration), out_of_range(calibration)
    if after > calibration.noise_alone:
        level = "attention"
        sentences.append(
            f"The largest misfit changed from {number(before)} to {number(after)}, above sensor noise: an effect is "
            "missing, a sensor is wrong, or the stated noise is too small. `lhpost6 discover` names what is missing."
        )
    else:
        sentences.append(
            f"The largest misfit changed from {number(before)} to {number(after)}, the level of sensor noise."
        )
    if calibration.friction is not None:
        level = level if calibration.friction.suffices else "attention"
        sentences.append(friction_summary(calibration))
    if wrong:
        level = "attention"
        sentences.append(f"Sensor errors {range_summary(calibration)}.")
    if bounded:
        level = "attention"
        sentences.append(f"At the bound of the fit, which indicates another cause: {', '.join(bounded)}.")
    sentences += filter(None, [skipped_summary(calibration.skipped), scale_summary(calibration.scale)])
    return " ".join(sentences), level if calibration.converged else "bad"


def _headlines(calibration: Calibration) -> list[Headline]:
    count, p = len(calibration.parameters), len(calibration.prior)
    informed, outside = calibration.informed, beyond(calibration)
    after = float(np.nanmax(calibration.misfit_after))
    before = float(np.nanmax(calibration.misfit_before))
    limit = calibration.numbers.number("report.informed")
    note = f"predicted deviation below {limit:g} of the prior's"
    material = calibration.numbers.number("report.material")
    differ = f"by more than {calibration.limit:g} predicted deviations and {material:g} stated ones"
    good: Level = "good" if calibration.converged else "bad"
    fits: Level = "good" if after <= calibration.noise_alone else "attention"
    apart = len(contradictions(calibration))
    by_chance = number(chance(calibration), 1)
    wrong = len(out_of_range(calibration))
    ranges = f"{wrong or 'none'} significantly beyond {'their' if wrong > 1 else 'its'} stated range{'s' * (wrong > 1)}"
    trust: Level = "attention" if wrong else "good"
    return [
        Headline("yes" if calibration.converged else "no", "Converged", f"rounds: {calibration.rounds}", good),
        Headline(f"{np.sum(informed[:count])} of {count}", "Identifiable parameters", note),
        Headline(f"{np.sum(outside[:count])} of {count}", "Parameters different from nominal", differ),
        Headline(f"{np.sum(outside[count:])} of {p - count}", "Significant sensor errors", ranges, trust),
        Headline(number(after), "Largest misfit", f"mean square, 1: sensor noise alone; {number(before)} before", fits),
        Headline(
            str(apart), "Contradictions", f"subset estimates against the joint one; expected by chance: {by_chance}"
        ),
    ]


def _bounded(calibration: Calibration) -> list[str]:
    return [name for i, name in enumerate(calibration.names) if verdict_on(calibration, i) == "at its bound"]


def _assumptions(calibration: Calibration) -> list[Block]:
    lines = [
        "Priors are the standard deviations stated in the machine file (models/lhpost6.toml for the shipped table); "
        "most are assumed, and an estimate that is not informative is no better than its prior.",
        "Sensor noise and the ranges of gains, offsets and delays are from the sensors' file "
        "(models/sensors/lhpost6.toml unless --sensors names another); they are not measured. Misfit, predicted "
        "deviations and intervals are all relative to that noise.",
        "Predicted deviations and intervals assume that the equations are complete; model errors are not included.",
        "Intervals take the unknowns as normally distributed about the estimates, to first order.",
    ]
    return [bullet_list(lines), numbers_used(calibration.numbers)]

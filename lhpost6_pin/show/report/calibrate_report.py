"""The report of a calibration: what a campaign says of a machine's numbers and of its sensors."""

from pathlib import Path

import numpy as np

from ...identification.calibration import Calibration
from ...identification.calibration.calibration_summary import chance, range_summary
from ...identification.calibration.verdicts import beyond, changed_parameters, contradictions, out_of_range, verdict_on
from .calibrate_sections import (
    alike_blocks,
    change_of,
    group_blocks,
    misfit_blocks,
    parameter_blocks,
    sensor_blocks,
    test_blocks,
)
from .control_blocks import load_of
from .page import Headline, Level, Markup, Page, Section, bullet_list, number, save_page, table, versions

__all__ = ["write_calibrate_report"]

NAMED = 3  # parameters that the verdict names


def write_calibrate_report(calibration: Calibration, path: Path | str, command: str = "") -> Path:
    """Write the self-contained HTML report of a calibration to `path` and return the path."""
    verdict, level = _judge(calibration)
    count, tests = len(calibration.parameters), len(calibration.tests)
    page = Page(
        kind="Calibration",
        title=f"{calibration.machine.name} calibrated by {calibration.campaign}",
        asked=(
            f"Find {count} parameters of {load_of(calibration.machine)}, and {len(calibration.unknowns)} errors of its "
            f"sensors, from {tests} test{'s' * (tests != 1)}: {', '.join(calibration.tests)}."
        ),
        verdict=verdict,
        level=level,
        headlines=_headlines(calibration),
        sections=[
            Section("parameters", "Parameters", parameter_blocks(calibration)),
            Section("sensors", "Errors of the sensors", sensor_blocks(calibration)),
            Section("misfit", "What is left", misfit_blocks(calibration)),
            Section("information", "Which tests tell of what", test_blocks(calibration)),
            Section("subsets", "What each group of residuals says", group_blocks(calibration)),
            Section("alike", "What cannot be told apart", alike_blocks(calibration)),
            Section("assumptions", "Assumptions and numbers used", _assumptions(calibration)),
        ],
        command=command or None,
        versions=versions(),
    )
    return save_page(page, path)


def _judge(calibration: Calibration) -> tuple[str, Level]:
    count, changed = len(calibration.parameters), changed_parameters(calibration)
    informed = int(np.sum(calibration.informed[:count]))
    rounds = f"{calibration.rounds} round{'s' * (calibration.rounds != 1)}"
    said = [
        f"The fit converged after {rounds}."
        if calibration.converged
        else f"The fit did not converge in {rounds}: estimates are where it stopped, and have no intervals.",
        f"The campaign has told something of {informed} of {count} parameters.",
    ]
    if changed:
        most = ", ".join(f"{calibration.names[i]} ({change_of(calibration, i)})" for i in changed[:NAMED])
        more = f"{'most clearly ' * (len(changed) > NAMED)}{most}"
        differ = "differs" if len(changed) == 1 else "differ"
        said.append(f"{len(changed)} {differ} from nominal: {more}.")
    else:
        said.append("None differs from nominal.")
    before, after = (float(np.nanmax(m)) for m in (calibration.misfit_before, calibration.misfit_after))
    level: Level = "good"
    bounded, wrong = _bounded(calibration), out_of_range(calibration)
    if after > calibration.noise_alone:
        level = "attention"
        said.append(
            f"The worst misfit went from {number(before)} to {number(after)}: more than sensor noise is left, so an "
            "effect is missing, a sensor is wrong, or noise is more than stated."
        )
    else:
        said.append(
            f"The worst misfit went from {number(before)} to {number(after)}: sensor noise is all that is left."
        )
    if wrong:
        level = "attention"
        said.append(f"Sensor errors {range_summary(calibration)}.")
    if bounded:
        level = "attention"
        said.append(f"As far off as the fit lets it go, so that something else is wrong: {', '.join(bounded)}.")
    return " ".join(said), level if calibration.converged else "bad"


def _headlines(calibration: Calibration) -> list[Headline]:
    count, p = len(calibration.parameters), len(calibration.prior)
    informed, outside = calibration.informed, beyond(calibration)
    after = float(np.nanmax(calibration.misfit_after))
    before = float(np.nanmax(calibration.misfit_before))
    limit = calibration.numbers.number("report.informed")
    note = f"predicted deviation below {limit:g} of the prior's"
    differ = f"by more than {calibration.limit:g} predicted deviations"
    good: Level = "good" if calibration.converged else "bad"
    fits: Level = "good" if after <= calibration.noise_alone else "attention"
    apart = len(contradictions(calibration))
    by_chance = number(chance(calibration), 1)
    wrong = len(out_of_range(calibration))
    ranges = f"{wrong} beyond their stated ranges" if wrong else range_summary(calibration)
    trust: Level = "attention" if wrong else "good"
    return [
        Headline("yes" if calibration.converged else "no", "Converged", f"rounds: {calibration.rounds}", good),
        Headline(f"{np.sum(informed[:count])} of {count}", "Parameters informed", note),
        Headline(f"{np.sum(outside[:count])} of {count}", "Parameters that differ from nominal", differ),
        Headline(f"{np.sum(outside[count:])} of {p - count}", "Sensor errors found", ranges, trust),
        Headline(number(after), "Worst misfit", f"1: noise alone; {number(before)} before", fits),
        Headline(str(apart), "Contradictions", f"groups against all together; by chance about {by_chance}"),
    ]


def _bounded(calibration: Calibration) -> list[str]:
    return [name for i, name in enumerate(calibration.names) if verdict_on(calibration, i) == "at its bound"]


def _assumptions(calibration: Calibration) -> list[Markup]:
    said = [
        "Priors are the standard deviations that the machine file states (models/lhpost6.toml for the shipped table); "
        "most are assumed, and an estimate that is not informed is no better than they are.",
        "Sensor noise, and how far gains, offsets and delays may be off, come from the sensors' file "
        "(models/sensors/lhpost6.toml unless --sensors names another); nobody has measured them. Misfit, predicted "
        "deviations and intervals are all relative to that noise.",
        "Predicted deviations and intervals hold if the equations do: what they leave out is not in them.",
        "The drawn and printed intervals take the unknowns as normally distributed about the estimates, to first "
        "order.",
    ]
    rows = [
        (path, f"{float(np.max(q.value)):g}{f' {q.unit}' if q.unit != '1' else ''}", q.evidence, q.source)
        for path, q in calibration.numbers.items()
    ]
    return [bullet_list(said), table("Numbers used", ("Number", "Value", "Evidence", "Source"), rows)]

"""Sections of a validation report: the summary as a heat map, and every test phase by phase."""

from collections.abc import Sequence

import numpy as np

from ...core.names import AXES
from ...identification.validation import PHASES, ColumnAgreement, Phase, Validation
from .page import Markup, details, number, paragraph, shaded, table, text
from .run_motion import percent, shown_as
from .validate_plots import actuator_blocks, force_blocks, motion_blocks, scale_of, spectrum_block

__all__ = [
    "ROMAN",
    "named",
    "summary_blocks",
    "test_blocks",
    "why_not",
    "worst_of",
]

ROMAN = {1: "I", 2: "II", 3: "III"}
SUMMED = {1: ("wrench",), 2: ("displacement", "acceleration", "wrench"), 3: ("displacement", "acceleration")}
"""Quantities of each phase that the summary shows."""

NOISE = 2.0  # judgement: times the noise, up to which an error of an axis almost at rest is insignificant
SENSED = 3.0  # judgement: standard deviations of the sensors' calibration that a mean error may reach
ACTUATORS = ("actuator_force", "chamber_pressure_a", "chamber_pressure_b")
_NAMES = {
    "wrench": "total actuator force",
    "struts": "strut force",
    "dissipative": "dissipative force",
    "actuator_force": "actuator force",
    "chamber_pressure_a": "pressure in chamber A",
    "chamber_pressure_b": "pressure in chamber B",
    "spool_command": "spool command",
}
_SHADES = (0.01, 0.03, 0.10, 0.30, np.inf)
"""RRMSE up to which a cell has each shade."""


def named(quantity: str) -> str:
    """Name of a quantity for display."""
    return _NAMES.get(quantity, quantity)


def worst_of(found: Validation, phase: int) -> tuple[Phase, ColumnAgreement] | None:
    """The largest error in the summary of a phase, among axes that moved; None without any."""
    rows = ((p, a) for p in found.phases if p.number == phase for a in _judged(p))
    return max(rows, key=lambda row: row[1].rrmse_aligned, default=None)


def why_not(found: Validation, phase: int) -> str:
    """Why a phase is not judged, as text."""
    reasons = {p.reason for p in found.phases if p.number == phase and p.reason}
    if len(reasons) == 1:
        return f"omitted: {reasons.pop()}"
    return "omitted, see the notes" if reasons else "no axis moved enough"


def _judged(phase: Phase) -> list[ColumnAgreement]:
    return [a for a in phase.agreement if a.quantity in SUMMED[phase.number] and a.moves]


# --------------------------------------------------------------------------------------------- over all tests
def summary_blocks(found: Validation) -> list[Markup]:
    """Return the error of every phase, test and axis as a shaded table."""
    tops = [f"up to {100 * top:g} %" for top in _SHADES[:-1]] + [f"above {100 * _SHADES[-2]:g} %"]
    key = " ".join(shaded(words, k) for k, words in enumerate(tops))
    how = (
        "RRMSE = √(Σ error² ∕ Σ measured²), delay removed; forces with their means removed (compared below). ▲ marks "
        "the largest of each phase. For an axis almost at rest the error is given as a multiple of that expected from "
        f"sensor noise, marked ! above {NOISE:g}, without gains and offsets of sensors; for its displacement, where "
        "gains and drift dominate, in absolute terms."
    )
    axes = [axis for axis in AXES if any(a.column == axis for p in found.phases for a in p.agreement)]
    rows = []
    for phase, quantity in ((n, q) for n in PHASES for q in SUMMED[n]):
        worst = worst_of(found, phase)
        for p in (p for p in found.phases if p.number == phase and not p.reason):
            cells = {a.column: _cell(a, bool(worst and worst[1] is a)) for a in p.of(quantity)}
            rows.append((f"{ROMAN[phase]} · {named(quantity)}", p.test, *(cells.get(axis, "") for axis in axes)))
    skipped = [
        paragraph(f"Phase {ROMAN[n]}, {PHASES[n]}: {why_not(found, n)}.")
        for n in PHASES
        if all(p.reason for p in found.phases if p.number == n) and any(p.number == n for p in found.phases)
    ]
    heat = table("RRMSE, delay removed", ("Phase and quantity", "Test", *axes), rows)
    after = [*_spool_blocks(found), *_noise_blocks(found), *_mean_blocks(found)]
    return [paragraph(how), paragraph(Markup(key)), heat, *skipped, *after]


def _spool_blocks(found: Validation) -> list[Markup]:
    """Return the largest RRMSE of the spool commands of the closed loop."""
    rows = [(p.test, a) for p in found.phases for a in p.of("spool_command") if a.moves]
    if not rows:
        return []
    test, worst = max(rows, key=lambda row: row[1].rrmse_aligned)
    words = f"Spool commands of the closed loop: largest RRMSE {percent(worst.rrmse_aligned)} ({test}, {worst.column})."
    return [paragraph(words)]


def _noise_blocks(found: Validation) -> list[Markup]:
    """Return the residual of inverse dynamics over the noise predicted for it, axis by axis."""
    phases = [p for p in found.phases if p.number == 1 and not p.reason]
    if not phases:
        return []
    rows: list[tuple[str, ...]] = []
    for p in phases:
        ratios = [a.error_to_noise for a in p.of("wrench")]
        rows.append((p.test, *(f"{'! ' * (not 1 / NOISE < r < NOISE)}{number(r, 3)}" for r in ratios)))
    rows.append(("noise predicted", *(_span(same) for same in zip(*(p.of("wrench") for p in phases), strict=True))))
    how = (
        "Residual of inverse dynamics (required less measured actuator force, mean and delay removed) over its "
        f"predicted sensor noise. 1 is noise alone; ! marks more than {NOISE:g} (incomplete model) and less than "
        f"{1 / NOISE:g} (stated noise too large). The last row is that noise, one standard deviation. Gain errors of "
        "sensors add to the residual of moving axes."
    )
    header = ("Test", *(a.column for a in phases[0].of("wrench")))
    return [paragraph(how), table("Residual of inverse dynamics over the noise predicted", header, rows)]


def _span(tests: Sequence[ColumnAgreement]) -> str:
    """Least and greatest noise of one column over all tests, in words."""
    scale = scale_of(tests[0].quantity, tests[0].column)
    low, high = (number(end(a.noise for a in tests) * scale.factor, 2) for end in (min, max))
    return f"{low if low == high else f'{low} to {high}'} {scale.unit}"


def _mean_blocks(found: Validation) -> list[Markup]:
    """Return the mean error of the total actuator force by inverse dynamics, against calibration uncertainty."""
    phases = [p for p in found.phases if p.number == 1 and not p.reason]
    if not phases:
        return []
    first = phases[0].of("wrench")
    rows = [(p.test, *(_mean_cell(a) for a in p.of("wrench"))) for p in phases]
    due = ("calibration, one sd", *(number(a.offset_expected * scale_of("wrench", a.column).factor, 2) for a in first))
    how = (
        "Mean of required less measured force by inverse dynamics. The last row is its uncertainty from gains and "
        f"offsets of the force sensors, one standard deviation; ! marks more than {SENSED:g} of them: a weight, a "
        "pressure or a sensor is wrong."
    )
    header = ("Test", *(f"{a.column} [{scale_of('wrench', a.column).unit}]" for a in first))
    return [paragraph(how), table("Mean error of the total actuator force", header, [*rows, due])]


def _mean_cell(one: ColumnAgreement) -> str:
    beyond = abs(one.offset) > SENSED * one.offset_expected
    return f"{'! ' * beyond}{number(one.offset * scale_of(one.quantity, one.column).factor)}"


def _cell(one: ColumnAgreement, worst: bool) -> Markup:
    if one.moves:
        shade = next(k for k, top in enumerate(_SHADES) if not one.rrmse_aligned > top)
        return shaded(f"{'▲ ' * worst}{percent(one.rrmse_aligned)}", shade)
    if one.quantity == "displacement":
        return text(f"{number(1e6 * one.error, 2)}\N{NO-BREAK SPACE}{'µrad' if one.column in AXES[3:] else 'µm'}")
    if not np.isfinite(one.error_to_noise):
        return text("almost at rest")
    return text(f"{'! ' * (one.error_to_noise > NOISE)}{number(one.error_to_noise, 2)} × noise")


# ---------------------------------------------------------------------------------------------- test by test
def test_blocks(found: Validation, test: str) -> list[Markup]:
    """Return every phase of a test, collapsed: numbers, figures, spectra."""
    blocks = []
    phases = [p for p in found.phases if p.test == test]
    motion = next((p for p in phases if p.pair("displacement")), None)
    for phase in phases:
        title = f"Phase {ROMAN[phase.number]}: {PHASES[phase.number]}"
        if phase.reason:
            blocks.append(paragraph(Markup(f"<strong>{title}</strong>"), f" omitted: {phase.reason}."))
            continue
        axes = _shown_axes(motion or phase)
        figures = force_blocks(phase, motion, axes) if phase.number == 1 else motion_blocks(phase, axes)
        figures += actuator_blocks(phase, "spool_command")
        for quantity in ACTUATORS:
            drawn = actuator_blocks(phase, quantity)
            figures += [details(f"Every actuator: {named(quantity)}", *drawn)] if drawn else []
        spectra = details("Spectra", *spectrum_block(phase, axes, found.numbers.bands))
        blocks.append(details(f"{title}{_short(phase)}", _metrics(phase), *figures, spectra))
    return blocks


def _shown_axes(phase: Phase) -> list[str]:
    """Axes that a phase draws: those whose displacement, or else force, moved; the strongest if none did."""
    rows = phase.of("displacement") or phase.of("wrench")
    return [a.column for a in rows if a.moves] or [max(rows, key=lambda a: a.variation).column]


def _short(phase: Phase) -> str:
    worst = max(_judged(phase), key=lambda a: a.rrmse_aligned, default=None)
    if worst is None:
        return ", almost at rest"
    return f", worst RRMSE {percent(worst.rrmse_aligned)} ({worst.column}, {named(worst.quantity)})"


def _metrics(phase: Phase) -> Markup:
    header = ("Quantity", "RRMSE", "Delay removed", "Delay", "Peak ratio", "Correlation", "RMS error")
    rows = []
    for a in phase.agreement:
        scale = scale_of(a.quantity, a.column)
        late = f"{1e3 * a.delay:.3f} ms".replace("-", "−") if np.isfinite(a.delay) else "–"
        alike = f"{a.correlation_aligned:.5f}" if np.isfinite(a.correlation_aligned) else "–"
        ratios = percent(a.rrmse), percent(a.rrmse_aligned), late, number(a.peak_ratio, 4), alike
        error, mean = (shown_as(x, scale).removesuffix("\N{NO-BREAK SPACE}1") for x in (a.error_aligned, a.offset))
        errors = error, number(a.error_to_noise, 2), mean
        rows.append((f"{named(a.quantity)}, {a.column}", *ratios, *errors))
    heads = (*header, "÷ noise", "Mean error")
    how = (
        "Delay: of the model behind the measurement. Correlation and RMS error: delay removed. A dash: almost at rest. "
        "Values with and without delay: metrics.json."
    )
    numbers = table(f"{PHASES[phase.number].capitalize()}, {phase.test}", heads, rows)
    return details("All numbers", paragraph(how), numbers)

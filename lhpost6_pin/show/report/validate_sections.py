"""Sections of a validation report: the summary as a heat map, and every test phase by phase."""

from collections.abc import Sequence

import numpy as np

from ...core.names import AXES
from ...identification.validation import PHASES, ColumnAgreement, Phase, Validation
from .page import Block, Markup, Table, details, number, paragraph, shaded, text
from .scales import ROTATIONS, percent, shown_as
from .validate_plots import actuator_blocks, force_figure, motion_blocks, scale_of, spectrum_blocks

__all__ = ["ROMAN", "named", "summary_blocks", "test_blocks", "why_not", "worst_in_words", "worst_of"]

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
    "spool_command_b": "spool command of servovalve B",
}
_SHADES = (0.01, 0.03, 0.10, 0.30, np.inf)
"""RRMSE up to which a cell has each shade."""


def named(quantity: str) -> str:
    """Name of a quantity for display."""
    return _NAMES.get(quantity, quantity)


def worst_of(
    found: Validation, phase: int, quantities: Sequence[str] | None = None
) -> tuple[Phase, ColumnAgreement] | None:
    """The largest error of a phase among columns that moved, of some quantities or those summed; None without any."""
    rows = ((p, a) for p in found.phases if p.number == phase for a in _judged(p, quantities))
    return max(rows, key=lambda row: row[1].rrmse_aligned, default=None)


def worst_in_words(found: Validation, phase: int) -> str:
    """The largest RRMSE of a phase in words: of the platen's motion and total force, and of single actuators."""
    worst, single = worst_of(found, phase), worst_of(found, phase, ACTUATORS)
    if worst is None:
        return why_not(found, phase)
    kind = "total force" if phase == 1 else "the platen and its total force" if phase == 2 else "the platen"
    words = f"largest RRMSE of {kind} {_placed(*worst)}"
    return f"{words}, of a single actuator {_placed(*single)}" if single else words


def _placed(phase: Phase, one: ColumnAgreement) -> str:
    return f"{percent(one.rrmse_aligned)} ({phase.test}, {one.column}, {named(one.quantity)})"


def why_not(found: Validation, phase: int) -> str:
    """Why a phase is not judged, as text."""
    reasons = {p.reason for p in found.phases if p.number == phase and p.reason}
    if len(reasons) == 1:
        return f"omitted: {reasons.pop()}"
    return "omitted, see the notes" if reasons else "no axis moved enough"


def _judged(phase: Phase, quantities: Sequence[str] | None = None) -> list[ColumnAgreement]:
    """Agreement of columns that moved, of some quantities or those that the summary sums."""
    some = SUMMED[phase.number] if quantities is None else quantities
    return [a for a in phase.agreement if a.quantity in some and a.moves]


# --------------------------------------------------------------------------------------------- over all tests
def summary_blocks(found: Validation) -> list[Block]:
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
    requested = {n: [p.reason for p in found.phases if p.number == n] for n in PHASES}
    skipped = [
        f"Phase {ROMAN[n]}, {PHASES[n]}: {why_not(found, n)}."
        for n, reasons in requested.items()
        if reasons and all(reasons)
    ]
    heat = Table(
        f"RRMSE, delay removed (▲ largest of a phase, ! above {NOISE:g} × noise)",
        ("Phase and quantity", "Test", *axes),
        rows,
    )
    more = (*_actuator_blocks(found), *_spool_blocks(found), *_residual_blocks(found))
    return [how, Markup(f"<p>{key}</p>"), heat, *skipped, *more]


def _actuator_blocks(found: Validation) -> list[Block]:
    """The largest RRMSE of forces and pressures of single actuators, by phase and test."""
    phases = [p for p in found.phases if any(_judged(p, (quantity,)) for quantity in ACTUATORS)]
    if not phases:
        return []
    names = ((f"{ROMAN[p.number]} · {PHASES[p.number]}", p.test) for p in phases)
    rows = [(*name, *(_single_cell(p, q) for q in ACTUATORS)) for name, p in zip(names, phases, strict=True)]
    how = (
        "Single actuators: the largest RRMSE, delay and means removed, over actuators whose force or pressure moved. "
        "Ten actuators move six axes: forces by which they only act against each other move nothing, and a small error "
        "of a spool position, a null or a length changes them by much. Total forces do not contain them."
    )
    return [how, Table("Largest RRMSE of a single actuator", ("Phase", "Test", *map(named, ACTUATORS)), rows)]


def _single_cell(phase: Phase, quantity: str) -> Markup:
    """The largest RRMSE of one quantity of all actuators, its actuator and its error over noise."""
    worst = max(_judged(phase, (quantity,)), key=lambda a: a.rrmse_aligned, default=None)
    if worst is None:
        return text("")
    words = f"{percent(worst.rrmse_aligned)} {worst.column}, {number(worst.error_to_noise, 2)} × noise"
    return shaded(words, _shade(worst))


def _spool_blocks(found: Validation) -> list[Block]:
    """The largest RRMSE of the spool commands of the closed loop."""
    worst = worst_of(found, 3, ("spool_command", "spool_command_b"))
    if worst is None:
        return []
    phase, one = worst
    where = f"({phase.test}, {one.column})"
    return [f"Spool commands of the closed loop: largest RRMSE {percent(one.rrmse_aligned)} {where}."]


def _residual_blocks(found: Validation) -> list[Block]:
    """Residual of inverse dynamics: over the noise predicted, and its mean against calibration uncertainty."""
    tests = {p.test: p.of("wrench") for p in found.phases if p.number == 1 and not p.reason}
    if not tests:
        return []
    columns = [a.column for a in next(iter(tests.values()))]
    ratios: list[tuple[str, ...]] = [
        (test, *(f"{'! ' * (a.error_to_noise > NOISE)}{number(a.error_to_noise)}" for a in own))
        for test, own in tests.items()
    ]
    ratios.append(("noise predicted", *map(_span, zip(*tests.values(), strict=True))))
    means: list[tuple[str, ...]] = [(test, *map(_mean_cell, own)) for test, own in tests.items()]
    sd = [a.offset_expected * scale_of("wrench", a.column).factor for a in next(iter(tests.values()))]
    means.append(("calibration, one sd", *(number(one, 2) for one in sd)))
    units, heads = [f"{column} [{scale_of('wrench', column).unit}]" for column in columns], ("Test", *columns)
    return [
        "Residual of inverse dynamics (required less measured actuator force, mean and delay removed) over its "
        f"predicted sensor noise. 1 is noise alone; ! marks more than {NOISE:g} (incomplete model). Far below 1 the "
        "record has less noise than is stated, or none. The last row is the predicted noise, one standard deviation. "
        "Gain errors of sensors add to the residual of moving axes.",
        Table(f"Residual of inverse dynamics over the noise predicted (! above {NOISE:g})", heads, ratios),
        "Mean of required less measured force by inverse dynamics. The last row is its uncertainty from gains and "
        "offsets of the sensors of force (load cells, else pressures), one standard deviation; ! marks more than "
        f"{SENSED:g} of them: a weight, a pressure or a sensor is wrong.",
        Table(f"Mean error of the total actuator force (! beyond {SENSED:g} deviations)", ("Test", *units), means),
    ]


def _span(tests: Sequence[ColumnAgreement]) -> str:
    """Least and greatest noise of one column over all tests, in words."""
    scale = scale_of(tests[0].quantity, tests[0].column)
    low, high = (number(end(a.noise for a in tests) * scale.factor, 2) for end in (min, max))
    return f"{low if low == high else f'{low} to {high}'} {scale.unit}"


def _mean_cell(one: ColumnAgreement) -> str:
    beyond = abs(one.offset) > SENSED * one.offset_expected
    return f"{'! ' * beyond}{number(one.offset * scale_of(one.quantity, one.column).factor)}"


def _shade(one: ColumnAgreement) -> int:
    """Number of the shade of a cell, by its RRMSE."""
    return next(k for k, top in enumerate(_SHADES) if not one.rrmse_aligned > top)


def _cell(one: ColumnAgreement, worst: bool) -> Markup:
    if one.moves:
        return shaded(f"{'▲ ' * worst}{percent(one.rrmse_aligned)}", _shade(one))
    if one.quantity == "displacement":
        return text(f"{number(1e6 * one.error, 2)}\N{NO-BREAK SPACE}{'µrad' if one.column in ROTATIONS else 'µm'}")
    if not np.isfinite(one.error_to_noise):
        return text("almost at rest")
    return text(f"{'! ' * (one.error_to_noise > NOISE)}{number(one.error_to_noise, 2)} × noise")


# ---------------------------------------------------------------------------------------------- test by test
def test_blocks(found: Validation, test: str) -> list[Block]:
    """Return every phase of a test, collapsed: numbers, figures, spectra."""
    blocks: list[Block] = []
    phases = [p for p in found.phases if p.test == test]
    motion = next((p for p in phases if p.pair("displacement")), None)
    for phase in phases:
        title = f"Phase {ROMAN[phase.number]}: {PHASES[phase.number]}"
        if phase.reason:
            blocks.append(paragraph(Markup(f"<strong>{title}</strong>"), f" omitted: {phase.reason}."))
            continue
        axes = _shown_axes(motion or phase)
        figures: list[Block] = []
        figures += [force_figure(phase, motion, axes)] if phase.number == 1 else motion_blocks(phase, axes)
        figures += [*actuator_blocks(phase, "spool_command"), *actuator_blocks(phase, "spool_command_b")]
        for quantity in ACTUATORS:
            drawn = actuator_blocks(phase, quantity)
            figures += [details(f"Every actuator: {named(quantity)}", *drawn)] if drawn else []
        spectra = details("Spectra", *spectrum_blocks(phase, axes, found.numbers.bands))
        blocks.append(details(f"{title}{_short(phase)}", _metrics(phase), *figures, spectra))
    return blocks


def _shown_axes(phase: Phase) -> list[str]:
    """Axes that a phase draws: those whose displacement, or else force, moved; the strongest if none did."""
    rows = phase.of("displacement") or phase.of("wrench")
    return [a.column for a in rows if a.moves] or [max(rows, key=lambda a: a.variation).column]


def _short(phase: Phase) -> str:
    rows = (max(_judged(phase, of), key=lambda a: a.rrmse_aligned, default=None) for of in (None, ACTUATORS))
    words = [f"{percent(a.rrmse_aligned)} ({a.column}, {named(a.quantity)})" for a in rows if a is not None]
    return f", largest RRMSE {' and '.join(words)}" if words else ", almost at rest"


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
        "Delay: of the model behind the measurement (negative: ahead of it). Correlation and RMS error: delay "
        "removed. A dash: almost at rest. "
        "Values with and without delay: metrics.json."
    )
    return details("All numbers", how, Table(f"{PHASES[phase.number].capitalize()}, {phase.test}", heads, rows))

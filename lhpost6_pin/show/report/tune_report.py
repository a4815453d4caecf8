"""The report of a tuning: bands, margins and Bode plots before and after, and the chosen gains."""

from pathlib import Path

import numpy as np

from ...tuning.tune import AxisTuning, Tuning
from .control_blocks import assumption_blocks, gain_table, load_of
from .page import Block, Headline, Level, Page, Section, Table, bullet_list, grid, number, save_page
from .scales import decibels, degrees, milliseconds
from .tune_plots import bode_figure, overview_figure

__all__ = ["headlines", "losses", "measuring_doubts", "specimen_limits", "trades", "tuning_tables"]
__all__ += ["write_tune_report"]

# Judgement, not physics: the band in which every axis must follow its reference, and the margin it must keep.
FOLLOWED = (0.1, 20.0)  # [Hz]
GAIN_MARGIN = 6.0  # [dB]
UNSTABLE = "unstable"  # of settings without a response


def write_tune_report(tuning: Tuning, path: Path | str, command: str = "") -> Path:
    """Write the self-contained HTML report of a tuning to `path` and return the path."""
    verdict, level = _verdict(tuning)
    names = [axis.axis for axis in tuning.axes]
    numbers = ("noise", "feedback_targets", "feedforward_targets")
    page = Page(
        kind="Tuning report · simulated",
        title=f"Tuning of {tuning.machine.name}",
        purpose=(
            f"Tune the three-variable control of {load_of(tuning.machine)}, starting from “{tuning.before.name}”, so "
            f"that every axis follows its reference within {tuning.tolerance:g} dB and coherently (coherence at "
            f"least {tuning.coherence:g})."
        ),
        verdict=verdict,
        level=level,
        headlines=headlines(tuning),
        sections=[
            Section("bands", "Bands and margins", [*tuning_tables(tuning), overview_figure(tuning)]),
            Section("limits", "Bandwidth limitation, 20 to 33 Hz", _limits(tuning)),
            Section("bode", "Bode plots before and after", _bode(tuning)),
            Section("gains", "Chosen settings", gain_table(tuning.before, tuning.after, names)),
            Section("steps", "Tuning steps", _steps(tuning)),
            Section("assumptions", "Assumptions and sources", assumption_blocks(tuning.machine, numbers)),
        ],
        command=command,
    )
    return save_page(page, path)


def _follows(axis: AxisTuning) -> bool:
    """True if the band holds every measured frequency from 0.1 to 20 Hz."""
    f = axis.after.frequency
    inside = f[(f >= FOLLOWED[0]) & (f <= FOLLOWED[1])]
    return bool(inside.size and axis.band_after[0] <= inside[0] and axis.band_after[1] >= inside[-1])


def _verdict(tuning: Tuning) -> tuple[str, Level]:
    band = f"from {FOLLOWED[0]:g} to {FOLLOWED[1]:g} Hz"
    short = [f"{axis.axis} {_band(axis.band_after)}" for axis in tuning.axes if not _follows(axis)]
    low = [a for a in tuning.axes if not 20.0 * np.log10(a.margin_after.gain) >= GAIN_MARGIN]
    margins = ", ".join(f"{axis.axis} {decibels(axis.margin_after.gain)}" for axis in low)
    before = "" if tuning.was_stable else f"With the settings before, {tuning.before.name}, the loop is unstable. "
    words = [
        f"{before}Not all axes are within {tuning.tolerance:g} dB and coherent {band}: {', '.join(short)}."
        if short
        else f"{before}Every axis is within {tuning.tolerance:g} dB of its reference and coherent {band}.",
        f"Gain margin below {GAIN_MARGIN:g} dB: {margins}."
        if low
        else f"The gain margin of every axis is at least {GAIN_MARGIN:g} dB.",
        f"The loop is {'stable' if tuning.doubled else 'unstable'} with all master gains doubled.",
        *specimen_limits(tuning),
        *losses(tuning),
        *trades(tuning),
        *measuring_doubts(tuning),
    ]
    if any(np.isnan(axis.band_after[0]) for axis in tuning.axes):
        return " ".join(words), "bad"
    doubtful = short or low or not tuning.doubled or losses(tuning) or measuring_doubts(tuning)
    return " ".join(words), "attention" if doubtful else "good"


def losses(tuning: Tuning) -> list[str]:
    """Sentences on axes that are worse with the settings found than with those before."""
    return [f"Worse than before in {axis.axis}: {'; '.join(axis.worse)}." for axis in tuning.axes if axis.worse]


def trades(tuning: Tuning) -> list[str]:
    """Sentences on axes whose margin is smaller than before in return for a wider band: no loss, but stated."""
    start = "For a band at least a tenth wider the margin is smaller than before in"
    return [f"{start} {axis.axis}: {'; '.join(axis.traded)}." for axis in tuning.axes if axis.traded]


def specimen_limits(tuning: Tuning) -> list[str]:
    """A sentence on axes that do not follow to the end because of a mode of the specimen, and what corrects them."""
    axes = [axis.axis for axis in tuning.axes if axis.limited_by_specimen and not _follows(axis)]
    if not axes:
        return []
    return [
        f"In {', '.join(axes)} the band ends near a mode of the specimen, whose notch these gains do not correct: "
        "iterate the drive of each motion (`lhpost6 iterate`)."
    ]


def measuring_doubts(tuning: Tuning) -> list[str]:
    """Sentences on axes whose response was measured in a run that was not linear."""
    start = "The response measured is not that of a linear table in"
    return [f"{start} {axis.axis}: {axis.doubt}." for axis in tuning.axes if axis.doubt]


def headlines(tuning: Tuning) -> list[Headline]:
    """Return the cards: narrowest band, smallest gain margin, target delay."""
    lost = [axis for axis in tuning.axes if np.isnan(axis.band_after[1])]
    narrow = lost[0] if lost else min(tuning.axes, key=lambda axis: axis.band_after[1])
    close = min(tuning.axes, key=lambda axis: axis.margin_after.gain)
    late = [axis.delay_after for axis in tuning.axes if np.isfinite(axis.delay_after)]
    measured = f"measured after tuning: {number(1e3 * min(late))} to {milliseconds(max(late))}" if late else ""
    return [
        Headline(
            _band(narrow.band_after),
            "Narrowest band",
            f"axis {narrow.axis}; before: {_band_before(tuning, narrow)}",
            "bad" if lost else "good" if all(map(_follows, tuning.axes)) else "attention",
        ),
        Headline(
            decibels(close.margin_after.gain),
            "Smallest gain margin",
            f"axis {close.axis}, {_at(close.margin_after.gain_frequency)}; {_smallest_before(tuning)}",
            "good" if 20.0 * np.log10(close.margin_after.gain) >= GAIN_MARGIN else "attention",
        ),
        Headline(
            milliseconds(tuning.delay),
            "Common target delay",
            measured or "not measured: no axis is coherent",
        ),
    ]


def tuning_tables(tuning: Tuning) -> list[Block]:
    """Return the tables of bands and margins before and after."""
    bands: list[tuple[str, ...]] = []
    margins: list[list[str]] = []
    for axis in tuning.axes:
        before = milliseconds(axis.delay_before), _extremes(axis, after=False)
        if not tuning.was_stable:
            before = UNSTABLE, UNSTABLE
        delays, spread = (before[0], milliseconds(axis.delay_after)), (before[1], _extremes(axis, after=True))
        bands.append((axis.axis, _band_before(tuning, axis), _band(axis.band_after), *delays, *spread))
        margins.append([axis.axis])
        for margin in (axis.margin_before, axis.margin_after):
            if margin is axis.margin_before and not tuning.was_stable:
                margins[-1] += [UNSTABLE, UNSTABLE]
                continue
            margins[-1].append(f"{decibels(margin.gain)} {_at(margin.gain_frequency)}")
            margins[-1].append(f"{degrees(margin.phase)} {_at(margin.phase_frequency)}")
    what = f"Unbroken band around 1 Hz within {tuning.tolerance:g} dB, coherence at least {tuning.coherence:g}"
    size = f"|T| {FOLLOWED[0]:g} to {FOLLOWED[1]:g} Hz"
    band_header = (
        "Axis",
        "Band before",
        "Band after",
        "Delay before",
        "Delay after",
        f"{size} before",
        f"{size} after",
    )
    margin_header = ("Axis", "Gain before", "Phase before", "Gain after", "Phase after")
    return [
        Table(what, band_header, bands),
        Table("Margins of the linear model without dry friction, the other axes closed", margin_header, margins),
    ]


def _extremes(axis: AxisTuning, *, after: bool) -> str:
    """Least and largest gain in the band that must be followed."""
    measured = axis.after if after else axis.before
    f = measured.frequency
    size = np.abs(measured.response[(f >= FOLLOWED[0]) & (f <= FOLLOWED[1]), 0, 0])
    if not size.size or not np.isfinite(size).any():
        return "–"
    return f"{decibels(np.nanmin(size), sign=True)} to {decibels(np.nanmax(size), sign=True)}"


def _band_before(tuning: Tuning, axis: AxisTuning) -> str:
    return _band(axis.band_before) if tuning.was_stable else UNSTABLE


def _smallest_before(tuning: Tuning) -> str:
    """The smallest gain margin before, which may be that of another axis."""
    if not tuning.was_stable:
        return f"before: {UNSTABLE}"
    close = min(tuning.axes, key=lambda axis: axis.margin_before.gain)
    return f"smallest before: {decibels(close.margin_before.gain)}, axis {close.axis}"


def _limits(tuning: Tuning) -> list[Block]:
    how = (
        "Within its band each axis meets the tolerance. Limitation of each band, according to the response measured at "
        "the next frequency:"
    )
    reasons = (f"{a.axis}, {_band(a.band_after)}: {a.limited_by or 'no cause identified'}" for a in tuning.axes)
    return [how, bullet_list(reasons)]


def _bode(tuning: Tuning) -> list[Block]:
    how = (
        "Response from reference to achieved acceleration under white noise on that axis alone, with another seed "
        f"than that of the fit. The shaded band is ±{tuning.tolerance:g} dB. Phase is shown after removing the common "
        f"delay of {milliseconds(tuning.delay)}, and as measured. The dashed line is the response of the linear model "
        "without dry friction with these settings; the dotted line marks the end of the operational band."
    )
    return [how, grid(*(bode_figure(tuning, a) for a in range(len(tuning.axes))), pairs=True)]


def _steps(tuning: Tuning) -> list[Block]:
    if not tuning.steps:
        return ["No steps recorded."]
    rows = [
        (f"{n}. {step.stage}", step.axis, number(step.before), number(step.after), step.reason)
        for n, step in enumerate(tuning.steps, 1)
    ]
    how = (
        "Feedback first, displacement gain Kx and force feedback KF, on the linear model, each with the criterion that "
        "ends its search; then feedforward of "
        "velocity Kvf, jerk Kjf and acceleration Kaf, fitted to the response measured. The expected error of a fit is "
        "the relative deviation of the response from a pure delay over the fitted band."
    )
    return [how, Table("Decisions, SI", ("Step", "Axis", "Before", "After", "Reason"), rows)]


def _band(band: tuple[float, float]) -> str:
    if np.isnan(band[0]):
        return "no band"
    return f"{number(band[0], 2)} to {number(band[1])}\N{NO-BREAK SPACE}Hz"


def _at(frequency: float) -> str:
    return f"at {number(frequency)}\N{NO-BREAK SPACE}Hz" if np.isfinite(frequency) else ""

"""Section of a run report on the ground motion itself: response spectra and intensity measures."""

from collections.abc import Sequence

from ...data.motion_measures import MOTIONS, PERIODS, MotionMeasures
from ...motions.intensity_measures import IntensityMeasures
from .charts import Curve, Panel, XAxis, chart_figure
from .page import Block, Figure, Table, details, missing, number
from .plots import ACHIEVED, SUPPLY, TARGET
from .scales import SCALES, axis_scale, axis_title, percent

__all__ = ["PERIOD_AXIS", "intensity_table", "spectrum_blocks"]

PERIOD_AXIS = XAxis("Period [s]", log=True, ticks=(0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10))
LINES = {"target": TARGET, "achieved": ACHIEVED, "required": SUPPLY}
WORDS = (
    "Peak ground acceleration, velocity and displacement (PGA, PGV, PGD); Arias intensity π/(2g) ∫ a² dt; significant "
    "duration, in which it grows from 5 to 95 %; cumulative absolute velocity (CAV) ∫ |a| dt. Spectrum error: RMS of "
    f"PSA achieved over target, less one, at periods from {PERIODS[0]:g} to {PERIODS[-1]:g} s."
)
ROW_HEIGHT = 300  # [CSS px]
FOLDED_HEIGHT = 200  # [CSS px]


def spectrum_blocks(measures: Sequence[MotionMeasures]) -> list[Block]:
    """Return intensity measures and response spectra of target and achieved motion of the commanded axes."""
    lacking = [name for name in MOTIONS if not any(name in one.spectra for one in measures)]
    absent = [f"{MOTIONS[name]}_acceleration" for name in lacking]
    blocks: list[Block] = [missing(absent, "Their response spectra are not drawn.")] if absent else []
    if len(absent) == len(MOTIONS):
        return blocks
    if any(one.intensity for one in measures):
        blocks += [WORDS, intensity_table(measures)]
    return [*blocks, *(block for one in measures if one.spectra for block in _axis_blocks(one))]


def intensity_table(measures: Sequence[MotionMeasures]) -> Table:
    """Return the intensity measures of the translational axes, of target and achieved motion."""
    rows = [
        (f"{one.axis} {name}", *_cells(values), percent(one.spectrum_error) if name == "achieved" else "–")
        for one in measures
        for name, values in one.intensity.items()
    ]
    header = ("Motion", "PGA [g]", "PGV [m/s]", "PGD [mm]", "Arias [m/s]", "D5–95 [s]", "CAV [m/s]", "Spectrum error")
    return Table("Intensity measures", header, rows)


def _cells(values: IntensityMeasures) -> list[str]:
    factors = [SCALES[quantity].factor for quantity in ("acceleration", "velocity", "displacement")]
    return [number(x * f) for x, f in zip(values, (*factors, 1.0, 1.0, 1.0), strict=True)]


def _axis_blocks(one: MotionMeasures) -> list[Block]:
    """Return the pseudo-acceleration spectra of an axis; those of velocity and displacement are folded."""
    words = f"Pseudo-spectral acceleration (PSA), {number(100 * one.damping, 1)} % damping."
    if one.spectrum_error == one.spectrum_error:
        words += f" Spectrum error {percent(one.spectrum_error)}."
    words += " Dashed: the required response spectrum." * ("required" in one.spectra)
    folded = (_panel(one, "velocity", "PSV"), _panel(one, "displacement", "SD"))
    more = "Pseudo-spectral velocity (PSV) and spectral displacement (SD)"
    return [
        _figure(one, "spectrum", words, [_panel(one, "acceleration", "PSA")], ROW_HEIGHT),
        details(f"{more}, axis {one.axis}", _figure(one, "spectra", f"{more}.", folded, FOLDED_HEIGHT)),
    ]


def _figure(one: MotionMeasures, name: str, words: str, panels: Sequence[Panel], height: int) -> Figure:
    return chart_figure(f"{name}-{one.axis}", axis_title(one.axis), words, panels, PERIOD_AXIS, row_height=height)


def _panel(one: MotionMeasures, quantity: str, short: str) -> Panel:
    scale, curves = axis_scale(one.axis, quantity), []
    field = quantity if quantity == "displacement" else f"pseudo_{quantity}"
    for name, spectrum in one.spectra.items():
        style = {**LINES[name], "width": LINES[name]["width"] + 0.6}
        curves.append(Curve(name, spectrum.period, scale.factor * getattr(spectrum, field), style))
    return Panel(f"{short} [{scale.unit}]", curves, from_zero=True)

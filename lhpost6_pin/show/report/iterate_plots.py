"""Sections of an iteration report: motion, error spectra, drive, and the identified transfer function of the table."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.names import AXES, SAMPLE_RATE
from ...data.signals import align, lowpass_zero_phase
from ...mechanics.pose import platen_motion
from ...tuning.identify import tuning_numbers
from ...tuning.iterate import Iterated, TableInverse
from .charts import Curve, Panel, XAxis, chart_figure, matrix_figure
from .control_blocks import AXIS_LINES, axis_title
from .page import Figure, Markup, figure, grid, paragraph
from .plots import ACHIEVED, AFTER, BEFORE, BUCKETS, RECORDED, SCALES, TARGET, Row, Trace, time_figure
from .run_metrics import peak_window
from .run_motion import ROTATIONS, axis_scale, percent, shown_as

__all__ = ["AxisIteration", "compare", "drive_blocks", "motion_blocks", "spectrum_blocks", "table_blocks"]

STEP = 1.0 / SAMPLE_RATE
ORDER = 32  # of the low-pass that ends the band drawn, as steep as the one that errors are judged with
CLOSE_UP = 1.0  # [s] drawn at full rate around the strongest
SEGMENT = 8.0  # [s] of the segments of the spectra; half of a shorter record
SHOWN = (0.2, 100.0)  # [Hz] of the error's spectrum
MATRIX = (0.5, 40.0)  # [Hz]

Array = NDArray[np.float64]


class AxisIteration(NamedTuple):
    """Acceleration of an axis, (n,) SI; `target`, `first` and `best` low-passed, delays removed."""

    axis: str
    target: Array
    first: Array
    best: Array
    wanted: Array  # target, not low-passed
    recorded: tuple[Array, Array]  # first and best, not low-passed
    delays: tuple[float, float]  # [s] of first and best
    errors: tuple[float, float]  # RRMSE of the same


def compare(result: Iterated, high: float) -> list[AxisIteration]:
    """Accelerations of the first and the best run on every axis that the target moves, judged up to `high` [Hz]."""
    runs = result.first_run, result.best_run
    motions = [platen_motion(run.plant, run.q, run.v, run.a).acceleration for run in runs]
    history = result.history[0], result.history[result.best]
    found = []
    for k, axis in enumerate(AXES):
        if np.isnan(history[0].acceleration[k]):
            continue
        late = [float(i.delay[k]) for i in history]
        moved = [align(m[:, k], d if np.isfinite(d) else 0.0, STEP) for m, d in zip(motions, late, strict=True)]
        wanted = result.target.acceleration[:, k]
        target, first, best = (lowpass_zero_phase(x, STEP, high, order=ORDER) for x in (wanted, *moved))
        errors = [float(i.acceleration[k]) for i in history]
        pairs = (moved[0], moved[1]), (late[0], late[1]), (errors[0], errors[1])
        found.append(AxisIteration(axis, target, first, best, wanted, *pairs))
    return found


def motion_blocks(found: Sequence[AxisIteration]) -> list[Markup]:
    """Return target and achieved acceleration of the first and the best run, with a close-up of every axis."""
    high = tuning_numbers().number("iteration.high")
    how = (
        f"Low-passed at {high:g} Hz, the judged band, with the delay of each run removed. Grey: target. The shaded "
        "interval is drawn below at the full rate, where the dotted line is the best run without the low-pass."
    )
    blocks = [paragraph(how)]
    for one in found:
        blocks.append(figure(_motion(one)))
        blocks.append(figure(_close_up(one)))
    return blocks


def spectrum_blocks(found: Sequence[AxisIteration]) -> list[Markup]:
    """Return amplitude spectral densities of target and errors, per axis."""
    from scipy.signal import welch

    drawings = []
    for one in found:
        scale = axis_scale(one.axis, "acceleration")
        length = min(round(SEGMENT * SAMPLE_RATE), len(one.wanted) // 2)
        curves = []
        signals = (one.wanted, one.recorded[0] - one.wanted, one.recorded[1] - one.wanted)
        for name, values, line in zip(
            ("target", "error, first run", "error, best run"), signals, (TARGET, BEFORE, AFTER), strict=True
        ):
            f, power = welch(scale.factor * values, SAMPLE_RATE, nperseg=length)
            inside = (f >= SHOWN[0]) & (f <= SHOWN[1]) & (power > 0.0)
            curves.append(Curve(name, f[inside], np.sqrt(power[inside]), line))
        top = max((float(np.max(np.asarray(c.y, float))) for c in curves if np.size(c.y)), default=1.0)
        panel = Panel(f"Spectral density [{scale.unit}/√Hz]", curves, log=True, span=(1e-5 * top, 2.0 * top))
        words = f"RRMSE {percent(one.errors[0])} in the first run, {percent(one.errors[1])} in the best."
        over = XAxis("Frequency [Hz]", log=True, span=SHOWN, ticks=(0.2, 0.5, 1, 2, 5, 10, 20, 50, 100))
        end = tuning_numbers().number("iteration.high")
        name = f"error-{one.axis}"
        drawings.append(
            figure(chart_figure(name, axis_title(one.axis), words, [panel], over, row_height=230, marks=[end]))
        )
    how = (
        "Errors are achieved minus target acceleration, delay removed. The dotted line marks the end of the judged "
        "band."
    )
    return [paragraph(how), grid(*drawings, pairs=True)]


def drive_blocks(result: Iterated, found: Sequence[AxisIteration]) -> list[Markup]:
    """Return the best drive over the reference, in the quantity of the controller's mode."""
    mode = result.settings.mode
    how = f"The drive is a {mode}, the mode of the reference generator; the reference is the drive of iteration 0."
    drawings = []
    for one in found:
        k = AXES.index(one.axis)
        reference, drive = result.drives[0][:, k], result.drive[:, k]
        scale = axis_scale(one.axis, mode)
        traces = [Trace("reference", reference, TARGET), Trace("best drive", drive, ACHIEVED)]
        ratio = float(np.abs(drive).max() / np.abs(reference).max()) if np.any(reference) else float("nan")
        words = f"Peak {shown_as(float(np.abs(drive).max()), scale)}, {percent(ratio)} of the reference's."
        rows = [Row(mode.capitalize(), traces, scale)]
        drawings.append(
            figure(
                time_figure(
                    f"drive-{one.axis}", axis_title(one.axis), words, rows, start=0.0, step=STEP, buckets=BUCKETS // 2
                )
            )
        )
    return [paragraph(how), grid(*drawings, pairs=True)]


def table_blocks(table: TableInverse) -> list[Markup]:
    """Return the magnitudes of the transfer function that was inverted, and its coherence."""
    transfer = table.transfer
    radius = tuning_numbers().number("noise.rotation_radius")
    f = transfer.frequency
    inside = (f >= MATRIX[0]) & (f <= MATRIX[1])
    size = np.where(np.isin(transfer.axes, ROTATIONS), radius, 1.0)
    response = np.abs(transfer.response[inside]) * size[:, None] / size
    decibels = 20.0 * np.log10(np.maximum(response, np.finfo(float).tiny))
    words = (
        f"Magnitude [dB], rows achieved, columns reference, one scale; rotations are multiplied by {radius:g} m. "
        f"Delay {shown_as(table.delay, SCALES['time'])}, the mean of the axes."
    )
    matrix = matrix_figure(
        "table",
        "From reference to achieved acceleration",
        words,
        transfer.axes,
        f[inside],
        decibels,
        AFTER,
        (-70.0, 15.0),
    )
    coherent = [
        Curve(axis, f[inside], transfer.coherence[inside, k], AXIS_LINES[axis]) for k, axis in enumerate(transfer.axes)
    ]
    over = XAxis("Frequency [Hz]", log=True, span=MATRIX, ticks=(0.5, 1, 2, 5, 10, 20, 40))
    panel = Panel("Multiple coherence", coherent, span=(0.0, 1.05))
    said = (
        "Fraction of each axis's motion explained linearly by all six references; the inverse is faded out where it "
        "falls from 0.8 to 0.4."
    )
    high = tuning_numbers().number("iteration.high")
    coherence = chart_figure("coherence", "Coherence of every axis", said, [panel], over, row_height=210, marks=[high])
    return [figure(matrix), figure(coherence)]


def _motion(one: AxisIteration) -> Figure:
    scale = axis_scale(one.axis, "acceleration")
    late = [shown_as(d, SCALES["time"]) for d in one.delays]
    words = (
        f"First run: RRMSE {percent(one.errors[0])}, delay {late[0]} removed. "
        f"Best run: RRMSE {percent(one.errors[1])}, delay {late[1]} removed."
    )
    traces = [
        Trace("target", one.target, TARGET),
        Trace("first", one.first, BEFORE),
        Trace("best", one.best, ACHIEVED),
    ]
    errors = [
        Trace("first, error", one.first - one.target, BEFORE),
        Trace("best, error", one.best - one.target, ACHIEVED),
    ]
    rows = [Row("Acceleration", traces, scale), Row("Error", errors, scale)]
    window = peak_window(one.target, STEP, CLOSE_UP)
    bands = [(window[0] * STEP, window[1] * STEP)] if window else []
    return time_figure(
        f"motion-{one.axis}", axis_title(one.axis), words, rows, start=0.0, step=STEP, bands=bands, row_height=150
    )


def _close_up(one: AxisIteration) -> Figure:
    n = len(one.target)
    first, last = peak_window(one.target, STEP, CLOSE_UP) or (0, n)
    part = slice(first, last)
    traces = [
        Trace("target", one.target[part], TARGET),
        Trace("first", one.first[part], BEFORE),
        Trace("best", one.best[part], ACHIEVED),
        Trace("best, all frequencies", one.recorded[1][part], RECORDED),
    ]
    return time_figure(
        f"close-{one.axis}",
        f"{axis_title(one.axis)}, close-up",
        "The second around the peak, every sample.",
        [Row("Acceleration", traces, axis_scale(one.axis, "acceleration"))],
        start=first * STEP,
        step=STEP,
        buckets=last - first,
        alone=True,
        row_height=210,
    )

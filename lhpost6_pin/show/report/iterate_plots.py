"""Sections of an iteration report: motion, error spectra, drive, and the identified transfer function of the table."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.arrays import Array
from ...core.names import AXES, SAMPLE_RATE
from ...data.metrics import peak_window
from ...data.signals import align, lowpass_zero_phase
from ...mechanics.pose import platen_motion
from ...tuning.identify import tuning_numbers
from ...tuning.iterate import Iterated, TableInverse
from .charts import Curve, Panel, chart_figure, frequency_axis, matrix_figure, spectra_figure
from .control_blocks import AXIS_LINES
from .page import Block, Figure, grid
from .plots import ACHIEVED, AFTER, BEFORE, BUCKETS, RECORDED, TARGET, Row, Trace, time_figure
from .scales import ROTATIONS, axis_scale, axis_title, milliseconds, percent, shown_as

__all__ = ["AxisIteration", "compare", "drive_blocks", "motion_blocks", "spectrum_blocks", "table_blocks"]

STEP = 1.0 / SAMPLE_RATE
ORDER = 32  # of the low-pass that ends the band drawn, as steep as the one that errors are judged with
CLOSE_UP = 1.0  # [s] drawn at full rate around the strongest
SEGMENT = 8.0  # [s] of the segments of the spectra; half of a shorter record
SHOWN = (0.2, 100.0)  # [Hz] of the error's spectrum
MATRIX = (0.5, 40.0)  # [Hz]


class AxisIteration(NamedTuple):
    """Acceleration of an axis, (n,) SI; `target`, `first` and `best` low-passed, delays removed."""

    axis: str
    target: Array
    first: Array
    best: Array
    unfiltered: tuple[Array, Array, Array]  # target, first and best, not low-passed
    delays: tuple[float, float]  # [s] of first and best
    errors: tuple[float, float]  # RRMSE of the same


def compare(result: Iterated, high: float) -> list[AxisIteration]:
    """Accelerations of the first and the best run on every axis that the target moves, judged up to `high` [Hz]."""
    runs = result.first_run, result.best_run
    motions = [platen_motion(run.plant, run.q, run.v, run.a).acceleration for run in runs]
    history = result.history[0], result.history[result.best]
    late, rrmse = [i.delay for i in history], [i.acceleration for i in history]
    found = []
    for k, axis in enumerate(AXES):
        if np.isnan(history[0].acceleration[k]):
            continue
        delays, errors = ((float(a[k]), float(b[k])) for a, b in (late, rrmse))
        moved = [align(m[:, k], d if np.isfinite(d) else 0.0, STEP) for m, d in zip(motions, delays, strict=True)]
        unfiltered = result.target.acceleration[:, k], moved[0], moved[1]
        target, first, best = (lowpass_zero_phase(x, STEP, high, order=ORDER) for x in unfiltered)
        found.append(AxisIteration(axis, target, first, best, unfiltered, delays, errors))
    return found


def motion_blocks(found: Sequence[AxisIteration]) -> list[Block]:
    """Return target and achieved acceleration of the first and the best run, with a close-up of every axis."""
    how = (
        f"Low-passed at {_judged_to():g} Hz, the judged band, with the delay of each run removed. Grey: target. The "
        "shaded interval is drawn below at the full rate, where the dotted line is the best run without the low-pass."
    )
    return [how, *(figure for one in found for figure in _motion(one))]


def _motion(one: AxisIteration) -> list[Figure]:
    """Motion and errors of an axis, and a close-up around its peak."""
    scale, title = axis_scale(one.axis, "acceleration"), axis_title(one.axis)
    runs = [
        f"{name} run: RRMSE {percent(error)}, delay {milliseconds(late)} removed."
        for name, error, late in zip(("First", "Best"), one.errors, one.delays, strict=True)
    ]
    traces = [Trace("target", one.target, TARGET), Trace("first", one.first, BEFORE), Trace("best", one.best, ACHIEVED)]
    errors = [
        Trace("first, error", one.first - one.target, BEFORE),
        Trace("best, error", one.best - one.target, ACHIEVED),
    ]
    rows = [Row("Acceleration", traces, scale), Row("Error", errors, scale)]
    window = peak_window(one.target, STEP, CLOSE_UP)
    bands = [(window[0] * STEP, window[1] * STEP)] if window else []
    near = [Row("Acceleration", [*traces, Trace("best, all frequencies", one.unfiltered[2], RECORDED)], scale)]
    words, whole = "The second around the peak, every sample.", (0, len(one.target))
    return [
        time_figure(
            f"motion-{one.axis}", title, " ".join(runs), rows, start=0.0, step=STEP, bands=bands, row_height=150
        ),
        time_figure(
            f"close-{one.axis}",
            f"{title}, close-up",
            words,
            near,
            start=0.0,
            step=STEP,
            window=window or whole,
            row_height=210,
        ),
    ]


def spectrum_blocks(found: Sequence[AxisIteration]) -> list[Block]:
    """Return amplitude spectral densities of target and errors, per axis."""
    from scipy.signal import welch

    names, lines = ("target", "error, first run", "error, best run"), (TARGET, BEFORE, AFTER)
    drawings = []
    for one in found:
        target, first, best = one.unfiltered
        length = min(round(SEGMENT * SAMPLE_RATE), len(target) // 2)
        f, power = welch(np.array([target, first - target, best - target]), SAMPLE_RATE, nperseg=length)
        words = f"RRMSE {percent(one.errors[0])} in the first run, {percent(one.errors[1])} in the best."
        drawings.append(
            spectra_figure(
                f"error-{one.axis}",
                axis_title(one.axis),
                words,
                list(zip(names, power, lines, strict=True)),
                f,
                axis_scale(one.axis, "acceleration"),
                SHOWN,
                decades=5.0,
                row_height=230,
                marks=[_judged_to()],
            )
        )
    how = (
        "Errors are achieved minus target acceleration, delay removed. The dotted line marks the end of the judged "
        "band."
    )
    return [how, grid(*drawings, pairs=True)]


def drive_blocks(result: Iterated, found: Sequence[AxisIteration]) -> list[Block]:
    """Return the best drive over the reference, in the quantity of the controller's mode."""
    mode = result.settings.mode
    how = f"The quantity of the drive is {mode}, the mode of the reference generator; iteration 0 is the reference."
    drawings = []
    for one in found:
        k, scale = AXES.index(one.axis), axis_scale(one.axis, mode)
        reference, drive = result.drives[0][:, k], result.drive[:, k]
        ratio = float(np.abs(drive).max() / np.abs(reference).max()) if np.any(reference) else float("nan")
        words = f"Peak {shown_as(float(np.abs(drive).max()), scale)}, {percent(ratio)} of the reference's."
        rows = [
            Row(mode.capitalize(), [Trace("reference", reference, TARGET), Trace("best drive", drive, ACHIEVED)], scale)
        ]
        name, title = f"drive-{one.axis}", axis_title(one.axis)
        drawings.append(time_figure(name, title, words, rows, start=0.0, step=STEP, buckets=BUCKETS // 2))
    return [how, grid(*drawings, pairs=True)]


def table_blocks(table: TableInverse) -> list[Block]:
    """Return the magnitudes of the transfer function that was inverted, and its coherence."""
    transfer = table.transfer
    radius = tuning_numbers().number("noise.rotation_radius")
    inside = (transfer.frequency >= MATRIX[0]) & (transfer.frequency <= MATRIX[1])
    f = transfer.frequency[inside]
    size = np.where(np.isin(transfer.axes, ROTATIONS), radius, 1.0)
    response = np.abs(transfer.response[inside]) * size[:, None] / size
    decibels = 20.0 * np.log10(np.maximum(response, np.finfo(float).tiny))
    words = (
        f"Magnitude [dB], rows achieved, columns reference, one scale; rotations are multiplied by {radius:g} m. "
        f"Delay {milliseconds(table.delay)}, the mean of the axes."
    )
    title, span = "From reference to achieved acceleration", (-70.0, 15.0)
    matrix = matrix_figure("table", title, words, transfer.axes, f, decibels, AFTER, span)
    coherent = [Curve(axis, f, transfer.coherence[inside, k], AXIS_LINES[axis]) for k, axis in enumerate(transfer.axes)]
    panels = [Panel("Multiple coherence", coherent, span=(0.0, 1.05))]
    several = len(transfer.axes) > 1
    how = (
        f"Fraction of {'each' if several else 'the'} axis's motion explained linearly by "
        f"{f'the {len(transfer.axes)} references' if several else 'the reference'}; the inverse is faded out where it "
        "falls from 0.8 to 0.4."
    )
    over, marks = frequency_axis(*MATRIX), [_judged_to()]
    return [
        matrix,
        chart_figure("coherence", "Coherence", how, panels, over, row_height=210, marks=marks),
    ]


def _judged_to() -> float:
    """End of the band that errors are judged in [Hz]."""
    return tuning_numbers().number("iteration.high")

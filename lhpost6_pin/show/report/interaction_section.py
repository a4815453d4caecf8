"""Section of a run report on table and specimen: responses with and without it, and spectra at its periods."""

import numpy as np
import xarray as xr

from ...data.metrics import channel, commanded_axes, labels, sampling
from ...data.motion_measures import DAMPING
from ...motions.response_spectra import response_spectrum
from ...tuning.interaction import Interaction
from .charts import Curve, Panel, chart_figure, frequency_axis, with_peaks
from .page import Block, Table, grid, number
from .plots import palette
from .scales import axis_scale, axis_title, decibels, percent, shown_as

__all__ = ["interaction_blocks", "period_table"]

BAND = (0.1, 40.0)  # [Hz] drawn
GAINS = (-24.0, 12.0)  # [dB] drawn, and peaks above


def interaction_blocks(record: xr.Dataset, found: Interaction) -> list[Block]:
    """Return what the specimen changes in the table's response, its modes, and spectra at its periods."""
    moved = [axis for axis in commanded_axes(record) if axis in found.axes] or list(found.axes)
    how = (
        "Response from reference to feedback of each axis by the linear model at rest without dry friction. Notch and "
        "peak are the least and largest ratio to the bare table's response, with the same settings on the bare table, "
        "up to the end of the operational band."
    )
    rows = [
        (cut.axis, name, f"{decibels(cut.notch, sign=True)} at {number(cut.notch_frequency)}\N{NO-BREAK SPACE}Hz",
         f"{decibels(cut.peak, sign=True)} at {number(cut.peak_frequency)}\N{NO-BREAK SPACE}Hz")
        for k, axis in enumerate(found.axes)
        for name, cuts in found.cuts.items()
        for cut in [cuts[k]]
        if axis in moved or 20.0 * np.log10(cut.peak / max(cut.notch, 1e-9)) > 3.0
    ]  # fmt: skip
    table = Table("Notch and peak against the bare table", ("Axis", "Response", "Notch", "Peak"), rows)
    lines = palette(len(found.responses))
    drawn = []
    for axis in moved:
        k = found.axes.index(axis)
        size, turn = [], []
        for (name, response), line in zip(found.responses.items(), lines, strict=True):
            part = (found.frequency >= BAND[0]) & (found.frequency <= BAND[1])
            f, one = found.frequency[part], response[part, k]
            size.append(Curve(name, f, 20.0 * np.log10(np.maximum(np.abs(one), 1e-6)), line))
            turn.append(Curve(name, f, np.degrees(np.unwrap(np.angle(one))), line))
        panels = [Panel("Magnitude [dB]", size, span=with_peaks(GAINS, size)), Panel("Phase [deg]", turn)]
        marks = [mode.frequency for mode in found.modes[:6] if BAND[0] < mode.frequency < BAND[1]]
        words = "Vertical lines: modes of the specimen on a fixed base." if marks else "Linear model."
        title = axis_title(axis)
        drawn.append(chart_figure(f"interaction-{axis}", title, words, panels, frequency_axis(*BAND), marks=marks))
    modes = [
        (number(mode.frequency, 4), number(1.0 / mode.frequency), percent(mode.damping),
         *(number(x * 1e-3) for x in mode.mass[:3]))
        for mode in found.modes
    ]  # fmt: skip
    header = ("Frequency [Hz]", "Period [s]", "Damping", "Effective mass x [t]", "y [t]", "z [t]")
    shown: list[Block] = [how, table, grid(*drawn, pairs=True)]
    if modes:
        shown.append(Table("Modes of the specimen on a fixed base", header, modes))
        shown += period_table(record, found)
    elif found.rigid:
        shown.append("The specimen is rigid: it has no periods of its own.")
    else:
        shown.append("The specimen has no mode on a fixed base that its model states.")
    return shown


def period_table(record: xr.Dataset, found: Interaction) -> list[Block]:
    """Return deviations of the response spectrum from the target's at the specimen's periods, the worst first."""
    names = ("reference_acceleration", "platen_acceleration")
    if any(name not in record for name in names) or not found.modes:
        return []
    _, step = sampling(record)
    periods = np.array([1.0 / mode.frequency for mode in found.modes if 1.0 / mode.frequency >= 10.0 * step])
    rows = []
    for axis in commanded_axes(record):
        k = labels(record, "axis").index(axis)
        motions = [channel(record, name)[:, k] for name in names]
        if not periods.size or not all(np.isfinite(x).all() for x in motions):
            continue
        target, achieved = (response_spectrum(x, step, periods, DAMPING).pseudo_acceleration for x in motions)
        scale = axis_scale(axis, "acceleration")
        for period, wanted, got in zip(periods, target, achieved, strict=True):
            share = got / wanted - 1.0 if wanted > 0.0 else np.nan
            texts = axis, number(period), shown_as(wanted, scale), shown_as(got, scale), percent(share)
            rows.append((abs(np.nan_to_num(share)), texts))
    if not rows:
        return []
    rows.sort(key=lambda row: -row[0])
    header = ("Axis", "Period [s]", "PSA of the target", "achieved", "Deviation")
    title = f"Response spectrum at the specimen's periods, {number(100 * DAMPING, 1)} % damping, worst first"
    return [Table(title, header, [texts for _, texts in rows])]

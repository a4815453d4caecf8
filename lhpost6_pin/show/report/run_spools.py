"""Section of a run report on the servovalves: fourth-stage spool commands and positions of every actuator."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...data.signals import delay
from .page import Figure, Markup, bar, figure, grid, missing, paragraph, table
from .plots import ACHIEVED, SCALES, TARGET, VERMILLION, Row, Trace, time_figure
from .run_components import kinds
from .run_metrics import SpoolUse, channel, peak_window, peaks, sampling
from .run_motion import percent, shown_as

__all__ = ["spool_blocks"]

Spool = Mapping[str, NDArray[np.float64]]  # of LINES, (n, n_act) [1]

LINES = {"command": TARGET, "position": ACHIEVED}
LIMITS = {"+1": 1.0, "−1": -1.0}
SPAN = (-1.2, 1.2)  # of every panel, to compare actuators and include the limits
BUCKETS = 750  # stretches a channel is divided into; half as many as of a plot over the whole width
MARKS = 300  # stretches of the record that are shaded or not for a command at its limit
CLOSE_UP = 1.0  # [s] drawn at full rate around the largest command
LONGEST_DELAY = 0.05  # [s] sought between command and position


def spool_blocks(record: xr.Dataset, spools: Sequence[SpoolUse]) -> list[Markup]:
    """Return the utilisation of the valves, and commands and positions of their spools against the limits ±1."""
    names = [f"spool_{who}" for who in LINES]
    absent = [name for name in names if name not in record]
    if len(absent) == len(names):
        return [missing(names, "Spools are not drawn.")]
    used = [[s.actuator, bar(s.peak), percent(s.rms), percent(s.saturated)] for s in spools]
    blocks = [missing(absent, "Only the other is drawn.")] if absent else []
    blocks.append(table("Valve utilisation", ("Actuator", "Largest opening", "RMS opening", "Time at the limit"), used))
    how = (
        "Fourth-stage spools as a fraction of their stroke, on one scale for all actuators, with the limits ±1. Grey: "
        "command; blue: position, behind the command by the delay of the valve. Shaded: a command is at its limit. "
        "Below, the largest command of each kind of actuator at the full rate."
    )
    blocks.append(paragraph(how))
    labels = [str(label) for label in record["actuator"].values]
    spool = {who: channel(record, f"spool_{who}", "actuator") for who in LINES if f"spool_{who}" in record}
    for own in kinds(labels):
        blocks.append(grid(*(figure(_panel(record, spool, labels[k], k)) for k in own), pairs=True))
    closest = (_close_up(record, spool, labels, own) for own in kinds(labels))
    return [*blocks, grid(*(figure(drawing) for drawing in closest if drawing), pairs=True)]


def _panel(record: xr.Dataset, spool: Spool, label: str, k: int) -> Figure:
    """Return command and position of one actuator over the whole record."""
    start, step = sampling(record)
    first = next(iter(spool))
    full = np.abs(spool[first][:, k]) >= 1.0
    words = f"Largest {first} {percent(float(peaks(spool[first][:, k])))} of the stroke"
    words += f", at its limit {percent(float(full.mean()))} of the time." if full.any() else "."
    return time_figure(
        f"plot-spool-{k + 1}",
        f"Spool {label}",
        words,
        [Row("Fraction of the stroke", _traces(spool, k, slice(None)), SCALES["ratio"], LIMITS, SPAN)],
        start=start,
        step=step,
        buckets=BUCKETS,
        bands=_stretches(full, start, step),
        band_color=VERMILLION,
    )


def _close_up(record: xr.Dataset, spool: Spool, labels: Sequence[str], own: Sequence[int]) -> Figure | None:
    """Return every sample around the largest command among the actuators `own`, on a scale of its own."""
    start, step = sampling(record)
    sizes = peaks(next(iter(spool.values()))[:, own])
    k = own[int(np.nan_to_num(sizes).argmax())]
    window = peak_window(next(iter(spool.values()))[:, k], step, CLOSE_UP)
    if window is None:
        return None
    traces = _traces(spool, k, slice(*window))
    words = "Around its largest command, every sample."
    if len(traces) == 2 and all(np.isfinite(trace.values).all() for trace in traces):
        late = float(delay(traces[0].values, traces[1].values, step, LONGEST_DELAY))
        words += f" The position is {shown_as(late, SCALES['time'])} late." if np.isfinite(late) else ""
    return time_figure(
        f"close-spool-{k + 1}",
        f"Spool {labels[k]}, close-up",
        words,
        [Row("Fraction of the stroke", traces, SCALES["ratio"])],
        start=start + window[0] * step,
        step=step,
        buckets=window[1] - window[0],
        alone=True,
    )


def _traces(spool: Spool, k: int, part: slice) -> list[Trace]:
    return [Trace(who, values[part, k], LINES[who]) for who, values in spool.items()]


def _stretches(marked: NDArray[np.bool_], start: float, step: float) -> list[tuple[float, float]]:
    """Return the times of the stretches that hold marked samples, neighbours joined; at most half of `MARKS`."""
    size = -(-len(marked) // MARKS)
    held = np.pad(marked, (0, -len(marked) % size)).reshape(-1, size).any(axis=1)
    edges = np.flatnonzero(np.diff(held, prepend=False, append=False)) * size
    times = start + step * np.minimum(edges, len(marked) - 1)
    return [(float(begin), float(end)) for begin, end in times.reshape(-1, 2)]

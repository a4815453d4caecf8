"""Spool commands and positions against their limits ±1."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from ...core.arrays import Array, Mask
from ...data.metrics import SpoolUse, channel, kinds, labels, peak_window, peaks, sampling
from ...data.signals import delay_within
from .page import Block, Figure, Table, bar, details, grid, missing
from .plots import ACHIEVED, ROW, TARGET, VERMILLION, Row, Trace, time_figure
from .scales import SCALES, milliseconds, percent

__all__ = ["spool_blocks", "spool_figure"]

LINES = {"command": TARGET, "position": ACHIEVED}
LIMITS = {"+1": 1.0, "−1": -1.0}
SPAN = (-1.2, 1.2)  # of every panel, to compare actuators and include the limits
BUCKETS = 750  # stretches a channel is divided into; half as many as of a plot over the whole width
MARKS = 300  # stretches of a record that are shaded or not for a command at its limit
CLOSE_UP = 1.0  # [s] drawn at full rate around the largest command
LONGEST_DELAY = 0.05  # [s] sought between command and position


def spool_blocks(record: xr.Dataset, spools: Sequence[SpoolUse]) -> list[Block]:
    """Return the utilisation of the valves, and commands and positions of their spools against the limits ±1."""
    names = [f"spool_{who}" for who in LINES]
    absent = [name for name in names if name not in record]
    if len(absent) == len(names):
        return [missing(names, "Spools are not drawn.")]
    used = [[s.actuator, bar(s.peak), percent(s.rms), percent(s.saturated)] for s in spools]
    blocks: list[Block] = [missing(absent, "Only the other is drawn.")] if absent else []
    blocks.append(Table("Valve utilisation", ("Actuator", "Largest opening", "RMS opening", "Time at the limit"), used))
    blocks.append(
        "Fourth-stage spools as a fraction of their stroke, on one scale for all actuators, with the limits ±1. Grey: "
        "command; blue: position, behind the command by the delay of the valve. Shaded: a command is at its limit. "
        "Shown: the spool of each kind of actuator that opens most; below, the same around its peak at the full rate."
    )
    start, step = sampling(record)
    spool = {who: channel(record, f"spool_{who}") for who in LINES if f"spool_{who}" in record}
    first, drawn = next(iter(spool.items()))
    actuators = labels(record, "actuator")
    panels = {}
    for own in kinds(actuators):
        for k in own:
            full = np.abs(drawn[:, k]) >= 1.0
            words = f"Largest {first} {percent(float(peaks(drawn[:, k])))} of the stroke"
            words += f", at its limit {percent(float(full.mean()))} of the time." if full.any() else "."
            name, traces = f"plot-spool-{k + 1}", _traces(spool, k)
            panels[k] = spool_figure(name, actuators[k], words, traces, full, start=start, step=step)
    most = [own[int(np.nan_to_num(peaks(drawn[:, own])).argmax())] for own in kinds(actuators)]
    closest = [_close_up(actuators, k, _traces(spool, k), start, step) for k in most]
    blocks.append(grid(*(panels.pop(k) for k in most), *(drawing for drawing in closest if drawing), pairs=True))
    if panels:
        blocks.append(details(f"The other {len(panels)} spools", grid(*panels.values(), pairs=True)))
    return blocks


def spool_figure(
    name: str,
    actuator: str,
    words: str,
    traces: Sequence[Trace],
    full: Mask,
    *,
    start: float,
    step: float,
    window: tuple[int, int] | None = None,
    row_height: int = ROW,
) -> Figure:
    """Return spool signals of one actuator with the limits ±1; samples `full`, at the limit, are shaded.

    `window` is the stretch drawn, first and last sample, with every sample; else the whole record.
    """
    first, last = window or (0, len(full))
    return time_figure(
        name,
        f"Spool {actuator}",
        words,
        [Row("Fraction of the stroke", traces, SCALES["ratio"], LIMITS, SPAN)],
        start=start,
        step=step,
        buckets=BUCKETS,
        window=window,
        bands=_stretches(full[first:last], start + first * step, step, 1 if window else -(-len(full) // MARKS)),
        band_color=VERMILLION,
        row_height=row_height,
    )


def _close_up(actuators: Sequence[str], k: int, traces: Sequence[Trace], start: float, step: float) -> Figure | None:
    """Every sample of a spool around the largest value of its first trace, on a scale of its own."""
    window = peak_window(traces[0].values, step, CLOSE_UP)
    if window is None:
        return None
    words = "Around its largest command, every sample."
    near = [trace.values[slice(*window)] for trace in traces]
    if len(near) == 2 and np.isfinite(near).all():
        late = float(delay_within(near[0], near[1], step, LONGEST_DELAY))
        words += f" The position is {milliseconds(late)} late." if np.isfinite(late) else ""
    rows = [Row("Fraction of the stroke", traces, SCALES["ratio"])]
    title = f"Spool {actuators[k]}, close-up"
    return time_figure(f"close-spool-{k + 1}", title, words, rows, start=start, step=step, window=window)


def _traces(spool: Mapping[str, Array], k: int) -> list[Trace]:
    return [Trace(who, values[:, k], LINES[who]) for who, values in spool.items()]


def _stretches(marked: Mask, start: float, step: float, size: int) -> list[tuple[float, float]]:
    """Times of the stretches of `size` samples that hold marked ones, neighbours joined."""
    held = np.pad(marked, (0, -len(marked) % size)).reshape(-1, size).any(axis=1)
    edges = np.flatnonzero(np.diff(held, prepend=False, append=False)) * size
    times = start + step * np.minimum(edges, len(marked) - 1)
    return [(float(begin), float(end)) for begin, end in times.reshape(-1, 2)]

"""The report of a replay in open loop: the model driven by recorded spools, over what was recorded."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...data.metrics import kinds, sampling
from ...data.replay_comparison import Compared, Paired, paired
from .page import Block, Figure, Headline, Level, Page, Section, Table, details, grid, missing, number, save_page
from .plots import ACHIEVED, TARGET, Row, Trace, time_figure
from .run_report import machine_blocks
from .scales import SCALES, Scale, axis_scale, axis_title, percent, shown_as

__all__ = ["comparison_table", "write_open_loop_report"]

MOTION = ("platen_displacement", "platen_velocity", "platen_acceleration")
ACTUATORS = {
    "actuator_force": ("Actuator forces", "force"),
    "chamber_pressure_a": ("Pressures in chambers A", "pressure"),
    "chamber_pressure_b": ("Pressures in chambers B", "pressure"),
    "strut_pressure": ("Pressures in the struts", "pressure"),
}
"""Title and scale of a channel of actuators or struts."""
BUCKETS = 320  # stretches of a channel over time, each drawn by its least and greatest sample
_ROW = 110  # [CSS px]
_TABLE_WORDS = (
    "At rest: an axis that the target does not move, or a channel that does not move; its difference is noise and "
    "cross-coupling, and has no RRMSE."
)
_COLOURS = "Grey: recorded, blue: model."


def write_open_loop_report(
    measured: xr.Dataset,
    simulated: xr.Dataset,
    compared: Sequence[Compared],
    path: Path,
    *,
    notes: Sequence[str] = (),
    command: str = "",
    machine_table: Iterable[Sequence[Any]] = (),
) -> tuple[str, Level]:
    """Write the report of a replay to `path`; returns its verdict and level.

    Raises RecordError for a measured record without a uniform time.
    """
    start, step = sampling(measured)
    pairs = {pair.name: pair for pair in paired(measured, simulated, (*MOTION, *ACTUATORS))}
    verdict, level = _verdict(simulated, compared)
    attrs = simulated.attrs
    load = "bare table" if attrs["specimen"] == "none" else f"specimen {attrs['specimen']}"
    page = Page(
        kind="Open-loop report · simulated",
        title=str(attrs["title"]),
        purpose=(
            f"Drive {attrs['machine']}, {load}, by the {attrs['source']}, from the recorded pressures, for "
            f"{number(float(simulated['time'][-1]))} s. No controller corrects the model: its displacement drifts."
        ),
        verdict=verdict,
        level=level,
        headlines=[
            _worst(compared, "platen_displacement", "Worst displacement RRMSE", _of_moving(compared)),
            _worst(compared, "actuator_force", "Worst actuator force RRMSE"),
            _drift(compared),
        ],
        sections=[
            Section("motion", "Motion of the platen", _motion_blocks(pairs, compared, start, step)),
            *(
                Section(name, title, _actuator_blocks(pairs, name, start, step))
                for name, (title, _) in ACTUATORS.items()
                if name in simulated
            ),
            Section("differences", "Table of differences", [_TABLE_WORDS, comparison_table(compared)]),
            Section("assumptions", "Assumptions and sources", machine_blocks(list(machine_table))),
        ],
        notes=notes,
        command=command,
    )
    save_page(page, path)
    return verdict, level


def comparison_table(compared: Sequence[Compared]) -> Table:
    """Return peak, largest difference, RRMSE and drift of every channel."""
    rows = [
        (
            *(c.channel, f"{c.peak_recorded:.4g} {c.unit}", f"{c.largest_difference:.3g} {c.unit}"),
            *("at rest" if math.isnan(c.rrmse) else percent(c.rrmse), f"{c.drift:.3g} {c.unit}/s"),
        )
        for c in compared
    ]
    return Table("Model against record", ("channel", "peak recorded", "largest difference", "RRMSE", "drift"), rows)


def _verdict(simulated: xr.Dataset, compared: Sequence[Compared]) -> tuple[str, Level]:
    trouble, count = str(simulated.attrs.get("trouble", "none")), simulated.attrs.get("spool_values_clipped", 0)
    clipped = f" {count} recorded spool values beyond full stroke were clipped to it." if count else ""
    if trouble != "none":
        return f"The replay {trouble.partition(';')[0]}.{clipped} See the notes.", "bad"
    if not compared:
        return "Nothing is compared: the record has none of the channels that a model gives.", "plain"
    named = (("platen_displacement", "displacement"), ("actuator_force", "actuator force"))
    worst = [(word, _largest(compared, name)) for name, word in named]
    words = [f"{word} {percent(one.rrmse)} ({_label(one)})" for word, one in worst if one is not None]
    if not words:
        return "The model was driven by the recorded spools; neither displacements nor forces are compared.", "plain"
    of = _of_moving(compared)
    of = f"; displacement {of}" if of and worst[0][1] is not None else ""
    return (
        f"Driven by the recorded spools, the model differs by an RRMSE of {' and '.join(words)} at most{of}.{clipped}",
        "plain",
    )


def _of_moving(compared: Sequence[Compared]) -> str:
    """Axes by which displacements are judged, in words; empty if none of the record's is at rest."""
    own = [c for c in compared if c.channel.startswith("platen_displacement")]
    moving = [_label(c) for c in own if not math.isnan(c.rrmse)]
    return f"of the axes that move ({', '.join(moving)})" if 0 < len(moving) < len(own) else ""


def _largest(compared: Sequence[Compared], name: str) -> Compared | None:
    """Channel of a variable with the largest RRMSE, of those that move."""
    own = [c for c in compared if c.channel.split()[0] == name and np.isfinite(c.rrmse)]
    return max(own, key=lambda c: c.rrmse, default=None)


def _label(one: Compared) -> str:
    return one.channel.split()[1]


def _worst(compared: Sequence[Compared], name: str, label: str, of: str = "") -> Headline:
    one = _largest(compared, name)
    return (
        Headline("–", label, f"no {name} in the record")
        if one is None
        else Headline(percent(one.rrmse), label, f"{_label(one)}, {of}" if of else _label(one))
    )


def _drift(compared: Sequence[Compared]) -> Headline:
    """The fastest drift of a translation of the platen."""
    own = [c for c in compared if c.channel.startswith("platen_displacement") and c.unit == "m"]
    if not own:
        return Headline("–", "Drift of the displacement", "no platen_displacement in the record")
    one = max(own, key=lambda c: abs(c.drift))
    return Headline(shown_as(one.drift, Scale(1e3, "mm/s")), "Drift of the displacement", f"axis {_label(one)}")


def _motion_blocks(pairs: dict[str, Paired], compared: Sequence[Compared], start: float, step: float) -> list[Block]:
    """Motion of every axis over time; axes at rest collapsed."""
    absent = [name for name in MOTION if name not in pairs]
    blocks: list[Block] = [missing(absent, "They are not compared.")] if absent else []
    if len(absent) == len(MOTION):
        return blocks
    still = {_label(c) for c in compared if c.channel.startswith("platen_displacement") and math.isnan(c.rrmse)}
    moving: list[Figure] = []
    resting: list[Figure] = []
    for k, axis in enumerate(next(iter(pairs[name] for name in MOTION if name in pairs)).columns):
        rows = [
            Row(name.removeprefix("platen_").capitalize(), _traces(pairs[name], k), axis_scale(axis, name[7:]))
            for name in MOTION
            if name in pairs
        ]
        drawn = _figure(f"motion-{axis}", axis_title(axis), rows, start, step)
        (resting if axis in still else moving).append(drawn)
    blocks.append(grid(*moving, pairs=True))
    return [*blocks, details(f"Axes at rest ({len(resting)})", *resting)] if resting else blocks


def _actuator_blocks(pairs: dict[str, Paired], name: str, start: float, step: float) -> list[Block]:
    """A channel of every actuator or strut over time, a row each, those of a kind in one figure."""
    if name not in pairs:
        return [missing([name], "It is not compared.")]
    pair, (title, scale) = pairs[name], ACTUATORS[name]
    drawings = []
    for own in kinds(pair.columns):
        rows = [Row(pair.columns[k], _traces(pair, k), SCALES[scale]) for k in own]
        span = pair.columns[own[0]] + (f" to {pair.columns[own[-1]]}" if len(own) > 1 else "")
        drawings.append(_figure(f"{name}-{pair.columns[own[0]]}", f"{title}, {span}", rows, start, step))
    return [grid(*drawings, pairs=True)]


def _figure(name: str, title: str, rows: Sequence[Row], start: float, step: float) -> Figure:
    return time_figure(name, title, _COLOURS, rows, start=start, step=step, buckets=BUCKETS, row_height=_ROW)


def _traces(pair: Paired, k: int) -> list[Trace]:
    return [Trace("recorded", pair.recorded[:, k], TARGET), Trace("model", pair.model[:, k], ACHIEVED)]

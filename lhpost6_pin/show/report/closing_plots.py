"""Figures of an error before and after the effects found: traces of a held-out test, and what each effect does."""

from collections.abc import Sequence

import numpy as np

from ...core.names import AXES
from ...discovery import Discovery
from ...discovery.effect_loops import EffectLoop
from ...discovery.held_out import GapTraces
from ...discovery.verdict_file import title_of, where
from ...identification.validation import PHASES
from .charts import Curve, Plot, grid_figure
from .page import Block, Figure, Table, number
from .plots import AFTER, BEFORE, BLACK, PURPLE, TARGET, Row, Trace, time_figure
from .scales import SCALES, Scale, axis_scale, force_scale

__all__ = ["closing_blocks"]

WINDOW = 6.0  # [s] drawn, where the refitted model errs most
POINTS = 1500  # of a curve
CELL, GAP = 260, 0.14  # [CSS px] height of a plot; free at the left of a column, as a share of it
DELIVERED = {"color": PURPLE, "width": 1.0, "dash": "dot"}
OWN = {"color": BLACK, "width": 1.6}
_SCALES = {"N": Scale(1e-3, "kN"), "N m": Scale(1e-3, "kN m"), "m3/s": Scale(6e4, "L/min"), "Pa": SCALES["pressure"]}
_STATES = {"m": Scale(1e3, "mm"), "m/s": Scale(1.0, "m/s"), "1": Scale(100.0, "%"), "Pa": SCALES["pressure"]}
_STATES |= {"Pa/s": Scale(1e-6, "MPa/s")}


def closing_blocks(found: Discovery) -> list[Block]:
    """Return the traces of the held-out test with the widest error, and the loop of every effect found."""
    blocks: list[Block] = []
    if found.proof and found.proof.traces:
        blocks.append(_trace_figure(found.proof.traces[0], 3 if found.search.added else 2))
    if found.loops:
        blocks += [_loop_figure(found.loops), _share_table(found)]
    return blocks or ["No test was held out, and no effect was found: nothing to compare."]


def _scale_of(one: GapTraces) -> Scale:
    if one.quantity in ("displacement", "velocity", "acceleration"):
        return axis_scale(one.column, one.quantity)
    if one.column in AXES:
        return force_scale(one.column)
    return SCALES["pressure"] if one.quantity.startswith("chamber") else Scale(1e-3, "kN")


def _trace_figure(one: GapTraces, count: int) -> Figure:
    """Measured and `count` models, and their errors, over the seconds in which the refitted model errs most."""
    dt = float(one.time[1] - one.time[0])
    width = min(len(one.time), max(2, round(WINDOW / dt)))
    errors = one.models - one.measured[:, None]
    from_record = one.phase != PHASES[1]  # a simulation that starts where the record does: its drift is error
    if not from_record:
        errors = errors - errors.mean(axis=0)
    squares = np.convolve(errors[:, 1] ** 2, np.ones(width), "valid")
    first = int(np.argmax(squares))
    scale = _scale_of(one)
    names = ("as delivered", "refitted", "with the effects")[:count]
    values = [Trace("measured", one.measured, TARGET)]
    styles = (DELIVERED, BEFORE, AFTER)[:count]
    values += [Trace(n, x, s) for n, x, s in zip(names, one.models.T[:count], styles, strict=True)]
    rest = [Trace(n, x, s) for n, x, s in zip(names[1:], errors.T[1:count], styles[1:], strict=True)]
    noise = {"2 σ of sensor noise": 2.0 * one.noise, "": -2.0 * one.noise}
    what = f"{one.quantity.replace('_', ' ')}, {one.column}"
    rows = [
        Row(what[0].upper() + what[1:], values, scale),
        Row("Error" if from_record else "Error, mean removed", rest, scale, lines=noise),
    ]
    words = (
        f"{one.test}, {one.phase}: the channel in which the refitted model errs most, {WINDOW:g} s about its largest "
        "error. The test was not searched."
    )
    window = (first, first + width - 1)
    start = float(one.time[0])
    return time_figure("closing", "Held-out test", words, rows, start=start, step=dt, window=window, row_height=230)


def _loop_figure(loops: Sequence[EffectLoop]) -> Figure:
    rows = []
    for one in loops:
        up = _SCALES.get(one.unit, Scale(1.0, one.unit))
        across = _STATES.get(one.over_unit, Scale(1.0, one.over_unit))
        keep = np.arange(0, len(one.state), max(1, -(-len(one.state) // POINTS)))
        x = one.state[keep] * across.factor
        title, family = (f"{x[0].upper()}{x[1:]} [{up.unit}]" for x in (one.column, title_of(one.family)))
        sides = [("residual without the effect", one.before, BEFORE), ("with it", one.after, AFTER)]
        both = [Curve(name, x, y[keep] * up.factor, style, "markers") for name, y, style in sides]
        order = np.argsort(x)
        own = [Curve("its own", x, one.own[keep] * up.factor, OWN, "markers")]
        for name, factor in zip(("90 % interval, low", "90 % interval, high"), one.spread, strict=True):
            own.append(Curve(name, x[order], one.own[keep][order] * factor * up.factor, TARGET, "markers"))
        over = f"{one.over[0].upper()}{one.over[1:]} [{across.unit}]"
        rows.append((Plot(title, over, both), Plot(family, over, own[::-1])))
    words = (
        "Every effect on the test where it does most, in the column where it is largest, all other numbers as fitted: "
        "left the residual without it and with it, right the difference of both, which is the effect itself."
    )
    return grid_figure("loops", "What each effect does", words, rows, cell=CELL, gap=GAP)


def _share_table(found: Discovery) -> Table:
    """Share of the squared error that each effect explains in its own column and in every phase, and all of them."""
    rows = [(title_of(o.family), f"{o.column}, {o.test}", _percent(o.explained)) for o in found.loops]
    titles = {one.candidate.name: title_of(one.candidate.family.named) for one in found.search.added}
    if len({*titles.values()}) < len(titles):  # two of a family are told apart by their components
        each = {one.candidate.name: where(one.candidate.components) for one in found.search.added}
        titles = {name: f"{title} ({each[name]})" for name, title in titles.items()}
    every = next(iter(titles.values())) if len(titles) == 1 else "all effects"
    for gap in found.proof.gaps if found.proof else ():
        place = f"{gap.phase}, {gap.test}"
        if len(titles) > 1:
            rows += [(titles[name], place, _percent(own)) for name, own in gap.shares.items()]
        share = 1.0 - gap.after**2 / gap.refitted**2 if gap.refitted > 0.0 else 0.0
        rows.append((every, place, f"{_percent(share)} ({number(gap.refitted)} before)"))
    return Table(
        "Share of the squared error explained: by an effect against the model without it, by all against the refit",
        ("Effect", "Of", "Share"),
        rows,
    )


def _percent(share: float) -> str:
    return f"{round(100.0 * share, 1) + 0.0:.1f} %"  # no negative zero

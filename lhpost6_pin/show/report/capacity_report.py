"""The report of a machine's capacity: performance on four-way paper, governing limits, tables beside what is stated."""

from collections.abc import Sequence
from pathlib import Path

from .page import Headline, Page, Section, Table, number, save_page
from .performance_plots import Load, performance_blocks
from .scales import axis_scale

__all__ = ["write_capacity_report"]


def write_capacity_report(
    path: Path, title: str, loads: Sequence[Load], tables: Sequence[Table], remark: str, *, command: str | None = None
) -> Path:
    """Write the self-contained HTML report of a capacity; `tables` without that of the governing limits.

    remark: how the tables belong to what a motion is judged by.
    """
    last = loads[-1]
    sentences = []
    for load in loads:
        bounds = [(one.axis, one.bound("acceleration")) for one in load.axes]
        words = ", ".join(f"{axis} {_said(axis, bound.value)} ({bound.by})" for axis, bound in bounds)
        sentences.append(f"Peak acceleration, {load.name}: {words}.")
    page = Page(
        kind="Capacity",
        title=title,
        purpose="What the table gives in sinusoidal motion, axis by axis, and which limit governs.",
        verdict=" ".join(sentences),
        level="plain",
        headlines=[
            Headline(_said(one.axis, one.bound("acceleration").value), f"Peak acceleration {one.axis}, {last.name}")
            for one in last.axes[:3]
        ],
        sections=[
            Section("performance", "Performance curves", performance_blocks(loads)),
            Section("capacity", "Capacity beside what is stated", [remark, *tables]),
        ],
        command=command,
    )
    return save_page(page, path)


def _said(axis: str, value: float) -> str:
    scale = axis_scale(axis, "acceleration")
    return f"{number(value * scale.factor)} {scale.unit}"

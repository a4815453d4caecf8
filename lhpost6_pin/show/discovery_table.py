"""Discovery results as tables for a terminal."""

import math

from rich.markup import escape
from rich.table import Table

from ..core.console import make_console
from ..discovery import Discovery
from ..discovery.verdict_summary import summary

__all__ = ["print_discovery"]


def print_discovery(found: Discovery) -> None:
    """Print the verdict, the effects with their parameters, and the errors on held-out tests."""
    console = make_console()
    verdict = found.verdict
    console.print(f"[bold]{verdict.word}[/]: {escape(summary(found))}")
    if verdict.effects:
        table = Table(
            "effect", "on", "number", "value", "90 % interval", "unit", title="Effects found", title_justify="left"
        )
        for one in verdict.effects:
            for name, value in one.parameters.items():
                interval = f"{value.low:.4g} to {value.high:.4g}"
                where = " ".join(one.components)
                table.add_row(one.family, escape(where), escape(name), f"{value.value:.4g}", interval, value.unit)
        console.print(table)
    if verdict.changed:
        table = Table("parameter", "value", "90 % interval", "unit", title="Parameters changed", title_justify="left")
        for name, value in verdict.changed.items():
            table.add_row(escape(name), f"{value.value:.5g}", f"{value.low:.5g} to {value.high:.5g}", value.unit)
        console.print(table)
    for off in verdict.sensors:
        size = f"{off.estimate.value:.4g} {off.estimate.unit}, stated {off.stated:.3g}"
        console.print(f"sensor: {escape(off.name)} {size}")
    if found.proof:
        title = "Normalised RMS error on held-out tests (1: sensor noise)"
        table = Table("phase", "test", "delivered", "refitted", "after", "closure", title=title, title_justify="left")
        for gap in found.proof.gaps:
            share = "" if math.isnan(gap.closure) else f"{gap.closure:.2f}"
            numbers = f"{gap.delivered:.3g}", f"{gap.refitted:.3g}", f"{gap.after:.3g}"
            table.add_row(gap.phase, escape(gap.test), *numbers, share)
        console.print(table)

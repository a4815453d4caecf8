"""A live view of the table while a command moves it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ..machine.machine import Machine
    from ..simulation.snapshot import Watch

__all__ = ["Amplify", "Change", "Live", "NoOpen", "show_address", "watched"]

Amplify = Annotated[float, typer.Option(help="Factor that enlarges the motion.")]
Change = Annotated[
    bool, typer.Option("--force-change", help="Show force change from the static value (weight, preload).")
]
Live = Annotated[bool, typer.Option("--live", help="Show the table in a browser as it moves, in real time at most.")]
NoOpen = Annotated[bool, typer.Option("--no-open", help="Print the address of the page; do not open a browser.")]

PATIENCE = 20.0
"""Longest wait [s] for a viewer to connect before a run begins."""


@contextmanager
def watched(
    live: bool,
    table: "Machine",
    title: str,
    *,
    amplify: float,
    change: bool,
    open_it: bool,
    err: bool = False,
    apart: bool = False,
) -> "Iterator[Watch | None]":
    """Yield the function that shows a running plant in a browser, or None if not `live`.

    With `apart` the view runs in another process and delays nothing; else the run waits for a viewer to connect.
    """
    if not live:
        yield None
        return
    from ..show.viewer import LiveView, Look, view_apart

    look, what = Look(amplify=amplify, change=change), f"{title} on this computer only"
    if apart:
        with view_apart(table, title, look) as (url, show):
            show_address(url, what, open_it, err)
            yield show
        return
    with LiveView(table, title, look) as view:
        show_address(view.url, what, open_it, err)
        if not view.wait(PATIENCE):
            typer.echo(f"no viewer connected for {PATIENCE:g} s; continuing", err=True)
        yield view.show


def show_address(url: str, what: str, open_it: bool, err: bool = False) -> None:
    """Print the address of a view (on stderr if `err`), and open it in a browser if there is one."""
    import webbrowser

    typer.echo(f"{url} shows {what}", err=err)
    if open_it and not webbrowser.open(url):
        typer.echo("no browser could be opened here: open this address in one", err=True)

"""A live view of the table while a command moves it."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import ParameterError

if TYPE_CHECKING:
    from ..machine.machine import Machine
    from ..simulation.snapshot import Watch

__all__ = ["EndedBySignal", "LiveOptions", "NoOpen", "ViewOptions", "show_address", "watched"]

NoOpen = Annotated[bool, typer.Option("--no-open", help="Print the address of the page; do not open a browser.")]

PATIENCE = 20.0
"""Longest wait [s] for a viewer to connect before a run begins."""


@dataclass(frozen=True)
class ViewOptions:
    """Options of a view in a browser."""

    amplify: Annotated[float, typer.Option(help="Factor that enlarges the motion.")] = 1.0
    force_change: Annotated[
        bool, typer.Option("--force-change", help="Show force change from the static value (weight, preload).")
    ] = False
    no_open: NoOpen = False


@dataclass(frozen=True)
class LiveOptions(ViewOptions):
    """Options of a view of a running plant."""

    live: Annotated[
        bool, typer.Option("--live", help="Show the table in a browser as it moves, in real time at most.")
    ] = False


@contextmanager
def watched(
    options: LiveOptions,
    table: "Machine",
    title: str,
    *,
    err: bool = False,
    apart: bool = False,
    ended: "Callable[[], bool] | None" = None,
) -> "Iterator[Watch | None]":
    """Yield the function that shows a running plant in a browser, or None unless a live view was chosen.

    With `apart` the view runs in another process and delays nothing; else the run waits for a viewer to connect, and
    while it is paused there, unless `ended`.
    """
    if not options.live:
        if options.amplify != 1.0 or options.force_change:
            raise ParameterError("--amplify and --force-change are options of the view of a run; add --live")
        yield None
        return
    from ..show.viewer import LiveView, Look, view_apart

    look = Look(amplify=options.amplify, change=options.force_change)
    what, open_it = f"{title} on this computer only", not options.no_open
    if apart:
        with view_apart(table, title, look) as (url, show):
            show_address(url, what, open_it, err)
            yield show
        return
    with LiveView(table, title, look, ended=ended or (lambda: False)) as view:
        show_address(view.url, what, open_it, err)
        typer.echo(f"the run begins when a browser shows that page, or in {PATIENCE:g} s", err=True)
        if not view.wait(PATIENCE):
            typer.echo(f"no viewer connected for {PATIENCE:g} s; continuing", err=True)
        yield view.show


class EndedBySignal:
    """Whether Ctrl-C or SIGTERM has come while in use in a ``with`` block: the first only ends a run on view.

    A second one acts as ever; so does every one of a run that is not on view.
    """

    def __init__(self, live: bool) -> None:
        """Watch for signals if the run is on view."""
        self._numbers = (signal.SIGINT, signal.SIGTERM) if live else ()
        self._before: dict[int, Any] = {}
        self._came = False

    def __call__(self) -> bool:
        """Whether one has come."""
        return self._came

    def __enter__(self) -> "EndedBySignal":
        """Begin to watch."""
        self._before = {number: signal.signal(number, self._end) for number in self._numbers}
        return self

    def __exit__(self, *_: object) -> None:
        """Let signals act as before."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before = {}

    def _end(self, *_: object) -> None:
        self._came = True
        self.__exit__()


def show_address(url: str, what: str, open_it: bool, err: bool = False) -> None:
    """Print the address of a view (on stderr if `err`), and open it in a browser if there is one."""
    import webbrowser

    typer.echo(f"{url} shows {what}", err=err)
    if open_it and not webbrowser.open(url):
        typer.echo("no browser found on this computer; open this address in a browser", err=True)

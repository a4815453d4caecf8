"""The application: commands by job, the entry point, errors without a traceback, output and progress."""

import errno
import inspect
import logging
import os
import shlex
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import cache, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from .. import __version__
from ..core.errors import LhpostError, OutOfRangeError
from ..core.garbage import collect_less

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["JOBS", "app", "command", "command_name", "main", "print_result", "progress_bar", "repeating_command"]
__all__ += ["run_script", "stderr"]

JOBS: Mapping[str, tuple[str, ...]] = {
    "Rehearse": ("run", "open-loop", "campaign", "ensemble", "motions"),
    "Control": ("tune", "iterate", "replay", "sine", "panel"),
    "Measured data": ("import", "check", "export", "decompose", "validate", "calibrate"),
    "Discover": ("discover", "demo"),
    "Connect": ("serve", "link", "serve-specimen", "export-fmu"),
    "Look": ("view", "info", "capacity", "new-machine", "doctor"),
}
"""Commands by job, in the order of `--help`, of the command reference and of the README."""


class _Commands(TyperGroup):
    """The commands, grouped by job; `--help` shows no value type for flags, which take none."""

    def list_commands(self, ctx: Any) -> list[str]:
        return sorted(self.commands, key=[name for names in JOBS.values() for name in names].index)

    def get_params(self, ctx: Any) -> list[Any]:
        return _without_kind(super().get_params(ctx))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        command: Any = super().get_command(ctx, cmd_name)
        if command is not None:
            command.rich_help_panel = next((job for job, names in JOBS.items() if cmd_name in names), None)
            _without_kind(command.get_params(ctx))
        return command


def _without_kind(parameters: list[Any]) -> list[Any]:
    for parameter in parameters:
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
    return parameters


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"lhpost6 {__version__}")
        raise typer.Exit


app = typer.Typer(
    cls=_Commands,
    help="The UC San Diego LHPOST6 shake table, modelled from first principles on Pinocchio.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


def command(name: str | None = None) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Register a function as a command; a parameter that is a dataclass becomes one option per field."""

    def register(function: Callable[..., None]) -> Callable[..., None]:
        parameters: list[inspect.Parameter] = []
        bundles: dict[str, Any] = {}
        for parameter in inspect.signature(function).parameters.values():
            options = [parameter]
            if is_dataclass(parameter.annotation):
                bundles[parameter.name] = parameter.annotation
                options = list(inspect.signature(bundles[parameter.name]).parameters.values())
            parameters += [option.replace(kind=inspect.Parameter.KEYWORD_ONLY) for option in options]

        @wraps(function)
        def run(**given: Any) -> None:
            for name, bundle in bundles.items():
                given[name] = bundle(**{field.name: given.pop(field.name) for field in fields(bundle)})
            function(**given)

        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        app.command(name)(run)
        return run

    return register


def command_name(command: typer.models.CommandInfo) -> str:
    """Name of a registered command on the command line."""
    return command.name or str(getattr(command.callback, "__name__", ""))


def main() -> None:
    """Entry point; errors that the user can correct are printed without a traceback."""
    from rich.logging import RichHandler

    collect_less()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: more threads double processor time, not speed
    handler = RichHandler(console=stderr(), show_path=False, show_time=False)
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[handler])
    with _noting_ctrl_c():
        try:
            with _without_traceback(2):
                app(prog_name="lhpost6")
        except (SystemExit, Exception) as end:
            if not (end.code == _INTERRUPTED if isinstance(end, SystemExit) else _PRESSED):
                raise
            again = "; the same command goes on from there" if sys.argv[1:2] in (["ensemble"], ["discover"]) else ""
            stderr().print(f"interrupted; no incomplete file is left{again}")
            sys.exit(_INTERRUPTED)


def run_script(function: Callable[..., Any]) -> None:
    """Run a script's function as a command; an error that the user can correct is one line and exit code 1."""
    with _without_traceback(1):
        typer.run(function)


@contextmanager
def _without_traceback(code: int) -> Iterator[None]:
    """Print errors that the user can correct, and exit with a code."""
    try:
        yield
    except LhpostError as error:
        known = {"largest_scale": error.largest_scale} if isinstance(error, OutOfRangeError) else {}
        _fail(code, type(error).__name__, str(error), **known)
    except OSError as error:  # disk full, no permission, a file where a folder should be
        path = error.filename2 or error.filename  # the second is what a finished file was to be renamed to
        reason = f"{os.strerror(error.errno)}{_REMEDIES.get(error.errno, '')}" if error.errno else str(error)
        _fail(code, "OSError", f"cannot read or write {path or 'a file'}: {reason}")


@contextmanager
def _noting_ctrl_c() -> Iterator[None]:
    """Record that Ctrl-C was pressed: callbacks of the compiler discard the exception and print a warning."""
    _PRESSED.clear()

    def note(number: int, frame: Any) -> None:
        _PRESSED.append(number)
        signal.default_int_handler(number, frame)

    def swallowed(lost: Any) -> None:
        if lost.exc_type is not KeyboardInterrupt:
            hook(lost)

    handler, hook = signal.signal(signal.SIGINT, note), sys.unraisablehook
    sys.unraisablehook = swallowed
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        sys.unraisablehook = hook


_REMEDIES = dict.fromkeys(
    (errno.ENOSPC, errno.EDQUOT, errno.EFBIG), "; make room, or choose another folder with --out"
) | {errno.EROFS: "; choose another folder with --out"}
"""Remedies by error number."""

_PRESSED: list[int] = []
"""Signals received from Ctrl-C since the command began."""

_INTERRUPTED = 130
"""Exit code of typer after Ctrl-C."""


def _fail(code: int, kind: str, message: str, **known: Any) -> None:
    """Print an error, also as JSON with --json, and exit."""
    from ..core.jsonable import as_json

    stderr().print("[bold red]error:[/] ", end="")
    stderr().print(message, markup=False, highlight=False)
    if "--json" in sys.argv[1:]:
        typer.echo(as_json({"error": {"kind": kind, "message": message, **known}}))
    sys.exit(code)


@cache
def stderr() -> "Console":
    """One console for errors, warnings and progress, so that they do not overwrite each other."""
    from rich.console import Console

    return Console(stderr=True, soft_wrap=True)


def print_result(
    json: bool, entries: Callable[[], Mapping[str, Any]], show: Callable[[], None], files: Sequence[Path] | None = None
) -> None:
    """Print a result and the files written, if the command writes any: its entries as JSON alone, or by `show`."""
    from ..core.jsonable import as_json

    if json:
        typer.echo(as_json({**entries(), "files": files} if files is not None else entries()))
        return
    show()
    for path in files or ():
        typer.echo(f"wrote {path}")


def repeating_command() -> str:
    """Command line that repeats this run."""
    return shlex.join(["lhpost6", *sys.argv[1:]])


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[float], None]]:
    """A progress bar with remaining time on stderr; yields a function of the completed fraction."""
    from rich import progress as rich

    columns = (rich.BarColumn(), rich.TaskProgressColumn(), rich.TimeElapsedColumn(), rich.TimeRemainingColumn())
    with rich.Progress(rich.TextColumn("{task.description}", markup=False), *columns, console=stderr()) as bar:
        task = bar.add_task(title, total=1.0)

        def advance(share: float) -> None:
            if _PRESSED:  # and the exception was discarded
                raise KeyboardInterrupt
            bar.update(task, completed=share)

        try:
            yield advance
        except LhpostError:
            bar.live.transient = not bar.tasks[task].completed  # no bar above an error before the start
            raise

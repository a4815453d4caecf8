"""The command reference: all commands by job, with arguments, options, help and defaults."""

import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_type_hints

from rich.text import Text
from typer.models import ArgumentInfo, OptionInfo

from lhpost6_pin import cli
from lhpost6_pin.cli.app import JOBS, command_name

from .markdown import cell, code_cell, table

__all__ = ["commands"]

KINDS = {str: "text", int: "whole number", float: "number", Path: "path", bool: ""}


class Given(NamedTuple):
    """One argument or option of a command."""

    names: tuple[str, ...]
    what: str
    default: str
    text: str
    required: bool
    many: bool
    is_option: bool


def commands() -> str:
    """Markdown of all commands, a section per job, after the exit codes."""
    functions = {command_name(c): c.callback for c in cli.app.registered_commands if c.callback}
    parts = [_exit_codes()]
    for job, names in JOBS.items():
        parts += [f"## {job}", *(_section(name, functions[name]) for name in names)]
    return "\n\n".join(parts)


def _exit_codes() -> str:
    """The sentence on exit codes in the docstring of the package, as a table."""
    text = inspect.getdoc(cli) or ""
    _, _, codes = text.partition("Exit codes: ")
    if not codes:
        raise ValueError("no exit codes in the docstring of lhpost6_pin.cli")
    rows = [entry.strip().rstrip(".").partition(" ") for entry in " ".join(codes.split()).split(",")]
    return "## Exit codes\n\n" + table(("code", "meaning"), [(f"`{code}`", cell(what)) for code, _, what in rows])


def _section(name: str, function: Callable[..., Any]) -> str:
    given = list(_given(function))
    parts = [f"### lhpost6 {name}", _plain(inspect.getdoc(function) or ""), f"```text\n{_usage(name, given)}\n```"]
    for title, rows in (
        ("argument", [g for g in given if not g.is_option]),
        ("option", [g for g in given if g.is_option]),
    ):
        if rows:
            cells = [(code_cell(", ".join(g.names)), cell(g.what), code_cell(g.default), cell(g.text)) for g in rows]
            parts.append(table((title, "value", "default", "meaning"), cells))
    return "\n\n".join(parts)


def _usage(name: str, given: list[Given]) -> str:
    words = []
    for entry in given:
        if not entry.is_option:
            word = entry.names[0] + ("..." if entry.many else "")
            words.append(word if entry.required else f"[{word}]")
    needed = [f"{g.names[0]} {g.what.upper().replace(' ', '_')}" for g in given if g.is_option and g.required]
    return " ".join(["lhpost6", name, *words, *needed, "[OPTIONS]"])


def _given(function: Callable[..., Any]) -> Iterator[Given]:
    hints = get_type_hints(function, include_extras=True)
    for key, parameter in inspect.signature(function).parameters.items():
        kind, *notes = get_args(hints[key])
        info = next(note for note in notes if isinstance(note, OptionInfo | ArgumentInfo))
        is_option = isinstance(info, OptionInfo)
        inner, many = _inner(kind)
        none = parameter.default is inspect.Parameter.empty
        yield Given(
            _names(key, info, inner) if is_option else (key.strip("_").upper(),),
            _range(KINDS[inner], info) + (", repeatable" if many and is_option else ""),
            "" if none or parameter.default is None else _default(parameter.default),
            _plain(info.help or ""),
            none,
            many,
            is_option,
        )


def _inner(kind: Any) -> tuple[type, bool]:
    """Type of one value, and whether the option is repeatable: Path and True for list[Path] | None."""
    some = next((k for k in get_args(kind) if k is not type(None)), kind) if type(None) in get_args(kind) else kind
    many = getattr(some, "__origin__", None) is list
    return (get_args(some)[0] if many else some), many


def _names(key: str, info: OptionInfo, kind: type) -> tuple[str, ...]:
    # within Annotated, typer keeps the first name as the default
    given = [name for name in (info.default, *(info.param_decls or ())) if isinstance(name, str)]
    if given:
        return tuple(given)
    name = f"--{key.strip('_').replace('_', '-')}"
    return (name, f"--no-{name[2:]}") if kind is bool else (name,)


def _range(what: str, info: OptionInfo | ArgumentInfo) -> str:
    bounds = [f"{word} {value:g}" for word, value in (("from", info.min), ("to", info.max)) if value is not None]
    return " ".join([what, *bounds])


def _default(value: object) -> str:
    return ("on" if value else "off") if isinstance(value, bool) else str(value)


def _plain(text: str) -> str:
    """Help without the escapes of its markup."""
    return Text.from_markup(text).plain

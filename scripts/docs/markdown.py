"""Small pieces of Markdown."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from lhpost6_pin.core.files import write_whole

__all__ = ["cell", "code_cell", "number", "print_and_keep", "table"]


def cell(text: str) -> str:
    """Text for a cell of a table, on one line, bars, markup and tags made harmless; between backticks is code."""
    parts = " ".join(text.split()).split("`")
    if len(parts) % 2 == 0:
        return _harmless("`".join(parts))
    return "".join(code_cell(part) if k % 2 else _harmless(part) for k, part in enumerate(parts))


def _harmless(text: str) -> str:
    text = text.replace("\\", "\\\\")
    for sign in "|*_<[":
        text = text.replace(sign, {"<": "&lt;"}.get(sign, f"\\{sign}"))
    return text


def code_cell(text: str) -> str:
    """The same as code; bars would end the cell, also within code."""
    if not text:
        return ""
    harmless = text.replace("&", "&amp;").replace("<", "&lt;").replace("|", "&#124;")
    return f"<code>{harmless}</code>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])


def number(value: float | Sequence[float]) -> str:
    """A number, or several, as the tables of the package print them."""
    return ", ".join(f"{v:.6g}" for v in value) if isinstance(value, Sequence) else f"{value:.6g}"


def print_and_keep(rows: Iterable[str], path: Path | None) -> None:
    """Print lines of Markdown, and write them to a file if there is one to write."""
    text = "\n".join(rows)
    print(text)
    if path is not None:
        with write_whole(path) as beside:
            beside.write_text(text, encoding="utf-8")

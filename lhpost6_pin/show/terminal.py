"""Tables and sentences in a terminal."""

import re

from rich.console import Console, JustifyMethod
from rich.markup import escape
from rich.measure import Measurement
from rich.table import Table as RichTable
from rich.text import Text

from ..core.console import make_console
from .report.page import Figure, Markup, Table, plain_text

__all__ = ["print_blocks"]

_PADDING, _LEAST = 3, 12
"""Characters about a column, and the least of one that wraps."""
_WIDEST = 10_000
"""Characters of a line that no table has."""

_NUMBER = re.compile(r"^$|[<~!▲+±−–-]|\d")


def print_blocks(*blocks: str | Text | Table | Figure) -> None:
    """Print blocks of a report: tables, and other text a line each; empty text and figures are omitted."""
    console = make_console()
    for block in blocks:
        if isinstance(block, Table):
            width = console.width if console.is_terminal else max(console.width, _natural_width(block))
            (console if width == console.width else Console(width=width)).print(_rich(block, width))
        elif isinstance(block, str | Text) and block:
            words = plain_text(block) if isinstance(block, Markup) else block
            console.print(words, markup=False, highlight=False, soft_wrap=True)


def _natural_width(table: Table) -> int:
    """Characters of a table without wrapped cells: in a file or a pipe none is cut off."""
    options = make_console().options.update(width=_WIDEST)
    return Measurement.get(Console(width=_WIDEST), options, _rich(table, _WIDEST)).maximum


def _rich(table: Table, width: int) -> RichTable:
    """The table with columns of numbers flush right; on a narrow terminal all columns wrap, so that none is lost."""
    made = RichTable(title=escape(table.caption) or None, title_justify="left")
    cells = [[cell if isinstance(cell, Text) else escape(plain_text(cell)) for cell in row] for row in table.rows]
    columns = []
    for n in range(len(table.header)):
        texts = [str(row[n]) for row in cells]
        right = n > 0 and all(map(_NUMBER.match, texts))
        whole = n == 0 or right or any(isinstance(row[n], Text) for row in cells)
        longest = max(map(len, texts), default=0)
        columns.append((right, whole, longest if whole else min(longest, _LEAST)))
    # headings wrap, numbers, styled words and the first column do not, unless nothing is left for the others
    fits = sum(_PADDING + size for _, _, size in columns) < width
    for n, (heading, (right, whole, longest)) in enumerate(zip(table.header, columns, strict=True)):
        size = longest if n and whole and fits else None
        justify: JustifyMethod = "right" if right else "left"
        made.add_column(
            escape(heading),
            justify=justify,
            no_wrap=n == 0 and (fits or longest <= width // 3),
            min_width=size,
            overflow="fold",
        )
    for row in cells:
        made.add_row(*row)
    return made

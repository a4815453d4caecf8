"""Tables and sentences in a terminal."""

import re

from rich.markup import escape
from rich.table import Table as RichTable
from rich.text import Text

from ..core.console import make_console
from .report.page import Figure, Markup, Table, plain_text

__all__ = ["print_blocks"]

_NUMBER = re.compile(r"^$|[<~!▲+±−–-]|\d")


def print_blocks(*blocks: str | Text | Table | Figure) -> None:
    """Print blocks of a report: tables, and other text a line each; empty text and figures are omitted."""
    console = make_console()
    for block in blocks:
        if isinstance(block, Table):
            console.print(_rich(block))
        elif isinstance(block, str | Text) and block:
            words = plain_text(block) if isinstance(block, Markup) else block
            console.print(words, markup=False, highlight=False, soft_wrap=True)


def _rich(table: Table) -> RichTable:
    """The table with columns of numbers flush right."""
    made = RichTable(title=escape(table.caption) or None, title_justify="left")
    cells = [[cell if isinstance(cell, Text) else escape(plain_text(cell)) for cell in row] for row in table.rows]
    for n, heading in enumerate(table.header):
        texts = [str(row[n]) for row in cells]
        right = n > 0 and all(map(_NUMBER.match, texts))
        whole = right or any(isinstance(row[n], Text) for row in cells)
        width = max(map(len, texts), default=0) if whole else None  # headings wrap, numbers and styled words do not
        made.add_column(escape(heading), justify="right" if right else "left", no_wrap=n == 0, min_width=width)
    for row in cells:
        made.add_row(*row)
    return made

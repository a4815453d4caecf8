"""Docstrings as Markdown: what is set as an equation in the source is set as one on the page.

An extension of griffe, which mkdocstrings reads the package with. Docstrings are plain text: a paragraph whose lines
are equations, or are laid out in columns, becomes a block of code; the rest stays prose.
"""

import inspect
import re

import griffe

__all__ = ["Equations", "as_markdown"]

_COLUMNS = re.compile(r"\S   +\S")
_EQUATION = re.compile(r"^[^.:;]{1,40}? (=|->) ")
_WORDS = re.compile(r"\b[a-z]{4,}\b")


def as_markdown(text: str) -> str:
    """Markdown of a docstring."""
    paragraphs = re.split(r"\n\s*\n", inspect.cleandoc(text))
    return "\n\n".join(_block(p) if _set_apart(p) else p for p in paragraphs)


def _set_apart(paragraph: str) -> bool:
    lines = paragraph.splitlines()
    return all(bool(_COLUMNS.search(line)) or _is_equation(line) for line in lines)


def _is_equation(line: str) -> bool:
    found = _EQUATION.match(line)
    return found is not None and not line.startswith(" ") and not _WORDS.search(found.group(0))


def _block(paragraph: str) -> str:
    return f"```text\n{inspect.cleandoc(paragraph)}\n```"


class Equations(griffe.Extension):
    """Rewrites every docstring of a package once it is loaded."""

    def on_package(self, *, pkg: griffe.Module, **kwargs: object) -> None:
        """Walk the whole package."""
        self._rewrite(pkg)

    def _rewrite(self, thing: griffe.Object) -> None:
        if thing.docstring is not None:
            thing.docstring.value = as_markdown(thing.docstring.value)
        for member in thing.members.values():
            if not member.is_alias:
                self._rewrite(member)

"""Results that show themselves in a notebook and where they are printed.

What draws them (`show.notebook`) stands above all results and is loaded by name, where a result is first shown.
"""

from importlib import import_module
from typing import Any

__all__ = ["Shown", "hint_of", "plot_of", "summary_of", "text_of"]

_NOTEBOOK = "lhpost6_pin.show.notebook"


def plot_of(result: Any) -> Any:
    """Report of a result (`show.notebook.show_report`): shown in a notebook, and saved to a file by `save`."""
    return import_module(_NOTEBOOK).show_report(result)


def summary_of(result: Any) -> str:
    """HTML of the head of a result's report: its verdict and key figures."""
    return str(import_module(_NOTEBOOK).show_summary(result)._repr_html_())


def text_of(result: Any) -> str:
    """Text of the head of a result's report, a few lines: kind and title, verdict, key figures."""
    return str(import_module(_NOTEBOOK).show_text(result))


def hint_of(result: Any) -> str:
    """One line in place of the arrays of a result, at no cost: its kind, and what shows more."""
    return f"<{type(result).__name__}: print() gives its verdict, plot() its report>"


class Shown:
    """A result with a report; dataclasses among the subclasses have ``repr=False``, else theirs prints all arrays."""

    def plot(self) -> Any:
        """Return the report, as `plot_of`."""
        return plot_of(self)

    def _repr_html_(self) -> str:
        return summary_of(self)

    def __str__(self) -> str:
        """Return the head of the report as text, as `text_of`."""
        return text_of(self)

    def __repr__(self) -> str:
        """Return one line, as `hint_of`."""
        return hint_of(self)

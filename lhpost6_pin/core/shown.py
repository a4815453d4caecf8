"""Results that show themselves in a notebook.

What draws them (`show.notebook`) stands above all results and is loaded by name, where a result is first shown.
"""

from importlib import import_module
from typing import Any

__all__ = ["Shown", "plot_of", "summary_of"]

_NOTEBOOK = "lhpost6_pin.show.notebook"


def plot_of(result: Any) -> Any:
    """Report of a result (`show.notebook.show_report`): shown in a notebook, and saved to a file by `save`."""
    return import_module(_NOTEBOOK).show_report(result)


def summary_of(result: Any) -> str:
    """HTML of the head of a result's report: its verdict and key figures."""
    return str(import_module(_NOTEBOOK).show_summary(result)._repr_html_())


class Shown:
    """A result with a report."""

    def plot(self) -> Any:
        """Return the report, as `plot_of`."""
        return plot_of(self)

    def _repr_html_(self) -> str:
        return summary_of(self)

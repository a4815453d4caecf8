"""Self-contained HTML reports: one page design for every command that reports something.

`page` knows how a report looks and `plots` turns channels into light interactive figures; the `run_*` modules
say what one test is judged by. A report of another kind is another set of sections on the same `Page`.
"""

from .run_report import write_run_report

__all__ = ["write_run_report"]

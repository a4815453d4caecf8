"""Self-contained HTML reports: one page design for every command that reports something.

`page` knows how a report looks, `plots` turns channels into light interactive figures, `run_metrics` and
`run_report` say what a simulated or measured test is judged by.
"""

from lhpost6_pin.report.run_report import write_run_report

__all__ = ["write_run_report"]

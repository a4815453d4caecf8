"""Self-contained HTML reports: one page design for every command that reports something.

`page` knows how a report looks; `plots` turns channels into light interactive figures and `charts` draws over
frequencies, iterations and harmonics. The `run_*` modules say what one test is judged by, `tune_*`, `iterate_*` and
`sine_*` what the tools of the controller found, `decompose_*` what forces are behind a test,
`calibrate_*` what a campaign says of a machine's numbers. A report of another kind is another set of sections on the
same `Page`.
"""

from .calibrate_report import write_calibrate_report
from .decompose_report import write_decompose_report
from .iterate_report import write_iterate_report
from .run_report import write_run_report
from .sine_report import write_sine_report
from .tune_report import write_tune_report

__all__ = [
    "write_calibrate_report",
    "write_decompose_report",
    "write_iterate_report",
    "write_run_report",
    "write_sine_report",
    "write_tune_report",
]

"""Self-contained HTML reports: one page design for every command that reports something.

`page` renders a page from blocks: text, tables and figures as data. `plots` draws channels over time and `charts` over
frequencies, iterations and harmonics, in the units of `scales`. The other modules make the sections of one report each:
a run, the tools of the controller (`tune_*`, `iterate_*`, `sine_*`), a force decomposition, a validation, a calibration
and a discovery.
"""

from .calibrate_report import write_calibrate_report
from .capacity_report import write_capacity_report
from .decompose_report import write_decompose_report
from .iterate_report import write_iterate_report
from .run_report import write_run_report
from .sine_report import write_sine_report
from .tune_report import write_tune_report

__all__ = [
    "write_calibrate_report",
    "write_capacity_report",
    "write_decompose_report",
    "write_iterate_report",
    "write_run_report",
    "write_sine_report",
    "write_tune_report",
]

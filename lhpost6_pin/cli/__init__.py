"""The command line `lhpost6`, a module for each job.

Exit codes: 0 done, 1 a run stopped on the way or a check found errors, 2 the input cannot be used or a file cannot be
read or written, 130 interrupted.
"""

from . import connect, control, discover, ensemble, import_data, look, measured_data, new_machine, panel, rehearse
from .app import app, main, run_script

__all__ = ["app", "connect", "control", "discover", "ensemble", "import_data", "look", "main", "measured_data", "panel"]
__all__ += ["new_machine", "rehearse", "run_script"]

"""The command line `lhpost6`.

Exit codes: 0 done, 1 a run stopped on the way or a check found errors, 2 the input cannot be used or a file cannot be
read or written, 130 interrupted.
"""

from . import calibration, campaigns, connect, controllers, data, demo, discovery, forces, look, runs, validation, view
from .app import app, main, run_script

__all__ = [
    "app",
    "calibration",
    "campaigns",
    "connect",
    "controllers",
    "data",
    "demo",
    "discovery",
    "forces",
    "look",
    "main",
    "run_script",
    "runs",
    "validation",
    "view",
]

"""Compile the step of the default engine in a second process, while the first one prepares a run.

Compiling takes most of the first run after an installation, and holds its process. What a run needs from its first
step on is compiled beside what its limits and its linear model need; both leave their code in the same cache.
"""

import os
import subprocess
import sys
from contextlib import suppress

from ..control.loop import CONTROL_TYPES, control_packed
from ..core.compiled import cache_folder
from ..core.garbage import collect_less
from .engine_fused import LOG_TYPES, log_packed
from .engine_pinocchio import STAGGERED_TYPES, staggered_packed

__all__ = ["SIGNATURES", "compile_ahead", "compile_step", "wait_for"]

LONGEST = 300.0
"""Time that the step is waited for [s]: several times what it takes on a slow machine."""


SIGNATURES = {log_packed: LOG_TYPES, control_packed: CONTROL_TYPES, staggered_packed: STAGGERED_TYPES}
"""What a step calls from Python, with the types of its arguments, in the order in which it is compiled: kinematics and
forces of the stage late, because the first process needs them for the equilibrium and compiles them meanwhile."""


def compile_ahead() -> "subprocess.Popen[bytes] | None":
    """Start to compile the step beside this process; None if that is done, or there is no second core or no cache.

    Wait for its end (`wait_for`) before the first step. It goes on if this process ends: the next run finds the code.
    """
    folder = cache_folder()
    if folder is None or (os.cpu_count() or 1) < 2 or any(folder.rglob(f"*.{staggered_packed.__name__}-*.nbi")):
        return None
    code = f"from {__name__} import compile_step; compile_step()"
    return subprocess.Popen([sys.executable, "-P", "-c", code], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def wait_for(compiling: "subprocess.Popen[bytes] | None") -> None:
    """Wait for the second process; after `LONGEST` this one compiles itself what it lacks."""
    if compiling is not None:
        with suppress(subprocess.TimeoutExpired):
            compiling.wait(LONGEST)


def compile_step() -> None:
    """Compile the step into the cache."""
    collect_less()
    for function, signature in SIGNATURES.items():
        function.compile(signature)  # type: ignore[attr-defined]

"""Compile the step of an engine in a second process, while the first one prepares a run; or load it in a thread.

Compiling takes most of the first run after an installation, and holds its process. What a run needs from its first
step on is compiled beside what its limits and its linear model need; both leave their code in the same cache. Later
runs load that code, for the most part without the interpreter.
"""

import os
import subprocess
import sys
from contextlib import suppress
from typing import Any

from ..control.loop import CONTROL_TYPES, control_packed
from ..core.beside import beside
from ..core.compiled import cache_folder
from ..core.garbage import collect_less
from .engine_fused import LOG_TYPES, RUN_TYPES, log_packed, staggered_run
from .engine_pinocchio import STAGGERED_TYPES, staggered_packed

__all__ = ["SIGNATURES", "compile_ahead", "compile_step", "load_ahead", "wait_for"]

LONGEST = 300.0
"""Time that the step is waited for [s]: several times what it takes on a slow machine."""


SIGNATURES: dict[str, dict[Any, tuple[Any, ...]]] = {
    "pinocchio": {log_packed: LOG_TYPES, control_packed: CONTROL_TYPES, staggered_packed: STAGGERED_TYPES},
    "fused": {staggered_run: RUN_TYPES},
}
"""What a closed loop calls from Python, by engine, with the types of its arguments, in the order in which it is
compiled: kinematics and forces of the stage late, because the first process needs them for the equilibrium and compiles
them meanwhile."""


def _is_cached(engine: str) -> bool:
    folder, last = cache_folder(), [*SIGNATURES[engine]][-1].__name__
    return folder is not None and any(folder.rglob(f"*.{last}-*.nbi"))


def compile_ahead(engine: str) -> "subprocess.Popen[bytes] | None":
    """Start to compile the step beside this process; None if that is done, or there is no second core or no cache.

    Wait for its end (`wait_for`) before the first step. It goes on if this process ends: the next run finds the code.
    """
    if cache_folder() is None or (os.cpu_count() or 1) < 2 or _is_cached(engine):
        return None
    quick = f"from {collect_less.__module__} import collect_less; collect_less()"
    code = f"{quick}; from {__name__} import compile_step; compile_step({engine!r})"
    return subprocess.Popen([sys.executable, "-P", "-c", code], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def wait_for(compiling: "subprocess.Popen[bytes] | None") -> None:
    """Wait for the second process; after `LONGEST` this one compiles itself what it lacks."""
    if compiling is not None:
        with suppress(subprocess.TimeoutExpired):
            compiling.wait(LONGEST)


def load_ahead(engine: str) -> None:
    """Start to load the step in a thread, if it has been compiled; other compiled code is loaded after it."""
    if _is_cached(engine):
        beside(compile_step, engine)


def compile_step(engine: str) -> None:
    """Compile the step into the cache, or load it from there."""
    for function, signature in SIGNATURES[engine].items():
        function.compile(signature)

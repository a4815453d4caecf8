"""Compile the step of the default engine in a second process, while the first one prepares a run.

Compiling takes most of the first run after an installation, and holds its process. What a run needs from its first
step on is compiled beside what its limits and its linear model need; both leave their code in the same cache.
"""

import os
import subprocess
import sys

from numba import types
from numba.core.types import Type

from ..control.loop import control_packed
from ..core.compiled import cache_folder
from .engine_fused import log_packed
from .engine_pinocchio import staggered_packed

__all__ = ["SIGNATURES", "compile_ahead", "compile_step"]


def _arrays(*dimensions: int) -> tuple[Type, ...]:
    return tuple(types.Array(types.float64, n, "C") for n in dimensions)


SIGNATURES = {
    staggered_packed: (*_arrays(1), types.float64, *_arrays(1, 1, 1)),
    control_packed: (types.int64, *_arrays(2, 1, 1, 1, 2, 2, 2)),
    log_packed: (types.int64, *_arrays(1, 2, 2, 2, 2, 2, 2)),
}
"""What a step calls from Python, in the order in which it is compiled, with the types of its arguments."""


def compile_ahead() -> "subprocess.Popen[bytes] | None":
    """Start to compile the step beside this process; None if that is done, or there is no second core or no cache.

    Wait for its end before the first step. It goes on if this process ends: the next run finds the code.
    """
    folder = cache_folder()
    if folder is None or (os.cpu_count() or 1) < 2 or any(folder.rglob(f"*.{log_packed.__name__}-*.nbi")):
        return None
    code = f"from {__name__} import compile_step; compile_step()"
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def compile_step() -> None:
    """Compile the step into the cache."""
    for function, signature in SIGNATURES.items():
        function.compile(signature)  # type: ignore[attr-defined]

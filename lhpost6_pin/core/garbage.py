"""Fewer searches for cyclic garbage in processes that run one command."""

import atexit
import gc

__all__ = ["collect_less"]

_OBJECTS = 10_000
"""New containers after which the interpreter looks for cyclic garbage; its own number is 700 to 2,000."""


def collect_less() -> None:
    """Search for cyclic garbage less often, and not when the process ends, whose memory is returned as a whole.

    Libraries make some 250,000 objects that live as long as the process. By its own thresholds the interpreter
    searches all of them several times while it loads them, and once more before it exits.
    """
    gc.set_threshold(_OBJECTS, *gc.get_threshold()[1:])
    atexit.register(gc.freeze)

"""Many runs at once: the fused engine on several machines or drives, over threads.

Compiled code releases the interpreter, so threads share one process. Each run works on its own arrays: results do not
depend on the number of threads, not in a single bit.
"""

from collections.abc import Sequence
from typing import Any

from joblib import Parallel, delayed

from ..mechanics.plant import Plant
from .simulate import Drive, Run, simulate

__all__ = ["simulate_many"]


def simulate_many(jobs: Sequence[tuple[Plant, Drive]], *, samples: int, threads: int = -1, **options: Any) -> list[Run]:
    """Run each (plant, drive) with the fused engine; options go to `simulate`. Results keep the order of jobs.

    threads = -1 uses all cores. Raises SimulationError as `simulate` does.
    """
    run = delayed(simulate)
    options = {"engine": "fused", **options}
    return list(
        Parallel(n_jobs=threads, prefer="threads")(
            run(plant, drive, samples=samples, **options) for plant, drive in jobs
        )
    )

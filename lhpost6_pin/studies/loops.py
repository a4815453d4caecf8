"""The control loop of each specimen and controller of an ensemble, on the machine as stated."""

import numpy as np
from threadpoolctl import threadpool_limits

from ..control import controlled
from ..core.arrays import Array
from ..core.errors import LhpostError
from ..tuning.stability import check_loop
from .plan import EnsemblePlan

__all__ = ["LOOP_DIMENSIONS", "loops_of"]

LOOP_DIMENSIONS = ("specimen", "controller")
"""Dimensions of an ensemble on which the control loop depends, beside its machines."""


def loops_of(plan: EnsemblePlan) -> dict[str, Array]:
    """Texts (specimens, controllers): `loop` stable, thin or unstable, and `loop_summary`; empty if it has no rest."""
    shape = len(plan.specimens), len(plan.controllers)
    verdict, summary = np.full(shape, "", object), np.full(shape, "", object)
    with threadpool_limits(1):  # with another number of threads sums of linear algebra round otherwise
        for i, machine in enumerate(plan.specimens.values()):
            for k, settings in enumerate(plan.controllers.values()):
                try:
                    found = check_loop(controlled(machine, settings)[2])
                except LhpostError:  # of its runs, too, which are rows with this reason
                    continue
                verdict[i, k], summary[i, k] = found.verdict, found.summary
    return {"loop": verdict, "loop_summary": summary}

"""Free parameters of a machine for a campaign: bounded by its travel, without those that its channels do not show."""

from collections.abc import Sequence

import numpy as np

from ...machine.machine import Machine
from ...mechanics.plant import Plant
from ...mechanics.pose import leg_displacements
from ..prepare import MeasuredTest
from .free_parameters import FreeParameter, machine_parameters

__all__ = ["parameters_of_tests"]


def parameters_of_tests(machine: Machine, plant: Plant, tests: Sequence[MeasuredTest]) -> tuple[FreeParameter, ...]:
    """Parameters of a machine for these tests, without those of a load cell where pressures are measured."""
    parameters, test = machine_parameters(machine, _travel(plant, tests)), tests[0]
    measured = {"chamber_pressure_a", "pressure_difference"} & test.channels.keys()
    return tuple(p for p in parameters if not (measured and p.name.endswith(".load_cell_share")))


def _travel(plant: Plant, tests: Sequence[MeasuredTest]) -> dict[str, float]:
    """Largest travel of the actuators and struts of each kind in either direction, with a margin [m]."""
    most = np.max([np.abs(leg_displacements(plant, t.motion.displacement)[0]).max(axis=0) for t in tests], axis=0)
    kinds = np.array([c.kind for c in plant.machine.components])
    return {str(kind): 1.05 * float(most[kinds == kind].max()) for kind in kinds}

"""Residual forces of a held-out test as records to view: the platen's motion, and at each actuator what is unexplained.

The residual wrench is shared out to the actuators with the least sum of squares. Arrows of all records of one test have
one scale, that of the refitted model, so that they shrink as the error does.
"""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from ..data.records import FULL_SCALE, make_record
from ..identification.calibration.problem import Problem
from ..mechanics.pose import kinematic_jacobian
from .balances import HeldOut

__all__ = ["residual_records"]


def residual_records(held: Problem, models: Mapping[str, HeldOut]) -> dict[str, xr.Dataset]:
    """Records of the first held-out test by model; the first sets the scale. None where no force is measured."""
    if not held.rows("wrench").any():
        return {}
    forces = {}
    for name, one in models.items():
        shares = np.linalg.pinv(kinematic_jacobian(one.base.plant)[:, held.axes])
        forces[name] = one.base.residuals[0].wrench[:, held.axes] @ shares
    scale = max(float(np.abs(next(iter(forces.values()))).max()), 1.0)
    test, found = held.tests[0], {}
    for name, force in forces.items():
        attrs = {"test": test.name, "title": f"residual forces, {name}", "machine": held.machine.name}
        channels = {"platen_displacement": test.motion.displacement, "actuator_force": force}
        time = test.dt * np.arange(test.samples)
        found[name] = make_record(time, channels, held.machine.labels, attrs | {FULL_SCALE: scale})
    return found

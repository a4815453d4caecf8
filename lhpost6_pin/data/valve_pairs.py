"""Two servovalves in parallel on one actuator, recorded apart: the one spool that has their flow together.

The model's actuator has `valves` equal servovalves that open alike. Valves A and B with spools x_A and x_B give, at the
same pressures, the flow of both with the spool x of the mean opening: 2 g(x) = g(x_A) + g(x_B), g of Eq. 4-2.
"""

from typing import TYPE_CHECKING

import numpy as np

from ..core.errors import RecordError
from ..laws.orifice import opening, spool_for_opening
from ..machine.machine import Machine

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["with_joint_spools"]


def with_joint_spools(machine: Machine, record: "xr.Dataset") -> "xr.Dataset":
    """The record with the joint spool of servovalves A and B in `spool_position`; without B's channel as it is.

    Where one servovalve of an actuator is open (`valves`), B's spool moves no oil and counts for nothing. Raises
    RecordError for the spool of a B without that of an A.
    """
    if "spool_position_b" not in record:
        return record
    if "spool_position" not in record:
        raise RecordError("spool_position_b is that of servovalve B; spool_position, of servovalve A, is missing")
    joint = record["spool_position"].transpose("time", "actuator").copy(deep=True)
    for actuator in machine.actuators:
        if actuator.name not in machine.double_acting or actuator.valves < 2:
            continue
        curve, sides = actuator.flow_curve, (joint, record["spool_position_b"])
        a, b = (
            np.clip(side.sel({dim: actuator.name}).values.astype(float), -1.0, 1.0)
            for side, dim in zip(sides, ("actuator", "horizontal"), strict=True)
        )
        opened = [0.5 * (opening(x, curve) + opening(y, curve)) for x, y in zip(a, b, strict=True)]
        joint.loc[{"actuator": actuator.name}] = [spool_for_opening(float(g), curve) for g in opened]
    return record.assign(spool_position=joint)

"""Where a test tells how friction slips, and the error of its forces there.

Friction whose yield slip is below the noise of the displacement has an unknown state wherever the platen hardly moves:
modelled along the measured motion it is noise there. Fits leave those samples out (`friction_march.made_fine`); a
comparison of records shows them, and states its error without them.
"""

import numpy as np

from ..core.arrays import Array
from ..core.names import AXES
from ..mechanics.plant import Plant
from .friction_march import made_fine
from .prepare import MeasuredTest

__all__ = ["UNKNOWN_SLIP", "slip_summary"]

UNKNOWN_SLIP = (
    "Friction here yields within less than the noise of the displacement: while the platen hardly moves, its slip is "
    "unknown and the modelled force is noise. Fits (calibrate, discover) leave these samples out, and correct errors "
    "of sensors, so that their errors are smaller."
)
"""What an unknown slip means, beside `slip_summary`."""


def slip_summary(plant: Plant, test: MeasuredTest, measured: Array, residual: Array, inside: slice) -> str:
    """In which share of a test slip is unknown, and the error of its forces in the rest; empty where it is known.

    measured and residual (n, 6) are forces at the samples `inside` of the test, equally filtered.
    """
    weight = made_fine(plant, test).weight
    if weight is None:
        return ""
    known = weight[inside]
    axes = plant.axes[plant.axes < 3]
    axis = int(axes[np.argmax(measured[:, axes].std(axis=0))])
    size, error = (float(np.std(known * x[:, axis])) for x in (measured, residual))
    rest = f", RRMSE along {AXES[axis]} in the others {100.0 * error / size:.3g} %" if size > 0.0 else ""
    return f"friction's slip is unknown in {100.0 * (1.0 - known.mean()):.0f} % of the samples{rest}"

"""Springs in the joints of a specimen's URDF, as compiled code reads them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..machine.specimen import Specimen

__all__ = ["SPRING", "spring_table"]

SPRING = np.dtype(
    [
        ("q", np.int64),  # place in q of the joint's coordinate; of its cosine, the sine behind, where it turns freely
        ("v", np.int64),  # place in v
        ("turns", np.int64),  # 1: q holds cosine and sine
        ("stiffness", np.float64),  # [N/m or N m/rad]
        ("rest", np.float64),  # [m or rad]
    ]
)


def spring_table(model: Any, specimen: Specimen | None) -> NDArray[np.void]:
    """Springs in the joints of a plant's Pinocchio model; none of a locked specimen."""
    named = {} if specimen is None or specimen.locked else specimen.joint_springs
    table = np.zeros(len(named), SPRING)
    for row, (name, spring) in zip(table, named.items(), strict=True):
        joint = model.getJointId(name)
        row["q"], row["v"], row["turns"] = model.idx_qs[joint], model.idx_vs[joint], model.nqs[joint] == 2
        row["stiffness"], row["rest"] = spring.stiffness, spring.rest
    return table

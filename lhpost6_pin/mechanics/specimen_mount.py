"""A specimen mounted on the platen: its URDF appended to the Pinocchio model at the platen's top frame."""

from typing import Any

import numpy as np
import pinocchio as pin

from ..core.errors import ParameterError
from ..machine.specimen import Specimen
from ..machine.urdf_numbers import check_urdf

__all__ = ["mount_specimen"]


def mount_specimen(model: Any, specimen: Specimen) -> Any:
    """Model of the platen with the specimen's URDF fixed to its top frame, at the specimen's position and rpy.

    Raises ParameterError for a URDF that is missing, unreadable, without mass, or named as parts of the platen are.
    """
    if not specimen.urdf.is_file():
        raise ParameterError(f"{specimen.urdf}: no such URDF file")
    check_urdf(specimen.urdf)
    try:
        body = pin.buildModelFromUrdf(str(specimen.urdf))
    except Exception as error:  # urdfdom reports malformed files as plain exceptions
        raise ParameterError(f"{specimen.urdf}: not a URDF that Pinocchio can read: {error}") from error
    if specimen.locked and body.njoints > 1:
        body = pin.buildReducedModel(body, list(range(1, body.njoints)), pin.neutral(body))
    if not np.all(np.isfinite((*specimen.position, *specimen.rpy))):
        raise ParameterError(f"{specimen.urdf}: position {specimen.position} and rpy {specimen.rpy} must be finite")
    at = pin.SE3(pin.rpy.rpyToMatrix(*specimen.rpy), np.array(specimen.position))
    if sum(i.mass for i in body.inertias) <= 0.0:
        raise ParameterError(f"{specimen.urdf}: the specimen has no mass; give its links <inertial> elements")
    try:
        joined = pin.appendModel(model, body, model.getFrameId("platen_top"), at)
    except ValueError as error:  # a joint or frame named as one of the platen's
        raise ParameterError(f"{specimen.urdf}: {error}; rename it in the URDF") from error
    joined.gravity = model.gravity
    return joined

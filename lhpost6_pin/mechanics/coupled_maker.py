"""The coupled specimen of a machine, made of a user's class, function or object, and checked."""

import inspect
from typing import Any

import numpy as np
import pinocchio as pin

from ..core.errors import ParameterError
from ..core.user_code import make_attribute
from ..machine.machine import Machine
from ..machine.user_specimen import UserSpecimen
from .coupled import CoupledSpecimen
from .remote_specimen import RemoteSpecimen

__all__ = ["coupled_specimen", "made_specimen"]


def coupled_specimen(machine: Machine) -> CoupledSpecimen | None:
    """Specimen of a machine that is coupled, made ready; None if it has none. Raises as `made_specimen` does."""
    return made_specimen(machine.specimen) if isinstance(machine.specimen, UserSpecimen) else None


def made_specimen(described: UserSpecimen) -> CoupledSpecimen:
    """The specimen that a description makes, or asks for in another process.

    Raises ParameterError for an object that is no specimen, naming what it lacks, or where no other process answers.
    """
    maker: Any = described.maker
    if isinstance(maker, str):
        return RemoteSpecimen(maker)
    if inspect.isfunction(maker) and next(iter(inspect.signature(maker).parameters), "") == "ops":
        from .opensees import OpenSeesSpecimen

        return OpenSeesSpecimen(maker, described.name)
    made = maker
    if inspect.isclass(maker) or inspect.isfunction(maker):
        made = make_attribute(described.source, maker, ParameterError)
    for method in ("init", "step"):
        if not callable(getattr(made, method, None)):
            raise ParameterError(
                f"{described.source} has no {method}(); a specimen has init(base, gravity) and step(memory, base, dt), "
                "an OpenSees model is a function build(ops, base)"
            )
    if not isinstance(getattr(made, "inertia", None), pin.Inertia):
        raise ParameterError(
            f"{described.source} has no inertia; name the rigidly attached part, inertia = pin.Inertia(...), or none: "
            "inertia = pin.Inertia.Zero()"
        )
    if not np.isfinite(made.inertia.toDynamicParameters()).all() or made.inertia.mass < 0.0:
        raise ParameterError(f"{described.source}: inertia has a mass of {made.inertia.mass:g} kg, or is not finite")
    found: CoupledSpecimen = made
    return found

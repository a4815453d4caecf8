"""A specimen in Python on the platen: a class of your own, or a function that builds an OpenSees model."""

from dataclasses import dataclass, field
from typing import Any

from ..core.errors import ParameterError
from ..core.user_code import load_attribute

__all__ = ["UserSpecimen", "load_user_specimen"]

Vec3 = tuple[float, float, float]


@dataclass(frozen=True)
class UserSpecimen:
    """Specimen description; `mechanics.coupled` says what `maker` must be.

    position [m] and rpy [rad] place the specimen's base in the platen's top-face frame: origin C, platen axes.
    """

    source: str  # FILE.py:NAME, or the name of an object in Python
    maker: Any = field(compare=False)  # class, function, or the object itself
    position: Vec3 = (0.0, 0.0, 0.0)
    rpy: Vec3 = (0.0, 0.0, 0.0)

    @property
    def name(self) -> str:
        """Short name, as written to records."""
        return self.source.rpartition(":")[2]


def load_user_specimen(source: Any, position: Vec3 = (0.0, 0.0, 0.0), rpy: Vec3 = (0.0, 0.0, 0.0)) -> UserSpecimen:
    """Specimen from ``FILE.py:NAME``, or of an object in Python.

    Raises ParameterError naming the file and what is wrong with it.
    """
    if not isinstance(source, str):
        return UserSpecimen(type(source).__name__, source, position, rpy)
    return UserSpecimen(source, load_attribute(source, "--specimen", ParameterError), position, rpy)

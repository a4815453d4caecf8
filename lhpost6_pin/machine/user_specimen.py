"""A specimen in Python on the platen: a class of your own, or a function that builds an OpenSees model."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..core.errors import ParameterError
from ..core.files import models_folder
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
        """Short name, as written to records: that of the class, of the file where it is a file's `build`."""
        file, _, attribute = self.source.rpartition(":")
        return attribute if attribute != "build" else Path(file).stem


def load_user_specimen(source: Any, position: Vec3 = (0.0, 0.0, 0.0), rpy: Vec3 = (0.0, 0.0, 0.0)) -> UserSpecimen:
    """Specimen from ``FILE.py:NAME``, or of an object in Python; ``FILE.py`` alone names its `build`.

    A file that is not found by its path is looked for among the shipped specimens. Raises ParameterError naming the
    file and what is wrong with it.
    """
    if not isinstance(source, str):
        return UserSpecimen(type(source).__name__, source, position, rpy)
    file, colon, attribute = source.rpartition(":")
    path, attribute = (Path(file), attribute) if colon else (Path(source), "build")
    if not path.is_file() and (known := models_folder() / "specimens" / path).is_file():
        path = known
    maker = load_attribute(f"{path}:{attribute}", "--specimen", ParameterError)
    return UserSpecimen(f"{path}:{attribute}", maker, position, rpy)

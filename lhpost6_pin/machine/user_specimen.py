"""A specimen that is a program: a class of your own, a function that builds an OpenSees model, or another process."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from ..core.errors import ParameterError
from ..core.files import models_folder
from ..core.user_code import load_attribute
from .specimen import Specimen

__all__ = ["REMOTE", "UserSpecimen", "load_user_specimen"]

Vec3 = tuple[float, float, float]

REMOTE = "udp:"
"""What the address of a specimen in another process begins with (`mechanics.remote_specimen`)."""


@dataclass(frozen=True)
class UserSpecimen(Specimen):
    """Specimen description; `mechanics.coupled` says what `maker` must be. It is no part of the plant's equations."""

    maker: Any = field(default=None, compare=False)  # class, function, the object itself, or an address
    attribute: str = "build"  # its name in the file

    @property
    def name(self) -> str:
        """Short name, as written to records: that of the class, of the file where it is a file's `build`."""
        return self.attribute if self.attribute != "build" else self.file.stem

    @property
    def source(self) -> str:
        """FILE.py:NAME, or the name of an object in Python."""
        return f"{self.file}:{self.attribute}" if self.file.suffix else self.attribute

    @property
    def is_urdf(self) -> bool:
        """No URDF."""
        return False

    @property
    def files(self) -> tuple[Path, ...]:
        """The Python file, if any."""
        return (self.file,) if self.file.suffix else ()

    @cached_property
    def contents(self) -> None:
        """Nothing in data."""
        return None


def load_user_specimen(source: Any, position: Vec3 = (0.0, 0.0, 0.0), rpy: Vec3 = (0.0, 0.0, 0.0)) -> UserSpecimen:
    """Specimen from ``FILE.py:NAME``, ``udp:HOST:PORT``, or an object in Python; ``FILE.py`` alone names its `build`.

    A file that is not found by its path is looked for among the shipped specimens. Raises ParameterError naming the
    file and what is wrong with it.
    """
    if isinstance(source, str) and source.startswith(REMOTE):
        return UserSpecimen(Path(), position, rpy, maker=source, attribute=source)
    if not isinstance(source, str):
        return UserSpecimen(Path(), position, rpy, maker=source, attribute=type(source).__name__)
    file, colon, attribute = source.rpartition(":")
    path, attribute = (Path(file), attribute) if colon else (Path(source), "build")
    if not path.is_file() and (known := models_folder() / "specimens" / path).is_file():
        path = known
    maker = load_attribute(f"{path}:{attribute}", "--specimen", ParameterError)
    return UserSpecimen(path, position, rpy, maker=maker, attribute=attribute)

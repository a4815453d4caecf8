"""A specimen on the platen: which URDF, where it is bolted, and whether its joints are free."""

from dataclasses import dataclass
from pathlib import Path

from ..core.files import find_shipped

__all__ = ["Specimen", "find_specimen"]


@dataclass(frozen=True)
class Specimen:
    """Specimen description; `rigid_body.make_model` reads the URDF.

    position [m] and rpy [rad] place the URDF's root link in the platen's top-face frame: origin C, platen axes.
    With `locked` joints the specimen is one rigid body on the platen; otherwise its joints are free.
    """

    urdf: Path
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    locked: bool = False

    @property
    def name(self) -> str:
        """Short name, as written to records."""
        return self.urdf.stem


def find_specimen(name_or_path: str | Path) -> Path:
    """URDF of a shipped specimen by name, or the path itself; raises UnknownNameError that lists the shipped ones."""
    path = Path(name_or_path)
    if path.suffix:
        return path
    return find_shipped("specimen", str(name_or_path), "specimens", ".urdf")

"""A specimen on the platen: which file describes it, where it is bolted, and whether it is rigid."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ..core.errors import UnknownNameError
from ..core.files import shipped_specimens
from .specimen_file import array_file_of, read_joint_springs, read_specimen
from .specimen_forms import JointSpring, Modes, SpecimenContents

__all__ = ["Specimen", "find_specimen"]


@dataclass(frozen=True)
class Specimen:
    """Specimen description; `rigid_body.make_model` mounts it.

    file is a URDF, whose joints may have springs in a TOML of the same name beside it, or states a rigid body with
    modes or matrices (.toml, .npz, .mat; `specimen_file`). position [m] and rpy [rad] place its root or base in the
    platen's top-face frame: origin C, platen axes. `locked`: one rigid body on the platen, without joints or modes.
    """

    file: Path
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    locked: bool = False

    @property
    def name(self) -> str:
        """Short name, as written to records."""
        return self.file.stem

    @property
    def is_urdf(self) -> bool:
        """Whether its file is a URDF; any other states its contents."""
        return self.file.suffix not in (".toml", ".npz", ".mat")

    @cached_property
    def contents(self) -> SpecimenContents | None:
        """What a file other than a URDF states; raises ParameterError naming file and entry."""
        return None if self.is_urdf else read_specimen(self.file)

    @property
    def modes(self) -> Modes | None:
        """Modes that move, if any."""
        return None if self.locked or self.contents is None else self.contents.modes

    @cached_property
    def joint_springs(self) -> dict[str, JointSpring]:
        """Springs of a URDF's joints by name; raises ParameterError."""
        return read_joint_springs(self.file.with_suffix(".toml")) if self.is_urdf else {}

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that describe it, the named one first."""
        beside = self.file.with_suffix(".toml")
        found = [self.file]
        if self.file.suffix != ".toml" and beside.is_file():
            found.append(beside)
        if not self.is_urdf and found[-1].suffix == ".toml" and (arrays := array_file_of(found[-1])) is not None:
            found.append(arrays)
        return tuple(dict.fromkeys(found))


def find_specimen(name_or_path: str | Path) -> Path:
    """File of a shipped specimen by name, or the path itself; raises UnknownNameError that lists the shipped ones."""
    path = Path(name_or_path)
    if path.suffix:
        return path
    known = shipped_specimens()
    if str(name_or_path) not in known:
        raise UnknownNameError("specimen", str(name_or_path), sorted(known))
    return known[str(name_or_path)]

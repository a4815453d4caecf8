"""The specimen of a test, as attributes of its record: name, file, place, and whether its joints were locked."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import RecordError, UnknownNameError
from .components import Vec3
from .specimen import Specimen, find_specimen
from .user_specimen import UserSpecimen

__all__ = ["Mounting", "mounting_doubts", "place_words", "recorded_mounting", "specimen_facts"]


class Mounting(NamedTuple):
    """Arguments of `Machine.with_specimen`."""

    file: str  # a path, or the name of a shipped specimen
    position: Vec3
    rpy: Vec3
    locked: bool


def specimen_facts(specimen: Specimen | None) -> dict[str, Any]:
    """Attributes of a record made with a specimen; `specimen` is `none` for a bare table.

    Of a specimen in Python without its file: a record that is read must not run a program.
    """
    if specimen is None:
        return {"specimen": "none"}
    place = {
        "specimen_position": np.array(specimen.position, float),  # of its root from C, platen axes [m]
        "specimen_rpy": np.array(specimen.rpy, float),  # [rad]
    }
    if isinstance(specimen, UserSpecimen):
        return {"specimen": specimen.name, **place}
    path = specimen.file.resolve()
    file = specimen.name if _is_shipped(path, specimen.name) else str(path)
    return {"specimen": specimen.name, "specimen_file": file, **place, "specimen_locked": int(specimen.locked)}


def place_words(place: Iterable[float]) -> str:
    """A place [m] as `--specimen-at` takes it."""
    return ",".join(f"{x:g}" for x in place)


def mounting_doubts(specimen: Specimen | None, records: Sequence[Mapping[str, Any]]) -> list[str]:
    """Sentences on what attributes of records state of their specimen otherwise than it is mounted, each once."""
    name = specimen.name if specimen else "none"
    at = np.array(specimen.position if specimen else (0.0, 0.0, 0.0), float)
    found: dict[str, None] = {}
    for attrs in records:
        made, place = str(attrs.get("specimen", name)), np.ravel(attrs.get("specimen_position", at))
        if made != name:
            found[f"the record states specimen {made}, --specimen mounts {name}"] = None
        elif place.shape == at.shape and not np.allclose(place, at):
            stated = place_words(place)
            found[f"the record states {name} at {stated} m from C: --specimen-at {stated} mounts it there"] = None
    return list(found)


def recorded_mounting(attrs: Mapping[str, Any], record: str) -> Mounting | None:
    """Specimen that `record` was made with; None for a bare table or where its place is not stated.

    Raises RecordError for a file that is not there, or numbers that are none.
    """
    if str(attrs.get("specimen", "none")) == "none" or "specimen_file" not in attrs:
        return None
    name, file = str(attrs["specimen"]), str(attrs["specimen_file"])
    try:
        places = [tuple(np.asarray(attrs[f"specimen_{key}"], float).ravel().tolist()) for key in ("position", "rpy")]
        locked = bool(int(attrs.get("specimen_locked", 0)))
    except (KeyError, TypeError, ValueError):
        places, locked = [], False
    if [len(place) for place in places] != [3, 3]:
        raise RecordError(
            f"{record} was made with specimen {name!r}, and its attributes specimen_position and specimen_rpy are not "
            "three numbers each; mount it with --specimen and --specimen-at"
        )
    try:
        found = find_specimen(file)
    except UnknownNameError:
        found = Path(file)
    if not found.is_file():
        raise RecordError(
            f"{record} was made with specimen {name!r} of {file}, which is not there; mount it with --specimen FILE"
        )
    position, rpy = places
    return Mounting(file, position, rpy, locked)


def _is_shipped(path: Path, name: str) -> bool:
    try:
        return find_specimen(name).resolve() == path
    except UnknownNameError:
        return False

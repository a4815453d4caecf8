"""Files of specimens: a rigid body, its modes, or matrices, in TOML; arrays also in .npz or .mat (docs: specimens.md).

[mass]      mass, centre_of_gravity, inertia        the whole specimen as a rigid body
[modes]     frequency, damping, participation       or
[matrices]  mass, stiffness, damping, influence     each { value = ..., unit = ... } or { variable = ..., unit = ... }
[[point]]   name, at, direction                     coordinates to record, those of the matrices in their order
[joint.N]   stiffness, damping, rest                in the file beside a URDF: springs of its joints
"""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..core.arrays import Array
from ..core.errors import ParameterError, instead_of
from ..core.files import read_toml, reason_of
from .quantity import read_quantity, to_unit
from .specimen_arrays import read_arrays, read_entry
from .specimen_forms import (
    DIRECTIONS,
    JointSpring,
    Modes,
    Point,
    RigidBody,
    SpecimenContents,
    check_shares,
    influence_of,
    rigid_body_of,
)
from .specimen_matrices import Matrices, modes_of

log = logging.getLogger(__name__)

__all__ = ["array_file_of", "read_joint_springs", "read_specimen"]

_SECTIONS = {
    "specimen": ("title", "source"),
    "mass": ("mass", "centre_of_gravity", "inertia"),
    "modes": ("file", "frequency", "damping", "participation"),
    "matrices": ("file", "mass", "stiffness", "damping", "damping_ratio", "influence", "highest_frequency"),
    "joint": None,
    "point": None,
}
_IN_POINT = ("name", "at", "direction", "shape")
_IN_JOINT = ("stiffness", "damping", "rest")
_VARIABLES = {"mass": "M", "stiffness": "K", "damping": "C", "influence": "R"}
"""Names of variables in a file of matrices without TOML."""
_UNITS = {"mass": "kg", "stiffness": "N/m", "damping": "N s/m"}

# Judgement, not physics: beyond critical damping no mode swings, and a ratio is one in per cent, or of a dashpot that
# belongs in [matrices] damping; structures with added dampers reach 0.3.
_CRITICAL, _USUAL = 1.0, 0.3


def read_specimen(path: Path) -> SpecimenContents:
    """Read a specimen's .toml, .npz or .mat; raises ParameterError naming file and entry."""
    if not path.is_file():
        raise ParameterError(f"{path}: no such specimen file")
    if path.suffix in (".npz", ".mat"):
        beside = path.with_suffix(".toml")
        if not beside.is_file():
            known = read_arrays(path)
            entries = {
                key: {"variable": v, "unit": _UNITS.get(key, "1")} for key, v in _VARIABLES.items() if v in known
            }
            return _contents({"matrices": {"file": path.name, **entries}}, path)
        path = beside
    return _contents(_tree(path), path)


def array_file_of(path: Path) -> Path | None:
    """File of arrays that a specimen's TOML names, if any; raises ParameterError for an unreadable one."""
    tree = _tree(path)
    named = next((t["file"] for t in (tree.get("modes"), tree.get("matrices")) if t and "file" in t), None)
    return None if named is None else path.parent / str(named)


def read_joint_springs(path: Path) -> dict[str, JointSpring]:
    """Springs of a URDF's joints by name, from the TOML beside it; none if there is no such file."""
    if not path.is_file():
        return {}
    found = {}
    for name, entries in _section(_tree(path), "joint", path).items():
        where = f"{path}: joint.{name}"
        _refuse_unknown(entries, _IN_JOINT, where)
        unit = "rad" if "rad" in str(entries.get("stiffness", {}).get("unit", "")) else "m"
        per = "N m/rad" if unit == "rad" else "N/m"
        rub = "N m s/rad" if unit == "rad" else "N s/m"
        numbers = [
            _number(entries, key, u, where, default=0.0)
            for key, u in (("stiffness", per), ("damping", rub), ("rest", unit))
        ]
        if min(numbers[:2]) < 0.0:
            raise ParameterError(f"{where}: stiffness and damping should be zero or positive")
        found[name] = JointSpring(*numbers)
    return found


def _contents(tree: Mapping[str, Any], path: Path) -> SpecimenContents:
    for name in tree:
        if name not in _SECTIONS:
            raise ParameterError(f"{path}: unknown section {name}; {instead_of(name, list(_SECTIONS))}")
    if "joint" in tree:
        raise ParameterError(
            f"{path}: [joint] states springs of a URDF; name the URDF, {path.with_suffix('.urdf').name}"
        )
    if "modes" in tree and "matrices" in tree:
        raise ParameterError(f"{path}: state [modes] or [matrices], not both")
    title = str(_section(tree, "specimen", path).get("title", path.stem))
    points = _points(tree, path)
    body = _body(_section(tree, "mass", path), f"{path}: mass") if "mass" in tree else None
    if "matrices" in tree:
        given, highest = _matrices(_section(tree, "matrices", path), points, path)
        where = f"{path}: matrices"
        found = modes_of(given, highest, where)
        body = body or rigid_body_of(given.influence.T @ given.mass @ given.influence, where)
        modes: Modes | None = found if points else found._replace(shape=np.zeros((0, len(found.frequency))))
    elif body is None:
        raise ParameterError(f"{path}: [mass] is missing; state the whole specimen's mass, centre_of_gravity, inertia")
    else:
        modes = _modes(_section(tree, "modes", path), tree.get("point", ()), path) if "modes" in tree else None
    if not body.mass > 0.0:
        raise ParameterError(f"{path}: the specimen has no mass; state it in [mass]")
    if modes is not None:
        check_shares(body, modes.participation, str(path))
    return SpecimenContents(title, body, modes, points)


def _body(entries: Mapping[str, Any], where: str) -> RigidBody:
    mass = _number(entries, "mass", "kg", where)
    centre = _vector(entries, "centre_of_gravity", "m", (3,), where)
    moments = _vector(entries, "inertia", "kg m2", (3, 6), where)
    xx, yy, zz, xy, xz, yz = (*moments, 0.0, 0.0, 0.0)[:6]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if mass <= 0.0 or np.linalg.eigvalsh(inertia)[0] < 0.0:
        raise ParameterError(f"{where}: mass should be positive and no principal moment of inertia negative")
    return RigidBody(mass, (centre[0], centre[1], centre[2]), inertia)


def _points(tree: Mapping[str, Any], path: Path) -> tuple[Point, ...]:
    tables, found = tree.get("point", []), []
    if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
        raise ParameterError(f"{path}: points are tables [[point]]")
    for k, table in enumerate(tables):
        where = f"{path}: point {k + 1}"
        _refuse_unknown(table, _IN_POINT, where)
        direction = table.get("direction")
        if direction not in DIRECTIONS:
            raise ParameterError(f"{where}: direction = {direction!r}; it should be one of {', '.join(DIRECTIONS)}")
        at = _vector(table, "at", "m", (3,), where)
        found.append(Point(str(table.get("name", f"point {k + 1}")), (at[0], at[1], at[2]), direction))
    names = [p.name for p in found]
    if twice := sorted({n for n in names if names.count(n) > 1}):
        raise ParameterError(f"{path}: two points are named {twice[0]!r}; give each a name of its own")
    return tuple(found)


def _modes(entries: Mapping[str, Any], points: Any, path: Path) -> Modes:
    arrays, where = _arrays(entries, path), f"{path}: modes"
    frequency = 2.0 * np.pi * read_entry(entries, "frequency", "Hz", 1, arrays, where)
    n = len(frequency)
    ratio = read_entry(entries, "damping", "1", 1, arrays, where)
    part = read_entry(entries, "participation", "sqrt(kg)", 2, arrays, where)
    if len(ratio) not in (1, n):
        raise ParameterError(f"{where}: damping has {len(ratio)} numbers; give one, or {n} as of frequency")
    if part.shape != (n, 6):
        raise ParameterError(
            f"{where}: participation has shape {part.shape}; give {n} rows of six: x, y, z, rx, ry, rz"
        )
    if frequency.min() <= 0.0 or ratio.min() < 0.0:
        raise ParameterError(f"{where}: frequency should be positive and damping zero or positive")
    _check_ratio(ratio, f"{where}.damping")
    shape = np.zeros((len(points), n))
    for k, table in enumerate(points):
        row = read_entry(table, "shape", "1/sqrt(kg)", 1, arrays, f"{path}: point {k + 1}")
        if len(row) != n:
            raise ParameterError(f"{path}: point {k + 1}: shape has {len(row)} numbers; give one for each of {n} modes")
        shape[k] = row
    return Modes(frequency, np.diag(2.0 * ratio * np.ones(n) * frequency), part, shape)


def _matrices(entries: Mapping[str, Any], points: tuple[Point, ...], path: Path) -> tuple[Matrices, float]:
    arrays, where = _arrays(entries, path), f"{path}: matrices"
    turning = any(p.direction.startswith("r") for p in points)
    for key, unit in _UNITS.items():
        given = entries.get(key, {}).get("unit", unit) if isinstance(entries.get(key), dict) else unit
        if turning and given != unit:
            raise ParameterError(
                f"{where}: {key} in {given}; with rotations among its points give it in SI, unit {unit!r}"
            )
    read = {k: read_entry(entries, k, u, 2, arrays, where) for k, u in _UNITS.items() if k in entries}
    for key in ("mass", "stiffness"):
        if key not in read:
            raise ParameterError(f"{where}: {key} is missing")
    if "influence" in entries:
        influence = read_entry(entries, "influence", "1", 2, arrays, where)
    elif points:
        influence = influence_of(points)
    else:
        raise ParameterError(
            f"{where}: influence is missing; give it (n, 6), or a [[point]] for every degree of freedom"
        )
    if points and len(points) != len(read["stiffness"]):
        raise ParameterError(
            f"{path}: {len(points)} points for {len(read['stiffness'])} rows of the stiffness; give one each"
        )
    if "damping" in read and "damping_ratio" in entries:
        raise ParameterError(f"{where}: state damping or damping_ratio, not both")
    ratio = read_entry(entries, "damping_ratio", "1", 1, arrays, where) if "damping_ratio" in entries else None
    if ratio is not None and ratio.min() < 0.0:
        raise ParameterError(f"{where}: damping_ratio should be zero or positive")
    if ratio is not None:
        _check_ratio(ratio, f"{where}.damping_ratio")
    highest = 2.0 * np.pi * _number(entries, "highest_frequency", "Hz", where, default=np.inf)
    return Matrices(read["mass"], read["stiffness"], read.get("damping"), influence, ratio), highest


def _check_ratio(ratio: Array, where: str) -> None:
    """Raise ParameterError for damping beyond critical; log a warning of more than structures have."""
    largest = float(ratio.max())
    if largest > _CRITICAL:
        raise ParameterError(
            f"{where}: {largest:g} of critical damping; it is a ratio, so write 2 per cent as 0.02, or with unit = '%'"
        )
    if largest > _USUAL:
        log.warning(
            "%s: %g of critical damping, more than structures have; is it in per cent? (unit = '%%')", where, largest
        )


def _arrays(entries: Mapping[str, Any], path: Path) -> dict[str, Array]:
    """Variables of the file of arrays that a section names; none if it names none."""
    return read_arrays(path.parent / str(entries["file"])) if "file" in entries else {}


def _tree(path: Path) -> dict[str, Any]:
    try:
        return read_toml(path)
    except ValueError as error:  # of TOML and of UTF-8
        raise ParameterError(f"{path}: not a TOML file: {error}") from None
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read: {reason_of(error)}") from None


def _section(tree: Mapping[str, Any], name: str, path: Path) -> Mapping[str, Any]:
    section = tree.get(name, {})
    if not isinstance(section, dict):
        raise ParameterError(f"{path}: {name} should be a section [{name}]")
    known = _SECTIONS[name]
    if known is not None:
        _refuse_unknown(section, known, f"{path}: {name}")
    elif not all(isinstance(entry, dict) for entry in section.values()):
        raise ParameterError(f"{path}: {name} should be sections [{name}.NAME]")
    return section


def _refuse_unknown(table: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in known:
            raise ParameterError(f"{where}: unknown {key}; {instead_of(key, list(known))}")


def _vector(entries: Mapping[str, Any], key: str, unit: str, lengths: tuple[int, ...], where: str) -> tuple[float, ...]:
    if key not in entries:
        raise ParameterError(f"{where}: {key} is missing")
    entry = entries[key]
    if not isinstance(entry, dict):
        raise ParameterError(f"{where}: {key} has no unit; write {key} = {{ value = ..., unit = '{unit}' }}")
    quantity = read_quantity({"evidence": "override", "source": "", **entry}, f"{where}: {key}")
    value = to_unit(quantity.value, quantity.unit, unit, f"{where}: {key}")
    numbers = value if isinstance(value, tuple) else (value,)
    if len(numbers) not in lengths:
        wanted = " or ".join(map(str, lengths))
        raise ParameterError(f"{where}: {key} has {len(numbers)} numbers; it should have {wanted}")
    return numbers


def _number(entries: Mapping[str, Any], key: str, unit: str, where: str, default: float | None = None) -> float:
    if default is not None and key not in entries:
        return default
    return _vector(entries, key, unit, (1,), where)[0]

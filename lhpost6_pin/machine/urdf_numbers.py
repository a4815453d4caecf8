"""The numbers of a URDF, looked at before Pinocchio reads them: its parser leaves out what it cannot read."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..core.errors import ParameterError
from .parameters import LARGEST

__all__ = ["check_urdf"]

_NUMBERS = {"mass": ("value",), "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
_PLACES = {"origin": ("xyz", "rpy"), "axis": ("xyz",)}
_WITHOUT_AXIS = ("fixed", "floating")
_NEGLIGIBLE = 1e-6
"""Share of the largest moment of inertia of all links below which a negative one is rounding."""


def check_urdf(path: Path) -> None:
    """Raise ParameterError naming the link or joint whose inertia or place is none, or that the file lacks."""
    try:
        robot = ET.parse(path).getroot()
    except (ET.ParseError, OSError, ValueError, LookupError) as error:  # the last two: of the file's encoding
        raise ParameterError(f"{path}: not a URDF that Pinocchio can read: {error}") from None
    links, joints = list(robot.findall("link")), list(robot.findall("joint"))
    _check_tree(path, robot, links, joints)
    moments = {}
    for owner in (*links, *joints):
        where = f"{path}: {owner.tag} {owner.get('name')}"
        parts = [owner] if owner.tag == "joint" else owner.findall("inertial")
        for part in parts:
            for tag, keys in _PLACES.items():
                for element in part.findall(tag):
                    numbers = _vectors(element, [key for key in keys if key in element.attrib], 3, where)
                    needed = tag == "axis" and owner.get("type") not in _WITHOUT_AXIS
                    if needed and numbers and not any(numbers):
                        raise ParameterError(f"{where}: its axis has no direction; give one that is not 0 0 0")
        for inertial in owner.findall("inertial"):
            mass, (xx, xy, xz, yy, yz, zz) = (_of(inertial, tag, keys, where) for tag, keys in _NUMBERS.items())
            if mass[0] < 0.0:
                raise ParameterError(f"{where}: its mass is negative; correct it")
            moments[where] = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    most = max((found[2] for found in moments.values()), default=0.0)
    for where, found in moments.items():
        if found[0] < -_NEGLIGIBLE * most:
            raise ParameterError(
                f"{where}: a principal moment of inertia is negative, {found[0]:.3g} kg m2; correct it"
            )


def _check_tree(path: Path, robot: ET.Element, links: Sequence[ET.Element], joints: Sequence[ET.Element]) -> None:
    """Raise ParameterError for a robot without name or links, or a joint between links that are not in the file."""
    if not robot.get("name") or not links:
        raise ParameterError(f"{path}: <robot> has no {'link' if robot.get('name') else 'name'}; give it one")
    names = {link.get("name") for link in links}
    for joint in joints:
        for end in ("parent", "child"):
            link = element.get("link") if (element := joint.find(end)) is not None else None
            if link not in names:
                raise ParameterError(
                    f"{path}: joint {joint.get('name')}: its {end} link {link} is not in the file; add it"
                )


def _of(inertial: ET.Element, tag: str, keys: tuple[str, ...], where: str) -> list[float]:
    element = inertial.find(tag)
    missing = [key for key in keys if element is None or key not in element.attrib]
    if element is None or missing:
        raise ParameterError(f"{where}: its <inertial> has no {tag} {missing[0]}; add it")
    return _vectors(element, keys, 1, where)


def _vectors(element: ET.Element, keys: Sequence[str], size: int, where: str) -> list[float]:
    """Numbers of some attributes, `size` of them in each."""
    found: list[float] = []
    for key in keys:
        text = element.attrib[key]
        try:
            numbers = [float(word) for word in text.split()]
        except ValueError:
            numbers = []
        if len(numbers) != size or not all(abs(number) <= LARGEST for number in numbers):  # NaN is none of them either
            raise ParameterError(f"{where}: {element.tag} {key} = {text[:40]!r} should be {size} finite number(s)")
        found += numbers
    return found

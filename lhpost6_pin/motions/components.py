"""Components of a recorded motion: where each points, and the axis of the table that it goes to."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypedDict

import numpy as np

from ..core.errors import MotionError
from .motion import AXES, GroundMotion, make_motion

__all__ = ["Channels", "Component", "Direction", "Stated", "assemble", "axis_and_sign", "direction_of"]
__all__ += ["direction_of_file"]

Channels = Mapping[str, int | str]
"""Channel or column, by number or name, of each axis: `{"x": 2, "y": 1}`."""

Direction = float | str | None
"""Azimuth of positive values [deg], clockwise from north; "up" or "down"; None where the file gives none."""

_WORDS: dict[str, Direction] = {
    **dict.fromkeys(("up", "u", "ud", "v", "z", "ver", "vrt", "vert", "vertical", "400", "402", "500"), "up"),
    **dict.fromkeys(("down", "dn", "dwn", "401", "600"), "down"),  # numbers as in headers of COSMOS and CSMIP
    **dict.fromkeys(("n", "ns", "north"), 0.0),
    **dict.fromkeys(("e", "ew", "east"), 90.0),
    **dict.fromkeys(("s", "south"), 180.0),
    **dict.fromkeys(("w", "west"), 270.0),
}
_AZIMUTH = re.compile(r"(\d{1,3})(?:deg(?:rees?)?)?")
_BEARING = re.compile(r"([ns])(\d{1,2})([ew])")  # S00E: from south to east by 0 degrees
_SEED = re.compile(r"[bcehs][hln]([zne])")  # channel codes of seismology: HNZ, BLE
_CARDINAL = {90.0: ("x", 1), 270.0: ("x", -1), 0.0: ("y", 1), 180.0: ("y", -1)}
_NEARLY_PARALLEL = 0.05  # sine of the angle between two components: they tell one direction only


class Stated(TypedDict, total=False):
    """What is stated of a file of columns that it may not say itself."""

    time_step: float | None  # [s]
    units: str | Mapping[str, str] | None  # one for all values, or one for each axis
    channels: Channels | None


class Component(NamedTuple):
    """One component of a record."""

    where: str  # file and channel, for messages
    labels: tuple[str, ...]  # number and name by which `channels` selects it
    direction: Direction
    time_step: float  # [s]
    values: np.ndarray  # (n,) SI
    quantity: str = "acceleration"
    axis: str | None = None  # where the file itself names it
    in_order: bool = False  # a horizontal goes to x or y in the order of files, whatever its azimuth


def direction_of(text: str) -> Direction:
    """Direction by the words of files: `90 Deg`, `UP`, `E-W`, `S00E`, `HNZ`, COSMOS's 400; None if it is none."""
    word = re.sub(r"[\s.°-]", "", text).casefold()
    if word in _WORDS:
        return _WORDS[word]
    if (match := _AZIMUTH.fullmatch(word)) and int(match[1]) <= 360:
        return float(int(match[1]) % 360)
    if match := _BEARING.fullmatch(word):
        turned = int(match[2]) if match[3] == "e" else -int(match[2])
        return float((turned if match[1] == "n" else 180 - turned) % 360)
    return _WORDS[match[1]] if (match := _SEED.fullmatch(word)) else None


def direction_of_file(stem: str) -> Direction:
    """Direction, up or down, that the end of a file's name gives, as in `ELC-UP`; None for any other name."""
    last = re.split(r"[-_. ]", stem)[-1]
    found = direction_of(last) if last != stem and not last.isdigit() else None
    return found if isinstance(found, str) else None


def axis_and_sign(direction: Direction) -> tuple[str, int] | None:
    """Axis of a direction, and its sign: east is +x, north +y, up +z; None if it lies along none."""
    if isinstance(direction, str):
        return "z", 1 if direction == "up" else -1
    return _CARDINAL.get(direction) if direction is not None else None


def assemble(
    components: Sequence[Component],
    name: str,
    source: str,
    *,
    channels: Channels | None = None,
    rotate: float | None = None,
) -> GroundMotion:
    """One motion from components of one record.

    `channels` selects them and gives their axes; else each goes where it points. `rotate` is the azimuth [deg] of the
    table's x: the two horizontal components, of any azimuths, are turned to x and y. Raises MotionError for a
    component that points along no axis, a vertical one for x or y (and a horizontal one for z), two for one axis,
    or time steps or quantities that differ.
    """
    chosen = _chosen(components, channels)
    steps = {c.where: c.time_step for c in chosen}
    if len(set(steps.values())) > 1:
        listed = ", ".join(f"{where} {step:g} s" for where, step in steps.items())
        raise MotionError(f"time steps differ: {listed}; give components of one record")
    quantities = {c.where: c.quantity for c in chosen}
    if len(set(quantities.values())) > 1:
        raise MotionError(f"accelerations and displacements are mixed: {quantities}; give one kind")
    level = [c for c in chosen if not isinstance(c.direction, str) and c.axis in (None, "x", "y")]
    others = [c for c in chosen if not any(c is other for other in level)]
    placed: dict[str, np.ndarray] = {}
    for component in others + (level if rotate is None else []):
        axis, sign = _place(component, tuple(placed))
        if axis in placed:
            raise MotionError(f"{component.where}: a second channel for axis {axis}; {_remedy(components)}")
        placed[axis] = sign * component.values
    if rotate is not None:
        if "roll" in placed or "pitch" in placed:
            raise MotionError(f"{chosen[0].where}: --rotate does not turn roll and pitch; leave it out")
        placed |= _turned(level, rotate)
        source = f"{source}, x turned to azimuth {rotate:g} deg"
    ordered = {axis: placed[axis] for axis in AXES if axis in placed}
    return make_motion(name, chosen[0].time_step, ordered, chosen[0].quantity, source)


def _chosen(components: Sequence[Component], channels: Channels | None) -> list[Component]:
    """Components in use, with the axes that `channels` gives them."""
    if channels is None:
        return list(components)
    chosen = []
    for axis, wanted in channels.items():
        found = next((c for c in components if str(wanted) in c.labels), None)
        if found is None:
            known = ", ".join(c.labels[0] for c in components)
            raise MotionError(f"{components[0].where}: no channel {wanted} for axis {axis}; channels are {known}")
        chosen.append(found._replace(axis=axis))
    return chosen


def _place(component: Component, taken: Sequence[str]) -> tuple[str, int]:
    """Axis and sign of a component; those already `taken` are passed over in the order of files."""
    direction, axis, where = component.direction, component.axis, component.where
    vertical = isinstance(direction, str)
    if axis is not None:
        if (vertical and axis in "xy") or (isinstance(direction, float) and axis == "z"):
            pointing = "vertical" if vertical else f"horizontal ({direction:g} deg)"
            raise MotionError(
                f"{where}: is {pointing}, not for axis {axis}; give it its own axis, and move the table's {axis} by it "
                f"with --axes {axis}={'z' if vertical else 'x'}"
            )
        return axis, -1 if direction == "down" and axis == "z" else 1
    if component.in_order and not vertical:
        free = [a for a in ("xyz" if direction is None else "xy") if a not in taken]
        if not free:
            raise MotionError(f"{where}: a third horizontal component; give two, and the vertical one")
        return free[0], 1
    along = axis_and_sign(direction)
    if along is None:
        given = "unknown" if direction is None else f"{direction:g} deg"
        raise MotionError(f"{where}: orientation {given} is not along an axis (90, 360, up); {_remedy([component])}")
    return along


def _remedy(components: Sequence[Component]) -> str:
    labels = [c.labels[0] for c in components]
    first, second = labels[0], labels[1] if len(labels) > 1 else "2"
    return (
        f"choose channels, as in --channels x={first},y={second}, or for a station at another angle turn its "
        "horizontal components with --rotate AZIMUTH of the table's x (90: x is east)"
    )


def _turned(components: Sequence[Component], rotate: float) -> dict[str, np.ndarray]:
    """Two horizontal components turned so that x points to azimuth `rotate` [deg], y 90 degrees counterclockwise."""
    if not np.isfinite(rotate):
        raise MotionError(f"--rotate {rotate}: give the azimuth of the table's x in degrees, 90 for east")
    where = components[0].where if components else "this motion"
    if len(components) != 2:
        raise MotionError(
            f"{where}: --rotate turns two horizontal components, here are {len(components)}; choose with --channels"
        )
    azimuths = []
    for c in components:
        azimuth = c.direction if isinstance(c.direction, float) else {"x": 90.0, "y": 0.0}.get(c.axis or "")
        if azimuth is None:
            raise MotionError(f"{c.where}: no azimuth in the file, so it cannot be turned; leave --rotate out")
        azimuths.append(np.radians(azimuth))
    if abs(np.sin(azimuths[1] - azimuths[0])) < _NEARLY_PARALLEL:
        raise MotionError(f"{where}: its horizontal components are parallel; choose two others with --channels")
    count = min(len(c.values) for c in components)
    measured = np.stack([c.values[:count] for c in components])
    east, north = np.linalg.solve([[np.sin(a), np.cos(a)] for a in azimuths], measured)
    x = np.radians(rotate)
    return {"x": np.sin(x) * east + np.cos(x) * north, "y": -np.cos(x) * east + np.sin(x) * north}

"""A machine as a URDF: bodies to look at, for the viewer and for other programs.

Links: ``world``, ``platen`` (frame {b}, at B), and for each actuator and strut NAME ``NAME_barrel`` and ``NAME_rod``.
A leg's links have z along the leg, the barrel's origin at the base point, the rod's at the platen point. A swivel leg
turns on two revolute joints at its base point; a bearing leg stays vertical and carries ``NAME_plate`` on two revolute
joints, the surface plate {n_i} (Eqs. 4-13, 4-14). A URDF is a tree: that the legs end at the platen is a matter of
their joint positions (`bodies.joint_positions`). All joints are zero in the control zero-position.

Masses: the platen alone, where the machine file has it (Table 4.1), and all of a leg's moving parts in its rod, a
point mass where it has the leg's effective mass along and across (so the tree reproduces M_eff,1). Sizes come from
the machine file, where it has none from ``models/drawing/sizes.toml``.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.files import models_folder
from ..machine.components import Actuator, Strut
from ..machine.machine import Machine
from ..machine.parameters import Parameters, load_parameters

__all__ = ["drawing_colour", "drawing_rgb", "drawing_size", "drawing_sizes", "legs", "urdf_text"]

Vec = Sequence[float] | Array
ORIGIN = (0.0, 0.0, 0.0)


@cache
def drawing_sizes() -> Parameters:
    """Sizes and colours that only drawings need; assumed ratios of lengths of the machine."""
    return load_parameters(models_folder() / "drawing" / "sizes.toml")


def drawing_colour(kind: str) -> str:
    """Colour of a kind of body, as ``#0072B2``."""
    return str(drawing_sizes().words[f"colour.{kind}"])


def drawing_rgb(kind: str) -> tuple[float, float, float]:
    """The same as red, green and blue, 0..1."""
    red, green, blue = (int(drawing_colour(kind)[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return red, green, blue


def drawing_size(path: str) -> float:
    """Ratio of lengths by its dotted name, as in ``arrow.length``."""
    value = drawing_sizes()[path].value
    assert isinstance(value, float)
    return value


def legs(machine: Machine) -> tuple[Actuator | Strut, ...]:
    """All that stands between the base and the platen: actuators, then struts."""
    return (*machine.actuators, *machine.struts)


class _Leg(NamedTuple):
    """Measures of an actuator or strut [m]; `kind` names its colour."""

    name: str
    kind: str
    base: Array
    platen_point: Array
    length: float  # in the control zero-position
    travel: float  # half stroke
    bore: float  # radius
    rod: float  # radius
    masses: tuple[float, float]  # along, across [kg]
    effort: float  # largest force [N]
    speed: float  # without load, at rated pressure [m/s]

    @property
    def tilt(self) -> Vec:
        """Roll, pitch, yaw [rad] that bring z to the leg's direction in the control zero-position."""
        x, y, z = self.platen_point - self.base
        return 0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x)

    @property
    def barrel_length(self) -> float:
        return drawing_size("barrel.length") * (self.length - self.travel)

    @property
    def rod_length(self) -> float:
        """Long enough to stay in the barrel, short enough not to leave it at the bottom."""
        longest = self.length + self.travel - (1.0 - drawing_size("rod.overlap")) * self.barrel_length
        return min(longest, self.length - self.travel)


def _leg(machine: Machine, component: Actuator | Strut) -> _Leg:
    length = math.dist(component.platen_point, component.base_point)
    masses = component.mass_along, component.mass_across
    if isinstance(component, Strut):
        kind, area, travel = "strut", component.area, drawing_size("strut.travel") * length
        rod = drawing_size("rod.plunger") * math.sqrt(area / math.pi)
        effort, speed = component.area * component.pressure, 0.0
    else:
        kind, area, travel = component.mount, component.area_a, component.stroke
        rod = drawing_size("rod.plunger") * math.sqrt(area / math.pi)
        if component.area_b is not None and component.area_b != component.area_a:
            area = max(component.area_a, component.area_b)
            rod = math.sqrt(abs(component.area_a - component.area_b) / math.pi)
        effort = area * machine.hydraulics.supply_pressure
        speed = component.valves * component.flow / area
    bore = math.sqrt(area / math.pi)
    ends = np.array(component.base_point), np.array(component.platen_point)
    return _Leg(component.name, kind, *ends, length, travel, bore, rod, masses, effort, speed)


def urdf_text(machine: Machine) -> str:
    """URDF of a machine, as text that ends with a newline; the same machine gives the same text."""
    robot = ET.Element("robot", name=machine.name)
    measures = [_leg(machine, component) for component in legs(machine)]
    for kind in ("platen", "swivel", "bearing", "strut", "rod", "plate", "reaction_mass"):
        opacity = drawing_size("reaction_mass.opacity") if kind == "reaction_mass" else 1.0
        rgba = [*(round(c, 4) for c in drawing_rgb(kind)), opacity]
        _add(_add(robot, "material", name=kind), "color", rgba=rgba)
    _reaction_mass(_add(robot, "link", name="world"), machine, measures)
    _platen(robot, machine, measures)
    for leg in measures:
        _add_leg(robot, leg)
    ET.indent(robot)
    note = (
        f"{machine.title}: bodies to look at. Made by scripts/make_urdf.py from {machine.parameters.origin} "
        "and drawing/sizes.toml; do not edit.\n"
        "     A tree: the legs end at the platen only if inverse kinematics sets their joints.\n"
        "     Swivels and plates turn freely: the zero effort and velocity of their limits mean nothing."
    ).replace("--", "-")
    return f'<?xml version="1.0"?>\n<!-- {note} -->\n{ET.tostring(robot, encoding="unicode")}\n'


def _platen(robot: ET.Element, machine: Machine, measures: Sequence[_Leg]) -> None:
    """Platen as a box from its top face to the bearing plane, with lugs to swivels outside it."""
    centre = np.array(machine.platen.centre_of_gravity)
    size = np.array([*machine.platen.size, -machine.platen.bearing_plane[2]])
    middle = [0.0, 0.0, -0.5 * size[2]] - centre
    link = _add(robot, "link", name="platen")
    _inertial(link, *_platen_inertia(machine))
    _visual(link, "platen", middle, "box", size=size)
    for leg in measures:
        if leg.kind == "bearing":
            continue
        point = leg.platen_point - centre
        width = 2.0 * drawing_size("swivel.radius") * leg.rod
        inside = np.clip(point, middle - 0.5 * (size - width), middle + 0.5 * (size - width))
        thick = 0.25 * width * (point == inside)
        low, high = np.minimum(point, inside) - thick, np.maximum(point, inside) + thick
        _visual(link, "platen", 0.5 * (low + high), "box", size=high - low)
    ends = ("world", "platen")
    if machine.motion == "free":
        _joint(robot, "platen_motion", "floating", ends, centre)
        return
    # one guide on the other: massless carriages between
    carriages = [f"platen_carriage_{'xyz'[k]}" for k in machine.axes[:-1]]
    for carriage in carriages:
        _add(robot, "link", name=carriage)
    between = ("world", *carriages, "platen")
    for n, k in enumerate(machine.axes):
        limit = machine.limits.displacement[k], 0.0, machine.limits.velocity[k]
        place = centre if n == 0 else np.zeros(3)
        _joint(
            robot,
            f"platen_motion_{'xyz'[k]}",
            "prismatic",
            (between[n], between[n + 1]),
            place,
            axis=np.eye(3)[k],
            limit=limit,
        )


def _platen_inertia(machine: Machine) -> tuple[float, Vec, Vec]:
    """Mass, centre of gravity and moments of inertia of the platen alone, else of the smallest effective mass."""
    known = machine.parameters
    if "estimates.platen_alone.mass" not in known:
        return machine.platen.isotropic_mass, ORIGIN, machine.platen.inertia
    mass, moments = (known.vector(f"estimates.platen_alone.{what}") for what in ("mass", "inertia"))
    return mass[0], ORIGIN, moments


def _add_leg(robot: ET.Element, leg: _Leg) -> None:
    """Barrel, rod and, for a bearing leg, surface plate."""
    name = leg.name
    barrel, rod = (_add(robot, "link", name=f"{name}_{part}") for part in ("barrel", "rod"))
    half, radius = 0.5 * leg.barrel_length, drawing_size("barrel.radius") * leg.bore
    _visual(barrel, leg.kind, (0.0, 0.0, half), "cylinder", radius=radius, length=2.0 * half)
    bearing = leg.kind == "bearing"
    edge = drawing_size("plate.edge") * leg.bore
    thickness = drawing_size("plate.thickness") * edge if bearing else 0.0
    along, across = leg.masses
    if along > 0.0:
        place = 0.5 if bearing else math.sqrt(across / along)  # the rod's point mass, from the base
        _inertial(rod, along, (0.0, 0.0, (place - 1.0) * leg.length), ORIGIN)
    bottom, top = -leg.rod_length, -thickness
    _visual(rod, "rod", (0.0, 0.0, 0.5 * (bottom + top)), "cylinder", radius=leg.rod, length=top - bottom)
    if bearing:
        _joint(robot, f"{name}_base", "fixed", ("world", f"{name}_barrel"), leg.base)
    else:
        ball = drawing_size("swivel.radius") * leg.rod
        _visual(barrel, leg.kind, ORIGIN, "sphere", radius=ball)
        _visual(rod, "rod", ORIGIN, "sphere", radius=ball)
        _universal(robot, name, "swivel", "xy", ("world", f"{name}_barrel"), leg.base, leg.tilt)
    ends, tip = (f"{name}_barrel", f"{name}_rod"), (0.0, 0.0, leg.length)
    limit = leg.travel, leg.effort, leg.speed
    _joint(robot, f"{name}_extension", "prismatic", ends, tip, axis=(0.0, 0.0, 1.0), limit=limit)
    if bearing:
        plate = _add(robot, "link", name=f"{name}_plate")
        _visual(plate, "plate", (0.0, 0.0, -0.5 * thickness), "box", size=(edge, edge, thickness))
        _universal(robot, name, "plate", "yx", (f"{name}_rod", f"{name}_plate"), ORIGIN, ORIGIN)


def _universal(robot: ET.Element, name: str, what: str, axes: str, ends: tuple[str, str], xyz: Vec, rpy: Vec) -> None:
    """Two revolute joints through one point, first about axes[0], then about axes[1]."""
    between, free = f"{name}_{what}_cross", (math.pi, 0.0, 0.0)
    _add(robot, "link", name=between)
    first, second = (np.eye(3)["xyz".index(a)] for a in axes)
    _joint(robot, f"{name}_{what}_{axes[0]}", "revolute", (ends[0], between), xyz, rpy, first, free)
    _joint(robot, f"{name}_{what}_{axes[1]}", "revolute", (between, ends[1]), ORIGIN, ORIGIN, second, free)


def _reaction_mass(world: ET.Element, machine: Machine, measures: Sequence[_Leg]) -> None:
    """Translucent block that the legs stand on and in, with a pedestal under each swivel above it."""
    margin = drawing_size("reaction_mass.margin") * max(machine.platen.size)
    width = drawing_size("barrel.radius")
    stand = [leg.base[2] - (0.0 if leg.kind == "bearing" else width * leg.bore) for leg in measures]
    under_platen = machine.platen.bearing_plane[2] - 0.5 * margin
    actuators = [z for z, leg in zip(stand, measures, strict=True) if leg.kind != "strut"]
    top, bottom = min(*actuators, under_platen), min(*stand, under_platen) - margin
    half = 0.5 * np.array([machine.platen.size])
    ends = np.vstack([leg.base[:2] for leg in measures] + [leg.platen_point[:2] for leg in measures] + [half, -half])
    low, high = np.array([*(ends.min(axis=0) - margin), bottom]), np.array([*(ends.max(axis=0) + margin), top])
    _visual(world, "reaction_mass", 0.5 * (low + high), "box", size=high - low)
    for leg, z in zip(measures, stand, strict=True):
        if z > top:
            edge = 3.0 * width * leg.bore
            _visual(world, "reaction_mass", (*leg.base[:2], 0.5 * (z + top)), "box", size=(edge, edge, z - top))


# ------------------------------------------------------------------------------------------------ XML
def _add(parent: ET.Element, tag: str, **attributes: str | float | Vec) -> ET.Element:
    """Add an element; numbers are written with 15 digits, without a negative zero."""
    texts = {
        name: value if isinstance(value, str) else " ".join(f"{v + 0.0:.15g}" for v in np.atleast_1d(value))
        for name, value in attributes.items()
    }
    return ET.SubElement(parent, tag, texts)


def _inertial(link: ET.Element, mass: float, centre: Vec, moments: Vec) -> None:
    inertial = _add(link, "inertial")
    _add(inertial, "origin", xyz=centre)
    _add(inertial, "mass", value=mass)
    x, y, z = moments
    _add(inertial, "inertia", ixx=x, iyy=y, izz=z, ixy="0", ixz="0", iyz="0")


def _visual(link: ET.Element, material: str, xyz: Vec, shape: str, **sizes: float | Vec) -> None:
    """Add a box, a cylinder along z or a sphere [m]."""
    visual = _add(link, "visual")
    _add(visual, "origin", xyz=xyz)
    _add(_add(visual, "geometry"), shape, **sizes)
    _add(visual, "material", name=material)


def _joint(
    robot: ET.Element,
    name: str,
    kind: str,
    ends: tuple[str, str],
    xyz: Vec,
    rpy: Vec = ORIGIN,
    axis: Vec | None = None,
    limit: tuple[float, float, float] | None = None,
) -> None:
    """Add a joint from ends[0] to ends[1]; limit is largest |position|, effort and speed."""
    joint = _add(robot, "joint", name=name, type=kind)
    _add(joint, "parent", link=ends[0])
    _add(joint, "child", link=ends[1])
    _add(joint, "origin", xyz=xyz, rpy=rpy)
    if axis is not None:
        _add(joint, "axis", xyz=axis)
    if limit is not None:
        most, effort, speed = limit
        _add(joint, "limit", lower=-most, upper=most, effort=effort, velocity=speed)

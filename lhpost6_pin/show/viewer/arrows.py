"""Force arrows: at the platen end of every actuator and strut, along it, as long and as deeply coloured as its force.

An arrow points the way the platen is pushed: away from the leg's base under compression, towards it under tension.
It is drawn over all else, so that the platen does not hide it.
"""

import math
from typing import Any

import numpy as np

from ...core.arrays import Array
from ...machine.machine import Machine
from ..urdf import drawing_rgb, drawing_size

__all__ = ["OPACITY", "arrow_colours", "arrow_sizes", "arrow_solid", "kilonewtons", "largest_force"]


CORNERS = 20

OPACITY = 0.95
"""Below 1: what is transparent is drawn last, and so over the platen that hides a rod's end."""


def largest_force(force: Array) -> float:
    """Largest magnitude of forces (n, n_legs) [N], of which the arrow is longest; 1 N where all are zero."""
    return max(float(np.nanmax(np.abs(force))), 1.0)


def kilonewtons(force: float) -> str:
    """A force [N] with its unit for reading, of a machine of any size: 1,760 kN, 6.63 kN, 0.12 kN."""
    return f"{force / 1e3:,.0f} kN" if force >= 1e5 else f"{force / 1e3:.3g} kN"


def arrow_sizes(machine: Machine, force: Array, largest: float) -> Array:
    """Scale (n, 3) of a unit arrow for forces (n,) [N]: turned round, by a mirror, under tension."""
    longest = drawing_size("arrow.length") * max(machine.platen.size)
    size = np.maximum(np.abs(force) / largest, 1e-4) * longest  # three.js cannot invert a scale of zero
    return np.stack([size, size, np.copysign(size, force)], axis=1)


def arrow_colours(force: Array, largest: float) -> Array:
    """Red, green and blue (n, 3), 0..1, from that of no force to that of the largest push or pull."""
    none, push, pull = (np.array(drawing_rgb(f"force_{kind}")) for kind in ("none", "push", "pull"))
    share = np.clip(np.abs(force) / largest, 0.0, 1.0)[:, None]
    return np.asarray(none + share * (np.where(force[:, None] >= 0.0, push, pull) - none))


def arrow_solid() -> Any:
    """Meshcat's geometry of an arrow of unit length along +z from the origin: a shaft and a head."""
    from meshcat import geometry

    shaft, head, neck = (drawing_size(f"arrow.{what}") for what in ("shaft", "head", "neck"))
    profile = [(shaft, 0.0), (shaft, neck), (head, neck)]  # radius, height
    angles = 2.0 * math.pi * np.arange(CORNERS) / CORNERS
    rings = [[(r * math.cos(a), r * math.sin(a), z) for a in angles] for r, z in profile]
    points = np.array([point for ring in rings for point in ring] + [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
    foot, tip = len(points) - 2, len(points) - 1
    faces = []
    for k in range(CORNERS):
        n = (k + 1) % CORNERS
        faces += [(foot, n, k), (tip, 2 * CORNERS + k, 2 * CORNERS + n)]
        for low in (0, CORNERS):
            high = low + CORNERS
            faces += [(low + k, low + n, high + n), (low + k, high + n, high + k)]
    return geometry.TriangularMeshGeometry(points, faces)

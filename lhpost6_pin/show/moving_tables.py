"""Tables of moving parts as bodies: how masses are split, and where they differ from their lump."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..core.names import AXES
from ..machine.machine import Machine
from .report.page import Table
from .terminal import print_blocks

__all__ = ["limit_poses", "lump_table", "moving_parts_entries", "print_moving_parts", "split_table"]

Pose = tuple[str, tuple[float, ...]]
"""Words, and the displacement (6,) of C with Euler angles [m, rad]."""


def limit_poses(machine: Machine) -> list[Pose]:
    """The zero-position, and the limit of every axis alone."""
    sizes, units = machine.limits.displacement, ("m", "m", "m", "rad", "rad", "rad")
    limits = [(f"{axis} = {sizes[k]:.3g} {units[k]}", tuple(sizes[k] * np.eye(6)[k])) for k, axis in enumerate(AXES)]
    return [("zero-position", (0.0,) * 6), *limits]


def split_table(machine: Machine) -> Table:
    """Masses and lengths of rods and barrels by kind."""
    from ..mechanics.leg_bodies import leg_bodies

    by_kind = {c.kind: body for c, body in zip(machine.components, leg_bodies(machine), strict=True)}
    rows = [(kind, *(f"{value:.6g}" for value in body)) for kind, body in by_kind.items()]
    header = ("kind", "rod [kg]", "rod [m]", "barrel [kg]", "barrel [m]")
    return Table("Moving bodies of a leg whose lump in the zero-position is its mass along and across", header, rows)


def lump_table(machine: Machine, poses: Iterable[Pose]) -> Table:
    """Bodies less lump at some poses, with the share of every kind."""
    from ..mechanics.lump_comparison import compare_with_lump

    rows: list[Sequence[str]] = []
    for words, pose in poses:
        found = compare_with_lump(machine, pose)
        parts = [("all", found.inertia, found.weight)]
        if any(pose):
            parts += [(kind, one.inertia, one.weight) for kind, one in found.by_kind.items()]
        for kind, inertia, weight in parts:
            share = f"{100.0 * found.mass_share:.3f} %" if kind == "all" else ""
            values = (*np.diag(inertia)[:3], inertia[0, 2], inertia[2, 4], inertia[1, 5])
            cells = [f"{1e-3 * v + 0.0:.3f}" for v in values] + [f"{1e-3 * v + 0.0:.1f}" for v in weight[[2, 3, 4]]]
            rows.append((words if kind == "all" else "", kind, share, *cells))
    header = ("displaced", "of", "mass", "X [t]", "Y [t]", "Z [t]", "x-z [t]", "z-pitch [t m]", "y-yaw [t m]")
    return Table(
        "Moving parts as bodies less their lump: inertia at B, weight on the platen at C",
        (*header, "Fz [kN]", "Mx [kN m]", "My [kN m]"),
        rows,
    )


def print_moving_parts(machine: Machine) -> None:
    """Print how the moving parts are split, and their difference from the lump at the limits of the axes."""
    print_blocks(
        split_table(machine), *([lump_table(machine, limit_poses(machine))] if machine.motion == "free" else [])
    )


def moving_parts_entries(machine: Machine) -> dict[str, Any]:
    """The same for `--json`: `bodies` by component and `against_lump` by pose."""
    from ..mechanics.leg_bodies import leg_bodies
    from ..mechanics.lump_comparison import compare_with_lump

    bodies = {c.name: body._asdict() for c, body in zip(machine.components, leg_bodies(machine), strict=True)}
    poses = limit_poses(machine) if machine.motion == "free" else []
    compared = []
    for words, pose in poses:
        found = compare_with_lump(machine, pose)
        entry = {"at": words, "displacement": pose, "mass_share": found.mass_share}
        kinds = {kind: one.weight for kind, one in found.by_kind.items()}
        compared.append({**entry, "inertia": found.inertia, "weight": found.weight, "weight_by_kind": kinds})
    return {"moving_parts": {"bodies": bodies, "against_lump": compared}}

"""How far the shipped tables run beyond the peak of their target where strokes or displacements govern.

    python scripts/stroke_overshoot.py [--machine lhpost6] [--share 0.95] [--out DIR]

Triangles and sines along every free translation, the fastest of them with all flow that is left to it, take a share of
the stroke or of the stated displacement, whichever is less, and run with the machine's own controller; motions that
another limit ends before are left out. Prints the largest share of target and achieved motion, and the difference,
which `limits.stroke_reserve` of the machine files allows for. Writes stroke_overshoot.json.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.files import refuse_folder, write_whole
from lhpost6_pin.core.names import AXES, SAMPLE_RATE
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.mechanics.pose import PlatenMotion
from lhpost6_pin.motions import Target, find_motion, make_target, with_scale
from lhpost6_pin.simulation.motion_limits import judge_motion
from lhpost6_pin.simulation.rehearse import rehearse

MACHINES = ("lhpost6", "uniaxial", "biaxial", "hexapod")
OF_TRAVEL = ("displacement", "actuator stroke")
WAVES: tuple[tuple[str, dict[str, float]], ...] = (
    ("triangle", {"velocity": 0.1, "corner_acceleration": 1.0}),
    ("triangle", {"velocity": 0.1, "corner_acceleration": 10.0}),
    ("triangle", {"velocity": 0.25, "corner_acceleration": 3.0}),
    ("sine", {"period": 10.0}),
    ("sine", {"period": 5.0}),
    ("sine", {"period": 2.0}),
)
"""Kinds of motion with their options in SI; the second triangle turns within 20 ms."""

NEARLY = 0.99
"""Share of the flow left to a motion that the fastest sine takes."""


def shares(plant: Plant, motion: PlatenMotion) -> dict[str, float]:
    """Largest demand over the full capacity of a motion by quantity."""
    found: dict[str, float] = {}
    for peak in judge_motion(plant, motion).peaks:
        if peak.decides:
            found[peak.quantity] = max(peak.utilisation, found.get(peak.quantity, 0.0))
    return found


def of_travel(found: dict[str, float]) -> float:
    """The larger of the shares of strokes and stated displacements."""
    return max(found[quantity] for quantity in OF_TRAVEL)


def motion_of(target: Target) -> PlatenMotion:
    """The motion of a target."""
    return PlatenMotion(target.displacement, target.velocity, target.acceleration)


def taking(plant: Plant, share: float, kind: str, axis: str, options: dict[str, float]) -> Target:
    """A wave along an axis that takes a share of the travel."""
    motion = find_motion(kind, axis=axis, amplitude=plant.machine.limits.displacement[AXES.index(axis)], **options)
    target = make_target(motion, rate=float(SAMPLE_RATE))
    for _ in range(4):  # elongations are not quite linear in the motion
        factor = share / of_travel(shares(plant, motion_of(target)))
        target = with_scale(target, factor * target.reference.scale)
    return target


def fastest(plant: Plant, share: float, axis: str) -> dict[str, float]:
    """Period of the sine that takes a share of the travel and nearly all flow that is left to it."""
    used = shares(plant, motion_of(taking(plant, share, "sine", axis, {"period": 5.0})))
    flow = max(used["velocity"], used["actuator velocity"] / (1.0 - plant.machine.limits.valve_reserve))
    return {"period": 5.0 * flow / NEARLY}


def targets(plant: Plant, share: float) -> Iterator[tuple[str, Target]]:
    """Waves along the free translations that take a share of the travel, and no more than is left of another limit."""
    reserve = plant.machine.limits.valve_reserve
    for axis in (AXES[k] for k in plant.axes if k < 3):
        for kind, options in (*WAVES, ("sine", fastest(plant, share, axis))):
            target = taking(plant, share, kind, axis, options)
            used = shares(plant, motion_of(target))
            most = max(value for name, value in used.items() if name not in (*OF_TRAVEL, "actuator velocity"))
            if most < 1.0 and used["actuator velocity"] < 1.0 - reserve:
                words = ", ".join(f"{key} {value:.3g}" for key, value in options.items())
                yield f"{kind} {axis} ({words})", target


def study(machines: list[str], share: float | None) -> list[dict[str, Any]]:
    """Shares of target and achieved motion of every run; None leaves the reserve of the machine file."""
    rows = []
    for name in machines:
        machine = load_machine(name)
        plant, controller = make_plant(machine), load_controller(machine.controller)
        for motion, target in targets(plant, share or 1.0 - machine.limits.stroke_reserve):
            test = rehearse(machine, target, controller, attrs={"test": motion}, engine="fused", beyond_limits=True)
            moved = [test.record[f"platen_{what}"].values for what in ("displacement", "velocity", "acceleration")]
            wanted, achieved = shares(plant, motion_of(target)), shares(plant, PlatenMotion(*moved))
            excess = max(achieved[quantity] - wanted[quantity] for quantity in OF_TRAVEL)
            rows.append(
                {
                    "machine": name,
                    "motion": motion,
                    "target": of_travel(wanted),
                    "achieved": of_travel(achieved),
                    "overshoot": float(excess),
                    "trouble": test.run.trouble,
                }
            )
    return rows


def main(
    machine: Annotated[list[str] | None, typer.Option(help="Shipped machine; may be repeated. Default: all.")] = None,
    share: Annotated[
        float | None, typer.Option(help="Share of the travel that targets take; default: all but the reserve.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Directory of the results.")] = Path("out/stroke_overshoot"),
) -> None:
    """Print and write the overshoot over strokes and displacements."""
    refuse_folder(out)
    rows = study(machine or list(MACHINES), share)
    table = Table("machine", "motion", "target", "achieved", "overshoot", title="Shares of stroke or displacement")
    for row in rows:
        numbers = (f"{100 * row[key]:.3f} %" for key in ("target", "achieved", "overshoot"))
        table.add_row(row["machine"], row["motion"], *numbers)
    console = Console(width=110)
    console.print(table)
    for name in dict.fromkeys(row["machine"] for row in rows):
        most = max(row["overshoot"] for row in rows if row["machine"] == name)
        console.print(f"{name}: largest overshoot {100 * most:.2f} % of the travel")
    with write_whole(out / "stroke_overshoot.json") as path:
        path.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    typer.run(main)

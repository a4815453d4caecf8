"""Step halving for the three schemes, as the report did for its own: errors and orders of convergence.

    python scripts/convergence.py [--out DIR] [--seconds 4]

A six-axis open-loop test (spools of a closed-loop rehearsal) is run with each scheme from 1/2048 s to 1/65536 s and
held against RK4 at 1/131072 s. Prints displacement and pressure errors, the order between halvings, and whether the
default scheme at 1/2048 s is closer to converged than the report's Euler at 1/8192 s. Writes convergence.json. RK4
loses its order where friction reverses, a kink that no step size resolves.
"""

import json
import logging
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.files import refuse_folder, write_whole
from lhpost6_pin.core.names import AXES, SAMPLE_RATE, SCHEMES
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.mechanics.pose import platen_motion
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.rehearse import rehearse
from lhpost6_pin.simulation.simulate import OpenLoop, simulate

REFERENCE_STEPS = 64
"""Model steps a controller sample of the converged run."""


def errors(plant: Plant, drive: OpenLoop, scheme: str, steps: int, exact: np.ndarray) -> dict[str, float | str] | None:
    """Displacement RRMSE (worst axis) and largest chamber pressure error, or None if the run stopped."""
    samples = len(drive.spool)
    run = simulate(plant, drive, samples=samples, scheme=scheme, steps_per_second=steps * SAMPLE_RATE, engine="fused")
    if run.trouble:
        return None
    motion = platen_motion(plant, run.q, run.v, run.a)
    error = motion.displacement - exact[:, :6]
    pressures = [i for i, name in enumerate(plant.states) if "pressure" in name]
    ratio = np.sqrt(np.sum(error**2, 0) / np.sum(exact[:, :6] ** 2, 0))
    return {
        "displacement_rrmse": float(ratio.max()),
        "axis": AXES[int(ratio.argmax())],
        "pressure": float(np.abs(run.z[:, pressures] - exact[:, 6:]).max()),
    }


def study(seconds: float) -> dict[str, list[dict[str, float | int | str | None]]]:
    """Errors of all schemes and steps."""
    plant = make_plant(load_machine())
    target = make_target(find_motion("sfu-like"), rate=float(SAMPLE_RATE))
    test = rehearse(plant.machine, target, load_controller("lhpost6"), attrs={"test": "sfu-like"}, engine="fused")
    begin = int(np.argmax(np.abs(test.run.spool).max(1) > 0.02))
    samples = int(seconds * SAMPLE_RATE)
    drive = OpenLoop(test.run.spool[begin : begin + samples], find_equilibrium(plant).state)
    exact_run = simulate(
        plant, drive, samples=samples, scheme="rk4", steps_per_second=REFERENCE_STEPS * SAMPLE_RATE, engine="fused"
    )
    motion = platen_motion(plant, exact_run.q, exact_run.v, exact_run.a)
    pressures = [i for i, name in enumerate(plant.states) if "pressure" in name]
    exact = np.hstack([motion.displacement, exact_run.z[:, pressures]])
    found: dict[str, list[dict[str, float | int | str | None]]] = {}
    for scheme in SCHEMES:
        found[scheme] = []
        for steps in (1, 2, 4, 8, 16, 32):
            error = errors(plant, drive, scheme, steps, exact)
            found[scheme].append({"steps_per_second": steps * SAMPLE_RATE, **(error or {"displacement_rrmse": None})})
    return found


def show(found: dict[str, list[dict[str, float | int | str | None]]]) -> None:
    """Print the errors with the order between halvings."""
    console = Console(width=110)
    for scheme, rows in found.items():
        table = Table("steps a second", "displacement RRMSE", "axis", "order", "pressure error [Pa]", title=scheme)
        before = None
        for row in rows:
            error = row["displacement_rrmse"]
            order = "" if not (before and error) else f"{np.log2(before / error):.2f}"
            cells = ("stopped", "", "", "")
            if error is not None:
                cells = (f"{error:.2e}", str(row["axis"]), order, f"{row['pressure']:.3g}")
            table.add_row(str(row["steps_per_second"]), *cells)
            before = error
        console.print(table)
    default = found[SCHEMES[0]][0]["displacement_rrmse"]
    euler = found["euler"][2]["displacement_rrmse"]
    word = "diverged" if euler is None else f"{euler:.2e}"
    console.print(f"{SCHEMES[0]} at 1/2048 s: {default:.2e}; the report's euler at 1/8192 s: {word}")


def main(
    out: Annotated[Path | None, typer.Option(help="Folder for convergence.json.")] = None,
    seconds: Annotated[float, typer.Option(help="Length of the test.")] = 4.0,
) -> None:
    """Run the study, print it and keep it."""
    if out is not None:
        refuse_folder(out)
    logging.getLogger("lhpost6_pin").setLevel(logging.ERROR)  # runs that stop are rows of the table
    found = study(seconds)
    show(found)
    if out is not None:
        with write_whole(out / "convergence.json") as path:
            path.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    typer.run(main)

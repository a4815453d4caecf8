"""Uncertainty of a rehearsal: many machines with uncertain parameters, one motion.

    python scripts/example_6_uncertain_machine.py [MOTION] [--machines 30] [--scale 1] [--out DIR]

Every uncertain parameter is drawn from its prior, all runs are distributed over threads in compiled code, and each
result gets an interval and the parameters that it correlates with most.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
import xarray as xr
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from lhpost6_pin.cli import run_script
from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.core.files import write_whole
from lhpost6_pin.data.signals import rrmse
from lhpost6_pin.identification.calibration import drawn_coordinates, machine_parameters, with_parameters
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import PlatenMotion
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulate import ClosedLoop, simulate_many


def figures(record: xr.Dataset) -> dict[str, float]:
    """Results of a run."""
    target, achieved = record["reference_acceleration"].values, record["platen_acceleration"].values
    moved = target.any(axis=0)
    return {
        "acceleration RRMSE, worst axis [%]": 100 * float(rrmse(target[:, moved], achieved[:, moved]).max()),
        "largest actuator force [kN]": float(abs(record["actuator_force"]).max()) / 1e3,
        "largest spool [%]": 100 * float(abs(record["spool_position"]).max()),
        "highest chamber pressure [MPa]": float(record["chamber_pressure_a"].max()) / 1e6,
    }


def main(
    motion: Annotated[str, typer.Argument(help="Name; `lhpost6 motions` lists them.")] = "ridgecrest",
    machines: Annotated[int, typer.Option(min=4, help="Number of machines.")] = 30,
    scale: Annotated[float, typer.Option(help="Scale factor of the motion.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Seed of the random draws.")] = 1,
    out: Annotated[Path, typer.Option(help="Directory of drawn.csv: parameters and results.")] = Path("out/uncertain"),
) -> None:
    """Run MOTION on machines drawn from the priors of the LHPOST6."""
    nominal = load_machine("lhpost6")
    target = make_target(find_motion(motion), scale=scale)

    # 1. Machines: every number with a standard deviation is a parameter; identical components stay identical
    parameters = machine_parameters(nominal)
    rng = np.random.default_rng(seed)
    drawn = np.array([drawn_coordinates(parameters, rng) for _ in range(machines)])

    # 2. A controller with the same settings for each, at rest before the motion
    wanted = PlatenMotion(target.displacement, target.velocity, target.acceleration)
    jobs = []
    for coordinates in drawn:
        plant = make_plant(with_parameters(nominal, parameters, coordinates))
        rest = find_equilibrium(plant)
        controller = make_controller(plant, rest, load_controller(nominal.controller))
        jobs.append((plant, ClosedLoop(controller, controller.drive_for(*wanted), rest)))

    # 3. All runs at once; the order of results is that of the jobs, whatever the number of threads
    runs = simulate_many(jobs, samples=len(target.time))
    found = [figures(record_of_run(run, {"test": motion}, wanted)) for run in runs]

    # 4. An interval for each result, and its rank correlation with each parameter, if larger than the largest
    #    expected by chance among that many parameters
    chance = np.sqrt(2.0 * np.log(2.0 * len(parameters)) / machines)
    table = Table("result", "median", "5 to 95 %", "largest rank correlations")
    for name in found[0]:
        values = np.array([one[name] for one in found])
        low, middle, high = np.percentile(values, [5, 50, 95])
        ranks = np.argsort(np.argsort(np.column_stack([values, drawn]), axis=0), axis=0)
        with_value = np.corrcoef(ranks.T)[0, 1:]
        first = [k for k in np.argsort(-np.abs(with_value))[:2] if abs(with_value[k]) > chance]
        follows = ", ".join(f"{parameters[k].name} {with_value[k]:+.2f}" for k in first) or "none beyond chance"
        table.add_row(escape(name), f"{middle:.4g}", f"{low:.4g} to {high:.4g}", escape(follows))
    Console(width=120).print(table)

    # 5. All parameters and results as a table for other tools
    header = ",".join([*(f"{k.name} [{k.unit}]" for k in parameters), *found[0]])
    rows = [
        [*(k.at(x) for k, x in zip(parameters, coordinates, strict=True)), *one.values()]
        for coordinates, one in zip(drawn, found, strict=True)
    ]
    with write_whole(out / "drawn.csv") as beside:
        np.savetxt(beside, rows, "%.9g", ",", header=header, comments="")
    print(out / "drawn.csv")


if __name__ == "__main__":
    run_script(main)

"""Do calibrations find the truth, and are their intervals honest? Simulated campaigns of machines with wrong numbers.

    python scripts/calibration_study.py --seeds 50 --jobs 2

Each seed draws every uncertain number of the machine from its stated distribution (normal, cut at three standard
deviations, a chamber longer than its stroke), sensor errors within their ranges, and noise; simulates the campaign of
models/procedures/campaign.toml; and calibrates the nominal machine by it. It prints, pooled over parameters and seeds,
how often the 90 % interval holds the truth, and how far estimates are off in predicted deviations. About two minutes
a seed on one core.
"""

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.files import write_whole
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.identification.calibration import calibrate, drawn_coordinates, machine_parameters, with_parameters
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.simulation.simulated_campaign import simulate_campaign
from lhpost6_pin.studies.workers import results_of, workers

SIGMAS = 1.6448536269514722  # half width of a 90 % interval


def one_case(seed: int) -> dict[str, Any]:
    """Deviations of the estimates from the truth, in predicted ones, and predicted over prior ones."""
    machine, sensors = load_machine(), load_sensors()
    parameters = machine_parameters(machine)
    rng = np.random.default_rng([seed, 1])
    truth = drawn_coordinates(parameters, rng)
    turned = with_parameters(machine, parameters, truth)
    campaign = simulate_campaign(turned, load_controller("lhpost6"), sensors, seed=seed)
    found = calibrate(machine, campaign.records, sensors, seed=seed, jobs=1)
    count = len(parameters)
    return {
        "seed": seed,
        "off": ((found.estimate[:count] - truth) / found.sd[:count]).tolist(),
        "ratio": (found.sd / found.prior)[:count].tolist(),
        "misfit": np.nanmean(found.misfit_after, axis=0).tolist(),
        "converged": found.converged,
    }


def main(
    seeds: Annotated[int, typer.Option(min=1, help="Campaigns to calibrate by.")] = 50,
    first: Annotated[int, typer.Option(help="First seed.")] = 1,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
    dask: Annotated[str | None, typer.Option(help="Dask cluster in place of them: its address, or local.")] = None,
    out: Annotated[Path, typer.Option(help="Where the deviations are kept.")] = Path("out/calibration_study.json"),
) -> None:
    """Calibrate by simulated campaigns whose truth is known, and count how often the intervals hold it."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with workers(jobs, dask):
        cases = sorted(results_of(one_case, ((seed,) for seed in range(first, first + seeds))), key=lambda c: c["seed"])
    with write_whole(out) as beside:
        beside.write_text(json.dumps(cases, indent=1), encoding="utf-8")
    off = np.array([c["off"] for c in cases])
    told = np.array([c["ratio"] for c in cases]) < 0.5
    inside = np.abs(off) < SIGMAS
    parameters = machine_parameters(load_machine())
    table = Table("parameter", "90 % interval holds it", "rms deviation [predicted]", "predicted over prior")
    for i, parameter in enumerate(parameters):
        ratio = np.mean([c["ratio"][i] for c in cases])
        table.add_row(
            parameter.name, f"{inside[:, i].mean():.0%}", f"{np.sqrt(np.mean(off[:, i] ** 2)):.2f}", f"{ratio:.3f}"
        )
    console = Console()
    console.print(table)
    console.print(f"{len(cases)} campaigns, {sum(c['converged'] for c in cases)} converged")
    console.print(
        f"90 % intervals hold the truth: {inside.mean():.1%} of all, {inside[told].mean():.1%} of the informed"
    )
    console.print(f"informed parameters within three predicted deviations: {(np.abs(off[told]) < 3.0).mean():.1%}")
    console.print(
        f"mean square of whitened residuals (wrench, flow, gas, force): {np.mean([c['misfit'] for c in cases], 0)}"
    )


if __name__ == "__main__":
    typer.run(main)

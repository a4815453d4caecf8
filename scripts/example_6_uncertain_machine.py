"""Uncertainty of a rehearsal in Python: an ensemble of machines, and a result of one's own from its dataset.

    python scripts/example_6_uncertain_machine.py [MOTION] [--machines 64] [--scales 0.5,1,1.5] [--out DIR]

`lhpost6 ensemble` does the same with a report. Every uncertain number is drawn from its prior, the runs are distributed
over processes, and all results are in one labelled dataset.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from lhpost6_pin.cli import run_script
from lhpost6_pin.studies.ensemble import run_ensemble
from lhpost6_pin.studies.exceedance import critical_scales, exceedance
from lhpost6_pin.studies.importance import importances
from lhpost6_pin.studies.plan_file import plan_from
from lhpost6_pin.studies.store import open_results


def main(
    motion: Annotated[str, typer.Argument(help="Name; `lhpost6 motions` lists them.")] = "ridgecrest",
    machines: Annotated[int, typer.Option(min=4, help="Number of machines.")] = 64,
    scales: Annotated[str, typer.Option(help="Scale factors of the motion.")] = "0.5,1,1.5",
    seed: Annotated[int, typer.Option(help="Seed of the random draws.")] = 1,
    out: Annotated[Path, typer.Option(help="Directory of ensemble.nc.")] = Path("out/uncertain"),
) -> None:
    """Run MOTION on machines drawn from the priors of the LHPOST6."""
    # 1. The plan: entries as in a plan file; files that it names are relative to the folder
    factors = [float(word) for word in scales.split(",")]
    entries = {"machines": machines, "seed": seed, "scales": factors, "quantities": ["tracking", "limits", "forces"]}
    plan = plan_from({"name": motion, "motion": [{"name": motion}], **entries}, Path(), "example 6")

    # 2. All runs, over processes; interrupted, the same call goes on where it stopped
    path = run_ensemble(plan, out)
    with open_results(path) as results:
        runs = results.squeeze(["motion", "specimen", "controller"])  # left: scale, machine, and a result's own

        # 3. A result of one's own: the largest force of the horizontal actuators, by scale
        table = Table("scale", "largest horizontal force [kN], median", "5 to 95 %")
        horizontal = [name for name in runs["actuator"].values if str(name).startswith("H")]
        force = runs["peak_force"].sel(actuator=horizontal).max("actuator") / 1e3
        for scale in runs["scale"].values:
            low, middle, high = force.sel(scale=scale).quantile([0.05, 0.5, 0.95])
            table.add_row(f"{scale:g}", f"{float(middle):.4g}", f"{float(low):.4g} to {float(high):.4g}")
        Console(width=120).print(table)

        # 4. The risk of a saturated valve: demand over capacity (scale, machine) of the limit called spool
        critical = critical_scales(runs["limit_use"].sel(limit="spool").values, runs["scale"].values)
        spool = exceedance("spool", critical, runs["scale"].values, level=0.05, confidence=0.95)
        for scale, share in zip(runs["scale"].values, spool.share, strict=True):
            print(f"probability of a saturated valve at scale {scale:g}: {share:.0%}")

        # 5. What that force follows from: first-order Sobol indices, from 60 machines on
        names = [str(name) for name in runs["parameter"].values] if "parameter" in runs else []
        found = importances(names, runs["coordinate"].values, force.values[-1], plan.numbers)
        for one in found[:3]:
            print(f"{one.parameter} explains {one.first_order:.2f} of the variance; by chance up to {one.chance:.2f}")

        # 6. Anything else with xarray, such as a table for another program
        np.savetxt(out / "forces.csv", force.values.T, "%.9g", ",", header=scales, comments="")
    print(out / "forces.csv")


if __name__ == "__main__":
    run_script(main)

"""The Python interface end to end: an earthquake on the virtual table, its record and its report.

    python scripts/example_1_rehearse_earthquake.py [MOTION] [--scale 0.5] [--out DIR]

The steps of `lhpost6 run` in Python.
"""

from pathlib import Path
from typing import Annotated

import typer

from lhpost6_pin.cli import run_script
from lhpost6_pin.control import load_controller
from lhpost6_pin.core.names import AXES
from lhpost6_pin.data.records import save_record
from lhpost6_pin.data.signals import rrmse
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.report.run_report import write_run_report
from lhpost6_pin.simulation.energy import energy_audit
from lhpost6_pin.simulation.limit_use import plant_limits
from lhpost6_pin.simulation.rehearse import rehearse


def main(
    motion: Annotated[str, typer.Argument(help="Name; `lhpost6 motions` lists them.")] = "ridgecrest",
    scale: Annotated[float, typer.Option(help="Scale factor of the motion.")] = 1.0,
    out: Annotated[Path, typer.Option(help="Directory of record.nc and report.html.")] = Path("out/example"),
) -> None:
    """Rehearse MOTION and print the tracking errors."""
    # 1. The machine, a ground motion, and its target, sampled at the rate of the controller
    machine = load_machine("lhpost6")
    target = make_target(find_motion(motion), scale=scale)

    # 2. Closed loop from rest; a motion beyond the table's limits is refused with the scale that fits
    test = rehearse(machine, target, load_controller("lhpost6"), attrs={"test": motion}, engine="fused")

    # 3. The record has the layout of a measured one: an xarray.Dataset, written as netCDF
    save_record(test.record, out / "record.nc")

    # 4. The report: one HTML file
    summary = write_run_report(test.record, out / "report.html", limits=plant_limits(test.run.plant))

    # 5. The same from the arrays: error of the platen displacement against the target
    errors = rrmse(test.record["reference_displacement"], test.record["platen_displacement"])
    for axis, error, moves in zip(AXES, errors, target.displacement.any(axis=0), strict=True):
        if moves:
            print(f"{axis}: displacement RRMSE {100 * error:.2f} %")

    # 6. The energy balance
    audit = energy_audit(test.run)
    for kind in ("inflow", "stored", "dissipated"):
        print(f"energy {kind}: {audit.total(kind)[-1] / 1e3:.1f} kJ")
    created = audit.total("created")[-1] / 1e3
    print(f"energy created by terms of the report's equations that do not conserve it: {created:.1f} kJ")
    print(f"energy residual: {abs(audit.residual).max() / 1e3:.3f} kJ")

    # 7. The verdict, and the file of the report
    print(summary.verdict)
    print(summary.path)


if __name__ == "__main__":
    run_script(main)

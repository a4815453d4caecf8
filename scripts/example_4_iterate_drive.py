"""Iterate the drive of a motion: `lhpost6 iterate` in Python.

    python scripts/example_4_iterate_drive.py [MOTION] [--scale 1] [--machine lhpost6] [--most 3] [--out DIR]

The transfer function of the table is identified with white noise; its inverse gives the first drive, and every run
corrects it by the remaining error. The last step applies the inverse to another motion.
"""

from pathlib import Path
from typing import Annotated

import typer

from lhpost6_pin.cli import run_script
from lhpost6_pin.control import load_controller
from lhpost6_pin.core.names import AXES
from lhpost6_pin.data.records import sample_interval
from lhpost6_pin.data.signals import align, delay, rrmse
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.report.iterate_report import write_iterate_report
from lhpost6_pin.simulation.rehearse import rehearse
from lhpost6_pin.tuning.drives import circumstances, save_drive
from lhpost6_pin.tuning.iterate import identify_inverse, iterate


def main(
    motion: Annotated[str, typer.Argument(help="Name; `lhpost6 motions` lists them.")] = "ridgecrest",
    scale: Annotated[float, typer.Option(help="Scale factor of the motion.")] = 1.0,
    machine: Annotated[str, typer.Option(help="Machine file, by shipped name or path.")] = "lhpost6",
    most: Annotated[int, typer.Option(help="Iterations.")] = 3,
    out: Annotated[Path, typer.Option(help="Directory of drive.nc and report.html.")] = Path("out/iterated"),
) -> None:
    """Iterate on MOTION, and apply the inverse to another one."""
    table = load_machine(machine)
    settings = load_controller(table.controller)
    axes = table.motion if table.motion in AXES else "xyz"
    target = make_target(find_motion(motion), scale=scale, axes=axes)

    # 1. The measured table response, and its inverse
    known = identify_inverse(table, settings)
    print(f"delay of the table: {1e3 * known.delay:.1f} ms")

    # 2. Runs, each corrected by the error of the last one; the best one is kept
    found = iterate(table, target, settings, table=known, most=most)
    for run in found.history:
        errors = ", ".join(f"{axis} {100 * e:.2f} %" for axis, e in zip(AXES, run.acceleration, strict=True) if e == e)
        print(f"iteration {run.number}: acceleration RRMSE {errors}{' (best)' if run.number == found.best else ''}")

    # 3. The drive; it is refused with another machine, specimen or controller
    save_drive(found.drive, settings.mode, target, out / "drive.nc", circumstances(table, settings.name))
    print(write_iterate_report(found, out / "report.html"))

    # 4. Another motion, conditioned by the inverse alone
    other = make_target(find_motion("sine", amplitude=0.02, period=0.5), axes=axes)
    for name, inverse in (("without inverse", None), ("with inverse", known.inverse)):
        record = rehearse(table, other, settings, attrs={"test": name}, inverse=inverse, engine="fused").record
        moved = other.displacement.any(axis=0)
        wanted, achieved = (record[f"{who}_acceleration"].values[:, moved] for who in ("reference", "platen"))
        step = sample_interval(record)
        error = rrmse(wanted, align(achieved, delay(wanted, achieved, step), step))
        print(f"sine, drive {name}: acceleration RRMSE {100 * error.max():.2f} %, delay removed")


if __name__ == "__main__":
    run_script(main)

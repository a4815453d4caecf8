"""Iterate on a motion until the table does what is wanted: what `lhpost6 iterate` does, with the Python interface.

    python scripts/example_4_iterate_drive.py [MOTION] [--scale 1] [--machine lhpost6] [--most 3] [--out DIR]

White noise shows the table's transfer function; its inverse makes the first drive, and every run corrects it by what
was missed. The inverse serves for other motions, too, as the last step shows.
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
from lhpost6_pin.show.report import write_iterate_report
from lhpost6_pin.simulation.rehearse import rehearse
from lhpost6_pin.tuning.drives import circumstances, save_drive
from lhpost6_pin.tuning.iterate import identify_inverse, iterate


def main(
    motion: Annotated[str, typer.Argument(help="Name, as `lhpost6 motions` lists them.")] = "ridgecrest",
    scale: Annotated[float, typer.Option(help="Factor on the motion.")] = 1.0,
    machine: Annotated[str, typer.Option(help="Machine file, by shipped name or path.")] = "lhpost6",
    most: Annotated[int, typer.Option(help="Iterations.")] = 3,
    out: Annotated[Path, typer.Option(help="Folder for drive.nc and report.html.")] = Path("out/iterated"),
) -> None:
    """Iterate on MOTION, and use the inverse for another one."""
    table = load_machine(machine)
    settings = load_controller(table.controller)
    axes = table.motion if table.motion in AXES else "xyz"
    target = make_target(find_motion(motion), scale=scale, axes=axes)

    # 1. The table as white noise shows it, and the filter that undoes it
    known = identify_inverse(table, settings)
    print(f"delay that the table has anyway: {1e3 * known.delay:.1f} ms")

    # 2. Runs, each corrected by what the last one missed; the best counts
    found = iterate(table, target, settings, table=known, most=most)
    for run in found.history:
        errors = ", ".join(f"{axis} {100 * e:.2f} %" for axis, e in zip(AXES, run.acceleration, strict=True) if e == e)
        print(f"iteration {run.number}: acceleration RRMSE {errors}{' (best)' if run.number == found.best else ''}")

    # 3. The drive with what it holds for: it is refused on another machine, specimen or controller
    save_drive(found.drive, settings.mode, target, out / "drive.nc", circumstances(table, settings.name))
    print(write_iterate_report(found, out / "report.html"))

    # 4. Another motion, conditioned by the inverse alone
    other = make_target(find_motion("sine", amplitude=0.02, period=0.5), axes=axes)
    for name, inverse in (("as it is", None), ("with the inverse", known.inverse)):
        record = rehearse(table, other, settings, attrs={"test": name}, inverse=inverse, engine="fused").record
        moved = other.displacement.any(axis=0)
        asked, achieved = (record[f"{who}_acceleration"].values[:, moved] for who in ("reference", "platen"))
        step = sample_interval(record)
        error = rrmse(asked, align(achieved, delay(asked, achieved, step), step))
        print(f"sine, drive {name}: acceleration RRMSE {100 * error.max():.2f} %, the delay removed")


if __name__ == "__main__":
    run_script(main)

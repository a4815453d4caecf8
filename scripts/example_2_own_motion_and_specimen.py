"""A motion of your own and a specimen: whether it fits, and what the specimen does to the table.

    python scripts/example_2_own_motion_and_specimen.py [FILE...] [--specimen pendulum] [--scale 1] [--out DIR]

FILE is a ground motion (PEER .AT2, COSMOS V1, CSV), or three of them for x, y and z. Without one a pulse is written as
CSV, to see what such a file looks like. The table runs it bare and loaded; an animation lays one over the other.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
import xarray as xr

from lhpost6_pin.cli import run_script
from lhpost6_pin.control import load_controller
from lhpost6_pin.core.files import write_whole
from lhpost6_pin.data.records import save_record
from lhpost6_pin.data.signals import rrmse
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import Target, load_motion, make_target
from lhpost6_pin.show.viewer import Look, show_record
from lhpost6_pin.simulation.rehearse import rehearse, target_within_limits


def write_pulse(path: Path) -> Path:
    """A pulse of 1 Hz and 3 m/s2 in x and 0.9 m/s2 in z: a time column, and a column with its unit for each axis."""
    time = np.arange(0.0, 4.0, 0.005)
    x = 3.0 * np.sin(2 * np.pi * (time - 2.0)) * np.exp(-((2.0 * (time - 2.0)) ** 2))
    with write_whole(path) as beside:
        np.savetxt(beside, np.column_stack([time, x, 0.3 * x]), "%.6g", ",", header="time_s,x_m_s2,z_m_s2", comments="")
    return path


def what_it_needs(machine: Machine, target: Target) -> None:
    """Say how much of each limit a target takes; more than there is raises an error that says the scale that fits."""
    needs = target_within_limits(make_plant(machine), target)
    for what, share in needs.utilisation.items():
        most = max(share, key=lambda name: share[name])
        print(f"{what}: {100 * share[most]:.0f} % of what {most} has")


def main(
    files: Annotated[list[Path] | None, typer.Argument(help="Ground motion; else a pulse is made.")] = None,
    specimen: Annotated[str, typer.Option(help="URDF file, or the shipped pendulum.")] = "pendulum",
    scale: Annotated[float, typer.Option(help="Factor on the motion.")] = 1.0,
    out: Annotated[Path, typer.Option(help="Folder for records and animation.")] = Path("out/own"),
) -> None:
    """Run FILE on the bare table and under a specimen."""
    # 1. The motion: accelerations or displacements, whichever the file holds, become a target that starts at rest
    motion = load_motion(files or [write_pulse(out / "pulse.csv")])
    target = make_target(motion, scale=scale)

    # 2. The specimen stands at C with its joints locked; position, orientation and free joints are options
    bare = load_machine("lhpost6")
    loaded = bare.with_specimen(specimen, position=(0.0, 0.0, 0.0), locked=True)
    what_it_needs(loaded, target)

    # 3. The same controller with and without it: a panel tuned on the bare table is a start for a loaded one
    records: dict[str, xr.Dataset] = {}
    for name, machine in (("bare", bare), ("loaded", loaded)):
        facts = {"test": name, "title": f"{motion.name}, {name}"}
        record = rehearse(machine, target, load_controller("lhpost6"), attrs=facts, engine="fused").record
        save_record(record, out / f"{name}.nc")
        moved = target.displacement.any(axis=0)
        error = rrmse(*(record[f"{who}_acceleration"].values[:, moved] for who in ("reference", "platen")))
        force = abs(record["actuator_force"]).max("time")
        strongest = force.idxmax().item()
        print(
            f"{name}: acceleration RRMSE {100 * error.max():.1f} % at worst; largest force {force.max() / 1e3:.0f} kN "
            f"({strongest}), largest spool {100 * abs(record['spool_position']).max():.0f} %"
        )
        records[name] = record

    # 4. The loaded table, and the bare one as an outline that differs ten times as much as it does
    picture = show_record(loaded, records["loaded"], [records["bare"]], Look(gap=10.0))
    picture.save(out / "view.html")
    print(out / "view.html")


if __name__ == "__main__":
    run_script(main)

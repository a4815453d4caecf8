"""A motion of your own and a specimen: the limits, and the effect of the specimen on the table.

    python scripts/example_2_own_motion_and_specimen.py [FILE...] [--specimen shear_frame] [--scale 1] [--out DIR]

FILE is a ground motion (PEER .AT2, COSMOS V1, CSV), or three of them for x, y and z. Without one a pulse is written
as an example of a CSV file. The table runs it bare and loaded; an animation overlays both.
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
from lhpost6_pin.simulation.motion_limits import check_motion_limits
from lhpost6_pin.simulation.rehearse import rehearse


def write_pulse(path: Path) -> Path:
    """A pulse of 1 Hz and 3 m/s2 in x and 0.9 m/s2 in z: a time column, and a column with its unit for each axis."""
    time = np.arange(0.0, 4.0, 0.005)
    x = 3.0 * np.sin(2 * np.pi * (time - 2.0)) * np.exp(-((2.0 * (time - 2.0)) ** 2))
    with write_whole(path) as beside:
        np.savetxt(beside, np.column_stack([time, x, 0.3 * x]), "%.6g", ",", header="time_s,x_m_s2,z_m_s2", comments="")
    return path


def print_demand(machine: Machine, target: Target) -> None:
    """Print demand over capacity of a target; beyond one, an error with the scale that fits is raised."""
    checked = check_motion_limits(make_plant(machine), target)
    for quantity, demand in checked.utilisation.items():
        governing = max(demand, key=lambda name: demand[name])
        print(f"{quantity}: {100 * demand[governing]:.0f} % of capacity ({governing})")


def main(
    files: Annotated[list[Path] | None, typer.Argument(help="Ground motion; default: a generated pulse.")] = None,
    specimen: Annotated[str, typer.Option(help="URDF or TOML file, or a shipped specimen.")] = "shear_frame",
    scale: Annotated[float, typer.Option(help="Scale factor of the motion.")] = 1.0,
    out: Annotated[Path, typer.Option(help="Directory of records and animation.")] = Path("out/own"),
) -> None:
    """Run FILE on the bare table and with a specimen."""
    # 1. The motion, from accelerations or displacements, becomes a target that starts at rest
    motion = load_motion(files or [write_pulse(out / "pulse.csv")])
    target = make_target(motion, scale=scale)

    # 2. The specimen stands at C, locked: the shear frame as a rigid body of 65 t; place and free joints are options
    bare = load_machine("lhpost6")
    loaded = bare.with_specimen(specimen, position=(0.0, 0.0, 0.0), locked=True)
    print_demand(loaded, target)

    # 3. The same controller with and without it: settings tuned on the bare table are initial values for a loaded one
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

    # 4. The loaded table, and the bare one as an outline with tenfold deviation
    picture = show_record(loaded, records["loaded"], [records["bare"]], Look(gap=10.0))
    picture.save(out / "view.html")
    print(out / "view.html")


if __name__ == "__main__":
    run_script(main)

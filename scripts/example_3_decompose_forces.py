"""Force decomposition of a test by inverse dynamics: `lhpost6 decompose` in Python.

    python scripts/example_3_decompose_forces.py [RECORD] [--out DIR]

Without a record it simulates one with sensor noise: a triangular wave in x, of the kind of test TX5.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
import xarray as xr

from lhpost6_pin.cli import run_script
from lhpost6_pin.control import load_controller
from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.sensors import add_noise, load_sensors
from lhpost6_pin.identification.decompose import decompose_record, find_agreement, find_work, save_ledger
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.report.decompose_report import write_decompose_report
from lhpost6_pin.show.result_tables import print_agreement
from lhpost6_pin.simulation.rehearse import rehearse


def triangular_test(machine: Machine) -> xr.Dataset:
    """A triangular wave in x with sensor noise."""
    wave = find_motion("triangle", amplitude=0.2, velocity=0.25, axis="x")
    facts = {"test": "TX", "title": "Triangular wave in x, simulated"}
    test = rehearse(machine, make_target(wave), load_controller("lhpost6"), attrs=facts, record_every=4, engine="fused")
    return add_noise(test.record, load_sensors(), np.random.default_rng(0))


def main(
    record: Annotated[Path | None, typer.Argument(help="Record of a test; default: a simulated one.")] = None,
    out: Annotated[Path, typer.Option(help="Directory of ledger.nc and report.html.")] = Path("out/forces"),
) -> None:
    """Decompose RECORD, print the agreement with the model, and draw the six rows of Section 6.1."""
    machine = load_machine("lhpost6")
    test = load_record(record) if record else triangular_test(machine)

    # 1. Motion from all sensors, forces from the motion, in the band of the comparison
    found = decompose_record(machine, test)

    # 2. Errors by axis, and the residual against noise, calibration errors and uncertain parameters
    agreement = find_agreement(found)
    print_agreement(found, agreement)

    # 3. From the arrays: the energy of every effect, dry friction among them
    work = find_work(found)
    for effect, energy in zip(work.effects, work.energy[-1], strict=True):
        print(f"{effect}: {energy / 1e3:+.2f} kJ into the platen")

    # 4. The ledger as netCDF, and the report with the plots
    save_ledger(found, out / "ledger.nc", work)
    print(write_decompose_report(found, agreement, work, out / "report.html"))


if __name__ == "__main__":
    run_script(main)

"""Is the interface wrench of a decomposition right, and are its intervals honest? Simulated tests with a specimen.

    python scripts/interface_study.py --seeds 50 --jobs 2

A rigid specimen of 50 t whose centre is 2.5 m above the platen rides on the table through half of Ridgecrest, in closed
loop. `known`: the bare table's numbers and the sensors' calibration are exact, and noise is drawn per seed. `priors`:
each seed draws the uncertain numbers of the bare table from their stated distributions, and gains, offsets and skews of
the sensors within their ranges; the nominal machine decomposes the test. Printed are RMS errors of the components, as
such and relative to their true RMS, and how often the 90 % interval holds the truth, over all samples and at the true
peaks. Noise does not depend on the motion: the relative error of `known` is in inverse proportion to the wrench.
"""

import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table

from lhpost6_pin.control import controlled, load_controller
from lhpost6_pin.core.files import write_whole
from lhpost6_pin.data.sensors import SensorSet, load_sensors
from lhpost6_pin.identification.calibration import drawn_coordinates, machine_parameters, with_parameters
from lhpost6_pin.identification.decompose import decompose_record, find_agreement
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.interface_wrench import INTERFACE_AXES
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulate import ClosedLoop, simulate
from lhpost6_pin.simulation.simulated_campaign import SensorErrors, as_sensed, draw_errors

SECONDS = (20.0, 34.0)  # of Ridgecrest: its strong part
BLOCK = """<robot name="block"><link name="block"><inertial><origin xyz="0 0 2.5"/><mass value="50000"/>
<inertia ixx="150000" iyy="150000" izz="100000" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


def exact(machine: Machine) -> Machine:
    """The machine without standard deviations of its numbers."""
    known = {path: replace(q, sd=None) for path, q in machine.parameters.quantities.items()}
    return replace(machine, parameters=replace(machine.parameters, quantities=known))


def without_errors(sensors: SensorSet) -> SensorSet:
    """Sensors whose calibration is known."""
    return replace(sensors, gain_range={}, offset_range={}, delay_range={})


def one_case(seed: int, kind: str, block: str) -> dict[str, Any]:
    """Errors of the components over their RMS, coverage over all samples, and at the true peaks."""
    machine, sensors = load_machine(), load_sensors()
    rng = np.random.default_rng([seed, 7])
    truth = machine
    if kind == "known":
        machine, sensors = exact(machine), without_errors(sensors)
    else:
        parameters = machine_parameters(machine)
        truth = with_parameters(machine, parameters, drawn_coordinates(parameters, rng))
    table = truth.with_specimen(block)
    plant, rest, controller = controlled(table, load_controller("lhpost6"))
    target = make_target(find_motion("ridgecrest"), scale=0.5)
    drive = controller.drive_for(target.displacement, target.velocity, target.acceleration)
    first, last = (round(2048 * t) for t in SECONDS)
    run = simulate(plant, ClosedLoop(controller, np.ascontiguousarray(drive[first:last]), rest), samples=last - first,
                   engine="fused")  # fmt: skip
    record = record_of_run(run, {"test": "ridgecrest", "title": "Ridgecrest with a block"})
    errors = SensorErrors({}, {}, {}) if kind == "known" else draw_errors(record, sensors, rng)
    measured = as_sensed(record, sensors, errors, 512.0, rng)
    found = decompose_record(machine.with_specimen(block), measured, sensors)
    interface = find_agreement(found, seed=seed).interface
    assert interface is not None
    band = found.comparison.band
    true = band.apply(record["specimen_wrench"].values, 1 / 2048)[:: 2048 // 512][found.inside]
    off = interface.wrench - true
    peaks = np.argmax(np.abs(true), axis=0)
    at = peaks, np.arange(6)
    return {
        "rms": np.sqrt(np.mean(off**2, axis=0)).tolist(),
        "error": (np.sqrt(np.mean(off**2, axis=0)) / np.sqrt(np.mean(true**2, axis=0))).tolist(),
        "varying": (off.std(axis=0) / true.std(axis=0)).tolist(),
        "inside": (np.abs(off) <= interface.half_width).mean(axis=0).tolist(),
        "peak_inside": (np.abs(off[at]) <= interface.half_width[at]).tolist(),
    }


def main(
    seeds: Annotated[int, typer.Option(min=1, help="Tests of each kind.")] = 50,
    first: Annotated[int, typer.Option(help="First seed.")] = 1,
    kinds: Annotated[str, typer.Option(help="Kinds, of known,priors.")] = "known,priors",
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
    out: Annotated[Path, typer.Option(help="Where the figures are kept.")] = Path("out/interface_study.json"),
) -> None:
    """Decompose simulated tests whose interface wrench is known."""
    out.parent.mkdir(parents=True, exist_ok=True)
    console, kept = Console(), {}
    with tempfile.TemporaryDirectory() as folder:
        block = Path(folder) / "block.urdf"
        block.write_text(BLOCK)
        for kind in kinds.split(","):
            jobs_of = (delayed(one_case)(seed, kind, str(block)) for seed in range(first, first + seeds))
            cases = kept[kind] = list(Parallel(n_jobs=jobs)(jobs_of))
            keys = ("rms", "error", "varying", "inside", "peak_inside")
            rms, error, varying, inside, peaks = (np.array([case[key] for case in cases], float) for key in keys)
            heads = ("RMS error", "relative", "mean removed", "inside, samples", "inside, peaks")
            table = Table("Component", *heads, title=kind)
            for j, name in enumerate(INTERFACE_AXES):
                columns = (np.median(error[:, j]), np.median(varying[:, j]), inside[:, j].mean(), peaks[:, j].mean())
                size = f"{np.median(rms[:, j]) / 1e3:.2f} {'kN' if j < 3 else 'kN m'}"
                table.add_row(name, size, *(f"{100 * x:.2f} %" for x in columns))
            table.add_row("all", "", "", "", f"{100 * inside.mean():.1f} %", f"{100 * peaks.mean():.1f} %")
            console.print(table)
    with write_whole(out) as beside:
        beside.write_text(json.dumps(kept, indent=1), encoding="utf-8")


if __name__ == "__main__":
    from lhpost6_pin.cli.app import run_script

    run_script(main)

"""The table as an FMU, run by FMPy, beside the same plant run here: how far they are apart.

    python scripts/fmu_round_trip.py [--seconds 2] [--out DIR]

Needs `pip install pythonfmu==0.7.0 fmpy`. Both take the same spool commands, a sine per actuator.
"""

import time
from pathlib import Path
from typing import Annotated

import fmpy
import numpy as np
import typer

from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.interfaces.fmi import export_fmu
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.simulation.running import RunningPlant


def main(
    seconds: Annotated[float, typer.Option(help=r"Length of the test \[s].")] = 2.0,
    out: Annotated[Path, typer.Option(help="Folder for the FMU.")] = Path("out/fmu"),
) -> None:
    """Export the nominal table, drive it through FMPy, and print the largest difference of each kind of output."""
    machine = load_machine("lhpost6")
    names = machine.actuator_names
    fmu = out / "lhpost6.fmu"
    export_fmu(machine, fmu)

    # Spool commands (n, n_actuators): what feeds the leaks, and a sine on top
    plant = make_plant(machine)
    rest = find_equilibrium(plant)
    n = round(seconds * SAMPLE_RATE)
    t = np.arange(n + 1) / SAMPLE_RATE
    size = np.where(np.char.startswith(names, "H"), 0.1, 0.02)
    spool = rest.spool + size * np.sin(2 * np.pi * np.outer(t, np.linspace(2.0, 5.0, len(names))))

    # By FMPy
    inputs = np.rec.fromarrays([t, *spool.T], names=["time", *(f"spool_command_{name}" for name in names)])
    begin = time.perf_counter()
    by_fmpy = fmpy.simulate_fmu(str(fmu), stop_time=n / SAMPLE_RATE, output_interval=1 / SAMPLE_RATE, input=inputs)
    print(f"{seconds:g} s through FMPy in {time.perf_counter() - begin:.2f} s")

    # Here
    table = RunningPlant(plant, rest)
    sensors = [table.sensors()]
    for command in spool[:-1]:
        table.advance(command)
        sensors.append(table.sensors())
    for channel, label, unit in (
        ("displacement", "actuator_displacement", "m"),
        ("force", "actuator_force", "N"),
        ("acceleration", "platen_acceleration", "m/s2, rad/s2"),
    ):
        ours = np.array([getattr(s, channel) for s in sensors])
        theirs = np.column_stack([by_fmpy[name] for name in by_fmpy.dtype.names if name.startswith(label)])
        print(f"{label}: up to {np.abs(ours).max():.4g}, apart by {np.abs(ours - theirs).max():.3g} {unit}")


if __name__ == "__main__":
    typer.run(main)

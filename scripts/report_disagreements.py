"""The report's three disagreements between model and table, each hidden in simulated tests, found, named and closed.

    python scripts/report_disagreements.py [NAME ...] [--out DIR]

drift      displacement drifts in open loop: spools that stand off their hydraulic null
offset     constant vertical force, roll and pitch moment: the weight is not that of the inertia
resonance  the oil column is too sharp in the model: pistons leak more than modelled

A machine with the effect runs a campaign under the virtual 469D and is seen through sensors with their errors; the
search knows the machine without it. Each example leaves verdict.json, model.toml and report.html in its folder.
"""

from pathlib import Path
from typing import Annotated

import typer

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import UnknownNameError
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.discovery import discover
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.show.report.discover_report import save_discovery
from lhpost6_pin.show.result_tables import print_discovery
from lhpost6_pin.simulation.simulated_campaign import simulate_campaign

HORIZONTAL = ("H1", "H2", "H3", "H4")
EXAMPLES = {
    "drift": ("spool_null_bias", HORIZONTAL, {"bias": 0.003}),
    "offset": ("gravity_offset", (), {"mass": 2.5e4, "moment_x": 2e4, "moment_y": -1.2e4}),
    "resonance": ("piston_leakage", HORIZONTAL, {"leakage": 2.5e-10}),
}
"""Name: family, components and numbers of what is hidden."""


def main(
    names: Annotated[list[str] | None, typer.Argument(help=f"Of {', '.join(EXAMPLES)}; all unless given.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for verdicts, models and reports.")] = Path("out/disagreements"),
    seed: Annotated[int, typer.Option(help="Of the sensors' errors and noise.")] = 5,
) -> None:
    """Hide, find and close each disagreement."""
    machine, sensors = load_machine(), load_sensors()
    for name in names or list(EXAMPLES):
        if name not in EXAMPLES:
            raise UnknownNameError("example", name, list(EXAMPLES))
        family, components, numbers = EXAMPLES[name]
        hidden = machine.with_effect(family, components, **numbers)
        tests = simulate_campaign(hidden, load_controller("lhpost6"), sensors, seed=seed, name=name)
        found = discover(machine, tests, sensors, hold_out=["EQ"], phases=(1, 2), seed=seed)
        typer.echo(f"{name}: hidden is {family}, {', '.join(f'{key} = {value:g}' for key, value in numbers.items())}")
        print_discovery(found)
        folder = out / name
        folder.mkdir(parents=True, exist_ok=True)
        *_, report = save_discovery(found, folder, f"found in example {name}")
        typer.echo(f"wrote {report}")


if __name__ == "__main__":
    typer.run(main)

"""Hide a suspected effect and identify it: a trial of discovery before measured data are used.

    python scripts/example_7_find_missing_effect.py [FAMILY] [--on COMPONENT] [--size 1] [--out DIR]

FAMILY is one of the library (`models/library/`). A table with this effect, of typical size, runs the short tests of
`lhpost6 demo`; the search knows the table without it and holds out the earthquake: `lhpost6 discover` in Python.
"""

from pathlib import Path
from typing import Annotated

import typer

from lhpost6_pin.cli import run_script
from lhpost6_pin.control import load_controller
from lhpost6_pin.data.campaign import save_campaign
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.discovery import discover
from lhpost6_pin.machine.library import find_family
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.show.report.discover_report import save_discovery
from lhpost6_pin.show.result_tables import print_discovery
from lhpost6_pin.simulation.simulated_campaign import simulate_campaign


def main(
    family: Annotated[str, typer.Argument(help="Name of a family of effects.")] = "bearing_thrust_direction",
    on: Annotated[list[str] | None, typer.Option(help="Component, repeatable; default: all possible ones.")] = None,
    size: Annotated[float, typer.Option(help="Factor on its typical size.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Seed of sensor noise and sensor errors.")] = 3,
    out: Annotated[Path, typer.Option(help="Directory of records, report and model.")] = Path("out/found"),
) -> None:
    """Hide FAMILY in simulated measurements and identify it."""
    machine, sensors = load_machine("lhpost6"), load_sensors()

    # 1. The true table, unknown to the search
    known = find_family(family)
    numbers = {shape.name: shape.typical * (size if shape.amplitude else 1.0) for shape in known.shapes}
    on = on or list(known.components(machine))
    table = machine.with_effect(family, on, name="", **numbers)
    print(f"hidden: {known.title} on {', '.join(on)}: {', '.join(f'{k} {v:g}' for k, v in numbers.items())}")

    # 2. Its records, with sensor noise, gains, offsets and skews
    settings = load_controller(machine.controller)
    tests = simulate_campaign(table, settings, sensors, seed=seed, name=f"{family} hidden", procedure="demo")
    save_campaign(tests, out / "measured")

    # 3. The search, and the held-out test: inverse dynamics and open loop
    found = discover(machine, tests, sensors, hold_out=["EQ"], phases=(1, 2), seed=seed)
    print_discovery(found)

    # 4. verdict.json, model.toml (for --machine in any command) and report.html
    for path in save_discovery(found, out, f"{machine.name} with the identified effects"):
        print(path)


if __name__ == "__main__":
    run_script(main)

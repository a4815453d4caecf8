"""Hide an effect that you suspect, search, and see the gap shrink: a trial of the search before it gets your data.

    python scripts/example_7_find_missing_effect.py [FAMILY] [--on COMPONENT] [--size 1] [--out DIR]

FAMILY is one of the library (`models/library/`). A table that has it, of its typical size, runs the short tests of
`lhpost6 demo`; the search knows the table without it and keeps the earthquake for the proof: what `lhpost6 discover`
does, with the Python interface.
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
from lhpost6_pin.show.discovery_table import print_discovery
from lhpost6_pin.show.report.discover_report import save_discovery
from lhpost6_pin.simulation.simulated_campaign import simulate_campaign


def main(
    family: Annotated[str, typer.Argument(help="Name of a family of effects.")] = "bearing_thrust_direction",
    on: Annotated[list[str] | None, typer.Option(help="Component; again for more; else all that can have it.")] = None,
    size: Annotated[float, typer.Option(help="Times its typical size.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Of noise and errors of the sensors.")] = 3,
    out: Annotated[Path, typer.Option(help="Folder for the records, the report and the model.")] = Path("out/found"),
) -> None:
    """Hide FAMILY in simulated measurements, and search them."""
    machine, sensors = load_machine("lhpost6"), load_sensors()

    # 1. The table as it is, which the search will not be told
    known = find_family(family)
    numbers = {shape.name: shape.typical * (size if shape.amplitude else 1.0) for shape in known.shapes}
    on = on or list(known.components(machine))
    table = machine.with_effect(family, on, name="", **numbers)
    print(f"hidden: {known.title} on {', '.join(on)}: {', '.join(f'{k} {v:g}' for k, v in numbers.items())}")

    # 2. What its sensors record, with noise, gains, offsets and skews
    settings = load_controller(machine.controller)
    tests = simulate_campaign(table, settings, sensors, seed=seed, name=f"{family} hidden", procedure="demo")
    save_campaign(tests, out / "measured")

    # 3. The search, and the proof on the test that was not searched: inverse dynamics and open loop
    found = discover(machine, tests, sensors, hold_out=["EQ"], phases=(1, 2), seed=seed)
    print_discovery(found)

    # 4. verdict.json, model.toml (for --machine in any command) and report.html
    for path in save_discovery(found, out, f"{machine.name} with what was found"):
        print(path)


if __name__ == "__main__":
    run_script(main)

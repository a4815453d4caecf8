"""Moving parts of the legs as bodies: against their lump over the range of motion, and what they cost.

    python scripts/moving_parts.py [--out DIR] [--seconds 2]

Prints how Table 4.1 is split into rods and barrels, inertia and weight less those of the lump, the constant vertical
force that the split explains for other lengths of rods and barrels, and microseconds of a step and of the forward
dynamics alone: ABA of the lump, projection on Pinocchio, and Pinocchio's constrained dynamics of legs on swivels.
Writes moving_parts.json. Times are processor time, the best of several repeats; ratios within one run are what counts.
"""

import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
import typer
from rich.console import Console

from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.core.files import refuse_folder, write_whole
from lhpost6_pin.core.names import ENGINES, SAMPLE_RATE
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.leg_model import LegModel, make_dynamics, make_leg_model
from lhpost6_pin.mechanics.lump_comparison import compare_with_lump
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.tables import unpack_tables
from lhpost6_pin.show.moving_tables import limit_poses, lump_table, split_table
from lhpost6_pin.show.report.page import Table
from lhpost6_pin.show.terminal import print_blocks
from lhpost6_pin.simulation.simulate import OpenLoop, simulate

LENGTHS = ((2.5, 2.5), (3.0, 2.5), (3.0, 3.5), (3.8, 2.9), (4.4, 2.5), (4.4, 3.5))
"""Lengths of rod and barrel [m] of the horizontal actuators: from a short rod to one that leaves the barrel's end."""


def best(work: Callable[[], Any], repeats: int) -> float:
    """Seconds of processor time of the fastest of some repeats."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def constrained(machine: Machine) -> tuple[Any, Any, Any]:
    """Model of platen and legs on swivels with a point constraint at every platen point, its data and constraints.

    Bearings are left out: sliding on a plane is no constraint that Pinocchio has, and a pad between two sliders has
    no mass, which makes the matrix singular.
    """
    plant = make_plant(machine)
    legs, _ = make_leg_model(machine)
    model = pin.appendModel(plant.model, legs, 0, pin.SE3.Identity())
    model.gravity = legs.gravity
    centre, constraints = np.array(machine.platen.centre_of_gravity), pin.StdVec_RigidConstraintModel()
    for component in machine.components:
        if getattr(component, "mount", "none") == "bearing":
            continue
        at = pin.SE3(np.eye(3), np.array(component.platen_point) - centre)
        slider = model.getJointId(f"{component.name}_extension")
        ends = 1, at, slider, pin.SE3.Identity()
        constraints.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, *ends, pin.LOCAL))
    return plant, model, constraints


def forward_dynamics(machine: Machine) -> dict[str, float]:
    """Microseconds of the forward dynamics alone, and the largest difference of the constrained from the projected."""
    full, lumped = (make_plant(machine.with_bodies(word)) for word in ("full", "lumped"))
    q, v = full.zero_state().q, np.array([0.5, -0.3, 0.1, 0.05, -0.02, 0.1])
    tau = 1e5 * np.arange(1.0, 7.0)
    q[:3] += 0.3, -0.2, 0.05

    # legs on swivels alone, to compare with point constraints; without `extra`, which Pinocchio has not
    massless = machine.with_params(vertical__mass_along=0.0).with_bodies("full")
    plant, model, constraints = constrained(massless)
    data, datas = model.createData(), pin.StdVec_RigidConstraintData()
    datas.extend(c.createData() for c in constraints)
    pin.initConstraintDynamics(model, data, constraints, datas)
    x, velocity, force = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    x[:7], velocity[:6], force[:6] = q, v, tau
    legs = LegModel(plant)
    legs.follow(q, v)
    x[7:], velocity[6:] = legs.position, legs.velocity
    solve = partial(pin.constraintDynamics, model, data, x, velocity, force, constraints, datas)
    projected = make_dynamics(plant)
    unpack_tables.py_func(plant.tables.packed).inertia["extra"] = 0.0
    apart = float(np.abs(solve()[:6] - projected(q, v, tau)).max())
    found = {
        "ABA, lumped": partial(make_dynamics(lumped), q, v, tau),
        "projection, CRBA and RNEA of the legs": partial(make_dynamics(full), q, v, tau),
        "constrained dynamics, 7 legs of 13": solve,
    }

    def repeated(work: Any) -> None:
        for _ in range(2000):
            work()

    times = {name: 1e6 / 2000 * best(partial(repeated, work), 5) for name, work in found.items()}
    return {**times, "constrained less projected [m/s2]": apart}


def steps(machine: Machine, seconds: float) -> dict[str, float]:
    """Microseconds of a semi-implicit step at 8192 Hz, both engines, lumped and as bodies."""
    samples, found = int(seconds * SAMPLE_RATE), {}
    for engine in ENGINES:
        for word in ("lumped", "full"):
            plant = make_plant(machine.with_bodies(word))
            rest = find_equilibrium(plant)
            phase = 2.0 * np.pi * np.arange(samples)[:, None] / SAMPLE_RATE + np.arange(plant.spools)
            loop = OpenLoop(rest.spool + 0.02 * np.sin(phase), rest.state)
            run = partial(simulate, plant, loop, samples=samples, engine=engine, record_every=4)
            run()
            found[f"{engine}, {word}"] = 1e6 * best(run, 5) / (4 * samples)
    return found


def offsets(machine: Machine) -> list[tuple[float, float, float]]:
    """Constant vertical force [N] of bodies less lump for lengths of rod and barrel, where the masses allow them."""
    found = []
    for rod, barrel in LENGTHS:
        other = machine.with_params(horizontal__rod_length=rod, horizontal__barrel_length=barrel)
        try:
            found.append((rod, barrel, float(compare_with_lump(other, np.zeros(6)).weight[2])))
        except ParameterError:
            continue
    return found


def main(
    out: Annotated[Path, typer.Option(help="Folder of moving_parts.json.")] = Path("out/moving_parts"),
    seconds: Annotated[float, typer.Option(help="Length of the timed runs [s].")] = 2.0,
) -> None:
    """Compare and time; see above."""
    refuse_folder(out)
    machine, console = load_machine(), Console()
    full = machine.with_bodies("full")
    poses = [(f"x = {x:g} m", (x, 0.0, 0.0, 0.0, 0.0, 0.0)) for x in (0.5, 0.89)]
    print_blocks(split_table(full), lump_table(full, [*poses, *(p for p in limit_poses(machine) if p[1][0] == 0.0)]))
    constant = offsets(full)
    rows = [(f"{rod:g}", f"{barrel:g}", f"{1e-3 * force:.1f}") for rod, barrel, force in constant]
    title = "Constant vertical force, by lengths [m] of horizontal rods and barrels"
    print_blocks(Table(title, ("rod", "barrel", "Fz [kN]"), rows))
    alone, step = forward_dynamics(machine), steps(machine, seconds)
    console.print("Forward dynamics alone [us]", markup=False)
    for name, value in alone.items():
        console.print(f"  {value:9.3g}  {name}", markup=False)
    console.print("A step of 1/8192 s [us]", markup=False)
    for name, value in step.items():
        console.print(f"  {value:9.3g}  {name}", markup=False)
    for engine in ENGINES:
        console.print(f"  {step[f'{engine}, full'] / step[f'{engine}, lumped']:9.3g}  {engine}, full over lumped")
    with write_whole(out / "moving_parts.json") as beside:
        entries = {"forward_dynamics_us": alone, "step_us": step, "vertical_force": constant}
        beside.write_text(json.dumps(entries, indent=1), encoding="utf-8")
    console.print(f"written: {out / 'moving_parts.json'}")


if __name__ == "__main__":
    typer.run(main)

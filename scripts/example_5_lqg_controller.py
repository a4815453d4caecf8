"""A controller of your own: LQG in place of the displacement loop of the 469D, and a comparison of both.

    lhpost6 run ridgecrest --controller scripts/example_5_lqg_controller.py:Lqg
    python scripts/example_5_lqg_controller.py [MOTION] [--scale 1] [--axes xyz] [--out DIR]

Requires python-control (`pip install control`). The linearised plant, without dry friction, is reduced to three states
per free axis: pose p of C and Euler angles, its rate v, and the compression s of the oil columns at the platen [m,
rad]. The input is a platen velocity u:

    p' = v,    v' = a(p, v, s) + f,    s' = u + d + g(p, v, s),    g near -v.

f (friction and other unmodelled forces) and d (leakage, valve gains) are modelled as constants and estimated with the
state: the integral action. python-control gives the gains of the Kalman filter and of the regulator, K:

    u = u_r - K (x^ - x_r) - d^.

x_r is the state of the target motion minus the share of f^, u_r the input between its samples: the inverse of the
model. x^ is the prediction for the time when the command reaches the valves, 5 ms later; commands under way are known.
The platen lags by the valve delay and one sample. The rest is as in the 469D: actuator velocities by the Jacobian at
the pose, decay of internal forces, inverse of the flow curve of the valve; but with the velocity at full opening under
the force required by the target motion.
"""

import math
import shlex
import sys
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import control
import numpy as np
import typer
import xarray as xr
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.linalg import block_diag
from scipy.signal import cont2discrete

from lhpost6_pin.cli import run_script
from lhpost6_pin.control import load_controller
from lhpost6_pin.control.plug import Feedback, Wanted
from lhpost6_pin.core.errors import ControllerError
from lhpost6_pin.core.files import refuse_folder
from lhpost6_pin.core.names import AXES, SAMPLE_RATE
from lhpost6_pin.data.signals import align, delay, lowpass_zero_phase, rrmse
from lhpost6_pin.effects.registry import parameters_of
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import Equilibrium, find_equilibrium, unloaded_speeds
from lhpost6_pin.mechanics.linearize import linearize
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.mechanics.pose import forward_kinematics, leg_displacements, platen_motion
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.report import page
from lhpost6_pin.show.report.plots import ACHIEVED, RECORDED, TARGET, Row, Trace, time_figure
from lhpost6_pin.show.report.scales import axis_scale
from lhpost6_pin.simulation.motion_limits import check_motion_limits
from lhpost6_pin.simulation.rehearse import SimulatedTest, rehearse

Array = NDArray[np.float64]
STEP = 1.0 / SAMPLE_RATE
EACH = np.eye(6)


class PlatenModel(NamedTuple):
    """dx/dt = a x + b u of x = (p, v, s), (m,) each, and platen velocities u (m,); m free axes, zero-position."""

    a: Array  # (3 m, 3 m)
    b: Array  # (3 m, m)
    stiffness: Array  # (m, m) wrench on the platen [N, N m] per compression [m, rad]


class Valves(NamedTuple):
    """From actuator velocity to spool: squared velocities are linear in the force."""

    squares: Array  # (n, 2) squared velocity at full opening under the rest force: extending, retracting [m2/s2]
    slopes: Array  # (n, 2) their change with the force [m2/s2/N]
    curve: Array  # (n,) lambda of the flow curve [1]
    leak: Array  # (n,) opening at rest [1]
    full: Array  # (n,) opening at full stroke [1]


class Design(NamedTuple):
    """Constants of a run."""

    plant: Plant
    rest: Equilibrium
    model: PlatenModel
    valves: Valves
    legs: Array  # (n, m) Jacobian in the zero-position
    share: Array  # (n, m) forces of the actuators per compression, least norm
    balance: Array  # (n, n) velocity per force in the null space of the motion
    lag: Array  # (m, m) compression per acceleration
    regulator: Array  # (m, 3 m)
    filter: Array  # (5 m, 3 m) gain on the measured pose, acceleration, wrench
    advance: Array  # (5 m, 7 m) next estimate from this one and the two commands in effect
    ahead: Array  # (5 m, ...) estimate for the time when a command given now arrives


@dataclass
class Memory:
    """State of the controller."""

    design: Design
    estimate: Array  # (5 m,) p, v, s, d, f
    sent: deque[Array]  # commands under way, (m,) each, oldest first
    asked: Array | None = None  # (3 m,) target state at the last sample


@dataclass(frozen=True)
class Lqg:
    """A controller (`lhpost6_pin.control.plug`) by its weights; rotations weigh as displacements at the lever [m].

    Errors and velocity of the regulator are of equal weight. Velocity over pose error is the bandwidth of the loop,
    velocity over compression error the damping of the oil columns: 100 1/s is much at 9 to 12 Hz and little at 35 to
    46 Hz, beyond reach with the valve delay. Weights of the filter are sensor noise and the drift of model errors.
    """

    lever: float = 5.0  # [m]
    pose_error: float = 0.01  # [m]
    compression_error: float = 0.001  # [m]
    speed: float = 0.1  # [m/s]
    pose_noise: float = 1e-4  # [m]
    acceleration_noise: float = 0.05  # [m/s2]
    compression_noise: float = 1e-5  # [m]
    velocity_drift: float = 0.02  # [m/s in a second, random walk]
    compression_drift: float = 0.01  # [m]
    speed_drift: float = 0.02  # of d [m/s]
    friction_drift: float = 10.0  # of f [m/s2]
    balance: float = 3.0  # rate at which internal forces decay [1/s]

    def init(self, plant: Plant, rest: Equilibrium) -> Memory:
        """Design for a plant; raises ControllerError for delays or joints beyond this model."""
        late = float(plant.delays[0]) * SAMPLE_RATE
        if np.ptp(plant.delays) or late <= 1.0:
            raise ControllerError(f"valves with one delay, above {STEP:.2g} s, are needed; these have {plant.delays}")
        model, m = platen_model(plant), plant.axes.size
        lever = np.where(plant.axes < 3, 1.0, self.lever)

        def diagonal(power: int, *sizes: float) -> Array:
            return block_diag(*(np.diag((size / lever) ** power) for size in sizes))

        weights = diagonal(-2, self.pose_error, np.inf, self.compression_error)  # rates are free
        regulator, *_ = control.dlqr(*held(model.a, model.b, STEP), weights, diagonal(-2, self.speed))

        one, none = np.eye(m), np.zeros((m, m))
        a = np.zeros((5 * m, 5 * m))
        a[: 3 * m, : 4 * m] = np.hstack([model.a, model.b])
        a[m : 2 * m, 4 * m :] = one
        b = np.vstack([model.b, none, none])
        sees = np.vstack([np.eye(m, 5 * m), a[m : 2 * m], np.eye(m, 5 * m, 2 * m)])
        drift = STEP * diagonal(2, self.velocity_drift, self.compression_drift, self.speed_drift, self.friction_drift)
        noise = diagonal(2, self.pose_noise, self.acceleration_noise, self.compression_noise)
        whole_a, whole_b = held(a, b, STEP)
        gain, *_ = control.dlqe(whole_a, np.eye(5 * m, 4 * m, -m), sees, drift, noise)

        # A command acts `late` samples after it was given; within that sample, the preceding one acts first
        samples = math.ceil(late) - 1
        part = late - samples
        (first_a, first_b), (last_a, last_b) = held(a, b, part * STEP), held(a, b, (1.0 - part) * STEP)
        ahead, acting = first_a, [first_b]
        for _ in range(samples - 1):
            ahead, acting = whole_a @ ahead, [*(whole_a @ x for x in acting), whole_b]

        legs = leg_jacobian(plant, np.zeros(6))
        null = np.eye(plant.spools) - legs @ np.linalg.pinv(legs)
        design = Design(
            plant=plant,
            rest=rest,
            model=model,
            valves=valve_tables(plant, rest),
            legs=legs,
            share=np.linalg.pinv(legs.T) @ model.stiffness,
            balance=self.balance * null @ np.diag(1.0 / oil_stiffness(plant)) @ null,
            lag=np.linalg.inv(model.a[m : 2 * m, 2 * m :]),
            regulator=regulator,
            filter=gain @ np.linalg.inv(block_diag(one, one, model.stiffness)),
            advance=np.hstack([last_a @ first_a - gain @ sees, last_a @ first_b, last_b]),
            ahead=np.hstack([ahead, *acting]),
        )
        return Memory(design, np.zeros(5 * m), deque(np.zeros((samples + 1, m)), maxlen=samples + 1))

    def step(self, memory: Memory, wanted: Wanted, sensors: Feedback) -> Array:
        """Spool commands (n,) of one sample."""
        d = memory.design
        axes, m = d.plant.axes, d.plant.axes.size
        # State of the table: measured, estimated, and predicted for the time when this command arrives
        pose = forward_kinematics(d.plant, sensors.displacement)[0][0]
        legs = leg_jacobian(d.plant, pose)
        wrench = legs.T @ sensors.force - d.legs.T @ d.rest.force
        seen = np.concatenate([pose[axes], sensors.acceleration[axes], wrench])
        sent = memory.sent
        memory.estimate = d.advance @ np.concatenate([memory.estimate, sent[0], sent[1]]) + d.filter @ seen
        there = d.ahead @ np.concatenate([memory.estimate, *list(sent)[1:]])
        # Target state at that time, and the velocity from the last target state to this one
        now = wanted_state(d, wanted)
        last = now if memory.asked is None else memory.asked
        memory.asked = now
        speed = (now - last)[2 * m :] / STEP - d.model.a[2 * m :] @ (0.5 * (now + last))
        goal = last.copy()
        goal[2 * m :] -= d.lag @ there[4 * m :]
        speed -= d.regulator @ (there[: 3 * m] - goal) + there[3 * m : 4 * m]
        # From platen velocities to spools
        rates = legs @ speed - d.balance @ (sensors.force - d.rest.force)
        spool, given = spools(d.valves, rates, d.share @ goal[2 * m :])
        if given is not rates:  # beyond full stroke: the filter receives the achievable velocity
            speed = np.linalg.lstsq(legs, given, rcond=None)[0]
        sent.append(speed)
        return spool


def leg_jacobian(plant: Plant, pose: Array) -> Array:
    """Rates of the actuators (n, m) per rate of a pose (6,) along the free axes."""
    _, rates = leg_displacements(plant, np.repeat(pose[None], 6, axis=0), EACH)
    return np.asarray(rates[plant.axes, : plant.spools].T)


def platen_model(plant: Plant) -> PlatenModel:
    """The linearised plant, projected on the platen's motion and the actuators' wrench on it.

    Raises ControllerError for a plant with joints beside the platen's.
    """
    machine, m = plant.machine, plant.axes.size
    if plant.model.nv != m:
        raise ControllerError("the model has no place for a specimen's joints; lock them with --locked")
    kinds = {c.kind for c in machine.components}
    friction = [f"{k}.{n}" for k in kinds for n in ("seal_friction", "pad_friction")]
    smooth = make_plant(machine.with_params({name: 0.0 for name in friction if name in machine.parameters}))
    rest = find_equilibrium(smooth)
    linear = linearize(smooth, rest.state, rest.spool)
    at_rest = np.tile(rest.state.q, (m, 1))
    to_pose = platen_motion(smooth, at_rest, np.eye(m), np.zeros((m, m))).velocity[:, plant.axes].T
    # Force of the pressures, and the pressures of a force in the proportion in which the spool moves them
    force = np.zeros((plant.spools, len(smooth.states)))
    pressure = np.zeros_like(force.T)
    for i, (row, actuator) in enumerate(zip(smooth.rows[smooth.tables.actuators], machine.actuators, strict=True)):
        force[i, row["state"]] = actuator.area_a
        if actuator.area_b is not None:
            force[i, row["state"] + 1] = -actuator.area_b
        moved = linear.B[2 * m :, i]
        pressure[:, i] = moved / (force[i] @ moved)
    legs = leg_jacobian(smooth, np.zeros(6))
    down = block_diag(to_pose, to_pose, legs.T @ force)
    up = block_diag(np.linalg.inv(to_pose), np.linalg.inv(to_pose), pressure @ np.linalg.pinv(legs.T))
    valves = valve_tables(smooth, rest)
    at_full = np.sqrt(np.where(valves.leak >= 0.0, *valves.squares.T))
    b = down @ linear.B @ (legs / (valves.curve * at_full)[:, None])
    scale = block_diag(np.eye(2 * m), b[2 * m :])
    return PlatenModel(np.linalg.solve(scale, down @ linear.A @ up @ scale), np.linalg.solve(scale, b), b[2 * m :])


def valve_tables(plant: Plant, rest: Equilibrium) -> Valves:
    """Valves of a plant at rest."""
    actuators = [parameters_of(row) for row in plant.rows[plant.tables.actuators]]
    more = 0.01 * plant.supply.pressure * plant.actuators.area_a  # [N] as good as any: the squares are linear in it
    found = [
        [unloaded_speeds(p, f, plant.supply) for p, f in zip(actuators, rest.force + x, strict=True)] for x in (0, more)
    ]
    squares, pushed = np.square(found)
    curve = plant.actuators.flow_curve
    leak = np.copysign(-np.expm1(-curve * np.abs(rest.spool)), rest.spool)
    return Valves(squares, (pushed - squares) / more[:, None], curve, leak, -np.expm1(-curve))


def oil_stiffness(plant: Plant) -> Array:
    """Stiffness of the actuators' oil columns, zero-position [N/m]."""
    oil = plant.machine.hydraulics.bulk_modulus
    columns = [(a.area_a / a.chamber_a, (a.area_b or 0.0) / (a.chamber_b or 1.0)) for a in plant.machine.actuators]
    return oil * np.sum(columns, axis=1)


def held(a: Array, b: Array, time: float) -> tuple[Array, Array]:
    """State after a time [s] per state before it, and per input held over it."""
    found = cont2discrete((a, b, np.eye(len(a)), np.zeros_like(b)), time)
    return found[0], found[1]


def wanted_state(design: Design, wanted: Wanted) -> Array:
    """State (3 m,) of a platen in the wanted motion."""
    axes, m = design.plant.axes, design.plant.axes.size
    moved = np.concatenate([wanted.displacement[axes], wanted.velocity[axes]])
    free = design.model.a[m : 2 * m, : 2 * m] @ moved
    return np.concatenate([moved, design.lag @ (wanted.acceleration[axes] - free)])


def spools(valves: Valves, rates: Array, force: Array) -> tuple[Array, Array]:
    """Spools (n,) for rates (n,) [m/s] under forces (n,) beyond those at rest [N], and the rates that they give."""
    squares = np.maximum(valves.squares + valves.slopes * force[:, None], 0.01 * valves.squares)
    extend, retract = np.sqrt(squares).T
    full = np.where(rates + valves.leak * extend >= 0.0, extend, retract)
    asked = rates / full + valves.leak
    opening = np.clip(asked, -valves.full, valves.full)
    spool = np.copysign(-np.log1p(-np.abs(opening)) / valves.curve, opening)
    return spool, rates if np.array_equal(opening, asked) else (opening - valves.leak) * full


# ------------------------------------------------------------------------------------------- comparison
BAND = 33.0
"""Errors are judged from 0 to this frequency [Hz], the table's bandwidth."""


class Tracked(NamedTuple):
    """How one quantity of one axis followed what was wanted, its delay removed, 0 to 33 Hz."""

    error: float  # RRMSE
    delay: float  # [s]
    wanted: Array  # (n,)
    achieved: Array  # (n,)


def tracked(record: xr.Dataset, quantity: str, axis: str) -> Tracked:
    """How a record's platen followed."""
    wanted, achieved = (
        lowpass_zero_phase(record[f"{who}_{quantity}"].sel(axis=axis).values, STEP, BAND)
        for who in ("reference", "platen")
    )
    late = float(delay(wanted, achieved, STEP))
    achieved = align(achieved, late, STEP)
    return Tracked(float(rrmse(wanted, achieved)), late, wanted, achieved)


def main(
    motion: Annotated[str, typer.Argument(help="Name; `lhpost6 motions` lists them.")] = "ridgecrest",
    scale: Annotated[float, typer.Option(help="Scale factor of the motion.")] = 1.0,
    axes: Annotated[str | None, typer.Option(help="Axes, such as xyz, x, or x=y.")] = None,
    settings: Annotated[str, typer.Option(help="Settings of the 469D: name or TOML file.")] = "lhpost6",
    out: Annotated[Path, typer.Option(help="Directory of lqg.html.")] = Path("out/lqg"),
) -> None:
    """Run MOTION with the 469D and with the LQG controller, and compare them."""
    refuse_folder(out)
    machine = load_machine("lhpost6")
    target = make_target(find_motion(motion), scale=scale, axes=axes)
    check_motion_limits(make_plant(machine), target)
    panel = load_controller(settings)
    tests = {
        "469D": rehearse(machine, target, panel, attrs={"test": motion}),
        "LQG": rehearse(machine, target, Lqg(), attrs={"test": motion}),
    }
    asked = [axis for axis, moved in zip(AXES, target.displacement.any(axis=0), strict=True) if moved]
    found = {
        (quantity, axis): [tracked(test.record, quantity, axis) for test in tests.values()]
        for quantity in ("displacement", "acceleration")
        for axis in asked
    }
    header, rows = summary(tests, found)
    title = f"{motion} at scale {scale:g}: the 469D ({panel.name}) and LQG"
    shown = Table(*header, title=title)
    for row in rows:
        shown.add_row(*row)
    console = Console()
    console.print(shown)
    console.print(f"wrote {write_report(out / 'lqg.html', title, header, rows, found)}", markup=False, soft_wrap=True)


def summary(
    tests: dict[str, SimulatedTest], found: dict[tuple[str, str], list[Tracked]]
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows of the table of figures."""
    rows = [
        (f"{quantity} {axis}: RRMSE (delay)", *(f"{100 * t.error:.2f} % ({1e3 * t.delay:.1f} ms)" for t in pair))
        for (quantity, axis), pair in found.items()
    ]
    runs = [test.run for test in tests.values()]
    rows.append(("largest spool, 1 is full stroke", *(f"{np.abs(run.spool).max():.2f}" for run in runs)))
    rows.append(("spool values clipped", *(str(run.clipped) for run in runs)))
    rows.append(("trouble", *(run.trouble or "none" for run in runs)))
    return ("0 to 33 Hz, delay removed", *tests), rows


def write_report(
    path: Path,
    title: str,
    header: tuple[str, ...],
    rows: list[tuple[str, ...]],
    found: dict[tuple[str, str], list[Tracked]],
) -> Path:
    """One page: the figures, and per axis the errors of both and the acceleration around its peak."""
    lines = {"469D": RECORDED, "LQG": ACHIEVED}
    blocks = []
    for (quantity, axis), pair in found.items():
        scale = axis_scale(axis, quantity)
        named = list(zip(lines, pair, strict=True))
        errors = [Trace(name, t.achieved - t.wanted, lines[name]) for name, t in named]
        drawing = time_figure(
            f"{quantity}-{axis}",
            f"Axis {axis}, {quantity}: error",
            "Achieved less wanted, 0 to 33 Hz, each with its own delay removed.",
            [Row("error", errors, scale)],
            start=0.0,
            step=STEP,
        )
        blocks.append(drawing)
        if quantity == "displacement":
            continue
        wanted = pair[0].wanted
        first = max(0, int(np.abs(wanted).argmax()) - SAMPLE_RATE)
        part = slice(first, first + 2 * SAMPLE_RATE)
        motions = [Trace(name, t.achieved[part], lines[name]) for name, t in named]
        drawing = time_figure(
            f"peak-{axis}",
            f"Axis {axis}, {quantity}: around the peak",
            "Two seconds, 0 to 33 Hz, each with its own delay removed.",
            [Row(quantity, [Trace("wanted", wanted[part], TARGET), *motions], scale)],
            start=first * STEP,
            step=STEP,
            alone=True,
        )
        blocks.append(drawing)
    worst = {key: [max(p[k].error for (q, _), p in found.items() if q == key) for k in (0, 1)] for key, _ in found}
    tiles = [
        page.Headline(f"{100 * lqg:.2f} %", f"{quantity} RRMSE, worst axis", f"469D: {100 * plain:.2f} %")
        for quantity, (plain, lqg) in worst.items()
    ]
    better = sum(lqg.error < plain.error for plain, lqg in found.values())
    report = page.Page(
        kind="Controllers compared",
        title=title,
        purpose="The same motion on the same plant with two controllers.",
        verdict=f"LQG follows more closely than the 469D in {better} of {len(found)} quantities.",
        level="plain",
        headlines=tiles,
        sections=[
            page.Section("figures", "Figures", [page.Table("RRMSE and delay", header, rows)]),
            page.Section("axes", "Per axis", blocks),
        ],
        notes=["LQG was designed with the very numbers that this plant runs on; a real table's are known less well."],
        command=shlex.join(["python", *sys.argv]),
        versions=page.versions(),
    )
    return page.save_page(report, path)


if __name__ == "__main__":
    run_script(main)

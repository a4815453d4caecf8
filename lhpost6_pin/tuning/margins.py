"""The controlled table as a linear system: loop gains, margins, and the response expected of settings.

The plant is linearised at rest without dry friction, where its damping is least: friction slides in large motion. The
velocity command u of each degree of freedom causes, through valve delay and sample hold, a displacement X u of C and
Euler angles and a force F u of the actuators on that degree of freedom. Outputs of the feedback generator are the
displacement and its derivatives. With Kx, Kv, ... as in `control.loop`

    L = Km N [ (Kx + Kv s + Ka s^2 + Ki/s) X + KF HP F ]
    T = X (1 + L)^-1 Km N (Kxf + Kvf s + Kaf s^2 + Kjf s^3 + Kx + Kv s + Ka s^2 + Ki/s)
"""

from dataclasses import dataclass

import numpy as np

from ..control import Controller
from ..core.arrays import Array, Complex
from ..core.names import SAMPLE_RATE
from ..laws.orifice import opening
from ..machine.machine import Machine
from ..mechanics.equilibrium import find_equilibrium
from ..mechanics.interface_wrench import bare
from ..mechanics.linearize import SPOOL_STEP, linearize
from ..mechanics.plant import make_plant

__all__ = ["LinearTable", "LoopModel", "Margin", "expected_response", "linear_table", "loop_frequencies"]
__all__ += ["loop_gain", "make_loop_model", "margins", "without_dry_friction"]

BAND = 0.05, 400.0
"""Of loops [Hz]: from below the corner of the reset integrator to far above the stiffest oil column."""
FREQUENCIES = np.geomspace(*BAND, 4000)
"""Frequencies of loops [Hz], dense enough for a resonance of 0.5 % damping; `loop_frequencies` for less."""


@dataclass(frozen=True)
class LoopModel:
    """Response of the table to the velocity command of each free axis, at `frequency` (m,) [Hz]."""

    frequency: Array
    displacement: Complex  # (m, n, n) of C and Euler angles [m, rad per m/s, rad/s]
    force: Complex  # (m, n, n) of the actuators on that degree of freedom [N, N m per m/s, rad/s]


@dataclass(frozen=True)
class Margin:
    """Stability margins of one axis, the loops of the others closed."""

    gain: float  # factor on the axis's master gain at which the loop becomes unstable; inf if none does
    gain_frequency: float  # of that instability [Hz]
    phase: float  # lag at which the loop becomes unstable [rad]; inf if the loop never reaches gain one
    phase_frequency: float


def without_dry_friction(machine: Machine) -> Machine:
    """Machine without the friction of seals and pads."""
    friction = [n for n in machine.parameters if n.endswith((".seal_friction", ".pad_friction"))]
    return machine.with_params(dict.fromkeys(friction, 0.0))


@dataclass(frozen=True)
class LinearTable:
    """A controller's plant at rest without dry friction: dx/dt = a x + b w, w (n_actuators,) its velocity commands.

    x: local pose and velocity of the plant's nv coordinates, then oil and any states of a specimen. Delays and lags of
    valves, hold and force balance are not in it.
    """

    a: Array  # (n, n)
    b: Array  # (n, n_actuators)
    nv: int
    to_c: Array  # (n_axes, n) displacement of C and Euler angles on the free axes
    to_force: Array  # (n_actuators, n) actuator forces [N]


def linear_table(controller: Controller) -> LinearTable:
    """Linearise a controller's plant about rest."""
    plant = make_plant(without_dry_friction(controller.plant.machine))
    rest = find_equilibrium(plant)
    linear = linearize(plant, rest.state, rest.spool)
    nv, axes = linear.nv, plant.axes
    carried = set(plant.states) - set(bare(plant).states)
    oil = (2 * nv + i for i, name in enumerate(plant.states) if "pressure" in name or "flow" in name or name in carried)
    keep = [*range(2 * nv), *oil]
    a, b = linear.A[np.ix_(keep, keep)], linear.B[keep]
    # spool per actuator velocity: the controller inverts the flow curve about the opening at rest
    actuators = plant.actuators
    for i, valve in enumerate(controller.actuator):
        curve, at = float(actuators.flow_curve[i]), float(rest.spool[i])
        slope = (opening(at + SPOOL_STEP, curve) - opening(at - SPOOL_STEP, curve)) / (2.0 * SPOOL_STEP)
        b[:, i] /= slope * (valve["extend"] if valve["bias"] >= 0.0 else valve["retract"])
    to_c = np.zeros((axes.size, len(keep)))
    to_c[:, : axes.size] = controller.lever[np.ix_(axes, axes)]
    pressure = {name: k for k, name in enumerate(plant.states[i - 2 * nv] for i in keep[2 * nv :])}
    to_force = np.zeros((plant.spools, len(keep)))
    for i, first in enumerate(plant.rows["state"][plant.tables.actuators]):
        for offset, area in enumerate((actuators.area_a[i], -actuators.area_b[i])):
            name = plant.states[first + offset] if offset == 0 or area != 0.0 else None
            if name in pressure:
                to_force[i, 2 * nv + pressure[name]] = area
    return LinearTable(a, b, nv, to_c, to_force)


def loop_frequencies(rates: Complex, count: int = 600, near: int = 41) -> Array:
    """Frequencies [Hz] for margins: a geometric grid of `count`, with `near` more about the resonance of every rate.

    rates (n,): of the motions exp(s t) of table or closed loop [1/s]; those not finite or outside the grid have none.
    The finest step is 0.015 % of a resonance's frequency with 41 near it, 0.0037 % with 161.
    """
    rates = rates[np.isfinite(rates)]
    rates = rates[(rates.imag > 2.0 * np.pi * BAND[0]) & (rates.imag < 2.0 * np.pi * BAND[1])]
    spread = 1.0 + np.sinh(np.linspace(-6.0, 6.0, near)) / np.sinh(6.0) * 0.1
    grid = np.unique(np.concatenate([np.geomspace(*BAND, count), np.outer(rates.imag / (2.0 * np.pi), spread).ravel()]))
    return np.asarray(grid[(grid >= BAND[0]) & (grid <= BAND[1])])


def make_loop_model(
    controller: Controller, frequency: Array = FREQUENCIES, table: LinearTable | None = None
) -> LoopModel:
    """Linear response of a controller's plant to its velocity commands, its force balance closed.

    table: that of `linear_table`, if known.
    """
    plant = controller.plant
    table = linear_table(controller) if table is None else table
    s = 2j * np.pi * frequency[:, None, None]
    hold = (1.0 - np.exp(-s / SAMPLE_RATE)) / (s / SAMPLE_RATE)
    late = np.exp(-s * plant.delays) / (1.0 + s * plant.lags) * hold  # (m, 1, n_actuators)
    states = np.linalg.solve(s * np.eye(len(table.a)) - table.a, table.b * late)  # per actuator velocity
    force = table.to_force @ states
    legs = controller.jacobian[:, plant.axes]
    rate = np.linalg.solve(np.eye(plant.spools) + controller.balance @ force, legs.astype(complex))
    displacement, on_axes = table.to_c @ states @ rate, legs.T @ (force @ rate)
    return LoopModel(frequency, np.asarray(displacement, np.complex128), np.asarray(on_axes, np.complex128))


def loop_gain(model: LoopModel, controller: Controller) -> Complex:
    """Loop gain L (m, n, n) of the free axes: the returned part of a velocity command, sign reversed."""
    back = np.exp(-2j * np.pi * model.frequency / SAMPLE_RATE)[:, None]
    rows = controller.axis
    passed = (1.0 - back) / (1.0 / rows["high_pass"] - back)
    shape = _shaping(model, controller)[:, :, None]
    feedback = _displacement_feedback(model, controller)[:, :, None]
    return shape * (feedback * model.displacement + (rows["force_gain"] * passed)[:, :, None] * model.force)


def expected_response(model: LoopModel, controller: Controller) -> Complex:
    """Response T (m, n, n), reference to feedback, of the linear system."""
    s = 2j * np.pi * model.frequency[:, None]
    names = ("displacement", "velocity", "acceleration", "jerk")
    ahead = sum(controller.axis[f"{name}_feedforward"] * s**k for k, name in enumerate(names))
    command = _shaping(model, controller) * (ahead + _displacement_feedback(model, controller))
    one = np.eye(len(controller.axis))
    return model.displacement @ np.linalg.solve(one + loop_gain(model, controller), command[:, :, None] * one)


def margins(model: LoopModel, controller: Controller, below: float = np.inf) -> tuple[Margin, ...]:
    """Gain and phase margin of each free axis, the others closed, of a loop that is stable.

    Phase margins count where the loop crosses gain one at a frequency up to `below` [Hz].
    """
    inner = np.linalg.inv(np.eye(len(controller.axis)) + loop_gain(model, controller))
    alone = 1.0 / np.einsum("mkk->mk", inner) - 1.0  # loop gain of an axis, others closed
    return tuple(_margin(model.frequency, loop, below) for loop in alone.T)


def _margin(frequency: Array, loop: Complex, below: float = np.inf) -> Margin:
    """Smallest margins of a scalar loop: at crossings of the negative real axis within, and of, the unit circle."""
    if not loop.any():
        return Margin(np.inf, np.nan, np.inf, np.nan)
    turn, size = np.unwrap(np.angle(loop)), np.log(np.abs(loop))
    gain, at_gain, phase, at_phase = np.inf, np.nan, np.inf, np.nan
    half_turns = np.floor((turn / np.pi - 1.0) / 2.0)  # changes where the loop crosses the negative real axis
    for i in np.flatnonzero(np.diff(half_turns)):
        level = np.pi * (2.0 * max(half_turns[i], half_turns[i + 1]) + 1.0)
        share = (level - turn[i]) / (turn[i + 1] - turn[i])
        factor = np.exp(-(1.0 - share) * size[i] - share * size[i + 1])
        if 1.0 < factor < gain:
            gain, at_gain = factor, frequency[i]
    for i in np.flatnonzero(np.diff(np.sign(size))):
        share = -size[i] / (size[i + 1] - size[i])
        left = abs(np.angle(-np.exp(1j * ((1.0 - share) * turn[i] + share * turn[i + 1]))))
        if left < phase and frequency[i] <= below:
            phase, at_phase = left, frequency[i]
    return Margin(float(gain), float(at_gain), float(phase), float(at_phase))


def _shaping(model: LoopModel, controller: Controller) -> Complex:
    """Master gain times notches (m, n)."""
    back = np.exp(-2j * np.pi * model.frequency / SAMPLE_RATE)
    out = np.ones((len(model.frequency), len(controller.axis)), complex)
    for k, row in enumerate(controller.axis):
        out[:, k] *= row["master_gain"]
        for b0, b1, b2, a1, a2 in row["notch"][: int(row["notches"])]:
            out[:, k] *= (b0 + b1 * back + b2 * back**2) / (1.0 + a1 * back + a2 * back**2)
    return out


def _displacement_feedback(model: LoopModel, controller: Controller) -> Complex:
    """Kx + Kv s + Ka s^2 + Ki/s, (m, n)."""
    s = 2j * np.pi * model.frequency[:, None]
    rows = controller.axis
    gains = sum(rows[f"{name}_gain"] * s**k for k, name in enumerate(("displacement", "velocity", "acceleration")))
    return np.asarray(gains + rows["reset_gain"] / (1.0 - np.exp(-s / SAMPLE_RATE)))

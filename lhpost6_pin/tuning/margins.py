"""The controlled table as a linear system: loop gains, margins, and the response expected of settings.

The plant is linearised at rest without dry friction, which is how it is least damped: large motion slides through it.
Per degree of freedom the controller asks for a velocity u; the plant answers with a displacement X u of C and Euler
angles and a force F u of the actuators on that degree of freedom, through valve delay and sample hold. The feedback
generator's outputs are the displacement and its derivatives. So with Kx, Kv, ... as in `control.loop`

    L = Km N [ (Kx + Kv s + Ka s^2 + Ki/s) X + KF HP F ]
    T = X (1 + L)^-1 Km N (Kxf + Kvf s + Kaf s^2 + Kjf s^3 + Kx + Kv s + Ka s^2 + Ki/s)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..control import Controller
from ..core.names import SAMPLE_RATE
from ..laws.orifice import opening
from ..mechanics.equilibrium import find_equilibrium
from ..mechanics.linearize import SPOOL_STEP, linearize
from ..mechanics.plant import make_plant

__all__ = ["LoopModel", "Margin", "expected_response", "loop_gain", "make_loop_model", "margins"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

FREQUENCIES = np.geomspace(0.05, 400.0, 4000)
"""Where loops are judged [Hz]: from below the reset integrator's corner to far above the stiffest oil column, dense
enough for a resonance of 0.5 % damping."""


@dataclass(frozen=True)
class LoopModel:
    """What the table answers to a velocity asked for on each free axis, at `frequency` (m,) [Hz]."""

    frequency: Array
    displacement: Complex  # (m, n, n) of C and Euler angles [m, rad per m/s, rad/s]
    force: Complex  # (m, n, n) of the actuators on that degree of freedom [N, N m per m/s, rad/s]


@dataclass(frozen=True)
class Margin:
    """How far one axis is from instability while the others stay closed."""

    gain: float  # factor on the axis's master gain at which the loop becomes unstable; inf if none does
    gain_frequency: float  # where that happens [Hz]
    phase: float  # lag that would make it unstable [rad]; inf if the loop never reaches gain one
    phase_frequency: float


def make_loop_model(controller: Controller, frequency: Array = FREQUENCIES) -> LoopModel:
    """Linear answer of a controller's plant to the velocities that it asks for, its force balance closed."""
    nominal = controller.plant
    machine = nominal.machine
    kinds = {c.kind for c in machine.components}
    friction = [f"{k}.{n}" for k in kinds for n in ("seal_friction", "pad_friction")]
    plant = make_plant(machine.with_params({name: 0.0 for name in friction if name in machine.parameters}))
    rest = find_equilibrium(plant)
    linear = linearize(plant, rest.state, rest.spool)
    nv, axes = linear.nv, plant.axes
    oil = (2 * nv + i for i, name in enumerate(plant.states) if "pressure" in name or "flow" in name)
    keep = [*range(2 * nv), *oil]
    a, b = linear.A[np.ix_(keep, keep)], linear.B[keep]
    # spool per leg rate: the controller inverts the flow curve about the opening at rest
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
    s = 2j * np.pi * frequency[:, None, None]
    hold = (1.0 - np.exp(-s / SAMPLE_RATE)) / (s / SAMPLE_RATE)
    late = np.exp(-s * plant.delays) / (1.0 + s * plant.lags) * hold  # (m, 1, n_actuators)
    states = np.linalg.solve(s * np.eye(len(keep)) - a, b * late)  # per leg rate
    force = to_force @ states
    legs = controller.jacobian[:, axes]
    rate = np.linalg.solve(np.eye(plant.spools) + controller.balance @ force, legs.astype(complex))
    displacement, felt = to_c @ states @ rate, legs.T @ (force @ rate)
    return LoopModel(frequency, np.asarray(displacement, np.complex128), np.asarray(felt, np.complex128))


def loop_gain(model: LoopModel, controller: Controller) -> Complex:
    """L (m, n, n) of the free axes: what comes back of a velocity asked for, sign reversed."""
    s = 2j * np.pi * model.frequency
    rows = controller.axis
    passed = (1.0 - np.exp(-s / SAMPLE_RATE))[:, None] / (1.0 / rows["high_pass"] - np.exp(-s / SAMPLE_RATE)[:, None])
    shape = _shaping(model, controller)[:, :, None]
    feedback = _displacement_feedback(model, controller)[:, :, None]
    return shape * (feedback * model.displacement + (rows["force_gain"] * passed)[:, :, None] * model.force)


def expected_response(model: LoopModel, controller: Controller) -> Complex:
    """T (m, n, n), reference to feedback, of the linear system."""
    s = 2j * np.pi * model.frequency[:, None]
    rows = controller.axis
    ahead = (
        rows["displacement_feedforward"]
        + rows["velocity_feedforward"] * s
        + rows["acceleration_feedforward"] * s**2
        + rows["jerk_feedforward"] * s**3
    )
    asked = _shaping(model, controller) * (ahead + _displacement_feedback(model, controller))
    n = len(rows)
    inner = np.linalg.solve(np.eye(n) + loop_gain(model, controller), asked[:, :, None] * np.eye(n))
    return model.displacement @ inner


def margins(model: LoopModel, controller: Controller, below: float = np.inf) -> tuple[Margin, ...]:
    """Gain and phase margin of each free axis, the others closed; of a loop that is stable as it is.

    Phase margins count where the loop crosses gain one at a frequency up to `below` [Hz].
    """
    inner = np.linalg.inv(np.eye(len(controller.axis)) + loop_gain(model, controller))
    alone = 1.0 / np.einsum("mkk->mk", inner) - 1.0  # what an axis sees of itself around its own loop, others closed
    return tuple(_margin(model.frequency, loop, below) for loop in alone.T)


def _margin(frequency: Array, loop: Complex, below: float = np.inf) -> Margin:
    """Smallest margins of a scalar loop: where it crosses the negative real axis inside, and the unit circle."""
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
    reset = rows["reset_gain"] / (1.0 - np.exp(-s / SAMPLE_RATE))
    gains = rows["displacement_gain"] + rows["velocity_gain"] * s + rows["acceleration_gain"] * s**2
    return np.asarray(gains + reset)

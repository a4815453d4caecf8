"""One test: rest, a closed loop of the battery's own at 2048 Hz, classical Runge-Kutta between its samples.

The loop leads by the valve's delay and the oil's compression, holds the displacement with a proportional and an
integral gain, damps the oil columns by acceleration and bleeds off forces the actuators exert on each other. It knows
the nominal table only.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.optimize import least_squares

from .rates import PA, PB, PULL, SEAL, SHOWN, SPOOL, STATES, TWIST, rates
from .table import lengths, mass_matrix, turned

__all__ = ["Channels", "Gains", "RATE", "make_gains", "simulate"]

RATE = 2048.0  # Hz
NODES, WEIGHTS = (0.0, 0.5, 0.5, 1.0, 0.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)  # classical Runge-Kutta


class Gains(NamedTuple):
    """Settings of the loop: six axes, ten actuators."""

    lead: int  # samples the feed-forward looks ahead
    oil: np.ndarray  # (6) feed-forward of jerk [s2]
    proportional: np.ndarray  # (6) [1/s]
    integral: np.ndarray  # (6) [1/s2]
    damping: np.ndarray  # (6) of acceleration [s]
    smoothing: np.ndarray  # (2, 6) share of a new error and acceleration per sample: first-order low-passes [1]
    balance: np.ndarray  # (10, 10) rates from forces [m/s/N]
    extend: np.ndarray  # (10) speed at a fully open valve [m/s]
    retract: np.ndarray  # (10)
    curve: np.ndarray  # (10) flow curve
    limit: float  # largest spool command


class Channels(NamedTuple):
    """What happened, without noise, at 2048 Hz: rows are samples."""

    state: np.ndarray  # (n, STATES)
    twist_rate: np.ndarray  # (n, 6) of B on body axes
    shown: np.ndarray  # (n, SHOWN)
    command: np.ndarray  # (n, 10)
    spool: np.ndarray  # (n, 10) at the ports


def make_gains(legs: np.ndarray, platen: np.ndarray, settings: dict) -> Gains:
    """Gains for a nominal table: flow inverted about the state of rest, internal forces by the null space."""
    body = platen[0]
    bulk, a, b = body["bulk"], legs["area_a"][:10], legs["area_b"][:10]
    stiffness = bulk * (a / legs["chamber_a"][:10] + np.where(b > 0, b / np.maximum(legs["chamber_b"][:10], 0.1), 0))
    null = np.eye(10) - (jacobian := _jacobian(np.zeros(6), legs, platen)) @ np.linalg.pinv(jacobian)
    rest = _rest_thrust(legs, platen) / a
    ratio = np.where(b > 0, b / a, 1.0)
    load_free = (body["supply"] + body["back_pressure"]) / (1.0 + 1.0 / ratio)  # four-way: both edges drop alike
    pa = np.where(b > 0, load_free, rest)
    speed = legs["flow"][:10] / a / np.sqrt(body["rated"])
    return Gains(
        lead=round(settings["lead"] * RATE),
        oil=np.array([(2 * np.pi * f) ** -2 for f in settings["oil_frequency"]]),
        proportional=np.array(settings["proportional"]),
        integral=np.array(settings["integral"]),
        damping=np.array(settings["damping"]),
        smoothing=1.0 - np.exp(-2 * np.pi * np.array([settings["low_pass"], settings["damping_low_pass"]]) / RATE),
        balance=settings["balance"] * null / stiffness[:, None],
        extend=speed * np.sqrt(ratio) * np.sqrt(body["supply"] - pa),
        retract=speed * np.sqrt(pa - body["back_pressure"]),
        curve=legs["flow_curve"][:10].copy(),
        limit=settings["limit"],
    )


def _rest_thrust(legs: np.ndarray, platen: np.ndarray) -> np.ndarray:
    """Static forces of the actuators, an equal lift from all vertical ones [N]."""
    pull = float(np.sum(legs["gas_pressure"] * legs["gas_area"]))
    return np.where(legs["kind"][:10] == 1, (platen[0]["mass_z"] * platen[0]["gravity"] + pull) / 6.0, 0.0)


@njit(cache=True)
def _jacobian(pose, legs, platen):
    """Rates of the ten extensions per rate of pose, by central differences (10, 6)."""
    out = np.empty((10, 6))
    for j in range(6):
        there, here = pose.copy(), pose.copy()
        there[j] += 1e-5
        here[j] -= 1e-5
        out[:, j] = (lengths(there, legs, platen)[:10] - lengths(here, legs, platen)[:10]) / 2e-5
    return out


def at_rest(legs: np.ndarray, platen: np.ndarray, held: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """State and spools of the static equilibrium: no acceleration, no flow, no forces of actuators on each other.

    held (25) are the shares of their friction that the seals, and the pads along two axes, hold; by default none.
    Where leaking legs cannot push against so much friction, it is half of that, a quarter, or none.
    """
    still = legs.copy()
    still["gap"] = 0.0  # play is crossed at rest without force
    inverse = np.linalg.inv(mass_matrix(platen))
    jacobian = _jacobian(np.zeros(6), legs, platen)
    null = np.linalg.svd(jacobian.T)[2][6:]
    horizontal = legs["kind"][:10] == 0
    n_b = int(horizontal.sum())
    y, dy, shown = np.zeros(STATES), np.zeros(STATES), np.zeros(SHOWN)

    def unbalance(guess: np.ndarray) -> np.ndarray:
        y[PA : PA + 10], y[PB : PB + n_b] = guess[:10] * 1e6, guess[10 : 10 + n_b] * 1e6
        spool = guess[10 + n_b :] * 1e-3
        y[SPOOL : SPOOL + 10] = spool
        rates(0.0, y, spool, 0.0, still, platen, inverse, dy, shown)
        internal = null @ shown[PULL : PULL + 10]
        return np.concatenate([dy[PA : PA + 10 + n_b] / 1e6, dy[TWIST : TWIST + 6], internal / 1e5])

    # a closed valve and empty chambers are at rest too: begin near the pressurised state and stay out of the other
    ratio = np.where(horizontal, legs["area_b"][:10] / legs["area_a"][:10], 1.0)
    pa = np.where(horizontal, 8.6e6 * ratio, _rest_thrust(legs, platen) / legs["area_a"][:10])
    seep = np.where(horizontal, -1.0, 0.4) * legs["leakage"][:10] * 1e7
    spool = np.cbrt(3.0 * legs["overlap"][:10] ** 2 * seep) + seep - legs["bias"][:10]
    guess = np.concatenate([pa / 1e6, np.full(n_b, 8.6), spool * 1e3])
    least = np.concatenate([np.full(10 + n_b, platen[0]["back_pressure"] / 1e6), np.full(10, -100.0)])
    friction = np.zeros(SPOOL - SEAL) if held is None else held
    for share in (1.0, 0.5, 0.25, 0.0):
        y[SEAL:SPOOL] = share * friction
        solved = least_squares(
            unbalance,
            *(guess, "2-point", (least, np.full(len(guess), 100.0))),
            x_scale=np.maximum(np.abs(guess), 0.1),
            **dict.fromkeys(("ftol", "xtol", "gtol"), 1e-14),
        )
        if np.abs(unbalance(solved.x)).max() <= 1e-3:
            return y, solved.x[10 + n_b :] * 1e-3
    raise ArithmeticError(f"no state of rest: {solved.message}")


def simulate(
    legs: np.ndarray,
    platen: np.ndarray,
    nominal: tuple[np.ndarray, np.ndarray],
    gains: Gains,
    reference: np.ndarray,
    surge: np.ndarray,
    substeps: int,
    held: np.ndarray | None = None,
) -> Channels:
    """The table's answer to a reference motion of C (n, 6) at 2048 Hz that begins and ends at rest.

    held (25) is that of `at_rest`.
    """
    y, spool = at_rest(legs, platen, held)
    inverse = np.linalg.inv(mass_matrix(platen))
    reference = np.ascontiguousarray(reference)
    velocity = np.gradient(reference, 1 / RATE, axis=0)
    acceleration = np.gradient(velocity, 1 / RATE, axis=0)
    jerk = np.gradient(acceleration, 1 / RATE, axis=0)
    ahead = np.minimum(np.arange(len(reference)) + gains.lead, len(reference) - 1)
    forward = (velocity + jerk * gains.oil)[ahead]
    return Channels(
        *_march(
            *(y, spool, forward, reference, velocity, acceleration, surge, legs, platen, *nominal, inverse),
            *(gains.proportional, gains.integral, gains.damping, gains.smoothing, gains.balance),
            *(gains.extend, gains.retract, gains.curve, gains.limit, substeps),
        )
    )


@njit(cache=True)
def _march(
    y, trim, forward, reference, velocity, acceleration, surge, legs, platen, nominal, nominal_platen, inverse,
    proportional, integral, damping, smoothing, balance, extend, retract, curve, limit, substeps,
):  # fmt: skip
    """Time loop: control at each sample, `substeps` Runge-Kutta steps to the next."""
    n = len(reference)
    states, accelerations, views = np.empty((n, STATES)), np.empty((n, 6)), np.empty((n, SHOWN))
    commands, spools = np.empty((n, 10)), np.empty((n, 10))
    slope, total_slope, ahead = np.zeros(STATES), np.zeros(STATES), np.zeros(STATES)
    shown, arrived = np.zeros(SHOWN), trim.copy()
    error, total, drive, squeeze = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(10)
    felt, jolt = np.zeros(6), np.zeros(6)
    rates(0.0, y, arrived, surge[0], legs, platen, inverse, slope, shown)
    rest = shown[PULL : PULL + 10].copy()
    h = 1.0 / (RATE * substeps)
    jacobian = _jacobian(reference[0], nominal, nominal_platen)
    for k in range(n):
        t = k / RATE
        rates(t, y, arrived, surge[k], legs, platen, inverse, slope, shown)
        states[k], accelerations[k], views[k] = y, slope[TWIST : TWIST + 6], shown
        for i in range(10):
            spools[k, i] = y[SPOOL + i] if legs[i].lag != 0.0 else arrived[i]
            squeeze[i] = shown[PULL + i] - rest[i]
        if k % 16 == 0:
            jacobian = _jacobian(reference[k], nominal, nominal_platen)
        for j in range(6):
            error[j] += smoothing[0, j] * (reference[k, j] - y[j] - error[j])
            total[j] += error[j] / RATE
            drive[j] = forward[k, j] + proportional[j] * error[j] + integral[j] * total[j]
        ax, ay, az = turned(_small(y), slope[TWIST], slope[TWIST + 1], slope[TWIST + 2])
        felt[0], felt[1], felt[2], felt[3:] = ax, ay, az, slope[TWIST + 3 : TWIST + 6]
        jolt += smoothing[1] * (acceleration[k] - felt - jolt)
        drive += damping * jolt
        speed = jacobian @ drive - balance @ squeeze
        for i in range(10):
            share = speed[i] / (extend[i] if speed[i] > 0.0 else retract[i])
            most = 1.0 - np.exp(-curve[i] * limit)
            share = max(min(share, most), -most)
            commands[k, i] = trim[i] - np.sign(share) * np.log(1.0 - abs(share)) / curve[i]
        for step in range(substeps):
            now = k + step / substeps
            for i in range(10):  # the command arrives late; over the step it is the mean of what was held
                behind = (legs[i].valve_delay + legs[i].late) * RATE
                first, last = now - behind, now + 1.0 / substeps - behind
                a, b = int(np.floor(first)), int(np.floor(last))
                early, late = commands[a, i] if a >= 0 else trim[i], commands[b, i] if b >= 0 else trim[i]
                part = (last - b) * substeps if b > a else 1.0
                arrived[i] = (1.0 - part) * early + part * late
            ahead[:], total_slope[:] = y, 0.0
            for stage in range(4):
                at = (now / RATE) + NODES[stage] * h
                rates(at, ahead, arrived, surge[k], legs, platen, inverse, slope, shown)
                for j in range(STATES):
                    total_slope[j] += WEIGHTS[stage] * slope[j]
                    ahead[j] = y[j] + NODES[stage + 1] * h * slope[j]
            for j in range(STATES):
                y[j] += h * total_slope[j]
    return states, accelerations, views, commands, spools


@njit(cache=True)
def _small(pose):
    """Rotation of a pose to first order, enough for a feedback."""
    R = np.eye(3)
    R[0, 1], R[0, 2], R[1, 2] = -pose[5], pose[4], -pose[3]
    R[1, 0], R[2, 0], R[2, 1] = pose[5], -pose[4], pose[3]
    return R

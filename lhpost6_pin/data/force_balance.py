"""Balance of all actuators' forces with what weight, struts and inertia require of them.

The forces f_i of all actuators must add up to the required wrench, with b_i the wrench of a unit force (`ports_along`):

    sum_i b_i(t) f_i(t) = required(t) - sum_s b_s(t) f_s(t)       (`required_wrench`; f_s: pulls of the struts)

It is compared on the average over a record, for the actuators that bear the platen (vertical force, roll and pitch),
and in bands of frequency for all. Friction is not known: Coulomb friction along every actuator and viscous friction
along every axis, with free coefficients, are projected out. An axis is weighed so that its component of a wrench counts
as the least forces of the actuators that produce it. What is left is the quadratic form of a Gram matrix per axis, from
which the remainder for any factors of the forces (another unit, another sign) follows.

Actuators that hardly act on each other's axes are judged apart (`actuator_groups`): noise of those that hold still does
not count against those that move.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array, Mask
from ..core.errors import RecordError
from ..core.names import AXES
from ..machine.parameters import Parameters
from ..mechanics.gas_pressure import strut_pressures
from ..mechanics.plant import Plant
from ..mechanics.port_path import PortPath, ports_along
from ..mechanics.pose import PlatenMotion, plant_motion
from ..mechanics.required_wrench import required_wrench
from .conditioning import integrate
from .records import sample_interval
from .signals import Band, differentiate

__all__ = ["ActuatorGroup", "ForceBalance", "actuator_groups", "dynamic_balances", "static_balance"]

VERTICAL = AXES.index("z")
TILTS = (AXES.index("roll"), AXES.index("pitch"))
COUPLED = 0.5  # of the largest wrench of a unit force on an axis, from which on an actuator acts on it
FIRM = 0.1  # of a speed's deviation: below it friction is taken to rise with speed
SAMPLES = 4.0  # a period at the end of a band: what is compared is band limited


class ActuatorGroup(NamedTuple):
    """Actuators that act on axes of their own."""

    actuators: Mask  # (n_actuators,)
    axes: Mask  # (n_axes,) of a plant's free ones


class ForceBalance(NamedTuple):
    """Measured forces against what is required of them together, n actuators on k axes."""

    by: str  # what requires the forces
    gram: Array  # (k, n + 1, n + 1) [N2] mean products of the actuators' shares, and last of what is required
    rubbed: Array  # as gram, of the part that is projected out as friction
    judged: Mask  # (n,) actuators that it can judge

    @property
    def required(self) -> float:
        """Mean square of what is required [N2]."""
        return float(np.sum(self.gram[:, -1, -1]))

    def remainder(self, factor: Array) -> Array:
        """Mean squares [N2] of required less measured forces times `factor` (..., n)."""
        return _missing(self.gram, factor)

    def friction(self, factor: Array) -> Array:
        """Mean squares [N2] of the friction that measured forces times `factor` (..., n) must hold to be right."""
        return _missing(self.rubbed, factor)

    def regression(self, factor: Array) -> tuple[float, float]:
        """Ratio of measured forces times `factor` (n,) to the required ones, and the share of these explained."""
        square = float(np.einsum("i,kij,j->", factor, self.gram[:, :-1, :-1], factor))
        common = float(np.sum(self.gram[:, -1, :-1] @ factor))
        return common / max(self.required, 1e-300), common**2 / max(self.required * square, 1e-300)

    def size(self, factor: Array) -> float:
        """RMS of measured forces times `factor` (n,), with their friction, over that of what is required."""
        whole = self.gram + self.rubbed
        measured = float(np.einsum("i,kij,j->", factor, whole[:, :-1, :-1], factor))
        return float(np.sqrt(measured / max(float(np.sum(whole[:, -1, -1])), 1e-300)))

    def of(self, group: ActuatorGroup) -> "ForceBalance":
        """The balance on the axes of a group, which judges its actuators."""
        return self._replace(gram=self.gram[group.axes], rubbed=self.rubbed[group.axes], judged=group.actuators)


class _Wrenches(NamedTuple):
    """Along a motion of n samples, each component over the size of the wrenches of unit forces on its axis."""

    share: Array  # (n, n_actuators + 1, n_axes) [N] of each actuator, and last of what is required
    friction: Array  # (n, ...) regressors without unit
    dt: float


def actuator_groups(plant: Plant) -> list[ActuatorGroup]:
    """Actuators that act on the same axes in the zero-position: of the LHPOST6 the horizontal and the vertical ones."""
    path, _ = _shares(plant, _rest(), np.zeros((1, plant.spools)))
    size = np.abs(path.column[0, : plant.spools][:, plant.axes])
    part = size / np.maximum(size.max(axis=0), 1e-300)
    acts = part >= np.minimum(COUPLED, part.max(axis=1, keepdims=True))
    groups: list[ActuatorGroup] = []
    left = np.ones(plant.spools, bool)
    while left.any():
        actuators = np.arange(plant.spools) == np.flatnonzero(left)[0]
        for _ in range(plant.spools):
            actuators = acts[:, acts[actuators].any(axis=0)].any(axis=1)
        groups.append(ActuatorGroup(actuators, acts[actuators].any(axis=0)))
        left &= ~actuators
    return groups


def static_balance(plant: Plant, force: Array, group: ActuatorGroup) -> ForceBalance | None:
    """Mean `force` (n, n_actuators) [N] of the group that bears the platen, against weight and struts; None of others.

    Means of other actuators are small, held by friction. Raises SimulationError for a coupled specimen.
    """
    if VERTICAL not in plant.axes[group.axes]:
        return None
    _, share = _shares(plant, _rest(), force.mean(axis=0, keepdims=True))
    axes = group.axes & np.isin(plant.axes, (VERTICAL, *TILTS))
    at_rest = share[0][:, axes]  # (n_actuators + 1, k)
    at_rest[:-1][~group.actuators] = 0.0
    gram = np.einsum("ik,jk->kij", at_rest, at_rest)
    return ForceBalance("weight", gram, np.zeros_like(gram), group.actuators)


def dynamic_balances(record: xr.Dataset, plant: Plant, force: Array, numbers: Parameters) -> Iterator[ForceBalance]:
    """Balance of `force` (n, n_actuators) [N] in each band of `numbers` that the record's rate and length permit.

    None without measured motion, where displacement and acceleration of the platen contradict each other, and where a
    displacement is beyond the stroke. Raises SimulationError for a coupled specimen.
    """
    dt = sample_interval(record)
    pairs = zip(*(numbers.vector(f"balance.{key}") for key in ("band_low", "band_high")), strict=True)
    bands = [Band(low, high) for low, high in pairs if record.sizes["time"] * dt >= 4 / low and 0.4 / dt >= high]
    if not bands:
        return
    motion = _motion(record, bands, numbers.number("balance.agreement"))
    if motion is None:
        return
    try:
        moved = _wrenches(plant, motion, force, dt, bands)
    except RecordError:
        return
    for band in bands:
        share = band.apply(moved.share, moved.dt)
        base, _ = np.linalg.qr(band.apply(moved.friction, moved.dt))
        flat = share.reshape(len(share), -1)
        rubbed = (base @ (base.T @ flat)).reshape(share.shape)
        left, friction = (np.einsum("tik,tjk->kij", x, x) / len(x) for x in (share - rubbed, rubbed))
        yield ForceBalance("inertia", left, friction, np.ones(plant.spools, bool))


def _missing(gram: Array, factor: Array) -> Array:
    """Mean squares [N2] of required less measured forces times `factor` (..., n), of a Gram matrix per axis."""
    both = np.concatenate([factor, np.full((*factor.shape[:-1], 1), -1.0)], axis=-1)
    return np.maximum(np.einsum("...i,kij,...j->...", both, gram, both, optimize=True), 0.0)


def _rest() -> PlatenMotion:
    """One sample of rest in the zero-position."""
    return PlatenMotion(*np.zeros((3, 1, 6)))


def _motion(record: xr.Dataset, bands: list[Band], agreement: float) -> PlatenMotion | None:
    """Motion of C below the highest band's end: of the displacement, if it was measured, else of the acceleration."""
    dt, top = sample_interval(record), Band(high=max(band.high for band in bands))
    measured = {
        name: top.apply(record[f"platen_{name}"].values.astype(float), dt)
        for name in ("displacement", "acceleration")
        if f"platen_{name}" in record
    }
    if "displacement" not in measured:
        if not measured:
            return None
        acceleration = measured["acceleration"]
        speed, _ = integrate(acceleration - acceleration.mean(axis=0), dt)
        return PlatenMotion(np.zeros_like(speed), speed, acceleration)
    speed = differentiate(measured["displacement"], dt)
    acceleration = differentiate(speed, dt)
    if "acceleration" in measured:
        ours, theirs = (bands[0].apply(x, dt)[:, :3].std(axis=0) for x in (acceleration, measured["acceleration"]))
        most = int(np.argmax(ours))
        if not ours[most] / agreement <= theirs[most] <= ours[most] * agreement:
            return None
    return PlatenMotion(measured["displacement"], speed, acceleration)


def _wrenches(plant: Plant, motion: PlatenMotion, force: Array, dt: float, bands: list[Band]) -> _Wrenches:
    """Shares and friction along a motion, at a rate that its bands need."""
    high = max(band.high for band in bands)
    every = max(1, int(1.0 / (SAMPLES * high * dt)))
    motion = PlatenMotion(*(x[::every] for x in motion))
    path, share = _shares(plant, motion, Band(high=high).apply(force, dt)[::every])
    rate, speed = (x / np.maximum(x.std(axis=0), 1e-300) for x in (path.rate[:, : plant.spools], motion.velocity))
    return _Wrenches(share, np.hstack([np.tanh(rate / FIRM), speed[:, plant.axes]]), dt * every)


def _shares(plant: Plant, motion: PlatenMotion, force: Array) -> tuple[PortPath, Array]:
    """Ports along a motion, and the shares of `_Wrenches` of forces (n, n_actuators)."""
    count, struts = plant.spools, plant.machine.struts
    moved = plant_motion(plant, motion)
    path = ports_along(plant, moved)
    pull = -strut_pressures(plant.machine, path.s[:, count : count + len(struts)]) * [s.area for s in struts]
    required = required_wrench(plant, moved, path.turn)
    required -= np.einsum("ts,tsk->tk", pull, path.column[:, count : count + len(struts)])
    given = path.column[:, :count] * force[:, :, None]
    size = np.sqrt(np.sum(np.mean(path.column[:, :count] ** 2, axis=0), axis=0))
    both = np.concatenate([given, required[:, None]], axis=1)[:, :, plant.axes]
    return path, both / np.maximum(size[plant.axes], 1e-300)

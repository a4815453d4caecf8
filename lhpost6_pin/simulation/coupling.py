"""Coupling of a plant with a specimen that takes the motion of its base and returns a wrench.

At every exchange, the start of a controller sample or of each model step, the specimen takes the motion (pose, twist,
acceleration) and returns its wrench w. On the platen's side stand the rigidly attached part of the specimen, M_i, as a
body of the model, and the rest dM of the mass with which the wrench follows an acceleration at once. What acts
on the platen between two exchanges is

    r = w - w_rigid(M_i) + dM a,        (M_table + M_i + dM) a = f + r,

w_rigid of M_i's inertia, gyroscopic terms and weight. r depends on the specimen's state alone and is continued linearly
over the interval from its last two values.

Interface mass. M_inf (6, 6) is the specimen's own (`interface_mass`), or that of pulses: from rest, the acceleration of
the base rises in one component from zero to one over one interval; the change of the wrench is a column of -M_inf. With
the impedance in use, dM = M_inf - M_i; without, dM = 0.

Stability. A wrench that follows the acceleration of the base through M_inf is fed back with one interval's delay by
L = (M_table + M_i + dM)^-1 (M_inf - M_i - dM), whose spectral radius must be below 1. Continued linearly, an eigenvalue
l of L grows per exchange by the larger root of z^2 + 2 l z - l = 0, below 1 for -1 < l < 1/3. `Stability.growth` is the
largest of these; a run with 1 or more is refused.

Energy. The wrench that acts on the platen over an interval and the one that the specimen gives at its ends differ by
what was continued wrongly. Their works on the motion of the base are summed apart; their difference is the energy that
the coupling creates.
"""

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ..core.arrays import Array
from ..core.errors import SimulationError
from ..core.names import SAMPLE_RATE, SCHEMES
from ..mechanics.coupled import (
    BaseMotion,
    CoupledSpecimen,
    base_at_rest,
    rigid_wrench,
    start_coupled,
    step_coupled,
)
from ..mechanics.derivatives import evaluate
from ..mechanics.interface import apparent_mass, base_motion, mass_at_b
from ..mechanics.leg_model import Dynamics, make_dynamics
from ..mechanics.plant import Plant
from ..mechanics.schemes import TAU, A, V
from ..mechanics.specimen_mount import base_placement
from ..mechanics.workspace import Workspace
from .engine_pinocchio import make_stepper

__all__ = [
    "DOUBTFUL",
    "FAILED",
    "Continued",
    "Coupling",
    "CouplingOptions",
    "CouplingResult",
    "Stability",
    "WithOutside",
]
__all__ += ["make_coupling", "stability_of"]

_LEAD = dict(zip(SCHEMES, (1.0, 0.0, 0.5), strict=True))
"""Instant within a model step, in steps, at which a scheme sees the wrench."""
DOUBTFUL = 1e-3
"""Share of the energy through the interface from which what the exchange created is a warning."""
FAILED = -2
"""Status of a stage whose specimen failed."""
_NEGATIVE = -1e-3
"""Least eigenvalue of the interface mass over that of the platen that a probe may show by rounding."""


class CouplingOptions(NamedTuple):
    """How a specimen is coupled."""

    every_step: bool = False  # exchange at every model step, not once a controller sample
    impedance: bool = True  # interface mass beyond the rigid part on the platen's side
    order: int = 1  # wrench between exchanges: 0 held, 1 continued linearly


class Stability(NamedTuple):
    """The criterion of an exchange: see the module."""

    interface_mass: Array  # (6, 6) M_inf at the base in base axes, linear first
    spectral_radius: float  # of L
    growth: float  # per exchange, with the wrench continued


class CouplingResult(NamedTuple):
    """Results of a coupled run: n samples."""

    wrench: Array  # (n, 6) of the specimen on the platen at its base, base axes, at each sample [N, N m]
    acceleration: Array  # (n, nv) of the plant at each sample
    work_specimen: float  # work of the exchanged wrench as the specimen gives it [J]
    work_platen: float  # as it acts on the platen [J]
    energy: float  # largest energy that passed the interface, either way [J]
    stability: Stability

    @property
    def energy_error(self) -> float:
        """Energy that the coupling created, over the largest that passed the interface [1]."""
        return (self.work_platen - self.work_specimen) / max(self.energy, np.finfo(float).tiny)

    @property
    def summary(self) -> str:
        """Energy and stability of the exchange in one sentence."""
        return (
            f"coupled specimen: at most {self.energy / 1e3:.4g} kJ passed its base; the exchange created "
            f"{self.energy_error:.2g} of it and damps its errors to {self.stability.growth:.2g} per exchange (below 1: "
            "stable)"
        )

    def every(self, step: int, rows: int) -> "CouplingResult":
        """With every `step`-th sample, `rows` in all."""
        return self._replace(wrench=self.wrench[::step][:rows], acceleration=self.acceleration[::step][:rows])


class Continued:
    """A wrench (6,) known at instants, held or continued linearly in between, over one interval at most."""

    def __init__(self, start: Array, order: int) -> None:
        """Constant before the first `take`."""
        if order not in (0, 1):
            raise SimulationError(f"order {order} of a continued wrench; 0: held, 1: linear")
        self.order, self.value, self.slope = order, np.array(start, float), np.zeros(6)
        self._interval = self._age = 0.0

    def take(self, value: Array, dt: float) -> None:
        """Take the value dt [s] after the last."""
        if self.order and dt > 0.0:
            self.slope = (value - self.value) / dt
        self.value, self._interval, self._age = value, dt, 0.0

    def later(self, dt: float) -> None:
        """Let dt [s] pass without a new value."""
        self._age += dt

    def at(self, t: float) -> Array:
        """Value at a time [s] from now."""
        return np.asarray(self.value + min(self._age + t, self._interval) * self.slope)


def stability_of(plant: Plant, dt: float, options: CouplingOptions) -> tuple[Stability, Array]:
    """Criterion of an exchange every dt [s], and dM (6, 6) at B; raises SimulationError for an impossible mass."""
    coupled = plant.coupled
    assert coupled is not None
    mass = _interface_mass(coupled, base_at_rest(plant.machine), plant.machine.platen.gravity, dt)
    rest = mass_at_b(base_placement(plant.machine), mass - coupled.inertia.matrix())
    table, axes = apparent_mass(plant), np.ix_(plant.axes, plant.axes)
    added = rest if options.impedance else np.zeros((6, 6))
    name = type(coupled).__name__
    bare = table - mass_at_b(base_placement(plant.machine), np.array(coupled.inertia.matrix()))
    own = mass_at_b(base_placement(plant.machine), mass)
    if np.linalg.eigvals(np.linalg.solve(bare[axes], own[axes])).real.min() < _NEGATIVE:
        raise SimulationError(
            f"the wrench of {name} grows with the acceleration of its base instead of opposing it; it must be that of "
            "the specimen on the platen: check its sign"
        )
    values = np.linalg.eigvals(np.linalg.solve((table + added)[axes], (rest - added)[axes]))
    radius = float(np.abs(values).max())
    growth = radius if not options.order else max(float(np.abs(np.roots([1.0, 2.0 * x, -x])).max()) for x in values)
    return Stability(mass, radius, growth), added


def _interface_mass(coupled: CoupledSpecimen, base: BaseMotion, gravity: float, dt: float) -> Array:
    """M_inf (6, 6) at the base: what the specimen states, or the columns of six pulses from rest."""
    name = type(coupled).__name__
    state = getattr(coupled, "interface_mass", None)
    if callable(state) and (given := state(dt)) is not None:
        stated = np.asarray(given, float)
        if stated.shape != (6, 6) or not np.isfinite(stated).all():
            raise SimulationError(f"{name}.interface_mass must return a finite matrix (6, 6), linear first")
        return stated
    at_rest = np.array(step_coupled(coupled, start_coupled(coupled, base, gravity)[0], base, dt, "at rest").vector)
    columns = []
    for k in range(6):
        unit = pin.Motion(np.eye(6)[k])
        moved = BaseMotion(base.pose * pin.exp6(dt * dt / 6.0 * unit), 0.5 * dt * unit, unit)
        memory, _ = start_coupled(coupled, base, gravity)
        columns.append(at_rest - step_coupled(coupled, memory, moved, dt, "in a pulse of its base").vector)
    return np.column_stack(columns)


class Coupling:
    """A plant with a coupled specimen, advanced sample by sample; `advance` is a `Stepper`.

    Attributes: stability; trouble, what the specimen raised when `advance` returned `FAILED`.
    """

    def __init__(self, plant: Plant, scheme: str, dt: float, steps: int, options: CouplingOptions) -> None:
        """Start the specimen at rest. Raises SimulationError for an exchange that would be unstable."""
        self._plant, self._dt, self._lead = plant, dt, _LEAD[scheme] * dt
        self._stale = scheme != SCHEMES[0]
        self._every = 1 if options.every_step else steps
        self._interval = dt * self._every
        self.stability, self._added = stability_of(plant, self._interval, options)
        _refuse_growth(plant, self.stability, options)
        axes = plant.axes
        table = apparent_mass(plant)[np.ix_(axes, axes)]
        share = np.linalg.solve(table + self._added[np.ix_(axes, axes)], table)
        accelerate = make_dynamics(plant)
        self._forward: Dynamics = accelerate
        if self._added.any():
            self._forward = lambda q, v, tau: share @ accelerate(q, v, tau)
        self._step = make_stepper(plant, scheme, dt, self._forward)
        self._placement = base_placement(plant.machine)
        assert plant.coupled is not None
        self._specimen = plant.coupled
        gravity = plant.machine.platen.gravity
        self._memory, self._wrench = start_coupled(plant.coupled, base_at_rest(plant.machine), gravity)
        self._rest = Continued(plant.rest_external, options.order)
        self._exchanges, self._t, self._history = 0, 0.0, True
        self.trouble: str | None = None
        self._moved, self._swept, self._last_v = np.zeros(6), np.zeros(6), np.zeros(6)
        self._works, self._passed, self._peak = np.zeros(2), 0.0, 0.0
        self._wrenches: list[Array] = []
        self._accelerations: list[Array] = []

    def without_history(self) -> "Coupling":
        """Keep the last sample's rows only, for plants that run without end."""
        self._history = False
        return self

    def evaluate(self, ws: Workspace, spool: Array) -> int:
        """As `evaluate_derivatives`, with the interface mass."""
        status = evaluate(self._plant, ws, spool)
        if status == 0:
            ws.motion[A] = self._forward(ws.q, ws.motion[V], ws.motion[TAU])
        return status

    def advance(self, ws: Workspace, window: Array, outside: Continued | None = None) -> int:
        """Advance over the model steps of a sample, spool (n_steps, nu); returns the stage status."""
        if outside is not None:
            ws.external[:] = self._rest.at(self._t) + outside.at(0.0)
        for i in range(len(window)):
            held = window[i : i + 1]
            if i % self._every == 0:
                if self._stale and (status := self.evaluate(ws, held[0])):
                    return status
                try:
                    self._exchange(ws)
                except SimulationError as error:  # the results so far are kept
                    self.trouble = str(error)
                    return FAILED
                if i == 0:
                    if not self._history:
                        self._wrenches.clear()
                        self._accelerations.clear()
                    self._wrenches.append(self._wrench.vector.copy())
                    self._accelerations.append(ws.motion[A].copy())
            ws.external[:] = self._rest.at(self._t + self._lead)
            if outside is not None:
                ws.external[:] += outside.at(i * self._dt + self._lead)
            if status := self._step(ws, held):
                return status
            self._t += self._dt
            twist = self._scatter(ws.motion[V])
            self._moved += self._dt * twist
            self._swept += self._dt * self._t * twist
        return 0

    def result(self) -> CouplingResult:
        """What was exchanged so far."""
        rows = np.array(self._wrenches).reshape(-1, 6), np.array(self._accelerations).reshape(len(self._wrenches), -1)
        return CouplingResult(*rows, float(self._works[0]), float(self._works[1]), self._peak, self.stability)

    def _scatter(self, v: Array) -> Array:
        """Components (6,) of the platen's free axes."""
        if self._plant.axes.size == 6:
            return v[:6]
        out = np.zeros(6)
        out[self._plant.axes] = v[: self._plant.axes.size]
        return out

    def _exchange(self, ws: Workspace) -> None:
        base = base_motion(self._plant, ws, self._placement)
        power = float(self._wrench.vector @ self._last_v)
        if self._exchanges:
            when = f"at {self._exchanges * self._interval:.4f} s"
            self._wrench = step_coupled(self._specimen, self._memory, base, self._interval, when)
        rigid = rigid_wrench(self._specimen.inertia, base, self._plant.machine.platen.gravity)
        rest = self._placement.act(self._wrench - rigid).vector + self._added @ self._scatter(ws.motion[A])
        if self._exchanges:
            old, slope = self._rest.value, self._rest.slope
            true = (rest - old) / self._interval
            self._works += [old @ self._moved + x @ self._swept for x in (true, slope)]
            self._last_v = base.twist.vector.copy()
            self._passed += 0.5 * self._interval * (power + float(self._wrench.vector @ self._last_v))
            self._peak = max(self._peak, abs(self._passed))
        self._rest.take(rest, self._interval if self._exchanges else 0.0)
        self._exchanges += 1
        self._t = 0.0
        self._moved, self._swept = np.zeros(6), np.zeros(6)


class WithOutside:
    """A `Stepper` of a plant, coupled or not, that adds a wrench (6,) from outside at B in platen axes."""

    def __init__(self, plant: Plant, scheme: str, dt: float, coupled: Coupling | None) -> None:
        """`coupled`: that of the plant's specimen, if it has one."""
        self._coupled, self._dt, self._lead = coupled, dt, _LEAD[scheme] * dt
        self._plain = make_stepper(plant, scheme, dt)

    def __call__(self, ws: Workspace, window: Array, outside: Continued | None) -> int:
        """Advance over the model steps of a sample; returns the stage status."""
        if self._coupled is not None:
            return self._coupled.advance(ws, window, outside)
        if outside is None:
            return self._plain(ws, window)
        for i in range(len(window)):
            ws.external[:] = outside.at(i * self._dt + self._lead)
            if status := self._plain(ws, window[i : i + 1]):
                return status
        return 0


def make_coupling(
    plant: Plant, scheme: str, steps_per_second: int, options: CouplingOptions | None = None
) -> Coupling | None:
    """Coupling of a plant with its specimen, None if its specimen is not coupled; raises as `Coupling` does."""
    if plant.coupled is None:
        return None
    steps = steps_per_second // SAMPLE_RATE
    return Coupling(plant, scheme, 1.0 / steps_per_second, steps, options or CouplingOptions())


def _refuse_growth(plant: Plant, found: Stability, options: CouplingOptions) -> None:
    if found.growth < 1.0:
        return
    name: Any = plant.machine.specimen.name if plant.machine.specimen else ""
    remedy = "state the rigidly attached part in its inertia"
    if not options.impedance:
        remedy = "couple it with the interface impedance, or " + remedy
    raise SimulationError(
        f"the exchange with {name} would be unstable: errors grow by {found.growth:.3g} per exchange, the spectral "
        f"radius of (M_table + M_i)^-1 (M_inf - M_i) is {found.spectral_radius:.3g}; {remedy}"
    )

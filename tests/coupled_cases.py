"""A tower of floors on springs as a specimen in Python, and the same tower in one set of equations with the plant."""

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from scipy.linalg import eigh, expm

from lhpost6_pin.core.arrays import Array
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.mechanics.coupled import rigid_wrench
from lhpost6_pin.mechanics.derivatives import rates_at
from lhpost6_pin.mechanics.equilibrium import Equilibrium
from lhpost6_pin.mechanics.interface import apparent_mass, base_motion, mass_at_b
from lhpost6_pin.mechanics.plant import Plant, State
from lhpost6_pin.mechanics.schemes import TAU, V_SEEN, V
from lhpost6_pin.mechanics.specimen_mount import base_placement
from lhpost6_pin.mechanics.workspace import make_workspace
from lhpost6_pin.simulation.simulate import OpenLoop

FULL = np.ones(3, bool)
SHEAR = np.array([True, True, False])


@dataclass
class Tower:
    """Floors, each on springs to the one below along the free directions; else they ride on the base.

    Linear about the base: its axes turn with the platen; what it neglects is of second order in the turn.
    """

    mass: Array  # (n,) of the floors [kg]
    height: Array  # (n,) above the base [m]
    stiffness: Array  # (n, 3) of the storeys [N/m]
    free: Array = field(default_factory=lambda: FULL)  # of x, y, z
    damping: float = 0.02
    inertia: pin.Inertia = field(default_factory=pin.Inertia.Zero)

    def __post_init__(self) -> None:
        n = len(self.mass)
        dofs = [(i, k) for i in range(n) for k in range(3)]
        rows = np.array([np.hstack([np.eye(3), -pin.skew(np.array([0.0, 0.0, h]))]) for h in self.height])
        self.all = rows.reshape(-1, 6)  # motion of all floors with the base
        self.masses = np.repeat(self.mass, 3)
        moves = np.array([self.free[k] for _, k in dofs])
        self.R, self.M = self.all[moves], np.diag(self.masses[moves])
        stiff = np.zeros((3 * n, 3 * n))
        for i in range(n):
            for k in range(3):
                a = 3 * i + k
                stiff[a, a] += self.stiffness[i, k]
                if i:
                    stiff[a - 3, a - 3] += self.stiffness[i, k]
                    stiff[a, a - 3] -= self.stiffness[i, k]
                    stiff[a - 3, a] -= self.stiffness[i, k]
        self.K = stiff[np.ix_(moves, moves)]
        values, shapes = eigh(self.K, self.M)
        self.frequency = np.sqrt(values) / (2 * np.pi)
        self.C = self.M @ shapes @ np.diag(2 * self.damping * np.sqrt(values)) @ shapes.T @ self.M
        rigid = self.all[~moves]
        self.riding = rigid.T @ np.diag(self.masses[~moves]) @ rigid  # mass that has no freedom
        self.moves, self._steps = moves, {}

    @property
    def m_inf(self) -> Array:
        return self.riding + self.inertia.matrix()

    def field(self, base, gravity: float) -> Array:
        """Acceleration of the base, less gravity, with the centrifugal part of the floors (n,)."""
        turn = pin.skew(base.twist.angular) @ pin.skew(base.twist.angular)
        around = (np.column_stack([0 * self.height, 0 * self.height, self.height]) @ turn.T).ravel()
        a = base.acceleration.vector.copy()
        a[:3] += gravity * base.pose.rotation[2]
        return self.all @ a + around

    def rates(self, u: Array, v: Array, a: Array) -> Array:
        return -np.linalg.solve(self.M, self.C @ v + self.K @ u) - a[self.moves]

    def wrench(self, u: Array, v: Array, a: Array, base, gravity: float) -> pin.Force:
        total = self.R.T @ (self.C @ v + self.K @ u)
        total -= self.all[~self.moves].T @ (self.masses[~self.moves] * a[~self.moves])
        return pin.Force(total) + rigid_wrench(self.inertia, base, gravity)

    def init(self, base, gravity):
        a = self.field(base, gravity)
        u = np.linalg.solve(self.K, -self.M @ a[self.moves])
        memory = {"x": np.concatenate([u, 0 * u]), "a": a, "gravity": gravity}
        return memory, self.wrench(u, 0 * u, a, base, gravity)

    def step(self, memory, base, dt):
        """Exact for an acceleration that is linear over the step."""
        n = len(self.K)
        if dt not in self._steps:
            zero, one = np.zeros((n, n)), np.eye(n)
            A = np.block([[zero, one], [-np.linalg.solve(self.M, self.K), -np.linalg.solve(self.M, self.C)]])
            B = np.vstack([zero, -one])
            big = np.zeros((4 * n, 4 * n))
            big[: 2 * n, : 2 * n], big[: 2 * n, 2 * n : 3 * n] = A, B
            big[2 * n : 3 * n, 3 * n :] = one
            self._steps[dt] = expm(big * dt)[: 2 * n]
        a = self.field(base, memory["gravity"])
        old = memory["a"][self.moves]
        memory["x"] = self._steps[dt] @ np.concatenate([memory["x"], old, (a[self.moves] - old) / dt])
        memory["a"] = a
        return self.wrench(memory["x"][:n], memory["x"][n:], a, base, memory["gravity"])


def tower(mass: float, *, free: Array = FULL, frequency: float = 4.0, rigid: float = 0.1, **more) -> Tower:
    """Three storeys of a total mass [kg], the lowest frequency along x [Hz]; `rigid` of it is a base slab."""
    floors = np.full(3, (1.0 - rigid) * mass / 3.0)
    k = floors[0] * (2 * np.pi * frequency) ** 2 / 0.198
    slab = rigid * mass
    inertia = (
        pin.Inertia(slab, np.array([0.0, 0.0, 0.2]), slab * np.diag([3.0, 4.0, 6.0])) if slab else pin.Inertia.Zero()
    )
    stiffness = k * np.array([[1.0, 1.4, 20.0], [0.8, 1.1, 16.0], [0.6, 0.9, 12.0]])
    return Tower(floors, np.array([3.0, 6.0, 9.0]), stiffness, free, inertia=inertia, **more)


def monolithic(plant: Plant, start: State, spool: Array, dt: float) -> tuple[Array, Array]:
    """Q and v (n, .) of plant and tower as one set of equations by RK4, spool (n, n_actuators) held over each step."""
    own, place, gravity = plant.coupled, base_placement(plant.machine), plant.machine.platen.gravity
    ws, model = make_workspace(plant, start), plant.model
    data = model.createData()
    rest = mass_at_b(place, own.m_inf - own.inertia.matrix())
    whole = apparent_mass(plant) + rest
    n = len(own.K)
    memory, _ = own.init(base_motion(plant, ws, place), gravity)

    def rates(q, v, z, x, held):
        ws.motion[V_SEEN] = ws.motion[V] = v
        ws.external[:] = 0.0
        ws.motion[1] = 0.0  # acceleration: what is left of the wrench without it
        base = base_motion(plant, ws._replace(q=q), place)
        field = own.field(base, gravity)
        wrench = own.wrench(x[:n], x[n:], field, base, gravity) - rigid_wrench(own.inertia, base, gravity)
        ws.external[:] = place.act(wrench).vector
        assert rates_at(plant, ws, q, z, held) == 0
        bare = pin.aba(model, data, q, v, ws.motion[TAU])  # M^-1 (tau - bias)
        a = np.linalg.solve(whole, apparent_mass(plant) @ bare)
        ws.motion[1] = a
        base = base_motion(plant, ws._replace(q=q), place)
        return a, ws.zd.copy(), np.concatenate([x[n:], own.rates(x[:n], x[n:], own.field(base, gravity))])

    q, v, z, x = start.q.copy(), start.v.copy(), start.z.copy(), memory["x"]
    out = [(q, v)]
    for held in spool:
        total, dq = [0.0, 0.0, 0.0, 0.0], np.zeros_like(v)
        a, dz, dx = np.zeros_like(v), np.zeros_like(z), np.zeros_like(x)
        for reach, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            # the twist of the next stage moves the pose: the body's own rate suffices at steps of 1e-5 s
            qs = pin.integrate(model, q, reach * dt * dq)
            vs, zs, xs = v + reach * dt * a, z + reach * dt * dz, x + reach * dt * dx
            a, dz, dx = rates(qs, vs, zs, xs, held)
            dq = vs
            total = [s + weight / 6.0 * r for s, r in zip(total, (dq, a, dz, dx), strict=True)]
        q, v, z, x = pin.integrate(model, q, dt * total[0]), v + dt * total[1], z + dt * total[2], x + dt * total[3]
        out.append((q, v))
    qs, vs = zip(*out, strict=True)
    return np.array(qs), np.array(vs)


def moving(rest: Equilibrium, samples: int) -> OpenLoop:
    """All axes by sines of a frequency of its own per actuator, about rest."""
    t = np.arange(samples)[:, None] / SAMPLE_RATE
    size = np.where(np.arange(len(rest.spool)) < 4, 0.05, 0.015)
    return OpenLoop(rest.spool + size * np.sin(2 * np.pi * t * np.linspace(3.0, 8.0, len(rest.spool))), rest.state)


def relative(found: Array, true: Array) -> float:
    """RRMSE of a motion (n, 6) whose components of one kind share their scale."""
    parts = (slice(0, 3), slice(3, 6))
    return max(np.linalg.norm((found - true)[:, p]) / np.linalg.norm(true[:, p]) for p in parts)

"""An OpenSees model as a coupled specimen.

    def build(ops, base):
        ops.node(2, 0.0, 0.0, 3.0)
        ops.mass(2, 2e4, 2e4, 2e4, 0.0, 0.0, 0.0)
        ops.fix(2, 0, 1, 1, 1, 1, 1)
        ops.uniaxialMaterial("Steel02", 1, 1.5e5, 2.5e7, 0.03, 18.0, 0.925, 0.15)
        ops.element("twoNodeLink", 1, base, 2, "-mat", 1, "-dir", 2)

`build` finds a model of three dimensions with six degrees of freedom per node, and the node `base` fixed at the origin.
It adds nodes, masses, materials, elements and damping (`rayleigh`, `modalDamping`), perhaps recorders. SI units; z up.

The model moves relative to its base. At each exchange the inertial forces of the base's motion act on its masses,

    M u'' + C u' + f(u) = -M (R (a - g) + omega x (omega x r)),

R the motion of a degree of freedom with the base, a the acceleration of the base (linear and angular), g gravity in
axes of the base. That is exact for all six components of a base that moves without limit, but for what the relative
motion u adds to it: Coriolis force, and inertia of the turning base at r + u in place of r. All fixed degrees of
freedom move with the base; their masses ride on it. The wrench is the rate of momentum of all masses,
-R^T M (u'' + R (a - g) + omega x (omega x r)): no damping force is lost, and levers are those of the undeformed model.
Loads other than gravity and masses shared between fixed and free degrees of freedom are not taken.

OpenSees holds one model at a time in a process. Time integration: Newmark, constant average acceleration, one step per
exchange; its relative error of a period is (omega dt)^2 / 12.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.sparse import csr_matrix

from ..core.arrays import Array
from ..core.errors import SimulationError
from ..core.optional import INSTALL
from ..core.user_code import call_user
from .coupled import BaseMotion

__all__ = ["OpenSeesSpecimen", "import_opensees"]

BASE = 1
"""Tag of the node that a model stands on."""
_PATTERN = 900_001
_GRAVITY_STEPS = 10
_TOLERANCE = 1e-12
"""Displacement increment [m] at which an equilibrium iteration ends."""
_ITERATIONS = 50
_DENSE = 100
"""Degrees of freedom up to which products with a full mass matrix are the faster."""


def import_opensees() -> Any:
    """Module of OpenSees; raises SimulationError that says how to install it."""
    try:
        import openseespy.opensees as ops
    except (ImportError, RuntimeError) as error:
        raise SimulationError(
            f"an OpenSees model needs openseespy: {INSTALL['openseespy']}; on Debian and Ubuntu its "
            f"libraries too: apt-get install libblas3 liblapack3 ({error})"
        ) from error
    return ops


class OpenSeesSpecimen:
    """A coupled specimen whose equations OpenSees integrates; `coupled.CoupledSpecimen`."""

    inertia = pin.Inertia.Zero()

    def __init__(self, build: Callable[[Any, int], Any], name: str) -> None:
        """Build the model once, to read its masses; raises SimulationError naming what is wrong with it."""
        self._ops, self._build, self.name = import_opensees(), build, name
        self._start()
        self._read_masses()

    def build(self, ops: Any, base: int) -> None:
        """Call the user's function."""
        self._build(ops, base)

    def interface_mass(self, dt: float) -> Array:
        """Masses (6, 6) that ride on the base; the others follow it through the model's elements."""
        return np.asarray(self._fixed.T @ (self._fixed_mass[:, None] * self._fixed))

    def init(self, base: BaseMotion, gravity: float) -> tuple[dict[str, float], pin.Force]:
        """Model at rest under gravity, by a static analysis."""
        ops = self._ops
        self._start()
        field = self._field(base, gravity)
        self._load(field[0], "Linear")
        self._solver()
        ops.integrator("LoadControl", 1.0 / _GRAVITY_STEPS)
        ops.analysis("Static")
        if ops.analyze(_GRAVITY_STEPS):
            raise SimulationError(f"{self.name}: OpenSees finds no equilibrium under gravity; is the model supported?")
        ops.loadConst("-time", 0.0)
        ops.wipeAnalysis()
        self._solver()
        ops.integrator("Newmark", 0.5, 0.25)
        ops.analysis("Transient")
        return {"gravity": gravity, "time": 0.0}, self._wrench(np.zeros(len(self._free)), *field)

    def step(self, memory: dict[str, float], base: BaseMotion, dt: float) -> pin.Force:
        """One step of the model under the inertial forces at its end."""
        ops = self._ops
        field = self._field(base, memory["gravity"])
        ops.remove("loadPattern", _PATTERN)
        self._load(field[0], "Constant")
        memory["time"] += dt
        if ops.analyze(1, dt):
            ops.algorithm("KrylovNewton")
            failed = ops.analyze(1, dt)
            ops.algorithm("Newton")
            if failed:
                raise SimulationError(f"{self.name}: OpenSees finds no equilibrium at {memory['time']:.4f} s")
        relative = {node: ops.nodeAccel(node) for node in self._nodes}
        return self._wrench(np.array([relative[node][dof] for node, dof in self._places]), *field)

    def _start(self) -> None:
        ops = self._ops
        ops.wipe()
        ops.model("basic", "-ndm", 3, "-ndf", 6)
        ops.node(BASE, 0.0, 0.0, 0.0)
        ops.fix(BASE, *[1] * 6)
        call_user(self, "build", "", SimulationError, ops, BASE)

    def _solver(self) -> None:
        ops = self._ops
        ops.constraints("Transformation")
        ops.numberer("RCM")
        ops.system("BandGeneral")
        ops.test("NormDispIncr", _TOLERANCE, _ITERATIONS, 0)
        ops.algorithm("Newton")

    def _read_masses(self) -> None:
        """Mass matrix of the free degrees of freedom, masses of the fixed ones, and their motion with the base."""
        ops = self._ops
        held = set(ops.getFixedNodes())
        if all(node in held and len(ops.getFixedDOFs(node)) == 6 for node in ops.getNodeTags()):
            raise SimulationError(f"{self.name}: the model has no free degree of freedom; OpenSees cannot solve it")
        ops.constraints("Transformation")
        ops.numberer("RCM")
        ops.system("FullGeneral")
        ops.test("NormDispIncr", _TOLERANCE, 1, 0)
        ops.algorithm("Linear")
        ops.integrator("GimmeMCK", 1.0, 0.0, 0.0)
        ops.analysis("Transient")
        ops.analyze(1, 0.0)
        n = ops.systemSize()
        places: dict[int, tuple[int, int]] = {}
        rows, masses = [], []
        for node in ops.getNodeTags():
            numbers, motion = ops.nodeDOFs(node), _rigid_motion(np.array(ops.nodeCoord(node)))
            fixed = set(ops.getFixedDOFs(node)) if node in ops.getFixedNodes() else set()
            for dof, number in enumerate(numbers):
                if number >= 0:
                    places.setdefault(number, (node, dof))
                elif dof + 1 in fixed and (mass := ops.nodeMass(node, dof + 1)):
                    rows.append((motion[dof], np.array(ops.nodeCoord(node)), dof))
                    masses.append(mass)
        if not n or set(places) != set(range(n)):
            raise SimulationError(f"{self.name}: OpenSees numbers {n} free degrees of freedom, {len(places)} of nodes")
        matrix = np.array(ops.printA("-ret")).reshape(n, n)
        self._places = [places[k] for k in range(n)]
        where = [np.array(ops.nodeCoord(node)) for node, _ in self._places]
        self._free = np.array([_rigid_motion(at)[dof] for at, (_, dof) in zip(where, self._places, strict=True)])
        self._mass = matrix if n <= _DENSE else csr_matrix(matrix)
        self._levers = _levers(where, [dof for _, dof in self._places])
        self._fixed = np.array([row for row, _, _ in rows]).reshape(-1, 6)
        self._fixed_mass = np.array(masses)
        self._fixed_levers = _levers([at for _, at, _ in rows], [dof for _, _, dof in rows])
        heavy = np.abs(matrix).sum(axis=1) > 0.0
        self._loaded: dict[int, list[tuple[int, int]]] = {}
        for k, (node, dof) in enumerate(self._places):
            if heavy[k]:
                self._loaded.setdefault(node, []).append((dof, k))
        self._nodes = sorted({node for node, _ in self._places})
        if not heavy.any() and not masses:
            raise SimulationError(f"{self.name}: the model has no mass; give its nodes ops.mass(...)")

    def _field(self, base: BaseMotion, gravity: float) -> tuple[Array, Array]:
        """Acceleration of free and of fixed degrees of freedom with the base, less gravity."""
        a = base.acceleration.vector.copy()
        a[:3] += gravity * base.pose.rotation[2]
        spin = pin.skew(base.twist.angular)
        turn = (spin @ spin).ravel()
        return self._free @ a + self._levers @ turn, self._fixed @ a + self._fixed_levers @ turn

    def _load(self, field: Array, series: str) -> None:
        ops, force = self._ops, -(self._mass @ field)
        if _PATTERN in ops.getPatterns():
            ops.remove("loadPattern", _PATTERN)
        ops.remove("timeSeries", _PATTERN)
        ops.timeSeries(series, _PATTERN)
        ops.pattern("Plain", _PATTERN, _PATTERN)
        for node, dofs in self._loaded.items():
            values = [0.0] * 6
            for dof, k in dofs:
                values[dof] = float(force[k])
            ops.load(node, *values)

    def _wrench(self, relative: Array, field: Array, fixed: Array) -> pin.Force:
        total = self._free.T @ (self._mass @ (relative + field)) + self._fixed.T @ (self._fixed_mass * fixed)
        return pin.Force(-total)


def _rigid_motion(at: Array) -> Array:
    """Motion (6, 6) of a node's degrees of freedom with a unit twist of the base, linear first."""
    return np.block([[np.eye(3), -pin.skew(at)], [np.zeros((3, 3)), np.eye(3)]])


def _levers(where: list[Array], dofs: list[int]) -> Array:
    """Matrix (n, 9) that gives (S r) along each degree of freedom from the entries of S; zero for rotations."""
    out = np.zeros((len(dofs), 9))
    for k, (at, dof) in enumerate(zip(where, dofs, strict=True)):
        if dof < 3:
            out[k, 3 * dof : 3 * dof + 3] = at
    return out

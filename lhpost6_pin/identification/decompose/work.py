"""Power and energy of every effect on the platen: its wrench times the twist of C, in {c}.

Inertia's work is the change of kinetic energy, but for the work of Eq. 4-26's direction-dependent mass (`energy`); the
rest is error of quadrature, and of velocity and acceleration as derivatives of each other.
"""

from typing import NamedTuple

import numpy as np

from ...core.arrays import Array
from ...mechanics.pose import rotation
from ...mechanics.rigid_body import platen_inertia
from .record import Decomposed

__all__ = ["Work", "delivered_by", "find_work"]


UNEXPLAINED = "unexplained"


class Work(NamedTuple):
    """Work on the platen over the samples compared, in the sensors' whole band."""

    time: Array  # (n,) [s]
    effects: tuple[str, ...]  # (m,) of the ledger, actuators as measured, and the unexplained rest
    power: Array  # (n, m) [W], positive into the platen
    energy: Array  # (n, m) since the first sample [J]
    inertia: Array  # (n,) work of inertia since the first sample [J]: the sum of all effects
    kinetic: Array  # (n,) change of kinetic energy since the first sample [J]

    @property
    def unbalanced(self) -> Array:
        """Work of inertia less the change of kinetic energy (n,) [J]."""
        return self.inertia - self.kinetic


def delivered_by(found: Decomposed, *, whole: bool = False) -> tuple[tuple[str, ...], Array]:
    """Effects and their wrenches (n, m, 6): the ledger's with the actuators' as measured, and the unexplained rest.

    Their sum is the inertia. In the band compared, or `whole` in the sensors' band, edges cut all the same.
    """
    forces, part = (found.whole, found.inside) if whole else (found.forces, slice(None))
    effects = forces.ledger.effects
    wrench = np.concatenate([forces.ledger.wrench[part], forces.residual[part, None]], axis=1)
    for k, effect in enumerate(found.plant.machine.effects):
        if effect.spools:
            wrench[:, k] = forces.component_wrench[part][:, list(effect.spools)].sum(axis=1)
    return (*effects, UNEXPLAINED), wrench


def find_work(found: Decomposed) -> Work:
    """Power of every effect, its energy by the trapezoidal rule, and the balance of kinetic energy."""
    from scipy.integrate import cumulative_trapezoid

    effects, wrench = delivered_by(found, whole=True)
    part = found.inside
    motion, states = found.test.motion, found.whole.states
    v = np.zeros((len(found.time), 6))
    v[:, found.plant.axes] = states.v[part]  # twist of B in platen axes, as forces saw it
    turn = rotation(motion.displacement[part, 3:])
    lever = found.plant.body[0]["rho_c"]
    linear = v[:, :3] + np.cross(v[:, 3:], lever)
    twist = np.hstack([np.einsum("nij,nj->ni", turn, x) for x in (linear, v[:, 3:])])
    power = np.einsum("nmj,nj->nm", wrench, twist)
    _, mass = platen_inertia(found.plant.model, found.plant.machine)
    kinetic = 0.5 * np.einsum("ni,ij,nj->n", v, mass, v)
    energy = cumulative_trapezoid(power, dx=found.dt, axis=0, initial=0.0)
    return Work(found.time, effects, power, energy, energy.sum(axis=1), kinetic - kinetic[0])

"""The wrench of a specimen on the platen from measured forces: base shear, axial force, overturning moments, torsion.

It is what the bare table's motion requires, less the measured actuator forces and the table's struts, weight and
friction: no motion of the specimen is needed. Beside it stand what a specimen's floors require (their masses times
their accelerations) where they were measured, and what the mounted model predicts under the measured motion.

Standard deviations over time are those of the sensors' noise (constant over time), their gains, offsets and skews, and
the bare table's parameters, propagated linearly and added in squares (`agreement`). They hold at the calibration given:
the standard deviations of an override, as `calibrate` writes them for a bare table, or those of the machine file.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.special import ndtri

from ...core.arrays import Array
from ...mechanics.interface_wrench import INTERFACE_AXES, at_interface, wrenches_at_b
from ...mechanics.pose import PlantMotion, rotation
from ...simulation.specimen_response import driven_wrenches
from ..inverse_dynamics import BASE_SHEAR, SPECIMEN
from .record import Decomposed, decompose_numbers

__all__ = ["InterfacePeak", "InterfaceWrench", "find_interface", "interface_at"]


class InterfacePeak(NamedTuple):
    """Peak of one component by magnitude."""

    component: str  # of `INTERFACE_AXES`
    value: float  # [N, N m]
    time: float  # [s]
    half_width: float  # of the interval, which is that of all samples at once: the largest of them is taken
    predicted: float  # peak of the mounted model's, NaN without a model

    @property
    def shown(self) -> bool:
        """Whether it is distinguished from zero."""
        return abs(self.value) > self.half_width


@dataclass(frozen=True)
class InterfaceWrench:
    """Wrench of the specimen on the platen at the interface in platen axes; n compared samples [N, N m]."""

    time: Array  # (n,) [s]
    wrench: Array  # (n, 6) from measured forces
    noise: Array  # (6,) standard deviation by the sensors' noise
    sensors: Array  # (n, 6) by calibration errors of the sensors
    parameters: Array  # (n, 6) by the bare table's parameters
    confidence: float  # of the interval
    crossings: float  # of zero, upwards, by the noise of a test of T seconds compared up to B hertz: B T / sqrt(3)
    floors: Array | None  # (n, 6) of the floors' masses times their accelerations; weight is not in it
    predicted: Array | None  # (n, 6) of the mounted model under the measured motion
    simulated: Array | None  # (n, 6) of the simulation itself, where the record holds it
    place: tuple[float, float, float]  # of the interface from C, platen axes [m]
    calibrated: int  # parameters with the standard deviation of a calibration or an override
    stated: int  # parameters with that of the machine file

    @property
    def sd(self) -> Array:
        """Standard deviation (n, 6)."""
        return np.sqrt(self.noise**2 + self.sensors**2 + self.parameters**2)

    @property
    def half_width(self) -> Array:
        """Half of the interval (n, 6) at each instant."""
        return float(ndtri(0.5 + 0.5 * self.confidence)) * self.sd

    @property
    def peak_width(self) -> Array:
        """Half of the interval (n, 6) of the largest sample: its noise is the largest of the whole test.

        Rice's rate of crossings of a level gives that size; it is nearly certain, and adds to the other errors rather
        than in squares.
        """
        one = float(ndtri(0.5 + 0.5 * self.confidence))
        level = math.sqrt(2.0 * math.log(max(-2.0 * self.crossings / math.log(self.confidence), 1.0)))
        return np.asarray(max(level, one) * self.noise + one * np.hypot(self.sensors, self.parameters))

    def at(self, sample: int) -> pin.Force:
        """Force of the specimen on the platen at one sample."""
        return pin.Force(self.wrench[sample])

    @property
    def peaks(self) -> tuple[InterfacePeak, ...]:
        """Peaks of all components."""
        width, found = np.broadcast_to(self.peak_width, self.wrench.shape), []
        for j, name in enumerate(INTERFACE_AXES):
            k = int(np.argmax(np.abs(self.wrench[:, j])))
            expected = np.nan if self.predicted is None else self.predicted[:, j]
            best = float(np.asarray(expected).flat[int(np.argmax(np.abs(expected)))])
            found.append(InterfacePeak(name, float(self.wrench[k, j]), float(self.time[k]), float(width[k, j]), best))
        return tuple(found)


def interface_at(found: Decomposed, wrench: Array) -> Array:
    """Wrenches (n, 6) at the interface in platen axes of those at C in {c}, over the compared samples."""
    turn = rotation(found.test.motion.displacement[found.inside, 3:])
    return at_interface(found.mounted, wrenches_at_b(found.mounted, turn, wrench))


def find_interface(found: Decomposed, noise: Array, sensors: Array, parameters: Array) -> InterfaceWrench | None:
    """Interface wrench of a record with standard deviations (n, 6); None where the platen carries nothing."""
    machine, ledger = found.mounted.machine, found.forces.ledger
    effects = {name: ledger.wrench[:, ledger.effect(name)] for name in (BASE_SHEAR, SPECIMEN) if name in ledger.effects}
    if machine.specimen is None and not effects:
        return None
    predicted = effects.get(SPECIMEN)
    if predicted is not None:
        predicted = interface_at(found, predicted)
    elif machine.specimen is not None and found.mounted.coupled is None:
        states = found.whole.states
        carried = driven_wrenches(found.mounted, PlantMotion(states.q, states.v, states.a), found.dt)
        predicted = found.compared(at_interface(found.mounted, carried))
    floors = effects.get(BASE_SHEAR)
    known = found.record.get("specimen_wrench")
    sections = {"platen", *(c.kind for c in machine.components)}
    own = [q for p, q in machine.parameters.items() if p.split(".")[0] in sections and q.sd is not None]
    calibrated = sum(q.evidence in ("calibrated", "override") for q in own)
    place = (0.0, 0.0, 0.0) if machine.specimen is None else machine.specimen.position
    return InterfaceWrench(
        time=found.time,
        wrench=interface_at(found, found.forces.carried),
        noise=np.sqrt(np.mean(noise**2, axis=0)),
        sensors=sensors,
        parameters=parameters,
        confidence=decompose_numbers().number("judgement.confidence"),
        crossings=found.comparison.band.high * len(found.time) * found.dt / math.sqrt(3.0),
        floors=None if floors is None else interface_at(found, floors),
        predicted=predicted,
        simulated=None if known is None else found.compared(known.values.astype(float)),
        place=place,
        calibrated=calibrated,
        stated=len(own) - calibrated,
    )

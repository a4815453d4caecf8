"""Machines drawn from stated uncertainties by Latin hypercube or Sobol sequence."""

import math
from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from ..core.arrays import Array
from ..core.errors import ParameterError, UnknownNameError
from ..identification.calibration import machine_parameters
from ..identification.calibration.free_parameters import FreeParameter
from ..laws.orifice import opening
from ..machine.machine import Machine

__all__ = ["DESIGNS", "Draws", "draw_machines"]

DESIGNS = ("lhs", "sobol")
"""Latin hypercube, with as many strata as machines; Sobol sequence, scrambled, of a power of two machines."""


class Draws(NamedTuple):
    """Uncertain parameters, and their coordinates in every machine: zero is the machine as stated."""

    parameters: tuple[FreeParameter, ...]
    coordinates: Array  # (n, k)

    @property
    def values(self) -> Array:
        """Values (n, k), each in its parameter's unit."""
        pairs = zip(self.parameters, self.coordinates.T, strict=True)
        columns = [[parameter.at(float(x)) for x in column] for parameter, column in pairs]
        return np.array(columns, float).reshape(len(self.parameters), len(self.coordinates)).T


def draw_machines(
    machine: Machine, count: int, *, design: str, seed: int, reach: float, uncertain: Sequence[str] = ("*",)
) -> Draws:
    """Draw the uncertain numbers of a machine from their priors, normal within `reach` standard deviations.

    `uncertain` are patterns of names, such as ``hydraulics.*``; identical components stay identical, and no number is
    drawn beyond what a machine can have. One machine is the machine as stated. Where the curve of a valve is known
    within a factor only, and the deviation of its flow contains that of the curve, as in a drafted machine, what is
    stated is the flow at full opening: the two are drawn together, so that this varies by the rest of that deviation.

    Raises UnknownNameError for a design that does not exist, ParameterError for a pattern without a parameter or a
    number of machines that a Sobol sequence does not fill.
    """
    if design not in DESIGNS:
        raise UnknownNameError("design of an ensemble", design, DESIGNS)
    every = machine_parameters(machine)
    for pattern in uncertain:
        if not any(fnmatchcase(one.name, pattern) for one in every):
            raise ParameterError(
                f"{machine.name}: no uncertain number matches {pattern!r}; there are {', '.join(p.name for p in every)}"
            )
    parameters = tuple(one for one in every if any(fnmatchcase(one.name, pattern) for pattern in uncertain))
    if count > 1 and not parameters:
        raise ParameterError(
            f"{machine.name}: {count} machines, but no number to draw; name patterns of uncertain ones"
        )
    if count == 1:
        return Draws(parameters, np.zeros((count, len(parameters))))
    uniform = _uniform(design, count, len(parameters), seed)
    from scipy.stats import truncnorm

    sd = np.array([one.sd for one in parameters])
    low = np.maximum(-reach, [one.lowest / one.sd for one in parameters])
    high = np.minimum(reach, [one.highest / one.sd for one in parameters])
    coordinates = np.asarray(sd * truncnorm.ppf(uniform, low, high), float)
    _tie_flows(every, parameters, coordinates)
    return Draws(parameters, coordinates)


def _tie_flows(every: Sequence[FreeParameter], parameters: Sequence[FreeParameter], coordinates: Array) -> None:
    """Draw flows together with curves that are known within a factor only, in place, coordinates (n, k)."""
    place = {one.name: i for i, one in enumerate(parameters)}
    for curve in (one for one in every if one.name.endswith(".flow_curve") and one.form == "log"):
        flow = next((one for one in parameters if one.name == curve.name.removesuffix("_curve")), None)
        if flow is None or flow.form != "log" or flow.sd < curve.sd:
            continue
        rest = math.sqrt(math.expm1(flow.sd) ** 2 - math.expm1(curve.sd) ** 2)  # of the relative deviations
        column = coordinates[:, place[flow.name]]
        column *= rest / flow.sd
        if curve.name in place:
            drawn = [curve.at(float(x)) for x in coordinates[:, place[curve.name]]]
            column -= np.log([opening(1.0, x) / opening(1.0, curve.value) for x in drawn])


def _uniform(design: str, count: int, dimensions: int, seed: int) -> Array:
    """Points (count, dimensions) of a design in the unit cube."""
    from scipy.stats import qmc

    rng = np.random.default_rng(seed)
    if design == "lhs":
        return np.asarray(qmc.LatinHypercube(dimensions, seed=rng).random(count), float)
    power = round(np.log2(count))
    if 2**power != count:
        below = 2 ** int(np.log2(count))
        raise ParameterError(f"a Sobol sequence has a power of two machines: {below} or {2 * below}, not {count}")
    return np.asarray(qmc.Sobol(dimensions, scramble=True, seed=rng).random_base2(power), float)

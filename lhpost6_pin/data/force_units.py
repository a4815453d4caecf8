"""Forces in a wrong unit: they are far from what the machine's weight and inertia require.

In motion, an actuator's force fits a mass (`mass_regression`), which is compared with the mass that it must move. At
rest, the actuators that bear the platen hold its weight and the pull of the struts: the sum of their mean forces is
compared with that of the zero position.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.names import AXES
from ..core.units import parse_unit, units_of
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..mechanics.actuator_forces import force_range, rest_forces
from ..mechanics.plant import make_plant
from ..mechanics.pose import kinematic_jacobian
from .channels import columns_of
from .layout_faults import RecordFinding
from .mass_regression import MassFit, mass_fits
from .rests import rest_numbers

__all__ = ["wrong_force_units"]

VERTICAL = AXES.index("z")
UPRIGHT = 0.5  # least cosine to the vertical of an actuator that bears the platen
ALIKE = 1e-3  # of a logarithm: kN taken for N, and kip taken for lbf, are the same factor


class _Ratio(NamedTuple):
    """Measured over required force."""

    actuators: tuple[str, ...]
    value: float
    by: str  # what requires it


def wrong_force_units(
    record: xr.Dataset, machine: Machine, fits: Sequence[MassFit] | None = None
) -> list[RecordFinding]:
    """A warning for measured forces of a record of `machine` that are a factor from what it requires.

    The factor is `force_unit.factor` of `models/procedures/rests.toml`, either way. With a specimen that the record
    states and the machine has not, forces may be larger than the machine requires. `fits` are the record's `mass_fits`,
    if they are known.
    """
    if "actuator_force" not in record:
        return []
    numbers = rest_numbers()
    limit = numbers.number("force_unit.factor")
    loaded = machine.specimen is None and str(record.attrs.get("specimen", "none")) != "none"
    wrong: dict[str, list[_Ratio]] = {}
    fits = mass_fits(record, machine, numbers) if fits is None else fits
    for one in (*_in_motion(fits, numbers), *_at_rest(record, machine)):
        if one.value < 1.0 / limit or (one.value > limit and not loaded):
            wrong.setdefault(_exchanged(one.value, numbers.number("force_unit.near")), []).append(one)
    return [_finding(units, each) for units, each in wrong.items()]


def _in_motion(fits: Sequence[MassFit], numbers: Parameters) -> Iterator[_Ratio]:
    for fit in fits:
        if fit.channel.startswith("actuator_force") and fit.by_mass >= numbers.number("force_unit.explained"):
            yield _Ratio((fit.actuator,), abs(fit.share), "inertia")


def _at_rest(record: xr.Dataset, machine: Machine) -> Iterator[_Ratio]:
    """The sum of all actuators that bear a platen which is free to move up and down."""
    plant = make_plant(machine)
    labels = list(map(str, record["actuator"].values))
    if VERTICAL not in plant.axes or plant.coupled is not None or not set(labels) >= set(machine.actuator_names):
        return
    upward = kinematic_jacobian(plant)[:, VERTICAL]
    bearing = np.abs(upward) >= UPRIGHT
    span, places = force_range(plant), [labels.index(name) for name in machine.actuator_names]
    needed = span.middle + rest_forces(plant).share[0] * span.half
    measured = columns_of(record["actuator_force"]).mean(axis=0)[places]
    due, held = (float(np.sum((force * upward)[bearing])) for force in (needed, measured))
    if due:
        names = [name for name, bears in zip(machine.actuator_names, bearing, strict=True) if bears]
        yield _Ratio(tuple(names), abs(held / due), "weight")


def _exchanged(ratio: float, near: float) -> str:
    """Units of which one taken for the other makes forces this ratio, within a factor `near`; empty if none does."""
    factors = {unit: known.factor for unit in units_of("N") if (known := parse_unit(unit))}
    off = {
        f"{true} taken for {read}": abs(math.log(max(ratio, 1e-300) * factors[true] / factors[read]))
        for read, true in permutations(factors, 2)
    }
    least = min(off.values())
    return " or ".join(pair for pair, value in off.items() if value < min(least + ALIKE, math.log(near)))


def _finding(units: str, each: Sequence[_Ratio]) -> RecordFinding:
    ratio, by = float(np.median([one.value for one in each])), dict.fromkeys(one.by for one in each)
    if units:
        size = f"1/{1.0 / ratio:.4g} of" if ratio < 1.0 else f"{ratio:.4g} times"
        remedy = "correct the unit in the channel map, and import again"
    else:
        size = f"{100.0 * ratio:.3g} % of"
        remedy = "check the zero and the unit of these sensors, and whether a specimen was mounted"
    what = f"are {size} what {' and '.join(by)} require{'s' * (len(by) == 1)}"
    names = ", ".join(dict.fromkeys(name for one in each for name in one.actuators))
    return RecordFinding("warning", f"actuator_force[{names}]", None, what + f": {units}?" * bool(units), remedy)

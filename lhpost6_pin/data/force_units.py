"""Forces in a wrong unit or with a turned sign: all together, they are far from what weight and inertia require.

Hypotheses are compared by what they leave of the balance of forces (`force_balance`): the forces as they are, and those
of a set of actuators times a factor, that of two units exchanged or -1. A hypothesis holds where it explains what is
required but for a stated share, and where with the forces as they are, and without those it corrects, the remainder is
a stated multiple: friction that is not modelled may be removed with the forces, but not explained by their factor.
Of hypotheses that do as well, that of a whole kind of actuators is taken.

The mean forces that bear the platen are judged first, by its weight and the pull of the struts. Those that agree with it
are not judged by inertia.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
import xarray as xr

from ..core.arrays import Array, Mask
from ..core.units import parse_unit, units_of
from ..machine.machine import Machine
from ..mechanics.payload import lock_joints
from ..mechanics.actuator_forces import force_range, rest_forces
from ..mechanics.plant import Plant, make_plant
from .channels import columns_of
from .force_balance import ForceBalance, dynamic_balances, static_balance
from .layout_faults import RecordFinding
from .rests import rest_numbers

__all__ = ["wrong_forces"]

TURNED = -1.0
SIGN_REMEDY = "its sign is turned: write sign = -1 in the channel map, and import again"
ALIKE = 1e-3  # of a logarithm: kN taken for N, and kip taken for lbf, are the same factor
MOST_ENUMERATED = 10  # actuators of which all sets are tried; of more, singles, pairs, kinds, and kinds but for one


@dataclass(frozen=True)
class _Wrong:
    """Forces of a set of actuators and what would correct them."""

    actuators: tuple[str, ...]
    ratio: float  # measured over required
    factor: float  # that corrects them; not a number: none that is known does
    by: str  # what requires it


def wrong_forces(record: xr.Dataset, machine: Machine) -> list[RecordFinding]:
    """A warning for forces of a record of `machine` in another unit, an error for those with a turned sign.

    A size that no unit explains is a warning from `force_unit.factor` of `models/procedures/rests.toml`, either way.
    With a specimen that the record states and the machine has not, forces may be larger than the machine requires.
    """
    if "actuator_force" not in record or set(record["actuator"].values.astype(str)) != set(machine.actuator_names):
        return []
    plant = make_plant(machine)
    if plant.coupled is not None:
        return []  # its wrench is not part of the compiled equations
    wrong: dict[str, list[_Wrong]] = {}
    for one in _Search(record, lock_joints(plant)).run():
        wrong.setdefault(_exchanged(one.factor), []).append(one)
    return [_finding(units, each) for units, each in wrong.items()]


class _Search:
    """Hypotheses on the forces of one record, in the order of their balances."""

    def __init__(self, record: xr.Dataset, plant: Plant) -> None:
        """Begin with all forces as they are."""
        self.record, self.plant, self.numbers = record, plant, rest_numbers()
        self.names = np.array(plant.machine.actuator_names)
        labels = list(map(str, record["actuator"].values))
        self.force = columns_of(record["actuator_force"])[:, [labels.index(name) for name in self.names]]
        self.loaded = plant.machine.specimen is None and str(record.attrs.get("specimen", "none")) != "none"
        self.factor = np.ones(len(self.names))
        self.settled = np.zeros(len(self.names), bool)  # forces that are explained, or corrected
        kinds = [(a.area_a, a.area_b) for a in plant.machine.actuators]
        self.kinds = [np.array([kind == other for other in kinds]) for kind in dict.fromkeys(kinds)]

    def run(self) -> Iterator[_Wrong]:
        """All that is wrong: signs of actuators that only push, means, then forces in motion."""
        yield from self._pulling()
        static = static_balance(self.plant, self.force, self.numbers.number("balance.upright"), self.loaded)
        if static is not None:
            yield from self._judge([static])
            left, needed = static.remainder(self.factor, self.loaded)
            if left <= self.numbers.number("balance.closed") * needed:
                self.settled |= static.judged
        yield from self._judge(list(dynamic_balances(self.record, self.plant, self.force, self.numbers)))

    def _pulling(self) -> Iterator[_Wrong]:
        """Signs of actuators with one chamber that pull on the average, by a share of what they push at rest."""
        span, mean = force_range(self.plant), self.force.mean(axis=0)
        due = span.middle + rest_forces(self.plant).share[0] * span.half
        single = self.plant.actuators.area_b == 0.0
        turned = single & (mean < 0.0) & (mean <= -self.numbers.number("balance.pulls") * np.abs(due))
        if turned.any():
            self.factor[turned] = TURNED
            yield _Wrong(tuple(self.names[turned]), float(np.mean(mean[turned] / due[turned])), TURNED, "weight")

    def _judge(self, balances: Sequence[ForceBalance]) -> Iterator[_Wrong]:
        """Hypotheses that hold in the balance, of several the one that closes best, one after the other."""
        while open_balances := [b for b in balances if (b.judged & ~self.settled).any()]:
            best = min((self._best(b) for b in open_balances), key=lambda one: one[0])
            _, balance, those, factor = best
            if not those.any():
                yield from self._unexplained(best[1])
                return
            self.factor[those] *= factor
            self.settled |= those
            gain, _ = balance.regression(self.factor)
            yield _Wrong(tuple(self.names[those]), gain / factor, factor, balance.by)

    def _best(self, balance: ForceBalance) -> tuple[float, ForceBalance, Mask, float]:
        """Least share of the remainder, and the set of actuators with its factor; an empty set if none holds."""
        sets = np.array(list(self._sets(balance.judged & ~self.settled)))  # (m, n)
        share, margin, near = (self.numbers.number(f"balance.{key}") for key in ("share", "margin", "near"))
        as_it_is, needed = balance.remainder(self.factor, self.loaded)
        least = float(as_it_is / max(needed, 1e-300))
        rows: list[tuple[float, bool, Mask, float]] = []
        for factor in self._factors():
            changed = np.where(sets, factor * self.factor, self.factor)
            left, whole = balance.remainder(changed, self.loaded)
            without, _ = balance.remainder(np.where(sets, 0.0, self.factor), self.loaded)
            least = min(least, float(np.min(left / np.maximum(whole, 1e-300))))
            holds = (left <= share * whole) & (margin * left <= np.minimum(as_it_is, without))
            if factor == TURNED:  # each of them opposes what is required
                opposes = np.sum(balance.gram[:, -1, :-1], axis=0) * self.factor < 0.0
                holds &= np.all(~sets | opposes, axis=1)
            for k in np.flatnonzero(holds):
                gain = 1.0 if self.loaded else balance.regression(changed[k])[0]
                if 1.0 / near <= gain <= near:
                    whole_kind = any(np.array_equal(sets[k], kind) for kind in self.kinds)
                    rows.append((float(left[k]), whole_kind, sets[k], factor))
        if not rows:
            return least, balance, np.zeros(len(self.names), bool), 1.0
        most = self.numbers.number("balance.tie") * min(row[0] for row in rows)
        _, _, those, factor = min((row for row in rows if row[0] <= most), key=lambda row: (not row[1], row[0]))
        return least, balance, those, factor

    def _sets(self, free: Mask) -> Iterator[Mask]:
        """Sets of the actuators that are free to be wrong."""
        which = np.flatnonzero(free)
        sizes = range(1, len(which) + 1) if len(which) <= MOST_ENUMERATED else (1, 2)
        for size in sizes:
            for those in combinations(which, size):
                yield np.isin(np.arange(len(free)), those)
        if len(which) > MOST_ENUMERATED:
            for kind in (free, *(kind & free for kind in self.kinds)):
                yield kind
                yield from (kind & (np.arange(len(free)) != k) for k in np.flatnonzero(kind))

    def _factors(self) -> list[float]:
        """Factors that correct forces: of exchanged units, and a turned sign; under an unknown load, larger ones."""
        factors = [math.exp(value) for value in _unit_factors()]
        return [k for k in factors if k > 1.0] if self.loaded else [TURNED, *factors]

    def _unexplained(self, balance: ForceBalance) -> Iterator[_Wrong]:
        """A size far from what is required, of all forces that are not explained, where no hypothesis holds."""
        ratio, explained = balance.regression(self.factor)
        limit, least = self.numbers.number("force_unit.factor"), self.numbers.number("force_unit.explained")
        doubted = explained >= least or balance.by == "weight"
        if doubted and (ratio < 1.0 / limit or (ratio > limit and not self.loaded)):
            yield _Wrong(tuple(self.names[balance.judged & ~self.settled]), abs(ratio), math.nan, balance.by)


def _unit_factors() -> dict[float, list[str]]:
    """Logarithms of factors that correct forces, each with the pairs of units that were exchanged."""
    factors = {unit: known.factor for unit in units_of("N") if (known := parse_unit(unit))}
    found: dict[float, list[str]] = {}
    for read, true in permutations(factors, 2):
        value = math.log(factors[true] / factors[read])
        same = next((other for other in found if abs(other - value) < ALIKE), value)
        found.setdefault(same, []).append(f"{true} taken for {read}")
    return found


def _exchanged(factor: float) -> str:
    """Units of which one was taken for the other, that a factor corrects; "sign" of a turned one; empty if none does."""
    if factor == TURNED:
        return "sign"
    return next(
        (" or ".join(pairs) for value, pairs in _unit_factors().items() if abs(math.log(factor) - value) < ALIKE), ""
    ) if factor > 0.0 else ""


def _finding(units: str, each: Sequence[_Wrong]) -> RecordFinding:
    ratio, by = float(np.median([one.ratio for one in each])), " and ".join(dict.fromkeys(one.by for one in each))
    names = ", ".join(dict.fromkeys(name for one in each for name in one.actuators))
    channel, verb = f"actuator_force[{names}]", f"require{'s' * (' and ' not in by)}"
    if units == "sign":
        what = f"opposes what {by} {verb}: it is {ratio:.3g} times that"
        return RecordFinding("error", channel, None, what, SIGN_REMEDY)
    if units:
        size = f"1/{1.0 / ratio:.4g} of" if ratio < 1.0 else f"{ratio:.4g} times"
        remedy = "correct the unit in the channel map, and import again"
        return RecordFinding("warning", channel, None, f"are {size} what {by} {verb}: {units}?", remedy)
    remedy = "check the zero and the unit of these sensors, and whether a specimen was mounted"
    return RecordFinding("warning", channel, None, f"are {100.0 * ratio:.3g} % of what {by} {verb}", remedy)

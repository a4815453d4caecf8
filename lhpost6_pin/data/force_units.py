"""Forces in a wrong unit or with a turned sign: all together, they are far from what weight and inertia require.

Hypotheses are compared by what they leave of the balance of forces (`force_balance`): the forces as they are, and those
of a set of actuators times a factor, that of two units exchanged or -1. A hypothesis holds where it explains what is
required but for a stated share, and where with the forces as they are, and without those it corrects, the remainder is
a stated multiple: friction that is not modelled may be removed with the forces, but not explained by their factor, and
no unit is named by inertia where the corrected forces would hold more than a stated share of friction.
Of hypotheses that do as well, that of a whole kind of actuators is taken.

Forces that motion confirms as they are, those without which a balance that holds would be much worse, are not doubted.
Of the others, mean forces that bear the platen are judged first, by its weight and the pull of the struts, and those
that do not agree with it then, or bear nothing, by inertia.
"""

import math
from collections.abc import Collection, Iterator, Sequence
from functools import cache
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array, Mask
from ..core.units import parse_unit, units_of
from ..machine.machine import Machine
from ..mechanics.actuator_forces import force_range, rest_forces
from ..mechanics.payload import lock_joints
from ..mechanics.plant import Plant, make_plant
from .channels import columns_of
from .force_balance import ForceBalance, actuator_groups, dynamic_balances, static_balance
from .layout_faults import RecordFinding
from .rests import rest_numbers
from .turned_signs import SIGN_REMEDY

__all__ = ["wrong_forces"]

TURNED = -1.0
ALIKE = 1e-3  # of a logarithm: kN taken for N, and kip taken for lbf, are the same factor
MOST_ENUMERATED = 10  # actuators of which all sets are tried; of more, singles, pairs, kinds, and kinds but for one


class _Wrong(NamedTuple):
    """Forces of a set of actuators and what would correct them."""

    actuators: tuple[str, ...]
    factor: float  # that corrects them; not a number: none that is known does
    by: str  # what requires it
    ratio: float = math.nan  # measured over required, where no factor is known


def wrong_forces(record: xr.Dataset, machine: Machine) -> list[RecordFinding]:
    """A warning for forces of a record of `machine` in another unit, an error for those with a turned sign.

    A size that no unit explains is a warning from `force_unit.factor` of `models/procedures/rests.toml`, either way.
    With a specimen that the record states and the machine has not, forces may be larger than the machine requires, and
    no unit is named.
    """
    if "actuator_force" not in record or set(record["actuator"].values.astype(str)) != set(machine.actuator_names):
        return []
    plant = make_plant(machine)
    if plant.coupled is not None:
        return []  # its wrench is not part of the compiled equations
    wrong: dict[str, list[_Wrong]] = {}
    search = _Search(record, lock_joints(plant))
    for one in search.run():
        wrong.setdefault(_exchanged(one.factor), []).append(one)
    turned = [
        RecordFinding(
            "error", f"actuator_force[{name}]", None, f"is the negative of what {one.by} requires", SIGN_REMEDY
        )
        for one in wrong.pop("sign", [])
        for name in one.actuators
    ]
    named = {name for each in wrong.values() for one in each for name in one.actuators}
    return turned + [_finding(units, each) for units, each in wrong.items()] + search.beyond(named)


class _Search:
    """Hypotheses on the forces of one record, group by group of its actuators."""

    def __init__(self, record: xr.Dataset, plant: Plant) -> None:
        """Begin with all forces as they are."""
        self.record, self.plant, self.numbers = record, plant, rest_numbers()
        self.names = np.array(plant.machine.actuator_names)
        labels = list(map(str, record["actuator"].values))
        self.force = columns_of(record["actuator_force"])[:, [labels.index(name) for name in self.names]]
        self.loaded = plant.machine.specimen is None and str(record.attrs.get("specimen", "none")) != "none"
        span = self.span = force_range(plant)
        due = span.middle + rest_forces(plant).share[0] * span.half
        self.held = self.force.mean(axis=0) / np.where(due == 0.0, np.inf, due)  # mean forces over those of rest
        self.factor = np.ones(len(self.names))
        self.settled = np.zeros(len(self.names), bool)  # forces that are explained, or corrected
        kinds = [(a.area_a, a.area_b) for a in plant.machine.actuators]
        self.kinds = [np.array([kind == other for other in kinds]) for kind in dict.fromkeys(kinds)]

    def run(self) -> Iterator[_Wrong]:
        """All that is wrong: signs of actuators that only push, means, then forces in motion."""
        groups = actuator_groups(self.plant)
        in_motion = list(dynamic_balances(self.record, self.plant, self.force, self.numbers))
        for balance in (b.of(group) for group in groups for b in in_motion):
            self._confirm(balance)
        yield from self._pulling()
        for group in groups:
            static = static_balance(self.plant, self.force, group)
            if static is not None:
                yield from self._judge([static])
                if static.remainder(self.factor) <= self.numbers.number("rest_balance.closed") * static.required:
                    self.settled |= static.judged
        for group in groups:
            yield from self._judge([b.of(group) for b in in_motion])

    def beyond(self, named: Collection[str]) -> list[RecordFinding]:
        """A warning for each actuator, none of those `named` already, whose force is far beyond what it can give."""
        able, found = np.maximum(np.abs(self.span.least), self.span.most), []
        peak = np.nan_to_num(np.abs(self.force), posinf=np.inf)
        for i in np.flatnonzero(peak.max(axis=0, initial=0.0) > self.numbers.number("force_unit.beyond") * able):
            if (name := str(self.names[i])) not in named:
                sample = int(peak[:, i].argmax())
                share = peak[sample, i] / able[i]
                what = f"reaches {peak[sample, i]:.4g} N, {share:.3g} times what the actuator can give"
                remedy = "check its unit in the channel map, or area and supply pressure of the machine file"
                found.append(RecordFinding("warning", f"actuator_force[{name}]", sample, what, remedy))
        return found

    def _confirm(self, balance: ForceBalance) -> None:
        """Settle the forces without which a balance that holds would be much worse."""
        left = balance.remainder(self.factor)
        without = balance.remainder(self.factor * (1.0 - np.eye(len(self.names))))
        holds = left <= self.numbers.number("balance.share") * balance.required
        self.settled |= balance.judged & holds & (without >= self.numbers.number("balance.confirmed") * left)

    def _pulling(self) -> Iterator[_Wrong]:
        """Signs of actuators with one chamber that pull on the average, by a share of what they push at rest."""
        single = (self.plant.actuators.area_b == 0.0) & ~self.settled
        turned = single & (self.held <= -self.numbers.number("rest_balance.pulls"))
        if turned.any():
            self.factor[turned] = TURNED
            yield _Wrong(tuple(self.names[turned]), TURNED, "weight")

    def _judge(self, balances: Sequence[ForceBalance]) -> Iterator[_Wrong]:
        """Hypotheses that hold in the balance, of several the one that closes best, one after the other."""
        while unsettled := [b for b in balances if (b.judged & ~self.settled).any()]:
            _, balance, those, factor = min((self._best(b) for b in unsettled), key=lambda one: one[0])
            if not those.any():
                yield from self._unexplained(max(unsettled, key=lambda b: self._regression(b)[1]))
                return
            self.factor[those] *= factor
            self.settled |= those
            yield _Wrong(tuple(self.names[those]), factor, balance.by)

    def _best(self, balance: ForceBalance) -> tuple[float, ForceBalance, Mask, float]:
        """Least share of the remainder, and the set of actuators with its factor; an empty set if none holds."""
        free = balance.judged & ~self.settled
        sets = np.array(list(self._sets(free)))  # (m, n)
        whole_kind = np.array([any(np.array_equal(one, kind) for kind in self.kinds) for one in sets])
        at_rest = balance.by == "weight"
        share, margin = (self.numbers.number(f"{'rest_' * at_rest}balance.{key}") for key in ("share", "margin"))
        as_it_is, without = balance.remainder(self.factor), balance.remainder(np.where(sets, 0.0, self.factor))
        rubbed = self.numbers.number("force_unit.friction")
        opposes = np.sum(balance.gram[:, -1, :-1], axis=0) * self.factor < 0.0  # what is required
        least, rows = float(as_it_is), []
        for factor in self._factors():
            changed = np.where(sets, factor * self.factor, self.factor)
            left = balance.remainder(changed)
            least = min(least, float(np.min(left)))
            holds = (left <= share * balance.required) & (margin * left <= np.minimum(as_it_is, without))
            if factor == TURNED:
                holds &= np.all(~sets | opposes, axis=1)
            elif not at_rest:  # where friction is not small beside inertia, it alone may set the size
                holds &= balance.friction(changed) <= rubbed * balance.required
            if at_rest:
                holds &= self._plausible(sets, changed, factor) | whole_kind
            for k in np.flatnonzero(holds):
                if self._near(balance, changed[k]):
                    rows.append((float(left[k]), bool(whole_kind[k]), sets[k], factor))
        least /= max(balance.required, 1e-300)
        if not rows:
            return least, balance, np.zeros(len(self.names), bool), 1.0
        most = self.numbers.number("balance.tie") * min(row[0] for row in rows)
        _, _, those, factor = min((row for row in rows if row[0] <= most), key=lambda row: (not row[1], row[0]))
        return least, balance, those, factor

    def _plausible(self, sets: Mask, changed: Array, factor: float) -> Mask:
        """Sets (m, n) whose corrected mean forces (m, n) are about those of rest, and no zero offset looks the same."""
        near = self.numbers.number("rest_balance.near")
        usual = np.all(~sets | (np.abs(np.log(np.maximum(changed * self.held, 1e-300))) <= math.log(near)), axis=1)
        return usual & (factor < 1.0 or factor > self.numbers.number("rest_balance.offset"))

    def _near(self, balance: ForceBalance, factor: Array) -> bool:
        """Whether forces times `factor` (n,) are about as large as what is required."""
        near = self.numbers.number("balance.near")
        return 1.0 / near <= balance.regression(factor)[0] <= near

    def _sets(self, free: Mask) -> Iterator[Mask]:
        """Sets of the actuators that are free to be wrong."""
        which = np.flatnonzero(free)
        every = len(which) <= MOST_ENUMERATED
        for size in range(1, len(which) + 1) if every else (1, 2):
            for those in combinations(which, size):
                yield np.isin(np.arange(len(free)), those)
        for kind in () if every else (free, *(kind & free for kind in self.kinds)):
            yield kind
            yield from (kind & (np.arange(len(free)) != k) for k in np.flatnonzero(kind))

    def _factors(self) -> list[float]:
        """Factors that correct forces: a turned sign, and those of exchanged units; none under an unknown load."""
        return [] if self.loaded else [TURNED, *(math.exp(value) for value in _unit_factors())]

    def _regression(self, balance: ForceBalance) -> tuple[float, float]:
        """Ratio and share of what is required that the forces of the balance's own actuators explain."""
        return balance.regression(self.factor * balance.judged)

    def _unexplained(self, balance: ForceBalance) -> Iterator[_Wrong]:
        """A size far from what is required, of all forces that are not settled, where no hypothesis holds.

        Not where the forces, brought to the size required, would hold much friction: what the projection leaves of it
        is not small beside inertia then. Forces that are far too small with all friction are doubted all the same.
        """
        ratio, explained = self._regression(balance)
        limit, near = self.numbers.number("force_unit.factor"), self.numbers.number("balance.near")
        rubbed = balance.friction(self.factor * balance.judged / (ratio or 1.0)) / max(balance.required, 1e-300)
        little = balance.size(self.factor * balance.judged) * self.numbers.number("force_unit.far") < 1.0
        doubted = balance.by == "weight" or (
            explained >= self.numbers.number("force_unit.explained")
            and (little or rubbed <= self.numbers.number("force_unit.friction"))
        )
        if doubted and (abs(ratio) < 1.0 / limit or (ratio > limit and not self.loaded)):
            units = [k for k in self._factors() if k > 0.0 and 1.0 / near <= ratio * k <= near]
            those = tuple(self.names[balance.judged & ~self.settled])
            yield _Wrong(those, units[0] if len(units) == 1 else math.nan, balance.by, abs(ratio))


@cache
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
    """Units that were exchanged, as a factor corrects them; "sign" of a turned one; empty if none were."""
    if factor == TURNED:
        return "sign"
    alike = (pairs for value, pairs in _unit_factors().items() if abs(math.log(factor) - value) < ALIKE)
    return " or ".join(next(alike, [])) if factor > 0.0 else ""


def _finding(units: str, each: Sequence[_Wrong]) -> RecordFinding:
    by, ratio = " and ".join(dict.fromkeys(one.by for one in each)), 1.0 / each[0].factor
    names = ", ".join(dict.fromkeys(name for one in each for name in one.actuators))
    channel, verb = f"actuator_force[{names}]", f"require{'s' * (' and ' not in by)}"
    if units:
        size = f"1/{1.0 / ratio:.4g} of" if ratio < 1.0 else f"{ratio:.4g} times"
        remedy = "correct the unit in the channel map, and import again"
        return RecordFinding("warning", channel, None, f"are {size} what {by} {verb}: {units}?", remedy)
    share = 100.0 * float(np.median([one.ratio for one in each]))
    remedy = "check the zero and the unit of these sensors, and whether a specimen was mounted"
    return RecordFinding("warning", channel, None, f"are {share:.3g} % of what {by} {verb}", remedy)

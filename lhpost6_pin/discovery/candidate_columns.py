"""Columns: derivatives of the whitened residuals by a candidate's amplitudes, in the frequency domain.

Candidates of one family and shape on different components are evaluated together where they are independent: each
force has a wrench of its own, a modifier of an actuator's oil or valve acts on its own chambers and spool.
"""

from collections.abc import Sequence
from itertools import chain, pairwise

import numpy as np

from ..core.arrays import Array
from ..effects.registry import LAWS
from ..identification.calibration.bin_rows import BinRows, bin_rows
from ..identification.calibration.operating_point import OperatingPoint
from ..identification.calibration.problem import Problem
from ..identification.calibration.sparse_bins import SparseBins
from ..identification.inverse_dynamics import with_loads
from ..identification.prepare import actuator_forces
from ..identification.residual_kernels import row_wrenches
from ..identification.residuals import follow
from ..mechanics.plant import make_plant
from .candidates import Candidate

__all__ = ["columns_of", "columns_of_groups", "whitened_rows"]

OF_AN_ACTUATOR = ("oil", "valve")
"""What laws modify that act on the residuals of one actuator alone."""


def columns_of(
    problem: Problem, base: OperatingPoint, candidates: Sequence[Candidate]
) -> tuple[list[BinRows], list[Array]]:
    """Columns of candidates that differ in components only; and each candidate's combination (k, q) of them."""
    columns, (parts,) = columns_of_groups(problem, base, [candidates])
    return columns, parts


def columns_of_groups(
    problem: Problem, base: OperatingPoint, groups: Sequence[Sequence[Candidate]]
) -> tuple[list[BinRows], list[list[Array]]]:
    """Columns of several such groups side by side; and the combinations (k, q) of them by group."""
    each, parts = zip(*(_bins_of(problem, base, group) for group in groups), strict=True)
    columns = whitened_rows(problem, [list(chain(*pieces)) for pieces in zip(*each, strict=True)])
    ends = np.cumsum([0, *(len(own[0]) for own in parts)])
    rows = np.eye(ends[-1])
    return columns, [[rows[:, a:b] @ part for part in own] for (a, b), own in zip(pairwise(ends), parts, strict=True)]


def whitened_rows(problem: Problem, pieces: Sequence[Sequence[SparseBins]]) -> list[BinRows]:
    """Rows of every test, whitened as residuals are, of its bins in pieces."""
    count = sum(problem.widths)
    return [bin_rows([problem.whitened(t, one) for one in own], count) for t, own in enumerate(pieces)]


def _bins_of(
    problem: Problem, base: OperatingPoint, candidates: Sequence[Candidate]
) -> tuple[list[list[SparseBins]], list[Array]]:
    """Bins of every test by k amplitudes of one group, in pieces; and each candidate's combination (k, q) of them."""
    machine, first = base.plant.machine, candidates[0]
    whole = first.on(machine, tuple(s.typical for s in first.amplitudes))
    (law,) = (LAWS[effect.law] for effect in whole.added_effects if effect.name == first.name)
    alone = sorted({name for c in candidates for name in c.components})
    on_legs = set(alone) <= {c.name for c in machine.components} and len(first.amplitudes) == 1
    forces = first.family.shows_in == ("wrench",) and not law.modifies and (on_legs or not base.plant.feels_load)
    of_actuators = law.modifies in OF_AN_ACTUATOR and set(first.family.shows_in) <= {"flow", "servo"}
    summed = on_legs and (forces or of_actuators)  # on several legs it is the sum of that on each
    if forces:
        bins = _by_force(problem, base, [first.at((name,)) for name in alone] if summed else candidates)
    elif summed:
        bins = _by_actuator(problem, base, first.at(tuple(alone)))
    else:
        each = zip(*(_by_difference(problem, base, c) for c in candidates), strict=True)
        bins = [list(chain(*pieces)) for pieces in each]
    if summed:
        return bins, [np.array([[float(name in c.components)] for name in alone]) for c in candidates]
    ends = np.cumsum([0, *(len(c.amplitudes) for c in candidates)])
    places = np.eye(ends[-1])
    return bins, [places[:, a:b] for a, b in pairwise(ends)]


def _by_difference(problem: Problem, base: OperatingPoint, candidate: Candidate) -> list[list[SparseBins]]:
    """Change of the residuals of every test by each amplitude of a candidate."""
    parts = []
    for size, one in _one_by_one(candidate):
        changes = problem.change(base, make_plant(candidate.on(base.plant.machine, one)), candidate.family.shows_in)
        parts.append([change.per(size) for change in changes])
    return [list(pieces) for pieces in zip(*parts, strict=True)]


def _one_by_one(candidate: Candidate) -> list[tuple[float, tuple[float, ...]]]:
    """Typical size of each amplitude; and all amplitudes, the others zero."""
    typical = [s.typical for s in candidate.amplitudes]
    return [(size, tuple(size * (k == i) for k in range(len(typical)))) for i, size in enumerate(typical)]


def _by_force(problem: Problem, base: OperatingPoint, candidates: Sequence[Candidate]) -> list[list[SparseBins]]:
    """Wrench of the force in every test by each amplitude of each candidate, all in one machine.

    Less than zero: it reduces what is required of the actuators.
    """
    machine, sizes = base.plant.machine, dict[str, float]()  # by the name of an effect
    for candidate in candidates:
        for size, one in _one_by_one(candidate):
            name = f"{candidate.name}, {len(sizes)}"
            machine, sizes[name] = candidate.on(machine, one, name=name), size
    plant = make_plant(machine)
    place = {effect.name: i for i, effect in enumerate(machine.effects)}
    rows = plant.rows[np.isin(plant.rows["effect"], [place[name] for name in sizes])]
    found: list[list[SparseBins]] = []
    before, paths = base.with_ports_of(plant)
    for test, there in zip(base.tests, paths, strict=True):
        path = follow(plant, test, (before, there))
        force = actuator_forces(plant.machine, test.channels)
        z = path.z if force is None else with_loads(plant, path.ports, path.required, path.z, force)
        wrench = row_wrenches(plant, path.ports, z, rows)
        own = [wrench[:, rows["effect"] == place[name]].sum(axis=1) / -size for name, size in sizes.items()]
        found.append([problem.of_wrench(len(found), np.stack(own, axis=-1))])
    return found


def _by_actuator(problem: Problem, base: OperatingPoint, candidate: Candidate) -> list[list[SparseBins]]:
    """Change of the residuals of every test by the amplitude on each actuator, from one evaluation."""
    size = candidate.amplitudes[0].typical
    changes = problem.change(base, make_plant(candidate.on(base.plant.machine, (size,))), candidate.family.shows_in)
    places = [base.plant.machine.actuator_names.index(name) for name in candidate.components]
    rows = [problem.rows_of_actuator(place) for place in places]
    return [[change.some(own).per(size) for own in rows] for change in changes]

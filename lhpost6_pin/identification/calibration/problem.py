"""The least-squares problem of a campaign: residuals of all tests and their derivatives by every unknown, whitened.

Unknowns x (p,): the machine's parameters, then the sensors' errors; zero at nominal machine and perfect sensors.
"""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np

from ...core.arrays import Array, Complex, Mask
from ...core.processes import by_processes
from ...core.threads import by_threads
from ...data.sensors import SensorSet
from ...machine.machine import Machine
from ...machine.specimen import Specimen
from ...mechanics.plant import Plant, make_plant
from ..friction_march import made_fine
from ..friction_start import start_wrenches
from ..prepare import MeasuredTest
from ..residual_change import Evaluated, change_of
from ..residuals import RESIDUALS, Residuals, evaluate_residuals, follow, kinds_shown
from .derivative_steps import derivative_steps
from .free_parameters import FreeParameter, parameter_changes
from .operating_point import OperatingPoint
from .parameters_of_tests import parameters_of_tests
from .scale import find_scale, without_held
from .sensor_errors import RemovedDelay, SensorUnknown, corrected, sensor_unknowns
from .sparse_bins import SparseBins, sparse_bins
from .start_states import StartStates, no_start_states, start_states
from .whitened_residuals import make_whitener, spectrum_of

__all__ = ["KINDS", "ResidualBands", "Problem", "Slopes", "EvaluationGroup"]

Slopes = dict[int, SparseBins]
"""Derivatives of a test's whitened bins, by the unknown's place in x."""

KINDS = ("wrench", "flow", "gas", "force")
"""Kinds of residuals that are compared by default."""


class ResidualBands(NamedTuple):
    """How residuals are compared."""

    bands: tuple[float, ...]  # edges [Hz] of bands of frequency, each with its own noise
    edge: float  # cut off at both ends of a test [s]
    step: float  # of an unknown, for its derivative, in prior standard deviations
    held: float  # of full friction, prior deviation of what friction holds at the start of a test


class EvaluationGroup(NamedTuple):
    """Unknowns that act on different rows, so that one evaluation gives all their derivatives."""

    members: tuple[tuple[int, int], ...]  # place in x, and actuator or strut on whose rows it acts; -1: on all rows
    residuals: tuple[str, ...]  # kinds that depend on it


class Problem:
    """Tests and their noisier copies, unknowns with their priors, and the whitener of the sensors' noise."""

    specimen: Specimen | None = None  # that moves: locked on the machine, its sway is `carried` in the tests

    def __init__(
        self,
        machine: Machine,
        tests: Sequence[MeasuredTest],
        noisy: Sequence[MeasuredTest],
        sensors: SensorSet,
        comparison: ResidualBands,
        *,
        again: Sequence[Sequence[MeasuredTest]] = (),
        jobs: int = -1,
        kinds: tuple[str, ...] = KINDS,
        others: Sequence[Machine] = (),
        delays: tuple[RemovedDelay, ...] = (),
    ) -> None:
        """Prepare the problem; all tests have the same channels.

        noisy are draws of the tests in order, any number of times, each with more noise, from which the whitener is
        made; `again` are further ones, for the correction of derivatives. Noise also includes differences of residuals
        between equally plausible machines (`others`). `delays` were removed from the tests. Raises RecordError if they
        are too short together.
        """
        self.delays, plant = delays, make_plant(machine)
        self.axes = plant.axes  # free twist components of the platen
        tests = tuple(made_fine(plant, test) for test in tests)

        def weighed(some: Sequence[MeasuredTest]) -> tuple[MeasuredTest, ...]:
            """Draws of the tests in order, any number of times, with the weights of the tests."""
            each = zip(some, cycle(tests), strict=False)
            return tuple(replace(t, weight=own.weight, substeps=own.substeps) for t, own in each)

        self.tests, self.comparison, self.jobs, self.kinds = tests, comparison, jobs, kinds
        self.noisy, self.again = weighed(noisy), tuple(map(weighed, again))
        unknowns = sensor_unknowns(machine, sensors, tests[0])
        self.unknowns = tuple(u for u in unknowns if set(u.shows_in) & set(kinds))
        self.free: dict[str, float] = {}  # prior over stated deviation of the released unknowns
        clean = self._clean(plant)
        self.scale = find_scale(machine, tests[0], clean[0])
        free = parameters_of_tests(machine, plant, tests)
        self._set(machine, without_held(free, self.scale))
        self.widths = tuple(x.shape[1] for x in clean[0])
        self.frequency = [self.bins(r, t)[1] for r, t in zip(clean, tests, strict=True)]
        noise = self._noise(plant, clean)
        instead = [make_plant(other) for other in others]
        for found, test, base in zip(noise, tests, clean, strict=True):
            # friction's state is uncertain by the difference between the raw and the smoothed path; that weighs as
            # much as all draws together, and so does each of the other machines
            more = []
            if test.weight is None:
                more.append(evaluate_residuals(plant, replace(test, path=None), kinds))
            more += [evaluate_residuals(one, test, kinds) for one in instead]
            draws = len(found)
            found += [self.bins(one.less(base), test)[0] * np.sqrt(draws) for one in more]
            found[:] = [bins * np.sqrt((draws + len(more)) / draws) for bins in found]
        # where all friction acts along one axis or two, what its form leaves there is no noise of other kinds
        kinds_of = None if machine.motion == "free" else np.repeat(np.arange(len(self.widths)), self.widths)
        bands, last = np.array(comparison.bands), self.rows("wrench")  # in which most unknowns show
        self.whitener = make_whitener(noise, self.frequency, bands, kinds_of, last)
        self.starts = [self._starts(plant, t) for t in range(len(tests))]

    def _set(self, machine: Machine, parameters: tuple[FreeParameter, ...]) -> "Problem":
        """Set the machine and its free parameters; returns itself."""
        self.machine, self.parameters = machine, parameters
        every: tuple[FreeParameter | SensorUnknown, ...] = (*parameters, *self.unknowns)
        self.names = tuple(one.name for one in every)
        self.stated = np.array([one.sd for one in every])
        self.prior = self.stated * [self.free.get(name, 1.0) for name in self.names]
        self.step = derivative_steps(every, self.comparison.step)
        # (p,) in which residuals are not nearly linear: all but shifts of points in plan, gains and offsets
        self.bent = np.array([*(not k.mirrored for k in parameters), *(u.kind == "delay" for u in self.unknowns)])
        self.lowest, self.highest = np.array([(one.lowest, one.highest) for one in every]).reshape(-1, 2).T
        groups: dict[tuple[str, tuple[str, ...]], list[tuple[int, int]]] = {}
        for i, one in enumerate(every):
            groups.setdefault((one.alone[0], one.shows_in), []).append((i, one.alone[1]))
        self.groups = [EvaluationGroup(tuple(members), shows_in) for (_, shows_in), members in groups.items()]
        return self

    def _with(self, **changes: Any) -> "Problem":
        """Copy with some attributes replaced."""
        other = copy(self)
        vars(other).update(changes)
        return other

    def with_machine(self, machine: Machine, parameters: tuple[FreeParameter, ...]) -> "Problem":
        """The same tests and noise with another machine, or other parameters."""
        return self._with()._set(machine, parameters)

    def with_free(self, name: str, share: float | None) -> "Problem":
        """The same with an unknown's prior deviation `share` times the stated one; None: as stated."""
        free = {other: known for other, known in self.free.items() if other != name}
        if share is not None:
            free[name] = share
        return self._with(free=free)._set(self.machine, self.parameters)

    def with_tests(self, tests: Sequence[MeasuredTest]) -> "Problem":
        """The same problem and weights with another draw of the same tests."""
        return self._with(tests=tuple(tests))

    @property
    def replicas(self) -> tuple["Problem", ...]:
        """The same problem with each further draw of the tests."""
        return tuple(map(self.with_tests, self.again))

    def scaled(self, scale: Array) -> "Problem":
        """The same problem, its whitened residuals scaled by test and band (t, b, c)."""
        whitener = self.whitener.scaled(scale)
        each = enumerate(zip(self.starts, self.frequency, strict=True))
        return self._with(whitener=whitener, starts=[one.scaled(scale[t, whitener.band(f)]) for t, (one, f) in each])

    def restarted(self, plant: Plant) -> "Problem":
        """The same problem with friction's states at the start of tests as they act on a plant."""
        return self._with(starts=[self._starts(plant, t) for t in range(len(self.tests))])

    def only(self, places: Sequence[int]) -> "Problem":
        """The same problem with some of its tests; noise is weighed as with all."""
        return self._with(
            tests=tuple(self.tests[t] for t in places),
            noisy=tuple(t for i, t in enumerate(self.noisy) if i % len(self.tests) in places),
            again=tuple(tuple(draw[t] for t in places) for draw in self.again),
            frequency=[self.frequency[t] for t in places],
            starts=[self.starts[t] for t in places],
            whitener=self.whitener._replace(factor=self.whitener.factor[list(places)]),
        )

    def noise_draws(self, x: Array) -> list[list[Complex]]:
        """Whitened bins (m, c) of every test by which each draw of noise changes its residuals, the unknowns at x."""
        plant = self.plant_at(x)
        noise = self._noise(plant, self._clean(plant))
        return [[self._whitened(t, bins) for bins in draws] for t, draws in enumerate(noise)]

    def _clean(self, plant: Plant) -> list[Residuals]:
        """Residuals of every test without more noise."""
        return list(by_threads(lambda test: evaluate_residuals(plant, test, self.kinds), self.tests, self.jobs))

    def _noise(self, plant: Plant, clean: Sequence[Residuals]) -> list[list[Complex]]:
        """Change of the bins (m, c) of every test with each draw of noise."""
        found: list[list[Complex]] = [[] for _ in clean]

        def of_one(i: int) -> Complex:
            test = self.noisy[i]
            return self.bins(evaluate_residuals(plant, test, self.kinds).less(clean[i % len(clean)]), test)[0]

        for i, bins in enumerate(by_threads(of_one, range(len(self.noisy)), self.jobs)):
            found[i % len(clean)].append(bins)
        return found

    def rows(self, kind: str, *places: int) -> Mask:
        """Mask of the stacked residuals' columns of a kind, all or those at some places.

        Of the wrench only along free axes: the others are zero.
        """
        at = RESIDUALS.index(kind)
        first, width = sum(self.widths[:at]), self.widths[at]
        own = set(self.axes.tolist() if kind == "wrench" else range(width))
        mask = np.zeros(sum(self.widths), bool)
        mask[[first + p for p in own.intersection(places or own) if p < width]] = True
        return mask

    @property
    def compared(self) -> Mask:
        """Mask of the stacked residuals' columns that are not zero by the machine's guides."""
        return np.asarray(np.any([self.rows(kind) for kind in RESIDUALS], axis=0))

    def residual(self, base: OperatingPoint) -> list[Complex]:
        """Whitened bins (m, c) of every test at an operating point."""

        def of_one(i: int) -> Complex:
            return self._whitened(i, self.bins(base.residuals[i], base.tests[i])[0])

        return list(by_threads(of_one, range(len(self.tests)), self.jobs))

    def _whitened(self, test: int, bins: Complex) -> Complex:
        """Whitened bins (m, c) of a test's `bins` (m, c)."""
        return self.whitened(test, sparse_bins(bins)).full(bins.shape[1])

    def whitened(self, test: int, some: SparseBins) -> SparseBins:
        """Whitened bins of a test's, less what friction's state at its start explains."""
        return self.starts[test].less(self.whitener.apply(test, some, self.frequency[test]))

    def _starts(self, plant: Plant, test: int) -> StartStates:
        """How friction's states at the start of a test move its whitened bins."""
        (wrench, _), f = start_wrenches(plant, self.tests[test]), self.frequency[test]
        if not wrench.shape[2]:
            return no_start_states()
        return start_states(self.whitener.apply(test, self.of_wrench(test, self.comparison.held * wrench), f))

    def slopes(self, base: OperatingPoint, free: Mask, progress: Callable[[float], None]) -> list[Slopes]:
        """Derivatives of the whitened bins of every test by the unknowns in `free` (p,), by differences."""
        groups = [g for g in self.groups if any(free[i] for i, _ in g.members)]
        out: list[Slopes] = [{} for _ in self.tests]
        differences = by_processes(partial(self._difference, base, free), groups, self.jobs)
        for done, found in enumerate(differences):
            for i, changes in found:
                for slopes, change in zip(out, changes, strict=True):
                    slopes[i] = change
            progress((done + 1) / len(groups))
        return out

    def _difference(
        self, base: OperatingPoint, free: Mask, group: EvaluationGroup
    ) -> list[tuple[int, list[SparseBins]]]:
        """Derivatives of every test's whitened bins, by place in x."""
        x, count = base.x, len(self.parameters)
        step = np.where(x + self.step > self.highest, -self.step, self.step)
        more = np.where(np.isin(np.arange(len(x)), [i for i, _ in group.members]), step, 0.0)
        if group.members[0][0] < count:
            changes = self.change(base, self.plant_at(x + more, base), group.residuals)
        else:  # from the corrected tests: derivatives are the same to first order
            tests = [corrected(t, self.unknowns, more[count:]) for t in base.tests]
            changes = self.change(base, base.plant, group.residuals, tests)
        out = []
        for i, place in group.members:
            if free[i]:
                own = changes
                if place >= 0:
                    rows = self.rows("gas", place) if group.residuals == ("gas",) else self.rows_of_actuator(place)
                    own = [change.some(rows) for change in changes]
                out.append((i, [self.whitened(t, change.per(step[i])) for t, change in enumerate(own)]))
        return out

    def change(
        self,
        base: OperatingPoint,
        plant: Plant,
        residuals: tuple[str, ...],
        tests: Sequence[MeasuredTest] | None = None,
    ) -> list[SparseBins]:
        """Bins by which every test's residuals of some kinds differ from the base's, with another plant or tests."""
        kinds = tuple(k for k in kinds_shown(residuals, self.tests[0].channels) if k in self.kinds)
        changes = []
        known, paths = base.with_ports_of(plant)
        for k, test in enumerate(tests or base.tests):
            same = test.motion is base.tests[k].motion
            path = follow(plant, test, (known, paths[k]) if same else None)
            before = Evaluated(known, base.tests[k], paths[k], base.residuals[k])
            changes.append(self._some_bins(change_of(before, plant, test, path, kinds), test)[0])
        return changes

    def plant_at(self, x: Array, near: OperatingPoint | None = None) -> Plant:
        """Plant with its parameters set to x (p,); sooner from a point `near` it, where little has to be set."""
        machine, at = self.machine, (x, near.x if near else x)
        changes, known = (parameter_changes(machine, self.parameters, y[: len(self.parameters)]) for y in at)
        if near and known.keys() == changes.keys():
            machine = near.plant.machine
            changes = {path: value for path, value in changes.items() if value != known[path]}
        return make_plant(machine.with_params(changes))

    def bins(self, residuals: Residuals, test: MeasuredTest) -> tuple[Complex, Array]:
        """Bins (m, c) of a test's stacked residuals, zero for those that have no columns here, or that guides take."""
        some, f = self._some_bins(residuals, test)
        return some.full(sum(self.widths)), f

    def _some_bins(self, residuals: Residuals, test: MeasuredTest) -> tuple[SparseBins, Array]:
        """Bins (k, m) of a test's residuals in the columns that are not zero."""
        free = (np.arange(residuals.wrench.shape[1])[:, None] == self.axes).any(axis=1)
        weight = free if test.weight is None else test.weight[:, None] * free
        stacked = residuals._replace(wrench=residuals.wrench * weight).stacked()
        used = stacked.any(axis=0)
        columns = np.flatnonzero(np.repeat([part.shape[1] > 0 for part in residuals], self.widths))[used]
        c = self.comparison
        bins, f = spectrum_of(stacked[:, used], test.dt, c.bands[0], c.bands[-1], c.edge)
        return SparseBins(columns, bins.T), f

    def of_wrench(self, test: int, wrench: Array) -> SparseBins:
        """Bins (k, p, m) of p changes of a test's wrench residual (n, 6, p)."""
        n, _, count = wrench.shape
        c = self.comparison
        weight = self.tests[test].weight
        free = wrench[:, self.axes].reshape(n, -1)
        weighed = free if weight is None else free * weight[:, None]
        bins, f = spectrum_of(weighed, self.tests[test].dt, c.bands[0], c.bands[-1], c.edge)
        return SparseBins(np.flatnonzero(self.rows("wrench")), bins.T.reshape(-1, count, len(f)))

    def rows_of_actuator(self, place: int) -> Mask:
        """Mask of the stacked residuals' columns of one actuator."""
        names, double = self.machine.actuator_names, self.machine.double_acting
        rows = self.rows("flow", place) | self.rows("force", place) | self.rows("servo", place)
        if names[place] in double:
            rows |= self.rows("flow", len(names) + double.index(names[place]))
        return rows

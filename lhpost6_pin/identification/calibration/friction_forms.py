"""Forms of friction compared by their error on held-out tests, for a platen on guides.

Each form is the machine with other friction: of the library in place of its own, or beside it. Its numbers, and those
of the model that friction is confused with (mass, viscous force), are fitted to the measured forces by plain least
squares, every test with equal weight: on real tables the error of any law of friction is far above sensor noise, and
weighing by noise would fit what is left between strokes. Errors are over the measured force, over the compared band
without an offset of the force; each test is predicted by a fit to the others, to first order from the fit to all.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from ...core.arrays import Array, Complex
from ...machine.library import find_family, in_size_of
from ...machine.machine import Machine
from ...machine.parameters import Parameters
from ...mechanics.plant import Plant, make_plant
from ..friction_march import least_yield
from ..prepare import MeasuredTest
from ..residuals import Path, evaluate_residuals, follow
from .effect_parameters import effect_parameters
from .free_parameters import FreeParameter, with_parameters
from .measured_wrench import measured_bins, wrench_bins
from .problem import Problem

__all__ = ["FormError", "FrictionForms", "compare_friction", "effect_of_form", "own_suffices"]

FEWEST = 3  # tests, of which one is held out
NEGLIGIBLE = 1e-3  # amplitude of a constant force above zero frequency over that at zero: leakage of the spectrum
OWN = "bouc_wen"
_CONFUSED = ("seal_friction", "viscous")
_HYSTERESIS = ("seal_yield", "seal_shape")


class _Form(NamedTuple):
    """A form of friction: how it is called, and what of the library makes it."""

    title: str
    family: str = ""
    fixed: tuple[tuple[str, float], ...] = ()  # numbers of the family that make it replace the machine's own friction
    hysteresis: bool = True  # whether the seal's own yield and shape are fitted


_FORMS = {
    "coulomb": _Form("Coulomb: no slip before it slides", hysteresis=False),
    OWN: _Form("presliding, Bouc-Wen: the machine's own"),
    "dahl": _Form("presliding, Dahl (LuGre without damping of its bristles)", "presliding", (("share", 1.0),)),
    "stribeck": _Form("Stribeck: falls with speed", "stribeck_friction"),
    "asymmetric": _Form("depends on direction", "asymmetric_friction"),
    "backlash": _Form("backlash in series with it", "backlash_before_friction", (("share", 1.0),)),
}


@dataclass(frozen=True)
class FormError:
    """One form's errors; t tests."""

    name: str
    title: str
    numbers: int  # that are fitted
    held_out: Array  # (t,) squared error over squared force, of each test by a fit to the others
    fitted: Array  # (t,) the same by the fit to all
    machine: Machine  # fitted to all

    @property
    def explained(self) -> Array:
        """R2 (t,) of the force on held-out tests."""
        return 1.0 - self.held_out

    @property
    def typical(self) -> float:
        """Squared error over squared force on held-out tests, the geometric mean: no test outweighs the others."""
        return _geometric_mean(self.held_out)

    @property
    def error(self) -> Array:
        """RMS error over RMS force (t,) on held-out tests."""
        return np.sqrt(self.held_out)


@dataclass(frozen=True)
class FrictionForms:
    """Forms by falling preference: the machine's own where no other is clearly better, else by held-out error."""

    tests: tuple[str, ...]
    forms: tuple[FormError, ...]
    suffices: bool  # whether none is clearly better than the machine's own

    @property
    def best(self) -> FormError:
        """The form that these tests prefer."""
        return self.forms[0]

    @property
    def own(self) -> FormError:
        """The machine's own form."""
        return next(form for form in self.forms if form.name == OWN)


def own_suffices(problem: Problem, machine: Machine, numbers: Parameters) -> bool:
    """Whether a fitted machine explains the forces of a problem's tests so well that no form of friction matters."""
    force = _Force(problem, machine)
    return _geometric_mean(_shares(force.rows(force.plant))) <= numbers.number("friction.enough")


def _geometric_mean(shares: Array) -> float:
    return float(np.exp(np.mean(np.log(np.maximum(shares, 1e-12)))))


def _shares(rows: Sequence[Array]) -> Array:
    """Squared error over squared force (t,) of every test, of its rows."""
    return np.array([np.sum(each**2) for each in rows])


def compare_friction(problem: Problem, numbers: Parameters, first: str = "") -> FrictionForms | None:
    """Compare forms of friction on a problem's tests; `numbers` are those of `models/procedures/calibration.toml`.

    Where `first` names a form, the others are compared only if it is clearly better than the machine's own. None where
    a comparison does not apply: a platen that is not on guides, friction of zero, no measured force, or fewer than
    three tests.
    """
    machine = problem.machine
    rubbing = all(a.seal_friction > 0.0 for a in machine.actuators)
    if machine.motion == "free" or not rubbing or len(problem.tests) < FEWEST or not problem.rows("wrench").any():
        return None
    there = {effect.family for effect in machine.added_effects}
    own, start = _compared(OWN, _FORMS[OWN], problem, numbers, {})
    found = [own]
    names = [name for name, form in _FORMS.items() if name != OWN and not (form.family and form.family in there)]
    for name in sorted(names, key=lambda name: name != first):
        found.append(_compared(name, _FORMS[name], problem, numbers, start)[0])
        if name == first and not _better(found[-1], own, numbers):
            break
    clear = [one for one in found if one is not own and _better(one, own, numbers)]
    rest = sorted((one for one in found if one not in clear), key=lambda one: (one is not own, one.typical))
    clear.sort(key=lambda one: one.typical)
    return FrictionForms(tuple(test.name for test in problem.tests), (*clear, *rest), not clear)


def _better(one: FormError, own: FormError, numbers: Parameters) -> bool:
    """Whether a form clearly lowers the held-out error of the machine's own, where that is more than a trifle.

    A joint whose gap is small against its elastic slip is no backlash, but presliding of another form.
    """
    n = numbers.number
    added = effect_of_form(one)
    if added is not None and "gap" in added[2] and added[2]["gap"] < n("friction.gap") * added[2]["slip"]:
        return False
    lower = np.mean(one.held_out < own.held_out) >= n("friction.tests")
    return bool(
        own.typical > n("friction.enough") and lower and one.typical < (1.0 - n("friction.better")) * own.typical
    )


def effect_of_form(form: FormError) -> tuple[str, tuple[str, ...], dict[str, float]] | None:
    """Family, components and fitted numbers of the effect that a form adds to the machine; None of its own friction."""
    entry = form.machine.parameters.effects.get(_name(form.name))
    if entry is None:
        return None
    return entry.family, entry.components, {key: float(np.ravel(q.value)[0]) for key, q in entry.values.items()}


def _name(form: str) -> str:
    """Name of a form's effect in a machine."""
    return f"form_{form}"


def _compared(
    name: str, form: _Form, problem: Problem, numbers: Parameters, known: Mapping[str, float]
) -> tuple[FormError, dict[str, float]]:
    """A form fitted to all tests, from coordinates by name where `known`, then to all but each; its coordinates."""
    machine, parameters = _variants(name, form, problem, numbers)
    force = _Force(problem, machine[0])
    fits = [_Fit(force, one, own, numbers) for one, own in zip(machine, parameters, strict=True)]
    starts = sorted(fits, key=lambda fit: fit.cost(fit.start(known))) if len(fits) > 1 else fits
    rounds = int(numbers.number("friction.rounds"))
    kept = starts[: int(numbers.number("friction.starts"))]
    whole = [(fit, fit.solve(fit.start(known), rounds)) for fit in kept]
    fit, x = min(whole, key=lambda pair: pair[0].cost(pair[1])) if len(whole) > 1 else whole[0]
    held, fitted = fit.held_out(x), _shares(fit.rows(x))
    names = [parameter.name for parameter in fit.parameters]
    error = FormError(name, form.title, len(x), held, fitted, fit.machine_at(x))
    return error, dict(zip(names, x.tolist(), strict=True))


def _variants(
    name: str, form: _Form, problem: Problem, numbers: Parameters
) -> tuple[list[Machine], list[tuple[FreeParameter, ...]]]:
    """The machine with a form of friction from each start of its shapes, and what is fitted of each."""
    machine = problem.machine
    masses = {f"platen.mass[{axis}]" for axis in machine.motion}
    fitted = _CONFUSED + (_HYSTERESIS if form.hysteresis else ())
    known = [p for p in problem.parameters if p.name in masses or p.name.partition(".")[2] in fitted]
    if not form.hysteresis:
        kinds = dict.fromkeys(a.kind for a in machine.actuators)
        least = {kind: min(least_yield(machine, a) for a in machine.actuators if a.kind == kind) for kind in kinds}
        return [machine.with_params({f"{kind}.seal_yield": slip for kind, slip in least.items()})], [tuple(known)]
    if not form.family:
        return [machine], [tuple(known)]
    family, fixed = in_size_of(find_family(form.family), machine), dict(form.fixed)
    components = tuple(a.name for a in machine.actuators)
    shapes = [s for s in family.shapes if not s.amplitude]
    spread, factor = (numbers.number(f"friction.{key}") for key in ("spread", "factor"))
    machines, parameters = [], []
    for start in product(*(s.start for s in shapes)):
        values = {s.name: s.typical for s in family.shapes if s.amplitude}
        values |= fixed | {s.name: value for s, value in zip(shapes, start, strict=True)}
        own = effect_parameters(family, _name(name), values, spread, factor)
        machines.append(machine.with_effect(form.family, components, name=_name(name), **values))
        parameters.append((*known, *(p for p in own if p.name.partition(".")[2] not in fixed)))
    return machines, parameters


class _Force:
    """Tests of a problem with their measured forces along the free axes, and residuals of any plant over them."""

    def __init__(self, problem: Problem, machine: Machine) -> None:
        self.problem, self.plant = problem, make_plant(machine)
        axes = self.plant.axes[self.plant.axes < 3]
        self.columns = np.flatnonzero(problem.rows("wrench", 0, 1, 2))
        self.paths: list[Path] = [follow(self.plant, test) for test in problem.tests]
        self.offset: list[Complex] = []
        self.size: list[float] = []
        for t, test in enumerate(problem.tests):
            self.offset.append(self._offset(test, t))
            measured = measured_bins(problem, self.plant, test, t)[:, axes]
            self.size.append(float(np.sum(np.abs(self._moving(measured, t)) ** 2)) or 1.0)

    def _offset(self, test: MeasuredTest, t: int) -> Complex:
        """Bins (m, k) above zero frequency of a constant force along each free axis, of unit norm; zero if negligible.

        It has some where samples without a known slip weigh nothing.
        """
        every = wrench_bins(self.problem, np.ones((test.samples, 6)), test)[:, self.columns]
        bins = every[self.problem.frequency[t] > 0.0]
        norm, whole = np.linalg.norm(bins, axis=0), np.linalg.norm(every, axis=0)
        return np.where(norm > NEGLIGIBLE * whole, bins / np.maximum(norm, 1e-300), 0.0)

    def _moving(self, bins: Complex, t: int) -> Complex:
        """Bins above zero frequency, without what an offset of the force would explain: no form of friction is that."""
        moving, offset = bins[self.problem.frequency[t] > 0.0], self.offset[t]
        return np.asarray(moving - offset * np.sum(offset.conj() * moving, axis=0).real)

    def residual(self, plant: Plant, t: int) -> Array:
        """Real rows of a test's force residual, their squares adding up to its share of the measured ones."""
        test = self.problem.tests[t]
        path = follow(plant, test, (self.plant, self.paths[t]))
        found = evaluate_residuals(plant, test, ("wrench",), path=path)
        bins = self._moving(self.problem.bins(found, test)[0][:, self.columns], t).ravel()
        return np.concatenate([bins.real, bins.imag]) / np.sqrt(self.size[t])

    def rows(self, plant: Plant) -> list[Array]:
        """Those of every test."""
        return [self.residual(plant, t) for t in range(len(self.size))]


class _Fit:
    """Bounded least squares of one machine's friction on forces, about its stated numbers."""

    def __init__(
        self, force: _Force, machine: Machine, parameters: tuple[FreeParameter, ...], numbers: Parameters
    ) -> None:
        n = numbers.number
        self.force, self.machine, self.parameters = force, machine, parameters
        self.prior = np.array([p.sd for p in parameters])
        own, reach = np.array([(p.lowest, p.highest) for p in parameters]).T, n("fit.reach") * self.prior
        self.low, self.high = np.maximum(own[0], -reach), np.minimum(own[1], reach)
        self.weight, self.step = n("friction.prior"), n("friction.step") * self.prior

    def machine_at(self, x: Array) -> Machine:
        """The machine with its parameters at x (p,)."""
        return with_parameters(self.machine, self.parameters, x)

    def start(self, known: Mapping[str, float]) -> Array:
        """Coordinates (p,) to start from: zero but for those known by name."""
        return np.array([known.get(parameter.name, 0.0) for parameter in self.parameters])

    def share(self, x: Array, t: int) -> float:
        """Squared error over squared force of a test."""
        return float(np.sum(self.force.residual(make_plant(self.machine_at(x)), t) ** 2))

    def cost(self, x: Array) -> float:
        """Mean of these shares over all tests."""
        return float(np.mean(_shares(self.rows(x))))

    def rows(self, x: Array) -> list[Array]:
        """Rows of every test at x."""
        return self.force.rows(make_plant(self.machine_at(x)))

    def slopes(self, x: Array, base: Sequence[Array]) -> list[Array]:
        """Derivatives (n, p) of every test's rows at x, where they are `base`."""
        columns: list[list[Array]] = []
        for i, step in enumerate(self.step):
            to = x.copy()
            to[i] += step if x[i] + step <= self.high[i] else -step
            columns.append([(after - b) / (to[i] - x[i]) for after, b in zip(self.rows(to), base, strict=True)])
        return [np.stack(each, axis=1) for each in zip(*columns, strict=True)]

    def solve(self, start: Array, rounds: int) -> Array:
        """Least squares on all tests, from x (p,)."""
        from scipy.optimize import least_squares

        last: list[tuple[Array, list[Array]]] = []
        prior = np.diag(self.weight / self.prior)

        def evaluated(x: Array) -> Array:
            last[:] = [(x.copy(), self.rows(x))]
            return np.concatenate([*last[0][1], prior @ x])

        def slopes(x: Array) -> Array:
            base = last[0][1] if np.array_equal(last[0][0], x) else self.rows(x)
            return np.concatenate([*self.slopes(x, base), prior])

        inside = np.clip(start, self.low + 1e-6 * self.prior, self.high - 1e-6 * self.prior)
        bounds, small = (self.low, self.high), 1e-4  # of a cost of some hundredths: below its scatter between tests
        return np.asarray(
            least_squares(
                evaluated, inside, slopes, bounds, x_scale=self.prior, max_nfev=rounds, ftol=small, xtol=small
            ).x
        )

    def held_out(self, x: Array) -> Array:
        """Shares (t,) of each test by the fit to the others: one Gauss-Newton step from the fit x to all."""
        base, scale = self.rows(x), self.prior
        slopes = [j * scale for j in self.slopes(x, base)]
        right = [j.T @ r for j, r in zip(slopes, base, strict=True)]
        square = [j.T @ j for j in slopes]
        near = 1e-3 * scale
        free = (x > self.low + near) & (x < self.high - near)
        prior, found = self.weight**2, []
        for t, (own, side) in enumerate(zip(square, right, strict=True)):
            matrix = sum(square) - own + prior * np.eye(len(x))
            step = np.zeros(len(x))
            wanted = -(sum(right) - side + prior * x / scale)
            step[free] = np.linalg.solve(matrix[np.ix_(free, free)], wanted[free])
            found.append(self.share(np.clip(x + step * scale, self.low, self.high), t))
        return np.array(found)

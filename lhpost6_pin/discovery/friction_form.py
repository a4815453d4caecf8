"""Backlash before the friction itself, identified by its held-out error before the library is searched.

Screening adds a little of an effect to a model near its best numbers. A joint that all friction sits behind is no such
small addition: it takes the place of the friction that the refit has bent to imitate it. Forms of friction are
therefore fitted in full and compared by their error on held-out tests first (`friction_forms`, as in a calibration);
a backlash that clearly does better than the machine's own friction is added, and the search goes on from there.

What the best law of friction leaves of real forces is no sensor noise, but scatter from stroke to stroke that no law
explains: a share of it counts as noise from then on, equally at all frequencies.
"""

from collections.abc import Sequence

import numpy as np

from ..core.arrays import Array, Complex
from ..core.progress import Progress, between, split
from ..identification.calibration.fit import solve
from ..identification.calibration.friction_forms import compare_friction, effect_of_form, own_suffices
from ..identification.calibration.normal_equations import bounds_of
from ..identification.calibration.operating_point import OperatingPoint
from ..identification.calibration.problem import Problem
from ..machine.library import find_family, in_size_of
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from .acceptance import gate, squares_by_column
from .balances import residual_at
from .candidates import Candidate
from .joint_fit import with_candidate
from .search_state import AddedEffect, FittedCandidate, Search, fitted_machine

__all__ = ["with_friction_form"]


def with_friction_form(found: Search, held: Problem | None, progress: Progress) -> tuple[Search, Problem | None]:
    """The search with backlash before the machine's friction, where its tests clearly prefer it; else itself.

    Returns the problem of the `held` tests, too, with the same share of what is left there as further noise.
    """
    numbers, problem = found.numbers, found.problem
    if problem.machine.motion == "free" or not problem.rows("wrench").any():
        return found, held
    if own_suffices(problem, fitted_machine(found.solution), found.calibration):
        return found, held
    forms = compare_friction(problem, found.calibration, "backlash")
    progress(0.5)
    effect = None if forms is None or forms.suffices else effect_of_form(forms.best)
    if forms is None or effect is None or find_family(effect[0]).named != "backlash":
        return found, held
    family, components, values = effect
    known = in_size_of(find_family(family), problem.machine)
    shape = tuple((s.name, values[s.name]) for s in known.shapes if not s.amplitude)
    candidate = Candidate(known, components, shape)
    amplitudes = tuple(values[s.name] for s in candidate.amplitudes)
    own = candidate.fit_parameters(amplitudes, numbers)
    more, _ = with_candidate(problem, candidate, amplitudes, own, np.zeros(len(problem.names)))
    start = _at(more, forms.best.machine, found.calibration)
    share = numbers.number("scatter.strokes")
    floor = _floor(more, more.residual(OperatingPoint(more, start)), share)
    scaled, parts = problem.scaled(floor), split(between(progress, 0.5, 1.0), 2)
    refit = solve(scaled, found.calibration, _at(scaled, forms.own.machine, found.calibration), parts[0])
    before = Search(scaled, refit, refit, numbers, found.calibration, found.added)
    after = before.solved(more.scaled(floor), start, parts[1], settled=True, near=np.ones(len(start), bool))
    gain = before.objective - after.objective
    if gain < gate(known, numbers):
        return found, held
    contest = (FittedCandidate(candidate, 0.0, fitted_machine(after.solution)),)
    fall = squares_by_column(before.residual) - squares_by_column(after.residual)
    compared = filter(None, map(effect_of_form, forms.forms))
    named = tuple(dict.fromkeys(find_family(name).named for name, *_ in compared))
    added = AddedEffect(candidate, gain, 0, len(forms.forms), contest, fall, 0.0, forms=named)
    if held is not None:
        held = held.scaled(_floor(held, residual_at(held, after.solution).whitened, share))
    return after.with_effect(added), held


def _at(problem: Problem, fitted: Machine, calibration: Parameters) -> Array:
    """Unknowns (p,) of a problem with the numbers of a fitted machine, within their bounds; zero what it has not."""
    x = np.zeros(len(problem.names))
    for i, parameter in enumerate(problem.parameters):
        (path, component), *others = parameter.paths
        if not others and not parameter.of and not path.startswith("effect."):
            value = np.ravel(fitted.parameters[path].value)[max(component, 0)]
            x[i] = parameter.coordinate(float(value))
    return np.clip(x, *bounds_of(problem, calibration))


def _floor(problem: Problem, residual: Sequence[Complex], share: float) -> Array:
    """Scale (t, b, c) of whitened residuals with a share of their RMS, by band and over all bands, as further noise."""
    scale = []
    for bins, f, factor in zip(residual, problem.frequency, problem.whitener.factor, strict=True):
        diagonal = np.abs(np.diagonal(factor, axis1=-2, axis2=-1))  # (b, c), one over the noise's deviation
        band = problem.whitener.band(f)
        weight = diagonal[band]
        power = np.divide(np.abs(bins), weight, out=np.zeros_like(weight), where=weight > 0.0) ** 2
        more = np.tile(power.mean(axis=0), (len(diagonal), 1))
        more[np.unique(band)] += [power[band == b].mean(axis=0) for b in np.unique(band)]
        scale.append(1.0 / np.sqrt(1.0 + share**2 * more * diagonal**2))
    return np.array(scale)

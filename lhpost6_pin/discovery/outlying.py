"""Parameters that stand out: three stated deviations off, where those of the same machine are much nearer.

Within three deviations of its prior a parameter is calibration. One that reaches beyond that within its interval, while
all others that the campaign informs on scatter by a fraction of it, has changed: it is reported as an effect of its
family. Where others are as far off, stated deviations are too small, and none stands out.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from ..core.arrays import Array
from ..identification.calibration.free_parameters import FreeParameter
from .candidates import list_releases
from .estimates import Estimate
from .finding import EffectFinding, p_value_of
from .search_state import Search

__all__ = ["outlying_parameters"]


def outlying_parameters(
    found: Search, sd: Array, estimates: Mapping[str, Estimate], gone: Collection[str] = ()
) -> Iterator[EffectFinding]:
    """Findings of parameters that stand out; sd (p,) are deviations of the unknowns, `estimates` theirs in their units.

    None of those that are `gone`: freed by a search, and no findings.

    None on guides, where few parameters are informed and priors are assumed.
    """
    n, problem = found.numbers.number, found.problem
    if problem.machine.motion != "free":
        return
    own = tuple(f"{one.candidate.name}." for one in found.added)
    count = len(problem.parameters)
    places = [i for i, p in enumerate(problem.parameters) if not (p.of or p.name.startswith(own) or p.natural)]
    known = sd < n("outlying.informative") * problem.stated
    informed = [i for i in places if known[i] and problem.names[i] not in problem.free]
    distance = _of_kinds(problem.parameters, found.solution.x) / problem.stated[:count]
    releases = {one.release: one for one in list_releases(problem)}
    for i in informed:
        others = [k for k in informed if k != i]
        name, reach = problem.names[i], n("outlying.reach") * sd[i] / problem.stated[i]
        if name in gone or name not in releases or len(others) < n("outlying.fewest"):
            continue
        usual = float(np.sqrt(np.mean(distance[others] ** 2)))
        if abs(distance[i]) + reach >= n("outlying.far") and abs(distance[i]) >= n("outlying.apart") * usual:
            one, gain = releases[name], 0.5 * float(distance[i]) ** 2
            yield EffectFinding(
                family=one.family.named,
                components=one.components,
                parameters={name: estimates[name]},
                gain=gain,
                p_value=p_value_of(gain, 1, len(informed)),
                form=one.family.name,
            )


def _of_kinds(parameters: Sequence[FreeParameter], x: Array) -> Array:
    """Coordinates (k,) of parameters, those that a kind shares at the mean of its components.

    A fit may move a shared number one way and the scatter of all its components the other: nothing has changed then.
    """
    out = np.array(x[: len(parameters)], float)
    for i, parameter in enumerate(parameters):
        scatter = [other.at(float(y)) for other, y in zip(parameters, x, strict=False) if other.of == parameter.name]
        if scatter:
            out[i] = parameter.coordinate(parameter.at(float(x[i])) * float(np.mean(scatter)))
    return out

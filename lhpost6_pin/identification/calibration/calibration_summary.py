"""Sentences on a calibration that its report and a terminal share."""

import numpy as np

from .free_parameters import parameter_changes
from .result import Calibration
from .verdicts import contradictions, out_of_range

__all__ = ["correlation_summary", "chance", "contradiction_summary", "cut_strokes", "range_summary"]


def cut_strokes(calibration: Calibration) -> list[str]:
    """A sentence on every stroke that had to give way to a chamber found shorter."""
    machine, count = calibration.machine, len(calibration.parameters)
    turned = {path for parameter in calibration.parameters for path, _ in parameter.paths}
    said = []
    for path, value in parameter_changes(machine, calibration.parameters, calibration.estimate[:count]).items():
        if path not in turned:
            stated = machine.parameters.number(path)
            said.append(f"{path}, stated as {stated:g} m, is cut to {value:.4g} m: a chamber was found to be shorter.")
    return said


def range_summary(calibration: Calibration) -> str:
    """Whether sensors are off by more than their file allows, in words that follow their number."""
    wrong = out_of_range(calibration)
    if not wrong:
        return "all within their stated ranges"
    return f"beyond their stated ranges: {', '.join(calibration.names[i] for i in wrong)}"


def correlation_summary(calibration: Calibration) -> str:
    """How many pairs cannot be told apart, and whether parameters are among them."""
    parameters, pairs = {parameter.name for parameter in calibration.parameters}, calibration.alike()
    if not pairs:
        return "All unknowns can be told apart."
    named = sum(a in parameters or b in parameters for a, b, _ in pairs)
    rest = len(pairs) - named
    said = "Parameters can be told apart from each other and from errors of sensors"
    if named:
        said = f"{_pairs(named)} of a parameter with another, or with an error of a sensor, cannot be told apart"
    if rest:
        said += f"; {_pairs(rest)} of errors of sensors cannot, which the parameters' intervals allow for"
    return f"{said}."


def contradiction_summary(calibration: Calibration) -> str:
    """How many estimates contradict all together, beside how many would by chance; empty where nothing is compared."""
    parts = {s.name: int(np.isfinite(s.sd).sum()) for s in calibration.subsets if s.part}
    if not parts:
        return ""
    found = [one.subset for one in contradictions(calibration)]
    apart = sum(name in parts for name in found)
    said = (
        f"{apart or 'None'} of {sum(parts.values())} estimates by single groups of residuals "
        f"{'contradict' if apart > 1 else 'contradicts'} all together by more than {calibration.limit:g} deviations; "
        f"about {chance(calibration):.1g} would by chance."
    )
    own = calibration.numbers.number("simulation.deviations")
    for subset in calibration.subsets:
        if not subset.part:
            count, other = int(np.isfinite(subset.sd).sum()), found.count(subset.name)
            said += f" Of {count} by simulation {other or 'none'} {'do' if other > 1 else 'does'} by more than {own:g}."
    return said


def chance(calibration: Calibration) -> float:
    """How many estimates by single groups noise alone makes contradict all together."""
    from scipy.stats import norm

    compared = sum(int(np.isfinite(s.sd).sum()) for s in calibration.subsets if s.part)
    return 2.0 * float(norm.sf(calibration.limit)) * compared


def _pairs(count: int) -> str:
    return f"{count} pair{'s' * (count != 1)}"

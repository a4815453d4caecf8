"""Sentences on a calibration, shared by its report and the terminal."""

import numpy as np

from .free_parameters import parameter_changes
from .result import Calibration, contradictions, out_of_range

__all__ = ["chance", "contradiction_summary", "correlation_summary", "cut_strokes", "range_summary"]


def cut_strokes(calibration: Calibration) -> list[str]:
    """A sentence on every stroke reduced because a chamber was identified as shorter."""
    machine, count = calibration.machine, len(calibration.parameters)
    own = {path for parameter in calibration.parameters for path, _ in parameter.paths}
    values = parameter_changes(machine, calibration.parameters, calibration.estimate[:count])
    return [
        f"{path}, stated as {machine.parameters.number(path):g} m, is reduced to {value:.4g} m: a chamber is shorter."
        for path, value in values.items()
        if path not in own
    ]


def range_summary(calibration: Calibration) -> str:
    """Whether sensor errors exceed their stated ranges, to follow their number."""
    wrong = out_of_range(calibration)
    if not wrong:
        return "all within their stated ranges"
    return f"beyond their stated ranges: {', '.join(calibration.names[i] for i in wrong)}"


def correlation_summary(calibration: Calibration) -> str:
    """How many pairs of unknowns are too strongly correlated to be identified separately."""
    own, pairs = {parameter.name for parameter in calibration.parameters}, calibration.correlated_pairs()
    if not pairs:
        return "No unknowns are strongly correlated."
    named = sum(a in own or b in own for a, b, _ in pairs)
    text = "No parameter is strongly correlated with another or with an error of a sensor"
    if named:
        text = f"{_pairs(named)} of a parameter with another, or with an error of a sensor, strongly correlated"
    if rest := len(pairs) - named:
        text += f"; {_pairs(rest)} of errors of sensors, which the parameters' intervals allow for"
    return f"{text}."


def contradiction_summary(calibration: Calibration) -> str:
    """How many subset estimates differ from the joint estimate, and how many by chance; empty without subsets."""
    parts = {s.name: int(np.isfinite(s.sd).sum()) for s in calibration.subsets if s.part}
    if not parts:
        return ""
    found = [one.subset for one in contradictions(calibration)]
    text = (
        f"{sum(name in parts for name in found)} of {sum(parts.values())} subset estimates (single groups of "
        f"residuals) differ from the joint estimate by more than {calibration.limit:g} sigma; expected by chance: "
        f"{chance(calibration):.1g}."
    )
    own = calibration.numbers.number("simulation.deviations")
    for subset in calibration.subsets:
        if not subset.part:
            count, other = int(np.isfinite(subset.sd).sum()), found.count(subset.name)
            text += f" Of {count} estimates by simulation, {other} differ by more than {own:g} sigma."
    return text


def chance(calibration: Calibration) -> float:
    """How many subset estimates noise alone makes differ from the joint estimate."""
    from scipy.stats import norm

    compared = sum(int(np.isfinite(s.sd).sum()) for s in calibration.subsets if s.part)
    return 2.0 * float(norm.sf(calibration.limit)) * compared


def _pairs(count: int) -> str:
    return f"{count} pair{'s' * (count != 1)}"

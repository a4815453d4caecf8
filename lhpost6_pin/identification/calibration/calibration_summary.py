"""Sentences on a calibration, shared by its report and the terminal."""

import numpy as np

from .free_parameters import parameter_changes
from .result import Calibration, contradictions, out_of_range, stated_range, verdict_on

__all__ = ["chance", "command_note", "compared", "contradiction_summary", "convergence_summary", "correlation_summary"]
__all__ += ["cut_strokes", "delay_summary", "friction_summary", "interval_summary", "lacking", "range_summary"]


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
    if wrong := out_of_range(calibration):
        return f"beyond their stated ranges: {', '.join(calibration.names[i] for i in wrong)}"
    share = np.abs(calibration.estimate) / stated_range(calibration)
    over = [f"{calibration.names[i]} {100 * share[i]:.0f} %" for i in np.argsort(-share) if share[i] > 1.0]
    if not over:
        return "all within their stated ranges"
    sure = f"more than {calibration.limit:g} predicted deviations"
    return f"none beyond its stated range by {sure} (beyond it by less: {', '.join(over)} of it)"


def delay_summary(calibration: Calibration) -> str:
    """Delays beyond their stated ranges that were removed before the fit; empty if there are none."""
    late = [d for d in calibration.delays if d.beyond(calibration.limit)]
    each = [
        f"{d.group} {1e3 * d.delay:.3g} ms relative to {d.reference} (stated of both: at most {1e3 * d.stated:.3g} ms)"
        for d in late
    ]
    return f"Delays beyond their stated ranges, removed before the fit: {', '.join(each)}." if late else ""


def lacking(calibration: Calibration) -> bool:
    """Whether these tests show more than noise that the calibrated model does not explain."""
    return bool(np.nanmax(calibration.misfit_after) > calibration.noise_alone)


def interval_summary(calibration: Calibration) -> str:
    """That intervals are too narrow where misfit is left; empty elsewhere."""
    if not (calibration.converged and lacking(calibration)):
        return ""
    largest = float(np.nanmax(calibration.misfit_after))
    return (
        f"Intervals allow for sensor noise, not for errors of the model: misfit is left (mean square {largest:.3g} at "
        "most, 1 is sensor noise), so that they are too narrow."
    )


def command_note(calibration: Calibration) -> str:
    """That no balance of a calibration has the way from commands to spools; empty where its delay is no unknown."""
    count = len(calibration.parameters)
    delays = [
        name
        for i, name in enumerate(calibration.names[:count])
        if name.endswith(".valve_delay") and verdict_on(calibration, i) == "not informed"
    ]
    if not delays:
        return ""
    remedy = "`lhpost6 discover` fits it where commands and spools were recorded"
    return f"{', '.join(delays)}: commands are in no balance of a calibration; {remedy}."


def convergence_summary(calibration: Calibration) -> str:
    """Whether the fit converged; if not, whether for want of an effect or of information; and what to do next."""
    rounds = f"{calibration.rounds} round{'s' * (calibration.rounds != 1)}"
    then = (
        "the model lacks something that these tests show, a sensor is wrong, or the stated noise is too small; "
        "`lhpost6 check` judges sensors and noise, `lhpost6 discover` names what is missing"
    )
    if calibration.converged:
        return f"converged after {rounds}" + (f"; misfit is left: {then}" if lacking(calibration) else "")
    if lacking(calibration):
        return f"not converged in {rounds}, while misfit is left: {then}"
    return f"not converged in {rounds}: these tests carry too little information; add tests or excite more"


def friction_summary(calibration: Calibration) -> str:
    """Which form of friction the tests prefer, and whether the machine's own suffices; empty where not compared."""
    found = calibration.friction
    if found is None:
        return ""
    own, best = found.own, found.best
    errors = [f"{100.0 * form.error.mean():.3g} %" for form in (own, best)]
    if found.suffices:
        return f"The machine's own form of friction suffices: none is clearly better than its mean error, {errors[0]}."
    return (
        f"The machine's own form of friction does not suffice: these tests prefer {best.title}, mean error {errors[1]} "
        f"in place of {errors[0]}. `lhpost6 discover` tests it against other effects and adds it to the machine."
    )


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
    parts = compared(calibration)
    if not parts:
        return ""
    found = [one.subset for one in contradictions(calibration)]
    text = (
        f"{sum(name in parts for name in found)} of {sum(parts.values())} subset estimates (single groups of "
        f"residuals) differ from the joint estimate by more than {calibration.limit:g} sigma; expected by chance: "
        f"{chance(calibration):.1g}."
    )
    own = calibration.numbers.number("simulation.deviations")
    for name, count in compared(calibration, part=False).items():
        text += f" Of {count} estimates by simulation, {found.count(name)} differ by more than {own:g} sigma."
    return text


def chance(calibration: Calibration) -> float:
    """How many subset estimates noise alone makes differ from the joint estimate."""
    from scipy.stats import norm

    return 2.0 * float(norm.sf(calibration.limit)) * sum(compared(calibration).values())


def compared(calibration: Calibration, part: bool = True) -> dict[str, int]:
    """How many estimates each subset has, those that are a `part` of the joint estimate, or simulation."""
    return {s.name: int(np.isfinite(s.sd).sum()) for s in calibration.subsets if s.part == part}


def _pairs(count: int) -> str:
    return f"{count} pair{'s' * (count != 1)}"

"""Notes beside a verdict: what remains of the held-out error, what a refit alone explains, how far intervals hold."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..identification.validation import PHASES
from ..machine.library import find_family
from .balances import Balance
from .estimates import deviations
from .held_out import Gap
from .search_state import Search

if TYPE_CHECKING:
    from .discover import Discovery
    from .verdict import Verdict

__all__ = [
    "EXPECTED_SCATTER",
    "balance_note",
    "before_screening",
    "drift_note",
    "fading_note",
    "floor_note",
    "form_note",
    "interval_note",
    "open_share",
    "open_summary",
    "refit_summary",
]

EXPECTED_SCATTER = (
    "Expected scatter: sensor noise, and what the form of friction, its state at the start and the oil's temperature "
    "leave open; the search weighs residuals by it."
)
"""The unit of all that a search weighs; that of a phase is sensor noise alone."""

OPEN = 0.1
"""Share of a gap beyond its floor from which it is stated that the effects leave it."""

FALLS = 2.0
"""Error as delivered over that of a refit from which it is stated what the refit explains it by."""

MOVES = 0.05
"""Share by which effects lower the error of a balance at least where it is evidence for them: scatter is less."""

CLOSED = 0.5
"""Share of a gap beyond its floor from which its closing is evidence for the effects."""

LISTED = 3  # sensor errors that are named


def open_share(found: "Discovery") -> float:
    """Largest share of a held-out gap beyond its floor that the effects leave; zero where no gap was open."""
    return max((1.0 - gap.closure for gap in _open_gaps(found)), default=0.0)


def _open_gaps(found: "Discovery") -> list[Gap]:
    """The gaps of held-out tests that were open before the effects."""
    return [gap for gap in found.proof.gaps if not math.isnan(gap.closure)] if found.proof else []


def open_summary(found: "Discovery") -> str:
    """How much of the widest gap the effects leave; empty where that is little."""
    if open_share(found) <= OPEN:
        return ""
    gap = min(_open_gaps(found), key=lambda one: one.closure)
    sizes = f"{gap.refitted:.3g} to {gap.after:.3g} times sensor noise, floor {gap.floor:.3g}"
    left = f"{100.0 * (1.0 - gap.closure):.0f} % of the error beyond the floor remains"
    return f" On held-out tests {left} ({gap.phase}, {gap.test}: {sizes})."


def floor_note(found: "Discovery") -> str:
    """Phases whose refit without effects is at the floor already, so that they cannot show an effect; else empty."""
    gaps = found.proof.gaps if found.proof and found.search.added else ()
    hidden = [f"{gap.phase}, {gap.test}" for gap in gaps if math.isnan(gap.closure)]
    if not hidden:
        return ""
    if any(b.error[1] - b.error[2] > MOVES * b.error[1] for b in found.balances):
        evidence = "and the balances are the evidence"
    elif any(gap.closure > CLOSED for gap in _open_gaps(found)):
        evidence = "and the other phases are the evidence"
    else:
        alone = "evidence is in the tests of the search alone, of which one may be held out"
        evidence = f"nor do their balances show it: {alone}"
    return (
        f"At the floor without effects already: {'; '.join(hidden)}. Sensor noise, also that in the state of friction, "
        f"hides there what the effects do: no closure is stated, {evidence}."
    )


def refit_summary(found: "Discovery") -> str:
    """What a refit without effects explains the error as delivered by; empty where it explains little."""
    gaps = [gap for gap in found.proof.gaps if gap.delivered > FALLS * gap.refitted] if found.proof else []
    if not gaps:
        return ""
    gap = max(gaps, key=lambda one: one.delivered / one.refitted)
    sizes = f"{gap.delivered:.3g} to {gap.refitted:.3g} times sensor noise"
    errors = [name for name in _sensor_errors(found.search) if _reaches(name, gap.phase, found.search.problem.names)]
    within = "" if found.verdict.sensors else " within their ranges"
    by = [f"errors of sensors{within} (foremost {', '.join(errors[:LISTED])})"] if errors else []
    by += ["the parameters that differ"] if found.verdict.changed else []
    causes = " and ".join(by) or "small changes of many parameters"
    return f" A refit lowers the held-out error ({gap.phase}, {gap.test}: {sizes}) by {causes}."


def _reaches(error: str, phase: str, names: Sequence[str]) -> bool:
    """Whether an error of a sensor, as in `gain spool_position[H1]`, is in what a phase reads.

    Inverse dynamics reads motion, gas and forces; chamber pressures only where no force was recorded.
    """
    channel = error.split()[-1].partition("[")[0]
    if phase != PHASES[1] or channel.startswith(("platen", "point", "actuator", "strut")):
        return True
    return channel.startswith(("chamber", "pressure")) and not any("actuator_force" in name for name in names)


def _sensor_errors(found: Search) -> list[str]:
    """Sensor errors that differ from zero with delays removed beforehand, the most significant first."""
    limit = found.calibration.number("report.deviations")
    first, names = len(found.problem.parameters), found.problem.names
    far = np.abs(found.solution.x / deviations(found))
    sizes = {names[i]: float(far[i]) for i in range(first, len(names)) if far[i] > limit}
    late = {f"delay {one.group}": abs(one.delay) / one.deviation for one in found.problem.delays if one.deviation > 0.0}
    sizes |= {name: size for name, size in late.items() if size > limit}
    return sorted(sizes, key=lambda name: -sizes[name])


def interval_note(found: "Discovery") -> str:
    """That intervals are too narrow where more than the expected scatter is left; empty elsewhere."""
    search = found.search
    limit = search.calibration.number("report.misfit")
    left = [kind for kind in search.problem.kinds if search.misfit(kind) > limit]
    if not left and open_share(found) <= OPEN:
        return ""
    where = (
        f"of {', '.join(left)} is left beyond that scatter" if left else "of held-out tests is left beyond its floor"
    )
    return (
        f"Intervals allow for the expected scatter, not for errors of the model: misfit {where}, so that they are too "
        "narrow."
    )


def before_screening(search: Search) -> list[str]:
    """Effects that were added before the library was screened, and by what: no round has their gains."""
    out = []
    for one in search.added:
        name, on = one.candidate.family.named, ", ".join(one.candidate.components)
        if one.forms:
            how = f"by the held-out error of forms of friction, fitted in full ({', '.join(one.forms)})"
        elif one.from_lengths:
            how = "by the lengths of actuators against the platen's pose"
        else:
            continue
        out.append(
            f"Before any round: {name} on {on}, identified {how}; gain of log-likelihood {one.gain:.4g}. Rounds add "
            "effects to the model with it, so that they do not show its gain."
        )
    return out


def form_note(found: "Discovery") -> str:
    """Equations of the forms that every fit frees, whose numbers are among those recalibrated; empty without any."""
    names = dict.fromkeys(name.rpartition(".")[0] for name in found.verdict.changed)
    entries = found.fitted.parameters.effects
    of = {name: find_family(entries[name].family) for name in names if name in entries}
    own = [
        f"{name}: {family.title}, {family.equation}." for name, family in of.items() if family.search == "background"
    ]
    return " ".join(["Freed in every fit, and no missing effects:", *own]) if own else ""


def drift_note(verdict: "Verdict") -> str:
    """Lengths that drift within tests, and what may cause that; empty without any."""
    drifting = [s.name.partition(" ")[2] for s in verdict.sensors if s.name.startswith("drift ")]
    drifts = f"drift{'s' * (len(drifting) == 1)} against the platen's pose within tests"
    cause = "a rod that lengthens with heat, a mount that creeps, or the zero of a sensor"
    return f"{', '.join(drifting)} {drifts} ({cause})" if drifting else ""


def fading_note(verdict: "Verdict") -> str:
    """Forces found that fade, which no elastic one does; empty without any."""
    each = [
        f"{find_family(one.candidate.family.named).title} ({', '.join(one.candidate.components)}) fades in about "
        f"{one.memory:g} s while it is held (gain {one.gain:.0f})"
        for one in verdict.fading
    ]
    return f"what was fitted as {' and '.join(each)}, as a viscoelastic mount does" if each else ""


def balance_note(balances: Sequence[Balance]) -> str:
    """What balances leave out, which decompose and validate show."""
    words = (
        f"{EXPECTED_SCATTER} An error below one is within it; over sensor noise alone, the unit of phases, the same "
        "error may be many times as large. Balances are of records whose sensors' errors were corrected as fitted; "
        "model.toml holds the machine without them, so that decompose and validate, which take records as they are, "
        "show larger errors."
    )
    least = min((one for one in balances if one.kind == "wrench"), key=lambda one: one.slip_known, default=None)
    if least is not None and least.slip_known < 1.0:
        words += (
            f" The wrench is compared in the {100.0 * least.slip_known:.0f} % of {least.test} where friction's slip is "
            "known; in the rest the displacement's noise hides it, and the modelled friction is noise."
        )
    return words

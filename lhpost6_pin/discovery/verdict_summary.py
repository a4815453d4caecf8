"""The verdict in a sentence."""

from ..machine.library import find_family
from .discover import Discovery

__all__ = ["said", "title_of", "where"]


def said(found: Discovery) -> str:
    """What was found, in a sentence or two; and that nothing proves it, where no test was held out."""
    if found.verdict.effects and found.proof is None:
        return f"{_found(found)} No test was held out to prove it: give more, or name one with --hold-out."
    return _found(found)


def _found(found: Discovery) -> str:
    verdict = found.verdict
    effects = " and ".join(f"{title_of(one.family)} ({where(one.components)})" for one in verdict.effects)
    if verdict.word == "none":
        return "the model explains the campaign; no parameter differs from what the machine file states."
    if verdict.word == "not_testable":
        return f"nothing was found, but the campaign is no test of {len(verdict.untestable)} families: excite more."
    if verdict.word == "parameters_only":
        return f"no effect is missing; {len(verdict.changed)} parameters differ: {', '.join(verdict.changed)}."
    if verdict.word == "sensor":
        return f"no effect is missing; sensors beyond what is stated: {', '.join(s.name for s in verdict.sensors)}."
    if verdict.word == "named":
        return f"{effects}."
    if verdict.word == "ambiguous":
        rivals = " and ".join(" or ".join(map(title_of, (e.family, *e.rivals))) for e in verdict.effects if e.rivals)
        return f"{effects}; the campaign cannot tell {rivals}."
    left, place = verdict.residual_function, "more than noise is left"
    if left is not None:
        place = f"something acts on {where(left.components)}, by {left.words}"
    elif drifting := [s.name.partition(" ")[2] for s in verdict.sensors if s.name.startswith("drift ")]:
        place = f"{', '.join(drifting)} drift against the platen's pose within tests"
    near = f" Nearest comes {' and '.join(map(title_of, verdict.nearest))}." if verdict.nearest else ""
    return f"{effects + '; beyond that ' if effects else ''}{place}, and the library has no name for it.{near}"


def title_of(family: str) -> str:
    """A family in words."""
    return find_family(family).title


def where(components: tuple[str, ...]) -> str:
    """Components in few words."""
    return ", ".join(components) if len(components) < 4 else f"{components[0]} to {components[-1]}"

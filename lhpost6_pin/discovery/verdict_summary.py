"""Summary of a verdict in a sentence or two."""

from ..machine.library import find_family
from .discover import Discovery

__all__ = ["summary", "title_of", "where"]


def summary(found: Discovery) -> str:
    """What was identified; and that it is not validated, where no test was held out."""
    verdict = found.verdict
    effects = " and ".join(f"{title_of(one.family)} ({where(one.components)})" for one in verdict.effects)
    if verdict.word == "unexplained":
        text = _unexplained(found, effects)
    else:
        rivals = " and ".join(" or ".join(map(title_of, (e.family, *e.rivals))) for e in verdict.effects if e.rivals)
        text = {
            "none": "no missing effect; no parameter differs from the machine file.",
            "not_testable": f"no missing effect, but {len(verdict.untestable)} families are not testable with this "
            "campaign: it needs more excitation.",
            "parameters_only": f"no missing effect; {len(verdict.changed)} parameters differ: "
            f"{', '.join(verdict.changed)}.",
            "sensor": "no missing effect; sensors beyond their stated ranges: "
            f"{', '.join(s.name for s in verdict.sensors)}.",
            "named": f"{effects}.",
            "ambiguous": f"{effects}; the campaign does not discriminate between {rivals}.",
        }[verdict.word]
    if verdict.effects and found.proof is None:
        return f"{text} Not validated, as no test was held out: add tests, or name one with --hold-out."
    return text


def _unexplained(found: Discovery, effects: str) -> str:
    verdict = found.verdict
    function, place = verdict.residual_function, "the residual exceeds noise"
    if function is not None:
        place = f"an effect acts on {where(function.components)}, as a function of {function.description}"
    elif drifting := [s.name.partition(" ")[2] for s in verdict.sensors if s.name.startswith("drift ")]:
        place = f"{', '.join(drifting)} drift against the platen's pose within tests"
    near = f" Nearest family: {' and '.join(map(title_of, verdict.nearest))}." if verdict.nearest else ""
    return f"{effects + '; in addition ' if effects else ''}{place}; no family of the library explains it.{near}"


def title_of(family: str) -> str:
    """Title of a family."""
    return find_family(family).title


def where(components: tuple[str, ...]) -> str:
    """Components, abbreviated."""
    return ", ".join(components) if len(components) < 4 else f"{components[0]} to {components[-1]}"

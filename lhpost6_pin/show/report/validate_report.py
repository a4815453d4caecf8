"""The report of a validation: agreement of model and measurement in three phases, by test and axis."""

from pathlib import Path

from ...identification.validation import PHASES, Validation
from .control_blocks import assumed_in, load_of, numbers_used
from .page import Headline, Level, Markup, Page, Section, bullet_list, number, save_page
from .run_motion import percent
from .validate_machine import drift_blocks, lag_blocks, resonance_blocks, valve_blocks
from .validate_sections import ROMAN, named, summary_blocks, test_blocks, why_not, worst_of

__all__ = ["write_validate_report"]

FOLLOWED = 0.10  # judgement, not physics: RRMSE, delay removed, up to which the model counts as valid for a test


def write_validate_report(found: Validation, path: Path | str, *, command: str = "") -> Path:
    """Write the self-contained HTML report of a validation to `path` and return the path."""
    verdict, level = _judge(found)
    asked = " and ".join(", ".join(PHASES[n] for n in _done(found)).rsplit(", ", 1))
    count = f"{len(found.tests)} test{'s' * (len(found.tests) > 1)}"
    page = Page(
        kind="Validation report",
        title=f"Validation on {found.campaign}",
        asked=(
            f"Compare {count} with {load_of(found.machine)} by {asked}, up to {number(found.numbers.band.high)} Hz."
        ),
        verdict=verdict,
        level=level,
        headlines=[_headline(found, n) for n in _done(found)],
        sections=[
            Section("summary", "Agreement by phase, test and axis", summary_blocks(found)),
            *_machine_sections(found),
            *(
                Section(f"test-{k}", f"Test {test}", test_blocks(found, test))
                for k, test in enumerate(found.tests, start=1)
            ),
            Section("assumptions", "Assumptions and sources", _assumptions(found)),
        ],
        notes=_notes(found),
        command=command,
    )
    return save_page(page, path)


def _machine_sections(found: Validation) -> list[Section]:
    """Sections on all tests together, for the requested phases."""
    done = _done(found)
    sections = []
    if 2 in done:
        sections.append(Section("drift", "Drift of the open loop", drift_blocks(found)))
    if 3 in done:
        sections.append(Section("lag", "Delay of the closed loop", lag_blocks(found)))
    if 2 in done or 3 in done:
        sections.append(Section("resonance", "Oil columns", resonance_blocks(found)))
        sections.append(Section("valves", "Servovalves", valve_blocks(found)))
    return sections


def _done(found: Validation) -> list[int]:
    """Numbers of the phases that were asked for."""
    return sorted({p.number for p in found.phases})


def _judge(found: Validation) -> tuple[str, Level]:
    sentences: list[str] = []
    level: Level = "good"
    for n in _done(found):
        worst = worst_of(found, n)
        if worst is None:
            sentences.append(f"{PHASES[n].capitalize()}: {why_not(found, n)}.")
            continue
        phase, one = worst
        where = f"{phase.test}, {one.column}, {named(one.quantity)}"
        words = f"{PHASES[n].capitalize()}: largest RRMSE {percent(one.rrmse_aligned)} ({where})"
        spread = found.residual_over_noise if n == 1 else None
        residual = f"; residual {number(spread[0], 2)} to {number(spread[1], 2)} times the noise" if spread else ""
        sentences.append(f"{words}{residual}.")
        level = level if one.rrmse_aligned <= FOLLOWED else "attention"
    if any("settings may differ" in words for p in found.phases for words in p.notes):
        sentences.append("The controller settings of the tests are unknown.")
    stopped = [p.test for p in found.phases if any("stopped at" in words for words in (*p.notes, p.reason or ""))]
    if stopped:
        sentences.append(f"A simulation stopped early in {', '.join(dict.fromkeys(stopped))}; see the notes.")
        level = "bad"
    return " ".join(sentences), level


def _headline(found: Validation, n: int) -> Headline:
    label = f"Phase {ROMAN[n]}, {PHASES[n]}: worst RRMSE, delay removed"
    worst = worst_of(found, n)
    if worst is None:
        return Headline("–", label, "not judged")
    phase, one = worst
    note = f"{phase.test}, axis {one.column}, {named(one.quantity)}; {percent(one.rrmse)} including delay; "
    note += f"{number(one.error_to_noise, 2)} × noise"
    return Headline(percent(one.rrmse_aligned), label, note, "good" if one.rrmse_aligned <= FOLLOWED else "attention")


def _notes(found: Validation) -> list[str]:
    """Missing phases and events; tests with the same note share it."""
    said: dict[str, list[str]] = {}
    for phase in found.phases:
        if phase.reason:
            said.setdefault(f"no {PHASES[phase.number]}: {phase.reason}", []).append(phase.test)
        for words in phase.notes * (phase.number > 1):
            said.setdefault(words, []).append(phase.test)
    tests = {words: list(dict.fromkeys(names)) for words, names in said.items()}
    return [
        f"{'All tests' if len(names) == len(found.tests) > 1 else ', '.join(names)}: {words}"
        for words, names in tests.items()
    ]


def _assumptions(found: Validation) -> list[Markup]:
    sensors, band = found.sensors, found.numbers.band
    guessed = sum(q.assumed for q in sensors.parameters.values())
    made = [p.notes for p in found.phases if p.number == 1 and not p.reason]
    lines = [
        *dict.fromkeys(words for notes in made for words in notes),
        f"All compared signals are low-passed by one zero-phase filter (gain 1/2 at {band.high:g} Hz, order "
        f"{band.order}); {found.numbers.edge:g} s at each end are omitted. Spectra are not filtered.",
        "Open-loop runs start in the control zero-position with the first recorded pressures and with friction at "
        "rest.",
        f"Noise is the change caused by adding the noise of “{sensors.name}” to a record once more; {guessed} of its "
        f"{len(sensors.parameters)} numbers are assumed. Gains and offsets of sensors are not corrected.",
        *(
            f"Skew removed from {group}: {1e3 * d.delay:+.3f} ± {1e3 * d.standard_error:.3f} ms behind {d.reference}."
            for group, d in found.skews.items()
        ),
        assumed_in(found.machine),
    ]
    return [bullet_list(lines), numbers_used(found.numbers.stated)]

"""The report of a validation: agreement of model and measurement in three phases, by test and axis."""

from collections.abc import Iterable
from pathlib import Path

from ...identification.known_slip import UNKNOWN_SLIP
from ...identification.validation import PHASES, Validation
from .control_blocks import assumed_in, load_of, numbers_used
from .page import Block, Headline, Level, Page, Section, bullet_list, number, save_page
from .scales import percent
from .validate_machine import drift_blocks, lag_blocks, resonance_blocks, valve_blocks
from .validate_sections import (
    ACTUATORS,
    ROMAN,
    named,
    summary_blocks,
    test_blocks,
    worst_in_words,
    worst_of,
)

__all__ = ["validation_notes", "validation_verdict", "write_validate_report"]

FOLLOWED = 0.10  # judgement, not physics: RRMSE, delay removed, up to which the model counts as valid for a test


def write_validate_report(found: Validation, path: Path | str, *, command: str = "") -> Path:
    """Write the self-contained HTML report of a validation to `path` and return the path."""
    verdict, level = validation_verdict(found)
    phases = _requested(found)
    listed = " and ".join(", ".join(PHASES[n] for n in phases).rsplit(", ", 1))
    count = f"{len(found.tests)} test{'s' * (len(found.tests) > 1)}"
    over_all = {
        "drift": ("Drift of the open loop", drift_blocks, 2 in phases),
        "lag": ("Delay of the closed loop", lag_blocks, 3 in phases),
        "resonance": ("Oil columns", resonance_blocks, 2 in phases or 3 in phases),
        "valves": ("Servovalves", valve_blocks, 2 in phases or 3 in phases),
    }
    page = Page(
        kind="Validation report",
        title=f"Validation on {found.campaign}",
        purpose=(
            f"Compare {count} with {load_of(found.machine)} by {listed}, up to {number(found.numbers.band.high)} Hz."
        ),
        verdict=verdict,
        level=level,
        headlines=[_headline(found, n) for n in phases],
        sections=[
            Section("summary", "Agreement by phase, test and axis", summary_blocks(found)),
            *(Section(name, title, blocks(found)) for name, (title, blocks, due) in over_all.items() if due),
            *(Section(f"test-{k}", f"Test {t}", test_blocks(found, t)) for k, t in enumerate(found.tests, start=1)),
            Section("assumptions", "Assumptions and sources", _assumptions(found)),
        ],
        notes=validation_notes(found),
        command=command,
    )
    return save_page(page, path)


def _requested(found: Validation) -> list[int]:
    """Numbers of the requested phases."""
    return sorted({p.number for p in found.phases})


def validation_verdict(found: Validation) -> tuple[str, Level]:
    """Return the verdict and its level."""
    sentences: list[str] = []
    level: Level = "good"
    for n in _requested(found):
        worst = worst_of(found, n)
        words = f"{PHASES[n].capitalize()}: {worst_in_words(found, n)}"
        spread = found.residual_over_noise if n == 1 and worst else None
        residual = f"; residual {number(spread[0], 2)} to {number(spread[1], 2)} times the noise" if spread else ""
        sentences.append(f"{words}{residual}.")
        level = "attention" if worst and not worst[1].rrmse_aligned <= FOLLOWED else level
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
    if (single := worst_of(found, n, ACTUATORS)) is not None:
        note += f". Single actuators: up to {percent(single[1].rrmse_aligned)} ({single[0].test}, {single[1].column})"
    return Headline(percent(one.rrmse_aligned), label, note, "good" if one.rrmse_aligned <= FOLLOWED else "attention")


def validation_notes(found: Validation) -> list[str]:
    """Return missing phases and events; tests with the same note share it."""
    said: list[tuple[str, str]] = []
    for phase in found.phases:
        missing = [f"no {PHASES[phase.number]}: {phase.reason}"] if phase.reason else []
        words = (*missing, *phase.notes * (phase.number > 1), *([phase.slip] if phase.slip else []))
        said += [(phase.test, one) for one in words]
    notes = _by_note(found, said)
    return [*notes, UNKNOWN_SLIP] if any(phase.slip for phase in found.phases) else notes


def _by_note(found: Validation, said: Iterable[tuple[str, str]]) -> list[str]:
    """Notes, given with their tests, once each with all its tests."""
    tests: dict[str, dict[str, None]] = {}
    for test, words in said:
        tests.setdefault(words, {})[test] = None
    return [
        f"{'All tests' if len(names) == len(found.tests) > 1 else ', '.join(names)}: {words}"
        for words, names in tests.items()
    ]


def _assumptions(found: Validation) -> list[Block]:
    sensors, band = found.sensors, found.numbers.band
    guessed = sum(q.assumed for q in sensors.parameters.values())
    made = [(p.test, words) for p in found.phases if p.number == 1 and not p.reason for words in p.notes]
    lines = [
        *_by_note(found, made),
        f"All compared signals are low-passed by one zero-phase filter (gain 1/2 at {band.high:g} Hz, order "
        f"{band.order}); {found.numbers.edge:g} s at each end are omitted. Spectra are not filtered.",
        "Open-loop runs start in the control zero-position with the first recorded pressures and with what seals and "
        "pads hold then by the balance of forces (nothing with a specimen that moves).",
        f"Noise is the change caused by adding the noise of “{sensors.name}” to a record once more; {guessed} of its "
        f"{len(sensors.parameters)} numbers are assumed. Gains and offsets of sensors are not corrected.",
        *(
            f"Skew removed from {group}: {1e3 * d.delay:+.3f} ± {1e3 * d.standard_error:.3f} ms behind {d.reference}."
            for group, d in found.skews.items()
        ),
        assumed_in(found.machine),
    ]
    return [bullet_list(lines), numbers_used(found.numbers.stated)]

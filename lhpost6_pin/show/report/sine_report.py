"""The report of a sine test: amplitude, phase and distortion without and with the cancellers."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...core.names import AXES
from ...tuning.identify import tuning_numbers
from ...tuning.sine import SineResult, SineTest
from .control_blocks import assumption_blocks, load_of, loop_sentence
from .page import Headline, Level, Page, Section, Table, number, save_page
from .scales import axis_scale, percent, shown_as, signed
from .sine_plots import (
    convergence_figure,
    error_per_cycle,
    harmonic_blocks,
    history_figure,
    motion_error,
    percent_of_fundamental,
    spool_blocks,
)

__all__ = ["sine_table", "sine_verdict", "write_sine_report"]

# Judgement, not physics: what a sine test must reach.
AMPLITUDE = 0.01
PHASE = np.radians(2.0)
GROWN = 1.05  # RMS error of the last measured cycle over the first from which it counts as growing, if not small
DISTORTION_LEFT = 0.5  # share of the total harmonic distortion without cancellers
DISTORTION_RISEN = 2.0  # the same, from which a test with cancellers is bad
SHAKEN = 2.0  # peak acceleration achieved over that of the target, from which the verdict states both


def write_sine_report(
    test: SineTest, path: Path | str, command: str = "", loop: Mapping[str, Any] | None = None
) -> Path:
    """Write the self-contained HTML report of a sine test to `path` and return the path.

    loop: stability of the control loop, see `loop_sentence`.
    """
    machine = test.before.run.plant.machine
    amplitude = shown_as(test.amplitude, axis_scale(test.axis, "displacement"))
    time = test.target.time[test.measured]
    cycles = round((time[-1] - time[0]) * test.frequency)
    verdict, level = sine_verdict(test, loop or {})
    numbers = assumption_blocks(machine, ("sine", "feedforward_targets.high"))
    page = Page(
        kind="Sine report · simulated",
        title=f"Sine of {amplitude} at {number(test.frequency)} Hz in {test.axis}",
        purpose=(
            f"Reproduce a sine of {amplitude} at {number(test.frequency)} Hz in {test.axis} on {load_of(machine)}, "
            f"with “{test.settings.name}”, alone and with amplitude-phase control and adaptive harmonic cancellation; "
            f"judged over the {cycles} cycles from {number(float(time[0]))} to {number(float(time[-1]))} s."
        ),
        verdict=verdict,
        level=level,
        headlines=_headlines(test),
        sections=[
            Section("errors", "Amplitude, phase and distortion", [sine_table(test)]),
            Section("harmonics", "Harmonics", harmonic_blocks(test)),
            Section("history", "The last cycles", [history_figure(test)]),
            Section("convergence", "Convergence", [convergence_figure(test)]),
            Section("spools", "Spool commands", spool_blocks(test)),
            Section("assumptions", "Assumptions and sources", numbers),
        ],
        command=command,
    )
    return save_page(page, path)


def _reached(test: SineTest) -> tuple[bool, bool, bool]:
    """True for amplitude, phase and distortion with cancellers that are within their criteria."""
    after, before = test.after, test.before
    halved = after.distortion <= DISTORTION_LEFT * before.distortion or not _has_harmonics(test)
    return abs(after.amplitude_error) <= AMPLITUDE, bool(abs(after.phase_error) <= PHASE), halved


def sine_verdict(test: SineTest, loop: Mapping[str, Any]) -> tuple[str, Level]:
    """Return the verdict, which begins with what its `loop` lacks, and its level."""
    after, before = test.after, test.before
    amplitude, phase, halved = _reached(test)
    unsteady, unstable = loop_sentence(loop)
    change, much = _change_of_distortion(test)
    words = [
        f"With the cancellers the amplitude error is {_share(after.amplitude_error)} and the phase error "
        f"{_angle(after.phase_error)}, {'within' if amplitude and phase else 'not within'} {100 * AMPLITUDE:g} % and "
        f"{np.degrees(PHASE):g}°.",
        change,
    ]
    if test.cancelled < test.wanted:
        words.append(
            f"Harmonics above {number(test.cancelled * test.frequency)} Hz have no canceller: there the response of "
            "the table changes too fast with frequency for one to be stable."
        )
    reached = amplitude and phase and halved and not unsteady
    level: Level = "bad" if unstable or much else "good" if reached else "attention"
    if unsteady:
        words.insert(0, unsteady)
    wanted = float(np.abs(test.target.acceleration[test.measured, AXES.index(test.axis)]).max())
    if (peak := _peak(test, after)) > SHAKEN * wanted:
        scale = axis_scale(test.axis, "acceleration")
        words.append(f"The acceleration reaches {shown_as(peak, scale)} for a target of {shown_as(wanted, scale)}.")
        level = "bad"
    _, rms = error_per_cycle(motion_error(test, after)[test.measured], test.frequency)
    if len(rms) > 1 and rms[-1] > max(GROWN * rms[0], AMPLITUDE * wanted / np.sqrt(2.0)):
        cause = "" if unstable else ": the cancellers are unstable here"
        words.append(f"The error with the cancellers grows from cycle to cycle{cause}.")
        level = "bad"
    counts = {"without": before.run.clipped, "with": after.run.clipped}
    if any(counts.values()):
        clipped = " and ".join(f"{count} {name} them" for name, count in counts.items() if count)
        words.append(f"The valves saturate: spool commands clipped at their limit, {clipped}.")
        level = "bad"
    return " ".join(words), level


def _change_of_distortion(test: SineTest) -> tuple[str, bool]:
    """The sentence on the distortion of the acceleration without and with cancellers; whether it rises by much."""
    before, after = test.before.distortion, test.after.distortion
    what, halved = f"The distortion of the acceleration {_band()}", _reached(test)[2]
    everywhere = (
        f"at all frequencies it is {percent(test.before.distortion_all)} and {percent(test.after.distortion_all)}"
    )
    if not _has_harmonics(test):
        return f"No harmonic lies in the band {_band()}, where distortion is judged; {everywhere}.", False
    if not np.isfinite([before, after]).all():
        return f"{what} is not judged: {percent(before)} without, {percent(after)} with them.", False
    if after < before:
        by = "half or more" if halved else "less than half"
        return f"{what} falls from {percent(before)} to {percent(after)}, by {by}; {everywhere}.", False
    by = f", by a factor of {number(after / before)}" if before > 0.0 else ""
    return (
        f"{what} rises from {percent(before)} to {percent(after)}{by}; {everywhere}.",
        after > DISTORTION_RISEN * before,
    )


def _headlines(test: SineTest) -> list[Headline]:
    tiles = (
        ("Amplitude error with cancellers", lambda found: _share(found.amplitude_error), ""),
        ("Phase error with cancellers", lambda found: _angle(found.phase_error), "; negative is late"),
        (
            f"Distortion (THD {_band()}) of the acceleration with cancellers",
            lambda found: percent(found.distortion),
            f"; at all frequencies {percent(test.after.distortion_all)}",
        ),
    )
    levels: list[Level] = ["good" if met else "attention" for met in _reached(test)]
    levels[2] = levels[2] if _has_harmonics(test) else "plain"
    return [
        Headline(shown(test.after), label, f"without {shown(test.before)}{note}", level)
        for (label, shown, note), level in zip(tiles, levels, strict=True)
    ]


def sine_table(test: SineTest) -> Table:
    """Return errors, distortion and spool commands without and with the cancellers."""
    fading = slice(test.measured.stop, None)
    quantities: dict[str, Callable[[SineResult], str]] = {
        "Amplitude error of the displacement": lambda r: _share(r.amplitude_error),
        "Phase error of the displacement": lambda r: _angle(r.phase_error),
        f"THD of the acceleration {_band()}": lambda r: percent(r.distortion),
        "Distortion of the acceleration, all frequencies": lambda r: percent(r.distortion_all),
        f"THD of the displacement {_band()}": lambda r: percent_of_fundamental(100.0 * r.distortion_displacement),
        "Peak acceleration, cycles measured": lambda r: shown_as(_peak(test, r), axis_scale(test.axis, "acceleration")),
        "Largest acceleration error, cycles measured": lambda r: _largest(test, r, test.measured),
        "Largest acceleration error, fading out": lambda r: _largest(test, r, fading),
        "Largest spool command": lambda r: percent(r.peak_spool),
        "Spool commands clipped": lambda r: str(r.run.clipped),
    }
    rows = [(name, shown(test.before), shown(test.after)) for name, shown in quantities.items()]
    caption = "Amplitude and phase of the fundamental, THD = √(Σ harmonics²) ∕ fundamental"
    return Table(caption, ("", "Controller alone", "With APC and AHC"), rows)


def _has_harmonics(test: SineTest) -> bool:
    """Whether a multiple of the frequency is within the band in which they are counted."""
    return len(test.after.acceleration.frequency) > 1


@cache
def _band() -> str:
    """The band in which harmonics are counted, in words."""
    return f"to {tuning_numbers().number('feedforward_targets.high'):g} Hz"


def _peak(test: SineTest, found: SineResult) -> float:
    """Largest acceleration achieved on the axis of the sine in the cycles measured [m/s2, rad/s2]."""
    achieved = motion_error(test, found) + test.target.acceleration[:, AXES.index(test.axis)]
    return float(np.abs(achieved[test.measured]).max())


def _largest(test: SineTest, found: SineResult, part: slice) -> str:
    size = np.abs(motion_error(test, found)[part])
    return shown_as(float(size.max()), axis_scale(test.axis, "acceleration")) if size.size else "–"


def _share(fraction: float) -> str:
    """A share to a thousandth of a per cent."""
    return f"{signed(100.0 * fraction, 3)}\N{NO-BREAK SPACE}%"


def _angle(angle: float) -> str:
    """An angle [rad] in degrees to a hundredth."""
    return f"{signed(float(np.degrees(angle)), 2)}°"

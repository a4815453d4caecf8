"""The report of a sine test: amplitude, phase and distortion without and with the cancellers."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.names import AXES
from ...tuning.sine import SineResult, SineTest
from .control_blocks import assumption_blocks, load_of
from .page import Headline, Level, Markup, Page, Section, number, save_page, table
from .run_motion import axis_scale, percent, shown_as
from .sine_plots import (
    achieved_motion,
    convergence_block,
    error_per_cycle,
    harmonic_blocks,
    history_block,
    percent_of_fundamental,
    spool_blocks,
)

__all__ = ["write_sine_report"]

# Judgement, not physics: what a sine test must reach.
AMPLITUDE = 0.01
PHASE = np.radians(2.0)
GROWN = 1.05  # RMS error of the last measured cycle over the first from which it counts as growing
DISTORTION_LEFT = 0.5  # share of the total harmonic distortion without cancellers


def write_sine_report(test: SineTest, path: Path | str, command: str = "") -> Path:
    """Write the self-contained HTML report of a sine test to `path` and return the path."""
    machine = test.before.run.plant.machine
    amplitude = shown_as(test.amplitude, axis_scale(test.axis, "displacement"))
    verdict, level = _judge(test)
    page = Page(
        kind="Sine report · simulated",
        title=f"Sine of {amplitude} at {number(test.frequency)} Hz in {test.axis}",
        asked=(
            f"Reproduce a sine of {amplitude} at {number(test.frequency)} Hz in {test.axis} on {load_of(machine)}, "
            f"with “{test.settings.name}”, alone and with amplitude-phase control and adaptive harmonic cancellation; "
            f"judged over {_measured(test)}."
        ),
        verdict=verdict,
        level=level,
        headlines=_headlines(test),
        sections=[
            Section("errors", "Amplitude, phase and distortion", [_numbers(test)]),
            Section("harmonics", "Harmonics", harmonic_blocks(test)),
            Section("history", "The last cycles", [history_block(test)]),
            Section("convergence", "Convergence", [convergence_block(test)]),
            Section("spools", "Spool commands", spool_blocks(test)),
            Section(
                "assumptions",
                "Assumptions and sources",
                assumption_blocks(machine, ("sine", "feedforward_targets.high")),
            ),
        ],
        command=command,
    )
    return save_page(page, path)


def _measured(test: SineTest) -> str:
    time = test.target.time[test.measured]
    cycles = round((time[-1] - time[0]) * test.frequency)
    return f"the {cycles} cycles from {number(float(time[0]))} to {number(float(time[-1]))} s"


def _judge(test: SineTest) -> tuple[str, Level]:
    after, before = test.after, test.before
    level: Level = "good"
    near = abs(after.amplitude_error) <= AMPLITUDE and abs(after.phase_error) <= PHASE
    halved = after.distortion <= DISTORTION_LEFT * before.distortion
    words = [
        f"With the cancellers the amplitude error is {_signed(after.amplitude_error)} and the phase error "
        f"{_angle(after.phase_error)}, {'within' if near else 'not within'} {100 * AMPLITUDE:g} % and "
        f"{np.degrees(PHASE):g}°.",
        f"The distortion of the acceleration falls from {percent(before.distortion)} to {percent(after.distortion)}"
        if after.distortion < before.distortion
        else f"The distortion of the acceleration does not fall: {percent(before.distortion)} without, "
        f"{percent(after.distortion)} with them",
    ]
    words[1] += ", by half or more." if halved else ", by less than half."
    if not (near and halved):
        level = "attention"
    if _growing(test):
        words.append("The error with the cancellers grows from cycle to cycle: the cancellers are unstable here.")
        level = "bad"
    clipped = {name: found.run.clipped for name, found in (("without", before), ("with", after)) if found.run.clipped}
    if clipped:
        said = " and ".join(f"{count} {name} them" for name, count in clipped.items())
        words.append(f"The valves saturate: spool commands clipped at their limit, {said}.")
        level = "bad"
    return " ".join(words), level


def _growing(test: SineTest) -> bool:
    """True if the acceleration error with cancellers grows over the measured cycles."""
    _, rms = error_per_cycle(_error(test, test.after)[test.measured], test.frequency)
    return bool(len(rms) > 1 and rms[-1] > GROWN * rms[0])


def _error(test: SineTest, found: SineResult) -> NDArray[np.float64]:
    """Achieved minus wanted acceleration (n,) over the whole test [m/s2, rad/s2]."""
    k = AXES.index(test.axis)
    return np.asarray((achieved_motion(found).acceleration - test.target.acceleration)[:, k])


def _headlines(test: SineTest) -> list[Headline]:
    after, before = test.after, test.before
    near = abs(after.amplitude_error) <= AMPLITUDE
    halved = after.distortion <= DISTORTION_LEFT * before.distortion
    return [
        Headline(
            _signed(after.amplitude_error),
            "Amplitude error with cancellers",
            f"without {_signed(before.amplitude_error)}",
            "good" if near else "attention",
        ),
        Headline(
            _angle(after.phase_error),
            "Phase error with cancellers",
            f"without {_angle(before.phase_error)}; negative is late",
            "good" if abs(after.phase_error) <= PHASE else "attention",
        ),
        Headline(
            percent(after.distortion),
            "Distortion (THD) of the acceleration with cancellers",
            f"without {percent(before.distortion)}",
            "good" if halved else "attention",
        ),
    ]


def _numbers(test: SineTest) -> Markup:
    fading = slice(test.measured.stop, None)
    rows = (
        ("Amplitude error of the displacement", *_both(test, lambda r: _signed(r.amplitude_error))),
        ("Phase error of the displacement", *_both(test, lambda r: _angle(r.phase_error))),
        ("THD of the acceleration", *_both(test, lambda r: percent(r.distortion))),
        ("THD of the displacement", *_both(test, lambda r: percent_of_fundamental(100.0 * r.distortion_displacement))),
        ("Largest acceleration error, cycles measured", *_both(test, lambda r: _largest(test, r, test.measured))),
        ("Largest acceleration error, fading out", *_both(test, lambda r: _largest(test, r, fading))),
        ("Largest spool command", *_both(test, lambda r: percent(r.peak_spool))),
        ("Spool commands clipped", *_both(test, lambda r: str(r.run.clipped))),
    )
    said = "Amplitude and phase of the fundamental, THD = √(Σ harmonics²) ∕ fundamental"
    return table(said, ("", "Controller alone", "With APC and AHC"), rows)


def _both(test: SineTest, said: Callable[[SineResult], str]) -> tuple[str, str]:
    return said(test.before), said(test.after)


def _largest(test: SineTest, found: SineResult, part: slice) -> str:
    size = np.abs(_error(test, found)[part])
    return shown_as(float(size.max()), axis_scale(test.axis, "acceleration")) if size.size else "–"


def _signed(fraction: float) -> str:
    """A share to a thousandth of a per cent, as the command prints it."""
    return f"{_rounded(100.0 * fraction, 3)}\N{NO-BREAK SPACE}%"


def _angle(angle: float) -> str:
    """An angle [rad] in degrees to a hundredth, as the command prints it."""
    return f"{_rounded(float(np.degrees(angle)), 2)}°"


def _rounded(value: float, digits: int) -> str:
    """A number with its sign, none on a rounded zero; an en dash where it is not finite."""
    if not np.isfinite(value):
        return "–"
    value = round(value, digits) + 0.0  # no negative zero
    return f"{value:{'+' if value else ''}.{digits}f}".replace("-", "−")

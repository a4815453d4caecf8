"""Results of tuning, iteration and sine tests as tables for a terminal."""

import math

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..core.names import AXES
from ..tuning.iterate import Iterated
from ..tuning.sine import SineTest
from ..tuning.tune import Tuning

__all__ = ["print_iterations", "print_sine", "print_tuning"]


def print_tuning(tuning: Tuning) -> None:
    """Print bands and margins before and after, and the tuned gains."""
    console = Console()
    title = f"Reference to feedback within {tuning.tolerance:g} dB and with a coherence of {tuning.coherence:g}"
    table = _table(title, "axis", "before [Hz]", "after [Hz]", "delay [ms]", "gain margin", "phase margin")
    for axis in tuning.axes:
        margin = axis.margin_after
        table.add_row(
            axis.axis,
            _band(axis.band_before),
            _band(axis.band_after),
            f"{1e3 * axis.delay_before:.1f} to {1e3 * axis.delay_after:.1f}",
            f"{20 * math.log10(margin.gain):.1f} dB at {margin.gain_frequency:.3g} Hz",
            f"{math.degrees(margin.phase):.0f} deg at {margin.phase_frequency:.3g} Hz",
        )
    console.print(table)
    gains = _table("Tuned gains", "axis", "Kx [1/s]", "KF [1]", "Kvf [1]", "Kaf [s]", "Kjf [s2]")
    ahead = (f"{name}_feedforward" for name in ("velocity", "acceleration", "jerk"))
    columns = [getattr(tuning.after, name) for name in ("displacement_gain", "force_damping", *ahead)]
    for axis in tuning.axes:
        gains.add_row(axis.axis, *(f"{column[AXES.index(axis.axis)]:.4g}" for column in columns))
    console.print(gains)
    for axis in tuning.axes:
        console.print(f"{axis.axis}: {axis.limited_by}", highlight=False, soft_wrap=True)
    stable = "stable" if tuning.doubled else "[bold red]unstable[/]"
    console.print(f"With all master gains doubled, without dry friction: {stable}")


def print_iterations(result: Iterated) -> None:
    """Print the errors of every iteration, and the stopping criterion."""
    console = Console()
    moved = [k for k in range(6) if not math.isnan(result.history[0].acceleration[k])]
    title = "RRMSE [%] of the acceleration, 0 to 33 Hz, delay removed"
    table = _table(title, "iteration", *(AXES[k] for k in moved), "displ., worst", "delay [ms]", "spool", "clipped")
    for found in result.history:
        name = f"{found.number}{' AIC' if found.number == 1 else ''}{' best' if found.number == result.best else ''}"
        table.add_row(
            name,
            *(f"{100 * found.acceleration[k]:.2f}" for k in moved),
            f"{100 * np.nanmax(found.displacement):.2f}",
            f"{1e3 * np.nanmin(found.delay):.1f}..{1e3 * np.nanmax(found.delay):.1f}",
            f"{found.peak_spool:.2f}",
            str(found.clipped),
        )
    console.print(table)
    console.print(f"stopped: {result.reason}", highlight=False)


def print_sine(test: SineTest) -> None:
    """Print amplitude, phase and distortion without and with cancellers."""
    console = Console()
    unit = "m" if test.axis in "xyz" else "rad"
    title = f"{test.amplitude:g} {unit} at {test.frequency:g} Hz in {test.axis}; distortion over all harmonics to 33 Hz"
    table = _table(
        title, "", "amplitude [%]", "phase [deg]", "THD accel. [%]", "THD displ. [%]", "largest spool", "clipped"
    )
    for name, found in (("alone", test.before), ("APC, AHC", test.after)):
        table.add_row(
            name,
            f"{100 * found.amplitude_error:+.3f}",
            f"{math.degrees(found.phase_error):+.2f}",
            f"{100 * found.distortion:.3f}",
            f"{100 * found.distortion_displacement:.4f}",
            f"{found.peak_spool:.2f}",
            str(found.run.clipped),
        )
    console.print(table)


def _table(title: str, *headings: str) -> Table:
    table = Table(title=escape(title), title_justify="left")
    for n, heading in enumerate(headings):
        table.add_column(escape(heading), justify="right" if n else "left")
    return table


def _band(band: tuple[float, float]) -> str:
    return "none" if math.isnan(band[0]) else f"{band[0]:.2g} to {band[1]:.3g}"

"""Tables that the commands of the virtual 469D print."""

import math
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from .iterate import Iterated
from .names import AXES
from .sine import SineTest
from .tuning import Tuning

__all__ = ["print_iterations", "print_sine", "print_tuning"]


def print_tuning(tuning: Tuning, folder: Path) -> None:
    """Bands and margins before and after, the gains found, and where the results are."""
    table = Table(title=f"Reference to feedback within {tuning.tolerance:g} dB and coherent", title_justify="left")
    for heading in ("axis", "before", "after", "delay", "gain margin", "phase margin", "Kx", "KF", "Kvf", "Kaf", "Kjf"):
        table.add_column(heading)
    for axis in tuning.axes:
        k = AXES.index(axis.axis)
        ahead = (f"{n}_feedforward" for n in ("velocity", "acceleration", "jerk"))
        margin = axis.margin_after
        table.add_row(
            axis.axis,
            _band(axis.band_before),
            _band(axis.band_after),
            f"{1e3 * axis.delay_before:.1f} -> {1e3 * axis.delay_after:.1f} ms",
            f"{20 * math.log10(margin.gain):.1f} dB at {margin.gain_frequency:.3g} Hz",
            f"{math.degrees(margin.phase):.0f} deg at {margin.phase_frequency:.3g} Hz",
            *(f"{getattr(tuning.after, name)[k]:.4g}" for name in ("displacement_gain", "force_damping", *ahead)),
        )
    console = Console()
    console.print(table)
    for axis in tuning.axes:
        console.print(f"{axis.axis}: {axis.limited_by}", highlight=False)
    stable = "stable" if tuning.doubled else "[bold red]unstable[/]"
    console.print(f"All master gains doubled at once, without dry friction: {stable}")
    console.print(f"wrote {folder / 'controller.toml'} and {folder / 'report.html'}", highlight=False)


def print_iterations(result: Iterated, folder: Path) -> None:
    """Errors of every iteration, why it stopped, and where the results are."""
    moved = [k for k in range(6) if not math.isnan(result.history[0].acceleration[k])]
    table = Table(title="Acceleration RRMSE, 0 to 33 Hz, delay removed", title_justify="left")
    table.add_column("iteration")
    for k in moved:
        table.add_column(AXES[k], justify="right")
    for heading in ("displacement, worst", "delay", "largest spool command"):
        table.add_column(heading, justify="right")
    for found in result.history:
        name = f"{found.number}{' (AIC)' if found.number == 1 else ''}{' best' if found.number == result.best else ''}"
        table.add_row(
            name,
            *(f"{100 * found.acceleration[k]:.2f} %" for k in moved),
            f"{100 * np.nanmax(found.displacement):.2f} %",
            f"{1e3 * np.nanmin(found.delay):.1f} to {1e3 * np.nanmax(found.delay):.1f} ms",
            f"{found.peak_spool:.2f}{f', {found.clipped} clipped' if found.clipped else ''}",
        )
    console = Console()
    console.print(table)
    console.print(f"stopped: {result.reason}", highlight=False)
    names = [str(folder / name) for name in ("drive.nc", "inverse.nc", "report.html")]
    console.print(f"wrote {', '.join(names)}", highlight=False)


def print_sine(test: SineTest, folder: Path) -> None:
    """Amplitude, phase and distortion before and after, and where the report is."""
    table = Table(title=f"{test.amplitude:g} at {test.frequency:g} Hz in {test.axis}", title_justify="left")
    for heading in ("", "amplitude", "phase", "THD acceleration", "THD displacement", "spool", "commands clipped"):
        table.add_column(heading, justify="right")
    for name, found in (("controller alone", test.before), ("with APC and AHC", test.after)):
        table.add_row(
            name,
            f"{100 * found.amplitude_error:+.3f} %",
            f"{math.degrees(found.phase_error):+.2f} deg",
            f"{100 * found.distortion:.3f} %",
            f"{100 * found.distortion_displacement:.4f} %",
            f"{found.peak_spool:.2f}",
            str(found.run.clipped),
        )
    console = Console()
    console.print(table)
    console.print(f"wrote {folder / 'report.html'}", highlight=False)


def _band(band: tuple[float, float]) -> str:
    return "none" if math.isnan(band[0]) else f"{band[0]:.2g} to {band[1]:.3g} Hz"

"""Figures of a tuning report: a Bode plot per axis, and the magnitudes of all axes."""

from typing import Any

import numpy as np

from ...core.arrays import Array, Complex, Mask
from ...data.transfer import Transfer
from ...tuning.identify import tuning_numbers
from ...tuning.tune import Tuning
from .charts import Curve, Panel, chart_figure, frequency_axis, with_peaks
from .control_blocks import AXIS_LINES
from .page import Figure
from .plots import AFTER, BEFORE, BLACK
from .scales import axis_title

__all__ = ["bode_figure", "overview_figure"]

BAND = (0.1, 40.0)  # [Hz] drawn
MODEL = {"color": BLACK, "width": 1.0, "dash": "dash"}
MODEL_POINTS = 500  # of the linear model's response that are drawn, at most
GAINS = (-12.0, 9.0)  # [dB] drawn, and peaks above
ROW = 130  # [CSS px]


def bode_figure(tuning: Tuning, a: int) -> Figure:
    """Return magnitude, phase without the common delay and as measured, and coherence of axis `a`."""
    axis = tuning.axes[a]
    curves, coherent = [], []
    for name, transfer, line in _measured(tuning, a):
        f, part = _drawn(transfer.frequency)
        curves.append(_response(name, line, f, transfer.response[part, 0, 0], tuning.delay))
        coherent.append(Curve(name, f, transfer.coherence[part, 0], line))
    f, part = _drawn(tuning.model.frequency)
    few = slice(None, None, -(-len(f) // MODEL_POINTS))
    curves.append(_response("linear model", MODEL, f[few], tuning.expected[part, a, a][few], tuning.delay))
    size, undelayed, measured = zip(*curves, strict=True)
    band = (-tuning.tolerance, tuning.tolerance)
    panels = [
        Panel("Magnitude [dB]", size, span=with_peaks(GAINS, size), band=band),
        Panel("Phase, common delay removed [deg]", undelayed, span=(-90.0, 90.0)),
        Panel("Phase as measured [deg]", measured),
        Panel("Coherence", coherent, span=(0.0, 1.05), lines={f"{tuning.coherence:g}": tuning.coherence}),
    ]
    words = f"Band to {axis.band_after[1]:.3g} Hz." if np.isfinite(axis.band_after[1]) else "No band."
    return _over_frequency(f"bode-{axis.axis}", axis_title(axis.axis), words, panels, row_height=ROW)


def overview_figure(tuning: Tuning) -> Figure:
    """Return the magnitudes of all axes before and after tuning."""
    panels = []
    for name in ("before", "after") if tuning.was_stable else ("after",):
        curves = []
        for axis in tuning.axes:
            transfer: Transfer = getattr(axis, name)
            f, part = _drawn(transfer.frequency)
            curves.append(Curve(axis.axis, f, _decibels(transfer.response[part, 0, 0]), AXIS_LINES[axis.axis]))
        band = (-tuning.tolerance, tuning.tolerance)
        panels.append(Panel(f"Magnitude {name} [dB]", curves, span=with_peaks(GAINS, curves), band=band))
    words = f"Reference to achieved acceleration of each axis; the shaded band is ±{tuning.tolerance:g} dB."
    title = "All axes before and after"
    if not tuning.was_stable:
        title = "All axes after tuning"
        words += " With the settings before, the loop is unstable: it has no response."
    return _over_frequency("overview", title, words, panels)


def _measured(tuning: Tuning, a: int) -> list[tuple[str, Transfer, dict[str, Any]]]:
    """Responses of axis `a` that were measured: those of unstable settings were not."""
    axis = tuning.axes[a]
    both = [("before", axis.before, BEFORE), ("after", axis.after, AFTER)]
    return both if tuning.was_stable else both[1:]


def _over_frequency(name: str, title: str, words: str, panels: list[Panel], **size: int) -> Figure:
    """Panels with the end of the operational band marked."""
    end = tuning_numbers().number("feedforward_targets.high")
    return chart_figure(name, title, words, panels, frequency_axis(*BAND), marks=[end], **size)


def _response(name: str, line: dict[str, Any], f: Array, response: Complex, delay: float) -> tuple[Curve, Curve, Curve]:
    """Magnitude, phase after removing a delay [s], and phase of a response (m,)."""
    turn = 360.0 * f * delay
    phase = np.degrees(np.angle(response * np.exp(1j * np.radians(turn))))
    phase[1:][np.abs(np.diff(phase)) > 180.0] = np.nan  # no line across a phase wrap
    return Curve(name, f, _decibels(response), line), Curve(name, f, phase, line), Curve(name, f, phase - turn, line)


def _drawn(frequency: Array) -> tuple[Array, Mask]:
    """Frequencies that are drawn, and where they are."""
    inside = (frequency >= BAND[0]) & (frequency <= BAND[1])
    return frequency[inside], inside


def _decibels(response: Complex) -> Array:
    return 20.0 * np.log10(np.maximum(np.abs(response), np.finfo(float).tiny))

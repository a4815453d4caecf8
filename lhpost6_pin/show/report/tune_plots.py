"""Figures of a tuning report: a Bode plot per axis, and the magnitudes of all axes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...data.transfer import Transfer
from ...tuning.identify import tuning_numbers
from ...tuning.tune import Tuning
from .charts import FREQUENCY_TICKS, Curve, Panel, XAxis, chart_figure
from .control_blocks import AXIS_LINES, axis_title
from .page import Markup, figure
from .plots import AFTER, BEFORE, BLACK

__all__ = ["bode_figure", "overview_figure"]

FREQUENCIES = XAxis("Frequency [Hz]", log=True, span=(0.1, 40.0), ticks=FREQUENCY_TICKS)
MODEL = {"color": BLACK, "width": 1.0, "dash": "dash"}
MODEL_POINTS = 500  # of the linear model's response that are drawn, at most
GAINS = (-12.0, 9.0)  # [dB] drawn
ROW = 130  # [CSS px]

Complex = NDArray[np.complex128]


def bode_figure(tuning: Tuning, a: int) -> Markup:
    """Return magnitude, phase without the common delay and as measured, and coherence of axis `a`."""
    axis = tuning.axes[a]
    shown, coherent = [], []
    for name, transfer, line in (("before", axis.before, BEFORE), ("after", axis.after, AFTER)):
        f, part = _drawn(transfer.frequency)
        shown.append(_response(name, line, f, transfer.response[part, 0, 0], tuning.delay))
        coherent.append(Curve(name, f, transfer.coherence[part, 0], line))
    f, part = _drawn(tuning.model.frequency)
    few = slice(None, None, -(-len(f) // MODEL_POINTS))
    shown.append(_response("linear model", MODEL, f[few], tuning.expected[part, a, a][few], tuning.delay))
    size, left, raw = zip(*shown, strict=True)
    band = (-tuning.tolerance, tuning.tolerance)
    panels = [
        Panel("Magnitude [dB]", size, span=GAINS, band=band),
        Panel("Phase, common delay removed [deg]", left, span=(-90.0, 90.0)),
        Panel("Phase as measured [deg]", raw),
        Panel("Coherence", coherent, span=(0.0, 1.05), lines={f"{tuning.coherence:g}": tuning.coherence}),
    ]
    words = f"Band to {axis.band_after[1]:.3g} Hz." if np.isfinite(axis.band_after[1]) else "No band."
    return figure(
        chart_figure(
            f"bode-{axis.axis}", axis_title(axis.axis), words, panels, FREQUENCIES, row_height=ROW, marks=[_band_end()]
        )
    )


def overview_figure(tuning: Tuning) -> Markup:
    """Return the magnitudes of all axes before and after tuning."""
    panels = []
    for name in ("before", "after"):
        curves = []
        for axis in tuning.axes:
            transfer: Transfer = getattr(axis, name)
            f, part = _drawn(transfer.frequency)
            curves.append(Curve(axis.axis, f, _decibels(transfer.response[part, 0, 0]), AXIS_LINES[axis.axis]))
        band = (-tuning.tolerance, tuning.tolerance)
        panels.append(Panel(f"Magnitude {name} [dB]", curves, span=GAINS, band=band))
    words = f"Reference to achieved acceleration of each axis; the shaded band is ±{tuning.tolerance:g} dB."
    return figure(
        chart_figure("overview", "All axes before and after", words, panels, FREQUENCIES, marks=[_band_end()])
    )


def _response(
    name: str, line: dict[str, Any], f: NDArray[np.float64], response: Complex, delay: float
) -> tuple[Curve, Curve, Curve]:
    """Magnitude, phase after removing a delay [s], and phase of a response (m,)."""
    turn = 360.0 * f * delay
    left = np.degrees(np.angle(response * np.exp(1j * np.radians(turn))))
    left[1:][np.abs(np.diff(left)) > 180.0] = np.nan  # no line across a phase wrap
    return Curve(name, f, _decibels(response), line), Curve(name, f, left, line), Curve(name, f, left - turn, line)


def _band_end() -> float:
    """End of the operational band [Hz]."""
    return tuning_numbers().number("feedforward_targets.high")


def _drawn(frequency: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Frequencies that are drawn, and where they are."""
    assert FREQUENCIES.span
    inside = (frequency >= FREQUENCIES.span[0]) & (frequency <= FREQUENCIES.span[1])
    return frequency[inside], inside


def _decibels(response: Complex) -> NDArray[np.float64]:
    return 20.0 * np.log10(np.maximum(np.abs(response), np.finfo(float).tiny))

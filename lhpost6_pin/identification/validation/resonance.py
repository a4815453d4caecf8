"""Oil-column resonances of a test: peaks of the response of the platen's acceleration to the spools.

The spools of all actuators, transformed to platen axes by kinematics, command a velocity; the response of acceleration
to it peaks at the oil column, whatever the test's own spectrum. The peak's width at half the power is 2 zeta f of an
oscillator, if neither the segment's resolution nor stiction limits it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...core.arrays import Array
from ...data.fusion import kinematic_jacobian
from ...mechanics.linearize import OilColumnMode
from ...mechanics.plant import Plant
from .metrics import Numbers

__all__ = ["Peak", "Resonance", "Response", "estimate_response", "find_peak", "find_resonances"]


@dataclass(frozen=True)
class Response:
    """Squared gain (f, k) from an axis's spools to its acceleration over `frequency` (f,) [Hz].

    The coherence (f, k) is zero where noise dominates spools or acceleration.
    """

    frequency: Array
    power: Array
    coherence: Array


class Peak(NamedTuple):
    """A peak: frequency [Hz], and half its relative width at half the power, as of a damping ratio [1]."""

    frequency: float
    sharpness: float


class Resonance(NamedTuple):
    """The oil column of one axis, nan where no peak stands out; `expected` [Hz] is that of the linear model."""

    column: str
    expected: float
    measured: Peak
    model: Peak


def estimate_response(
    plant: Plant, spool: Array, acceleration: Array, noise: tuple[Array, Array], dt: float, numbers: Numbers
) -> Response:
    """Response of accelerations (n, k) of the plant's axes to spools (n, n_actuators), one axis at a time.

    noise is a draw of the sensors' noise in either.
    """
    from scipy.signal import csd, welch

    to_axes = np.linalg.pinv(kinematic_jacobian(plant)[:, plant.axes]).T
    commanded = spool @ to_axes
    each = {"fs": 1 / dt, "nperseg": min(round(numbers.number("spectra.segment") / dt), len(commanded)), "axis": 0}
    f, given = welch(commanded, **each)
    response, given_noise, response_noise = (welch(x, **each)[1] for x in (acceleration, noise[0] @ to_axes, noise[1]))
    _, cross = csd(commanded, acceleration, **each)
    least = numbers.number("spectra.noise") ** 2
    clear = (given > least * given_noise) & (response > least * response_noise)
    power = np.divide(np.abs(cross) ** 2, given**2, out=np.zeros_like(given), where=clear)
    coherence = np.divide(np.abs(cross) ** 2, given * response, out=np.zeros_like(given), where=clear)
    return Response(f, power, coherence)


def find_resonances(
    columns: Sequence[str], measured: Response, model: Response, modes: Sequence[OilColumnMode], numbers: Numbers
) -> tuple[Resonance, ...]:
    """Oil-column peaks near the modes of the linear model, one for each axis that has a mode."""
    found = []
    for k, column in enumerate(columns):
        mode = next((m for m in modes if m.axis == column), None)
        if mode is not None:
            peaks = (
                find_peak(r.frequency, r.power[:, k], r.coherence[:, k], mode.frequency, numbers)
                for r in (measured, model)
            )
            found.append(Resonance(column, mode.frequency, *peaks))
    return tuple(found)


def find_peak(f: Array, power: Array, coherence: Array, expected: float, numbers: Numbers) -> Peak:
    """Largest peak of a response (n,) about an expected frequency [Hz]; nan if none stands out and is coherent.

    Its frequency is the vertex of the parabola through the logarithms of three values; its width is measured where the
    power has fallen to half, between samples by straight lines.
    """
    nothing = Peak(float("nan"), float("nan"))
    span = numbers.number("resonance.search")
    inside = np.flatnonzero((f >= (1 - span) * expected) & (f <= (1 + span) * expected))
    if len(inside) < 5:
        return nothing
    top = int(inside[np.argmax(power[inside])])
    stands_out = power[top] > numbers.number("resonance.prominence") * np.median(power[inside])
    if top in (inside[0], inside[-1]) or not stands_out or coherence[top] < numbers.number("resonance.coherence"):
        return nothing
    a, b, c = np.log(np.maximum(power[top - 1 : top + 2], np.finfo(float).tiny))
    shift = 0.5 * (a - c) / (a - 2 * b + c) if a - 2 * b + c < 0 else 0.0
    centre = f[top] + shift * (f[1] - f[0])
    half = 0.5 * power[top]
    below, above = np.flatnonzero(power[:top] < half), np.flatnonzero(power[top:] < half) + top
    if not (len(below) and len(above)):
        return Peak(float(centre), float("nan"))
    left = np.interp(half, power[below[-1] : below[-1] + 2], f[below[-1] : below[-1] + 2])
    right = np.interp(half, power[[above[0], above[0] - 1]], f[[above[0], above[0] - 1]])
    return Peak(float(centre), float((right - left) / (2 * centre)))

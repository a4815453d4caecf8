"""Spectra of a test: amplitude ratios in bands, oil-column resonances, transfer functions of the servovalves.

Signals are not low-passed at the band of the comparison, since half of the oil columns lie above it.

The spools of all actuators, transformed to platen axes by kinematics, command a velocity; the response of acceleration
to it peaks at the oil column, whatever the test's own spectrum. The peak's width at half the power is 2 zeta f of an
oscillator, if neither the segment's resolution nor stiction limits it.

The model has a pure delay between a spool and its command (report, Figure 6.21). The measured one is the slope of the
transfer function's phase; a command that is held over the controller's samples adds half of one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import xarray as xr

from ...core.arrays import Array, Complex
from ...data.alignment import combine_delays, phase_delay
from ...data.records import sample_interval
from ...machine.machine import Machine
from ...mechanics.linearize import OilColumnMode
from ...mechanics.plant import Plant
from ...mechanics.pose import kinematic_jacobian
from .prepare_tests import Numbers

__all__ = ["Peak", "Resonance", "Response", "Spectrum", "Valves", "estimate_response", "estimate_spectrum"]
__all__ += ["find_peak", "find_resonances", "find_valves"]


@dataclass(frozen=True)
class Spectrum:
    """Power spectral densities [unit2/Hz] of one quantity over `frequency` (f,) [Hz], k columns."""

    quantity: str
    columns: tuple[str, ...]
    frequency: Array
    measured: Array  # (f, k)
    model: Array  # (f, k)
    ratio: Array  # (bands, k) amplitude of the model over the measurement; nan where noise prevails


def estimate_spectrum(
    quantity: str, columns: Sequence[str], measured: Array, model: Array, noise: Array, dt: float, numbers: Numbers
) -> Spectrum:
    """Welch's estimate for both sides (n, k); noise (n, k) is a draw of the sensors' noise."""
    f, (power, modelled, noisy) = _powers(dt, numbers.number("spectra.segment"), measured, model, noise)
    ratio = np.full((len(numbers.bands) - 1, power.shape[1]), np.nan)
    for b, (low, high) in enumerate(pairwise(numbers.bands)):
        inside = (f >= low) & (f < high)
        if inside.any():
            means = [x[inside].mean(axis=0) for x in (power, modelled, noisy)]
            clear = means[0] > numbers.number("spectra.noise") ** 2 * means[2]
            ratio[b] = np.sqrt(np.divide(means[1], means[0], out=np.full(len(clear), np.nan), where=clear))
    return Spectrum(quantity, tuple(columns), f, power, modelled, ratio)


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
    to_axes = np.linalg.pinv(kinematic_jacobian(plant)[:, plant.axes]).T
    segment, least = numbers.number("spectra.segment"), numbers.number("spectra.noise") ** 2
    commanded = spool @ to_axes
    f, (given, response, *noises) = _powers(dt, segment, commanded, acceleration, noise[0] @ to_axes, noise[1])
    square = np.abs(_cross_power(dt, segment, commanded, acceleration)) ** 2
    clear = (given > least * noises[0]) & (response > least * noises[1])
    power, coherence = (
        np.divide(square, by, out=np.zeros_like(given), where=clear) for by in (given**2, given * response)
    )
    return Response(f, power, coherence)


def find_resonances(
    columns: Sequence[str], measured: Response, model: Response, modes: Sequence[OilColumnMode], numbers: Numbers
) -> tuple[Resonance, ...]:
    """Oil-column peaks near the modes of the linear model, one for each axis that has a mode."""
    expected = {m.axis: m.frequency for m in reversed(modes)}  # the first of each axis
    found = []
    for k, column in enumerate(columns):
        if column in expected:
            sides = [(r.frequency, r.power[:, k], r.coherence[:, k]) for r in (measured, model)]
            peaks = (find_peak(*side, expected[column], numbers) for side in sides)
            found.append(Resonance(column, expected[column], *peaks))
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


@dataclass(frozen=True)
class Valves:
    """Delays of spools (k,) behind their commands; transfer functions of the test with the most accurate delays."""

    columns: tuple[str, ...]
    delay: Array  # (k,) over all tests [s]
    standard_error: Array  # (k,) [s]
    model: Array  # (k,) of the machine [s]
    test: str
    frequency: Array  # (f,) [Hz]
    response: Complex  # (f, k) [1]; nan where spool and command are not coherent


def find_valves(machine: Machine, records: Sequence[xr.Dataset], numbers: Numbers) -> Valves | None:
    """Delays and transfer functions of all records that have spools and commands; None if none has."""
    names, sides = list(machine.actuator_names), ("spool_command", "spool_position")
    found = []
    for record in records:
        if set(sides) <= set(record.data_vars):
            command, spool = (np.asarray(record[n].sel(actuator=names).values, float) for n in sides)
            dt = sample_interval(record)
            found.append((record, command, spool, dt, *phase_delay(command, spool, dt)))
    if not found:
        return None
    delays, errors = (np.array([test[k] for test in found]) for k in (4, 5))  # (tests, k)
    each = np.array([combine_delays(d, e) for d, e in zip(delays.T, errors.T, strict=True)])
    each[~np.isfinite(each[:, 1])] = np.nan
    record, command, spool, dt = found[int(np.argmin(np.median(errors, axis=1)))][:4]
    segment = numbers.number("valves.segment")
    f, (commanded, done) = _powers(dt, segment, command, spool)
    cross, both = _cross_power(dt, segment, command, spool), commanded * done
    coherence = np.divide(np.abs(cross) ** 2, both, out=np.zeros_like(both), where=both > 0.0)
    coherent = coherence > numbers.number("valves.coherence")
    response = np.divide(cross, commanded, out=np.full_like(cross, np.nan), where=coherent)
    model = np.array([a.valve_delay for a in machine.actuators])
    return Valves(tuple(names), each[:, 0], each[:, 1], model, str(record.attrs.get("test", "test")), f, response)


def _powers(dt: float, segment: float, *signals: Array) -> tuple[Array, list[Array]]:
    """Frequencies (f,) and power spectral densities (f, k) of signals (n, k): Welch's averages of segments [s]."""
    from scipy.signal import welch

    length = min(round(segment / dt), len(signals[0]))
    found = [welch(x, 1 / dt, nperseg=length, axis=0) for x in signals]
    return found[0][0], [power for _, power in found]


def _cross_power(dt: float, segment: float, one: Array, other: Array) -> Complex:
    """Cross-spectral densities (f, k) of signals (n, k), likewise."""
    from scipy.signal import csd

    found: Complex = csd(one, other, 1 / dt, nperseg=min(round(segment / dt), len(one)), axis=0)[1]
    return found

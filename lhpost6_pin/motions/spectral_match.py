"""A motion adjusted until the response spectrum of its target is a given one.

The Fourier amplitudes of the motion are corrected by the ratio of wanted to found spectrum, phases stay (Gasparini and
Vanmarcke 1976). The spectrum found is that of the target, with band-pass and rest at both ends, so that the matched
motion is treated as any other. Peaks of an acceleration above the spectrum's level at its highest frequency, which
would rule it there, are rounded off. What lies outside the band is scaled as its nearest end.
"""

import logging
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ..core.errors import MotionError
from .motion import AXES, GroundMotion
from .process import Target, make_target, processing
from .response_spectra import response_spectrum
from .spectrum_file import EXAMPLE
from .target_spectrum import TargetSpectrum

__all__ = ["SpectrumMatch", "match_spectrum", "rounded_peaks", "spectrum_errors"]

_log = logging.getLogger(__name__)
_IN_BANDWIDTH = 3  # frequencies matched within the half-power bandwidth of an oscillator
_SAMPLES = 16  # of the targets in between, a period of the low-pass corner
_SHARPNESS = 12  # of the rounding of peaks: even, and high enough to leave the rest alone


class SpectrumMatch(NamedTuple):
    """A matched motion, the band [Hz] of the match, and the largest relative error in it by axis, also in words."""

    motion: GroundMotion
    band: tuple[float, float]
    errors: dict[str, float]
    summary: str


def match_spectrum(
    motion: GroundMotion,
    spectrum: TargetSpectrum,
    *,
    high_pass: float | None = None,
    low_pass: float | None = None,
) -> SpectrumMatch:
    """Motion with the `spectrum` when its target is made with these corners [Hz] (`make_target`) at scale 1.

    The band is that of the spectrum, from twice the high-pass corner up to the low-pass corner and half the motion's
    sampling rate. Axes for which the spectrum has no column stay as they are. A warning is logged where the match is
    worse than the tolerance. Raises MotionError if no axis or band remains.
    """
    from scipy.fft import next_fast_len

    numbers = processing()
    axes = _axes(motion, spectrum)
    target_of = partial(make_target, axes=",".join(axes), high_pass=high_pass, low_pass=low_pass, warn=False)
    first = target_of(motion)
    band = _band(motion, spectrum, first)
    frequency = _frequencies(band, spectrum.damping)
    count = next_fast_len(2 * len(motion.samples), real=True)  # zeros keep the end from wrapping round to the begin
    inside = np.log(np.clip(np.fft.rfftfreq(count, motion.time_step), *band))
    samples = motion.samples.copy()
    best, smallest = samples.copy(), dict.fromkeys(axes, np.inf)
    rate = _SAMPLES * first.reference.low_pass
    for round_ in range(int(numbers["match_iterations"]) + 1):
        target = target_of(replace(motion, samples=samples), rate=rate)
        for axis in axes:
            column = AXES.index(axis)
            correction = 1 / _ratio(target, spectrum, axis, frequency)
            error = float(np.abs(1 / correction - 1).max())
            if error < smallest[axis]:
                smallest[axis], best[:, column] = error, samples[:, column]
            if round_ == 0:  # its level, before its form
                samples[:, column] *= np.exp(np.log(correction).mean())
                continue
            gain = np.exp(np.interp(inside, np.log(frequency), np.log(correction)))
            corrected = np.fft.irfft(gain * np.fft.rfft(samples[:, column], count), count)[: len(samples)]
            if motion.quantity == "acceleration":
                corrected = rounded_peaks(corrected, float(spectrum.at(axis, frequency[-1:])[0]))
            samples[:, column] = corrected
        if max(smallest.values()) <= numbers["match_goal"]:
            break
    matched = replace(motion, samples=best)
    errors = spectrum_errors(target_of(matched), spectrum, band)
    text = (
        f"matched to {spectrum.source} ({100 * spectrum.damping:g} % damping) from {band[0]:.3g} to {band[1]:.3g} Hz, "
        f"largest error {', '.join(f'{axis} {100 * error:.1f} %' for axis, error in errors.items())}"
    )
    if max(errors.values()) > numbers["match_tolerance"]:
        _log.warning(
            "%s: its spectrum deviates by more than %g %%, by %.1f %%; choose a motion of broader band, or a higher "
            "--high-pass",
            *(motion.name, 100 * numbers["match_tolerance"], 100 * max(errors.values())),
        )
    matched = replace(matched, source=f"{motion.source}; {text}", spectrum=spectrum)
    return SpectrumMatch(matched, band, errors, text)


def rounded_peaks(samples: np.ndarray, level: float) -> np.ndarray:
    """Samples (n,) with what is above a level rounded off to it."""
    return np.asarray(samples / (1 + (samples / level) ** _SHARPNESS) ** (1 / _SHARPNESS))


def spectrum_errors(target: Target, spectrum: TargetSpectrum, band: tuple[float, float]) -> dict[str, float]:
    """Largest relative deviation of a target's response spectrum from another one in a band [Hz], by axis.

    Of the axes that the target moves and the spectrum has, at scale 1; also between the frequencies that were matched.
    """
    moved = [axis for axis, _ in target.reference.axes if axis in spectrum.acceleration]
    frequency = _frequencies(band, spectrum.damping / 2)
    return {axis: float(np.abs(_ratio(target, spectrum, axis, frequency) - 1).max()) for axis in moved}


def _axes(motion: GroundMotion, spectrum: TargetSpectrum) -> tuple[str, ...]:
    """Axes of a motion that have a spectrum."""
    found = tuple(axis for axis in motion.axes if axis in spectrum.acceleration)
    if not found:
        raise MotionError(
            f"{spectrum.source}: has a spectrum for {', '.join(spectrum.acceleration)}, {motion.name} moves "
            f"{', '.join(motion.axes) or 'in no axis'}; {EXAMPLE}"
        )
    return found


def _band(motion: GroundMotion, spectrum: TargetSpectrum, target: Target) -> tuple[float, float]:
    """Frequencies [Hz] between which the spectrum can be met."""
    reference, (least, *_, most) = target.reference, spectrum.frequency
    low = max(least, processing()["match_lowest"] * reference.high_pass)
    high = min(most, reference.low_pass, 0.5 / motion.time_step)
    if not low < high:
        raise MotionError(
            f"{spectrum.source}: its {least:.3g} to {most:.3g} Hz are not within what {motion.name} can match with "
            f"corners at {reference.high_pass:.3g} and {reference.low_pass:.3g} Hz and steps of {motion.time_step:g} s"
        )
    return float(low), float(high)


def _frequencies(band: tuple[float, float], damping: float) -> np.ndarray:
    """Frequencies (k,) [Hz] over a band, evenly in their logarithm, some in each half-power bandwidth."""
    width = np.log1p(2 * max(damping, 0.01)) / _IN_BANDWIDTH
    return np.geomspace(*band, int(np.ceil(np.log(band[1] / band[0]) / width)) + 1)


def _ratio(target: Target, spectrum: TargetSpectrum, axis: str, frequency: np.ndarray) -> np.ndarray:
    """Response spectrum of a target over the wanted one (k,)."""
    acceleration = target.acceleration[:, AXES.index(axis)]
    found = response_spectrum(acceleration, target.time_step, 1 / frequency, spectrum.damping).pseudo_acceleration
    return np.asarray(found / spectrum.at(axis, frequency))

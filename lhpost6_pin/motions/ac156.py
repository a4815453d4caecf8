"""Motions compatible with the required response spectrum of ICC-ES AC156, the shake-table test of components.

The spectrum, for 5 % damping, is straight in log-log between four knees (0.1, 1.3, 8.3, 33.3 Hz): it rises to
A_FLX, holds, and falls to A_RIG. Horizontal: A_FLX = S_DS (1 + 2 z/h) <= 1.6 S_DS and A_RIG = 0.4 S_DS
(1 + 2 z/h) <= 1.2 S_DS; vertical: 0.67 S_DS and 0.27 S_DS whatever z/h. All numbers are in
`models/ground_motions/tests.toml`.
"""

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import MotionError
from .motion import GroundMotion, make_motion
from .process import smooth_step
from .response_spectra import response_spectrum
from .spectral_match import rounded_peaks
from .target_spectrum import TargetSpectrum

__all__ = ["ac156", "required_spectrum"]

_log = logging.getLogger(__name__)
_ITERATIONS = 12
_DRAWS = 5
_MARGIN = 0.75  # part of the tolerance the match may use; the rest is for the processing that follows
_PER_OCTAVE = 12  # matching frequencies: twice as dense as AC156's check at sixths of an octave


def required_spectrum(
    frequency: np.ndarray, flexible: float, rigid: float, knees: Sequence[float], lowest_ratio: float
) -> np.ndarray:
    """Return the required spectral acceleration (m,) [unit of `flexible`] at `frequency` (m,) [Hz].

    Constant beyond the outer knees.
    """
    levels = np.log([lowest_ratio * flexible, flexible, flexible, rigid])
    return np.exp(np.interp(np.log(frequency), np.log(knees), levels))


class Ac156(NamedTuple):
    """Numbers of a motion: its spectrum, its record and its band."""

    sds: float  # design spectral acceleration S_DS [m/s2]
    height_ratio: float  # z/h [1]
    knees: Sequence[float]  # (4,) [Hz]
    lowest_ratio: float  # at the first knee, over the flexible level
    flexible_cap: float  # A_FLX over S_DS, at most
    rigid_ratio: float  # A_RIG over S_DS (1 + 2 z/h)
    rigid_cap: float  # A_RIG over S_DS, at most
    vertical_flexible: float  # the same ratios of the vertical, whatever z/h
    vertical_rigid: float
    tolerance_below: float  # of the spectrum, relative
    tolerance_above: float
    damping: float  # share of critical
    rise: float  # of the envelope [s]
    hold: float
    decay: float
    high_pass: Sequence[float] | float  # corner [Hz], one or one for each axis
    highest: float  # corner of the low-pass [Hz]
    time_step: float  # [s]
    seed: int


def ac156(*, name: str, **numbers: Any) -> GroundMotion:
    """Tri-axial acceleration [m/s^2] whose response spectra match AC156 from the second to the last knee.

    numbers are those of `Ac156`; `sds` and `height_ratio` set the level. The high-pass keeps
    the displacement within a table's stroke; the spectrum is then not met far below the second knee. The axes are
    independent: each has its own noise, drawn with `seed`.

    Raises MotionError for impossible levels.
    """
    n = Ac156(**numbers)
    corners = np.broadcast_to(np.asarray(n.high_pass, dtype=float), (3,))
    if not (n.sds > 0 and 0 <= n.height_ratio <= 1 and (corners > 0).all() and (corners < n.knees[1]).all()):
        raise MotionError(
            f"{name}: S_DS {n.sds:g} m/s^2, z/h {n.height_ratio:g}, high-pass {n.high_pass} Hz; need S_DS > 0, "
            f"0 <= z/h <= 1 and corners between 0 and {n.knees[1]} Hz"
        )
    factor = 1 + 2 * n.height_ratio
    horizontal = n.sds * min(factor, n.flexible_cap), n.sds * min(n.rigid_ratio * factor, n.rigid_cap)
    levels = (horizontal, horizontal, (n.vertical_flexible * n.sds, n.vertical_rigid * n.sds))
    duration = n.rise + n.hold + n.decay
    time = np.arange(round(duration / n.time_step) + 1) * n.time_step
    envelope = smooth_step(time / n.rise)[0] * smooth_step((duration - time) / n.decay)[0]
    octaves = np.log2(n.knees[-1] / n.knees[1])
    matched = n.knees[1] * 2 ** np.linspace(0, octaves, int(np.ceil(octaves * _PER_OCTAVE)) + 1)
    middle = np.sqrt((1 - n.tolerance_below) * (1 + n.tolerance_above))
    tolerance = np.log((1 + n.tolerance_above) / middle)
    generators = np.random.default_rng(n.seed).spawn(3)
    channels = {}
    for axis, (flexible, rigid), corner, generator in zip("xyz", levels, corners, generators, strict=True):
        wanted = middle * required_spectrum(matched, flexible, rigid, n.knees, n.lowest_ratio)
        channels[axis], deviation = _matched_noise(
            time, envelope, matched, wanted, n.damping, (corner, n.highest), _MARGIN * tolerance, generator
        )
        if deviation > tolerance:
            _log.warning(
                "%s, axis %s: spectrum is up to %.2f times off the middle of AC156's tolerance; try another seed",
                name,
                axis,
                np.exp(deviation),
            )
    source = f"ICC-ES AC156 spectrum, S_DS {n.sds:.4g} m/s^2, z/h {n.height_ratio:g}, seed {n.seed}"
    motion = make_motion(name, n.time_step, channels, "acceleration", source)
    required = {
        axis: required_spectrum(np.array(n.knees), *level, n.knees, n.lowest_ratio)
        for axis, level in zip(channels, levels, strict=True)
    }
    return replace(motion, spectrum=TargetSpectrum(np.array(n.knees), required, n.damping, "ICC-ES AC156"))


def _matched_noise(
    time: np.ndarray,
    envelope: np.ndarray,
    matched: np.ndarray,
    wanted: np.ndarray,
    damping: float,
    band: tuple[float, float],
    close: float,
    generator: np.random.Generator,
) -> tuple[np.ndarray, float]:
    """Noise under the envelope (n,) whose response spectrum is `wanted` at the frequencies `matched`.

    Amplitudes of the Fourier components, of fixed random phase, are corrected by the ratio of wanted to
    found spectrum (Gasparini and Vanmarcke 1976) until the largest deviation, as the logarithm of that
    ratio, is at most `close`. Peaks above the rigid level, which would rule the spectrum's rigid end, are
    rounded off before the band-pass. Where the deviation stays larger, new phases are drawn. Returns the best
    motion and its deviation.
    """
    from scipy.fft import next_fast_len

    step = time[1] - time[0]
    count = next_fast_len(2 * len(time), real=True)  # zeros behind the motion keep the filter from wrapping round
    frequency = np.fft.rfftfreq(count, step)
    ratio = (frequency / band[0]) ** 8
    gain = ratio / (1 + ratio) / (1 + (frequency / band[1]) ** 16)
    inside = np.log(np.clip(frequency, matched[0], matched[-1]))
    best, smallest = np.zeros(len(time)), np.inf
    for _draw in range(_DRAWS):
        phases = np.exp(2j * np.pi * generator.random(len(frequency)))
        amplitude = np.interp(inside, np.log(matched), wanted / np.sqrt(matched)) * phases
        for _ in range(_ITERATIONS):
            noise = rounded_peaks(envelope * np.fft.irfft(amplitude, count)[: len(time)], wanted[-1])
            motion = np.fft.irfft(gain * np.fft.rfft(noise, count), count)[: len(time)]
            found = response_spectrum(motion, step, 1 / matched, damping).pseudo_acceleration
            correction = wanted / found
            deviation = float(np.abs(np.log(correction)).max())
            if deviation < smallest:
                best, smallest = motion, deviation
            if smallest <= close:
                return best, smallest
            amplitude *= np.interp(inside, np.log(matched), correction)
    return best, smallest

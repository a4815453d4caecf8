"""From a ground motion to a target of the table: displacement, velocity and acceleration.

One Fourier series carries all three: with the motion's spectrum A(f), a zero-phase band-pass
H(f) = 1 / (1 + (f_high/f)^2n) / (1 + (f/f_low)^2m) and D = -H A / (2 pi f)^2, the series for D, 2 pi i f D
and -(2 pi f)^2 D are evaluated on the controller's time grid, so the three are derivatives of each other to
rounding and the resampling is exact for a band-limited motion. A window w(t) of a polynomial with two
continuous derivatives then brings the displacement to rest at both ends; velocity and acceleration follow by
the product rule, (w d)' and (w d)'', so they stay consistent.
"""

import logging
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from numbers import Real
from typing import Any

import numpy as np

from ..core.errors import MotionError
from ..core.files import models_folder
from ..core.threads import by_threads
from .joins import join_warning, sharp_joins
from .lost_peaks import lost_peaks
from .motion import AXES, GroundMotion
from .target_spectrum import TargetSpectrum
from .toml import load_toml, values_of

__all__ = ["Reference", "Target", "axes_map", "make_target", "processing", "smooth_step", "with_scale"]

_log = logging.getLogger(__name__)

_MOST = 2**22
"""Samples that a target may have: half an hour at 2048 Hz, of which a run needs some 14 GB."""


@dataclass(frozen=True)
class Reference:
    """Processing by which a target was made from a motion."""

    motion: str
    source: str
    scale: float
    axes: tuple[tuple[str, str], ...]  # (axis of the table, channel of the motion)
    high_pass: float  # corner [Hz]; 0 is none
    low_pass: float  # corner [Hz]
    start: float  # time of the target's first sample on the motion's clock [s]
    time_scale: float = 1.0  # of the motion (`adjust.with_time_scale`)

    @property
    def title(self) -> str:
        """Motion and scales in words."""
        compressed = f", time scale {self.time_scale:g}" if self.time_scale != 1.0 else ""
        return f"{self.motion} at scale {self.scale:g}{compressed}"

    @property
    def facts(self) -> dict[str, Any]:
        """Attributes of a record of this motion."""
        return {"scale": self.scale, "time_scale": self.time_scale, "motion": self.motion, "source": self.source}


@dataclass(frozen=True, eq=False)
class Target:
    """A motion for the table at the controller's rate, at rest in the zero position at both ends."""

    time: np.ndarray  # (n,) [s]
    displacement: np.ndarray  # (n, 6) [m, rad]
    velocity: np.ndarray  # (n, 6) [m/s, rad/s]
    acceleration: np.ndarray  # (n, 6) [m/s^2, rad/s^2]
    reference: Reference
    spectrum: TargetSpectrum | None = None  # that it is to have, by axis of the table

    @property
    def time_step(self) -> float:
        """Sampling interval [s]."""
        return float(self.time[1] - self.time[0])


@cache
def processing() -> dict[str, float]:
    """Numbers of the processing of all motions, in SI."""
    table = load_toml(models_folder() / "ground_motions" / "tests.toml")
    return values_of(table, "processing")


def axes_map(text: str) -> tuple[tuple[str, str], ...]:
    """Pairs (axis of the table, channel of the motion) from a text.

    Letters (``"xyz"``, ``"x"``) or names separated by commas (``"x,roll"``) keep these axes; ``"x=y"`` moves
    the table's x by the motion's y, as in ``"x=y,y=x,z"``. Raises MotionError for anything else.
    """
    items = [item.strip() for item in text.split(",")]
    if len(items) == 1 and items[0] not in AXES and "=" not in items[0]:
        items = list(items[0])
    pairs = []
    for item in items:
        axis, equals, channel = (part.strip() for part in item.partition("="))
        pairs.append((axis, channel if equals else axis))
    for name in (name for pair in pairs for name in pair):
        if name not in AXES:
            raise MotionError(
                f"axes {text!r}: no axis {name!r}; write such as xyz, x, x=y or x,roll of {', '.join(AXES)}"
            )
    for axis, channel in pairs:
        if (axis in AXES[:3]) != (channel in AXES[:3]):
            kinds = ("a translation", "a rotation") if axis in AXES[:3] else ("a rotation", "a translation")
            raise MotionError(
                f"axes {text!r}: {axis} is {kinds[0]} and {channel} {kinds[1]}, metres are no radians; choose a "
                "component of the same kind"
            )
    if not pairs or len({axis for axis, _ in pairs}) < len(pairs):
        raise MotionError(f"axes {text!r}: name each axis of the table once")
    return tuple(pairs)


@np.errstate(over="ignore", invalid="ignore")  # what becomes infinite is refused with its scale
def make_target(
    motion: GroundMotion,
    *,
    scale: float = 1.0,
    axes: str | None = None,
    window: tuple[float, float] | None = None,
    high_pass: float | None = None,
    low_pass: float | None = None,
    pad: float | None = None,
    rate: float = 2048.0,
    warn: bool = True,
) -> Target:
    """Target for the table from a ground motion.

    `scale` multiplies it, `axes` selects and permutes (see `axes_map`; all axes by default), `window`
    (begin, end) [s] cuts a part of it. Corners [Hz] of the zero-phase band-pass default to the values in
    `models/ground_motions/tests.toml`, the high-pass over the motion's time scale; a displacement motion is not
    high-passed by default. The record is extended by `pad` [s] at both ends, over which the target comes from and goes
    to rest; that of the file is times a time scale above 1, as displacements at the ends are times its square. `rate`
    is the controller's [1/s].

    A displacement motion that does not begin and end at rest has a pulse of acceleration there; unless `warn` is False,
    a warning is logged of one that exceeds the motion's own (`joins`), and of peaks that the low-pass takes
    (`lost_peaks`).

    Raises MotionError for a window, corner or scale that makes no sense, or numbers too large to compute with.
    """
    settings = processing()
    integrated = motion.quantity == "acceleration"
    if high_pass is None:
        high_pass = settings["high_pass"] / motion.time_scale if integrated else 0.0
    low_pass = settings["low_pass"] if low_pass is None else low_pass
    pad = settings["pad"] * max(motion.time_scale, 1.0) if pad is None else pad
    pairs = axes_map(",".join(AXES) if axes is None else axes)
    if not (isinstance(scale, Real) and np.isfinite(scale)):
        raise MotionError(f"{motion.name}: scale is {scale!r}; give a finite number")
    if not (0 <= high_pass < low_pass < rate / 2 and pad > 0):
        raise MotionError(
            f"{motion.name}: high-pass {high_pass:g} Hz, low-pass {low_pass:g} Hz and {pad:g} s of padding; "
            f"need 0 <= high-pass < low-pass < {rate / 2:g} Hz and some padding"
        )
    if integrated and high_pass <= 0:
        raise MotionError(f"{motion.name}: an acceleration needs a positive high-pass corner to integrate")
    first, last = _cut(motion, window)
    channels = np.zeros((last - first, len(AXES)))
    for axis, channel in pairs:
        channels[:, AXES.index(axis)] = scale * motion.samples[first:last, AXES.index(channel)]
    _refuse_infinite(motion.name, scale, channels)
    given = motion.axes
    if given and not any(channel in given for _, channel in pairs):
        raise MotionError(
            f"{motion.name}: moves {', '.join(given)} only, of which axes {axes!r} leave nothing; "
            f"'{pairs[0][0]}={given[0]}' moves {pairs[0][0]} of the table by {given[0]} of the motion"
        )
    step = Fraction(motion.time_step * rate).limit_denominator(10_000)  # in samples of the target
    memory = max(settings["memory"] / high_pass if high_pass else 0.0, 2 * pad)
    span = (last - first) * motion.time_step + 2 * memory
    if max(span / motion.time_step, span * rate) > _MOST:
        raise MotionError(
            f"{motion.name}: {span:g} s with a time step of {motion.time_step:g} s are more than {_MOST} samples; "
            "correct the time step or the size that sets its length (a number without a unit is in SI), or cut a window"
        )
    # both the record's first sample and the period fall on samples of the target
    ends = _multiple(round(memory / motion.time_step) + 1, step.denominator)
    total = _multiple(len(channels) + 2 * ends, step.denominator)
    if integrated:
        extended = _extend_acceleration(channels, ends, total, round(settings["taper"] / motion.time_step))
    else:
        extended = _extend_displacement(channels, ends, total)
    frequency = np.fft.rfftfreq(total, motion.time_step)[:, None]
    series = np.fft.rfft(extended, axis=0)
    if warn:
        kept = np.fft.irfft(series * _gain(frequency, 0.0, low_pass, settings), total, axis=0)
        allowed, unit = (settings["lost_acceleration"], "m/s^2") if integrated else (settings["lost_displacement"], "m")
        if lost := lost_peaks(motion.name, extended, kept, low_pass, allowed, unit):
            _log.warning("%s", lost)
    series = series * _gain(frequency, high_pass, low_pass, settings)
    if total % 2 == 0:
        series[-1] = 0  # the highest frequency has no derivative in a real series
    if integrated:
        series = -series / (2 * np.pi * np.where(frequency == 0, np.inf, frequency)) ** 2
    lead = round(pad * rate)
    begin, count = int(ends * step) - lead, round((len(channels) - 1) * float(step)) + 2 * lead + 1
    size, angular = int(total * step), 2 * np.pi * frequency
    moved = np.isin(AXES, [axis for axis, _ in pairs])
    series = series[:, moved]  # the other axes stay at rest
    factors = 1.0, 1j * angular, -(angular**2)
    d, v, a = by_threads(lambda factor: _evaluate(series * factor, total, size)[begin : begin + count], factors)
    w, w1, w2 = _rest_window(count, lead, rate)
    displacement, velocity, acceleration = motion_of_axes = np.zeros((3, count, len(AXES)))
    motion_of_axes[:, :, moved] = w * d, w1 * d + w * v, w2 * d + 2 * w1 * v + w * a
    _refuse_infinite(motion.name, scale, displacement, velocity, acceleration)
    if warn and not integrated:
        reach = int(np.ceil(settings["join_reach"] * rate / low_pass))
        excess = settings["join_excess"]
        joins = sharp_joins(channels, motion.time_step, acceleration, rate, lead=lead, reach=reach, excess=excess)
        if joins:
            _log.warning("%s", join_warning(motion.name, joins))
    start = first * motion.time_step - lead / rate
    reference = Reference(motion.name, motion.source, scale, pairs, high_pass, low_pass, start, motion.time_scale)
    spectrum = motion.spectrum and motion.spectrum.on_axes(pairs).with_scale(scale)
    return Target(np.arange(count) / rate, displacement, velocity, acceleration, reference, spectrum)


def with_scale(target: Target, scale: float) -> Target:
    """Copy of a target at another `scale` of its motion (the processing is linear)."""
    factor = scale / target.reference.scale
    rows = {key: factor * getattr(target, key) for key in ("displacement", "velocity", "acceleration")}
    spectrum = target.spectrum and target.spectrum.with_scale(factor)
    return replace(target, reference=replace(target.reference, scale=scale), spectrum=spectrum, **rows)


def smooth_step(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rise from 0 to 1 over x in [0, 1] with two continuous derivatives, and these derivatives by x."""
    x = np.clip(x, 0.0, 1.0)
    rest = 1.0 - x
    return x**3 * (10 - 15 * x + 6 * x**2), 30 * x**2 * rest**2, 60 * x * rest * (1 - 2 * x)


def _refuse_infinite(name: str, scale: float, *arrays: np.ndarray) -> None:
    if not all(np.isfinite(array).all() for array in arrays):
        raise MotionError(f"{name}: at scale {scale:g} its samples are too large to compute with; give a smaller scale")


def _multiple(count: int, of: int) -> int:
    """Smallest multiple of `of` that is at least `count`."""
    return -(-count // of) * of


def _cut(motion: GroundMotion, window: tuple[float, float] | None) -> tuple[int, int]:
    """First sample of the window and one past its last."""
    if window is None:
        return 0, len(motion.samples)
    begin, end = window
    if not 0 <= begin < end <= motion.duration + motion.time_step / 2:
        raise MotionError(
            f"{motion.name}: window {begin:g} to {end:g} s does not lie in the record, 0 to {motion.duration:g} s"
        )
    first, last = round(begin / motion.time_step), round(end / motion.time_step) + 1
    last = min(last, len(motion.samples))
    if last - first < 2:
        raise MotionError(f"{motion.name}: window {begin:g} to {end:g} s holds fewer than 2 samples; widen it")
    return first, last


def _extend_acceleration(channels: np.ndarray, ends: int, total: int, taper: int) -> np.ndarray:
    """Straight line removed, ends tapered, zeros on both sides (total, 6)."""
    place = np.linspace(-1.0, 1.0, len(channels))
    design = np.stack([np.ones_like(place), place], axis=1)
    straight = design @ np.linalg.lstsq(design, channels, rcond=None)[0]
    taper = min(taper, len(channels) // 4)
    ramp = smooth_step(np.arange(len(channels)) / max(taper, 1))[0]
    extended = np.zeros((total, channels.shape[1]))
    extended[ends : ends + len(channels)] = (channels - straight) * (ramp * ramp[::-1])[:, None]
    return extended


def _extend_displacement(channels: np.ndarray, ends: int, total: int) -> np.ndarray:
    """End values held, then led smoothly from the last to the first, so that the series is periodic."""
    extended = np.empty((total, channels.shape[1]))
    extended[:ends] = channels[0]
    extended[ends : ends + len(channels)] = channels
    after = total - ends - len(channels)
    back = smooth_step((np.arange(after) - after / 2) / (after / 2))[0][:, None]
    extended[ends + len(channels) :] = (1 - back) * channels[-1] + back * channels[0]
    return extended


def _gain(frequency: np.ndarray, high_pass: float, low_pass: float, settings: dict[str, float]) -> np.ndarray:
    """Gain of the zero-phase band-pass."""
    gain = 1 / (1 + (frequency / low_pass) ** (2 * settings["low_pass_order"]))
    if high_pass:
        ratio = (frequency / high_pass) ** (2 * settings["high_pass_order"])
        gain = gain * ratio / (1 + ratio)
    return gain


def _evaluate(series: np.ndarray, total: int, size: int) -> np.ndarray:
    """Fourier series of `total` samples, evaluated at `size` samples over the same time (size, n_axes)."""
    return np.fft.irfft(series[: size // 2 + 1].T, size).T * (size / total)


def _rest_window(count: int, pad: int, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Window (count, 1) that is zero at both ends, with its time derivatives [1/s, 1/s^2]."""
    pad = min(pad, (count - 1) // 2)
    x = np.arange(count) / pad
    rise, rise1, rise2 = smooth_step(x)
    per_second = rate / pad
    w = rise * rise[::-1]
    w1 = (rise1 - rise1[::-1]) * per_second
    w2 = (rise2 + rise2[::-1]) * per_second**2
    return w[:, None], w1[:, None], w2[:, None]

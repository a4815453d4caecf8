"""Motions adjusted as a whole: turned about the vertical, scaled in time, tapered, matched to a response spectrum."""

from dataclasses import replace

import numpy as np

from ..core.errors import MotionError
from .motion import GroundMotion
from .process import processing, smooth_step
from .spectral_match import SpectrumMatch, match_spectrum
from .target_spectrum import TargetSpectrum

__all__ = ["adjust_motion", "with_rotation", "with_taper", "with_time_scale"]


def adjust_motion(
    motion: GroundMotion,
    *,
    rotate_by: float | None = None,
    time_scale: float | None = None,
    taper: float | None = None,
    spectrum: TargetSpectrum | None = None,
    high_pass: float | None = None,
    low_pass: float | None = None,
) -> tuple[GroundMotion, SpectrumMatch | None]:
    """Motion turned by an angle [deg], scaled in time, tapered [s], then matched to a spectrum; None leaves a step out.

    With it the match, if there is one.

    The corners [Hz] are those with which the target is made. Raises MotionError for what a step cannot do.
    """
    if rotate_by is not None:
        motion = with_rotation(motion, rotate_by)
    if time_scale is not None:
        motion = with_time_scale(motion, time_scale)
    if taper is not None:
        motion = with_taper(motion, taper)
    if spectrum is None:
        return motion, None
    match = match_spectrum(motion, spectrum, high_pass=high_pass, low_pass=low_pass)
    return match.motion, match


def with_rotation(motion: GroundMotion, angle: float) -> GroundMotion:
    """Motion whose horizontal components are turned by `angle` [deg] about the vertical, from x towards y.

    It has no spectrum to which it was made.

    Raises MotionError for an angle that is not finite, or a motion without horizontal components or with roll or pitch.
    """
    if not np.isfinite(angle):
        raise MotionError(f"{motion.name}: --rotate-by {angle}: give an angle in degrees")
    if motion.samples[:, 3:5].any() or not motion.samples[:, :2].any():
        why = "has roll or pitch" if motion.samples[:, 3:5].any() else "has no horizontal component"
        raise MotionError(f"{motion.name}: {why}, so that it is not turned; leave --rotate-by out")
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    samples = motion.samples.copy()
    samples[:, :2] = samples[:, :2] @ np.array([[cosine, sine], [-sine, cosine]])
    source = f"{motion.source}; turned by {angle:g} deg from x towards y"
    return replace(motion, samples=samples, source=source, spectrum=None)


def with_time_scale(motion: GroundMotion, factor: float) -> GroundMotion:
    """Motion of a model: durations times `factor`, as similitude has it where lengths are times its square.

    Translational accelerations stay, displacements follow with the square; angles stay, angular accelerations are over
    the square. Raises MotionError for a factor that is not positive.
    """
    if not 0 < factor < np.inf:
        raise MotionError(
            f"{motion.name}: time scale is {factor}; give a positive number, such as 0.5 for half the duration"
        )
    powers = (0, -2) if motion.quantity == "acceleration" else (2, 0)
    return replace(
        motion,
        time_step=factor * motion.time_step,
        samples=motion.samples * factor ** np.repeat(np.array(powers, dtype=float), 3),
        source=f"{motion.source}; time scale {factor:g}",
        time_scale=factor * motion.time_scale,
        spectrum=motion.spectrum and motion.spectrum.with_time_scale(factor),
    )


def with_taper(motion: GroundMotion, seconds: float) -> GroundMotion:
    """Displacement motion led from zero and to zero over `seconds` at its ends, with two continuous derivatives.

    Raises MotionError for an acceleration, which is tapered as it is (`make_target`), or a taper that is not positive
    or longer than half of the motion.
    """
    if motion.quantity == "acceleration":
        raise MotionError(
            f"{motion.name}: --taper is for displacements, and this is an acceleration, which is tapered over "
            f"{processing()['taper']:g} s at both ends as it is; leave --taper out"
        )
    if not 0 < seconds <= motion.duration / 2:
        raise MotionError(
            f"{motion.name}: --taper {seconds:g}: give seconds at each end, above zero and at most half of the motion, "
            f"{motion.duration / 2:g} s"
        )
    rise = smooth_step(np.arange(len(motion.samples)) * motion.time_step / seconds)[0]
    samples = motion.samples * (rise * rise[::-1])[:, None]
    return replace(motion, samples=samples, source=f"{motion.source}; tapered over {seconds:g} s at both ends")

"""Displacement motions that do not begin and end at rest: the warning, and the taper that leads them in and out."""

import logging

import numpy as np
import pytest
from commands import refused

from lhpost6_pin.core.errors import MotionError
from lhpost6_pin.motions import adjust_motion, find_motion, list_motions, make_motion, make_target, with_taper
from lhpost6_pin.motions.process import processing

STEP = 1.0 / 2048.0
TIME = np.arange(8 * 2048 + 1) * STEP


def displacement(values, axis="x"):
    return make_motion("own", STEP, {axis: values}, "displacement", "test")


def sine(frequency=1.0, amplitude=0.05, phase=0.0):
    return displacement(amplitude * np.sin(2.0 * np.pi * frequency * TIME + phase))


def warnings_of(caplog, motion, **options):
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        target = make_target(motion, **options)
    return target, caplog.text


def test_a_sine_that_starts_with_its_full_velocity_is_announced_with_the_pulse_at_the_join(caplog):
    """Closed form: a jump of velocity v behind 1 / (1 + (f / f0)^8) accelerates by 2 v f0 (pi / 8) / sin(pi / 8)."""
    target, said = warnings_of(caplog, sine())
    speed = 0.05 * 2.0 * np.pi
    pulse = 2.0 * speed * processing()["low_pass"] * (np.pi / 8.0) / np.sin(np.pi / 8.0)
    peak = float(np.abs(target.acceleration[:, 0]).max())
    assert peak == pytest.approx(pulse, rel=0.005)  # but for 2 m/s^2 of the sine itself, zero at the join
    assert "own: x starts at 0.314 m/s and 0 m, not at rest (also x at its end)" in said
    assert f"at t = 4.000 s, the target reaches {peak:.3g} m/s^2, in the motion itself " in said
    own = float(said.split("in the motion itself ")[1].split()[0])
    assert own == pytest.approx(0.05 * (2.0 * np.pi) ** 2, rel=0.05)  # what rings beyond 3 periods of the low-pass
    assert said.count("WARNING") == 1 and "--taper SECONDS" in said


def test_the_end_and_a_rotation_are_named_as_such(caplog):
    ending = np.where(TIME > 1.25, 0.05 * np.sin(2.0 * np.pi * np.maximum(TIME - 1.25, 0.0)) ** 3, 0.0)[: -2048 // 10]
    _, said = warnings_of(caplog, displacement(ending, "roll"))
    assert "roll ends at " in said and "rad/s and " in said and "rest after it" in said and "also" not in said


@pytest.mark.parametrize(
    "values",
    [
        0.05 * np.cos(2.0 * np.pi * TIME),  # at its peak, where a sine has no velocity
        0.05 * np.sin(2.0 * np.pi * TIME) ** 2,
        np.full_like(TIME, 0.01),
        np.random.default_rng(1).standard_normal(TIME.size).cumsum() * 1e-4,  # its own accelerations are larger
        np.r_[np.zeros(2048), 0.02 * np.sin(np.pi * TIME[:-4096]), np.zeros(2048)],  # its jumps are its own
    ],
    ids=["peak", "rest", "constant", "noise", "within"],
)
def test_a_motion_that_is_at_rest_at_its_ends_or_as_sharp_itself_is_not_announced(caplog, values):
    assert not warnings_of(caplog, displacement(values))[1]


def test_no_motion_by_name_is_announced_and_no_acceleration(caplog):
    for entry in list_motions():
        if entry.kind in ("sine", "triangle", "six_axial"):
            assert not warnings_of(caplog, find_motion(entry.name))[1], entry.name
    shaken = make_motion("a", 0.01, {"x": np.cos(np.arange(800) / 5.0)}, "acceleration", "test")
    assert not warnings_of(caplog, shaken)[1]
    assert not warnings_of(caplog, sine(), warn=False)[1]


def test_a_taper_leads_the_motion_in_and_out_and_leaves_what_is_between(caplog):
    """Product rule: (w d)'' = w'' d + 2 w' v + w a, with w of the taper's closed form."""
    motion, _ = adjust_motion(sine(), taper=2.0)
    between = slice(2 * 2048, -2 * 2048)
    np.testing.assert_array_equal(motion.samples[between], sine().samples[between])
    assert motion.source.endswith("; tapered over 2 s at both ends")
    target, said = warnings_of(caplog, motion)
    assert not said
    lead = 4 * 2048
    x, w = np.clip(TIME / 2.0, 0.0, 1.0), 2.0 * np.pi
    rise, rise1, rise2 = (
        x**3 * (10 - 15 * x + 6 * x**2),
        30 * (x - x**2) ** 2 / 2.0,
        60 * x * (1 - x) * (1 - 2 * x) / 4.0,
    )
    d, v, a = 0.05 * np.sin(w * TIME), 0.05 * w * np.cos(w * TIME), -0.05 * w**2 * np.sin(w * TIME)
    expected = (rise2 * d + 2.0 * rise1 * v + rise * a)[: 3 * 2048]
    found = target.acceleration[lead : lead + 3 * 2048, 0]
    np.testing.assert_allclose(
        found, expected, atol=0.01
    )  # of 2 m/s^2; third derivatives jump, which the low-pass rounds


def test_a_taper_that_cannot_be_is_refused(lhpost6, tmp_path):
    with pytest.raises(MotionError, match="--taper 0: give seconds at each end"):
        with_taper(sine(), 0.0)
    with pytest.raises(MotionError, match="at most half of the motion, 4 s"):
        with_taper(sine(), 4.1)
    ended = lhpost6("run", "ridgecrest", "--taper", 2, "--out", tmp_path / "r")
    assert refused(ended, "--taper is for displacements", "tapered over 1 s at both ends as it is")

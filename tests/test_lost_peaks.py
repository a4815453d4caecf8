"""Peaks that the low-pass of a target takes from a motion: the warning, its numbers, and what is not warned of."""

import logging
import re

import numpy as np
import pytest

from lhpost6_pin.motions import find_motion, make_motion, make_target
from lhpost6_pin.motions.process import processing

STEP = 1.0 / 2048.0
TIME = np.arange(8 * 2048 + 1) * STEP
BURST = np.sin(np.pi * TIME / 8.0) ** 2  # comes from and goes to rest


def said_of(caplog, motion, **options):
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        make_target(motion, **options)
    return caplog.text


@pytest.mark.parametrize("quantity, unit, amplitude", [("displacement", "m", 5e-4), ("acceleration", "m/s^2", 5.0)])
def test_a_sine_above_the_corner_is_announced_with_the_peak_that_the_low_pass_leaves(caplog, quantity, unit, amplitude):
    """Closed form: the gain of 1 / (1 + (f / f0)^8) at 40 Hz."""
    motion = make_motion("own", STEP, {"x": amplitude * BURST * np.sin(80.0 * np.pi * TIME)}, quantity, "test")
    corner = processing()["low_pass"]
    left = amplitude / (1.0 + (40.0 / corner) ** 8)
    said = said_of(caplog, motion)
    stated = float(re.search(r"leaves ([-.e\d]+) ", said)[1])
    assert stated == pytest.approx(left, rel=0.01)  # three digits, peaks between samples, and the burst's own width
    assert f"{unit} of its peak of {amplitude:.3g} {unit} in x" in said
    assert "--low-pass" in said
    assert said_of(caplog, motion, low_pass=200.0) == "" == said_of(caplog, motion, warn=False)


def test_rotations_are_in_radians_and_other_axes_are_named(caplog):
    wave = 1e-4 * BURST * np.sin(80.0 * np.pi * TIME)
    slow = 1e-2 * BURST * np.sin(2.0 * np.pi * TIME)
    motion = make_motion("own", STEP, {"x": slow, "roll": wave, "yaw": 0.5 * wave}, "displacement", "test")
    said = said_of(caplog, motion)
    assert " rad of its peak of 0.0001 rad in " in said and "less of " in said and " in x" not in said


@pytest.mark.parametrize("name", ["ridgecrest-ccc", "ridgecrest-clc", "ac156", "sfu-like", "white-noise", "triangle"])
def test_motions_of_the_library_keep_their_peaks(caplog, name):
    assert "low-pass" not in said_of(caplog, find_motion(name))

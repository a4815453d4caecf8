"""Recorded spools less their noise: a local Wiener filter, and the drift of an open loop that noise had caused."""

import numpy as np
from machine_cases import PRACTICE

from lhpost6_pin.data.quiet_spools import quiet_spools
from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.data.signals import local_wiener
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.simulation.rehearse import replay


def test_a_signal_without_noise_stays_as_it_is():
    x = np.random.default_rng(0).normal(size=(500, 3))
    np.testing.assert_allclose(local_wiener(x, 0.0, 51), x, rtol=0, atol=1e-13)


def test_noise_at_rest_is_averaged_and_motion_far_above_it_kept():
    rng, t = np.random.default_rng(1), np.arange(4096) / 512.0
    moving = np.where(t > 4.0, np.sin(2 * np.pi * 3.0 * t), 0.0)
    noisy = 0.02 + moving + rng.normal(0.0, 1e-3, t.size)
    left = local_wiener(noisy, 1e-3, 256) - 0.02 - moving
    assert left[128:1900].std() < 2e-4  # a mean of 256 leaves 6e-5; s2 of 256 samples strays by 9 %, and a tenth passes
    assert left[2304:-128].std() < 1.1e-3  # the noise itself, none of the sine


def test_spools_without_a_stated_noise_are_left_alone():
    record, sensors = load_record(PRACTICE), load_sensors("lhpost6")
    bare = quiet_spools(record.drop_vars("spool_position"), sensors)
    assert "spool_position" not in bare
    clean = record.assign_attrs(kind="simulated")
    assert quiet_spools(clean, sensors) is clean
    assert quiet_spools(record, sensors.__class__(**{**vars(sensors), "noise": {}})) is record


def test_noise_of_spools_no_longer_lifts_the_platen():
    """Vertical valves open more one way than the other for the same noise about null: 13 um in a test along x.

    The platen's z in open loop, against the measured one at rest after the test. 3 um: the mean of 200 samples whose
    noise is 10 um below 100 Hz is known to 1 um.
    """
    record, machine = load_record(PRACTICE), load_machine()
    measured = record["platen_displacement"].sel(axis="z").values[-200:].mean()
    off = []
    for spools in (record, quiet_spools(record, load_sensors("lhpost6"))):
        ran = replay(machine, spools, attrs={}, engine="fused").record
        off.append(float(ran["platen_displacement"].sel(axis="z").values[-800:].mean() - measured))
    assert off[0] > 8e-6
    assert abs(off[1]) < 3e-6

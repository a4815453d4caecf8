"""Alignment: known skews are found from sensors that measure the same thing twice, and taken out."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from sensor_cases import RATE, measured, waves

from lhpost6_pin.data.alignment import Delay, align_record, combine_delays, group_delays, phase_delay, slow_delay
from lhpost6_pin.data.campaign_check import check_campaign
from lhpost6_pin.data.channels import sensor_groups
from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.sensors import add_noise, load_sensors
from lhpost6_pin.data.signals import align, differentiate
from lhpost6_pin.machine.machine import load_machine

DT = 1 / RATE
T = np.arange(round(20 * RATE)) * DT
SKEWS = {"platen_velocity": 3e-4, "platen_acceleration": -3e-4, "actuator_displacement": 1.5e-4}
SKEWS |= {"chamber_pressure": -2e-4, "strut_pressure": 3e-4}


def skewed(plant, seed: int):
    """Noisy record with the skews above."""
    record, _ = measured(plant, seed)
    for group, tau in SKEWS.items():
        for name in set(sensor_groups()[group]) & set(record.data_vars):
            record = record.assign({name: record[name].copy(data=align(record[name].values, -tau, DT))})
    return add_noise(record, load_sensors(), np.random.default_rng(seed))


@pytest.mark.parametrize("tau", [3e-4, -2.3e-3, 0.031])
def test_a_delay_is_the_slope_of_the_phase_whatever_gain_and_offset(tau: float):
    x, late = (waves(t, np.ones(3), 0)[1] for t in (T, T - tau))
    found, _ = phase_delay(x, 0.7 * late + 3.0, DT)
    # a window of 2 s spreads each line over 1 Hz, all at the line's phase: short by (0.3 Hz / f)^2, 2 % at 2 Hz
    np.testing.assert_allclose(found, tau, rtol=0.02)


def test_a_slow_signal_s_delay_is_found_by_regression():
    x, late = (waves(t, np.ones(3), 0, highest=1.0)[0] for t in (T, T - 2e-4))
    found, error = slow_delay(x, 0.7 * late + 3.0, DT)
    np.testing.assert_allclose(found, 2e-4, rtol=0.02)  # second-order term, and ends that do not rest
    noise = np.random.default_rng(0).standard_normal(x.shape)
    found, error = slow_delay(x, late + 1e-3 * noise, DT)
    assert (np.abs(found - 2e-4) < 5 * error).all()
    assert np.isinf(slow_delay(x, 0 * x, DT)[1]).all()


def test_the_standard_error_is_that_of_repeated_noise():
    x = waves(T, np.ones(1), 0)[1]
    rng = np.random.default_rng(0)
    spread = 0.3 * x.std()
    pairs = [phase_delay(x, x + spread * rng.standard_normal(x.shape), DT) for _ in range(40)]
    tau, error = (np.array([p[k][0] for p in pairs]) for k in (0, 1))
    # forty draws know a standard deviation to 11 %; the coherence is estimated from 20 segments besides
    assert tau.std() == pytest.approx(np.median(error), rel=0.5)
    assert abs(tau.mean()) < 5 * tau.std() / np.sqrt(40)


@pytest.mark.parametrize("seconds", [1.5, 3, 11, 25])
def test_noise_determines_no_delay(seconds: float):
    """Of 500 pairs of unlike noise none or one is coherent, where one in 20,000 sets of frequencies is by chance."""
    pairs = np.random.default_rng(1).standard_normal((2, round(512 * seconds), 500))
    delay, error = phase_delay(*pairs, 1 / 512)
    assert np.isinf(error).sum() >= 499 and np.all(delay[np.isinf(error)] == 0.0)


def test_a_delay_of_a_signal_under_its_noise_is_as_uncertain_as_stated():
    """Slow motion in white noise: of 300 pairs, less than 2 % lie beyond four stated errors."""
    rng = np.random.default_rng(2)
    true = 0.05 * np.cumsum(rng.standard_normal((5632, 300)), axis=0)  # 11 s
    for noise in (0.25, 2.5):  # 5 and 50 times its change in a sample
        measured = np.roll(true, 2, axis=0) + noise * rng.standard_normal(true.shape)
        delay, error = phase_delay(true, measured, 1 / 512)
        known = np.isfinite(error)
        assert known.any() and np.mean(np.abs(delay - 2 / 512)[known] > 4 * error[known]) < 0.02


def test_a_silent_channel_has_no_delay_and_an_infinite_error():
    found, error = phase_delay(waves(T, np.ones(1), 0)[0], np.zeros((len(T), 1)), DT)
    assert np.isinf(error[0])
    assert np.isfinite(found[0])
    assert combine_delays(found, error) == (0.0, float("inf"))


def test_delays_are_averaged_by_their_errors_and_widened_by_their_scatter():
    assert combine_delays([1.0, 4.0], [1.0, 2.0]) == pytest.approx((1.6, np.sqrt(1 / 1.25 * 1.8)))
    assert combine_delays([1.0, 1.0, 99.0], [1.0, 1.0, 11.0]) == pytest.approx((1.0, np.sqrt(0.5)))


@pytest.mark.long
def test_skews_of_a_noisy_campaign_are_found_within_a_tenth_of_a_millisecond(plant):
    delays = group_delays(plant, [skewed(plant, seed) for seed in (0, 1)])
    assert set(delays) == set(SKEWS)
    for group, tau in SKEWS.items():
        assert delays[group].standard_error < 1e-4, group
        assert delays[group].delay == pytest.approx(tau, abs=1e-4), group  # the accuracy wanted
        if group != "strut_pressure":  # which moves least against its noise
            assert delays[group].delay == pytest.approx(tau, abs=2e-5), group


def test_aligned_records_have_no_skew_left_and_say_what_was_done(plant):
    record = skewed(plant, 2)
    delays = group_delays(plant, [record])
    aligned = align_record(record, delays)
    for group, left in group_delays(plant, [aligned]).items():
        assert abs(left.delay) < 2 * delays[group].standard_error + 5e-6, group  # end effects: some samples of 10^4
    moved = f"actuator_displacement advanced by {1e3 * delays['actuator_displacement'].delay:.4g} ms"
    assert moved in aligned.attrs["aligned"] and "behind platen_displacement" in aligned.attrs["aligned"]
    np.testing.assert_array_equal(aligned["platen_displacement"], record["platen_displacement"])


def test_groups_without_a_twin_are_left_out_and_a_delay_can_be_given_by_hand(plant):
    record, motion = measured(plant, duration=4.0)
    assert not group_delays(plant, [record[["platen_displacement", "spool_position", "actuator_force"]]])  # no twins
    aligned = align_record(record, {"platen_velocity": 1e-3, "platen_acceleration": Delay("by hand", 0.0, 0.0, 0)})
    shifted = motion.velocity + 1e-3 * motion.acceleration
    inside = slice(50, -50)
    scale = np.abs(differentiate(motion.acceleration, DT)[inside]).max(axis=0)  # of Taylor's next term
    assert (np.abs(aligned["platen_velocity"].values - shifted)[inside] < 1e-6 * scale).all()


@pytest.mark.parametrize("factor", [20.0, 1e3, 2e5])
def test_a_displacement_in_a_wrong_unit_leaves_struts_without_length_and_is_no_crash(factor):
    record = load_record(Path(__file__).parent / "data" / "records" / "practice_a_TX.nc")
    record["platen_displacement"] = record["platen_displacement"] * factor
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = check_campaign(load_machine("lhpost6"), [record])
    assert found is not None

"""Tuning without hand work: bands, margins, other machines, and what it says of a loop that is not stable.

The noise is shorter than `tuning.toml` has it, so that a tuning takes seconds: fewer averages, the same law.
"""

from dataclasses import replace

import numpy as np
import pytest
from machine_cases import PENDULUM
from run_cases import with_tuning_numbers

from lhpost6_pin.control import controlled, load_controller
from lhpost6_pin.core.errors import SimulationError
from lhpost6_pin.data.transfer import Transfer
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.specimen_modes import specimen_modes
from lhpost6_pin.tuning import identify
from lhpost6_pin.tuning import tune as tuning
from lhpost6_pin.tuning.bandwidth import bandwidth_limitation
from lhpost6_pin.tuning.feedback_search import with_gains
from lhpost6_pin.tuning.feedforward_fit import FeedforwardFit
from lhpost6_pin.tuning.identify import noise_target, tuning_numbers
from lhpost6_pin.tuning.margins import margins
from lhpost6_pin.tuning.tune import stays_stable, tune

pytestmark = pytest.mark.long

SHORT = {"noise.duration": 32.0, "noise.slow_duration": 80.0, "feedforward_targets.rounds": 2.0}


@pytest.fixture(scope="module", autouse=True)
def short_noise():
    """Numbers of `tuning.toml` with shorter noise and a round less, in every module that reads them."""
    yield from with_tuning_numbers(SHORT, identify, tuning)


@pytest.fixture(scope="module")
def told():
    """Shares of the work done, as `uniaxial` told them."""
    return []


@pytest.fixture(scope="module")
def uniaxial(told):
    return tune(load_machine("uniaxial"), load_controller("uniaxial"), progress=told.append)


def test_a_guided_table_is_tuned_to_follow_over_the_whole_band(uniaxial, told):
    (axis,) = uniaxial.axes
    low, high = axis.band_after
    assert low <= 0.1 and high >= 33.0 and axis.limited_by == "follows to 33 Hz and beyond"
    assert axis.band_before[1] < 20.0  # it was not so before
    f, T = axis.after.frequency, axis.after.response[:, 0, 0]
    inside = (f >= 0.5) & (f <= 33.0)
    near = np.abs(T[inside] * np.exp(2j * np.pi * f[inside] * uniaxial.delay) - 1.0)
    assert np.sqrt(np.mean(near**2)) < 0.1  # |T| and phase near one, but for the delay
    assert abs(axis.delay_after - uniaxial.delay) < 2e-3 < axis.delay_before
    assert told == sorted(told) and 0.0 < told[0] and told[-1] == pytest.approx(1.0)


def test_tuning_keeps_the_margins_it_was_asked_for(uniaxial):
    (axis,) = uniaxial.axes
    numbers = tuning_numbers()
    assert axis.margin_after.gain >= numbers.number("feedback_targets.gain_margin") > 2.0
    assert uniaxial.doubled and stays_stable(uniaxial.machine, uniaxial.after)


def test_tuning_changes_what_it_tunes_and_nothing_else(uniaxial):
    tuned = {"displacement_gain", "reset_gain", "force_damping"}
    tuned |= {f"{x}_feedforward" for x in ("velocity", "acceleration", "jerk")}
    before, after = (
        {k: v for k, v in vars(s).items() if k not in ("stated", "notches")} for s in (uniaxial.before, uniaxial.after)
    )
    assert {k for k in before if before[k] != after[k]} == tuned
    for name in tuned:  # the machine has no other axis
        assert getattr(uniaxial.after, name)[1:] == getattr(uniaxial.before, name)[1:]
    assert uniaxial.after.notches == uniaxial.before.notches
    kx, ki = uniaxial.after.displacement_gain[0], uniaxial.after.reset_gain[0]
    assert ki == pytest.approx(tuning_numbers().number("feedback_targets.reset_ratio") * kx**2)


def test_every_step_of_the_tuning_leads_to_the_settings_found(uniaxial):
    names = {"Kx": "displacement_gain", "KF": "force_damping", "Kvf": "velocity_feedforward"}
    names |= {"Kaf": "acceleration_feedforward", "Kjf": "jerk_feedforward"}
    last = {s.stage: s for s in uniaxial.steps}
    assert set(last) == {*names, "delay"}
    for stage, name in names.items():
        assert last[stage].after == getattr(uniaxial.after, name)[0]
    assert last["delay"].after == uniaxial.delay


@pytest.mark.slow  # a whole tuning; that of unstable settings starts elsewhere, too, and ends at the same gain
def test_tuning_again_from_its_own_result_finds_the_same(uniaxial):
    """It does not depend on where it starts from."""
    again = tune(uniaxial.machine, uniaxial.after)
    assert again.after == uniaxial.after and again.delay == uniaxial.delay


def test_settings_that_are_unstable_on_a_machine_are_tuned_all_the_same(uniaxial):
    """Ten times the gain it can take: there is no response to show, but a tuning."""
    wild = replace(uniaxial.before, displacement_gain=(800.0,) * 6)
    assert not stays_stable(uniaxial.machine, wild)
    found = tune(uniaxial.machine, wild)
    assert found.after.displacement_gain[0] == uniaxial.after.displacement_gain[0]
    (axis,) = found.axes
    assert np.isnan(axis.before.response).all() and np.isnan([*axis.band_before, axis.delay_before]).all()
    assert np.isnan(axis.margin_before.gain) and axis.margin_after.gain > 2.0


def test_a_panel_with_velocity_and_acceleration_feedback_is_fitted_exactly():
    """The plant comes back from a response made by hand with all feedback gains, whatever they are."""
    frequency = np.linspace(0.5, 33.0, 200)
    s = 2j * np.pi * frequency
    plant = np.exp(-0.005 * s) / (s + 3.0)
    given = {"displacement_gain": 2.0, "velocity_gain": 0.3, "acceleration_gain": 0.01, "displacement_feedforward": 0.4}
    given |= {"velocity_feedforward": 1.0, "acceleration_feedforward": 0.002, "jerk_feedforward": 1e-5}
    settings = replace(load_controller("lhpost6"), **{name: (value,) * 6 for name, value in given.items()})
    gains = [2.0 + 0.4, 0.3 + 1.0, 0.01 + 0.002, 1e-5]  # on s^0 to s^3
    response = plant * sum(g * s**n for n, g in enumerate(gains))
    seen = Transfer(frequency, response[:, None, None], np.ones((200, 1)))
    fit = FeedforwardFit(seen, settings, 0, ((0.5, 5.0), (0.5, 33.0)), (1, 2))
    np.testing.assert_allclose(fit.plant, plant, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("start", ["lhpost6", "untuned"])
def test_a_light_specimen_costs_no_axis_its_displacement_gain(start):
    """0.7 t on the platen's 257 t: neither Kx nor KF of roll can be raised alone, and both can.

    Margins of the bare table's settings are the yardstick, to what `AxisTuning.worse` judges a loss.
    """
    plant, shipped = make_plant(load_machine().with_specimen(PENDULUM, locked=True)), load_controller("lhpost6")
    job = tuning._Job(plant, load_controller(start), lambda share: None)
    tuned = job.search.raised(job.search.lowest(load_controller(start)))
    growth = tuning_numbers().number("feedback_targets.growth")
    assert min(tuned.displacement_gain) > max(shipped.displacement_gain) / growth
    before, after = (margins(job.model, job.controller(s)) for s in (shipped, tuned))
    for old, new in zip(before, after, strict=True):
        assert new.gain > old.gain / 1.12 and new.phase > old.phase - np.radians(5.0)
    reasons = [job.search.limits(tuned, a) for a in range(6)]
    assert all("beyond 0.1 of the slowest oil column" in of_gain for of_gain, _ in reasons)
    assert "at most 2" in reasons[0][1] and "sensitivity" in reasons[3][1] and "beyond 2" in reasons[3][1]
    wide = with_gains(tuned, 3, force_damping=2.0 * tuned.force_damping[3])
    assert "in roll at" in job.search._refusal(wide, 3)


def test_a_machine_that_no_gain_can_hold_is_refused():
    for _ in with_tuning_numbers({**SHORT, "feedback_targets.first_gain": 40.0}, identify, tuning):
        with pytest.raises(SimulationError, match="unstable even with the lowest gains tried"):
            tune(load_machine("uniaxial"), load_controller("uniaxial"))


# ------------------------------------------------------------------------------------------ other machines
CHANGES = {
    "a platen half as heavy again": {"platen.mass": [252e3, 252e3, 262e3]},
    "softer oil": {"hydraulics.bulk_modulus": 0.8 * load_machine().hydraulics.bulk_modulus},
    "a longer valve delay": {"horizontal.valve_delay": 0.007, "vertical.valve_delay": 0.007},
}


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_a_changed_table_is_tuned_without_hand_work(change):
    """From the settings of the table as it was."""
    found = tune(load_machine().with_params(change), load_controller("lhpost6"))
    assert found.doubled
    for axis in found.axes:
        assert axis.margin_after.gain > 2.0
        f, T = axis.after.frequency, np.abs(axis.after.response[:, 0, 0])
        # what counts with dry friction and so little noise is the gain, not the coherence
        follows = (f > 0.1) & (f < 6.0)
        assert np.abs(20 * np.log10(T[follows])).max() < 3.0, axis.axis


@pytest.mark.slow
def test_a_rigid_specimen_is_tuned_without_hand_work():
    machine = load_machine().with_specimen(PENDULUM, locked=True)
    found = tune(machine, load_controller("lhpost6"))
    assert found.doubled and all(axis.margin_after.gain > 2.0 for axis in found.axes)


def test_the_shipped_settings_came_of_this_machine(plant, rest, controller):
    for name in "xyz":
        found = identify.identify(
            controller, rest, noise_target((name,), plant.machine.limits, seed=7), (name,), segment=4.0
        )
        low, high = tuning.band_within(found, 0, 3.0, 0.7)
        assert low <= 0.75 and high > 15.0, name


def test_a_response_measured_while_the_platen_lifts_off_an_actuator_is_doubted():
    """With 4.9 MN at 4 m and 1.5 m, V6 stays loaded in the usual noise in yaw, and not in five times that in pitch."""
    machine = load_machine().with_specimen("block_4_9MN", (4.0, 1.5, 0.0))
    _, rest, controller = controlled(machine, load_controller("cautious"))
    noise = noise_target(("pitch",), machine.limits, duration=8.0)
    strong = replace(noise, **{n: 5.0 * getattr(noise, n) for n in ("displacement", "velocity", "acceleration")})
    calm = noise_target(("yaw",), machine.limits, duration=8.0)
    assert identify.run_noise(controller, rest, calm)[1] == ""
    assert "chamber A of V6 fell below zero pressure" in identify.run_noise(controller, rest, strong)[1]


# ------------------------------------------------------------------------------------------- small pieces
def test_a_limit_cycle_is_not_taken_for_stability():
    """Valves that saturate bound an unstable loop: it swings for ever, neither growing nor dying away."""
    settings = load_controller("lhpost6")
    master = (settings.master_gain[0], 12.0 * settings.master_gain[1], *settings.master_gain[2:])
    assert not stays_stable(load_machine(), replace(settings, master_gain=master))


def test_what_limits_a_band_is_said_even_where_there_is_none(plant):
    f = np.arange(1, 400) / 8.0
    ones = np.ones((len(f), 1, 1), complex)
    good = np.ones((len(f), 1))

    def words(response, coherence, band):
        found = bandwidth_limitation(plant, Transfer(f, response, coherence, ("x",)), band, 3.0, 0.8, 33.0)
        assert not found.by_specimen
        return found.summary

    assert words(ones, good, (0.125, 40.0)) == "follows to 33 Hz and beyond"
    assert words(3 * ones, good, (np.nan, np.nan)).startswith("gain +9.5 dB at 1 Hz")
    assert words(ones, 0.5 * good, (np.nan, np.nan)).startswith("coherence 0.50 at 1 Hz")
    both = words(0.5 * ones, 0.5 * good, (0.125, 20.0))
    assert "coherence 0.50 at 20.1 Hz" in both and "gain -6.0 dB at 20.1 Hz" in both


def test_a_band_that_ends_at_a_mode_of_the_specimen_is_limited_by_it_and_not_by_the_valves():
    """The shear frame moves along x at 2.50 Hz; along y it is rigid, and at 5 Hz no mode is near."""
    plant = make_plant(load_machine().with_specimen("shear_frame"))
    first = specimen_modes(plant)[0].frequency
    f = np.arange(1, 400) / 16.0
    low = np.full((len(f), 1, 1), 0.63, complex)

    def found(axis, end):
        transfer = Transfer(f, low, np.ones((len(f), 1)), (axis,))
        return bandwidth_limitation(plant, transfer, (0.0625, end), 3.0, 0.8, 33.0)

    notch = found("x", 2.4375)
    assert notch.by_specimen and notch.summary.endswith(f"near the specimen's mode 1 at {first:.3g} Hz")
    assert "gain -4.0 dB at 2.5 Hz" in notch.summary and "valve delay" not in notch.summary
    for other in (found("y", 2.4375), found("x", 4.9375)):
        assert not other.by_specimen and "specimen" not in other.summary and "of valve delay" in other.summary


def test_noise_has_the_level_and_the_band_it_says():
    numbers = tuning_numbers()
    limits = load_machine().limits
    target = noise_target(("x", "roll"), limits)
    x, roll = target.acceleration[:, 0], target.acceleration[:, 3]
    middle = slice(len(x) // 2 - 20000, len(x) // 2 + 20000)  # it rises and falls at its ends
    rms = np.sqrt(np.mean(x[middle] ** 2))
    # 20 s of noise over 40 Hz are some 1600 free values
    assert rms == pytest.approx(numbers.number("noise.rms"), rel=0.1)
    assert np.sqrt(np.mean(roll[middle] ** 2)) == pytest.approx(rms / numbers.number("noise.rotation_radius"), rel=0.1)
    assert not target.acceleration[:, [1, 2, 4, 5]].any()
    assert abs(np.corrcoef(x, roll)[0, 1]) < 0.1  # independent of each other
    assert not np.allclose(x, noise_target(("x", "roll"), limits, seed=2).acceleration[:, 0])
    slow = noise_target(("x",), limits, slow=True)
    spectrum = np.abs(np.fft.rfft(slow.acceleration[:, 0])) ** 2
    f = np.fft.rfftfreq(len(slow.acceleration), 1 / 2048)
    inside = (f > numbers.number("noise.slow_low")) & (f < numbers.number("noise.high") * 1.05)
    assert spectrum[inside].sum() > 0.99 * spectrum.sum()
    assert np.abs(slow.displacement[:, 0]).max() < 0.2


def test_noise_stays_within_the_limits_of_a_small_table():
    """A tenth of the LHPOST6's stroke in y alone: y falls to the share of its limit, x is as it was."""
    limits, share = load_machine().limits, tuning_numbers().number("noise.of_limits")
    x, _, *rest = limits.displacement
    small = replace(limits, displacement=(x, 0.02, *rest))
    usual, less = (noise_target(("x", "y"), bound, slow=True) for bound in (limits, small))
    assert np.array_equal(usual.displacement[:, 0], less.displacement[:, 0])
    assert np.abs(less.displacement[:, 1]).max() == pytest.approx(share * 0.02, rel=1e-12)
    ratio = less.acceleration[:, 1] @ usual.acceleration[:, 1] / (usual.acceleration[:, 1] @ usual.acceleration[:, 1])
    assert np.allclose(less.velocity[:, 1], ratio * usual.velocity[:, 1], rtol=1e-12, atol=0.0)


def test_the_oil_column_that_limits_a_band_is_one_that_moves_its_axis(plant):
    """That of pitch, at 35.3 Hz, is nearer to the end of the band than that of z, at 36.6 Hz, and moves x beside it."""
    f = np.arange(1, 400) / 8.0

    def words(axis):
        transfer = Transfer(f, np.full((len(f), 1, 1), 0.5, complex), np.ones((len(f), 1)), (axis,))
        return bandwidth_limitation(plant, transfer, (0.125, 32.0), 3.0, 0.8, 33.0).summary

    assert "near the oil column at 36.6 Hz (z)" in words("z")
    assert "near the oil column at 35.3 Hz (pitch)" in words("x")
    assert "oil column" not in words("yaw")


@pytest.mark.parametrize("axis", ["x", "y"])
def test_of_two_axes_alike_the_own_oil_column_limits_the_band(axis):
    """Both columns of the biaxial table are at 21.35 Hz; those of x had been named for y."""
    f = np.arange(1, 400) / 8.0
    transfer = Transfer(f, np.full((len(f), 1, 1), 0.5, complex), np.ones((len(f), 1)), (axis,))
    found = bandwidth_limitation(make_plant(load_machine("biaxial")), transfer, (0.125, 21.0), 3.0, 0.8, 33.0)
    assert f"near the oil column at 21.4 Hz ({axis})" in found.summary

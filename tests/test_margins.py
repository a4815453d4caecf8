"""The controlled table as a linear system: margins and response against closed forms, noise and simulation."""

from dataclasses import replace

import numpy as np
import pytest

from lhpost6_pin.control import Notch, load_controller, make_controller
from lhpost6_pin.core.names import AXES
from lhpost6_pin.data.transfer import band
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.linearize import oil_column_modes
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.tuning.identify import identify, noise_target
from lhpost6_pin.tuning.margins import (
    FREQUENCIES,
    _margin,
    expected_response,
    loop_frequencies,
    loop_gain,
    make_loop_model,
    margins,
)
from lhpost6_pin.tuning.tune import stays_stable


@pytest.fixture(scope="module")
def model(controller):
    return make_loop_model(controller)


def test_a_grid_about_resonances_holds_the_peak_of_a_lightly_damped_oil_column():
    """Peak 1 / (2 zeta sqrt(1 - zeta^2)) of a resonance with 0.12 % damping, as roll has it; wherever it lies.

    A step of 0.0037 % is a thirtieth of half the resonance's width: the peak is missed by less than 0.1 %.
    """
    zeta, missed = 0.0012, []
    for frequency in 46.0 + np.linspace(0.0, 0.1, 7):
        pole = 2.0 * np.pi * frequency * complex(-zeta, np.sqrt(1.0 - zeta**2))
        for grid in (loop_frequencies(np.array([pole, -3.0, np.inf]), count=1500, near=161), FREQUENCIES):
            r = grid / frequency
            found = np.abs(1.0 / (1.0 - r**2 + 2j * zeta * r)).max()
            missed.append(1.0 - found * 2.0 * zeta * np.sqrt(1.0 - zeta**2))
    assert max(map(abs, missed[0::2])) < 1e-3 < 0.1 < max(missed[1::2])  # the plain grid misses a tenth or more


@pytest.mark.parametrize("gain, delay", [(5.0, 0.02), (20.0, 0.005), (2.0, 0.1)])
def test_margins_of_an_integrator_with_delay_are_those_of_its_closed_form(gain, delay):
    """L = k exp(-s T) / s: gain margin pi / (2 k T) at 1 / (4 T), phase margin pi / 2 - k T at k / (2 pi)."""
    s = 2j * np.pi * FREQUENCIES
    found = _margin(FREQUENCIES, gain * np.exp(-s * delay) / s)
    step = FREQUENCIES[1] / FREQUENCIES[0]  # frequencies are those of the grid
    assert found.gain == pytest.approx(np.pi / (2 * gain * delay), rel=1e-4)  # interpolated between its points
    assert found.gain_frequency == pytest.approx(0.25 / delay, rel=step - 1)
    assert found.phase == pytest.approx(np.pi / 2 - gain * delay, abs=1e-4)
    assert found.phase_frequency == pytest.approx(gain / (2 * np.pi), rel=step - 1)


def test_phase_margins_can_be_asked_for_below_a_frequency():
    """An integrator, and an oil column at 30 Hz that crosses gain one again with less phase left."""
    s = 2j * np.pi * FREQUENCIES
    column = (2 * np.pi * 30.0) ** 2
    loop = 3.0 / s * np.exp(-1e-3 * s) * column / (s**2 + 0.01 * 2 * np.pi * 30.0 * s + column)
    everywhere, low = _margin(FREQUENCIES, loop), _margin(FREQUENCIES, loop, below=10.0)
    assert everywhere.phase_frequency > 25.0 and everywhere.phase < low.phase
    assert low.phase_frequency == pytest.approx(3.0 / (2 * np.pi), rel=0.01)
    assert low.phase == pytest.approx(np.pi / 2 - 3e-3, abs=1e-3)  # the column, far above, turns it by 2e-4
    assert (low.gain, low.gain_frequency) == (everywhere.gain, everywhere.gain_frequency)


def test_a_loop_that_only_falls_below_a_gain_is_not_taken_for_one_with_an_upper_limit():
    """Three integrators with leads cross the negative real axis twice: gains too small are unstable, too."""
    s = 2j * np.pi * FREQUENCIES
    low, high = 2 * np.pi * 0.5, 2 * np.pi * 20.0
    loop = 3e5 * (s + low) ** 2 / s**3 / (s + high) ** 2 * high**2 / 1e4  # stable between two gains
    found = _margin(FREQUENCIES, loop)
    # closed form of arg L = -pi: 2 atan(w / low) - 2 atan(w / high) = pi / 2, its upper root
    product, span = low * high, high - low
    root = (span + np.sqrt(span**2 - 4 * product)) / 2
    at = 1j * root
    gain = 1 / abs(3e5 * (at + low) ** 2 / at**3 / (at + high) ** 2 * high**2 / 1e4)
    assert gain > 1.0 and found.gain == pytest.approx(gain, rel=1e-3)


def test_without_feedback_there_is_nothing_that_could_become_unstable(plant, rest):
    none = (0.0,) * 6
    settings = replace(load_controller("lhpost6"), displacement_gain=none, reset_gain=none, force_damping=none)
    controller = make_controller(plant, rest, settings)
    for margin in margins(make_loop_model(controller, np.geomspace(0.1, 100.0, 50)), controller):
        assert margin.gain == margin.phase == np.inf and np.isnan(margin.gain_frequency)


def test_a_loop_without_feedback_answers_a_velocity_like_an_integrator_below_its_oil_columns(plant, rest, controller):
    """X = 1 / s at 1 Hz: valve gain and kinematics are inverted, the delay stays."""
    model = make_loop_model(controller, np.array([0.9, 1.0]))
    s = 2j * np.pi * model.frequency[:, None, None]
    late = np.exp(-s * 0.005) * (1 - np.exp(-s / 2048)) / (s / 2048)
    found = model.displacement * s / late
    # the slowest oil column adds (1 Hz / 9.3 Hz)^2, leaks give way by 0.6 %; the horizontal actuators act 1.25 m below
    # C: their yielding to a turn moves it by 0.03 m a radian
    assert np.abs(found - np.eye(6)).max() < 0.05


def test_the_plants_velocity_response_peaks_at_its_oil_columns(model, plant):
    peaks = {m.axis: m.frequency for m in oil_column_modes(plant.machine)}
    for k, name in enumerate(AXES):
        speed = np.abs(model.displacement[:, k, k]) * model.frequency
        assert model.frequency[np.argmax(speed)] == pytest.approx(peaks[name], rel=0.01)  # damped ones, on the grid


def test_the_expected_response_starts_at_one_and_master_gain_notches_and_loops_enter_it(plant, rest, model, controller):
    assert np.abs(expected_response(model, controller)[0] - np.eye(6)).max() < 0.02  # at 0.05 Hz
    settings = replace(controller.settings, master_gain=(0.5,) * 6)
    halved = make_controller(plant, rest, settings)
    assert np.allclose(loop_gain(model, halved), 0.5 * loop_gain(model, controller))
    for a, b in zip(margins(model, halved), margins(model, controller), strict=True):
        assert a.gain >= 1.5 * b.gain  # coupled axes share their margins
    notch = Notch((20.0,) * 6, (2.0,) * 6, (-1.0,) * 6)
    notched = make_controller(plant, rest, replace(controller.settings, notches=(notch,)))
    at = np.argmin(np.abs(model.frequency - 20.0))
    assert np.abs(loop_gain(model, notched)[at]).max() < 0.01 * np.abs(loop_gain(model, controller)[at]).max()


def test_along_the_vertical_noise_measures_what_the_linear_model_expects(plant, rest, controller):
    """Little friction acts there. Nearer to the oil column at 37 Hz the valves' flow damps more than in the small."""
    target = noise_target(("z",), plant.machine.limits, seed=5)
    measured = band(identify(controller, rest, target, ("z",), 8.0), 0.5, 20.0)
    expected = expected_response(make_loop_model(controller, measured.frequency), controller)[:, 2, 2]
    found = measured.response[:, 0, 0]
    error = np.abs(found - expected)
    # friction 1 %, the column's approach 2 %; twice that
    assert np.sqrt(np.mean(error**2)) < 0.03 and error.max() < 0.08


@pytest.mark.parametrize("axis", AXES)
def test_a_gain_margin_is_where_the_loop_becomes_unstable_in_simulation(controller, model, axis):
    """Nine tenths of the way it is still stable, a seventh beyond not: all without dry friction."""
    k = AXES.index(axis)
    machine, settings = controller.plant.machine, controller.settings
    margin = margins(model, controller)[k].gain
    assert 2.0 < margin < 100.0

    def scaled(factor):
        master = list(settings.master_gain)
        master[k] *= factor
        return replace(settings, master_gain=tuple(master))

    assert stays_stable(machine, scaled(0.9 * margin))
    assert not stays_stable(machine, scaled(1.15 * margin))


def test_the_shipped_settings_keep_six_decibels_and_survive_twice_their_gain(controller, model):
    for margin in margins(model, controller):
        assert 20 * np.log10(margin.gain) > 6.0 and np.degrees(margin.phase) > 30.0
    doubled = replace(controller.settings, master_gain=tuple(2.0 * g for g in controller.settings.master_gain))
    assert stays_stable(controller.plant.machine, doubled)
    inner = np.linalg.inv(np.eye(6) + loop_gain(model, controller))
    assert np.abs(np.einsum("mkk->mk", inner)).max() < 3.0  # no frequency where the loop amplifies much


def test_margins_and_response_of_a_guided_machine_have_one_axis():
    plant = make_plant(load_machine("uniaxial"))
    controller = make_controller(plant, find_equilibrium(plant), load_controller("uniaxial"))
    model = make_loop_model(controller)
    (margin,) = margins(model, controller)
    assert 2.0 < margin.gain < np.inf and expected_response(model, controller).shape == (len(FREQUENCIES), 1, 1)

"""Response spectra against closed forms of the damped oscillator."""

import numpy as np
import pytest

from lhpost6_pin.motions import response_spectrum


def test_resonant_harmonic_builds_up_to_the_closed_form():
    damping, period, amplitude, cycles = 0.05, 0.5, 2.0, 40
    w = 2 * np.pi / period
    step = period / 400
    time = np.arange(cycles * 400 + 1) * step
    found = response_spectrum(amplitude * np.sin(w * time), step, [period], damping)
    # u = A/(2 D w^2) (1 - exp(-D w t)) at the peaks, up to D^2; the excitation linear between samples loses
    # (w dt)^2/12 = 2e-5 and the sampled peak (w dt)^2/8 = 3e-5
    steady = amplitude / (2 * damping * w**2)
    assert found.displacement[0] == pytest.approx(steady, rel=1.3e-3)  # D^2/2 = 1.25e-3
    assert found.displacement[0] < steady


@pytest.mark.parametrize("damping", [0.0, 0.02, 0.05, 0.3])
def test_a_sudden_constant_acceleration_overshoots_as_the_step_response(damping):
    period, amplitude = 0.8, 1.5
    w = 2 * np.pi / period
    half = np.pi / (w * np.sqrt(1 - damping**2))  # time of the first peak, placed on a sample
    step = half / 64
    found = response_spectrum(np.full(400, amplitude), step, [period], damping)
    overshoot = np.exp(-damping * np.pi / np.sqrt(1 - damping**2))
    # the input is linear between samples, so the recurrence is exact: rounding only
    assert found.displacement[0] == pytest.approx(amplitude / w**2 * (1 + overshoot), rel=1e-10)


def test_free_vibration_after_a_triangular_impulse_keeps_its_amplitude_without_damping():
    period, steps = 0.4, 64
    w, step = 2 * np.pi / period, period / steps
    acceleration = np.zeros(20 * steps)
    acceleration[1] = 3.0  # a triangle of area 3 dt
    found = response_spectrum(acceleration, step, [period], 0.0)
    impulse = 3.0 * step * (np.sin(w * step / 2) / (w * step / 2)) ** 2
    # the response is a sine of known amplitude, with peaks on samples: rounding, grown over 1280 steps
    assert found.displacement[0] == pytest.approx(impulse / w, rel=1e-9)


def test_a_stiff_oscillator_follows_the_ground_and_a_soft_one_stays_behind():
    step = 1 / 2048
    time = np.arange(8 * 2048) * step
    envelope = np.sin(np.pi * time / time[-1]) ** 2
    displacement = 0.1 * envelope * np.sin(2 * np.pi * time)
    acceleration = np.gradient(np.gradient(displacement, step), step)
    found = response_spectrum(acceleration, step, [0.02, 200.0])
    # stiff: PSA = PGA (1 + (T/T_ground)^2 ...) = 4e-4; soft: SD = PGD within the ratio of the periods, 5e-3
    assert found.pseudo_acceleration[0] == pytest.approx(np.abs(acceleration).max(), rel=2e-3)
    assert found.displacement[1] == pytest.approx(np.abs(displacement).max(), rel=2e-2)


def test_the_recurrence_agrees_with_a_general_integrator_on_a_random_input():
    from scipy.integrate import solve_ivp

    step, period, damping = 0.02, 0.7, 0.05
    acceleration = np.random.default_rng(5).standard_normal(60)
    time = np.arange(60) * step
    w = 2 * np.pi / period

    def rate(t, state):
        return state[1], -np.interp(t, time, acceleration) - 2 * damping * w * state[1] - w**2 * state[0]

    solution = solve_ivp(rate, (0, time[-1]), [0, 0], t_eval=time, rtol=1e-11, atol=1e-14, max_step=step / 4)
    found = response_spectrum(acceleration, step, [period], damping)
    # the integrator's tolerance over the kinks of the input
    assert found.displacement[0] == pytest.approx(np.abs(solution.y[0]).max(), rel=1e-6)


def test_pseudo_quantities_are_the_displacement_times_powers_of_the_frequency():
    acceleration = np.random.default_rng(1).standard_normal(500)
    periods = np.geomspace(0.05, 10, 30)
    found = response_spectrum(acceleration, 0.005, periods)
    w = 2 * np.pi / periods
    np.testing.assert_allclose(found.pseudo_velocity, w * found.displacement, rtol=1e-14)
    np.testing.assert_allclose(found.pseudo_acceleration, w**2 * found.displacement, rtol=1e-14)


def test_long_periods_at_the_control_rate_keep_their_digits():
    # 20 s at 2048 Hz: angle per step 1.5e-4; the same motion sampled coarsely (exact for its straight lines)
    coarse = np.random.default_rng(2).standard_normal(100)
    fine = np.interp(np.arange(99 * 512 + 1) / 512, np.arange(100), coarse)
    slow = response_spectrum(coarse, 0.25, [20.0]).displacement[0]
    # coarse peaks miss at most (w dt)^2/8 = 8e-4
    assert response_spectrum(fine, 0.25 / 512, [20.0]).displacement[0] == pytest.approx(slow, rel=8e-4)


@pytest.mark.parametrize(
    ("step", "period", "damping"), [(0.0, 1.0, 0.05), (0.01, 0.0, 0.05), (0.01, 1.0, 1.0), (0.01, 1.0, -0.1)]
)
def test_impossible_oscillators_are_refused(step, period, damping):
    with pytest.raises(ValueError, match="positive"):
        response_spectrum(np.zeros(10), step, [period], damping)

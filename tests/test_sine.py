"""Sine tests: amplitude, phase and distortion with and without cancellers, and which samples they are judged by."""

from dataclasses import replace

import numpy as np
import pytest
from machine_cases import plant_named
from run_cases import with_tuning_numbers

from lhpost6_pin.control import controlled, load_controller
from lhpost6_pin.core.errors import SimulationError
from lhpost6_pin.core.names import AXES, SAMPLE_RATE
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.show.report.sine_report import sine_verdict
from lhpost6_pin.simulation.motion_limits import fitting_scale
from lhpost6_pin.tuning import identify as identify_module
from lhpost6_pin.tuning import sine as module
from lhpost6_pin.tuning.sine import default_amplitude, sine_target, sine_test, with_cancellers

pytestmark = pytest.mark.long

QUICK = {"sine.time_constant": 1.5, "sine.harmonics": 15.0, "sine.settling": 6.0}


@pytest.fixture(scope="module", autouse=True)
def quick():
    """Faster learning of fewer harmonics than `tuning.toml` has."""
    yield from with_tuning_numbers(QUICK, identify_module, module)


@pytest.mark.parametrize(("axis", "amplitude", "frequency"), [("x", 0.1, 1.0), ("yaw", 0.01, 2.0)])
def test_cancellers_bring_a_sine_to_its_amplitude_and_phase_and_halve_its_distortion(axis, amplitude, frequency):
    test = sine_test(load_machine(), load_controller("lhpost6"), axis=axis, amplitude=amplitude, frequency=frequency)
    before, after = test.before, test.after
    assert abs(after.amplitude_error) < 0.01 and abs(np.degrees(after.phase_error)) < 2.0
    assert after.distortion < 0.5 * before.distortion
    assert abs(after.amplitude_error) < abs(before.amplitude_error) or abs(before.amplitude_error) < 0.002
    assert after.displacement.amplitude[0] == pytest.approx(amplitude, rel=0.01)
    assert after.peak_spool < 1.0 and after.run.clipped == 0


def test_no_canceller_is_where_the_response_of_pitch_turns_about_its_zeros():
    """With pitch moves x: zeros at 31 Hz, poles at 36 Hz, where the phase differs by 60 to 125 degrees."""
    _, _, alone = controlled(load_machine(), load_controller("lhpost6"))
    highest = {axis: 0.5 * len(with_cancellers(alone, axis, 0.5, 66, 3.0).canceller) for axis in AXES}
    assert highest == {"x": 33, "y": 33, "z": 33, "roll": 33, "pitch": pytest.approx(29.0, abs=1.0), "yaw": 33}
    single = with_cancellers(alone, "pitch", 32.0, 1, 3.0)
    assert len(single.canceller) == 1  # the fundamental always has one


def test_a_sine_without_harmonics_in_the_band_is_not_judged_by_them_nor_by_an_error_that_is_small():
    """The error of its last cycle was a little larger than of the first, both a ten-thousandth of the sine."""
    test = sine_test(load_machine(), load_controller("lhpost6"), axis="x", amplitude=0.0005, frequency=30.0)
    words, level = sine_verdict(test, {})
    assert abs(test.after.amplitude_error) < 0.001 and level == "good" and np.isnan(test.after.distortion)
    assert "No harmonic lies in the band to 33 Hz" in words and "unstable" not in words and "rises" not in words


def test_a_sine_that_overshoots_until_a_chamber_empties_states_by_how_much():
    with pytest.raises(SimulationError, match=r"unphysical .* times that of the target: choose an amplitude smaller"):
        sine_test(load_machine(), load_controller("lhpost6"), axis="x", amplitude=0.00083, frequency=33.0)


def test_cancellers_of_pitch_are_stable():
    """One of 32 Hz, the eighth multiple, grew until an actuator reached its stop."""
    test = sine_test(load_machine(), load_controller("lhpost6"), axis="pitch", amplitude=0.001, frequency=4.0)
    assert abs(test.after.amplitude_error) < 0.001 and test.after.distortion < 0.1 * test.before.distortion
    assert (test.cancelled, test.wanted) == (7, 8)
    assert "Harmonics above 28.0 Hz have no canceller" in sine_verdict(test, {})[0]


@pytest.mark.parametrize("amplitude, frequency", [(0.1, 1.0), (0.75, 0.5), (0.02, 3.3), (0.0005, 33.0)])
def test_a_sine_is_judged_over_whole_cycles_at_full_amplitude_after_learning(amplitude, frequency):
    numbers = module.tuning_numbers()
    target, level, measured = sine_target("x", amplitude, frequency)
    assert np.all(level[measured] > 1.0 - 1e-6) and level[0] == level[-1] == 0.0 and level.shape == target.time.shape
    x, a = target.displacement[measured, 0], target.acceleration[measured, 0]
    cycles = numbers.number("sine.measured_cycles")
    assert len(x) == np.ceil(cycles / frequency * SAMPLE_RATE)
    t = np.arange(len(x)) / SAMPLE_RATE
    waves = np.column_stack([np.cos(2 * np.pi * frequency * t), np.sin(2 * np.pi * frequency * t)])
    (c, s), *_ = np.linalg.lstsq(waves, x, rcond=None)
    assert np.hypot(c, s) == pytest.approx(amplitude, rel=2e-3)  # the target's high-pass at a fraction of the sine's
    assert np.abs(x - waves @ [c, s]).max() < 2e-3 * amplitude
    # the full sine lasts as long before, for the cancellers to learn
    settle = numbers.number("sine.settling") * numbers.number("sine.time_constant")
    before = target.displacement[measured.start - int(0.95 * settle * SAMPLE_RATE) : measured.start, 0]
    assert np.abs(before).max() < 1.01 * amplitude
    for part in np.array_split(before, max(1, int(0.9 * settle * frequency))):
        assert np.ptp(part) > 1.8 * amplitude
    assert measured.stop <= len(target.displacement) and np.abs(a).max() == pytest.approx(
        amplitude * (2 * np.pi * frequency) ** 2, rel=5e-3
    )


def test_cancellers_sit_on_the_multiples_of_their_axis(controller):
    found = with_cancellers(controller, "z", 2.0, 5, 3.0)
    assert np.array_equal(found.canceller["axis"], [2.0] * 5)
    assert np.allclose(found.canceller["turn"] * SAMPLE_RATE / (2 * np.pi), [2.0, 4.0, 6.0, 8.0, 10.0])
    assert np.allclose(found.canceller["cosine"] ** 2 + found.canceller["sine"] ** 2, 1.0)
    assert len(controller.canceller) == 0  # a changed copy


@pytest.mark.parametrize(
    ("machine", "axis", "amplitude", "frequency", "message"),
    [
        ("uniaxial", "y", 0.01, 1.0, "uniaxial cannot move in y; choose --axis from x"),
        ("lhpost6", "x", 1e-4, 40.0, "a sine of 40 Hz lies outside the table's band"),
        ("lhpost6", "z", 0.3, 0.5, r"without cancellers the run stopped at .* V. left its stroke"),
    ],
)
def test_a_sine_that_cannot_be_is_refused(machine, axis, amplitude, frequency, message):
    options = {"axis": axis, "amplitude": amplitude, "frequency": frequency}
    with pytest.raises(SimulationError, match=message):
        sine_test(load_machine(machine), load_controller(machine), **options)


def test_a_sine_that_lifts_the_platen_off_an_actuator_is_refused():
    machine = load_machine().with_specimen("block_4_9MN", (4.0, 1.5, 0.0))
    with pytest.raises(SimulationError, match=r"without cancellers the run became unphysical at .* chamber A of V"):
        sine_test(machine, load_controller("cautious"), axis="z", amplitude=0.08, frequency=2.0)


def test_cancellers_that_are_unstable_are_named_where_the_controller_alone_runs_the_sine(monkeypatch):
    runs = iter(["", "became unphysical at 3 s"])
    monkeypatch.setattr(module, "with_pressure_trouble", lambda run: replace(run, trouble=next(runs)))
    message = (
        "with cancellers the run became unphysical at 3 s. Without them the same sine runs to its end: the cancellers"
    )
    with pytest.raises(SimulationError, match=message):
        sine_test(load_machine("uniaxial"), load_controller("uniaxial"), axis="x", amplitude=0.01, frequency=1.0)


def test_frequencies_without_end_and_other_modes_are_refused():
    for frequency in (0.0, 1e-4, np.nan, np.inf):  # before time and memory are spent on endless periods
        with pytest.raises(SimulationError, match=r"outside the table's band; choose a frequency from 0.07 to 33 Hz"):
            sine_target("x", 0.1, frequency)
    displacement = replace(load_controller("lhpost6"), mode="displacement")
    with pytest.raises(SimulationError, match="cancellers need a reference generator in acceleration mode"):
        sine_test(load_machine(), displacement, axis="x", amplitude=0.1, frequency=1.0)


@pytest.mark.parametrize(
    "name, axis, frequency", [("lhpost6", "x", 0.5), ("lhpost6", "yaw", 5.0), ("uniaxial", "x", 1.0)]
)
def test_an_amplitude_that_is_not_stated_is_half_of_what_fits(name, axis, frequency):
    plant = plant_named(name)
    amplitude = default_amplitude(plant, axis, frequency)
    fits = amplitude * fitting_scale(plant, sine_target(axis, amplitude, frequency)[0])
    assert 0.45 < amplitude / fits <= 0.5 + 1e-3  # rounded down to two digits, what fits to three

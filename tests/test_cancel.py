"""Sine cancellers in any closed loop: the level they learn at, what they reach in `run`, what cannot be."""

from dataclasses import replace

import numpy as np
import pytest
from commands import refused
from run_cases import with_tuning_numbers

from lhpost6_pin.control import controlled, load_controller
from lhpost6_pin.core.errors import SimulationError
from lhpost6_pin.data.distortion import harmonics
from lhpost6_pin.data.records import load_record
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.simulate import ClosedLoop, PluggedLoop
from lhpost6_pin.tuning import cancel as module
from lhpost6_pin.tuning import identify as identify_module
from lhpost6_pin.tuning.cancel import amplitude_at, cancelling, change_of_cycles
from lhpost6_pin.tuning.sine import sine_target

pytestmark = pytest.mark.long


@pytest.fixture(scope="module", autouse=True)
def quick():
    """Faster learning of fewer harmonics than `tuning.toml` has."""
    yield from with_tuning_numbers({"sine.time_constant": 1.0, "sine.harmonics": 10.0}, identify_module, module)


def test_the_level_is_the_envelope_of_a_sine_and_nothing_of_another_frequency():
    target, envelope, _ = sine_target("x", 0.1, 1.0)
    amplitude = amplitude_at(target.displacement[:, 0], 1.0)
    # mean over a cycle of an envelope that rises over three: a third of a cycle's rise at most
    assert np.abs(amplitude / 0.1 - envelope).max() < 0.1 and amplitude.max() == pytest.approx(0.1, rel=1e-3)
    t = np.arange(20480) / 2048.0
    other = np.sin(2 * np.pi * 2.0 * t)
    assert amplitude_at(np.zeros(100), 1.0).max() == 0.0
    away = amplitude_at(np.sin(2 * np.pi * t) + other, 1.0)
    inside = slice(2048, -2048)  # whole cycles
    assert np.ptp(away[inside]) < 0.01


@pytest.fixture(scope="module")
def loop(machine):
    _, rest, controller = controlled(machine, load_controller("lhpost6"))
    target = make_target(find_motion("sine", axis="x", amplitude=0.05, period=1.0, cycles=2))
    drive = controller.drive_for(target.displacement, target.velocity, target.acceleration)
    return ClosedLoop(controller, drive, rest), target


def test_the_loop_has_the_drive_it_had_and_cancellers_of_its_harmonics(loop):
    closed, target = loop
    found = cancelling(closed, target, "x=1")
    assert np.array_equal(found.drive[:, :6], closed.drive) and found.drive.shape[1] == 13
    assert np.array_equal(found.drive[:, 6:12], target.acceleration)
    assert found.controller.canceller.size == 10 and found.controller.columns == 13


def test_of_a_motion_that_is_no_sine_a_warning_says_how_little_there_is_to_cancel(loop, caplog):
    closed, target = loop
    x = target.displacement[:, 0]
    cancelling(closed, target, "x=1")
    assert not caplog.records
    slow = 0.3 * np.sin(2.0 * np.pi * 0.1 * np.arange(len(x)) / 2048.0)
    cancelling(closed, replace(target, displacement=target.displacement + np.outer(slow, np.eye(6)[0])), "x=1")
    assert "of its largest displacement in x" in caplog.text
    assert change_of_cycles(np.sin(2.0 * np.pi * np.arange(20480) / 2048.0), 1.0) < 1e-9  # a steady sine


def test_an_earthquake_with_much_of_that_frequency_is_no_sine(loop, caplog):
    closed, _ = loop
    target = make_target(find_motion("ridgecrest"))
    drive = closed.controller.drive_for(target.displacement, target.velocity, target.acceleration)
    cancelling(closed._replace(drive=drive), target, "x=0.3")  # 81 % of its largest displacement
    assert "does not repeat itself at 0.3 Hz" in caplog.text


@pytest.mark.parametrize(
    "sine, message",
    [
        ("x", "write an axis and its fundamental in hertz"),
        ("x=fast", "write an axis and its fundamental in hertz"),
        ("x=nan", "outside the table's band"),
        ("x=90", "outside the table's band"),
        ("q=1", "cannot move in q"),
        ("z=1", "has nothing at 1 Hz in z"),
    ],
)
def test_a_sine_that_is_not_there_is_refused(loop, sine, message):
    with pytest.raises(SimulationError, match=message):
        cancelling(*loop, sine)


def test_a_controller_of_ones_own_has_no_cancellers(loop):
    closed, target = loop
    plugged = PluggedLoop(None, target.displacement, target.velocity, target.acceleration, closed.rest)
    with pytest.raises(SimulationError, match="does without"):
        cancelling(plugged, target, "x=1")


def test_run_brings_a_sine_nearer_to_its_amplitude(lhpost6, tmp_path, brief):
    motion = ("sine", "--set", "amplitude=0.05", "--set", "cycles=10", "--set", "ramp_cycles=1", "--engine", "fused")
    errors = []
    for n, more in enumerate(((), ("--cancel", "x=1"))):
        assert lhpost6("run", *motion, *more, "--no-report", "--out", tmp_path / str(n)).code == 0
        record = load_record(tmp_path / str(n) / "record.nc")
        end = int(np.argmax(record["time"].values > 11.5))
        last = slice(end - 3 * 2048, end)
        x, wanted = (record[f"{name}_displacement"].values[last, 0] for name in ("platen", "reference"))
        amplitudes = [harmonics(values, 2048.0, 1.0, 1).amplitude[0] for values in (x, wanted)]
        errors.append(abs(amplitudes[0] / amplitudes[1] - 1.0))
    assert errors[1] < 0.3 * errors[0]  # 8 s of learning with a time constant of 1 s
    assert refused(lhpost6("run", *motion, "--cancel", "y=1"), "has nothing at 1 Hz in y")

"""Sensors that other sensors contradict: each kind of fault is found, named and put right; good ones are left alone."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from sensor_cases import measured

from lhpost6_pin.control import load_controller
from lhpost6_pin.data.sensors import add_noise, load_sensors
from lhpost6_pin.data.signals import align
from lhpost6_pin.discovery.discover import discovery_numbers
from lhpost6_pin.discovery.lost_motion import LostMotion, _groups, lost_motion
from lhpost6_pin.discovery.sensor_findings import correct_records, find_sensor_faults
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import Plant
from lhpost6_pin.simulation.simulated_campaign import simulate_campaign

SENSORS = load_sensors()


@pytest.fixture(scope="module")
def campaign(plant: Plant) -> list[xr.Dataset]:
    """Two records with noise and nothing wrong."""
    return [add_noise(measured(plant, seed)[0], SENSORS, np.random.default_rng(seed)) for seed in (0, 10)]


def changed(records: list[xr.Dataset], name: str, change) -> list[xr.Dataset]:
    """Records with one channel's values (n, k) changed."""
    return [r.assign({name: r[name].copy(data=change(r[name].values.copy()))}) for r in records]


def scaled(column: int, factor: float):
    """A change of one column by a factor."""

    def change(values: np.ndarray) -> np.ndarray:
        values[:, column] *= factor
        return values

    return change


def crossed(values: np.ndarray) -> np.ndarray:
    """Eight hundredths of the acceleration along y in that along x."""
    values[:, 0] += 0.08 * values[:, 1]
    return values


def test_good_sensors_have_no_faults(plant: Plant, campaign) -> None:
    assert find_sensor_faults(plant, campaign, SENSORS) == ()
    assert correct_records(campaign, ())[0] is campaign[0]


@pytest.mark.parametrize(
    ("channel", "change", "name", "family", "value"),
    [
        ("platen_acceleration", scaled(2, 1.06), "gain platen_acceleration[z]", "accelerometer_error", 0.06),
        ("platen_velocity", scaled(0, 0.95), "gain platen_velocity[x]", "accelerometer_error", -0.05),
        ("platen_acceleration", crossed, "cross y platen_acceleration[x]", "accelerometer_error", 0.08),
        ("actuator_displacement", scaled(3, 1.04), "gain actuator_displacement[H4]", "length_sensor_error", 0.04),
    ],
)
def test_a_gain_or_cross_talk_beyond_its_range_is_named_and_measured(
    plant: Plant, campaign, channel, change, name, family, value
) -> None:
    wrong = changed(campaign, channel, change)
    faults = {f.name: f for f in find_sensor_faults(plant, wrong, SENSORS)}
    assert faults[name].family == family
    # what calibration leaves open of both sensors that are compared: half a percent each
    assert faults[name].value == pytest.approx(value, abs=0.012)
    assert abs(value) > faults[name].stated
    if channel.startswith("platen"):
        mended = correct_records(wrong, tuple(faults.values()))
        assert find_sensor_faults(plant, mended, SENSORS) == ()
        again, first = mended[0][channel].values, campaign[0][channel].values
        np.testing.assert_allclose(again, first, atol=0.012 * np.abs(first).max())


def test_a_late_group_of_channels_is_named(plant: Plant, campaign) -> None:
    dt = float(campaign[0]["time"][1] - campaign[0]["time"][0])
    late = changed(campaign, "platen_acceleration", lambda x: align(x, -3e-3, dt))
    (fault,) = find_sensor_faults(plant, late, SENSORS)
    assert (fault.name, fault.family) == ("delay platen_acceleration", "channel_delay")
    assert fault.value == pytest.approx(3e-3, abs=3e-4)  # what calibration leaves open


def test_a_length_that_drifts_within_tests_is_a_fault_of_its_own(plant: Plant, campaign) -> None:
    """Ten times as far as its noise within a record: no gain or offset of a sensor does that."""
    rate = 2e-4 / float(campaign[0]["time"][-1])

    def warmed(values: np.ndarray) -> np.ndarray:
        values[:, 2] += np.linspace(0.0, 2e-4, len(values))
        return values

    faults = {f.name: f for f in find_sensor_faults(plant, changed(campaign, "actuator_displacement", warmed), SENSORS)}
    found = faults["drift actuator_displacement[H3]"]
    assert (found.family, found.stated) == ("length_sensor_error", 0.0)
    assert found.value == pytest.approx(rate, rel=0.15)  # noise of a record of some seconds
    assert not [name for name in faults if name.startswith("drift") and "H3" not in name]


def test_the_play_of_a_pin_shows_in_its_length_and_nowhere_else(plant: Plant, campaign) -> None:
    numbers, _ = discovery_numbers()
    assert lost_motion(plant, campaign, SENSORS, numbers) == ()
    machine = load_machine().with_effect("swivel_play", ("H3",), half_play=5e-5, closing_force=3e3)
    loose = simulate_campaign(machine, load_controller("lhpost6"), SENSORS, seed=3, tests=("TX", "WN")).records
    (found,) = lost_motion(plant, loose, SENSORS, numbers)
    assert found.component == "H3"
    assert found.half_play == pytest.approx(5e-5, rel=0.2)  # skews of force and length blunt the turn: `lengths.form`
    assert found.gain > 100.0
    assert not any(f.kind == "offset" for f in find_sensor_faults(plant, loose, SENSORS, ["H3"]))


def test_play_is_one_effect_where_all_pins_have_about_as_much() -> None:
    names = ("H1", "H2", "H3", "H4")
    search = SimpleNamespace(problem=SimpleNamespace(machine=SimpleNamespace(double_acting=names)))

    def grouped(**sizes: float) -> list[list[str]]:
        lost = [LostMotion(name, size, 1e-6) for name, size in sizes.items()]
        return [[one.component for one in group] for group in _groups(lost, search)]

    assert grouped(H1=5e-5, H2=6e-5, H3=7e-5, H4=8e-5) == [list(names)]
    assert grouped(H1=5e-5, H2=6e-5, H3=7e-5, H4=2e-4) == [[name] for name in names]
    assert grouped(H2=5e-5, H3=5e-5) == [["H2"], ["H3"]]
    assert grouped() == []

"""Sensors: stated noise, noise with the stated spectrum and found again in a rest, and a channel more."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from run_cases import shaken
from scipy.signal import welch

from lhpost6_pin.core.errors import ParameterError, UnknownNameError
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.data.alignment import group_delays
from lhpost6_pin.data.channels import LAYOUT, Channel, channel_unit, sensor_groups
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.conditioning import resolutions
from lhpost6_pin.data.consistency import check_sensors
from lhpost6_pin.data.importing.channel_map import channels_of
from lhpost6_pin.data.records import load_record, make_record, save_record
from lhpost6_pin.data.sensors import SensorSet, add_noise, load_sensors, spectrum
from lhpost6_pin.identification.calibration.sensor_errors import corrected, sensor_unknowns
from lhpost6_pin.identification.prepare import AS_RECORDED, prepare_test
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulated_campaign import as_sensed, draw_errors

SENSORS = load_sensors()


def still(rate: float, duration: float = 40.0, moves: float | None = None) -> xr.Dataset:
    """Record of forces, pressures and platen at rest, until `moves` [s]."""
    t = np.arange(round(rate * duration)) / rate
    x = np.zeros((len(t), 6))
    if moves is not None:
        x[:, 0] = np.where(t > moves, 0.1 * (t - moves) ** 2, 0.0)
    channels = {"platen_displacement": x, "actuator_force": np.zeros((len(t), 2)), "supply_pressure": 2e7 + 0 * t}
    return make_record(t, channels, {"actuator": ["H1", "H2"]}, {})


def test_every_noise_has_a_channel_a_unit_and_a_source():
    assert set(SENSORS.noise) <= set(LAYOUT)
    few = {"pressure_difference", "floor_acceleration"}  # sensors that the LHPOST6 does not have
    assert set(SENSORS.delay_range) == set(sensor_groups()) - few
    assert all(q.source and q.evidence for q in SENSORS.parameters.values())


def test_the_noise_left_by_the_low_pass_is_the_integral_of_its_gain():
    # Butterworth of order 8 both ways: integral of (1 + x^16)^-2 over x is (1 - 1/16) (pi/16) / sin(pi/16)
    share = 15 / 16 * (np.pi / 16) / np.sin(np.pi / 16) * 100 / 1024
    assert SENSORS.noise_sd("actuator_force")[0] == pytest.approx(4000 * np.sqrt(share), rel=1e-4)  # trapezoid


def test_the_noise_below_a_sharp_cutoff_within_the_band_is_the_whites_share():
    assert SENSORS.noise_sd("actuator_force", 30.0)[0] == pytest.approx(4000 * np.sqrt(30 / 1024), rel=1e-6)


def test_a_range_becomes_the_standard_deviation_of_a_uniform_error():
    assert SENSORS.gain_sd("actuator_force") == pytest.approx(0.005 / np.sqrt(3))
    assert SENSORS.offset_sd("chamber_pressure_a") == pytest.approx(3e4 / np.sqrt(3))
    assert SENSORS.delay_sd("strut_pressure") == pytest.approx(3e-4 / np.sqrt(3))
    assert SENSORS.offset_sd("spool_position") == 0.0


@pytest.mark.parametrize("rate", [150.0, 512.0, 2048.0, 8192.0])
def test_simulated_noise_has_the_stated_spectrum_at_any_rate(rate: float):
    noisy = add_noise(still(rate), SENSORS, np.random.default_rng(0))
    f, power = welch(noisy["actuator_force"].values, rate, nperseg=round(rate), axis=0)
    power = power.mean(axis=1)
    inside = (f > 2) & (f < min(40.0, rate / 4))
    due = SENSORS.noise_spectrum("actuator_force", f)[:, 0]
    # 38 bins of 2 x 40 averages each: 1.8 % standard deviation, Hann's overlap a little more; five of them
    assert power[inside].mean() == pytest.approx(due[inside].mean(), rel=0.10)
    # sampling loses no variance, it folds it: 2 x 2 x 92 Hz x 40 s independent values, 0.8 %
    assert noisy["actuator_force"].values.std() == pytest.approx(SENSORS.noise_sd("actuator_force")[0], rel=0.04)


def test_noisy_channels_are_recorded_with_the_stated_number_of_steps():
    values = add_noise(still(512.0), SENSORS, np.random.default_rng(0))["actuator_force"].values
    steps = values / np.diff(np.unique(values)).min()
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)  # rounding of the quotient
    assert np.ptp(steps) <= 2**16


def test_rotations_are_recorded_over_a_range_of_their_own():
    """150 m along x in steps of 2 mm: noise of angles, some microradians, is finer by far, and keeps its own steps."""
    record = add_noise(still(512.0, moves=1.0), SENSORS, np.random.default_rng(0))
    moved = record["platen_displacement"].values
    for kind in (slice(0, 3), slice(3, 6)):
        step = np.ptp(moved[:, kind]) / (2**16 - 1)
        assert resolutions(record["platen_displacement"])[kind] == pytest.approx([step] * 3, rel=1e-6)
    own = SENSORS.noise_sd("platen_displacement")
    assert moved[:, 3].std() == pytest.approx(own[3], rel=0.04)  # of so many independent values 0.8 %


def test_the_resolution_adds_to_the_spectrum_of_a_coarse_channel():
    record = add_noise(still(512.0, moves=1.0), SENSORS, np.random.default_rng(0))  # 150 m: a step of 2 mm
    step = np.ptp(record["platen_displacement"].values) / (2**16 - 1)
    density = spectrum(SENSORS, record, "platen_displacement", np.array([1.0]))
    assert density[0, 0] == pytest.approx(step**2 / 6 / 512, rel=1e-3)  # the sensor's own is far smaller


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ('actuator_force = { value = 4000.0, unit = "N"', 'actuator_force = { value = 4000.0, unit = "m"', "unit"),
        ("actuator_force = { value = 4000.0", "actuator_farce = { value = 4000.0", "actuator_farce"),
        ("actuator_force = { value = 4000.0", "actuator_force = { value = -4000.0", "negative"),
        ("[offset_range]", "[offsets]", "offsets"),
        ("bits = { value = 16.0", "bits = { value = 0.0", "positive"),
    ],
)
def test_a_wrong_file_is_refused_by_the_name_of_its_key(tmp_path, old: str, new: str, names: str):
    text = (models_folder() / "sensors" / "lhpost6.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "wrong.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises((ParameterError, UnknownNameError), match=names):
        load_sensors(tmp_path / "wrong.toml")


def test_unknown_sensors_are_refused_with_those_that_exist():
    with pytest.raises(UnknownNameError, match="lhpost6"):
        load_sensors("no_such")
    with pytest.raises(UnknownNameError, match="actuator_force"):
        SENSORS.noise_sd("force")


MACHINE = load_machine()
NAME = "load_cell"
CELL = Channel(
    dims=("time", "actuator"),
    units="N",
    long_name="force of a second load cell",
    residuals=("force",),
    fault="pressure_sensor_error",
    same_as="actuator_force",
)
STATED = {"noise": (2000.0, "N"), "gain_range": (0.005, "1"), "offset_range": (3000.0, "N"), "delay_range": (2e-4, "s")}


@pytest.fixture
def with_cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SensorSet:
    """The shipped sensors and the new one, its descriptor in the layout."""
    monkeypatch.setitem(LAYOUT, NAME, CELL)  # type: ignore[arg-type]
    text = (models_folder() / "sensors" / "lhpost6.toml").read_text(encoding="utf-8")
    for section, (value, unit) in STATED.items():
        entry = f'{NAME} = {{ value = {value}, unit = "{unit}", evidence = "assumed", source = "a test" }}'
        text = text.replace(f"[{section}]\n", f"[{section}]\n{entry}\n")
    path = tmp_path / "sensors.toml"
    path.write_text(text, encoding="utf-8")
    return load_sensors(path)


def test_a_channel_is_one_descriptor_and_its_entries_in_a_sensors_file(with_cell, tmp_path):
    assert with_cell.noise_sd(NAME)[0] > 0.0 and with_cell.delay_sd(NAME) == pytest.approx(2e-4 / np.sqrt(3))
    assert sensor_groups()[NAME] == (NAME,) and channel_unit(f"{NAME}[H1]") == "N"
    assert channels_of(MACHINE.labels)[f"{NAME}[V6]"] == (NAME, "V6")  # what a channel map can name

    rng = np.random.default_rng(1)  # a simulated test shows it, through a sensor of its own
    clean = record_of_run(shaken(MACHINE, 4096), {"test": "shaken"})
    np.testing.assert_array_equal(clean[NAME], clean["actuator_force"])
    drawn = draw_errors(clean, with_cell, rng)
    record = as_sensed(clean, with_cell, drawn, 1024.0, rng)
    assert np.abs(record[NAME] - record["actuator_force"]).max() > 1000.0
    path = tmp_path / "test.nc"
    save_record(record, path)
    assert load_record(path, MACHINE.labels)[NAME].attrs["units"] == "N"

    stuck = record.copy(deep=True)  # checks look at it
    stuck[NAME].values[1000:, 2] = stuck[NAME].values[1000, 2]
    assert f"{NAME}[H3]" in {f.channel for f in check_dataset(stuck) if f.severity == "warning"}

    plant = make_plant(MACHINE)  # it is aligned and compared with what it repeats
    late = group_delays(plant, [record])[NAME]
    due = drawn.delay[NAME] - drawn.delay["actuator_force"]
    assert late.reference == "actuator_force" and late.delay == pytest.approx(due, abs=5 * late.standard_error)
    found = [f for f in check_sensors(plant, [record], with_cell) if f.channel == f"{NAME}[V2]"]
    assert {f.quantity for f in found} == {"gain", "delay", "offset", "residual"}
    assert all(f.verdict != "suspicious" for f in found)

    test = prepare_test(plant, record, with_cell, AS_RECORDED)  # its errors are unknowns of a calibration
    unknowns = sensor_unknowns(MACHINE, with_cell, test)
    own = [u.name for u in unknowns if u.channel == NAME]
    assert {f"gain {NAME}[H1]", f"offset {NAME}[V6]", f"delay {NAME}"} <= set(own) and len(own) == 21
    values = np.array([100.0 * (u.name == f"offset {NAME}[H2]") for u in unknowns])
    change = corrected(test, unknowns, values).channels[NAME] - test.channels[NAME]
    assert np.allclose(change[:, 1], -100.0) and not np.delete(change, 1, axis=1).any()

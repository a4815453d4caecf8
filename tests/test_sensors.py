"""Sensors: stated noise, simulated noise that has the stated spectrum, noise found again in a rest."""

import numpy as np
import pytest
import xarray as xr
from scipy.signal import welch

from lhpost6_pin.core.errors import ParameterError, UnknownNameError
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.data.channels import LAYOUT, sensor_groups
from lhpost6_pin.data.records import make_record
from lhpost6_pin.data.sensors import add_noise, estimate_noise, find_rest, load_sensors, spectrum

SENSORS = load_sensors()


def still(rate: float, duration: float = 40.0, moves: float | None = None) -> xr.Dataset:
    """Record of forces, pressures and platen at rest, until `moves` [s]."""
    t = np.arange(round(rate * duration)) / rate
    x = np.zeros((len(t), 6))
    if moves is not None:
        x[:, 0] = np.where(t > moves, 0.1 * (t - moves) ** 2, 0.0)
    channels = {"platen_displacement": x, "actuator_force": np.zeros((len(t), 2)), "supply_pressure": 2e7 + 0 * t}
    return make_record(t, channels, {"actuator": ["H1", "H2"]}, {})


def test_every_noise_has_a_channel_a_unit_and_a_source() -> None:
    assert set(SENSORS.noise) <= set(LAYOUT)
    assert set(SENSORS.delay_range) == set(sensor_groups())
    assert all(q.source and q.evidence for q in SENSORS.parameters.values())


def test_the_noise_left_by_the_low_pass_is_the_integral_of_its_gain() -> None:
    # Butterworth of order 8 both ways: integral of (1 + x^16)^-2 over x is (1 - 1/16) (pi/16) / sin(pi/16)
    share = 15 / 16 * (np.pi / 16) / np.sin(np.pi / 16) * 100 / 1024
    assert SENSORS.noise_sd("actuator_force")[0] == pytest.approx(4000 * np.sqrt(share), rel=1e-4)  # trapezoid


def test_the_noise_below_a_sharp_cutoff_within_the_band_is_the_whites_share() -> None:
    assert SENSORS.noise_sd("actuator_force", 30.0)[0] == pytest.approx(4000 * np.sqrt(30 / 1024), rel=1e-6)


def test_a_range_becomes_the_standard_deviation_of_a_uniform_error() -> None:
    assert SENSORS.gain_sd("actuator_force") == pytest.approx(0.005 / np.sqrt(3))
    assert SENSORS.offset_sd("chamber_pressure_a") == pytest.approx(3e4 / np.sqrt(3))
    assert SENSORS.delay_sd("strut_pressure") == pytest.approx(3e-4 / np.sqrt(3))
    assert SENSORS.offset_sd("spool_position") == 0.0


@pytest.mark.parametrize("rate", [150.0, 512.0, 2048.0, 8192.0])
def test_simulated_noise_has_the_stated_spectrum_at_any_rate(rate: float) -> None:
    noisy = add_noise(still(rate), SENSORS, np.random.default_rng(0))
    f, power = welch(noisy["actuator_force"].values, rate, nperseg=round(rate), axis=0)
    power = power.mean(axis=1)
    inside = (f > 2) & (f < min(40.0, rate / 4))
    due = SENSORS.noise_spectrum("actuator_force", f)[:, 0]
    # 38 bins of 2 x 40 averages each: 1.8 % standard deviation, Hann's overlap a little more; five of them
    assert power[inside].mean() == pytest.approx(due[inside].mean(), rel=0.10)
    # sampling loses no variance, it folds it: 2 x 2 x 92 Hz x 40 s independent values, 0.8 %
    assert noisy["actuator_force"].values.std() == pytest.approx(SENSORS.noise_sd("actuator_force")[0], rel=0.04)


def test_noisy_channels_are_recorded_with_the_stated_number_of_steps() -> None:
    values = add_noise(still(512.0), SENSORS, np.random.default_rng(0))["actuator_force"].values
    steps = values / np.diff(np.unique(values)).min()
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)  # rounding of the quotient
    assert np.ptp(steps) <= 2**16


def test_the_resolution_adds_to_the_spectrum_of_a_coarse_channel() -> None:
    record = add_noise(still(512.0, moves=1.0), SENSORS, np.random.default_rng(0))  # 150 m: a step of 2 mm
    step = np.ptp(record["platen_displacement"].values) / (2**16 - 1)
    density = spectrum(SENSORS, record, "platen_displacement", np.array([1.0]))
    assert density[0, 0] == pytest.approx(step**2 / 6 / 512, rel=1e-3)  # the sensor's own is far smaller


def test_rest_ends_where_the_table_begins_to_move() -> None:
    record = add_noise(still(512.0, 4.0, moves=2.0), SENSORS, np.random.default_rng(0))
    rest = find_rest(record, SENSORS)
    # 0.1 t^2 passes six standard deviations of 6 um + resolution after 30 ms
    assert rest.start / 512 < 0.05
    assert 2.0 < rest.stop / 512 < 2.05


def test_a_record_that_begins_in_motion_has_no_rest_and_no_estimate() -> None:
    record = add_noise(still(512.0, 4.0, moves=-1.0), SENSORS, np.random.default_rng(0))
    assert find_rest(record, SENSORS) == slice(0, 0)
    assert estimate_noise(record, SENSORS) == ()


def test_noise_is_found_again_within_its_standard_error() -> None:
    estimates = estimate_noise(add_noise(still(512.0), SENSORS, np.random.default_rng(3)), SENSORS)
    assert len(estimates) == 9
    for estimate in estimates:
        # five standard errors over nine columns: once in 10^5
        assert estimate.sd == pytest.approx(estimate.stated, abs=5 * estimate.standard_error), estimate.channel
        assert estimate.standard_error < 0.01 * estimate.stated


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
def test_a_wrong_file_is_refused_by_the_name_of_its_key(tmp_path, old: str, new: str, names: str) -> None:
    text = (models_folder() / "sensors" / "lhpost6.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "wrong.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises((ParameterError, UnknownNameError), match=names):
        load_sensors(tmp_path / "wrong.toml")


def test_unknown_sensors_are_refused_with_those_that_exist() -> None:
    with pytest.raises(UnknownNameError, match="lhpost6"):
        load_sensors("no_such")
    with pytest.raises(UnknownNameError, match="actuator_force"):
        SENSORS.noise_sd("force")

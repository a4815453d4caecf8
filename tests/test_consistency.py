"""Consistency: sensors that agree pass, each kind of error is found where it is, and only there."""

from dataclasses import replace

import numpy as np
import pytest
from machine_cases import plant_named
from sensor_cases import RATE, measured

from lhpost6_pin.data.consistency import ConsistencyFinding, check_sensors
from lhpost6_pin.data.records import make_record
from lhpost6_pin.data.sensors import add_noise, load_sensors
from lhpost6_pin.data.signals import align

pytestmark = pytest.mark.long

SENSORS = load_sensors()


@pytest.fixture(scope="module")
def campaign(plant):
    """Two records with noise and nothing wrong."""
    return [add_noise(measured(plant, seed)[0], SENSORS, np.random.default_rng(seed)) for seed in (0, 10)]


def with_change(records, name: str, change) -> list:
    """Records with one channel's values (n, k) changed."""
    return [r.assign({name: r[name].copy(data=change(r[name].values.copy()))}) for r in records]


def suspicious(findings) -> set[tuple[str, str]]:
    """Channel and quantity of everything suspicious."""
    return {(f.channel, f.quantity) for f in findings if f.verdict == "suspicious"}


def find(findings, channel: str, quantity: str, check: str = "") -> ConsistencyFinding:
    """The finding of a channel and quantity."""
    return next(f for f in findings if (f.channel, f.quantity) == (channel, quantity) and check in f.check)


def test_sensors_that_agree_are_not_suspected(plant, campaign) -> None:
    findings = check_sensors(plant, campaign, SENSORS)
    assert suspicious(findings) == set()
    assert {f.check for f in findings} == {
        "force against pressures",
        "length against platen pose",
        "kinematic parity",
        "velocity against displacement",
        "acceleration against displacement",
        "strut pressure against gas law",
        "supply pressure against nominal",
        "spool against command",
    }


def test_channels_that_stay_at_zero_without_noise_can_be_compared(plant, campaign) -> None:
    still = [r.isel(time=slice(0, 512)) for r in campaign[:1]]
    for name in ("platen_displacement", "platen_velocity", "platen_acceleration"):
        still = with_change(still, name, np.zeros_like)
    findings = check_sensors(plant, still, replace(SENSORS, noise={}))
    residual = find(findings, "platen_velocity[x]", "residual")
    assert (residual.estimate, residual.expected, residual.verdict) == (0.0, 0.0, "ok")


def test_estimates_scatter_by_their_standard_errors(plant, campaign) -> None:
    findings = [f for f in check_sensors(plant, campaign, SENSORS) if f.quantity != "residual"]
    z = np.array([(f.estimate - f.expected) / f.standard_error for f in findings])
    # some 150 numbers: their spread is known to 6 %; quantities of one channel hang together
    assert 0.7 < np.sqrt(np.mean(z**2)) < 1.3


def test_calibration_errors_within_their_range_are_found_and_accepted(plant, campaign) -> None:
    records = with_change(campaign, "actuator_force", lambda f: 1.005 * f + 4000.0)
    findings = check_sensors(plant, records, SENSORS)
    assert suspicious(findings) == set()
    for quantity, due in (("gain a", 1.005), ("gain b", 1.005), ("offset", 4000.0)):
        found = find(findings, "actuator_force[H2]", quantity)
        assert found.estimate == pytest.approx(due, abs=4 * found.standard_error)  # 1 in 10^4
        assert found.standard_error < 0.1 * found.tolerance


def _third(column: int, factor: float, offset: float = 0.0):
    def change(x):
        x[:, column] = factor * x[:, column] + offset
        return x

    return change


@pytest.mark.parametrize(
    ("name", "change", "where"),
    [
        ("actuator_force", _third(2, 1.05), {"actuator_force[H3]"}),
        ("actuator_force", _third(1, 0.97), {"actuator_force[H2]"}),
        ("actuator_force", _third(6, 1.0, 60e3), {"actuator_force[V3]"}),
        ("chamber_pressure_b", _third(0, 0.95), {"actuator_force[H1]"}),
        ("platen_velocity", _third(1, 1.05), {"platen_velocity[y]"}),
        ("platen_acceleration", _third(5, -1.0), {"platen_acceleration[yaw]"}),
        ("strut_pressure", _third(1, 1.3), {"strut_pressure[S2]"}),
        ("spool_position", _third(8, 0.9), {"spool_position[V5]"}),
    ],
)
def test_an_error_beyond_its_range_is_found_where_it_is(plant, campaign, name, change, where) -> None:
    findings = check_sensors(plant, with_change(campaign, name, change), SENSORS)
    assert {channel for channel, _ in suspicious(findings)} == where


def test_a_length_that_is_off_breaks_its_own_comparison_and_parity(plant, campaign) -> None:
    findings = check_sensors(plant, with_change(campaign, "actuator_displacement", _third(3, 1.05)), SENSORS)
    assert ("actuator_displacement[H4]", "gain") in suspicious(findings)
    assert any("parity" in channel for channel, _ in suspicious(findings))
    only_lengths = [
        r[["actuator_displacement"]] for r in with_change(campaign, "actuator_displacement", _third(3, 1.05))
    ]
    assert suspicious(check_sensors(plant, only_lengths, SENSORS))  # parity needs nothing else


def test_a_channel_that_is_late_is_found(plant, campaign) -> None:
    late = with_change(campaign, "spool_position", lambda x: align(x, -2e-3, 1 / RATE))
    findings = check_sensors(plant, late, SENSORS)
    found = find(findings, "spool_position[H1]", "delay")
    assert found.verdict == "suspicious"
    assert found.expected == plant.delays[0]
    assert found.estimate == pytest.approx(plant.delays[0] + 2e-3, rel=0.03)  # the regression's second-order term


def test_a_noisier_sensor_shows_in_its_residual_only(plant, campaign) -> None:
    rng = np.random.default_rng(5)
    noisy = with_change(campaign, "supply_pressure", lambda x: x + 2e4 * rng.standard_normal(x.shape))
    assert suspicious(check_sensors(plant, noisy, SENSORS)) == {("supply_pressure", "residual")}


def test_what_hardly_moves_is_untested_rather_than_right(plant, campaign) -> None:
    still = [r.assign({n: 1e-4 * r[n] for n in r.data_vars if str(n).startswith("platen")}) for r in campaign]
    still = [
        add_noise(r[["platen_displacement", "platen_acceleration"]], SENSORS, np.random.default_rng(0)) for r in still
    ]
    assert find(check_sensors(plant, still, SENSORS), "platen_acceleration[roll]", "gain").verdict == "untested"


@pytest.fixture(scope="module")
def still_forces(plant):
    """Records whose pressures and forces stay near their static values, each with noise of its own."""
    record = measured(plant)[0]
    names = ("actuator_force", "chamber_pressure_a", "chamber_pressure_b")
    means = {n: record[n].mean("time") for n in names}
    still = record.assign({n: (m + 2e-4 * (record[n] - m)).transpose(*record[n].dims) for n, m in means.items()})
    return [add_noise(still[[*names]], SENSORS, np.random.default_rng(seed)) for seed in range(5)]


def test_a_force_that_hardly_varies_says_nothing_of_gains_and_offsets_are_not_made_of_noise(
    plant, still_forces
) -> None:
    for record in still_forces:
        lawful = with_change(
            [record], "chamber_pressure_a", lambda p: 1.0045 * p + 2.7e4
        )  # near the ends of the ranges
        lawful = with_change(lawful, "actuator_force", lambda f: 0.9955 * f - 3600.0)
        findings = check_sensors(plant, lawful, SENSORS)
        assert suspicious(findings) == set()
        assert {f.verdict for f in findings if f.quantity.startswith("gain")} == {"untested"}
        assert all(f.standard_error > 0.0 for f in findings)


def test_what_a_still_force_is_off_by_may_be_its_offset_or_its_gain(plant, still_forces) -> None:
    wrong = with_change(still_forces[:1], "actuator_force", _third(6, 1.05))
    findings = check_sensors(plant, wrong, SENSORS)
    assert suspicious(findings) == {("actuator_force[V3]", "offset")}
    found = find(findings, "actuator_force[V3]", "offset")
    assert found.named == "offset or gain a" and found.named in str(found)
    mean = float(still_forces[0]["actuator_force"][:, 6].mean())
    assert found.estimate == pytest.approx(0.05 * mean, abs=10 * found.standard_error + 0.001 * mean)


def test_sensors_that_agree_better_than_stated_are_not_suspected(plant) -> None:
    findings = check_sensors(plant, [measured(plant)[0]], SENSORS)
    residuals = [f for f in findings if f.quantity == "residual"]
    assert min(f.estimate / f.expected for f in residuals) < 0.1
    assert {f.verdict for f in residuals} == {"ok"}


def test_a_machine_without_redundant_lengths_has_no_parity() -> None:
    plant = plant_named("uniaxial")
    t = np.arange(2048) / RATE
    x = 0.1 * np.sin(2 * np.pi * t)[:, None]
    record = make_record(t, {"actuator_displacement": x}, {"actuator": plant.machine.actuator_names}, {})
    assert check_sensors(plant, [record], SENSORS) == ()

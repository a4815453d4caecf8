"""Consistency: sensors that agree pass; each kind of fault is found where it is, named, and corrected."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from machine_cases import plant_named
from sensor_cases import RATE, measured, scaled, with_change

from lhpost6_pin.control import load_controller
from lhpost6_pin.data.consistency import LEVELS, ConsistencyFinding, check_sensors
from lhpost6_pin.data.records import make_record
from lhpost6_pin.data.sensors import add_noise, load_sensors
from lhpost6_pin.data.signals import align
from lhpost6_pin.discovery.discover import discovery_numbers
from lhpost6_pin.discovery.lost_motion import LostMotion, _groups, lost_motion, with_rod_lengths
from lhpost6_pin.discovery.sensor_findings import correct_records, find_sensor_faults
from lhpost6_pin.identification.calibration import calibration_numbers
from lhpost6_pin.identification.calibration.prepare import policy_of
from lhpost6_pin.identification.prepare import align_records, prepare_test
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.simulation.simulated_campaign import simulate_campaign

pytestmark = pytest.mark.long

SENSORS = load_sensors()


def suspicious(findings) -> set[tuple[str, str]]:
    """Channel and quantity of everything suspicious."""
    return {(f.channel, f.quantity) for f in findings if f.verdict == "suspicious"}


def find(findings, channel: str, quantity: str, check: str = "") -> ConsistencyFinding:
    return next(f for f in findings if (f.channel, f.quantity) == (channel, quantity) and check in f.check)


def test_sensors_that_agree_are_not_suspected(plant, redundant):
    findings = check_sensors(plant, redundant, SENSORS)
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


def test_channels_that_stay_at_zero_without_noise_can_be_compared(plant, redundant):
    still = [r.isel(time=slice(0, 512)) for r in redundant[:1]]
    for name in ("platen_displacement", "platen_velocity", "platen_acceleration"):
        still = with_change(still, name, np.zeros_like)
    findings = check_sensors(plant, still, replace(SENSORS, noise={}))
    residual = find(findings, "platen_velocity[x]", "residual")
    assert (residual.estimate, residual.expected, residual.verdict) == (0.0, 0.0, "ok")


def test_estimates_scatter_by_their_standard_errors(plant, redundant):
    findings = [f for f in check_sensors(plant, redundant, SENSORS) if f.quantity != "residual"]
    z = np.array([(f.estimate - f.expected) / f.standard_error for f in findings])
    # some 150 numbers: their spread is known to 6 %; quantities of one channel hang together
    assert 0.7 < np.sqrt(np.mean(z**2)) < 1.3


def test_calibration_errors_within_their_range_are_found_and_accepted(plant, redundant):
    records = with_change(redundant, "actuator_force", lambda f: 1.005 * f + 4000.0)
    findings = check_sensors(plant, records, SENSORS)
    assert suspicious(findings) == set()
    for quantity, due in (("gain a", 1.005), ("gain b", 1.005), ("offset", 4000.0)):
        found = find(findings, "actuator_force[H2]", quantity)
        assert found.estimate == pytest.approx(due, abs=4 * found.standard_error)  # 1 in 10^4
        assert found.standard_error < 0.1 * found.tolerance


@pytest.mark.parametrize(
    ("name", "change", "where"),
    [
        ("actuator_force", scaled(2, 1.05), {"actuator_force[H3]"}),
        ("actuator_force", scaled(1, 0.97), {"actuator_force[H2]"}),
        ("actuator_force", scaled(6, 1.0, 60e3), {"actuator_force[V3]"}),
        ("chamber_pressure_b", scaled(0, 0.95), {"actuator_force[H1]"}),
        ("platen_velocity", scaled(1, 1.05), {"platen_velocity[y]"}),
        ("platen_acceleration", scaled(5, -1.0), {"platen_acceleration[yaw]"}),
        ("strut_pressure", scaled(1, 1.3), {"strut_pressure[S2]"}),
        ("spool_position", scaled(8, 0.9), {"spool_position[V5]"}),
    ],
)
def test_an_error_beyond_its_range_is_found_where_it_is(plant, redundant, name, change, where):
    findings = check_sensors(plant, with_change(redundant, name, change), SENSORS)
    assert {channel for channel, _ in suspicious(findings)} == where


def test_a_length_that_is_off_breaks_its_own_comparison_and_parity(plant, redundant):
    findings = check_sensors(plant, with_change(redundant, "actuator_displacement", scaled(3, 1.05)), SENSORS)
    assert ("actuator_displacement[H4]", "gain") in suspicious(findings)
    assert any("parity" in channel for channel, _ in suspicious(findings))
    only_lengths = [
        r[["actuator_displacement"]] for r in with_change(redundant, "actuator_displacement", scaled(3, 1.05))
    ]
    assert suspicious(check_sensors(plant, only_lengths, SENSORS))  # parity needs nothing else


def test_a_channel_that_is_late_is_found(plant, redundant):
    late = with_change(redundant, "spool_position", lambda x: align(x, -2e-3, 1 / RATE))
    findings = check_sensors(plant, late, SENSORS)
    found = find(findings, "spool_position[H1]", "delay")
    assert found.verdict == "suspicious"
    assert found.expected == plant.delays[0]
    assert found.estimate == pytest.approx(plant.delays[0] + 2e-3, rel=0.03)  # the regression's second-order term


def test_a_noisier_sensor_shows_in_its_residual_only(plant, redundant):
    rng = np.random.default_rng(5)
    noisy = with_change(redundant, "supply_pressure", lambda x: x + 2e4 * rng.standard_normal(x.shape))
    assert suspicious(check_sensors(plant, noisy, SENSORS)) == {("supply_pressure", "residual")}


def test_what_hardly_moves_is_untested_rather_than_right(plant, redundant):
    still = [r.assign({n: 1e-4 * r[n] for n in r.data_vars if str(n).startswith("platen")}) for r in redundant]
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


def test_a_force_that_hardly_varies_says_nothing_of_gains_and_offsets_are_not_made_of_noise(plant, still_forces):
    for record in still_forces:
        lawful = with_change(
            [record], "chamber_pressure_a", lambda p: 1.0045 * p + 2.7e4
        )  # near the ends of the ranges
        lawful = with_change(lawful, "actuator_force", lambda f: 0.9955 * f - 3600.0)
        findings = check_sensors(plant, lawful, SENSORS)
        assert suspicious(findings) == set()
        assert {f.verdict for f in findings if f.quantity.startswith("gain")} == {"untested"}
        assert all(f.standard_error > 0.0 for f in findings)


def test_what_a_still_force_is_off_by_may_be_its_offset_or_its_gain(plant, still_forces):
    wrong = with_change(still_forces[:1], "actuator_force", scaled(6, 1.05))
    findings = check_sensors(plant, wrong, SENSORS)
    assert suspicious(findings) == {("actuator_force[V3]", "offset")}
    found = find(findings, "actuator_force[V3]", "offset")
    assert found.named == "offset or gain a" and found.named in str(found)
    mean = float(still_forces[0]["actuator_force"][:, 6].mean())
    assert found.estimate == pytest.approx(0.05 * mean, abs=10 * found.standard_error + 0.001 * mean)


def test_sensors_that_agree_better_than_stated_are_not_suspected(plant):
    findings = check_sensors(plant, [measured(plant)[0]], SENSORS)
    residuals = [f for f in findings if f.quantity == "residual"]
    assert min(f.estimate / f.expected for f in residuals) < 0.1
    assert {f.verdict for f in residuals} == {"ok"}


def test_a_machine_without_redundant_lengths_has_no_parity():
    plant = plant_named("uniaxial")
    t = np.arange(2048) / RATE
    x = 0.1 * np.sin(2 * np.pi * t)[:, None]
    record = make_record(t, {"actuator_displacement": x}, {"actuator": plant.machine.actuator_names}, {})
    assert check_sensors(plant, [record], SENSORS) == ()


def crossed(values: np.ndarray) -> np.ndarray:
    """Eight hundredths of the acceleration along y in that along x."""
    values[:, 0] += 0.08 * values[:, 1]
    return values


def test_good_sensors_have_no_faults(plant, redundant):
    assert find_sensor_faults(plant, redundant, SENSORS) == ()
    assert correct_records(redundant, ())[0] is redundant[0]


@pytest.mark.parametrize(
    ("channel", "change", "name", "family", "value"),
    [
        ("platen_acceleration", scaled(2, 1.06), "gain platen_acceleration[z]", "accelerometer_error", 0.06),
        ("platen_velocity", scaled(0, 0.95), "gain platen_velocity[x]", "accelerometer_error", -0.05),
        ("platen_acceleration", crossed, "cross y platen_acceleration[x]", "accelerometer_error", 0.08),
        ("actuator_displacement", scaled(3, 1.04), "gain actuator_displacement[H4]", "length_sensor_error", 0.04),
    ],
)
def test_a_gain_or_cross_talk_beyond_its_range_is_named(plant, redundant, channel, change, name, family, value):
    wrong = with_change(redundant, channel, change)
    faults = {f.name: f for f in find_sensor_faults(plant, wrong, SENSORS)}
    assert faults[name].family == family
    # what calibration leaves open of both sensors that are compared: half a percent each
    assert faults[name].value == pytest.approx(value, abs=0.012)
    assert abs(value) > faults[name].stated
    if channel.startswith("platen"):
        mended = correct_records(wrong, tuple(faults.values()))
        assert find_sensor_faults(plant, mended, SENSORS) == ()
        again, first = mended[0][channel].values, redundant[0][channel].values
        np.testing.assert_allclose(again, first, atol=0.012 * np.abs(first).max())


def test_a_turned_axis_of_the_displacement_is_the_only_fault(plant, redundant):
    """Velocity, acceleration, lengths and forces contradict it, and none of them is accused."""
    turned = with_change(redundant, "platen_displacement", scaled(1, -1.0))
    faults = find_sensor_faults(plant, turned, SENSORS)
    assert [(f.name, f.family) for f in faults] == [("sign platen_displacement[y]", "accelerometer_error")]
    assert find_sensor_faults(plant, correct_records(turned, faults), SENSORS) == ()


def test_a_late_group_of_channels_is_named(plant, redundant):
    dt = float(redundant[0]["time"][1] - redundant[0]["time"][0])
    late = with_change(redundant, "platen_acceleration", lambda x: align(x, -3e-3, dt))
    (fault,) = find_sensor_faults(plant, late, SENSORS)
    assert (fault.name, fault.family) == ("delay platen_acceleration", "channel_delay")
    assert fault.value == pytest.approx(3e-3, abs=3e-4)  # what calibration leaves open
    ranges = SENSORS.delay_range
    assert fault.reference == "platen_displacement"
    assert fault.stated == ranges["platen_acceleration"] + ranges["platen_displacement"]


def test_a_delay_is_accepted_up_to_the_ranges_of_both_sensors_and_no_further(plant, redundant):
    both = SENSORS.delay_range["platen_acceleration"] + SENSORS.delay_range["platen_displacement"]
    verdicts = []
    for share in (0.9, 1.1):  # three deviations of both together would be 1.22 of the sum
        late = with_change(redundant, "platen_acceleration", lambda x, share=share: align(x, -share * both, 1 / RATE))
        found = find(check_sensors(plant, late, SENSORS), "platen_acceleration[x]", "delay")
        assert found.estimate == pytest.approx(share * both, rel=0.05)  # the regression's second-order term
        verdicts.append(found.verdict)
    assert verdicts == ["ok", "suspicious"]


@pytest.mark.parametrize("longer", [2e-4, 2e-5])  # [m]
def test_a_length_that_drifts_within_tests_is_a_fault_of_its_own(plant, redundant, longer):
    """Several times its noise within a record: no gain, no offset and no pin out of place does that.

    The smaller drift is within what all errors of calibration could come to, and unlike any of them.
    """
    rate = longer / float(redundant[0]["time"][-1])

    def warmed(values: np.ndarray) -> np.ndarray:
        values[:, 2] += np.linspace(0.0, longer, len(values))
        return values

    faults = {
        f.name: f for f in find_sensor_faults(plant, with_change(redundant, "actuator_displacement", warmed), SENSORS)
    }
    found = faults["drift actuator_displacement[H3]"]
    assert (found.family, found.stated) == ("length_sensor_error", 0.0)
    assert found.value == pytest.approx(rate, rel=0.15)  # noise of a record of some seconds
    assert not [name for name in faults if name.startswith("drift") and "H3" not in name]


def test_the_play_of_a_pin_shows_in_its_length_and_nowhere_else(plant, redundant):
    numbers, _ = discovery_numbers()
    assert lost_motion(plant, redundant, SENSORS, numbers) == ()
    machine = load_machine().with_effect("swivel_play", ("H3",), half_play=5e-5, closing_force=3e3)
    loose = simulate_campaign(machine, load_controller("lhpost6"), SENSORS, seed=3, tests=("TX", "WN")).records
    (found,) = lost_motion(plant, loose, SENSORS, numbers)
    assert found.component == "H3"
    assert found.half_play == pytest.approx(5e-5, rel=0.2)  # skews of force and length blunt the turn: `lengths.form`
    assert found.gain > 100.0
    policy = policy_of(calibration_numbers())
    aligned, _ = align_records(plant, with_rod_lengths(loose, [found], machine), policy)
    for record, longer in zip(loose, aligned, strict=True):
        assert np.isnan(longer["rod_displacement"].sel(actuator=["H1", "V6"]).values).all()
        side = prepare_test(plant, longer, SENSORS, policy).side[0, :, 2]
        force = record["actuator_force"].sel(actuator="H3").values[:: len(record["time"]) // len(side)][: len(side)]
        closed = np.abs(force) > 3e4  # ten times the closing force: the pin stands on one side
        side, force = side[closed], force[closed]
        assert np.mean(np.sign(side) == np.sign(force)) > 0.95  # noise of lengths and poses
        assert np.median(np.abs(side)) == pytest.approx(1.0, abs=0.25)  # that of the estimate, and noise
    assert not any(f.kind in LEVELS for f in find_sensor_faults(plant, loose, SENSORS, ["H3"]))


def test_play_is_one_effect_where_all_pins_have_about_as_much():
    names = ("H1", "H2", "H3", "H4")
    machine = SimpleNamespace(double_acting=names)

    def grouped(**sizes: float) -> list[list[str]]:
        lost = [LostMotion(name, size, 1e-6) for name, size in sizes.items()]
        return [[one.component for one in group] for group in _groups(lost, machine)]

    assert grouped(H1=5e-5, H2=6e-5, H3=7e-5, H4=8e-5) == [list(names)]
    assert grouped(H1=5e-5, H2=6e-5, H3=7e-5, H4=2e-4) == [[name] for name in names]
    assert grouped(H2=5e-5, H3=5e-5) == [["H2"], ["H3"]]
    assert grouped() == []


@pytest.mark.parametrize("late", [0.0, 4e-3, 1e-2])
def test_a_late_accelerometer_is_found_where_noise_of_the_displacement_hides_its_gain(plant, redundant, late):
    """Motion of a fiftieth: noise is more than a tenth of the derivatives, shrinks the gain, and the delay no less."""
    channels = ["platen_displacement", "platen_acceleration"]
    small = [r[channels].map(lambda x: 0.02 * x, keep_attrs=True) for r in redundant]
    small = with_change(small, channels[1], lambda x: align(x, -late, 1 / RATE))
    noisy = [add_noise(r, SENSORS, np.random.default_rng(k)) for k, r in enumerate(small)]
    found = check_sensors(plant, noisy, SENSORS)
    gain, delay = (find(found, "platen_acceleration[x]", quantity) for quantity in ("gain", "delay"))
    assert gain.verdict == "untested" and delay.verdict == ("suspicious" if late else "untested")
    assert delay.estimate == pytest.approx(late, abs=5e-4)  # three standard errors

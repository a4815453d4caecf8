"""Noise measured by the records themselves: rests, levels, sensors files, signs, and what sensors can tell."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from commands import refused
from hypothesis import example, given, settings
from hypothesis import strategies as st
from machine_cases import PRACTICE
from scipy.linalg import null_space
from sensor_cases import with_change

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.data.campaign_check import check_campaign
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.consistency import check_sensors
from lhpost6_pin.data.fusion import fuse_motion
from lhpost6_pin.data.layout_faults import FASTEST, SLOWEST
from lhpost6_pin.data.mass_regression import mass_fits
from lhpost6_pin.data.measured_sensors import compare_noise, find_sensors, measured_sensors, save_sensors
from lhpost6_pin.data.noise_levels import noise_levels
from lhpost6_pin.data.observable import observable
from lhpost6_pin.data.records import load_record, make_record, sample_interval, save_record
from lhpost6_pin.data.rests import find_rests, rest_numbers, restless
from lhpost6_pin.data.sensors import SensorSet, add_noise, load_sensors
from lhpost6_pin.data.signals import Band, align, differentiate
from lhpost6_pin.data.turned_signs import turned_signs
from lhpost6_pin.machine.components import Floor
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import kinematic_jacobian
from lhpost6_pin.simulation.rehearse import rehearse
from lhpost6_pin.tuning.sine import sine_target

TABLE = load_machine("uniaxial")
PLANT = make_plant(TABLE)
BEFORE, MOVING, AFTER = 1.5, 12.0, 2.0  # s
TRUE = {
    "platen_displacement": np.array([3e-6, 0, 0, 0, 0, 0]),
    "platen_acceleration": np.array([0.03, 0, 0, 0, 0, 0]),
    "pressure_difference": np.array([8e3]),
}
AREA, MASS, FRICTION = TABLE.actuators[0].area_a, TABLE.platen.mass[0], 5e3
ALONG = np.sign(TABLE.actuators[0].platen_point[0] - TABLE.actuators[0].base_point[0])


def sensors(rate: float, low_pass: float, bits: int = 24) -> SensorSet:
    given = load_sensors()
    return replace(given, rate=rate, band=Band(high=low_pass, order=16), noise=TRUE, bits=bits)


def shaken(seed: int, rate: float = 256.0, before: float = BEFORE, after: float = AFTER) -> xr.Dataset:
    """A one-axis test without noise: rest, tones up to 8 Hz that swell and fade, rest; inertia and friction."""
    rng = np.random.default_rng(seed)
    t = np.arange(round((before + MOVING + after) * rate)) / rate
    inside = np.clip((t - before) / MOVING, 0, 1)
    f = rng.uniform(0.7, 8, 12)
    tones = np.sin(2 * np.pi * np.multiply.outer(t, f) + rng.uniform(0, 6, 12)) / f**1.5
    x = 0.02 * np.sin(np.pi * inside) ** 4 * tones.sum(axis=1)
    v = differentiate(x, 1 / rate)
    a = differentiate(v, 1 / rate)
    six = [np.column_stack([column, np.zeros((len(t), 5))]) for column in (x, a)]
    pressure = ALONG * (MASS * a + FRICTION * np.tanh(v / 1e-3))[:, None] / AREA
    channels = {"platen_displacement": six[0], "platen_acceleration": six[1], "pressure_difference": pressure}
    facts = {"kind": "measured", "test": f"test {seed}"}
    return make_record(t, channels, TABLE.labels, facts)


def campaign(rate: float = 256.0, low_pass: float = 1e4, **options: float) -> list[xr.Dataset]:
    rng = np.random.default_rng(7)
    return [add_noise(shaken(k, rate, **options), sensors(rate, low_pass), rng) for k in range(4)]


@pytest.fixture(scope="module")
def tests() -> list[xr.Dataset]:
    return campaign()


# Rests ----------------------------------------------------------------------------------------------------------------


def test_rests_are_found_before_and_after_the_motion_and_nowhere_else(tests):
    for record, slices in zip(tests, find_rests(tests), strict=True):
        time = record["time"].values
        (first, last) = [(time[s][0], time[s][-1]) for s in slices]
        # motion swells with the fourth power: 2 % of its time is below 0.4 um, a seventh of the noise
        assert first[0] == 0 and BEFORE - 0.6 < first[1] < BEFORE + 0.7
        assert BEFORE + MOVING - 0.7 < last[0] < BEFORE + MOVING + 0.6 and last[1] == time[-1]


def test_constant_speed_and_creep_are_no_rest(tests):
    t = tests[0]["time"].values
    ramp = np.where(t < BEFORE, 0.002 * t, 0.0)  # 2 mm/s: no acceleration
    moved = with_change(tests[:1], "platen_displacement", lambda x: x + np.outer(ramp, np.eye(6)[0]))
    for part in (slice(0, round(1.2 * 256)),):
        assert all(s.start >= part.stop for s in find_rests([*moved, *tests[1:]])[0])


def test_a_command_that_moves_ends_a_rest(tests):
    t = tests[0]["time"].values
    command = np.zeros((len(t), 1)) + np.where(t > BEFORE, 0.1 * np.sin(8 * t), 0.01 * np.sin(20 * t))[:, None]
    late = make_record(t, {"valve_command": command}, TABLE.labels, {})["valve_command"]
    rests = find_rests([tests[0].assign(valve_command=late), *tests[1:]])
    assert rests[0] == () and all(len(slices) == 2 for slices in rests[1:])


# Comparisons ----------------------------------------------------------------------------------------------------------


def test_sensors_are_compared_by_the_noise_that_their_records_show(tests, tmp_path):
    """A file that states thirty times as much: by that nothing could be wrong, not even an accelerometer off by 6 %."""
    content = measured_sensors(PLANT, tests)
    stated = {key: q for key, q in content.items() if key.startswith("noise.")}
    much = {key: replace(q, value=tuple(30.0 * np.atleast_1d(q.value))) for key, q in stated.items()}
    save_sensors(replace(content, quantities={**content.quantities, **much}), path := tmp_path / "much.toml")
    off = with_change(tests, "platen_acceleration", lambda x: 1.06 * x)
    for records, wrong in ((tests, set()), (off, {"gain"})):
        found = check_campaign(TABLE, records, str(path))
        assert found is not None and found.findings is not None
        assert {f.quantity for f in found.findings if f.verdict == "suspicious"} == wrong
        assert any("an effect may pass for noise" in words for words in found.warnings)


def test_records_free_of_noise_are_not_compared():
    """What rounding leaves is no noise: any error of numerical derivatives would be beyond it."""
    found = check_campaign(TABLE, [shaken(k) for k in range(4)], "lhpost6")
    assert found is not None and found.findings is None and found.noise == ()
    assert "simulated without noise" in found.warnings[0] and "record two seconds" not in found.warnings[0]


# Levels ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("disturbed", ["as it is", "hum", "drift"])
def test_the_level_at_rest_is_that_of_the_noise(tests, disturbed):
    t = tests[0]["time"].values
    if disturbed == "hum":  # three times the noise
        tests = with_change(tests, "pressure_difference", lambda x: x + 34e3 * np.sin(2 * np.pi * 50 * t)[:, None])
    if disturbed == "drift":  # forty times the noise in a test
        tests = with_change(tests, "pressure_difference", lambda x: x + 20e3 * t[:, None])
    found = noise_levels(tests)
    assert found.seconds > 4 * 2.5 and found.band is None and set(found.channels) == set(TRUE)
    for name, one in found.channels.items():
        # three standard errors, 2 % each; hum raises two bins of 49 and their neighbours, the median by 2 %
        most = 3 * one.error[0] + 0.03 * (disturbed == "hum")
        assert one.sd(256.0)[0] == pytest.approx(TRUE[name][0], rel=most), name
        assert one.error[0] < 0.04 and not one.density[1:].any()


def test_the_low_pass_of_a_recorder_is_found_by_its_corner_and_order():
    found = noise_levels(campaign(1024.0, 120.0))
    assert found.band is not None
    assert found.band.high == pytest.approx(120.0, rel=0.03)  # bins are 2 Hz apart
    assert found.band.order == pytest.approx(16, abs=4)
    for name, one in found.channels.items():  # the density, which the filter leaves below its corner
        assert one.sd(1024.0)[0] == pytest.approx(TRUE[name][0], rel=3 * one.error[0]), name


def test_steps_of_a_converter_are_no_noise_of_the_sensor():
    step = 4e-6
    rounded = with_change(campaign(), "platen_displacement", lambda x: step * np.round(x / step))
    one = noise_levels(rounded).channels["platen_displacement"]
    extent = np.ptp([r["platen_displacement"].values for r in rounded])
    assert one.step == pytest.approx(step) and one.bits == pytest.approx(np.log2(extent / step), abs=1)
    assert one.sd(256.0)[0] == pytest.approx(3e-6, rel=3 * one.error[0])
    assert one.quantum[0] == pytest.approx(step**2 / 6 / 256)


def test_offsets_are_means_at_rest():
    shifted = with_change(campaign(), "platen_acceleration", lambda x: x + 0.1 * np.eye(6)[0])
    one = noise_levels(shifted).channels["platen_acceleration"]
    assert one.offset[0] == pytest.approx(0.1, abs=4 * 0.03 / np.sqrt(256 * 9))  # of the mean of nine seconds of noise


def test_without_a_rest_the_least_flat_part_of_the_spectrum_stands_in():
    moving = [r.isel(time=slice(4 * 256, 11 * 256)) for r in campaign()]
    found = noise_levels(moving)
    assert found.seconds == 0 and "without a rest" in found.source
    sd = {name: one.sd(256.0)[0] / TRUE[name][0] for name, one in found.channels.items()}
    for name in ("platen_displacement", "platen_acceleration"):
        # the quietest of a tenth of the windows and the least of several bands: up to 20 % too little
        assert sd[name] == pytest.approx(1, rel=0.25), name
    assert sd["pressure_difference"] > 0.75  # an upper bound: friction that jumps has power at all frequencies


def test_noise_that_motion_hides_is_not_guessed():
    moving = [shaken(k).isel(time=slice(4 * 256, 11 * 256)) for k in range(4)]
    with pytest.raises(RecordError, match="hide the noise of platen_displacement, platen_acceleration"):
        measured_sensors(PLANT, moving)


# Sensors files --------------------------------------------------------------------------------------------------------


def test_a_sensors_file_holds_what_the_records_show_and_says_what_is_assumed(tests, tmp_path):
    content = measured_sensors(PLANT, tests)
    save_sensors(content, tmp_path / "own.toml")
    read = load_sensors(tmp_path / "own.toml")
    levels = noise_levels(tests)
    for name, one in levels.channels.items():
        f = np.array([10.0, 30.0])
        # four figures, and a low-pass stated at half the rate: 1e-6 of the power at 30 of 128 Hz
        assert read.noise_spectrum(name, f)[:, 0] == pytest.approx(one.density[0], rel=2e-3)
    assert {key: q.evidence for key, q in content.items()} == {k: q.evidence for k, q in read.parameters.items()}
    assert all(
        q.evidence == "measured" and "test 0, test 1" in q.source for k, q in content.items() if k[:6] == "noise."
    )
    assert {q.evidence for k, q in content.items() if k.startswith(("gain_range", "delay_range"))} == {"assumed"}
    assert set(read.gain_range) == {"platen_acceleration"}  # the others' gains are scales of mass and friction
    assert read.offset_range["pressure_difference"] == 0.01 * TABLE.hydraulics.supply_pressure
    assert len(list(tmp_path.iterdir())) == 1  # no half file beside it


@pytest.mark.parametrize(
    ("factor", "phrase"), [(2.0, "0.5 of what"), (0.5, "2 times what"), (0.0, "states none"), (1.0, "")]
)
def test_noise_is_compared_with_what_a_file_states(tests, factor, phrase):
    stated = replace(sensors(256.0, 1e4), noise={**TRUE, "pressure_difference": factor * TRUE["pressure_difference"]})
    found = {one.channel: one for one in compare_noise(noise_levels(tests), stated)}
    one = found["pressure_difference"]
    assert phrase in one.warning and bool(phrase) == bool(one.warning)
    assert one.ratio == pytest.approx(1 / factor if factor else np.inf, rel=0.06)  # three standard errors
    assert not found["platen_displacement[x]"].warning


def test_noise_read_above_the_stated_low_pass_is_not_compared_and_its_statement_is_that_below_it():
    """Without a rest the flat part of a spectrum may lie where the recorder's filter leaves nothing."""
    stated = sensors(256.0, 20.0)
    (one,) = [x for x in noise_levels([add_noise(shaken(1), sensors(256.0, 120.0), np.random.default_rng(0))])
              .channels.values() if x.channel == "pressure_difference"]  # fmt: skip
    levels = noise_levels([shaken(1)])._replace(channels={one.channel: one._replace(low=90.0, high=110.0)}, rate=256.0)
    (found,) = compare_noise(levels, stated)
    # white noise at the rate of the records, beside a step of the converter far below it
    assert found.stated == pytest.approx(TRUE["pressure_difference"][0], rel=0.01)
    assert np.isnan(found.ratio) and not found.warning
    (below,) = compare_noise(levels._replace(channels={one.channel: one._replace(low=5.0, high=15.0)}), stated)
    assert below.stated == pytest.approx(TRUE["pressure_difference"][0], rel=0.01) and not np.isnan(below.ratio)


def test_round_off_of_a_computed_column_is_no_noise(tests):
    computed = [r.copy(deep=True) for r in tests]
    for record in computed:
        record["platen_acceleration"][:, 5] = 1e-33 * np.random.default_rng(3).standard_normal(record.sizes["time"])
    density = noise_levels(computed).channels["platen_acceleration"].density
    assert density[0] > 0 and density[5] == 0.0


@pytest.mark.parametrize("commanded", [False, True])
def test_the_gain_of_a_spool_may_be_off_where_its_command_tells(tests, commanded):
    """A gain of 1.0015, as sensors have, had been an unexplained residual: without a command it is the valve's flow."""
    records = []
    for k, record in enumerate(tests):
        t = record["time"].values
        command = np.where(t > BEFORE, 0.1 * np.sin(8 * t), 0.0)[:, None]
        noise = 1e-4 * np.random.default_rng(k).standard_normal(command.shape)
        spools = {"spool_position": command + noise} | ({"spool_command": command} if commanded else {})
        made = make_record(t, spools, TABLE.labels, {})
        records.append(record.assign({name: made[name] for name in spools}))
    assert ("gain_range.spool_position" in measured_sensors(PLANT, records)) == commanded


def test_noise_that_a_file_states_wrongly_is_replaced_by_that_of_the_records_and_no_other(tests, tmp_path, caplog):
    content = measured_sensors(PLANT, tests)
    stated = content.quantities["noise.pressure_difference"]
    wrong = replace(stated, value=2.0 * stated.value)
    save_sensors(
        replace(content, quantities={**content.quantities, "noise.pressure_difference": wrong}),
        path := tmp_path / "s.toml",
    )
    found = find_sensors(TABLE, tests, path)
    assert "noise replaced" in caplog.text and "platen_displacement" not in caplog.text
    # the level is a median over some hundred bins: within a few per cent
    np.testing.assert_allclose(found.noise["pressure_difference"], stated.value, rtol=0.05)
    for name in ("platen_displacement", "platen_acceleration"):
        np.testing.assert_array_equal(found.noise[name], load_sensors(path).noise[name])


def test_sensors_of_another_machine_are_measured_unless_named(tests, caplog):
    found = find_sensors(TABLE, tests)
    assert found.noise["pressure_difference"][0] == pytest.approx(8e3, rel=0.06)
    assert "s of rest in test 0" in caplog.text  # it says so
    assert find_sensors(load_machine("lhpost6"), []).name == load_sensors().name
    assert find_sensors(TABLE, tests, "lhpost6").name == load_sensors().name
    silent = [shaken(0).assign_attrs(kind="simulated")]
    with pytest.raises(RecordError, match=r"uniaxial names no sensors file.*without noise.*--sensors-out"):
        find_sensors(TABLE, silent)


def test_a_late_accelerometer_is_found_with_its_delay(tests):
    tau = 0.009
    late = with_change(tests, "platen_acceleration", lambda x: align(x, -tau, 1 / 256))
    known = find_sensors(TABLE, late)
    found = {f.quantity: f for f in check_sensors(PLANT, late, known) if f.channel == "platen_acceleration[x]"}
    assert found["delay"].estimate == pytest.approx(tau, abs=1e-4) and found["delay"].verdict == "suspicious"
    assert found["gain"].estimate == pytest.approx(1, abs=0.01) and found["gain"].verdict == "ok"
    # magnitude alone: no wrong unit
    assert not [
        f for f in check_dataset(late[0], TABLE) if f.channel == "platen_acceleration[x]" and "times" in f.message
    ]


# Signs ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("column", [0, 3, 7])
def test_a_force_with_its_sign_turned_is_found_and_no_other(column):
    machine, record = load_machine(), load_record(PRACTICE)
    assert turned_signs(record, machine) == []
    signs = np.where(np.arange(10) == column, -1.0, 1.0)
    (turned,) = with_change([record], "actuator_force", lambda x: x * signs)
    moves = column < 4  # a test along x: the vertical actuators hold, and nothing can be said of them
    expected = [f"actuator_force[{machine.actuator_names[column]}]"] * moves
    assert [f.channel for f in turned_signs(turned, machine)] == expected


def test_two_forces_that_are_exchanged_are_not_stated_to_be_turned_for_sure():
    machine, record = load_machine(), load_record(PRACTICE)
    facing = kinematic_jacobian(make_plant(machine))[:4, 0]  # elongation per motion along x: H1 and H2 face H3 and H4
    other = int(np.argmin(facing * facing[0]))
    order = np.arange(10)
    order[[0, other]] = other, 0
    (exchanged,) = with_change([record], "actuator_force", lambda x: x[:, order])
    found = {f.channel: f.remedy for f in turned_signs(exchanged, machine)}
    first, second = machine.actuator_names[0], machine.actuator_names[other]
    assert set(found) == {f"actuator_force[{first}]", f"actuator_force[{second}]"}
    for own, its in ((first, second), (second, first)):
        assert found[f"actuator_force[{own}]"].startswith(f"its sign is turned, or it is exchanged with {its}: ")
    signs = np.where(np.arange(10) == 0, -1.0, 1.0)
    (turned,) = with_change([record], "actuator_force", lambda x: x * signs)
    assert "exchanged" not in turned_signs(turned, machine)[0].remedy


@pytest.mark.parametrize(("axis", "amplitude", "column"), [("x", 0.1, 1), ("z", 0.05, 4)])
def test_a_turned_force_is_found_in_a_slow_sine_in_which_friction_hides_inertia(axis, amplitude, column):
    machine = load_machine()
    target, _, _ = sine_target(axis, amplitude, 0.25)
    bare = rehearse(machine, target, load_controller("lhpost6"), attrs={}, engine="fused", record_every=8).record
    record = add_noise(bare, load_sensors(), np.random.default_rng(0))
    assert turned_signs(record, machine) == []
    signs = np.where(np.arange(10) == column, -1.0, 1.0)
    (turned,) = with_change([record], "actuator_force", lambda x: x * signs)
    (found,) = turned_signs(turned, machine)
    assert found.channel == f"actuator_force[{machine.actuator_names[column]}]" and "takes energy" in found.message


def test_a_platen_that_settles_does_not_take_energy_by_forces_of_turned_sign():
    """After a move along z it rose by 16 um in 8 s, against a force that fell: all six signs were called turned."""
    machine = load_machine()
    move = sine_target("z", 0.06, 0.25)[0]
    still = np.zeros((20 * SAMPLE_RATE, 6))
    held = {n: np.vstack([getattr(move, n), still]) for n in ("displacement", "velocity", "acceleration")}
    longer = replace(move, time=np.arange(len(held["velocity"])) / SAMPLE_RATE, **held)
    run = rehearse(machine, longer, load_controller("lhpost6"), attrs={}, engine="fused", record_every=8).record
    rate, found = SAMPLE_RATE // 8, []
    for after in range(5, 13):
        rest = run.isel(time=slice((after - 20) * rate, (after - 12) * rate or None))
        assert 0.0 < np.ptp(rest["platen_displacement"].values[:, 2]) < 1e-4
        found += turned_signs(rest.assign_coords(time=rest["time"] - rest["time"][0]), machine)
    assert not found


def test_an_actuator_that_takes_what_the_others_give_is_not_turned():
    """Four horizontal actuators for three degrees of freedom: forces in balance with each other do no net work."""
    machine, record = load_machine(), load_record(PRACTICE)
    rows = kinematic_jacobian(make_plant(machine))
    balanced = null_space(rows[:4, [0, 1, 5]].T)[:, 0]
    speed = record["platen_velocity"].values[:, 0] * np.sign(rows[0, 0] * balanced[0])
    size = 4.0 * record["actuator_force"].values[:, :4].std() / speed.std()

    def working(force: np.ndarray) -> np.ndarray:
        return force - size * np.outer(speed, np.append(balanced, np.zeros(6)))

    (against,) = with_change([record], "actuator_force", working)
    fits = {fit.actuator: fit for fit in mass_fits(against, machine, rest_numbers())}
    assert fits["H1"].given < -0.25 and fits["H1"].by_mass < 0.6
    assert turned_signs(against, machine) == []


def test_a_late_force_of_inertia_is_no_turned_one():
    """By 5 ms, white noise of inertia seems to be taken from the platen in part."""
    machine, record = load_machine(), load_record(PRACTICE)
    for tau in (-5e-3, 5e-3):
        (late,) = with_change([record], "actuator_force", lambda x, tau=tau: align(x, tau, sample_interval(record)))
        assert turned_signs(late, machine) == []


def test_a_pressure_difference_with_its_sign_turned_is_an_error_with_the_remedy(tests):
    assert turned_signs(tests[0], TABLE) == []
    (turned,) = with_change(tests[:1], "pressure_difference", lambda x: -x)
    errors = [f for f in check_dataset(turned, TABLE) if f.severity == "error"]
    assert [f.channel for f in errors] == [f"pressure_difference[{TABLE.actuator_names[0]}]"]
    assert "sign = -1" in errors[0].remedy


def test_a_turned_accelerometer_is_not_taken_for_a_turned_pressure(tests):
    (turned,) = with_change(tests[:1], "platen_acceleration", lambda x: -x)
    assert turned_signs(turned, TABLE) == []
    assert any("opposite signs" in f.message for f in check_dataset(turned, TABLE))


# What sensors can tell ------------------------------------------------------------------------------------------------


def told(present: set[str], machine: Machine = TABLE) -> dict[str, str]:
    return {one.quantity: one.verdict for one in observable(machine, present)}


def test_scales_are_told_by_a_force_and_ratios_by_pressures():
    bare = {"platen_displacement", "valve_command"}
    assert told(bare)["moving mass"] == told(bare)["valve gain and null"] == told(bare)["leakage"] == "no"
    assert told(bare)["valve delay and lag"] == "no"  # a load that varies delays the motion, too
    few = told({*bare, "pressure_difference"})
    partly = ("moving mass", "friction law", "leakage", "specimen", "valve delay and lag")
    assert {few[quantity] for quantity in partly} == {"ratio"}
    assert told({*bare, "pressure_difference", "actuator_force"})["moving mass"] == "yes"
    assert told({*bare, "chamber_pressure_a", "chamber_pressure_b"})["moving mass"] == "ratio"
    floored = replace(TABLE, floors=(Floor("RF", "x", 100.0),))  # a floor without its mass is no force
    assert [told({*bare, "floor_acceleration"}, one)["specimen"] for one in (TABLE, floored)] == ["no", "yes"]
    cell = told({*bare, "actuator_force"})  # of a piston of equal areas, it is the pressure difference
    assert cell["moving mass"] == "yes" and cell["valve gain and null"] == cell["leakage"] == "ratio"
    single = TABLE.with_params({f"{TABLE.actuators[0].kind}.area_b": 0.7 * TABLE.actuators[0].area_a})
    assert told({*bare, "actuator_force"}, single)["leakage"] == "no"
    assert told({"spool_command", "spool_position"})["valve delay and lag"] == "yes"
    name = "friction by direction"  # which an offset of the force is, too
    assert cell[name] == few[name] == "ratio" and name not in told(bare)
    assert name not in told({*bare, "actuator_force"}, load_machine())
    assert "gas of the struts" not in told(bare) and "gas of the struts" in {
        one.quantity for one in observable(load_machine(), bare)
    }


# The command ----------------------------------------------------------------------------------------------------------


def test_check_writes_a_sensors_file_for_a_campaign(tests, lhpost6, tmp_path):
    for record in tests:
        save_record(record, tmp_path / "c" / f"{record.attrs['test']}.nc")
    ended = lhpost6("check", "c", "--machine", "uniaxial", "--sensors-out", "own.toml")
    assert ended.code == 0 and Path("own.toml").is_file()
    for phrase in ("s of rest in test 0", "What these sensors can tell", "moving mass", "piston area"):
        assert phrase in ended.words
    assert refused(lhpost6("check", "c", "--machine", "uniaxial", "--sensors-out", "own.toml"), "exists", "own.toml")
    compared = lhpost6("check", "c", "--machine", "uniaxial", "--sensors", "lhpost6")
    assert "of what the sensors file states: an effect may pass for noise" in compared.words


def test_without_rests_or_sensors_a_command_says_what_to_run(lhpost6, tmp_path):
    moving = shaken(0).isel(time=slice(4 * 256, 11 * 256))
    save_record(moving, tmp_path / "c" / "a.nc")
    for command in ("calibrate", "discover", "validate"):
        ended = lhpost6(command, "c", "--machine", "uniaxial")
        assert refused(ended, "uniaxial names no sensors file", "lhpost6 check c --machine uniaxial --sensors-out")
    assert refused(lhpost6("check", "c", "--machine", "uniaxial", "--sensors-out", "own.toml"), "not written", "rest")
    assert not Path("own.toml").exists()


# Sampling rates -------------------------------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None, derandomize=True, database=None)
@given(exponent=st.floats(np.log10(SLOWEST), np.log10(FASTEST)), samples=st.integers(2, 600))
@example(exponent=-1.0, samples=2)  # the spline and the parabola of fused motion had fewer points than coefficients
@example(exponent=-1.0, samples=400)  # no sample in a segment of a spectrum
@example(exponent=0.0, samples=60)  # none in a window of the noise
@example(exponent=np.log10(25.0), samples=5)  # no time between the edges of filters
@example(exponent=np.log10(5.9), samples=2)
def test_records_of_any_sampling_rate_and_length_are_judged_without_a_crash(exponent, samples):
    rate = float(f"{10**exponent:.6g}")
    rng = np.random.default_rng(samples)
    t = np.arange(samples) / np.clip(rate, 1.001 * SLOWEST, 0.999 * FASTEST)
    x, a = np.zeros((2, samples, 6))
    x[:, 0], a[:, 0] = 1e-3 * rng.standard_normal((2, samples))
    channels = {"platen_displacement": x, "actuator_displacement": x[:, :1], "platen_acceleration": a}
    channels |= {"pressure_difference": 1e5 * rng.standard_normal((samples, 1))}
    record = make_record(t, channels, TABLE.labels, {"kind": "measured", "test": "logger"})
    levels = noise_levels([record])
    if 0.8 * rate / 2 <= 6.0:  # the band that is read ends below its lowest frequency
        assert not levels.channels
    warned = [f.message for f in check_dataset(record, TABLE) if f.channel == "time" and f.severity == "warning"]
    assert len(warned) == (not 200 <= 1 / sample_interval(record) <= 1e5)
    check_campaign(TABLE, [record])
    check_campaign(TABLE, [record], "lhpost6")
    fused = fuse_motion(PLANT, record, load_sensors())
    assert np.isfinite(fused.motion.displacement).all()


@pytest.mark.parametrize("factors", [(0.1, 1.0), (1.0, 5.0), (0.1, 4.0)])
def test_noise_of_translations_says_nothing_of_that_of_rotations(factors):
    """Both had the ratio of their mean, of metres and radians: that of translations."""
    stated, table = load_sensors("lhpost6"), load_machine()
    still = load_record(PRACTICE)
    still = still[["platen_displacement"]].map(np.zeros_like, keep_attrs=True).assign_attrs(kind="measured")
    noisy = add_noise(still, stated, np.random.default_rng(3))
    noisy["platen_displacement"].values[:] *= np.repeat(factors, 3)
    found = find_sensors(table, [noisy], "lhpost6").noise["platen_displacement"]
    # a level is a median over some hundred bins of a short rest: within a few per cent, mean of three
    np.testing.assert_allclose(found / stated.noise["platen_displacement"], np.repeat(factors, 3), rtol=0.1)


@pytest.mark.parametrize("shape", ["creep", "ringing"])
def test_the_channel_that_keeps_a_record_from_resting_is_named(shape):
    record = load_record(PRACTICE).assign_attrs(kind="measured")
    assert restless([record]) == "" and find_rests([record]) != [()]  # all rest: none keeps the others from it
    t = record["time"].values
    wave = 5e-3 * np.sin(0.3 * t) if shape == "creep" else 2e-3 * np.sin(12.0 * t) * (1.0 + 0.5 * np.sin(0.2 * t))
    record["platen_displacement"].values[:, 2] += wave
    assert find_rests([record]) == [()] and restless([record]) == "platen_displacement[z]"


def test_an_upper_bound_above_the_stated_noise_does_not_contradict_it(caplog):
    """A short test, copied without its rests: motion is in the bound of rotations, which was taken for noise."""
    record = load_record(PRACTICE)
    assert noise_levels([record]).seconds == 0.0
    assert find_sensors(load_machine(), [record], "lhpost6").name == load_sensors("lhpost6").name
    assert "noise replaced" not in caplog.text

"""Three-phase validation: what agrees is found to agree, what was put in is found, what is missing is named."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from commands import refused
from machine_cases import PRACTICE

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.data.campaign import Campaign, load_campaign, save_campaign
from lhpost6_pin.data.channels import LAYOUT
from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.data.signals import Band, align, resample_band_limited
from lhpost6_pin.discovery.floor import normalised_error
from lhpost6_pin.identification.validation import PHASES, ComparedQuantity, Phase, metrics, phases, validate
from lhpost6_pin.identification.validation.phase_agreement import MOTIONS, agree
from lhpost6_pin.identification.validation.phases import run_phase
from lhpost6_pin.identification.validation.prepare_tests import validation_numbers, wrench_calibration
from lhpost6_pin.identification.validation.spectra import find_peak, find_valves
from lhpost6_pin.mechanics.linearize import oil_column_modes
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.report.page import Table
from lhpost6_pin.show.report.scales import percent
from lhpost6_pin.show.report.validate_report import validation_verdict, write_validate_report
from lhpost6_pin.show.report.validate_sections import _residual_blocks
from lhpost6_pin.simulation.rehearse import rehearse
from lhpost6_pin.simulation.simulated_campaign import SensorErrors, as_sensed
from lhpost6_pin.tuning.identify import noise_target

pytestmark = pytest.mark.long


def triangle(axis="x"):
    motion = find_motion("triangle", axis=axis, amplitude=0.1, velocity=0.2, corner_acceleration=3.0, cycles=1)
    return make_target(motion)


def late_by(record, source, late):
    """The record with the platen's motion taken from `source`, late."""
    motions = {f"platen_{q}": record[f"{source}_{q}"].values for q in MOTIONS}
    return record.assign({n: record[n].copy(data=align(x, -late, 1 / 2048)) for n, x in motions.items()})


@pytest.fixture(scope="module")
def campaign(machine):
    """A triangle along X and white noise on all axes, in closed loop, free of sensor noise."""
    settings = load_controller("lhpost6")
    noise = noise_target(("x", "y", "z", "roll", "pitch", "yaw"), machine.limits, duration=8.0)
    records = [
        rehearse(machine, target, settings, attrs={"test": name}, engine="fused").record.isel(time=slice(0, 20481))
        for name, target in (("TX", triangle()), ("WN", noise))
    ]
    return Campaign("made", tuple(records))


@pytest.fixture(scope="module")
def coarse(campaign):
    """The same at a quarter of the rate, as tests are recorded."""
    slow = (r.isel(time=slice(None, None, 4)).assign_attrs(sample_rate_hz=512.0) for r in campaign.records)
    return campaign._replace(records=tuple(slow))


@pytest.fixture(scope="module")
def noisy(campaign):
    """The same as sensors show it, at a quarter of the rate: noise, but no gains, offsets and skews."""
    rng, exact = np.random.default_rng(0), SensorErrors({}, {}, {})
    return campaign._replace(records=tuple(as_sensed(r, load_sensors(), exact, 512.0, rng) for r in campaign.records))


@pytest.fixture(scope="module")
def found(machine, campaign):
    return validate(machine, campaign)


@pytest.fixture(scope="module")
def found_noisy(machine, noisy):
    return validate(machine, noisy)


# Nothing differs ------------------------------------------------------------------------------------------------------


def test_the_closed_loop_repeats_a_run_of_the_same_machine(found):
    for test in found.tests:
        rows = [a for q in (*MOTIONS, "wrench") for a in found.phase(test, 3).of(q) if a.moves]
        assert {a.column for a in rows} >= {"x"}
        # same controller, reference and state: the run is repeated step by step; the alignment by no delay rounds
        assert max(a.rrmse for a in rows) < 1e-12
        assert max(a.rrmse_aligned for a in rows) < 1e-12


@pytest.mark.parametrize(("rate", "most"), [(512.0, 1e-5), (300.0, 1e-4)])
def test_the_closed_loop_repeats_a_run_that_was_recorded_at_another_rate(machine, campaign, rate, most):
    """Samples of the run are picked at 512 Hz, and interpolated at 300 Hz, whose instants are between them."""
    record = campaign.records[0]
    time = np.arange(int(record["time"].values[-1] * rate) + 1) / rate
    channels = {
        n: (v.dims, resample_band_limited(v.values, record["time"].values, time), v.attrs)
        for n, v in record.data_vars.items()
        if v.dims[0] == "time"
    }
    coords = {n: c.values for n, c in record.coords.items() if n != "time"} | {"time": ("time", time)}
    slow = xr.Dataset(channels, coords, record.attrs)
    rows = validate(machine, Campaign("slow", (slow,)), phases=[3]).phase("TX", 3).agreement
    # both sides are low-passed at 30 Hz, one at each rate; the reference is low-passed at 60 Hz once more
    assert max(a.rrmse for a in rows if a.moves and a.quantity in MOTIONS) < most


def test_the_open_loop_repeats_a_run_whose_spools_keep_still_within_a_sample(machine):
    """With a delay of ten samples, not 10.24, a record's positions are all that the ports saw."""
    whole = machine.with_params({f"{kind}.valve_delay": 10 / 2048 for kind in ("horizontal", "vertical")})
    record = rehearse(whole, triangle(), load_controller("lhpost6"), attrs={"test": "TX"}, engine="fused").record
    phase = validate(whole, Campaign("whole", (record,)), phases=[2]).phase("TX", 2)
    assert max(a.rrmse for a in phase.agreement if a.moves) < 1e-12  # the same steps: rounding
    assert max(abs(a.drift) for a in phase.of("displacement")) < 1e-15


def test_the_open_loop_of_a_run_differs_by_what_its_spools_do_within_a_sample(found):
    """A record has their mean over each sample: the same oil, up to 0.24 of a sample, 0.1 ms, off."""
    for test, most in (("TX", 1e-3), ("WN", 1e-2)):  # of accelerations and forces; several times what it is
        rows = [a for q in (*MOTIONS, "wrench") for a in found.phase(test, 2).of(q) if a.moves]
        assert {(a.quantity, a.column) for a in rows} >= {("displacement", "x"), ("wrench", "x"), ("wrench", "pitch")}
        assert max(a.rrmse for a in rows) < most
        assert max(a.rrmse for a in rows if a.quantity == "displacement") < 0.1 * most


def test_the_closed_loop_gives_the_commands_of_the_run_itself(found):
    for test in found.tests:
        rows = found.phase(test, 3).of("spool_command")
        assert len(rows) == 10
        assert max(a.error for a in rows) < 1e-9  # of full stroke: rounding


def test_inverse_dynamics_of_a_run_without_noise_gives_back_its_forces(found):
    for test in found.tests:
        rows = [a for a in found.phase(test, 1).of("wrench") if a.moves]
        assert {a.column for a in rows} >= {"x", "pitch"}
        # the record has a quarter of the model's steps: friction is marched with four times the step, whose lag
        # of 0.2 ms shows where friction turns over
        assert max(a.rrmse for a in rows) < 0.02


def test_inverse_dynamics_is_at_the_noise_of_the_sensors(found_noisy):
    for test in found_noisy.tests:
        for one in found_noisy.phase(test, 1).of("wrench"):
            # two draws differ in size by 1 / sqrt(2 x 30 Hz x 9 s) = 4 %. Friction is not linear in noise: at rest the
            # first draw moves it from where it is, the second, on top of it, by less
            assert 0.8 < one.error_to_noise < 2.5, f"{test} {one.column}"
    for one in found_noisy.phase("WN", 1).of("wrench"):
        assert 0.8 < one.error_to_noise < 1.3, one.column  # nothing rests


def test_the_open_loop_of_noisy_spools_is_as_far_off_as_noise_takes_it(found_noisy):
    for one in found_noisy.phase("WN", 2).of("acceleration"):
        assert one.moves
        # noise of spools excites oil columns, whose level wanders in 9 s: one draw tells another to a factor of two
        assert 0.5 < one.error_to_noise < 2.0, one.column


def test_oil_columns_of_model_and_run_are_the_same_and_near_those_of_the_linear_model(found, machine):
    expected = {m.axis: m.frequency for m in oil_column_modes(machine)}
    rows = [r for r in found.phase("WN", 2).resonances if np.isfinite(r.measured.frequency)]
    assert len(rows) >= 3
    for one in rows:
        assert one.model.frequency == pytest.approx(one.measured.frequency, rel=1e-4)  # but for what spools do within
        assert one.model.sharpness == pytest.approx(one.measured.sharpness, rel=1e-2)  # a sample
        assert one.expected == expected[one.column]
        assert one.measured.frequency == pytest.approx(
            one.expected, rel=validation_numbers().number("resonance.search")
        )


# What was put in ------------------------------------------------------------------------------------------------------


def test_a_delay_that_was_put_in_is_found_and_removed(machine, campaign):
    late = 0.004
    moved = late_by(campaign.records[0], "platen", late)
    phase = validate(machine, Campaign("late", (moved,)), phases=[3]).phase("TX", 3)
    rows = {a.quantity: a for a in phase.agreement if a.column == "x"}
    # the measurement is late, so the model is early; shifts are exact for what is band-limited to 30 of 1024 Hz
    assert rows["velocity"].delay == pytest.approx(-late, abs=1e-6)
    assert rows["acceleration"].rrmse > 0.05
    assert rows["acceleration"].rrmse_aligned < 1e-3
    assert rows["acceleration"].correlation < rows["acceleration"].correlation_aligned == pytest.approx(1.0, abs=1e-6)
    assert rows["acceleration"].error_aligned < 0.02 * rows["acceleration"].error
    (lag,) = phase.lags
    assert lag.measured - lag.model == pytest.approx(late, abs=1e-6)


def test_a_platen_that_does_what_is_asked_is_behind_it_by_as_much_as_it_is_late(machine, campaign):
    late = 0.012
    moved = late_by(campaign.records[0], "reference", late)
    (lag,) = validate(machine, Campaign("late", (moved,)), phases=[3]).phase("TX", 3).lags
    assert lag.column == "x"
    assert lag.measured == pytest.approx(late, abs=1e-6)  # shifts are exact for what is band-limited


def test_a_drift_that_was_put_in_is_found(machine, campaign):
    record = campaign.records[0]
    rate = np.array([1e-4, 0, 0, 0, 0, 2e-5])
    moved = record["platen_displacement"] - np.outer(record["time"].values, rate)
    drifting = record.assign(platen_displacement=moved.assign_attrs(units="m, rad"))
    found = validate(machine, Campaign("drifting", (drifting,)), phases=[2])
    drift = [a.drift for a in found.phase("TX", 2).of("displacement")]
    # a line passes a low-pass of unit gain unchanged; spools within a sample leave some 1e-9 m/s
    np.testing.assert_allclose(drift, rate, atol=1e-8)


def test_an_effect_that_the_model_lacks_shows_in_its_phase(machine, coarse):
    heavier = machine.with_params({"platen.mass": [1.1 * m for m in machine.platen.mass]})
    found = validate(heavier, coarse, phases=[1])
    force = {a.column: a for a in found.phase("WN", 1).of("wrench")}
    assert force["x"].rrmse > 0.05  # a tenth of the inertia force, which is most of it
    # the weight of a tenth of the vertical mass, in the mean, upwards
    assert force["z"].offset == pytest.approx(0.1 * machine.platen.mass[2] * 9.80665, rel=0.01)


def test_the_delay_of_a_servovalve_that_was_put_in_is_found(machine):
    rng, dt, n, late = np.random.default_rng(3), 1 / 512, 6000, 0.0047
    command = Band(high=60.0).apply(0.3 * rng.standard_normal((n, 10)), dt)
    command[:, 4] = 0.0  # V1 keeps still
    spool = align(0.9 * command, late * -1, dt) + 1e-4 * rng.standard_normal((n, 10))
    dims = ("time", "actuator")
    coords = {"time": np.arange(n) * dt, "actuator": list(machine.actuator_names)}
    record = xr.Dataset({"spool_command": (dims, command), "spool_position": (dims, spool)}, coords, {"test": "WN"})
    valves = find_valves(machine, [record], validation_numbers())
    moved = np.arange(10) != 4
    assert np.isnan(valves.delay[4])
    assert np.isnan(valves.response[:, 4]).all()
    # noise of 1e-4 in 0.1 over 40 of 256 Hz; the standard error says so
    np.testing.assert_allclose(valves.delay[moved], late, atol=5e-6)
    assert (np.abs(valves.delay[moved] - late) < 5 * valves.standard_error[moved]).all()
    seen = (valves.frequency > 2.0) & (valves.frequency < 40.0)
    response = valves.response[np.ix_(seen, moved)]
    wanted = 0.9 * np.exp(-2j * np.pi * valves.frequency[seen, None] * late)
    np.testing.assert_allclose(response, np.broadcast_to(wanted, response.shape), atol=0.02)  # windows of 1 s: 1 / 47
    assert (valves.model == machine.actuators[0].valve_delay).all()
    assert find_valves(machine, [record[["spool_command"]]], validation_numbers()) is None


@pytest.mark.parametrize(("scale", "moves"), [(1.0, True), (0.01, False)])
def test_a_column_moves_if_it_stands_out_of_the_noise_and_of_the_others(scale, moves):
    t = np.arange(4096) / 512
    x = np.sin(2 * np.pi * t)
    measured = np.stack([x, scale * x], axis=1)
    numbers = validation_numbers()
    pair = ComparedQuantity("displacement", ("x", "y"), measured, 1.1 * measured, np.full(2, 1e-4), np.full(2, 1e-4))
    rows = agree([pair], 1 / 512, numbers)
    assert rows[0].rrmse == pytest.approx(0.1)
    assert rows[1].moves is moves
    assert np.isfinite(rows[1].rrmse) == moves
    assert rows[1].error_to_noise == pytest.approx(0.1 * scale * np.sqrt(0.5) / 1e-4, rel=1e-2)
    loud = agree([replace(pair, sensor_noise=np.full(2, 0.1))], 1 / 512, numbers)  # rms 0.71
    assert not loud[0].moves


def test_a_held_out_error_is_over_one_noise_whichever_model_is_wrong():
    """Two models with one error, the noise predicted with one five times as large: no model gains by its own noise."""
    t = np.arange(4096) / 512
    x = np.sin(2 * np.pi * t)[:, None]
    phases = []
    for noise in (1e-2, 5e-2):
        pair = ComparedQuantity("wrench", ("x",), x, 1.1 * x, np.full(1, 1e-4), np.full(1, noise))
        phases.append(Phase(1, "SINE", t, (pair,), agree([pair], 1 / 512, validation_numbers())))
    quiet, noisy = phases
    assert normalised_error(noisy, quiet) == normalised_error(quiet, quiet) == pytest.approx(7.07, rel=1e-2)
    assert normalised_error(quiet, noisy) == pytest.approx(normalised_error(quiet, quiet) / 5.0)
    assert np.isnan(normalised_error(None, quiet)) and np.isnan(normalised_error(quiet, replace(quiet, reason="none")))


def test_a_preload_makes_no_error_look_small_and_an_offset_none_large():
    t = np.arange(4096) / 512
    x = np.sin(2 * np.pi * t)
    measured, model = 1e6 + 1e4 * x, 1.01e6 + 1.2e4 * x
    pair = ComparedQuantity("actuator_force", ("V1",), measured[:, None], model[:, None], np.ones(1), np.ones(1))
    (one,) = agree([pair], 1 / 512, validation_numbers())
    assert one.rrmse == pytest.approx(0.2)
    assert one.offset == pytest.approx(1e4, rel=1e-3)  # the ends are left out, and with them a whole number of periods


def test_the_peak_of_an_oscillator_has_its_frequency_and_damping():
    f = np.linspace(0.0, 60.0, 2401)
    f0, zeta = 11.0, 0.03
    power = 1 / ((1 - (f / f0) ** 2) ** 2 + (2 * zeta * f / f0) ** 2)
    peak = find_peak(f, power, np.ones_like(f), 11.7, validation_numbers())
    assert peak.frequency == pytest.approx(f0 * np.sqrt(1 - 2 * zeta**2), rel=1e-3)
    assert peak.sharpness == pytest.approx(zeta, rel=0.01)  # half-power width 2 zeta f0, to second order in zeta
    assert np.isnan(find_peak(f, power, np.zeros_like(f), 11.7, validation_numbers()).frequency)  # not coherent
    assert np.isnan(find_peak(f, np.ones_like(f), np.ones_like(f), 11.7, validation_numbers()).frequency)  # no peak


# What is missing ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lost", "number", "named"),
    [
        (["spool_position"], 2, "spool_position"),
        (["reference_displacement"], 3, "reference_displacement"),
        (["actuator_force", "chamber_pressure_a"], 1, "actuator_force"),
    ],
)
def test_a_phase_without_its_channels_says_which_and_the_others_go_on(machine, coarse, lost, number, named):
    record = coarse.records[0].drop_vars(lost)
    found = validate(machine, Campaign("poor", (record,)))
    assert named in found.phase("TX", number).reason
    others = [p for p in found.phases if p.number != number and "chamber_pressure_a" not in lost]
    assert all(p.reason is None for p in others)


def test_without_known_settings_there_is_no_closed_loop_unless_they_are_given(machine, coarse):
    record = coarse.records[0]
    for said, words in ((None, "names no controller"), ("somebody's", "not shipped")):
        attrs = {k: v for k, v in record.attrs.items() if k != "controller"} | ({"controller": said} if said else {})
        unsaid = record.copy(deep=False)
        unsaid.attrs = attrs
        with pytest.raises(RecordError, match=words):
            validate(machine, Campaign("unsaid", (unsaid,)), phases=[3])
    given = validate(machine, Campaign("given", (unsaid,)), phases=[3], settings=load_controller("lhpost6"))
    assert given.phase("TX", 3).of("velocity")[0].rrmse < 1e-5  # low-passed on either side at another rate
    assert any("“somebody's”: settings may differ" in words for words in given.phase("TX", 3).notes)


@pytest.mark.parametrize("samples", [3, 400])
def test_a_test_that_is_too_short_says_so_and_the_others_go_on(machine, coarse, samples):
    one, two = coarse.records
    short = two.isel(time=slice(0, samples))
    found = validate(machine, Campaign("short", (one, short)), phases=[1])
    assert "too short" in found.phase("WN", 1).reason
    assert found.phase("TX", 1).reason is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda one, two: (one, two.assign_attrs(test="TX")), "two tests are named 'TX'"),
        (lambda one, two: (one[["spool_command"]],), r"no phase of any test is possible.*actuator_displacement"),
        (lambda one, two: (one.assign_attrs(specimen="tower"),), r"'tower'.*--specimen"),
    ],
)
def test_tests_of_one_name_a_specimen_not_mounted_and_nothing_to_compare_are_refused(machine, coarse, change, message):
    with pytest.raises(RecordError, match=message):
        validate(machine, Campaign("poor", change(*coarse.records)))


def test_strut_pressures_may_be_missing(machine, coarse):
    shares = []
    poor = Campaign("poor", (coarse.records[0].drop_vars("strut_pressure"),))
    phase = validate(machine, poor, phases=[1], progress=shares.append).phase("TX", 1)
    assert phase.pair("struts") is None and phase.of("wrench")[0].moves and shares == [1.0]


def test_a_folder_without_records_and_tests_of_different_states_are_refused(machine, campaign, tmp_path):
    with pytest.raises(RecordError, match="holds no record"):
        load_campaign(tmp_path, machine)
    one, two = campaign.records
    mixed = campaign._replace(records=(one, two.assign_attrs(valves_per_horizontal_actuator=2)))
    save_campaign(mixed, tmp_path)
    with pytest.raises(RecordError, match=r"differ in valves_per_horizontal_actuator \(TX.nc: 1; WN.nc: 2\)"):
        load_campaign(tmp_path, machine)


def test_a_measured_record_goes_through(machine):
    record = load_record(PRACTICE)
    found = validate(machine, Campaign("measured", (record,)), phases=[1, 2])
    rows = {(p.number, a.quantity, a.column): a for p in found.phases for a in p.agreement}
    assert rows[1, "wrench", "x"].rrmse_aligned < 0.03  # 0.5 % of gain, friction of noisy motion
    assert rows[2, "velocity", "x"].rrmse_aligned < 0.01
    assert abs(rows[2, "displacement", "x"].drift) < 1e-3  # m/s: noise and offsets of spools and pressures


# What is written ------------------------------------------------------------------------------------------------------


def test_the_number_of_threads_changes_nothing(machine, noisy):
    one, many = (validate(machine, noisy, phases=[1], jobs=n) for n in (1, 2))
    assert json.dumps(metrics(one)) == json.dumps(metrics(many))


def test_the_report_has_the_figures_of_every_phase(found_noisy, tmp_path):
    page = write_validate_report(found_noisy, tmp_path / "report.html", command="lhpost6 validate made").read_text()
    figures = set(re.findall(r'class="plot" id="([^"]+)"', page))
    wanted = {"forces-TX", "loops-TX", "motion2-TX-x", "motion3-TX-x", "spool_command3-TX-H1", "actuator_force2-WN-V1"}
    wanted |= {f"motion{n}-WN-{axis}" for n in (2, 3) for axis in ("x", "y", "z", "roll", "pitch", "yaw")}
    wanted |= {"valves-H1", "valves-V1"}
    wanted |= {"chamber_pressure_a2-TX-H1", "chamber_pressure_b2-TX-H1", "spectrum1-WN-x", "spectrum2-WN-x"}
    assert wanted <= figures
    assert len(figures) == len(re.findall(r'class="plot" id=', page))  # no name twice
    assert page.count("▲") >= 1 + len(PHASES)  # the key and the worst of each phase
    assert len(page) < 6e6


def test_the_verdict_states_the_largest_error_of_a_single_actuator_too(found_noisy):
    rows = [(p.test, a) for p in found_noisy.phases if p.number == 2 for a in p.agreement if a.moves]
    single = [(t, a) for t, a in rows if a.quantity in ("actuator_force", "chamber_pressure_a", "chamber_pressure_b")]
    test, worst = max(single, key=lambda row: row[1].rrmse_aligned)
    total = max(a.rrmse_aligned for _, a in rows if a.quantity in ("displacement", "acceleration", "wrench"))
    assert worst.rrmse_aligned > 2.0 * total  # forces of actuators against each other move nothing
    words, _ = validation_verdict(found_noisy)
    assert f"of a single actuator {percent(worst.rrmse_aligned)} ({test}, {worst.column}, " in words


def test_the_command_leaves_report_and_metrics(lhpost6, coarse, tmp_path):
    save_campaign(coarse._replace(records=coarse.records[:1]), tmp_path / "in")
    ended = lhpost6("validate", "in", "--out", "out", "--jobs", "1")
    assert ended.code == 0, ended
    found = json.loads((tmp_path / "out" / "metrics.json").read_text(), parse_constant=pytest.fail)  # no NaN, Infinity
    x = found["tests"]["TX"]["closed loop"]["agreement"]["velocity"]["x"]
    assert x["rrmse"] < 1e-5  # low-passed on either side at another rate
    behind = found["tests"]["TX"]["closed loop"]["behind_reference"]["x"]
    assert behind["model"] == pytest.approx(behind["measured"], abs=1e-6)
    assert len(found["valves"]) == 10
    assert found["units"]["drift"] == "the row's unit per second"
    assert x["unit"] == "m/s"
    assert found["tests"]["TX"]["open loop"]["agreement"]["velocity"]["yaw"]["rrmse"] is None
    assert (tmp_path / "out" / "report.html").stat().st_size > 1e6


@pytest.mark.parametrize("phases", ["", "4", "1;2"])
def test_phases_that_do_not_exist_are_refused(lhpost6, phases, tmp_path):
    assert refused(lhpost6("validate", tmp_path, "--phases", phases), "1,2,3")


@pytest.mark.parametrize("name", ["actuator_force", "pressure_difference", "chamber_pressure_a"])
def test_the_mean_of_a_wrench_is_as_uncertain_as_the_sensors_that_its_forces_come_from(table, name):
    """Forces come from load cells, else from pressures times areas; an offset alone shows, as all means are zero."""
    actuator, given = (
        table.actuators[0],
        replace(load_sensors(), gain_range={}, offset_range=dict.fromkeys(LAYOUT, 2.0)),
    )
    names = {"chamber_pressure_a": ("chamber_pressure_a", "chamber_pressure_b")}.get(name, (name,))
    measured = SimpleNamespace(channels={one: np.zeros((4, 1)) for one in names})
    test = SimpleNamespace(basis=SimpleNamespace(sensors=given), plant=make_plant(table), test=measured)
    areas = {"actuator_force": [1.0], "pressure_difference": [actuator.area_a]}.get(
        name, [actuator.area_a, actuator.area_b]
    )
    due = 2.0 / np.sqrt(3.0) * np.linalg.norm(areas)
    assert wrench_calibration(test)[0] == pytest.approx(due, rel=1e-9)  # rounding: the actuator lies along x


def test_a_reason_that_tests_share_is_the_same_for_all(monkeypatch):
    def fails(test):
        raise RecordError(f"{test.test.record.encoding['source']}: has no spool_position")

    monkeypatch.setattr(phases, "_open_loop", fails)
    reasons = set()
    for name in ("TX", "TY"):
        record = xr.Dataset()
        record.encoding["source"] = f"campaign/{name}.nc"
        test = SimpleNamespace(test=SimpleNamespace(record=record, name=name), time=np.zeros(2))
        reasons.add(run_phase(2, test).reason)
    assert reasons == {"has no spool_position"}


def test_only_residuals_above_their_noise_are_marked(found):
    """A record without noise has residuals far below the noise that a sensors file states: nothing is wrong with it."""
    ratio = {"x": 3e-4, "y": 1.0, "z": 2.5}
    phase = next(p for p in found.phases if p.number == 1)
    rows = tuple(a._replace(noise=1.0, error_aligned=ratio.get(a.column, 1.9)) for a in phase.of("wrench"))
    tables = [
        b for b in _residual_blocks(replace(found, phases=(replace(phase, agreement=rows),))) if isinstance(b, Table)
    ]
    cells = next(t for t in tables if "over the noise" in t.caption).rows[0]
    assert [str(cell).startswith("! ") for cell in cells[1:]] == [False, False, True, False, False, False]

"""Records taken apart: exact without noise, left at the noise's level with it, and honest about what is not."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from machine_cases import DATA, machine_named
from run_cases import RATE, every_step
from sensor_cases import measured

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.data.filled_samples import between_gaps
from lhpost6_pin.data.records import load_record, open_record, sample_interval
from lhpost6_pin.data.sensors import add_noise, load_sensors
from lhpost6_pin.identification.decompose import decompose_record, find_agreement, find_work, save_ledger
from lhpost6_pin.identification.decompose.dataset import delivered_by
from lhpost6_pin.identification.inverse_dynamics import leg_wrenches
from lhpost6_pin.show.report.decompose_plots import moved_axes
from lhpost6_pin.show.report.decompose_report import (
    _headlines,
    _verdict,
    match_tables,
    residual_tables,
    write_decompose_report,
)
from lhpost6_pin.simulation.outputs import record_of_run

pytestmark = pytest.mark.long

PRACTICE = {name: DATA / "records" / f"practice_a_{name}.nc" for name in ("TX", "EQ_ridgecrest2019_ccc")}
MACHINE = machine_named("lhpost6")
SENSORS = load_sensors()


@pytest.fixture(scope="module")
def clean():
    """A record of every model step, without noise."""
    return record_of_run(every_step(MACHINE, 1.6, size=0.04), {"test": "shaken", "title": "Shaken"})


@pytest.fixture(scope="module", params=sorted(PRACTICE))
def practice(request):
    """A test of an independent simulator with noisy sensors, nothing hidden in it; and how well it comes apart."""
    found = decompose_record(MACHINE, load_record(PRACTICE[request.param]))
    return found, find_agreement(found)


@pytest.fixture(scope="module")
def triangle():
    return load_record(PRACTICE["TX"])


# ---------------------------------------------------------------------------------------- how well it comes apart
def test_a_simulated_record_at_the_model_step_comes_apart_exactly_and_slower_as_the_scheme_is_staggered(clean):
    exact = decompose_record(MACHINE, clean)
    slow = decompose_record(MACHINE, clean.isel(time=slice(None, None, 4)).assign_attrs(sample_rate_hz=RATE / 4))
    left, slower = (np.abs(x.forces.residual).max() / np.abs(x.forces.measured).max() for x in (exact, slow))
    assert exact.sensors is None and left < 1e-8  # stated bound; 1e-14 found
    assert 1e-8 < slower < 1e-3  # friction marched with steps four times as long
    agreement = find_agreement(exact)
    assert np.nanmax(agreement.actuators.rrmse) < 1e-8 and not agreement.noise.any()
    assert set(agreement.varying_explained) == {"none needed"}


def test_without_noise_an_axis_that_bears_no_force_is_not_judged(clean):
    """A record along x was bad by 2.4e-02 of the force about roll: 0.02 N m of rounding over none."""
    whole = decompose_record(MACHINE, clean)
    forces = SimpleNamespace(measured=whole.forces.measured.copy(), residual=whole.forces.residual.copy())
    found = SimpleNamespace(plant=whole.plant, sensors=None, forces=forces)
    forces.measured[:, 3], forces.residual[:, 3] = 0.0, 5.0  # N m
    words, level = _verdict(found, None)
    assert level == "good" and "(x, y, z, pitch, yaw; the others bear none)" in words
    forces.residual[:, 0] += 1e4
    assert _verdict(found, None)[1] == "bad"


def test_the_card_of_the_worst_error_says_of_which_axes_it_is(practice):
    """2.6 % stood above a table with 55 % in yaw, which hardly moves."""
    found, agreement = practice
    moved = moved_axes(found)
    notes = [one.note for one in _headlines(found, agreement) if one.label.startswith("Worst RRMSE")]
    words = f"of the axes that move ({', '.join(moved)}), not those almost at rest"
    assert len(notes) == 2 and all((words in note) == (len(moved) < 6) for note in notes)


def test_with_noise_the_residual_is_at_the_noises_level_in_every_axis(practice):
    _, agreement = practice
    assert (agreement.noise_ratio > 0.9).all()  # 40 s x 33 Hz know a standard deviation to 3 %
    assert (agreement.noise_ratio < 1.0 + SENSORS.noise_range).all()
    assert set(agreement.varying_explained) == {"noise"}
    assert set(agreement.offset_explained) <= {"noise", "sensors"}


def test_where_axes_move_modelled_forces_follow_measured_ones(practice):
    _, agreement = practice
    assert agreement.actuators.rrmse[0] < 0.03
    assert agreement.actuators.rrmse_varying[0] < 0.01
    assert agreement.dissipative.rrmse_varying[0] < 0.03
    assert agreement.struts is not None and agreement.struts.rrmse[2] < 0.005  # pressure gains to 0.5 %
    assert agreement.actuators.peak_ratio[0] == pytest.approx(1.0, abs=0.05)
    assert abs(agreement.actuators.delay[0]) < 6e-4  # two skews of 0.3 ms


def test_a_parameter_that_is_wrong_shows_above_noise_and_sensors(triangle):
    wrong = MACHINE.with_params({"horizontal.seal_friction": 2 * 9250.0})
    agreement = find_agreement(decompose_record(wrong, triangle))
    assert agreement.noise_ratio[0] > 5
    assert agreement.varying_explained[0] in ("parameters", "nothing")
    assert agreement.varying_explained[2:4] == ("noise", "noise")  # z and roll have no part in it


# ---------------------------------------------------------------------------------------- what is to be expected
def test_noise_of_the_forces_alone_is_what_the_legs_make_of_it(triangle):
    only = replace(SENSORS, noise={"actuator_force": SENSORS.noise["actuator_force"]})
    found = decompose_record(MACHINE, triangle, only, align=False)
    unit = leg_wrenches(found.plant, found.plant.zero_state().q[None], np.ones((1, 10)))[0]
    f = np.linspace(0, 256, 4097)
    kept = np.trapezoid(only.noise_spectrum("actuator_force", f)[:, 0] * found.comparison.band.gain(f) ** 2, f)
    expected = np.sqrt(kept * np.sum(unit**2, axis=0))
    # 2 x 33 Hz x 10 s independent values: 3 %; legs turn by 0.2 m of 5
    np.testing.assert_allclose(find_agreement(found).noise, expected, rtol=0.12)


def test_offsets_and_gains_of_vertical_forces_add_in_squares(practice):
    found, agreement = practice
    vertical = found.whole.component_force[:, 4:10].mean(axis=0)
    spread = np.sqrt(
        6 * SENSORS.offset_sd("actuator_force") ** 2 + SENSORS.gain_sd("actuator_force") ** 2 * vertical @ vertical
    )
    assert agreement.sensors.offset[2] == pytest.approx(spread, rel=0.02)  # and a little from the horizontal ones


# ---------------------------------------------------------------------------------------- where things come from
def test_skews_are_taken_out_unless_asked_not_to(triangle):
    plain, aligned = decompose_record(MACHINE, triangle, align=False), decompose_record(MACHINE, triangle)
    assert not plain.delays and plain.record is triangle
    assert "actuator_displacement" in aligned.delays and "Skews removed" in " ".join(aligned.notes)
    assert "aligned" in aligned.record.attrs


def test_a_skew_beyond_the_stated_ranges_is_warned_of(triangle, caplog):
    decompose_record(MACHINE, triangle)
    assert "shifted back" not in caplog.text
    late = triangle.copy(deep=True)
    late["platen_acceleration"].values[:] = np.roll(late["platen_acceleration"].values, 10, axis=0)
    decompose_record(MACHINE, late)
    said = "platen_acceleration is 19.3 ms behind platen_displacement, where the sensors' ranges allow 0.6"
    assert said in caplog.text


def test_pressures_stand_in_for_forces(triangle):
    found = decompose_record(MACHINE, triangle.drop_vars("actuator_force"))
    assert "P_A A_1" in found.notes[0]
    agreement = find_agreement(found)
    assert agreement.actuators.rrmse_varying[0] < 0.02
    assert set(agreement.offset_explained) <= {"noise", "sensors"}


def test_without_strut_pressures_the_models_struts_stand_in(triangle):
    found = decompose_record(MACHINE, triangle.drop_vars("strut_pressure"))
    assert find_agreement(found).struts is None
    left = found.forces.dissipative_measured - found.forces.dissipative
    np.testing.assert_allclose(left, found.forces.residual, atol=1e-6)  # rounding of meganewtons


def test_one_axis_comes_apart_too(tmp_path):
    machine = machine_named("uniaxial")
    clean = record_of_run(every_step(machine, 1.6, size=0.04), {"test": "one"})
    clean = clean.isel(time=slice(None, None, 4)).assign_attrs(sample_rate_hz=RATE / 4)
    found = decompose_record(machine, add_noise(clean, SENSORS, np.random.default_rng(0)), sensors=SENSORS)
    agreement = find_agreement(found)
    assert agreement.noise_ratio[0] == pytest.approx(1.0, abs=0.3)  # 2 x 33 Hz x 1.1 s: 8 % each
    page = write_decompose_report(found, agreement, find_work(found), tmp_path / "page.html")
    assert "Axis" in page.read_text()


# ---------------------------------------------------------------------------------------- work
def test_all_effects_and_the_rest_add_up_to_the_inertia(practice):
    found, _ = practice
    effects, wrench = delivered_by(found)
    assert effects[-1] == "unexplained"
    np.testing.assert_allclose(wrench.sum(axis=1), found.forces.ledger.inertia, atol=1e-7)  # of meganewtons


def test_energy_is_balanced_and_friction_takes_it(practice):
    found, _ = practice
    work = find_work(found)
    spent = dict(zip(work.effects, work.energy[-1], strict=True))
    assert spent["actuators_4_way"] > 1e5
    assert all(spent[name] < 0 for name in ("seal_friction", "pad_friction", "viscous"))
    assert abs(spent["unexplained"]) < 0.005 * spent["actuators_4_way"]  # gains of forces
    # trapezoids at 512 Hz of what moves at 10 Hz, (2 pi 10 / 512)^2 / 12 = 1e-3
    assert np.abs(work.unbalanced).max() < 2e-3 * np.abs(work.kinetic).max()


# ---------------------------------------------------------------------------------------- on disk
def test_the_ledger_is_written_with_names_and_units(practice, tmp_path):
    found, _ = practice
    save_ledger(found, tmp_path / "ledger.nc", source="here.nc")
    data = open_record(tmp_path / "ledger.nc")
    assert {"time", "effect", "component", "axis"} <= set(data.dims)
    np.testing.assert_allclose(data.wrench.sum("effect"), data.inertia, atol=1e-7)
    np.testing.assert_array_equal(data.required - data.measured, data.residual)
    assert all(v.attrs["units"] and v.attrs["long_name"] for v in data.data_vars.values())
    assert data.attrs["record"] == "here.nc" and data.attrs["cutoff_hz"] == 33.0
    assert data.attrs["machine"] == "LHPOST6" and "fused" in data.attrs["made_from"]
    assert [p.name for p in tmp_path.iterdir()] == ["ledger.nc"]


def test_the_command_leaves_ledger_and_report_and_says_what_is_left(lhpost6, tmp_path):
    ended = lhpost6("decompose", PRACTICE["TX"], "--out", tmp_path, "--cutoff", "20", "--no-align")
    assert ended.code == 0, ended
    assert "up to 20 Hz" in ended.words and "Sufficient explanation" in ended.words
    page = (tmp_path / "report.html").read_text()
    assert "at noise level" in page and "Dissipative force" in page
    assert open_record(tmp_path / "ledger.nc").attrs["cutoff_hz"] == 20.0


@pytest.mark.slow  # forty seconds at the rate of a record; test_report has as many samples on a page of a run
def test_a_page_of_forty_seconds_stays_small(plant, tmp_path):
    record, _ = measured(plant, duration=40.0)
    noisy = add_noise(record, SENSORS, np.random.default_rng(0)).assign_attrs(kind="measured")
    found = decompose_record(plant.machine, noisy)
    agreement = find_agreement(found)
    assert "nothing" in agreement.varying_explained  # its pressures follow no dynamics
    page = write_decompose_report(found, agreement, find_work(found), tmp_path / "page.html")
    assert page.stat().st_size < 6e6
    assert "an effect is missing, or a sensor is wrong" in page.read_text()


# ---------------------------------------------------------------------------------------- what cannot be
@pytest.mark.parametrize(
    ("lost", "message"),
    [
        (["actuator_force", "chamber_pressure_a"], "neither actuator_force nor chamber_pressure_a"),
        (["actuator_force", "chamber_pressure_b"], "no chamber_pressure_b"),
        (["actuator_displacement", "platen_displacement"], "neither actuator_displacement nor platen_displacement"),
        (["platen_velocity"], "no platen_velocity"),
    ],
)
def test_what_a_record_lacks_is_named(triangle, clean, lost, message):
    with pytest.raises(RecordError, match=message):
        decompose_record(MACHINE, (clean if "platen_velocity" in lost else triangle).drop_vars(lost))


@pytest.mark.parametrize("channel", ["actuator_force", "platen_acceleration", "strut_pressure"])
def test_a_sample_that_is_no_number_is_named(triangle, channel):
    holed = triangle.copy(deep=True)
    holed[channel][1234, 1] = np.nan
    with pytest.raises(RecordError, match=rf"{channel}\[\w+\] at sample 1234 is not finite"):
        decompose_record(MACHINE, holed)


def test_records_of_other_machines_specimens_and_too_short_ones_are_refused(triangle):
    for machine, record, options, message in (
        (machine_named("uniaxial"), triangle, {}, "name its machine with --machine"),
        (MACHINE, triangle.assign_attrs(specimen="tower"), {}, "mount it with --specimen"),
        (MACHINE, triangle.isel(time=slice(0, 600)), {}, "too short"),
        (MACHINE, triangle, {"cutoff": 0.0}, "cutoff must be above zero"),
        (MACHINE, triangle, {"cutoff": 0.75 / sample_interval(triangle)}, "show nothing above .* give a cutoff below"),
    ):
        with pytest.raises(RecordError, match=message):
            decompose_record(machine, record, **options)


def test_the_tutorial_names_the_tables_and_columns_that_are_printed(practice):
    found, agreement = practice
    tables = [*residual_tables(found, agreement), *match_tables(found, agreement)]
    page = (Path(__file__).parents[1] / "scripts/docs/pages/tutorials/forces.md").read_text()
    first, mean, total, *_ = (table.caption for table in tables)
    named = [page.index(f"*{title.partition(':')[0]}*") for title in (first, mean, total)]
    assert named == sorted(named)
    assert all(f"*{column}*" in page for column in ("Ratio", "Sensors", "Parameters", "Sufficient explanation"))
    assert set(tables[0].header) >= {"Ratio", "Sensors", "Parameters", "Sufficient explanation"}


def test_a_record_with_a_long_gap_that_was_filled_is_compared_in_its_longest_stretch(triangle, caplog):
    """Interpolated samples were residuals: an effect "missing" in every axis, and healthy sensors "suspicious"."""
    gap = slice(2000, 2100)
    broken = triangle.copy(deep=True)
    for name in broken.data_vars:  # as an import fills it, but for the spline
        values = broken[name].values
        values[gap] = np.linspace(values[gap.start], values[gap.stop], 100, endpoint=False)
    filled = broken.assign_attrs(filled_samples="100 from 2000")
    found = decompose_record(MACHINE, filled)
    assert "100 samples are interpolated" in caplog.text and any("longest stretch" in note for note in found.notes)
    assert (
        find_agreement(found).noise_ratio.max()
        < 1.5
        < find_agreement(decompose_record(MACHINE, broken)).noise_ratio.max()
    )
    short = triangle.assign_attrs(filled_samples="10 from 2000")  # 0.02 s
    assert between_gaps(short) is short

"""Rehearsing a motion in closed loop and replaying a record's spools in open loop."""

import re

import numpy as np
import pytest
from machine_cases import DATA, PENDULUM, machine_named

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import OutOfRangeError, ParameterError, RecordError, SimulationError
from lhpost6_pin.core.names import ENGINES, SAMPLE_RATE
from lhpost6_pin.data.records import load_record, thinned
from lhpost6_pin.data.signals import rrmse
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.valve_delay import delayed_spools
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.report.run_report import write_run_report
from lhpost6_pin.simulation.motion_limits import check_motion_limits
from lhpost6_pin.simulation.rehearse import rehearse, replay
from lhpost6_pin.simulation.simulate import OpenLoop, simulate

pytestmark = pytest.mark.long

RECORDS = DATA / "records"


def sine_target(scale=1.0, **options):
    """Two cycles along X, some 10 s with the rest at both ends."""
    return make_target(
        find_motion("sine", **{"amplitude": 0.05, "cycles": 1, "ramp_cycles": 0.5, **options}), scale=scale
    )


def rehearsal(target=None, machine=None, **options):
    """A rehearsal with the shipped settings, on the LHPOST6 unless given another."""
    controller, options = load_controller("lhpost6"), {"attrs": {}, "engine": "fused", **options}
    return rehearse(machine or load_machine(), target or sine_target(), controller, **options)


def replayed(record, **options):
    return replay(load_machine(), record, **{"attrs": {}, "engine": "fused", **options})


@pytest.fixture(scope="module")
def rehearsed():
    return rehearsal()


@pytest.fixture(scope="module")
def practice():
    return load_record(RECORDS / "practice_a_TX.nc")


# Rest -----------------------------------------------------------------------------------------------------------------


ECCENTRIC = load_machine().with_specimen(PENDULUM, position=(2.0, 1.0, 0.0), locked=True)


@pytest.mark.parametrize("machine", [*map(machine_named, ("lhpost6", "stewart", "uniaxial")), ECCENTRIC])
def test_a_zero_target_keeps_the_platen_at_rest_for_ten_seconds(machine):
    controller = load_controller("uniaxial" if machine.name == "uniaxial" else "lhpost6")
    test = rehearse(machine, sine_target(scale=0.0), controller, attrs={}, engine="fused")
    assert test.run.time[-1] >= 10.0
    # required: 1e-6 m. What rounding of the pressures leaves is far less
    assert np.abs(test.record["platen_displacement"].values).max() < 1e-9


# Limits ---------------------------------------------------------------------------------------------------------------


def test_a_guided_machine_refuses_what_it_cannot_move_and_says_what_to_choose():
    plant = make_plant(machine_named("uniaxial"))
    with pytest.raises(OutOfRangeError, match=r"uniaxial cannot move in y, z; choose with --axes x"):
        check_motion_limits(plant, make_target(find_motion("ridgecrest"), scale=0.1))
    summary = check_motion_limits(plant, make_target(find_motion("ridgecrest"), scale=0.1, axes="x"))
    assert summary.utilisation["displacement"]["x"] == pytest.approx(0.1 / 0.584, rel=2e-3)  # three digits of a scale


@pytest.mark.parametrize("name", ["lhpost6", "stewart", "uniaxial"])
def test_the_scale_that_a_refusal_names_fits_and_the_next_does_not(name):
    plant = make_plant(machine_named(name))
    with pytest.raises(OutOfRangeError) as caught:
        check_motion_limits(plant, sine_target(amplitude=5.0))
    fits = float(re.search(r"scale that fits is ([\d.e+-]*\d)", str(caught.value)).group(1))
    assert check_motion_limits(plant, sine_target(amplitude=5.0, scale=fits)).highest[2] <= 1.0 + 1e-6
    with pytest.raises(OutOfRangeError):
        check_motion_limits(plant, sine_target(amplitude=5.0, scale=1.01 * fits))


def test_two_valves_carry_what_one_cannot():
    target = sine_target(amplitude=0.7, period=2.0)  # 2.2 m/s
    with pytest.raises(OutOfRangeError, match="H1 actuator velocity"):
        check_motion_limits(make_plant(load_machine()), target)
    check_motion_limits(make_plant(load_machine().with_valves(2)), target)


def test_rehearsing_beyond_limits_is_refused_before_anything_runs_unless_asked_for():
    called = []
    with pytest.raises(OutOfRangeError):
        rehearsal(sine_target(amplitude=5.0), progress=called.append)
    assert not called
    test = rehearsal(sine_target(amplitude=5.0), beyond_limits=True)
    assert test.run.trouble is not None or test.run.clipped > 0


# What a rehearsal leaves ----------------------------------------------------------------------------------------------


def test_the_platen_follows_its_target(rehearsed):
    record = rehearsed.record
    achieved, asked = record["platen_displacement"].values[:, 0], record["reference_displacement"].values[:, 0]
    assert rrmse(asked, achieved) < 0.25  # a delay of 25 ms alone is 2 pi 0.025 = 16 % of a sine of 1 s
    assert np.abs(record["platen_displacement"].values[:, 1]).max() < 1e-12  # by symmetry


def test_the_record_is_thinned_without_touching_the_simulation(rehearsed, tmp_path):
    thin = rehearsal(record_every=16)
    assert thin.record.attrs["sample_rate_hz"] == 128
    for name in ("platen_displacement", "chamber_pressure_a", "spool_command", "reference_acceleration"):
        assert np.array_equal(thin.record[name].values, rehearsed.record[name].values[::16])
    assert thinned(rehearsed.record, 16).identical(thin.record)  # the same afterwards
    assert rehearsed.record.attrs["sample_rate_hz"] == 2048  # thinning changes nothing of the whole record
    assert thin.record.attrs["thinned_from_hz"] == 2048 and "thinned_from_hz" not in rehearsed.record.attrs
    assert thinned(thin.record, 2).attrs["thinned_from_hz"] == 2048
    write_run_report(thin.record, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "at 128 samples a second (thinned from 2048 without a filter: peaks" in page
    few = rehearsed.record.isel(time=slice(0, 10))
    assert thinned(few, 16).identical(few)  # a record needs two samples


@pytest.mark.parametrize("engine", ENGINES)
def test_progress_rises_to_one(engine):
    shares = []
    rehearsal(engine=engine, steps_per_second=SAMPLE_RATE, progress=shares.append)
    assert len(shares) > 5 and shares == sorted(shares) and shares[-1] == 1.0


def test_a_run_that_diverges_keeps_what_was_finite_in_a_valid_record():
    """The report's Euler at 2048 Hz: its last state may hold numbers that are none."""
    test = rehearsal(scheme="euler", steps_per_second=SAMPLE_RATE)
    assert test.run.trouble and test.record.attrs["trouble"] == test.run.trouble
    assert 1000 < test.record.sizes["time"] < len(sine_target().time)
    for name, variable in test.record.data_vars.items():
        assert np.isfinite(variable.values).all(), name
    assert len(test.run.time) == len(test.run.command) == test.record.sizes["time"]


# Replay ---------------------------------------------------------------------------------------------------------------


def test_replay_of_a_rehearsal_at_the_controllers_rate_is_the_rehearsal():
    """One step a sample: the recorded positions are all that the ports saw, and pressures start the same."""
    test = rehearsal(steps_per_second=SAMPLE_RATE)
    again = replayed(test.record, steps_per_second=SAMPLE_RATE)
    assert again.record.attrs["spool_interpolation"] == "held"
    assert np.array_equal(again.run.q, test.run.q) and np.array_equal(again.run.z, test.run.z)


def test_replay_of_a_rehearsal_at_a_finer_step_differs_by_what_moves_within_a_sample(rehearsed):
    """The 5 ms delay is 10.24 samples, so the spools move 0.24 of a sample after each one.

    A record has one position a sample, the mean. Held, it lets the same oil through, but not at the same instant
    within the sample: 0.05 um of 50 mm (with the position at each sample's start it would be 0.1 mm, late by 0.76 of
    a sample). With the positions at every step the replay is the rehearsal, bit for bit.
    """
    run, record = rehearsed
    again = replayed(record)
    difference = np.abs(again.record["platen_displacement"].values - record["platen_displacement"].values)
    assert difference.max() < 5e-7  # ten times what it is
    steps = run.steps_per_second // SAMPLE_RATE
    exact = np.zeros((len(run.time) * steps, run.plant.spools))
    for sample in range(len(run.time)):
        window = exact[sample * steps : (sample + 1) * steps]
        delayed_spools(run.command, 0, sample, run.plant.delays, float(SAMPLE_RATE), window)
    start = find_equilibrium(run.plant).state
    same = simulate(run.plant, OpenLoop(exact, start), samples=len(run.time), engine="fused")
    assert np.array_equal(same.q, run.q) and np.array_equal(same.z, run.z)


def test_simulated_records_at_the_controllers_rate_are_held_and_all_others_interpolated(rehearsed, practice):
    simulated = rehearsed.record.isel(time=slice(8192, 8192 + 600))
    measured = simulated.assign_attrs(kind="measured")
    slower = simulated.isel(time=slice(None, None, 4))
    for record, how in (
        (simulated, "held"),
        (measured, "band-limited"),
        (slower, "band-limited"),
        (practice.isel(time=slice(0, 64)), "band-limited"),
    ):
        test = replayed(record, steps_per_second=SAMPLE_RATE)
        assert test.record.attrs["spool_interpolation"] == how
        if how == "held":
            assert np.array_equal(test.run.spool, record["spool_position"].values)


def test_spools_in_per_cent_are_refused_with_the_channel_the_sample_and_the_likely_mistake(practice):
    percent = practice.assign(spool_position=100.0 * practice["spool_position"])
    peak = percent["spool_position"].isel(
        actuator=int(np.abs(percent["spool_position"]).max("time").argmax("actuator"))
    )
    sample = int(np.abs(peak.values).argmax())
    said = (
        rf"spool_position\[{peak.actuator.item()}\] reaches {np.abs(peak.values).max():.4g}: V or % .*sample {sample}"
    )
    with pytest.raises(RecordError, match=said):
        replayed(percent)


@pytest.mark.parametrize("steps", [1, 4])
def test_interpolated_spools_are_the_signal_in_the_middle_of_each_step(practice, steps):
    """A sine of 31 Hz at 512 samples a second, between whose samples nothing was recorded."""
    t = np.arange(512) / 512

    def spool(time):
        return 0.02 * np.outer(np.sin(2 * np.pi * 31 * time), np.linspace(0.1, 1.0, 10))

    positions = (("time", "actuator"), spool(t), practice["spool_position"].attrs)
    record = practice.isel(time=slice(0, 512)).assign(spool_position=positions)
    test = replayed(record, steps_per_second=steps * SAMPLE_RATE)
    middles = [(j + 0.5) / (steps * SAMPLE_RATE) for j in range(steps)]
    expected = np.mean([spool(test.run.time + middle) for middle in middles], axis=0)  # a record has the mean
    inside = slice(100, -100)  # 24 samples of the old rate at each end are continued by reflection
    # the interpolation is good to 1e-7 of the amplitude
    assert np.abs(test.run.spool[inside] - expected[inside]).max() < 5e-9


def test_replay_of_a_practice_record_follows_it_as_well_as_its_own_effects_allow(practice):
    """Another simulator's test with sensor noise: another step and a filter, 0.7 mm of 200 mm after 11 s."""
    runs = [replayed(practice, engine=engine) for engine in ENGINES]
    for run, record in runs:
        assert run.trouble is None
        t = practice["time"].values
        model = record["platen_displacement"].interp(time=t[t <= record["time"].values[-1]]).values[:, 0]
        assert rrmse(practice["platen_displacement"].values[: len(model), 0], model) < 0.01
    assert np.abs(runs[0].run.q - runs[1].run.q).max() < 1e-10  # two engines, one result


def test_channels_are_taken_by_name_whatever_their_order_and_as_many_valves_opened_as_the_record_says(rehearsed):
    record = rehearsed.record.isel(time=slice(8192, 8192 + 256))
    turned = record.isel(actuator=slice(None, None, -1), horizontal=slice(None, None, -1)).transpose()
    a, b = (replayed(r) for r in (record, turned))
    assert np.array_equal(a.run.q, b.run.q) and np.array_equal(a.run.z, b.run.z)
    test = replayed(record.assign_attrs(valves_per_horizontal_actuator=2))
    assert {a.valves for a in test.run.plant.machine.actuators if a.area_b is not None} == {2}
    assert test.record.attrs["valves_per_horizontal_actuator"] == 2


@pytest.mark.parametrize("name", ["spool_position", "chamber_pressure_a", "chamber_pressure_b"])
def test_a_record_without_what_a_replay_needs_says_so_by_name(practice, name):
    with pytest.raises(RecordError, match=f"has no {name}"):
        replay(load_machine(), practice.drop_vars(name), attrs={})


def test_a_record_of_two_samples_can_be_replayed_and_a_run_over_at_once_says_why(rehearsed, practice):
    record = practice.isel(time=slice(0, 64)).copy(deep=True)
    two = replayed(rehearsed.record.isel(time=slice(0, 2)))
    assert np.abs(two.record["platen_displacement"].values).max() < 1e-12
    record["chamber_pressure_a"][0] = 1e12
    for engine in ENGINES:
        with pytest.raises(SimulationError, match=r"stopped at 0\.\d+ s: V1 left its stroke"):
            replayed(record, engine=engine)


# Valves ---------------------------------------------------------------------------------------------------------------


def test_valves_are_opened_on_double_acting_actuators_only():
    machine = load_machine()
    assert machine.with_valves(0) is machine
    for count in (1, 2):
        changed = machine.with_valves(count)
        assert [a.valves for a in changed.actuators] == [count] * 4 + [a.valves for a in machine.actuators[4:]]
    assert [a.valves for a in machine.actuators][:4] == [1] * 4  # a copy was changed
    with pytest.raises(ParameterError, match="valves"):
        machine.with_valves(-1)

"""Friction's state at the start of a test: taken out of the residuals, as if it were one more unknown."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.core.names import AXES, SAMPLE_RATE
from lhpost6_pin.data.campaign import Campaign
from lhpost6_pin.data.records import load_record, save_record
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.effects.registry import law_of, states_of
from lhpost6_pin.identification.calibration import calibration_numbers
from lhpost6_pin.identification.calibration.normal_equations import NoiseBias, NormalEquations
from lhpost6_pin.identification.calibration.operating_point import OperatingPoint
from lhpost6_pin.identification.calibration.prepare import policy_of, prepare_problem
from lhpost6_pin.identification.calibration.sparse_bins import sparse_bins
from lhpost6_pin.identification.calibration.start_states import no_start_states, start_states
from lhpost6_pin.identification.decompose.agreement import find_agreement
from lhpost6_pin.identification.decompose.record import decompose_record
from lhpost6_pin.identification.friction_start import estimate_start, largest_share, start_wrenches
from lhpost6_pin.identification.inverse_dynamics import leg_wrenches
from lhpost6_pin.identification.prepare import AS_RECORDED, prepare_test
from lhpost6_pin.identification.residuals import evaluate_residuals, follow
from lhpost6_pin.identification.validation import validate
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import plant_motion
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.report.decompose_report import EXACT
from lhpost6_pin.simulation.rehearse import rehearse, replay
from lhpost6_pin.simulation.simulated_campaign import SensorErrors, as_sensed, simulate_campaign

RECORDS = Path(__file__).parent / "data" / "records"


def power(bins):
    return float(np.sum(np.abs(bins) ** 2))


@pytest.fixture(scope="module")
def problem():
    record = load_record(RECORDS / "practice_a_TX.nc")
    return prepare_problem(load_machine("lhpost6"), [record], load_sensors("lhpost6"), calibration_numbers())


@pytest.fixture(scope="module")
def base(problem):
    return OperatingPoint(problem, np.zeros(len(problem.names)))


def real_rows(bins):
    return np.concatenate([part(bins).reshape(-1, bins.shape[2]) for part in (np.real, np.imag)])


def test_what_remains_is_the_residual_of_the_estimate_with_the_states_as_unknowns():
    """Its power is the least of |r - D a|^2 + |a|^2, to rounding."""
    rng = np.random.default_rng(0)
    change, bins = (rng.standard_normal((12, 4, 3)) + 1j * rng.standard_normal((12, 4, 3)) for _ in range(2))
    change[:, 1] = 0.0  # a column in which the states do not show
    known, target = np.vstack([real_rows(change), np.eye(3)]), np.vstack([real_rows(bins), np.zeros((3, 3))])
    least = np.sum((target - known @ np.linalg.lstsq(known, target, rcond=None)[0]) ** 2, axis=0)
    remains = start_states(sparse_bins(change)).less(sparse_bins(bins)).full(4)
    np.testing.assert_allclose([power(remains[..., k]) for k in range(3)], least, rtol=1e-9)
    np.testing.assert_array_equal(remains[:, 1], bins[:, 1])


def test_weights_that_change_scale_what_remains():
    rng = np.random.default_rng(1)
    change, bins = (rng.standard_normal((12, 4, 3)) + 1j * rng.standard_normal((12, 4, 3)) for _ in range(2))
    scale = rng.uniform(0.5, 2.0, (12, 4))
    states, seen = start_states(sparse_bins(change)), sparse_bins(bins * scale[..., None])
    again, remains = (one.full(4) for one in (states.scaled(scale).less(seen), states.less(sparse_bins(bins))))
    np.testing.assert_allclose(again, remains * scale[..., None], rtol=0.0, atol=1e-12)  # rounding


def test_what_was_taken_out_is_restored():
    """To rounding, of directions of which nine tenths and nearly all were taken out."""
    rng = np.random.default_rng(3)
    change, bins = (rng.standard_normal((12, 4, 3)) + 1j * rng.standard_normal((12, 4, 3)) for _ in range(2))
    states = start_states(sparse_bins(change * [1.0, 30.0, 1000.0]))
    again = states.restored(states.less(sparse_bins(bins))).full(4)
    np.testing.assert_allclose(again, bins, rtol=0.0, atol=1e-9)


def test_equations_with_the_states_of_another_plant_are_those_evaluated_with_it(problem):
    """Of friction that yields over twice the slip, with their correction for noise; to rounding."""
    x, report = np.zeros(len(problem.names)), lambda share: None
    softer = {f"{kind}.{key}": 2.0 for kind in ("horizontal", "vertical") for key in ("seal_yield", "pad_yield")}
    parameters = problem.machine.parameters
    changes = {path: factor * parameters.number(path) for path, factor in softer.items() if path in parameters}
    plant = make_plant(problem.machine.with_params(changes))

    def evaluated(own):
        normal = NormalEquations(own, x, report)
        return normal.less(NoiseBias(normal, x, [report] * len(own.again)))

    before, due = evaluated(problem), evaluated(problem.restarted(plant))
    found = before.restarted(plant)
    matrix, side = due.whole
    assert abs(before.whole[0] - matrix).max() > 1e-3 * abs(matrix).max()
    np.testing.assert_allclose(found.whole[0], matrix, rtol=0.0, atol=1e-9 * abs(matrix).max())
    np.testing.assert_allclose(found.whole[1], side, rtol=0.0, atol=1e-9 * abs(side).max())


@pytest.mark.parametrize("prepare", [policy_of(calibration_numbers()), AS_RECORDED._replace(edge=0.25)])
def test_noise_of_the_first_sample_is_no_travel(base, prepare):
    """A motion fused from sensors begins at the noise of its first sample: what is held is not lost from there.

    A first sample that is off by 50 micrometres moved states by a sixth of full friction.
    """
    record = load_record(RECORDS / "practice_a_TX.nc")
    other = record.copy(deep=True)
    other["platen_displacement"].values[0, :3] += 5e-5
    states = []
    for one in (record, other):
        test = prepare_test(base.plant, one, load_sensors("lhpost6"), prepare)
        z = follow(base.plant, test, start=drawn(base.plant, 0.8)).z
        states.append(z[test.settled : test.settled + 50])
    assert abs(states[0]).max() > 0.5
    assert abs(states[0] - states[1]).max() < 0.01


def test_columns_in_which_no_state_shows_are_left_as_they_are():
    rng = np.random.default_rng(2)
    change, bins = (rng.standard_normal((12, 4, 3)) + 0j for _ in range(2))
    change[:, :2], bins[:, 2:] = 0.0, 0.0
    some = sparse_bins(bins)
    assert start_states(sparse_bins(change)).less(some) is some
    bins[:, 3] = 1.0  # in one column of theirs: what remains is in both
    np.testing.assert_array_equal(start_states(sparse_bins(change)).less(sparse_bins(bins)).columns, [0, 1, 2, 3])


def test_a_test_without_forces_is_left_as_it_is(base):
    test = without_forces(base.tests[0])
    assert start_wrenches(base.plant, test)[0].shape == (test.samples, 6, 0)
    assert not estimate_start(base.plant, test, 30.0).any()
    some = sparse_bins(np.ones((7, 3, 1), complex))
    assert no_start_states().less(some) is some


def without_forces(test):
    kept = {name: values for name, values in test.channels.items() if "force" not in name and "pressure" not in name}
    return replace(test, channels=kept)


def drawn(plant, share):
    """States at the start, up to a share of full friction."""
    rng, start = np.random.default_rng(1), np.zeros(len(plant.states))
    for row in plant.rows:
        if law_of(row).friction_memory:
            own = states_of(row)
            start[own] = share * rng.uniform(-1.0, 1.0, own.stop - own.start) / np.sqrt(own.stop - own.start)
    return start


@pytest.mark.parametrize("share", [0.2, 0.8])
def test_what_seals_and_pads_hold_at_the_start_is_no_residual(problem, base, share):
    """Friction's law is nearly linear in the state: of that less than a twentieth remains, of noise nearly all."""
    plant, test = base.plant, base.tests[0]
    after = evaluate_residuals(plant, test, problem.kinds, path=follow(plant, test, start=drawn(plant, share)))
    change = problem.bins(after, test)[0] - problem.bins(base.residuals[0], test)[0]
    white = problem.whitener.apply(0, sparse_bins(change), problem.frequency[0])
    remains = problem.whitened(0, sparse_bins(change))
    assert power(white.bins) > 30.0 * share**2
    assert (
        power(remains.bins) < 0.05 * power(white.bins) + 3.0 * share**2
    )  # priors allow for one deviation of every state
    rng = np.random.default_rng(2)
    noise = sparse_bins(rng.standard_normal(change.shape) + 1j * rng.standard_normal(change.shape))
    assert power(problem.starts[0].less(noise).bins) > 0.99 * power(noise.bins)


def full(plant):
    """All of the friction held at the start, in directions of chance."""
    start = drawn(plant, 1.0)
    for row in plant.rows:
        if law_of(row).friction_memory:
            start[states_of(row)] /= np.linalg.norm(start[states_of(row)])
    return start


def moved(plant, test, start):
    """The test with the forces of one that began with states (n_states,) of its own; residual wrench (n, 6) without."""
    rest = evaluate_residuals(plant, test, ("wrench",)).wrench
    more = evaluate_residuals(plant, test, ("wrench",), path=follow(plant, test, start=start)).wrench - rest
    arms = leg_wrenches(plant, plant_motion(plant, test.motion).q, np.ones((test.samples, plant.spools)))
    force = test.channels["actuator_force"] + np.einsum("ni,nik->nk", more, np.linalg.pinv(arms))
    return replace(test, channels=test.channels | {"actuator_force": force}), rest


@pytest.mark.parametrize("held", [lambda plant: drawn(plant, 0.8), full], ids=["part", "full"])
def test_the_balance_of_forces_shows_what_is_held_at_the_start(base, held):
    """Forces of a test that began with states of its own, from the motion and forces of one that did not.

    From full friction on the force is no linear function of the state: what remains is within a twentieth of the noise.
    """
    plant, test = base.plant, base.tests[0]
    began, rest = moved(plant, test, held(plant))
    found = estimate_start(plant, began, 30.0)
    after = evaluate_residuals(plant, began, ("wrench",), path=follow(plant, began, start=found)).wrench
    before = evaluate_residuals(plant, began, ("wrench",)).wrench
    spreads = [x[:, plant.axes].std(axis=0) for x in (before, after, rest)]  # means may be offsets of the load cells
    assert np.all(spreads[1] < 1.05 * spreads[2]) and np.any(spreads[0] > 1.5 * spreads[2])


def test_a_test_that_began_at_rest_is_left_as_it_is(base):
    """Of single states that hardly show, noise may suggest a part; of the wrench less than its noise."""
    plant, test = base.plant, base.tests[0]
    path = follow(plant, test, start=estimate_start(plant, test, 30.0))
    rest, after = (evaluate_residuals(plant, test, ("wrench",), path=p).wrench for p in (base.paths[0], path))
    for axis in set(plant.axes) - {AXES.index("pitch")}:  # where vertical seals, too, follow the noise of the path
        assert (after - rest)[:, axis].std() < 0.5 * rest[:, axis].std()
    assert np.all(after.std(axis=0) < 1.02 * rest.std(axis=0))


# ---------------------------------------------------------------------------------------------- records without noise
@pytest.fixture(scope="module")
def run():
    """A simulated sine along X, in closed loop from rest."""
    target = make_target(find_motion("sine", amplitude=0.03, period=1.0, cycles=2.0), rate=float(SAMPLE_RATE))
    test = {"test": "sine"}
    return rehearse(load_machine(), target, load_controller("lhpost6"), attrs=test, engine="fused").record


AMID = 7 * SAMPLE_RATE  # sample of the run, in its motion


def second(record, begin=AMID):
    """What a recording that began in the motion holds: no hidden states."""
    late = record.isel(time=slice(begin, None))
    late = late.assign_coords(time=late["time"] - late["time"][0])
    return late.drop_vars([name for name in late if name.startswith("hidden_")])


def friction_of(record, plant, sample):
    """Hidden states (n_states,) of a run at a sample."""
    own = np.concatenate([record[f"hidden_{kind}"].values[sample] for kind in ("seal_friction", "pad_friction")])
    return np.concatenate([np.zeros(len(plant.states) - len(own)), own])


@pytest.mark.parametrize("begin", [AMID, AMID + 700])
def test_a_recording_that_began_after_a_motion_is_as_exact_as_the_run_from_rest(run, begin):
    """Friction holds most of its force there; the residual is that of the run itself, with its own states."""
    plant = make_plant(load_machine())
    test = prepare_test(plant, second(run, begin), None, AS_RECORDED)
    due = friction_of(run, plant, begin)
    assert largest_share(plant, due) > 0.3
    zero, true, found = (
        evaluate_residuals(plant, test, ("wrench",), path=follow(plant, test, start=start)).wrench
        for start in (None, due, estimate_start(plant, test, 30.0))
    )
    size = np.abs(zero).max(axis=0)
    # steps end where they hardly change states: within two thousandths of what zero leaves, on every axis
    assert np.all(np.abs(found).max(axis=0) < np.abs(true).max(axis=0) + 2e-3 * size.max())


def test_a_run_from_rest_is_begun_from_zero(run):
    """To the last bit, as its residual is that of rounding."""
    plant = make_plant(load_machine())
    test = prepare_test(plant, second(run, 0), None, AS_RECORDED)
    assert not estimate_start(plant, test, 30.0).any()


def test_what_a_model_lacks_along_the_whole_test_is_not_explained_by_its_start(run):
    """A platen that is a tenth heavier, in a run from rest."""
    heavier = make_plant(load_machine(override={"platen.mass": [1.1 * m for m in load_machine().platen.mass]}))
    test = prepare_test(heavier, second(run, 0), None, AS_RECORDED)
    assert not estimate_start(heavier, test, 30.0).any()


def test_decompose_finds_a_recording_after_a_motion_exact_and_states_what_friction_holds(run):
    found = decompose_record(load_machine(), second(run))
    assert any(note.startswith("Seals or pads hold up to") for note in found.notes)
    worst = np.abs(found.forces.residual).max(axis=0) / np.abs(found.forces.measured).max(axis=0)
    assert worst[0] < EXACT and worst[4] < EXACT


def test_open_loop_begins_with_what_an_earlier_motion_left_in_seals_and_pads(lhpost6, tmp_path):
    """A recording of the second of two sines: without it the table shook at rest, and forces were wrong by a third."""
    one = make_target(find_motion("sine", amplitude=0.03, period=1.0, cycles=2.0), rate=float(SAMPLE_RATE))
    twice = {name: np.tile(getattr(one, name), (2, 1)) for name in ("displacement", "velocity", "acceleration")}
    target = replace(one, time=np.arange(2 * len(one.time)) / SAMPLE_RATE, **twice)
    test = rehearse(load_machine(), target, load_controller("lhpost6"), attrs={"test": "two"}, engine="fused")
    record = second(test.record, len(one.time) - SAMPLE_RATE)  # at rest for more than a second
    save_record(record, tmp_path / "second.nc")
    ended = lhpost6("open-loop", tmp_path / "second.nc", "--engine", "fused")
    assert "Seals or pads hold up to" in (tmp_path / "out" / "second_open_loop" / "report.html").read_text()
    found = load_record(tmp_path / "out" / "second_open_loop" / "record.nc")
    alone = replay(load_machine(), record, attrs={}, engine="fused").record
    force = record["actuator_force"].values
    size = np.abs(force[:, :4]).max()
    errors = [np.abs(x["actuator_force"].values - force)[:, :4].max() / size for x in (found, alone)]
    assert errors[1] > 0.3 and errors[0] < 0.02  # prior and linearisation: hundredths of what is held
    assert ended.code == 0


# ---------------------------------------------------------------------------------------------- up to a trip
def tripped(run):
    """The run as a recording that tripped in its motion, after which forces are not of its motion."""
    force = run["actuator_force"].values.copy()
    force[9 * SAMPLE_RATE :] += 1e5
    return run.assign(actuator_force=run["actuator_force"].copy(data=force)).assign_attrs(
        trouble="tripped at 9.000 s: z displacement beyond its interlock"
    )


def test_decompose_uses_a_recording_up_to_its_trip_and_states_it(run):
    found = decompose_record(load_machine(), tripped(run))
    assert found.notes[0].startswith("tripped at 9.000 s: z displacement")
    assert found.record.sizes["time"] == 9 * SAMPLE_RATE
    worst = np.abs(found.forces.residual).max(axis=0) / np.abs(found.forces.measured).max(axis=0)
    assert np.all(worst[[0, 2, 4]] < EXACT)  # of the axes that bear a force


def test_decompose_refuses_a_recording_that_tripped_before_it_began(run):
    with pytest.raises(RecordError, match=r"s are too short"):
        decompose_record(load_machine(), run.assign_attrs(trouble="tripped before the recording began: by Anna"))


def test_validate_uses_a_recording_up_to_its_trip_and_states_it(run, caplog):
    found = validate(load_machine(), Campaign("c", (tripped(run),)), phases=(1,), jobs=1)
    assert "test sine tripped at 9.000 s" in caplog.text
    (phase,) = found.phases
    assert phase.notes[0].startswith("tripped at 9.000 s") and len(phase.time) == 9 * SAMPLE_RATE
    assert max(a.rrmse_aligned for a in phase.of("wrench") if a.moves) < EXACT


def test_pads_near_their_full_friction_in_both_directions_are_found(base):
    """Full friction of a pad is a circle in its plane: each direction has what the other leaves.

    Held by a motion before along x and y at once, as after a sweep of both; what remains is noise within a twentieth.
    """
    plant, test, start = base.plant, base.tests[0], np.zeros(len(base.plant.states))
    for row in plant.rows:
        if law_of(row).friction_memory:
            own = states_of(row)
            start[own] = [0.74, 0.67] if own.stop - own.start == 2 else 0.0
    began, rest = moved(plant, test, start)
    found = estimate_start(plant, began, 30.0)
    after = evaluate_residuals(plant, began, ("wrench",), path=follow(plant, began, start=found)).wrench
    assert largest_share(plant, found) <= 1.0 + 1e-12  # rounding
    assert np.all(after[:, plant.axes].std(axis=0) < 1.05 * rest[:, plant.axes].std(axis=0))


# ------------------------------------------------------------------------------------------------ records with noise
def test_offsets_of_load_cells_are_not_called_held_friction():
    """In a test along z, pads never travel along x or y: a state there is a force that stays, as an offset is."""
    machine, sensors = load_machine(), load_sensors()
    (record,) = simulate_campaign(machine, load_controller("lhpost6"), sensors, seed=2, tests=("TZ",)).records
    found = decompose_record(machine, record)
    mean = found.forces.residual.mean(axis=0)
    assert np.all(np.abs(mean[:2]) < 3.0 * np.array([3.6e3, 2.9e3]))  # [N] deviations by offsets within their ranges


def test_a_delay_that_a_test_does_not_determine_is_not_removed():
    """In a motion a tenth as large the accelerometer was "24.6 ms late", of sensors without any skew."""
    exact = {"seed": 1, "errors": False, "tests": ("TX",), "scale": 0.1}
    (record,) = simulate_campaign(load_machine(), load_controller("lhpost6"), load_sensors(), **exact).records
    found = decompose_record(load_machine(), record)
    assert all(abs(one.delay) < 3e-4 for one in found.delays.values())  # as the sensors' ranges allow
    assert np.all(find_agreement(found).noise_ratio[0] < 1.1)


def test_a_long_rest_after_a_motion_does_not_raise_the_predicted_noise(run):
    """A second draw of noise moves the platen at rest more than one does: friction would creep away in it."""
    still = run.isel(time=[-1] * (40 * SAMPLE_RATE))
    whole = xr.concat([run, still], dim="time", data_vars="minimal")
    whole = whole.assign_coords(time=np.arange(whole.sizes["time"]) / SAMPLE_RATE)
    rng, exact = np.random.default_rng(5), SensorErrors({}, {}, {})  # not the noise that is drawn again
    record = as_sensed(whole, load_sensors(), exact, 512.0, rng).assign_attrs(kind="measured")
    found = decompose_record(load_machine(), record)
    ratio = find_agreement(found).noise_ratio
    assert np.all((ratio > 0.8) & (ratio < 1.25))

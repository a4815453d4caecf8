"""Calibration: parameters turn what they say, noise is whitened, derivatives are right, and the truth is recovered."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from commands import refused

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.data.campaign import Campaign, load_campaign, save_campaign
from lhpost6_pin.data.records import sample_interval
from lhpost6_pin.data.sensors import SensorSet, add_noise
from lhpost6_pin.data.signals import align
from lhpost6_pin.discovery.discover import discovery_numbers
from lhpost6_pin.identification.calibration import (
    calibrate,
    calibration_numbers,
    fit,
    machine_parameters,
    with_parameters,
)
from lhpost6_pin.identification.calibration.calibration_summary import chance, compared
from lhpost6_pin.identification.calibration.expected_scatter import noise_at
from lhpost6_pin.identification.calibration.fit import solve
from lhpost6_pin.identification.calibration.free_parameters import FreeParameter, plan_parameters, scatter_parameters
from lhpost6_pin.identification.calibration.normal_equations import bounded_step, bounds_of
from lhpost6_pin.identification.calibration.operating_point import OperatingPoint
from lhpost6_pin.identification.calibration.override import save_override
from lhpost6_pin.identification.calibration.prepare import policy_of, prepare_problem
from lhpost6_pin.identification.calibration.problem import Problem, ResidualBands
from lhpost6_pin.identification.calibration.result import changed_parameters, contradictions
from lhpost6_pin.identification.calibration.sensor_errors import corrected, corrected_record, sensor_unknowns
from lhpost6_pin.identification.calibration.simulated_residuals import by_simulation
from lhpost6_pin.identification.calibration.sparse_bins import sparse_bins
from lhpost6_pin.identification.calibration.whitened_residuals import (
    Whitener,
    excess,
    make_whitener,
    mean_squares,
    negative_log_likelihood,
    spectrum_of,
)
from lhpost6_pin.identification.prepare import AS_RECORDED, MeasuredTest, chamber_pressures, prepare_test
from lhpost6_pin.identification.residuals import RESIDUALS, evaluate_residuals
from lhpost6_pin.machine.machine import Machine, build_machine, load_machine
from lhpost6_pin.machine.parameters import load_parameters
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import Target, find_motion, make_target
from lhpost6_pin.simulation.rehearse import rehearse
from lhpost6_pin.simulation.simulated_campaign import simulate_campaign
from lhpost6_pin.tuning.identify import noise_target

pytestmark = pytest.mark.long

TURNED = {
    "horizontal.seal_friction": 0.3,
    "horizontal.viscous": -0.3,
    "hydraulics.bulk_modulus": -0.15,
    "horizontal.leakage": 0.4,
    "platen.mass[x]": 0.02,
    "hold_down.polytropic_index": -0.04,
}
"""Coordinates of the parameters that the simulated machine has turned; one and a half to two stated deviations."""


@pytest.fixture(scope="module")
def truth(machine: Machine) -> np.ndarray:
    return np.array([TURNED.get(k.name, 0.0) for k in machine_parameters(machine)])


@pytest.fixture(scope="module")
def campaign(machine: Machine, sensors: SensorSet, truth: np.ndarray) -> Campaign:
    """Two tests of a machine whose parameters are turned, with noise and calibration errors."""
    turned = with_parameters(machine, machine_parameters(machine), truth)
    return simulate_campaign(turned, load_controller("lhpost6"), sensors, seed=3, tests=("TX", "WN"))


def parameter(machine: Machine, name: str) -> FreeParameter:
    return next(k for k in machine_parameters(machine) if k.name == name)


# ------------------------------------------------------------------------------------------------------- parameters
def test_every_number_with_an_uncertainty_is_a_free_parameter_unless_it_is_geometry(machine):
    turned = {path for k in machine_parameters(machine) for path, _ in k.paths}
    stated = {p for p, q in machine.parameters.items() if q.sd is not None}
    assert {p for p in stated if not p.endswith(("_point", "bearing_plane"))} <= turned


def test_a_parameter_at_zero_leaves_the_machine_as_it_is(machine):
    parameters = machine_parameters(machine)
    same = with_parameters(machine, parameters, np.zeros(len(parameters)))
    assert all(same.parameters[p].value == q.value for p, q in machine.parameters.items())


@pytest.mark.parametrize("name", ["horizontal.flow", "platen.centre_of_gravity[z]", "vertical.platen_height"])
def test_a_coordinate_and_its_value_are_inverse(machine, name):
    k = parameter(machine, name)
    assert k.coordinate(k.at(1.3 * k.sd)) == pytest.approx(1.3 * k.sd, rel=1e-12)


def test_a_height_moves_all_points_of_a_kind_and_the_bearing_plane_with_them(machine):
    k = parameter(machine, "vertical.platen_height")
    lifted = with_parameters(machine, [k], np.array([0.03]))
    rise = [b.platen_point[2] - a.platen_point[2] for a, b in zip(machine.actuators, lifted.actuators, strict=True)]
    assert rise == pytest.approx([0.0] * 4 + [0.03] * 6, abs=1e-12)
    assert lifted.platen.bearing_plane[2] - machine.platen.bearing_plane[2] == pytest.approx(0.03, abs=1e-12)


def test_a_twin_differs_by_a_factor_of_what_its_kind_has(machine):
    shared, own = parameter(machine, "horizontal.flow"), scatter_parameters(machine, 0.05, 3.0)
    twin = next(k for k in own if k.name == "H2.flow")
    turned = with_parameters(machine, [twin, shared], np.array([0.1, -0.2]))
    flows = [a.flow / b.flow for a, b in zip(turned.actuators, machine.actuators, strict=True)]
    assert flows[:4] == pytest.approx([0.8, 0.8 * 1.1, 0.8, 0.8], rel=1e-12)
    assert flows[4:] == [1.0] * 6
    assert {k.name.split(".")[0] for k in own} == set(machine.actuator_names)
    assert not [k for k in scatter_parameters(turned, 0.05, 3.0) if k.name == "H2.flow"]  # it has a number of its own


def test_what_is_positive_stays_so(machine):
    parameters = [k for k in machine_parameters(machine) if k.form == "factor"]
    least = with_parameters(machine, parameters, np.array([k.lowest for k in parameters]))
    for k in parameters:
        assert 0.0 < k.at(k.lowest) < k.value
    assert all(a.leakage > 0.0 and a.viscous > 0.0 for a in least.actuators)


def test_points_move_in_plan_as_mirror_images(machine):
    parameters = {k.name: k for k in plan_parameters(machine)}
    chosen = [parameters["horizontal.base_x"], parameters["vertical.platen_y"]]
    moved = with_parameters(machine, chosen, np.array([0.02, 0.01]))
    for before, after in zip(machine.components, moved.components, strict=True):
        shift = np.subtract(after.base_point, before.base_point)
        kind = before.kind
        wanted = [0.02 * np.sign(before.base_point[0]) * (kind == "horizontal"), 0.01 * np.sign(before.base_point[1])]
        assert shift == pytest.approx([wanted[0], wanted[1] * (kind == "vertical"), 0.0], abs=1e-12)
    assert "hold_down.platen_y" not in parameters  # all struts are on the axis


def test_a_chamber_is_not_turned_shorter_than_its_stroke_or_than_its_piston_was_seen_to_move(machine):
    k = parameter(machine, "horizontal.chamber_a")
    assert k.at(k.lowest) > machine.actuators[0].stroke
    with_parameters(machine, [k], np.array([k.lowest]))  # can still be built
    (k,) = (k for k in machine_parameters(machine, {"horizontal": 0.6}) if k.name == "horizontal.chamber_a")
    assert k.at(k.lowest) == pytest.approx(0.6, rel=2e-3)


@pytest.mark.parametrize(
    ("stated", "chamber_a", "chamber_b", "wanted"),
    [
        (0.75, 0.9, 0.9, 0.75),  # longer chambers leave it as stated
        (0.75, 0.7503, 0.9, 0.75),  # as long as it fits
        (0.75, 0.72, 0.7, 0.7 / 1.001),  # the shortest chamber cuts it
        (0.6, 0.72, 0.7, 0.6),
    ],
)
def test_a_stroke_stays_as_stated_unless_a_chamber_is_shorter(machine, stated, chamber_a, chamber_b, wanted):
    machine = machine.with_params({"horizontal.stroke": stated})
    free = machine_parameters(machine, {"horizontal": 0.3})
    parameters = [k for k in free if k.name.startswith("horizontal.chamber")]
    turned = with_parameters(machine, parameters, np.array([chamber_a, chamber_b]) / 0.8 - 1.0)
    assert (turned.actuators[0].chamber_a, turned.actuators[0].chamber_b) == pytest.approx((chamber_a, chamber_b))
    assert [a.stroke for a in turned.actuators[:4]] == pytest.approx([wanted] * 4, rel=1e-12)


def test_a_guided_machine_has_no_parameters_of_axes_that_it_has_not():
    names = {k.name for k in machine_parameters(load_machine("uniaxial"))}
    assert "platen.mass[x]" in names
    assert not {n for n in names if n.startswith("platen.inertia") or n.endswith("_height")}


# ------------------------------------------------------------------------------------------------------ spectra
def test_white_noise_has_its_spectrum_in_every_bin():
    rng, dt = np.random.default_rng(0), 1 / 512
    noise = rng.standard_normal((20480, 4))
    bins, f = spectrum_of(noise, dt, 0.0, 200.0, 0.5)
    power = np.mean(np.abs(bins[f > 0]) ** 2)
    assert power == pytest.approx(2 * dt, rel=0.03)  # one-sided; 30 000 bins scatter by 0.6 %


@pytest.mark.parametrize("test", [0, 1])
def test_whitened_noise_has_unit_power_and_no_correlation(test):
    """In a test as in another where a column is ten times as noisy: every test has its own scale."""
    rng, dt = np.random.default_rng(1), 1 / 512
    mix = np.array([[1.0, 0.0, 0.0], [3.0, 0.5, 0.0], [-2.0, 1.0, 0.1]])
    loud = np.array([[1.0, 1.0, 1.0], [1.0, 10.0, 1.0]])

    def draw(t):
        return spectrum_of(rng.standard_normal((8192, 3)) @ mix.T * loud[t], dt, 0.0, 30.0, 0.0)

    noise = [[draw(t)[0] for _ in range(20)] for t in (0, 1)]
    f = draw(0)[1]
    whitener = make_whitener(noise, [f, f], np.array([0.0, 0.01, 10.0, 20.0, 30.0]))
    white = [whitener.apply(test, sparse_bins(draw(test)[0]), f).full(3) for _ in range(20)]  # others than it is from
    others = np.vstack([x[f > 0] for x in white])
    matrix = others.conj().T @ others / len(others)
    assert np.allclose(matrix, np.eye(3), atol=0.06)  # 9 600 bins: entries scatter by 1 %, their estimate as much
    means = np.mean([np.abs(x[f == 0]) ** 2 for x in white])
    # a mean is real: half the power; sixty of them scatter by a fifth, their scales by a third
    assert 0.2 < means < 0.8


def test_columns_of_independent_noise_stay_as_they_are():
    """Correlations by chance must not carry what is wrong in one column into another."""
    rng, edges = np.random.default_rng(2), np.array([0.0, 0.01, 10.0])
    first, second = rng.standard_normal((2, 400, 1)) + 1j * rng.standard_normal((2, 400, 1))
    noise = np.hstack([first, second, 0.1 * first + 0.02 * second])  # the third is of both
    f = np.linspace(0.1, 9.9, 400)
    factor = make_whitener([[np.vstack([noise[:1], noise])]], [np.append(0.0, f)], edges).factor[0, 1]
    assert factor[1, 0] == 0.0
    assert abs(factor[2, 0]) > 1.0 and abs(factor[2, 1]) > 1.0
    assert np.array_equal(factor, np.tril(factor))


def test_columns_of_different_groups_are_not_mixed():
    """What the model of friction leaves in a force must not reach a flow, though the same sensor's noise is in both."""
    rng, edges, f = np.random.default_rng(2), np.array([0.0, 0.01, 10.0]), np.linspace(0.1, 9.9, 400)
    force, other = rng.standard_normal((2, 400, 1)) + 1j * rng.standard_normal((2, 400, 1))
    noise = [[np.hstack([force, force + 0.5 * other, force + other])]]
    factor = make_whitener(noise, [f], edges, np.array([0, 1, 1])).factor[0, 1]
    assert factor[1, 0] == factor[2, 0] == 0.0
    assert abs(factor[2, 1]) > 0.5  # within a group they are


def test_noise_of_too_few_samples_is_refused():
    noise = [[np.ones((2, 7), complex)] * 3]  # the first band counts with the second
    with pytest.raises(RecordError, match=r"6 samples of the noise between 1 and 2 Hz"):
        make_whitener(noise, [np.array([1.0, 2.5])], np.array([1.0, 2.0, 3.0]))


def test_the_last_columns_are_mixed_with_all_others_and_these_not_with_them():
    rng = np.random.default_rng(4)
    noise = rng.standard_normal((2000, 4)) @ (np.eye(4) + 0.2 * rng.standard_normal((4, 4))) + 0j
    f, edges = np.linspace(0.1, 9.9, 2000), np.array([0.0, 5.0, 10.0])
    last = np.array([True, False, True, False])
    whitener = make_whitener([[noise]], [f], edges, last=last)
    assert not whitener.factor[0][:, ~last][:, :, last].any() and whitener.factor[0][:, last][:, :, ~last].any()
    white = whitener.apply(0, sparse_bins(noise), f).full(4)
    for band in (f < 5.0, f > 5.0):
        matrix = white[band].conj().T @ white[band] / band.sum()
        assert np.allclose(matrix, np.eye(4), atol=0.1)  # 1000 bins: entries scatter by 3 %, their estimate as much


def test_columns_that_are_zero_are_whitened_as_all_others():
    rng = np.random.default_rng(3)
    noise = rng.standard_normal((300, 5)) @ rng.standard_normal((5, 5)) + 0j
    f = np.linspace(0.1, 9.9, 300)
    whitener = make_whitener([[noise]], [f], np.array([0.0, 5.0, 10.0]))
    bins = rng.standard_normal((300, 5, 2)) * np.array([0, 1, 0, 1, 0])[:, None] + 0j
    whole = np.array([whitener.factor[0, b] @ x for b, x in zip(whitener.band(f), bins, strict=True)])
    found = whitener.apply(0, sparse_bins(bins), f)
    np.testing.assert_array_equal(found.columns, [1, 2, 3, 4])  # none before the first is mixed with it
    assert np.allclose(found.full(5), whole, rtol=1e-12, atol=1e-12)
    assert not whitener.apply(0, sparse_bins(0.0 * bins), f).columns.size


# ------------------------------------------------------------------------------------------------------- errors
def test_correction_undoes_gain_offset_and_delay(problem, machine, sensors):
    before = problem.tests[0].channels
    offsets = np.linspace(-2e4, 2e4, 14)
    after = problem.tests[0].with_channels(
        actuator_force=before["actuator_force"] * np.linspace(0.996, 1.004, 10),
        chamber_pressure_a=before["chamber_pressure_a"] + offsets[:10],
        chamber_pressure_b=before["chamber_pressure_b"] + offsets[10:],
        spool_position=align(before["spool_position"], -2e-4, problem.tests[0].dt),
    )
    names = [f"gain actuator_force[{n}]" for n in machine.actuator_names]
    names += [f"offset chamber_pressure_a[{n}]" for n in machine.actuator_names]
    names += [f"offset chamber_pressure_b[{n}]" for n in machine.double_acting] + ["delay spool_position"]
    values = dict(zip(names, [*np.linspace(-0.004, 0.004, 10), *offsets, 2e-4], strict=True))
    errors = np.array([values.get(u.name, 0.0) for u in problem.unknowns])
    right = corrected(after, problem.unknowns, errors).channels
    for name in ("actuator_force", "chamber_pressure_a", "chamber_pressure_b"):
        assert np.allclose(right[name], before[name], rtol=1e-13)
    assert right["strut_pressure"] is before["strut_pressure"]  # what has no error is not copied
    inside = slice(50, -50)  # what is shifted in and out at the ends is not known
    shown, rest = (np.abs(x["spool_position"] - before["spool_position"])[inside] for x in (after.channels, right))
    assert rest.max() < 0.01 * shown.max()


def test_spools_are_late_together_and_each_by_part_of_a_sample(problem, campaign):
    """The delay of the group and that of one spool add up, in a test and in a record."""
    names = [u.name for u in problem.unknowns]
    values = np.zeros(len(names))
    values[names.index("delay spool_position")], values[names.index("delay spool_position[H2]")] = 2e-4, -1.5e-4
    each = np.full(10, 2e-4)
    each[1] = 0.5e-4
    test, record = problem.tests[0], campaign.records[1]
    right = corrected(test, problem.unknowns, values)
    due = align(test.channels["spool_position"], each, test.dt)
    np.testing.assert_allclose(right.channels["spool_position"], due, rtol=0.0, atol=1e-15)  # rounding
    spool = corrected_record(record, problem.unknowns, values)["spool_position"].values
    due = align(record["spool_position"].values, each, sample_interval(record))
    np.testing.assert_allclose(spool, due, rtol=0.0, atol=1e-15)


def test_gains_of_platen_channels_take_their_share_of_the_motion(machine, sensors, campaign):
    plant = make_plant(machine)
    record = campaign.records[1].drop_vars("actuator_displacement")
    numbers = calibration_numbers()
    ready, scaled = (
        prepare_test(plant, r, sensors, policy_of(numbers))
        for r in (record, record.assign(platen_velocity=1.003 * record["platen_velocity"]))
    )
    unknowns = sensor_unknowns(machine, sensors, ready)
    values = np.array([0.003 * u.name.startswith("gain platen_velocity") for u in unknowns])
    right = corrected(scaled, unknowns, values)
    for moved, wanted, wrong in zip(right.motion, ready.motion, scaled.motion, strict=True):
        # to first order: what is left is the gain's square, 1e-5 of the share, 3e-3 of the change
        assert np.abs(moved - wanted).max() < 5e-3 * np.abs(wrong - wanted).max()


def test_errors_of_chambers_b_are_taken_out_where_spools_were_not_measured(problem, machine, sensors):
    blind = problem.tests[0].with_channels(spool_position=None)
    unknowns = sensor_unknowns(machine, sensors, blind)
    values = np.array([1e4 * (u.name == "offset chamber_pressure_b[H3]") for u in unknowns])
    before, after = (chamber_pressures(machine, t.channels) for t in (blind, corrected(blind, unknowns, values)))
    change = after - before
    assert np.allclose(change[:, 12], -1e4, rtol=1e-9)  # ten chambers A, then H1 and H2; pressures are rounded at 1e-9
    assert not np.delete(change, 12, axis=1).any()


# --------------------------------------------------------------------------------------------------------- fit
COMPARISON = ResidualBands((0.0, 0.01, 5.0, 10.0, 20.0, 30.0), 0.3, 0.1, 0.5)


@pytest.fixture(scope="module")
def seen(machine, sensors, campaign) -> list[MeasuredTest]:
    """One test, and four times with more noise."""
    plant = make_plant(machine)
    record = campaign.records[1].drop_vars("actuator_displacement")
    rng = np.random.default_rng(5)
    return [
        replace(prepare_test(plant, r, sensors, AS_RECORDED._replace(pressure_cutoff=60.0)), path=None)
        for r in (record, *(add_noise(record, sensors, rng) for _ in range(4)))
    ]


@pytest.fixture(scope="module")
def problem(machine, sensors, seen) -> Problem:
    return Problem(machine, seen[:1], seen[1:], sensors, COMPARISON, again=[seen[1:2]])


def assert_slopes(problem: Problem, chosen: list[int]) -> list[np.ndarray]:
    """Unknowns evaluated together have the derivatives of each alone, which are returned."""
    x, places, found = np.zeros(len(problem.prior)), np.arange(len(problem.prior)), []
    base = OperatingPoint(problem, x)
    (slope,) = problem.slopes(base, np.isin(places, chosen), lambda share: None)
    for i in chosen:
        step = 0.1 * problem.prior[i] * (places == i)
        after = OperatingPoint(problem, x + step)
        found.append((problem.residual(after)[0] - problem.residual(base)[0]) / step[i])
        # differences of residuals of order one, divided by a step: their rounding is what differs
        out = np.zeros_like(found[-1])
        out[:, slope[i].columns] = slope[i].bins.T
        assert np.allclose(out, found[-1], rtol=1e-6, atol=1e-7 * np.abs(found[-1]).max())
    return found


def test_unknowns_evaluated_together_have_the_derivatives_of_each_alone(problem):
    spools = ("gain spool_position[H2]", "gain spool_position[V5]")
    chosen = [problem.names.index(n) for n in (*spools, "offset chamber_pressure_b[H3]", "gain strut_pressure[S2]")]
    assert_slopes(problem, chosen)


def test_where_a_sum_of_delays_is_known_derivatives_do_not_tell_its_parts_apart(machine, sensors, seen):
    """Valves later and commands taken out as late as that leave the servo residual as it is.

    One-sided differences with unequal steps had left a part of each derivative: a valve's delay of 4 ms was
    "identified" as 1.8 +- 0.3 ms, with the commands late by the rest.
    """
    keys = "horizontal.valve_delay", "vertical.valve_delay"
    unsure = {key: replace(q := machine.parameters[key], sd=0.5 * float(q.value)) for key in keys}
    machine = build_machine(replace(machine.parameters, quantities={**machine.parameters.quantities, **unsure}))
    problem = Problem(machine, seen[:1], seen[1:], sensors, COMPARISON, kinds=RESIDUALS)
    valves = [p for p in problem.parameters if p.name.endswith(".valve_delay")]
    chosen = [problem.names.index(name) for name in (*(p.name for p in valves), "delay spool_command")]
    assert len(chosen) == 3  # of the horizontal and the vertical valves, and of commands
    base = OperatingPoint(problem, np.zeros(len(problem.prior)))
    (slope,) = problem.slopes(base, np.isin(np.arange(len(problem.prior)), chosen), lambda share: None)
    dense = []
    for i in chosen:
        out = np.zeros((slope[i].bins.shape[1], len(problem.rows("servo"))), complex)
        out[:, slope[i].columns] = slope[i].bins.T
        dense.append(out[:, problem.rows("servo")])
    *of_valves, of_commands = dense
    whole = sum(out / p.slope(0.0) for out, p in zip(of_valves, valves, strict=True))
    assert np.abs(whole).max() > 0.0
    # shifts extend both ends of the record differently: 1.4e-6 is left; 2e-2 with unequal steps
    np.testing.assert_allclose(whole + of_commands, 0.0, atol=1e-5 * np.abs(whole).max())


def test_pressures_that_stand_in_for_forces_show_in_the_wrench(seen, machine, sensors):
    tests = [t.with_channels(actuator_force=None) for t in seen]
    without = Problem(machine, tests[:1], tests[1:], sensors, COMPARISON)
    chosen = [without.names.index(n) for n in ("gain chamber_pressure_a[H2]", "offset chamber_pressure_b[H3]")]
    for alone in assert_slopes(without, chosen):
        assert np.abs(alone[:, without.rows("wrench")]).max() > 0.0


def test_softer_oil_makes_more_noise_in_flows_than_in_the_wrench(problem, seen):
    soft = -2.0 * problem.prior * (np.array(problem.names) == "hydraulics.bulk_modulus")
    stiff, now = (noise_at(problem, x)[0] for x in (np.zeros(len(soft)), soft))
    share = soft[problem.names.index("hydraulics.bulk_modulus")]
    factor = (1.0 + share) ** -2  # of power: that of L A / beta squared
    bands = slice(2, None)  # below, other noise than that of the pressures' rates counts
    flow, wrench = problem.rows("flow"), problem.rows("wrench")
    assert factor > 1.1
    # flows have noise of lengths and spools as well, which oil does not change; least of it where rates are largest
    assert np.all(now[bands][:, flow] > stiff[bands][:, flow])
    assert np.all(now[bands][:, flow] < (factor + 1e-6) * stiff[bands][:, flow])
    assert np.all(now[-1][flow] > (1.0 + 0.6 * (factor - 1.0)) * stiff[-1][flow])
    # the wrench is whitened last: noise that it shares with flows is taken out by what stiff oil makes of these
    rise = now[bands] / stiff[bands] - 1.0
    assert np.all(np.abs(rise[:, wrench]) < 0.5 * rise[-1][flow].max())


def test_whitened_bins_scale_with_the_whitener(problem):
    scale = np.linspace(0.5, 2.0, problem.whitener.factor[..., 0].size).reshape(problem.whitener.factor.shape[:3])
    x = np.zeros(len(problem.prior))
    base = OperatingPoint(problem, x)
    before, after = problem.residual(base)[0], problem.scaled(scale).residual(base)[0]
    band = problem.whitener.band(problem.frequency[0])
    assert np.allclose(after, before * scale[0][band], rtol=1e-9, atol=1e-12)  # rounding


def test_the_surprise_of_what_is_left_falls_as_least_squares_over_its_power():
    whitener = Whitener(np.array([0.0, 1.0, 2.0, 9.0]), np.zeros((1, 3, 1, 1), complex))
    f = np.array([0.5, *np.linspace(1.0, 1.9, 5), *np.linspace(2.0, 8.0, 30)])
    rng = np.random.default_rng(4)
    bins = rng.normal(0.0, np.repeat([30.0, 3.0, 0.5], [1, 5, 30]))[:, None] + 0j
    (power,) = excess(whitener, [bins], [f])
    means, counts = mean_squares(whitener, np.abs(bins) ** 2, f)
    step = 1e-6
    for b in range(3):
        more = means + step * (np.arange(3) == b)[:, None]
        slope = float((negative_log_likelihood(more, counts) - negative_log_likelihood(means, counts))[0]) / step
        due = counts[b] / power[np.searchsorted(f, whitener.edges[b])][0]
        assert slope == pytest.approx(due, rel=1e-4)  # of a difference over a step
    less = negative_log_likelihood(np.full((3, 1), 0.7), counts)[0]
    assert less == pytest.approx(0.7 * counts.sum())  # less than noise is noise


@pytest.mark.slow
def test_slopes_of_twins_keep_up_with_what_they_share(machine, sensors, seen):
    """After a frugal search that has moved what twins share, their slopes still add up to that of it."""
    ready = Problem(machine, seen[:1], seen[1:], sensors, COMPARISON, again=[seen[1:2]])
    ready = ready.with_machine(machine, (*ready.parameters, *scatter_parameters(machine, 0.05, 3.0)))
    numbers = discovery_numbers()[1]
    found = solve(ready, numbers, np.zeros(len(ready.prior)), lambda share: None, frugal=True)
    grown = dict(zip(ready.names, 1.0 + found.at, strict=True))
    assert abs(grown["horizontal.seal_friction"] - 1.0) > 0.1  # it was turned by 0.3
    rows = found.normal.rows[0]
    only = np.eye(len(ready.names))
    slopes = {n: grown[n] * rows.times(e) for n, e in zip(ready.names, only, strict=True) if "seal_friction" in n}
    shared = slopes["horizontal.seal_friction"]
    each = [j for name, j in slopes.items() if name.startswith("H")]
    # by differences; the last step is not renewed
    assert len(each) == 4
    assert np.abs(sum(each) - shared).max() < 0.05 * np.abs(shared).max()


def test_a_step_that_goes_too_far_is_taken_back(problem, seen, monkeypatch):
    own = load_parameters(models_folder() / "procedures" / "discovery.toml").quantities
    numbers = calibration_numbers()
    numbers = replace(numbers, quantities={**numbers.quantities, **own})
    low, high = bounds_of(problem, numbers)

    def too_far(*known):
        x = known[2]
        return np.clip(x + 20.0 * bounded_step(*known), low, high) - x

    monkeypatch.setattr(fit, "bounded_step", too_far)
    start = np.zeros(len(problem.prior))
    found = fit.solve(problem, numbers, start, lambda share: None, frugal=True)
    before, after = (fit.objective(problem, problem.residual(OperatingPoint(problem, x)), x) for x in (start, found.x))
    assert after < before + fit.OVERSHOT


def test_whitened_residuals_hold_as_many_columns_as_their_kinds(problem):
    r = evaluate_residuals(make_plant(problem.machine), problem.tests[0], problem.kinds)
    assert problem.widths == tuple(x.shape[1] for x in r) == (6, 14, 3, 10, 0, 0)
    assert sum(problem.rows(k).sum() for k in ("wrench", "flow", "gas", "force")) == 33


FORCES = ["actuator_force", "chamber_pressure_a", "chamber_pressure_b"]


def slower(record):
    return record.isel(time=slice(None, None, 10)).assign_attrs(sample_rate_hz=51.2)


def _zero(record, name, sample=7, column=1, value=0.0):
    values = record[name].values.copy()
    values[sample, column] = value
    return record.assign({name: record[name].copy(data=values)})


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda r: _zero(r, "spool_position", value=np.nan), r"WN: spool_position\[H2\], sample 7: is not finite"),
        (lambda r: _zero(r, "strut_pressure"), r"WN: strut_pressure\[S2\] is not above zero at sample 7"),
        (lambda r: r.drop_vars("spool_position"), "WN has no spool_position, which other tests have"),
        (lambda r: r.drop_vars("chamber_pressure_b"), "WN: has pressures of one side only"),
        (lambda r: r.drop_vars("platen_displacement"), "WN: has no platen_displacement; lengths do not replace it"),
        (lambda r: r.drop_vars(FORCES), "WN: has neither actuator_force nor chamber_pressure_a"),
        (lambda r: r.isel(actuator=slice(9)), "WN: actuator: has labels"),
        (lambda r: r.isel(horizontal=slice(2)), "WN: horizontal: has labels"),
        (lambda r: r.assign_attrs(specimen="house"), "WN was made with specimen 'house'"),
        (lambda r: r.isel(time=slice(350)), "WN: 0.682 s at 512 Hz leave nothing to compare between 15 and 18 Hz"),
        (lambda r: r.isel(time=slice(300)), "WN: 0.584 s at 512 Hz leave nothing to compare between 0 and 0.01 Hz"),
        (slower, "WN: .* at 51.2 Hz leave nothing to compare between 27 and 30 Hz"),
    ],
)
def test_a_test_that_cannot_be_calibrated_by_is_refused_by_name(machine, sensors, campaign, spoil, message):
    first, second = campaign.records
    with pytest.raises(RecordError, match=message):
        calibrate(machine, [first, spoil(second)], sensors)


def test_what_the_first_test_lacks_is_named_too_and_no_test_at_all_is_refused(machine, sensors, campaign):
    first, second = campaign.records
    with pytest.raises(RecordError, match="TX has no strut_pressure, which other tests have"):
        calibrate(machine, [first.drop_vars("strut_pressure"), second], sensors)
    with pytest.raises(RecordError, match="the campaign has no records"):
        calibrate(machine, [], sensors)


@pytest.mark.parametrize("command", ["calibrate", "validate", "discover"])
def test_no_jobs_at_all_are_refused(lhpost6, command, tmp_path):
    assert refused(lhpost6(command, tmp_path, "--jobs", "0"), "--jobs 0")


@pytest.fixture(scope="module")
def found(machine, sensors, campaign):
    return calibrate(machine, campaign.records, sensors, campaign="two tests")


def test_what_was_turned_is_found_and_the_rest_stays(found, truth):
    count = len(found.parameters)
    off = (found.estimate[:count] - truth) / found.sd[:count]
    names = np.array(found.names[:count])
    assert found.converged
    assert found.informed[:count][np.isin(names, list(TURNED))].all()
    # four predicted deviations: chance exceeds them for one of six parameters once in 2600 campaigns
    assert np.abs(off[np.isin(names, list(TURNED))]).max() < 4.0, dict(zip(names, off, strict=True))
    assert np.median(np.abs(off)) < 1.2  # exact predictions give 0.67; with 37 parameters the median scatters by 0.15


def test_delays_are_those_of_the_records_with_what_was_removed_before_the_fit(found, campaign):
    """Pressures, aligned with forces first, were given the delay of forces."""
    attrs, removed = campaign.records[0].attrs, {one.group for one in found.delays}
    assert "chamber_pressure" in removed
    for group in ("actuator_force", "chamber_pressure"):
        i = found.names.index(f"delay {group}")
        true = float(attrs[f"true_delay_{group}"]) - float(attrs["true_delay_platen_displacement"])
        # the fused motion is later than displacements by a share of the other sensors' delays, some microseconds
        assert found.estimate[i] == pytest.approx(true, abs=4.0 * found.sd[i] + 1e-5)


def test_simulation_is_a_second_opinion_that_agrees(found, truth):
    simulated = found.subsets[-1]
    count = len(found.parameters)
    off = ((simulated.estimate[:count] - truth) / simulated.sd[:count])[np.isfinite(simulated.sd[:count])]
    assert simulated.name == "simulation"
    assert np.isnan(simulated.sd[count:]).all()  # of the sensors it has no opinion of its own
    assert len(off) > 25  # of 37 parameters
    assert np.median(np.abs(off)) < 1.2
    assert np.abs(off).max() < 5.0  # errors of the sensors, held, are only in the floor


def exact(machine: Machine, target: Target) -> xr.Dataset:
    """A test simulated without sensors."""
    return rehearse(machine, target, load_controller("lhpost6"), attrs={}, engine="fused", record_every=4).record


def test_noise_that_a_test_does_not_have_is_not_subtracted(machine, sensors, campaign):
    records = [exact(machine, noise_target(("x",), machine.limits, duration=12.0)), campaign.records[1]]
    problem = prepare_problem(machine, records, sensors, calibration_numbers())
    tests = [test.motion.acceleration for test in problem.tests]
    for replica in problem.again:
        more = [test.motion.acceleration for test in replica]
        assert np.array_equal(more[0], tests[0]) and not np.array_equal(more[1], tests[1])


@pytest.mark.slow
def test_a_test_without_noise_changes_nothing_of_the_machine_that_made_it(machine, sensors):
    """Noise that was not there was subtracted from the normal equations: inertias "changed" by up to 8 %."""
    found = calibrate(machine, [exact(machine, make_target(find_motion("ridgecrest"), scale=0.8))], sensors)
    assert found.converged
    assert [found.names[i] for i in changed_parameters(found)] == []


@pytest.mark.slow  # a whole campaign
def test_groups_of_residuals_agree_as_chance_allows_where_nothing_is_wrong(machine, sensors):
    """Seed 0: with noise in the derivatives left out of the deviations six differed, the farthest by 6.5."""
    whole = simulate_campaign(machine, load_controller("lhpost6"), sensors, seed=0)
    null = calibrate(machine, whole.records, sensors)
    apart = [one for one in contradictions(null) if one.subset != "simulation"]
    assert sum(compared(null).values()) > 250 and chance(null) < 1.0
    assert len(apart) <= 4, apart  # chance makes five or more of one expected in 0.4 % of campaigns
    assert all(abs(one.deviations) < 5.0 for one in apart)


@pytest.mark.slow
def test_a_group_that_contradicts_the_others_is_found(machine, sensors, campaign, found):
    """Horizontal load cells 4 % high, thirteen stated deviations: the wrench gives another mass than its prior."""
    high = np.where([name.startswith("H") for name in machine.actuator_names], 1.04, 1.0)
    wrong = [r.assign(actuator_force=r["actuator_force"] * high) for r in campaign.records]
    some = calibrate(machine, wrong, sensors)
    named = {(one.subset, some.names[one.unknown]) for one in contradictions(some)}
    assert ("wrench, x", "platen.mass[x]") in named
    assert len(contradictions(some)) > 10 * chance(some) > len(contradictions(found))


def test_without_spools_there_is_no_second_opinion(problem):
    blind = problem.with_tests([t.with_channels(spool_position=None) for t in problem.tests])
    x = np.zeros(len(problem.prior))
    assert by_simulation(blind, [], x, calibration_numbers(), lambda share: None) is None


def test_misfit_falls_to_the_noise(found):
    assert np.nanmax(found.misfit_before) > 10.0
    assert np.nanmax(found.misfit_after) < 1.5  # noise alone gives one; friction shaken by noise a little more


def test_override_file_makes_the_calibrated_machine(found, machine, tmp_path):
    path = save_override(found, tmp_path / "override.toml")
    again = load_machine("lhpost6", path)
    for name, quantity in found.calibrated.parameters.items():
        assert again.parameters[name].value == pytest.approx(quantity.value, rel=1e-12), name
    assert again.parameters["horizontal.flow"].source.startswith("calibrated from campaign two tests")
    assert again.parameters["horizontal.flow"].evidence == "calibrated"


def test_a_fit_that_did_not_converge_leaves_the_deviations_of_the_machine_file(found, machine, tmp_path):
    path = save_override(replace(found, converged=False), tmp_path / "override.toml")
    text = path.read_text(encoding="utf-8")
    assert "The fit did not converge" in text.split("[", 1)[0]
    again = load_machine("lhpost6", path)
    for parameter in found.parameters:
        for name, _ in parameter.paths:
            stated, quantity = machine.parameters[name], again.parameters[name]
            assert quantity.sd == stated.sd, name
            assert "did not converge" in quantity.source
    assert again.parameters["platen.mass"].value == found.calibrated.parameters["platen.mass"].value
    assert save_override(found, path).read_text(encoding="utf-8").count("sd = ") > len(found.parameters) / 2


@pytest.mark.slow
def test_chambers_shorter_than_the_stated_stroke_are_found_and_the_oil_stays_as_stiff(machine, sensors):
    short = {"horizontal.chamber_a": 0.70, "horizontal.chamber_b": 0.72}
    true = machine.with_params({**short, "horizontal.stroke": 0.65})
    records = simulate_campaign(true, load_controller("lhpost6"), sensors, seed=4, tests=("TX", "WN")).records
    again = calibrate(machine, records, sensors)
    for name, value in {**short, "hydraulics.bulk_modulus": machine.hydraulics.bulk_modulus}.items():
        i = again.names.index(name)
        k = again.parameters[i]
        assert again.estimate[i] == pytest.approx(k.coordinate(value), abs=4.0 * again.sd[i]), name
        assert again.sd[i] < 0.1 * k.sd


def test_numbers_of_an_earlier_override_stay_in_the_new_one(found, machine, tmp_path):
    earlier = machine.with_params({"limits.valve_reserve": 0.2, "horizontal.valves": 2})
    path = save_override(replace(found, machine=earlier), tmp_path / "override.toml")
    again = load_machine("lhpost6", path)
    assert again.parameters["limits.valve_reserve"].value == 0.2
    assert "horizontal.valves" not in again.parameters  # how many were open is in the records


def test_names_with_quotes_do_not_spoil_the_override_file(found, tmp_path):
    named = replace(found, campaign='the "north" C:\\tests', tests=("line\nbreak",))
    again = load_machine("lhpost6", save_override(named, tmp_path / "override.toml"))
    assert again.parameters["horizontal.flow"].source == f"calibrated from campaign {named.campaign}: {named.tests[0]}"


# ---------------------------------------------------------------------------------------------------- campaigns
def test_a_campaign_is_the_same_for_the_same_seed_and_survives_the_disk(machine, sensors, tmp_path):
    settings = load_controller("lhpost6")
    one, other = (simulate_campaign(machine, settings, sensors, seed=2, tests=("TZ",)) for _ in range(2))
    assert one.records[0].identical(other.records[0])
    save_campaign(one, tmp_path)
    again = load_campaign(tmp_path, machine)
    assert np.array_equal(again.records[0]["actuator_force"], one.records[0]["actuator_force"])

"""Tables with few sensors: what replaces chamber pressures, spools and specimens, and what may not explain itself."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.data.channels import LAYOUT, residuals_of
from lhpost6_pin.discovery import withdrawal
from lhpost6_pin.discovery.balances import gain_on
from lhpost6_pin.discovery.candidates import list_candidates, with_background
from lhpost6_pin.discovery.discover import discovery_numbers
from lhpost6_pin.discovery.estimates import Estimate, interval_reach, sums_of
from lhpost6_pin.discovery.withdrawal import Withdrawn
from lhpost6_pin.identification.calibration.free_parameters import machine_parameters
from lhpost6_pin.identification.calibration.whitened_residuals import Whitener
from lhpost6_pin.identification.decompose.record import decompose_test
from lhpost6_pin.identification.friction_march import made_fine, refined, thinned
from lhpost6_pin.identification.known_slip import slip_summary
from lhpost6_pin.identification.prepare import MeasuredTest, chamber_pressures
from lhpost6_pin.identification.residuals import evaluate_residuals, follow, oil_balance
from lhpost6_pin.identification.validation.prepare_tests import wrench_calibration
from lhpost6_pin.machine.library import families, scaled_families
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.port_path import PortPath
from lhpost6_pin.mechanics.pose import PlatenMotion


def few(test: MeasuredTest, machine: Machine) -> MeasuredTest:
    """The same with the pressure difference alone."""
    channels, rates = dict(test.channels), dict(test.rates)
    for own in (channels, rates):
        a, b = (own.pop(f"chamber_pressure_{side}") for side in "ab")
        own["pressure_difference"] = a - b
        own.pop("actuator_force", None)
    return replace(test, channels=channels, rates=rates)


# ------------------------------------------------------------------------------------------- pressures and flow
def test_a_pressure_difference_gives_the_flow_that_both_chambers_give_together(table, test):
    """Half the difference of the chambers' balances; their sum of pressures is that of a matched valve, nearly."""
    plant = make_plant(table)
    both = evaluate_residuals(plant, test, ("flow",)).flow
    alone = evaluate_residuals(plant, few(test, table), ("flow",)).flow
    scale = table.actuators[0].area_a * np.abs(test.motion.velocity[:, 0]).max()
    assert alone.shape == (len(both), 1)
    # both chambers have the same oil and nearly the same volume: what is left is the change of mean pressure
    np.testing.assert_allclose(alone[:, 0], 0.5 * (both[:, 0] - both[:, 1]), atol=2e-2 * scale)


def test_the_mean_pressure_follows_from_the_difference_by_continuity(table, test):
    """Against the simulation's own pressures; what is symmetric leaves all of the change of mean pressure."""
    plant, own = make_plant(table), few(test, table)
    balance = oil_balance(plant, own, follow(plant, own))
    assert balance is not None
    true = np.hstack([test.channels[f"chamber_pressure_{side}"] for side in "ab"]).mean(axis=1)
    found, symmetric = balance.pressure.mean(axis=1), chamber_pressures(table, own.channels).mean(axis=1)
    moving = slice(50, -50)  # the start is not at its steady mean, rates are those of a record's ends
    left, whole = (np.std((true - mean)[moving]) for mean in (found, symmetric))
    assert left < 0.3 * whole, (left, whole)


def test_a_pin_changes_sides_when_its_length_shows_it(table, test):
    """Not when the oil's force does: closed form of what an arbitrary side draws."""
    half_play, (actuator,) = 1e-4, table.actuators
    loose = make_plant(table.with_effect("swivel_play", (actuator.name,), half_play=half_play, closing_force=1e3))
    time = test.dt * np.arange(test.samples)[:, None]
    side, rate = np.sin(30.0 * time), 30.0 * np.cos(30.0 * time)
    rigid = evaluate_residuals(make_plant(table), test, ("flow",)).flow
    shown = evaluate_residuals(loose, replace(test, side=np.stack([side, rate])), ("flow",)).flow
    unknown = evaluate_residuals(loose, replace(test, side=np.full((2, test.samples, 1), np.nan)), ("flow",)).flow
    by_force = evaluate_residuals(loose, test, ("flow",)).flow
    np.testing.assert_array_equal(unknown, by_force)
    assert np.abs(by_force - shown).max() > 0.1 * np.abs(shown - rigid).max()  # the force has another rhythm
    bulk = table.hydraulics.bulk_modulus
    for k, (sign, area, name) in enumerate(((1, actuator.area_a, "a"), (-1, actuator.area_b, "b"))):
        pressed = test.rates[f"chamber_pressure_{name}"][:, 0] * area / bulk
        drawn = sign * half_play * (area * rate[:, 0] + pressed * side[:, 0])
        rounding = 1e-12 + 1e-9 * np.abs(drawn).max()
        np.testing.assert_allclose(shown[:, k] - rigid[:, k], drawn, atol=rounding)


def test_a_force_on_equal_areas_is_a_pressure_difference_and_on_others_none(table, test):
    force = {"actuator_force": np.full((3, 1), 600.0)}
    pressure = chamber_pressures(table, force)
    assert pressure is not None
    np.testing.assert_allclose(pressure[:, 0] - pressure[:, 1], 600.0 / table.actuators[0].area_a)
    assert chamber_pressures(load_machine(), {"actuator_force": np.zeros((3, 10))}) is None
    assert "flow" in residuals_of("actuator_force", {"actuator_force"})
    assert "flow" not in residuals_of("actuator_force", {"actuator_force", "chamber_pressure_a"})


def test_the_base_shear_of_measured_floors_is_in_the_balance(test, tmp_path):
    floor = (
        '\n[floor.RF]\nalong = "x"\n'
        'mass = { value = 210.0, unit = "kg", evidence = "measured", source = "weighed", rel_sd = 0.05 }\n'
        'point = { value = [0.0, 0.0, 2.0], unit = "m", evidence = "measured", source = "drawing" }\n'
    )
    path = tmp_path / "floors.toml"
    path.write_text((models_folder() / "uniaxial.toml").read_text(encoding="utf-8") + floor)
    machine = load_machine(path)
    acceleration = np.linspace(-2.0, 2.0, test.samples)[:, None]
    floored = replace(test, channels={**test.channels, "floor_acceleration": acceleration})
    plant = make_plant(machine)
    change = evaluate_residuals(plant, floored).wrench - evaluate_residuals(plant, test).wrench
    np.testing.assert_allclose(change[:, 0], 210.0 * acceleration[:, 0], rtol=1e-9)
    assert "RF.mass" in {p.name for p in machine_parameters(machine)}
    assert machine.labels["floor"] == ("RF",)
    floored = replace(floored, record=test.record.assign_coords(time=test.dt * np.arange(test.samples)))
    forces, _ = decompose_test(plant, floored)
    shear = forces.ledger.wrench[:, forces.ledger.effect("base_shear"), 0]
    np.testing.assert_allclose(shear, -210.0 * acceleration[:, 0], rtol=1e-9)
    without, _ = decompose_test(plant, replace(floored, channels=test.channels))
    np.testing.assert_allclose(forces.residual[:, 0] - without.residual[:, 0], -shear, rtol=1e-6)


# ------------------------------------------------------------------------------------------- friction at rest
def rocking(dt: float = 1 / 256, noise: float = 0.0) -> MeasuredTest:
    """A sine of 3 Hz with a rest before it, as a displacement with noise shows it."""
    motion = rocking_motion(dt, 1024)
    path = motion.displacement.copy()
    motion.displacement[:, 0] += noise * np.random.default_rng(0).standard_normal(1024)
    return MeasuredTest("rocking", dt, motion, {}, path=path)


def test_where_noise_shakes_presliding_rests_weigh_nothing_and_slip_is_marched_finely(table):
    stiff = make_plant(table.with_params({"drive.seal_yield": 5e-6}))
    test = made_fine(stiff, rocking(noise=1e-6))
    assert test.weight is not None and test.substeps > 1
    t = test.dt * np.arange(test.samples)
    assert np.all(test.weight[t < 0.9] == 0.0)
    fast = (t > 1.0) & (np.abs(test.motion.velocity[:, 0]) > 0.015)
    assert np.all(test.weight[fast] > 0.99)
    loose = made_fine(make_plant(table.with_params({"drive.seal_yield": 2e-3})), rocking(noise=1e-6))
    assert loose.weight is None and loose.substeps == 1


def test_the_mean_of_a_force_from_a_pressure_difference_is_as_sure_as_that_sensor(table):
    """It had no standard deviation in a validation, where a decomposition of the same record had 0.194 kN."""
    channels = {"pressure_difference": np.full((10, 1), 2e5)}
    spread = {"pressure_difference": (5e4, 0.01)}
    sensors = SimpleNamespace(offset_sd=lambda name: spread[name][0], gain_sd=lambda name: spread[name][1])
    plant = make_plant(table)
    test = SimpleNamespace(basis=SimpleNamespace(sensors=sensors), plant=plant, test=SimpleNamespace(channels=channels))
    wanted = table.actuators[0].area_a * np.hypot(5e4, 0.01 * 2e5)
    assert wrench_calibration(test)[0] == pytest.approx(wanted, rel=1e-9)  # rounding: one actuator along x
    test.test.channels = {}
    assert np.isnan(wrench_calibration(test)).all()


def test_the_error_of_forces_is_stated_without_the_samples_that_a_fit_leaves_out(table):
    """What discover promises is over the rest: an error where slip is unknown is none of the promise."""
    stiff = make_plant(table.with_params({"drive.seal_yield": 5e-6}))
    test = rocking(noise=1e-6)
    weight = made_fine(stiff, test).weight
    measured, residual = np.zeros((2, test.samples, 6))
    measured[:, 0] = 100.0 * test.motion.velocity[:, 0]
    residual[:, 0] = 0.02 * measured[:, 0] + 50.0 * (weight == 0.0) * np.cos(np.arange(test.samples))
    words = slip_summary(stiff, test, measured, residual, slice(None))
    unknown = f"unknown in {100.0 * (1.0 - weight.mean()):.0f} % of the samples"
    assert words == f"friction's slip is {unknown}, RRMSE along x in the others 2 %"
    loose = make_plant(table.with_params({"drive.seal_yield": 2e-3}))
    assert slip_summary(loose, test, measured, residual, slice(None)) == ""


def test_a_fine_march_is_the_march_of_a_record_sampled_as_finely(table):
    """Friction that yields within a turn-back, at 256 Hz with substeps against 4096 Hz without."""
    plant = make_plant(table.with_params({"drive.seal_yield": 5e-6}))
    coarse, fine = rocking(), rocking(dt=1 / 4096)
    fine = replace(fine, motion=rocking_motion(1 / 4096, 16 * 1023 + 1), path=None)
    row = plant.rows[plant.rows["state"] >= 0]
    state = int(next(r["state"] for r in row if r["spool"] < 0))
    wanted = follow(plant, fine).z[:, state]
    smooth = np.convolve(wanted, np.ones(17) / 17, "same")[::16]  # the mean over one interval, as the march gives it
    found = follow(plant, replace(coarse, path=None, substeps=16)).z[:, state]
    rough = follow(plant, replace(coarse, path=None)).z[:, state]
    inside = slice(280, -4)
    error, without = (np.sqrt(np.mean((z - smooth)[inside] ** 2)) for z in (found, rough))
    assert error < 0.02 and without > 3.0 * error  # cubic interpolation of 3 Hz at 256 Hz: micrometres of 2 mm


@pytest.mark.parametrize("count", [2, 5])
def test_a_refined_path_is_the_cubic_hermite_spline_through_its_samples(count):
    """SciPy's spline of coordinate and of slip; both to rounding: coordinates of order one, 40 samples summed."""
    rng, dt = np.random.default_rng(3), 1 / 256
    s, rate, slip = rng.normal(size=(3, 40, 2))
    slip[0] = 0.0
    fine = refined(PortPath(s, rate, slip, np.zeros((40, 2, 6)), np.zeros((40, 3, 3))), dt, count)
    t, at = np.arange(40) * dt, np.arange(39 * count + 1) * dt / count
    spline, gone = CubicHermiteSpline(t, s, rate), CubicHermiteSpline(t, np.cumsum(slip, axis=0), rate)
    np.testing.assert_allclose(fine.s, spline(at), atol=1e-13)
    np.testing.assert_allclose(fine.rate, spline(at, 1), atol=1e-10)
    np.testing.assert_allclose(np.cumsum(fine.slip, axis=0), gone(at), atol=1e-12)


@pytest.mark.parametrize("count", [2, 5])
def test_thinned_states_are_means_over_an_interval_about_each_sample(count):
    z = np.random.default_rng(4).normal(size=(9 * count + 1, 3))
    width = 2 * (count // 2) + 1
    padded = np.pad(z, ((count // 2, count // 2), (0, 0)), "edge")
    wanted = np.lib.stride_tricks.sliding_window_view(padded, width, axis=0).mean(axis=-1)[::count]
    np.testing.assert_allclose(thinned(z, count), wanted, atol=1e-14)


def rocking_motion(dt: float, samples: int) -> PlatenMotion:
    """The motion of `rocking` at another rate."""
    t = np.arange(samples) * dt
    turn, motion = 2.0 * np.pi * 3.0, [np.zeros((samples, 6)) for _ in range(3)]
    phase = turn * np.maximum(t - 1.0, 0.0)
    motion[0][:, 0] = 2e-3 * (1.0 - np.cos(phase))
    motion[1][:, 0] = 2e-3 * turn * np.sin(phase)
    motion[2][:, 0] = 2e-3 * turn**2 * np.cos(phase) * (t > 1.0)
    return PlatenMotion(*motion)


# ------------------------------------------------------------------------------------------- library and priors
def test_the_library_has_the_size_of_the_machine_and_is_that_of_the_lhpost6_itself(table):
    assert scaled_families(load_machine()) == families()
    heavier = [1.02 * mass for mass in load_machine().platen.mass]
    fitted = load_machine().with_params({"platen.mass": heavier})
    small, large = scaled_families(table), families()
    assert scaled_families(fitted)["added_mass"] == scaled_families(load_machine())["added_mass"]
    friction = [group["stribeck_friction"].shapes for group in (small, large)]
    force = table.hydraulics.supply_pressure * table.actuators[0].area_a
    assert friction[0][0].typical < 0.05 * force < friction[1][0].typical * 10
    assert friction[0][1] == friction[1][1]  # a Stribeck speed is that of the film, not of the table


def test_a_coefficient_beyond_its_source_is_refused(table):
    with pytest.raises(ParameterError, match=r"coefficient = 0.95 1 is not between 0 and 0.05"):
        make_plant(table.with_effect("load_dependent_friction", ("A1",), coefficient=0.95))


def test_a_wide_prior_is_one_of_the_logarithm(table):
    wide = table.with_params({"drive.seal_yield": {"value": 5e-5, "rel_sd": 2.0}})
    found = {p.name: p for p in machine_parameters(wide)}
    assert found["drive.seal_yield"].form == "log" and found["drive.viscous"].form == "factor"
    assert found["drive.seal_yield"].sd == pytest.approx(np.log(3.0))


def test_where_spools_are_not_measured_their_lag_is_fitted_and_never_a_candidate(table):
    blind = {"platen_displacement", "pressure_difference", "valve_command"}
    names = {one.name for one in with_background(table, 1.5, blind)[1]}
    assert "spool_lag_A1.time" in names
    assert "spool_lag_A1.time" not in {one.name for one in with_background(table, 1.5, LAYOUT)[1]}
    listed = {c.family.name for group in list_candidates(table, blind) for c in group}
    assert not listed & {"spool_lag", "transport_delay"}
    assert {"spool_lag", "transport_delay"} <= {c.family.name for group in list_candidates(table) for c in group}


def test_delay_and_lag_have_an_interval_as_a_sum_where_the_spool_is_not_measured(table):
    """Each alone had one of a per cent, half a millisecond off: a fit cannot tell them apart, whatever it predicts."""
    blind = {"platen_displacement", "pressure_difference", "valve_command"}
    path = f"{table.actuators[0].kind}.valve_delay"
    uncertain = {path: replace(table.parameters[path], sd=2e-3)}
    quantities = {**table.parameters.quantities, **uncertain}
    table = replace(table, parameters=replace(table.parameters, quantities=quantities))
    machine, background = with_background(table, 1.5, blind)
    lag = next(p for p in background if p.name == "spool_lag_A1.time")
    delay = next(p for p in machine_parameters(machine) if p.name == path)
    x, step = np.array([lag.coordinate(2e-3), 0.1]), 1e-6
    slopes = np.array([p.slope(c) for p, c in zip((lag, delay), x, strict=True)])
    differences = [(p.at(c + step) - p.at(c - step)) / (2 * step) for p, c in zip((lag, delay), x, strict=True)]
    assert slopes == pytest.approx(differences, rel=1e-8)  # central, of coordinates near one
    sd, alike = 3e-4, 0.999  # [s] of each, and their correlation, negative
    covariance = np.outer(sd / slopes, sd / slopes) * np.array([[1.0, -alike], [-alike, 1.0]])

    def sums(channels: set[str]) -> dict:
        test = SimpleNamespace(channels=channels)
        problem = SimpleNamespace(parameters=(lag, delay), machine=machine, tests=[test])
        solution = SimpleNamespace(x=x)
        return sums_of(SimpleNamespace(problem=problem, solution=solution, numbers=discovery_numbers()[0]), covariance)

    ((names, total),) = sums(blind).items()
    assert names == (delay.name, lag.name) and total.unit == "s"
    assert total.value == pytest.approx(delay.at(0.1) + 2e-3)
    half = interval_reach(discovery_numbers()[0].number("verdict.probability")) * sd * np.sqrt(2.0 * (1.0 - alike))
    assert (total.low, total.high) == pytest.approx((total.value - half, total.value + half))
    assert sums({*blind, "spool_position"}) == {}


def test_a_machine_that_has_an_effect_already_gets_no_second_one_of_its_name(table):
    """Once searched with its own model.toml, a machine ended in `an effect named ... is in this machine already`."""
    there = table.with_effect("stribeck_friction", ("A1",), name="stribeck_friction_A1")
    assert "stribeck_friction_A1" not in {c.name for group in list_candidates(there) for c in group}
    again = with_background(there, 1.5, LAYOUT)[0]
    assert with_background(again, 1.5, LAYOUT)[1] == ()


# ------------------------------------------------------------------------------------------- held-out tests
class Held:
    """Tests held out, as `gain_on` sees them."""

    whitener = Whitener(np.array([0.0, 10.0, 20.0]), np.ones((1, 2, 1, 1), np.complex128))
    frequency = (np.linspace(0.1, 19.9, 400),)


class Left:
    """A residual."""

    def __init__(self, bins: np.ndarray) -> None:
        """Of one test, (m, 1)."""
        self.whitened = [bins]


@pytest.mark.parametrize(("share", "closes"), [(1.0, True), (0.0, False), (-1.0, False)])
def test_only_an_effect_that_is_there_gains_on_held_out_tests_what_its_change_promises(share, closes):
    """Noise of unit power and an effect three times as large; a change of that size, with it, across it, against it."""
    rng = np.random.default_rng(2)
    noise, own, other = (rng.standard_normal((400, 1, 2)) @ np.array([1.0, 1.0j]) / np.sqrt(2.0) for _ in range(3))
    effect = 3.0 * own
    change = share * effect + (3.0 * other if share == 0.0 else 0.0)
    gain, expected = gain_on(Held, Left(noise + effect), Left(noise + effect - change), np.array([True]))
    assert expected > 100.0
    assert (gain > 0.3 * expected) == closes
    assert closes or gain < 0.0


def test_the_gain_of_a_true_effect_scatters_by_the_root_of_twice_what_is_expected():
    """By noise alone, over 300 draws: their mean within 4 sd / sqrt(300) = 2, their deviation within 4 / sqrt(600)."""
    rng = np.random.default_rng(5)
    gains = []
    for _ in range(300):
        noise, own = (rng.standard_normal((400, 1, 2)) @ np.array([1.0, 1.0j]) / np.sqrt(2.0) for _ in range(2))
        change = 0.3 * own / np.sqrt(np.mean(np.abs(own) ** 2))
        gains.append(gain_on(Held, Left(noise + change), Left(noise), np.array([True]))[0])
    expected = 0.09 * 400
    assert np.mean(gains) == pytest.approx(expected, abs=2.0)
    assert np.std(gains) == pytest.approx(np.sqrt(2.0 * expected), rel=0.16)


BACKLASH = SimpleNamespace(family=families()["backlash"], components=("A1",), release="", name="backlash_A1")
ADDED = SimpleNamespace(candidate=BACKLASH, gain=80.0)
SIZE = "backlash_A1.friction"


def why_withdrawn(judged: Callable[..., Withdrawn | None], *args: object, **given: object) -> str | None:
    """Why an effect is no finding, where what is computed of the search is `given` by name."""
    with ExitStack() as patched:
        for name, result in given.items():
            patched.enter_context(mock.patch.object(withdrawal, name, return_value=result))
        found = judged(*args)
    return found and found.why


@pytest.mark.parametrize(
    ("share", "half", "bounds", "why"),
    [
        (0.2, 0.02, (), None),
        (0.05, 0.01, (), "own_form"),  # a null of the one-axis battery: a twentieth, beside presliding of Dahl's form
        (0.2, 0.3, (), "zero"),  # small_table t5 had local viscous friction of 430 N s/m within 430 of zero named
        (0.2, 0.02, (SIZE,), "at_bound"),
        (0.2, 0.02, ("backlash_A1.gap",), "at_bound"),
        (0.2, 0.02, ("drive.seal_shape",), None),
    ],
)
def test_an_effect_on_guides_that_its_own_numbers_reject_is_no_finding(table, share, half, bounds, why):
    friction = table.actuators[0].seal_friction
    given = {"amplitude_of": SIZE, "fitted_machine": table}
    value, low, high = (friction * f for f in (share, share - half, share + half))
    estimates = {SIZE: Estimate(value, "N", low, high)}
    for machine in (table, load_machine()):
        problem = SimpleNamespace(machine=machine)
        found = SimpleNamespace(problem=problem, solution=None, numbers=discovery_numbers()[0], added=(ADDED,))
        free = None if SIZE not in bounds else "at_bound"  # on legs the size alone
        wanted = why if machine is table else free
        assert why_withdrawn(withdrawal._by_estimate, found, ADDED, bounds, estimates, **given) == wanted


def test_an_effect_that_a_held_out_test_hardly_shows_stays_only_where_that_test_need_not_excite_it(table):
    """A null of the one-axis battery had backlash of tiny size named, which its held-out test did not confirm."""
    held = SimpleNamespace(tests=[SimpleNamespace(channels=LAYOUT)], kinds=("wrench", "flow"), rows=lambda _: [True])
    left = SimpleNamespace(whitened=[np.ones((9, 1))])
    given = {"residual_at": left, "without_effect": SimpleNamespace(solution=None), "gain_on": (2.0, 6.0)}
    given["share_explained"] = np.nan
    for machine, wanted in ((table, "held_out"), (load_machine(), None)):
        problem = SimpleNamespace(machine=machine, unknowns=())
        found = SimpleNamespace(problem=problem, numbers=discovery_numbers()[0], refit=None, solution=None)
        assert why_withdrawn(withdrawal._by_held_out, found, ADDED, held, left, left, **given) == wanted


@pytest.mark.parametrize(
    ("gain", "expected", "share", "why"),
    [
        (243.0, 394.0, 0.69, None),  # air in the oil beside an overlap of all valves, of a hundred times its residual
        (243.0, 394.0, 0.4, "held_out"),
        (300.0, 394.0, 0.4, None),  # most of the gain that is expected
        (100.0, 394.0, 0.69, "held_out"),  # less than three tenths of it
        (262.0, 1000.0, 0.69, None),  # a dead volume, as well: what has another form gains at most a tenth of that
        (13.5, 12.1, np.nan, None),  # thrust along the platen's normal where it hardly tilts: nothing is beyond noise
        (3.5, 13.5, np.nan, None),  # a leak, by two deviations of noise less than expected, by three more than by none
        (-1.0, 13.5, np.nan, "held_out"),
        (-12.7, 5.5, np.nan, "held_out"),  # an inertia 40 % off, named for thrust along the normal that no test excites
        (-5.0, 5.5, np.nan, None),  # within chance
    ],
)
def test_a_weak_effect_is_judged_by_what_is_beyond_noise(gain, expected, share, why):
    """Squares before any effect, of noise or of a strong one beside it, are no measure of it."""
    held = SimpleNamespace(tests=[SimpleNamespace(channels=LAYOUT)], kinds=("wrench", "flow"), rows=lambda _: [True])
    left = SimpleNamespace(whitened=[np.ones((9, 1))])
    given = {"residual_at": left, "without_effect": SimpleNamespace(solution=None), "gain_on": (gain, expected)}
    given |= {"lowers_squares": False, "is_absorbed": False, "absorbing": (), "share_explained": share}
    problem = SimpleNamespace(machine=load_machine(), unknowns=())
    found = SimpleNamespace(problem=problem, numbers=discovery_numbers()[0], refit=None, solution=None, added=(ADDED,))
    assert why_withdrawn(withdrawal._by_held_out, found, ADDED, held, left, left, **given) == why

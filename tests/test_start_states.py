"""Friction's state at the start of a test: taken out of the residuals, as if it were one more unknown."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lhpost6_pin.core.names import AXES
from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.effects.registry import law_of, states_of
from lhpost6_pin.identification.calibration import calibration_numbers
from lhpost6_pin.identification.calibration.operating_point import OperatingPoint
from lhpost6_pin.identification.calibration.prepare import prepare_problem
from lhpost6_pin.identification.calibration.start_states import no_start_states, start_states
from lhpost6_pin.identification.friction_start import estimate_start, start_wrenches
from lhpost6_pin.identification.inverse_dynamics import leg_wrenches
from lhpost6_pin.identification.residuals import evaluate_residuals, follow
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.pose import plant_motion

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
    remains = start_states(change).less(bins)
    np.testing.assert_allclose([power(remains[..., k]) for k in range(3)], least, rtol=1e-9)
    np.testing.assert_array_equal(remains[:, 1], bins[:, 1])


def test_weights_that_change_scale_what_remains():
    rng = np.random.default_rng(1)
    change, bins = (rng.standard_normal((12, 4, 3)) + 1j * rng.standard_normal((12, 4, 3)) for _ in range(2))
    scale = rng.uniform(0.5, 2.0, (12, 4))
    states = start_states(change)
    again = states.scaled(scale).less(bins * scale[..., None])
    np.testing.assert_allclose(again, states.less(bins) * scale[..., None], rtol=0.0, atol=1e-12)  # rounding


def test_a_test_without_forces_is_left_as_it_is(base):
    test = without_forces(base.tests[0])
    assert start_wrenches(base.plant, test)[0].shape == (test.samples, 6, 0)
    assert not estimate_start(base.plant, test, 30.0).any()
    bins = np.ones((7, 3, 1), complex)
    assert no_start_states(7).less(bins) is bins


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
    white = problem.whitener.apply(0, change[..., None], problem.frequency[0])
    remains = problem.whitened(0, change[..., None])
    assert power(white) > 30.0 * share**2
    assert power(remains) < 0.05 * power(white) + 3.0 * share**2  # priors allow for one deviation of every state
    rng = np.random.default_rng(2)
    noise = rng.standard_normal(white.shape) + 1j * rng.standard_normal(white.shape)
    assert power(problem.starts[0].less(noise)) > 0.99 * power(noise)


def full(plant):
    """All of the friction held at the start, in directions of chance."""
    start = drawn(plant, 1.0)
    for row in plant.rows:
        if law_of(row).friction_memory:
            start[states_of(row)] /= np.linalg.norm(start[states_of(row)])
    return start


@pytest.mark.parametrize("held", [lambda plant: drawn(plant, 0.8), full], ids=["part", "full"])
def test_the_balance_of_forces_shows_what_is_held_at_the_start(base, held):
    """Forces of a test that began with states of its own, from the motion and forces of one that did not.

    From full friction on the force is no linear function of the state: what remains is within a twentieth of the noise.
    """
    plant, test, start = base.plant, base.tests[0], held(base.plant)
    rest = evaluate_residuals(plant, test, ("wrench",)).wrench
    more = evaluate_residuals(plant, test, ("wrench",), path=follow(plant, test, start=start)).wrench - rest
    arms = leg_wrenches(plant, plant_motion(plant, test.motion).q, np.ones((test.samples, plant.spools)))
    force = test.channels["actuator_force"] + np.einsum("ni,nik->nk", more, np.linalg.pinv(arms))
    began = replace(test, channels=test.channels | {"actuator_force": force})
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

"""Inverse dynamics: a run comes apart into the forces that made it; another account of the same equations agrees."""

import numpy as np
import pytest
from machine_cases import PENDULUM, machine_named
from run_cases import RATE, every_step, forces_of, motion_of

from lhpost6_pin.core.errors import RecordError, SimulationError
from lhpost6_pin.identification.inverse_dynamics import Decomposition, inverse_dynamics, leg_wrenches, march_states
from lhpost6_pin.identification.prepare import MeasuredTest
from lhpost6_pin.identification.residuals import evaluate_residuals
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.port_path import ports_along
from lhpost6_pin.mechanics.pose import PlatenMotion, plant_motion
from lhpost6_pin.simulation.ledger import force_ledger
from lhpost6_pin.simulation.simulate import Run

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def run() -> Run:
    """Half a second of all six axes at 8192 Hz."""
    return every_step(machine_named("lhpost6"))


@pytest.fixture(scope="module")
def found(run: Run) -> Decomposition:
    return inverse_dynamics(run.plant, run.time, motion_of(run), *forces_of(run), model_step=True)


def test_a_run_recorded_at_the_model_step_comes_apart_to_rounding(found: Decomposition):
    largest = np.abs(found.measured).max(axis=0)
    assert (largest > 1e5).all()  # all six axes are shaken
    # 4000 steps of 1e-16 each in the states, and a meganewton of weight and struts against each other
    assert (np.abs(found.residual).max(axis=0) < 1e-11 * np.abs(found.measured).max()).all()


@pytest.mark.parametrize("name", ["stewart", "uniaxial"])
def test_other_machines_come_apart_as_well(name: str):
    run = every_step(machine_named(name), 0.2)
    found = inverse_dynamics(run.plant, run.time, motion_of(run), *forces_of(run), model_step=True)
    axes = run.plant.axes
    assert np.abs(found.measured[:, axes]).max() > 1e3
    assert np.abs(found.residual[:, axes]).max() < 1e-10 * np.abs(found.measured).max()


def test_without_the_velocity_that_forces_saw_the_rest_is_of_second_order(run: Run):
    left = []
    for rate in (RATE // 2, RATE):
        other = run if rate == RATE else every_step(machine_named("lhpost6"), 0.5, rate)
        taken = inverse_dynamics(other.plant, other.time, motion_of(other), *forces_of(other))
        left.append(np.sqrt(np.mean(taken.residual**2, axis=0)))
    np.testing.assert_allclose(left[0] / left[1], 4.0, rtol=0.1)  # third-order terms


def test_marched_friction_is_that_of_the_run(run: Run):
    columns = [i for i, name in enumerate(run.plant.states) if "pressure" not in name]
    ports = ports_along(run.plant, plant_motion(run.plant, motion_of(run)))
    z = march_states(run.plant, ports, 1.0 / RATE, start=run.z[0])
    assert np.abs(run.z[:, columns]).max() > 0.5  # pads and seals slide
    # lengths of 5 m round to 1e-15 m, 5e-12 of the seals' yield of 0.2 mm
    assert np.abs(z[:, columns] - run.z[:, columns]).max() < 2e-11


def test_leg_wrenches_are_those_of_the_ledger(run: Run, found: Decomposition):
    ledger = force_ledger(run)
    actuators = sum(ledger.wrench[:, ledger.effect(e.name)] for e in run.plant.machine.effects if e.spools)
    assert np.abs(found.measured - actuators).max() < 1e-9 * np.abs(actuators).max()  # poses twice through Euler angles
    assert found.struts_measured is not None
    assert np.abs(found.struts_measured - ledger.wrench[:, ledger.effect("hold_down")]).max() < 1.0  # N, of 7 MN


def test_a_unit_force_along_a_vertical_leg_pushes_the_platen_up(run: Run):
    names = run.plant.machine.actuator_names
    force = np.zeros((1, len(names)))
    force[0, names.index("V1")] = 1.0
    wrench = leg_wrenches(run.plant, run.plant.zero_state().q[None], force)[0, names.index("V1")]
    x, y, _ = run.plant.machine.actuators[names.index("V1")].platen_point
    np.testing.assert_allclose(wrench, [0, 0, 1, y, -x, 0], atol=1e-12)


def test_modelled_and_measured_dissipation_differ_by_the_residual_and_the_struts(found: Decomposition):
    assert found.struts_measured is not None
    left = found.dissipative_measured - found.dissipative
    expected = found.residual + found.struts - found.struts_measured
    np.testing.assert_allclose(left, expected, atol=1e-9 * np.abs(found.measured).max())


def test_pin_rnea_and_the_compiled_dynamics_leave_the_same_residual(run: Run):
    """Two routes: Pinocchio's inverse dynamics here, the mass matrix times what forward dynamics misses there."""
    motion, (force, struts) = motion_of(run), forces_of(run)
    wrong = 1.1 * force
    taken = inverse_dynamics(run.plant, run.time, motion, wrong, struts)
    test = MeasuredTest("t", 1.0 / RATE, motion, {"actuator_force": wrong, "strut_pressure": struts})
    other = evaluate_residuals(run.plant, test, ("wrench",)).wrench
    assert np.abs(taken.residual).max() > 1e5
    assert np.abs(other - taken.residual).max() < 1e-13 * np.abs(taken.component_wrench).max()  # rounding


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.nan, "platen_displacement at sample 77: "),
        (np.inf, "platen_displacement at sample 77: "),
        (5.0, r"sample 77: H[1-4] is out of its stroke, .*; check its channels, units"),
    ],
)
def test_a_pose_that_is_not_finite_or_out_of_a_stroke_is_named_by_its_sample(run: Run, value: float, message: str):
    motion = motion_of(run)
    motion.displacement[77, 0] = value
    with pytest.raises(RecordError, match=message):
        inverse_dynamics(run.plant, run.time, motion, *forces_of(run))


def test_a_specimen_with_joints_is_refused_and_locked_it_comes_apart():
    machine = machine_named("lhpost6")
    loose, locked = (machine.with_specimen(PENDULUM, locked=x) for x in (False, True))
    still = PlatenMotion(*np.zeros((3, 8, 6)))
    with pytest.raises(SimulationError, match="--locked"):
        inverse_dynamics(make_plant(loose), np.arange(8) / 512, still, np.zeros((8, 10)))
    run = every_step(locked, 0.2)
    taken = inverse_dynamics(run.plant, run.time, motion_of(run), *forces_of(run), model_step=True)
    assert np.abs(taken.residual).max() < 1e-11 * np.abs(taken.measured).max()

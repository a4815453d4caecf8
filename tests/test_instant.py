"""Single instants on Pinocchio's types against the report's formulas, written by hand in `kinematics`."""

import numpy as np
import pinocchio as pin
import pytest
from machine_cases import FREE_MACHINES, machine_named, plant_named, random_poses

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.mechanics import kinematics as kin
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.instant import displacement_of, legs_at, platen_pose_at, required_wrench_at, wrench_at

RNG = np.random.default_rng(4)


@pytest.mark.parametrize("thrust", ["report", "normal"])
@pytest.mark.parametrize("name", FREE_MACHINES)
def test_the_wrench_of_actuator_forces_is_that_of_eqs_4_22_to_4_24(name: str, thrust: str) -> None:
    plant, machine = plant_named(name, thrust), machine_named(name, thrust)
    for values in random_poses(machine, 12) / 3.0:
        force = RNG.uniform(-1e6, 1e6, plant.spools)
        found = wrench_at(plant, platen_pose_at(values), force)
        due = pin.Force.Zero()
        for component, axial in zip(machine.actuators, force, strict=True):
            arm = kin.component_vector(machine, values, component) + component.base_point - values[:3]
            push = kin.component_force(machine, values, component, axial)
            due += pin.Force(push, np.cross(arm, push))
        np.testing.assert_allclose(found.vector, due.vector, atol=1e-13 * 1e7)  # sums of ten


def test_a_pose_is_the_reports_rotation_and_comes_back() -> None:
    for values in random_poses(machine_named("lhpost6"), 12):
        pose = platen_pose_at(values)
        np.testing.assert_allclose(pose.rotation, kin.rotation(values[3:]), atol=1e-15)
        np.testing.assert_allclose(displacement_of(pose), values, atol=1e-15)


@pytest.mark.parametrize("name", FREE_MACHINES)
def test_what_actuators_deliver_is_the_power_of_their_wrench(name: str) -> None:
    """Power of the wrench on a twist is that of the forces on the rates, where thrust conserves energy."""
    plant = plant_named(name, "normal")
    for values in random_poses(machine_named(name), 12) / 3.0:
        pose, force = platen_pose_at(values), RNG.uniform(-1e6, 1e6, plant.spools)
        twist = pin.Motion(RNG.uniform(-1.0, 1.0, 6))
        s, rates = legs_at(plant, pose, twist)
        lengths = kin.inverse_kinematics(machine_named(name), values)
        np.testing.assert_allclose(
            s[: plant.spools], lengths - kin.inverse_kinematics(plant.machine, np.zeros(6)), atol=1e-14
        )
        missed = wrench_at(plant, pose, force).dot(twist) - force @ rates[: plant.spools]
        assert abs(missed) < 1e-13 * np.abs(force).sum() * 10.0  # speeds up to 10 m/s


@pytest.mark.parametrize("name", FREE_MACHINES)
def test_the_required_wrench_is_that_of_eqs_4_24_to_4_29(name: str) -> None:
    plant, machine = plant_named(name), machine_named(name)
    for values in random_poses(machine, 12):
        twist, rate = pin.Motion(RNG.uniform(-1.0, 1.0, 6)), pin.Motion(RNG.uniform(-9.0, 9.0, 6))
        found = required_wrench_at(plant, platen_pose_at(values), twist, rate)
        turn, centre = kin.rotation(values[3:]), np.array(machine.platen.centre_of_gravity)
        lever = turn @ centre
        omega, alpha = twist.angular, rate.angular
        v = twist.linear + np.cross(omega, lever)
        a = rate.linear + np.cross(alpha, lever) + np.cross(omega, np.cross(omega, lever))
        b_V = np.concatenate([turn.T @ omega, turn.T @ v])
        b_A = np.concatenate([turn.T @ alpha, turn.T @ a - np.cross(turn.T @ omega, turn.T @ v)])
        at_b = kin.inertial_wrench(machine, b_V, b_A) - kin.external_wrench(machine, values, {})
        force, moment = turn @ at_b[3:], turn @ at_b[:3]
        due = pin.Force(force, moment + np.cross(lever, force))
        np.testing.assert_allclose(found.vector, due.vector, atol=1e-13 * np.abs(due.vector).max())


@pytest.mark.parametrize("name", FREE_MACHINES)
def test_actuators_at_rest_hold_the_weight_against_the_struts(name: str) -> None:
    plant = plant_named(name)
    rest = find_equilibrium(plant)
    pull = [-strut.pressure * strut.area for strut in plant.machine.struts]
    still = required_wrench_at(plant, rest.pose, pin.Motion.Zero(), pin.Motion.Zero())
    given = wrench_at(plant, rest.pose, [*rest.force, *pull])
    np.testing.assert_allclose(given.vector, still.vector, atol=1e-8)  # of 5e6 N
    np.testing.assert_allclose(rest.wrench.vector, wrench_at(plant, rest.pose, rest.force).vector, atol=1e-8)


def test_a_pose_out_of_stroke_names_its_actuator() -> None:
    with pytest.raises(RecordError, match=r"H[12] is out of its stroke"):
        wrench_at(plant_named("lhpost6"), platen_pose_at([3.0, 0, 0, 0, 0, 0]), np.ones(10))

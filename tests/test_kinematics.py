"""The report's Chapter 3, and single instants, against Pinocchio and finite differences over the travel range."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from machine_cases import FREE_MACHINES, MACHINES, machine_named, plant_named, platen_se3, random_poses
from run_cases import at_rest

from lhpost6_pin.core.errors import RecordError, SimulationError
from lhpost6_pin.mechanics import kinematics as kin
from lhpost6_pin.mechanics.instant import displacement_of, legs_at, platen_pose_at, required_wrench_at, wrench_at
from lhpost6_pin.mechanics.rigid_body import make_model

LHPOST6 = machine_named("lhpost6")
POSES = random_poses(LHPOST6, 24)
ROUNDING = 1e-13  # some ten operations on numbers below 10 in double precision
H = 1e-5  # step of central differences: truncation h^2/6 L''' ~ 1e-11, rounding eps/h ~ 1e-11
DIFFERENCE = 2e-9  # their sum with a margin for L''' up to 100 (lengths of some m, angles of a few degrees)

angles = st.tuples(
    st.floats(-3.1, 3.1),
    st.floats(-1.5, 1.5),  # Eq. 3-3: pitch stays within a quarter turn
    st.floats(-3.1, 3.1),
)
vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3)


def central(function, pose, direction):
    """Directional derivative of function(pose) by central differences."""
    return (np.asarray(function(pose + H * direction)) - np.asarray(function(pose - H * direction))) / (2.0 * H)


def twists(count, seed=1):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.0, 1.0, (count, 6)) * [0.3, 0.3, 0.5, 3.0, 2.0, 0.5]


def motion_of(twist):
    return pin.Motion(kin.to_pinocchio_order(twist))


def all_frames(machine, pose):
    """One frame of every kind of the report's Table 3.1."""
    swivel = [c for c in machine.components if not kin.is_bearing(c)]
    bearing = [c for c in machine.components if kin.is_bearing(c)]
    frames = [kin.frame_s(), kin.frame_c(pose), kin.frame_b(machine, pose)]
    frames += [kin.frame_p(machine, pose, c) for c in (swivel[0], swivel[-1], *bearing[:1])]
    return frames + [kin.frame_n(machine, pose, c) for c in bearing[1:2]]


# Order ---------------------------------------------------------------------------------------------------------------


def test_report_order_is_angular_first_and_pinocchio_order_linear_first():
    omega, v = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    twist = kin.to_pinocchio_order(np.concatenate([omega, v]))
    motion = pin.Motion(v, omega)
    assert np.array_equal(twist, motion.vector)
    assert np.array_equal(kin.to_report_order(motion.vector), np.concatenate([omega, v]))
    rows = np.arange(12.0).reshape(2, 6)
    assert np.array_equal(kin.to_report_order(kin.to_pinocchio_order(rows)), rows)


# Rotations -----------------------------------------------------------------------------------------------------------


@given(st.floats(-7.0, 7.0), vectors, vectors)
def test_elementary_rotations_and_the_skew_matrix_are_pinocchios(angle, x, y):
    for axis, rotation in zip("xyz", (kin.rotation_x, kin.rotation_y, kin.rotation_z), strict=True):
        assert np.allclose(rotation(angle), pin.utils.rotate(axis, angle), rtol=0.0, atol=1e-15)
    assert np.array_equal(kin.skew(x), pin.skew(np.array(x)))
    assert np.allclose(kin.skew(x) @ y, np.cross(x, y), rtol=0.0, atol=1e-13)


@given(angles)
def test_rotation_and_the_euler_rate_jacobians_are_pinocchios(euler):
    rpy = np.array(euler)
    assert np.allclose(kin.rotation(euler), pin.rpy.rpyToMatrix(*euler), rtol=0.0, atol=1e-15)
    for own, reference in ((kin.s_J_E, pin.LOCAL_WORLD_ALIGNED), (kin.b_J_E, pin.LOCAL)):
        assert np.allclose(own(euler), pin.rpy.computeRpyJacobian(rpy, reference), rtol=0.0, atol=1e-15)


@given(angles, vectors)
def test_angular_velocity_is_what_turns_the_rotation_matrix(euler, rates):
    euler, rates = np.array(euler), np.array(rates) / 10.0
    turn = kin.rotation(euler)
    rate = central(kin.rotation, euler, rates)
    assert np.allclose(rate, kin.skew(kin.s_J_E(euler) @ rates) @ turn, atol=DIFFERENCE)  # Eq. 3-7
    assert np.allclose(rate, turn @ kin.skew(kin.b_J_E(euler) @ rates), atol=DIFFERENCE)  # Eq. 3-9
    # Eq. 3-11: {b}'s components are {s}'s, turned back
    assert np.allclose(kin.b_J_E(euler), turn.T @ kin.s_J_E(euler), atol=ROUNDING)


# Twists and wrenches between frames ----------------------------------------------------------------------------------


@given(angles, vectors, angles, vectors)
def test_twist_jacobian_between_any_frames_is_pinocchios_action(euler_f, at_f, euler_g, at_g):
    f = pin.SE3(kin.rotation(euler_f), np.array(at_f))
    g = pin.SE3(kin.rotation(euler_g), np.array(at_g))
    placement = f.actInv(g)  # f_M_g
    jacobian = kin.f_J_g(f, g)
    action = placement.toActionMatrix()
    reordered = kin.to_pinocchio_order(kin.to_pinocchio_order(jacobian).T).T
    assert np.allclose(reordered, action, rtol=0.0, atol=1e-13)
    assert np.allclose(jacobian @ kin.f_J_g(g, f), np.eye(6), rtol=0.0, atol=1e-12)  # Eq. 3-16; |r| <= 35 m, squared
    wrench = kin.to_pinocchio_order(kin.to_pinocchio_order(kin.wrench_transform(f, g)).T).T
    assert np.allclose(wrench, placement.toDualActionMatrix(), rtol=0.0, atol=1e-13)
    assert np.allclose(kin.wrench_transform(f, g), np.linalg.inv(jacobian).T, rtol=0.0, atol=1e-11)  # Eq. 4-22


@pytest.mark.parametrize("name", FREE_MACHINES)
def test_twists_in_all_frames_are_one_motion_to_pinocchio_and_power_is_the_same(name):
    machine = machine_named(name)
    for pose, twist, wrench in zip(random_poses(machine, 12), twists(12), twists(12, seed=2), strict=True):
        b = kin.frame_b(machine, pose)
        assert np.allclose(b.homogeneous, platen_se3(machine, pose).homogeneous, atol=ROUNDING)
        in_world = b.act(motion_of(twist))  # {s}
        for frame in all_frames(machine, pose):
            mine, force = kin.f_J_g(frame, b) @ twist, kin.wrench_transform(frame, b) @ wrench
            assert np.allclose(mine, kin.to_report_order(frame.actInv(in_world).vector), atol=ROUNDING)
            assert mine @ force == pytest.approx(twist @ wrench, abs=1e-12)  # Eq. 4-20
            theirs = motion_of(mine).dot(pin.Force(kin.to_pinocchio_order(force)))
            assert theirs == pytest.approx(twist @ wrench, abs=1e-12)


@pytest.mark.parametrize("name", FREE_MACHINES)
def test_platen_jacobians_are_pinocchios_frame_jacobians(name):
    machine = machine_named(name)
    model = make_model(machine)
    joint = model.getJointId("platen")
    for component in machine.components:
        lever = np.array(component.platen_point) - machine.platen.centre_of_gravity
        model.addFrame(pin.Frame(component.name, joint, pin.SE3(np.eye(3), lever), pin.FrameType.OP_FRAME))
    data = model.createData()
    for pose in random_poses(machine, 12):
        q = pin.SE3ToXYZQUAT(platen_se3(machine, pose))
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)

        def theirs(frame, reference=pin.LOCAL_WORLD_ALIGNED):
            raw = pin.getFrameJacobian(model, data, model.getFrameId(frame), reference)
            return kin.to_report_order(kin.to_report_order(raw).T).T  # rows and columns

        assert np.allclose(kin.c_J_b(machine, pose), theirs("platen_top"), atol=ROUNDING)
        for component in machine.components:
            r_CP = kin.rotation(pose[3:]) @ component.platen_point
            mine = kin.p_J_c(r_CP) @ kin.c_J_b(machine, pose)
            assert np.allclose(mine, theirs(component.name), atol=ROUNDING)
            if not kin.is_bearing(component):  # Eq. 3-22 from Pinocchio's Jacobian of the swivel alone
                vector = data.oMf[model.getFrameId(component.name)].translation - component.base_point
                row = vector / np.linalg.norm(vector) @ theirs(component.name)[3:]
                assert np.allclose(kin.swivel_jacobian(pose, component) @ kin.c_J_b(machine, pose), row, atol=ROUNDING)


# Components ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MACHINES)
def test_length_jacobians_are_finite_differences_of_the_lengths(name):
    machine = machine_named(name)
    free = np.isin(np.arange(6), machine.axes)
    for component in machine.components:
        apart = np.subtract(component.platen_point, component.base_point)
        assert np.allclose(kin.component_vector(machine, np.zeros(6), component), apart, atol=ROUNDING)
    for pose, rate in zip(random_poses(machine, 24), twists(24)[:, ::-1] * free, strict=True):
        for component in machine.components:
            speed = central(lambda p, c=component: np.linalg.norm(kin.component_vector(machine, p, c)), pose, rate)
            row = kin.length_jacobian(machine, pose, component)
            assert row @ kin.twist_c(pose, rate) == pytest.approx(speed, abs=DIFFERENCE)
        speeds = central(lambda p: kin.inverse_kinematics(machine, p), pose, rate)
        assert np.allclose(kin.pose_jacobian(machine, pose) @ rate, speeds, atol=DIFFERENCE)  # Eqs. 3-31 to 3-33


def test_bearing_end_is_where_its_vertical_meets_the_sliding_plane():
    bearings = [a for a in LHPOST6.actuators if kin.is_bearing(a)]
    for pose in POSES:
        placement = pin.SE3(pin.rpy.rpyToMatrix(*pose[3:]), np.array(pose[:3]))
        for bearing in bearings:
            end = bearing.base_point + kin.bearing_vector(LHPOST6, pose, bearing)
            assert np.array_equal(end[:2], bearing.base_point[:2])  # stays vertical, exactly
            on_platen = placement.actInv(end)
            assert on_platen[2] == pytest.approx(LHPOST6.platen.bearing_plane[2], abs=ROUNDING)


def test_plate_lies_in_the_sliding_plane_and_does_not_turn_about_its_normal():
    for pose in POSES:
        turn = kin.rotation(pose[3:])
        plate = kin.plate_rotation(turn)
        assert np.allclose(plate @ plate.T, np.eye(3), atol=ROUNDING)
        assert np.linalg.det(plate) == pytest.approx(1.0, abs=ROUNDING)
        assert np.allclose(plate[:, 2], turn[:, 2], atol=ROUNDING)  # Eq. 4-13
        assert plate[1, 0] == 0.0  # Eq. 4-14: two rotations only, none about the vertical
        # without yaw it is the platen's own rotation
        level = [pose[3], pose[4], 0.0]
        assert np.allclose(kin.plate_rotation(kin.rotation(level)), kin.rotation(level), atol=ROUNDING)


def test_slip_is_how_fast_the_contact_point_walks_over_the_platen():
    bearings = [a for a in LHPOST6.actuators if kin.is_bearing(a)]
    for pose, rate in zip(POSES, twists(len(POSES))[:, ::-1], strict=True):
        c_V = kin.twist_c(pose, rate)
        turn = kin.rotation(pose[3:])
        plate = kin.plate_rotation(turn)
        for bearing in bearings:
            slip = kin.slip_velocity(LHPOST6, pose, bearing, c_V)
            assert slip[2] == pytest.approx(0.0, abs=ROUNDING)  # stated below Eq. 4-15

            def contact(p, bearing=bearing):
                """Contact point in platen axes, from C."""
                end = kin.frame_p(LHPOST6, p, bearing).translation
                return kin.rotation(p[3:]).T @ (end - p[:3])

            walk = central(contact, pose, rate)  # the plate over the platen: the other way round
            assert np.allclose(slip, -plate.T @ turn @ walk, atol=DIFFERENCE)


# Inverse and forward kinematics --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MACHINES)
def test_forward_kinematics_undoes_inverse_kinematics_to_1e12(name):
    machine = machine_named(name)
    for pose in random_poses(machine, 24):
        found = kin.forward_kinematics(machine, kin.inverse_kinematics(machine, pose))
        assert np.abs(found - pose).max() < 1e-12


def test_forward_kinematics_from_the_pose_before_needs_few_steps():
    for pose in POSES[:6]:
        near = pose + 1e-4  # a sample later at 0.2 m/s
        found = kin.forward_kinematics(LHPOST6, kin.inverse_kinematics(LHPOST6, near), pose, steps=4)
        assert np.abs(found - near).max() < 1e-12


def test_ten_lengths_with_errors_give_the_least_squares_pose():
    rng = np.random.default_rng(3)
    measured = kin.inverse_kinematics(LHPOST6, POSES[0]) + 1e-4 * rng.standard_normal(10)
    pose = kin.forward_kinematics(LHPOST6, measured)
    miss = kin.inverse_kinematics(LHPOST6, pose) - measured
    assert np.linalg.norm(miss) > 1e-5  # six numbers cannot fit ten
    # at the minimum the gradient vanishes: residual 1e-4 times the last step 1e-13 and rounding
    assert np.abs(kin.pose_jacobian(LHPOST6, pose).T @ miss).max() < 1e-13


@pytest.mark.parametrize("length", [np.full(10, np.nan), np.full(10, 1e9)])
def test_lengths_that_fit_no_pose_are_refused(length):
    with pytest.raises(SimulationError, match="no pose found"):
        kin.forward_kinematics(LHPOST6, length)


# Thrust --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FREE_MACHINES)
def test_normal_thrust_conserves_power_and_the_reports_vertical_thrust_does_not(name):
    lost = {"normal": 0.0, "report": 0.0}
    for thrust in lost:
        machine = machine_named(name, thrust)
        for pose, twist in zip(random_poses(machine, 12), twists(12), strict=True):
            c_V = kin.c_J_b(machine, pose) @ twist
            for component in machine.components:
                force = kin.component_force(machine, pose, component, 1.0)
                p = kin.frame_p(machine, pose, component)
                delivered = force @ (kin.f_J_g(p, kin.frame_c(pose)) @ c_V)[3:]
                spent = kin.length_jacobian(machine, pose, component) @ c_V
                lost[thrust] = max(lost[thrust], abs(delivered - spent))
    assert lost["normal"] < ROUNDING
    has_bearings = name == "lhpost6"
    assert (lost["report"] > 1e-3) == has_bearings  # tilt of 0.04 rad times slip of m/s


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
    plant, rest = at_rest(machine_named(name))
    pull = [-strut.pressure * strut.area for strut in plant.machine.struts]
    still = required_wrench_at(plant, rest.pose, pin.Motion.Zero(), pin.Motion.Zero())
    given = wrench_at(plant, rest.pose, [*rest.force, *pull])
    np.testing.assert_allclose(given.vector, still.vector, atol=1e-8)  # of 5e6 N
    np.testing.assert_allclose(rest.wrench.vector, wrench_at(plant, rest.pose, rest.force).vector, atol=1e-8)


def test_a_pose_out_of_stroke_names_its_actuator() -> None:
    with pytest.raises(RecordError, match=r"H[12] is out of its stroke"):
        wrench_at(plant_named("lhpost6"), platen_pose_at([3.0, 0, 0, 0, 0, 0]), np.ones(10))

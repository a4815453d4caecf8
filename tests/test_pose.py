"""Between a plant's coordinates and a record's: round trips, derivatives in time, forward kinematics of records."""

import numpy as np
import pinocchio as pin
import pytest
from machine_cases import MACHINES, machine_named, plant_named, random_poses, smooth_motion

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.mechanics import kinematics as kin
from lhpost6_pin.mechanics.pose import (
    PlatenMotion,
    forward_kinematics,
    frame_of_pose,
    leg_displacements,
    plant_motion,
    platen_motion,
    pose_acceleration,
    rotation,
)

T = np.arange(400) / 200.0  # 2 s of a motion below 2 Hz


@pytest.mark.parametrize("name", MACHINES)
def test_plant_and_record_coordinates_are_one_motion(name):
    plant = plant_named(name)
    motion = smooth_motion(plant.machine, T)
    there = plant_motion(plant, motion)
    back = platen_motion(plant, there.q, there.v, there.a)
    # rounding of a dozen operations on displacements below 1, velocities below 10, accelerations below 100
    for given, found, atol in zip(motion, back, (1e-14, 1e-13, 1e-12), strict=True):
        assert np.allclose(found, given, rtol=0.0, atol=atol)
    again = plant_motion(plant, back)
    for given, found, atol in zip(there, again, (1e-14, 1e-13, 1e-12), strict=True):
        assert np.allclose(found, given, rtol=0.0, atol=atol)


@pytest.mark.parametrize("name", MACHINES)
def test_plant_velocity_and_acceleration_are_derivatives_in_time_to_pinocchio(name):
    plant = plant_named(name)
    h = 1e-4  # central difference: h^2/6 times a third derivative up to 8^3 of it, 1e-6 at most; rounding far below
    now, after, before = (plant_motion(plant, smooth_motion(plant.machine, T + shift)) for shift in (0.0, h, -h))
    for k in range(len(T)):
        moved = pin.difference(plant.model, before.q[k], after.q[k]) / (2.0 * h)
        assert np.allclose(moved, now.v[k], rtol=0.0, atol=1e-6)
    # one derivative more: 8 times the error
    assert np.allclose((after.v - before.v) / (2.0 * h), now.a, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("name", ["lhpost6", "stewart"])
def test_plant_coordinates_place_c_where_the_record_says(name):
    plant = plant_named(name)
    data = plant.model.createData()
    motion = smooth_motion(plant.machine, T[::20])
    there = plant_motion(plant, motion)
    for k, pose in enumerate(motion.displacement):
        pin.framesForwardKinematics(plant.model, data, there.q[k])
        placement = data.oMf[plant.model.getFrameId("platen_top")]
        assert np.allclose(placement.translation, pose[:3], rtol=0.0, atol=1e-14)
        assert np.allclose(placement.rotation, pin.rpy.rpyToMatrix(*pose[3:]), rtol=0.0, atol=1e-14)
        # the twist by the report's Eqs. 3-10 and 3-18
        c_V = kin.twist_c(pose, motion.velocity[k])
        mine = np.linalg.solve(kin.c_J_b(plant.machine, pose), c_V)
        assert np.allclose(there.v[k], kin.to_pinocchio_order(mine), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("name", MACHINES)
def test_leg_displacements_and_rates_are_the_reports(name):
    plant, machine = plant_named(name), machine_named(name)
    motion = smooth_motion(machine, T[::10])
    legs, rates = leg_displacements(plant, motion.displacement, motion.velocity)
    turns = rotation(motion.displacement[:, 3:])
    zero = np.array([np.linalg.norm(kin.component_vector(machine, np.zeros(6), c)) for c in machine.components])
    for k, pose in enumerate(motion.displacement):
        assert np.allclose(turns[k], kin.rotation(pose[3:]), rtol=0.0, atol=1e-15)
        length = [np.linalg.norm(kin.component_vector(machine, pose, c)) for c in machine.components]
        assert np.allclose(legs[k], np.array(length) - zero, rtol=0.0, atol=1e-14)
        c_V = kin.twist_c(pose, motion.velocity[k])
        speed = [kin.length_jacobian(machine, pose, c) @ c_V for c in machine.components]
        assert np.allclose(rates[k], speed, rtol=0.0, atol=1e-13)
    assert np.array_equal(leg_displacements(plant, motion.displacement)[1], np.zeros_like(rates))


@pytest.mark.parametrize("name", MACHINES)
def test_forward_kinematics_of_a_record_smooth_or_jumping_undoes_inverse_kinematics_to_1e12(name):
    plant = plant_named(name)
    jumps = random_poses(plant.machine, 200)  # each sample anywhere: the warm start is as bad as it can be
    for poses in (smooth_motion(plant.machine, T).displacement, jumps):
        legs, _ = leg_displacements(plant, poses)
        pose, residual = forward_kinematics(plant, legs[:, : plant.spools])
        assert np.abs(pose - poses).max() < 1e-12 and residual.max() < 1e-12


@pytest.mark.parametrize("name", MACHINES)
def test_forward_kinematics_of_records_and_of_the_report_agree_on_lengths_that_fit_no_pose_exactly(name):
    plant, machine = plant_named(name), machine_named(name)
    rng = np.random.default_rng(4)
    poses = random_poses(machine, 8)
    legs = leg_displacements(plant, poses)[0][:, : plant.spools] + 1e-4 * rng.standard_normal((8, plant.spools))
    found, residual = forward_kinematics(plant, legs)
    zero = kin.inverse_kinematics(machine, np.zeros(6))
    for k in range(8):
        pose = kin.forward_kinematics(machine, legs[k] + zero)
        # both stop at steps below 1e-13; Gauss-Newton is linear here with a ratio near the residual, 1e-4
        assert np.allclose(found[k], pose, rtol=0.0, atol=1e-12)
        miss = kin.inverse_kinematics(machine, pose) - zero - legs[k]
        assert residual[k] == pytest.approx(np.linalg.norm(miss), abs=1e-12)


def test_forward_kinematics_counts_the_columns_and_names_the_sample_that_is_not_finite():
    with pytest.raises(RecordError, match="9 columns; this machine has 10"):
        forward_kinematics(plant_named("lhpost6"), np.zeros((3, 9)))
    legs = np.zeros((5, 10))
    legs[3, 2] = np.nan
    with pytest.raises(RecordError, match="sample 3"):
        forward_kinematics(plant_named("lhpost6"), legs)


@pytest.mark.parametrize("name", MACHINES)
def test_accelerometers_tell_at_one_sample_what_a_record_holds(name):
    """The compiled sensors against the whole-record formula, over the travel range, turning fast."""
    plant = plant_named(name)
    poses = random_poses(plant.machine, 200, seed=3)
    rng = np.random.default_rng(4)
    state = plant_motion(plant, PlatenMotion(poses, np.zeros_like(poses), np.zeros_like(poses)))
    v, a = rng.normal(size=(2, 200, plant.axes.size))
    wanted = platen_motion(plant, state.q, v, 10 * a).acceleration
    frame, found = np.zeros((8, 3)), np.zeros((200, 6))
    for k in range(200):
        frame_of_pose(poses[k], plant.body, frame)
        pose_acceleration(frame, plant.body, plant.axes, v[k], 10 * a[k], found[k])
    assert np.abs(found - wanted).max() < 1e-12 * np.abs(wanted).max()  # rounding

"""The wrench between specimen and platen: identities of RNEA, closed forms, and what a decomposition finds of it."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from machine_cases import PENDULUM, machine_named, random_poses
from run_cases import driven, every_step

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.data.signals import Band
from lhpost6_pin.identification.decompose import decompose_record, find_agreement
from lhpost6_pin.identification.decompose.interface import InterfaceWrench
from lhpost6_pin.mechanics.instant import platen_pose_at
from lhpost6_pin.mechanics.interface_wrench import (
    at_interface,
    bare,
    driven_specimen,
    interface_force,
    specimen_wrenches,
    wrenches_at_b,
)
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import PlantMotion
from lhpost6_pin.mechanics.required_wrench import wrenches_at_c
from lhpost6_pin.mechanics.specimen_modes import specimen_modes
from lhpost6_pin.show.results import agreement_entries
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulated_campaign import SensorErrors, as_sensed

MACHINE = machine_named("lhpost6")
G = MACHINE.platen.gravity
PLACE = (1.0, 0.5, 0.2)
BLOCK = """<robot name="block"><link name="block"><inertial><origin xyz="0 0 2.5"/><mass value="100000"/>
<inertia ixx="150000" iyy="150000" izz="100000" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    path = tmp_path_factory.mktemp("specimen") / "block.urdf"
    path.write_text(BLOCK)
    return path


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    """A mass of 2 t on a vertical slide, and one of 1 t that hangs 2.5 m below a hinge about y."""
    path = tmp_path_factory.mktemp("specimen") / "frame.urdf"
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    path.write_text(
        f"""<robot name="frame"><link name="foot"><inertial><mass value="100"/>{inertia}</inertial></link>
        <joint name="hinge" type="continuous"><parent link="foot"/><child link="bob"/><origin xyz="0 0 3"/>
        <axis xyz="0 1 0"/><dynamics damping="500"/></joint>
        <link name="bob"><inertial><origin xyz="0 0 -2.5"/><mass value="1000"/>
        <inertia ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""
    )
    return path


def states(plant, count=8, seed=0):
    """Poses over the travel range with velocities and accelerations (count, nv)."""
    rng = np.random.default_rng(seed)
    q = np.tile(pin.neutral(plant.model), (count, 1))
    for row, pose in zip(q, random_poses(plant.machine, count), strict=True):
        placed = platen_pose_at(pose)
        row[:3] = placed.act(-plant.body[0]["rho_c"])
        row[3:7] = pin.Quaternion(placed.rotation).coeffs()
    return q, rng.standard_normal((count, plant.model.nv)), 5.0 * rng.standard_normal((count, plant.model.nv))


# ------------------------------------------------------------------------------------------------- identities
def test_a_block_at_rest_exerts_its_weight_and_accelerated_its_inertia(block):
    plant = make_plant(MACHINE.with_specimen(block, PLACE))
    mass, height, rest = 100000.0, 2.5, plant.zero_state()
    still = interface_force(plant, rest.q, rest.v, np.zeros(6))
    np.testing.assert_allclose(still.vector, [0, 0, -mass * G, 0, 0, 0], atol=1e-6)  # rounding of 5e5 N
    a = np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # at rest and level, B accelerates as every point
    pushed = interface_force(plant, rest.q, rest.v, a)
    np.testing.assert_allclose(pushed.vector, [-2 * mass, 0, -mass * G, 0, -2 * mass * height, 0], atol=1e-6)


def test_a_rigid_specimens_wrench_is_newton_and_euler_of_its_own_inertia(block):
    """pin.Inertia of the block alone, under the motion of the platen's frame: I a + v x* (I v) - I g."""
    plant = make_plant(MACHINE.with_specimen(block, PLACE, (0.1, -0.2, 0.3)))
    q, v, a = states(plant)
    found = specimen_wrenches(plant, q, v, a)
    body = pin.buildModelFromUrdf(str(block)).inertias[0]
    at = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.2, 0.3), plant.body[0]["rho_c"] + np.array(PLACE))
    inertia = at.act(body)
    for k in range(len(q)):
        turn = pin.Quaternion(q[k, 3:7]).toRotationMatrix()
        gravity = pin.Motion(turn.T @ np.array([0.0, 0.0, -G]), np.zeros(3))
        twist, rate = pin.Motion(v[k]), pin.Motion(a[k])
        required = inertia * (rate - gravity) + twist.cross(inertia * twist)
        np.testing.assert_allclose(found[k], -required.vector, rtol=1e-10, atol=1e-10 * np.abs(found[k]).max())


def test_wrenches_go_to_c_and_back_and_to_the_interface_as_pinocchio_moves_them(block):
    plant = make_plant(MACHINE.with_specimen(block, PLACE))
    q, v, a = states(plant)
    at_b = specimen_wrenches(plant, q, v, a)
    turn = np.array([pin.Quaternion(row[3:7]).toRotationMatrix() for row in q])
    np.testing.assert_allclose(wrenches_at_b(plant, turn, wrenches_at_c(plant, turn, at_b)), at_b, rtol=1e-9)
    to_interface = pin.SE3(np.eye(3), -(plant.body[0]["rho_c"] + np.array(PLACE)))
    for moved, force in zip(at_interface(plant, at_b), at_b, strict=True):
        np.testing.assert_allclose(moved, to_interface.act(pin.Force(force)).vector, rtol=1e-9, atol=1e-6)


def test_a_bare_table_carries_nothing_and_a_table_without_its_specimen_is_bare(block):
    plant = make_plant(MACHINE)
    assert bare(plant) is plant
    assert not specimen_wrenches(plant, *states(plant)).any()
    assert bare(make_plant(MACHINE.with_specimen(block))).machine.specimen is None


# ------------------------------------------------------------------------------------------------- driven joints
def test_a_hanging_mass_has_the_frequency_damping_and_mass_of_its_closed_form(frame):
    """(g / l)^1/2 = 2 pi f; damping c / (2 m l^2 2 pi f); along x it moves its whole mass, about its hinge."""
    (mode,) = specimen_modes(make_plant(MACHINE.with_specimen(frame)))
    omega = np.sqrt(G / 2.5)
    assert mode.frequency == pytest.approx(omega / (2 * np.pi), rel=1e-6)  # central differences of 1e-6 rad
    assert mode.damping == pytest.approx(500.0 / (2 * 1000.0 * 2.5**2 * omega), rel=1e-6)
    np.testing.assert_allclose(mode.mass[:3], [1000.0, 0.0, 0.0], atol=1e-3)


def test_a_driven_specimen_moves_as_the_table_that_carries_it(frame):
    """Joints of a simulated run, from the platen's motion alone: apart by the scheme's error at 8192 steps."""
    t, k = np.arange(4096)[:, None] / 2048, np.arange(10)
    wave = 0.1 * np.sin(2 * np.pi * (1 + 0.2 * k) * t + k) * np.minimum(1.0, 5 * t)
    run = driven(MACHINE.with_specimen(frame, PLACE), wave * np.where(k < 4, 1.0, 0.1), "pinocchio")
    found = driven_specimen(run.plant, PlantMotion(run.q[:, :7], run.v[:, :6], run.a[:, :6]), 1 / 2048)
    moved = np.abs(run.v[:, 6]).max()
    assert moved > 0.02  # [rad/s] it does move
    np.testing.assert_allclose(found.v[:, 6], run.v[:, 6], atol=1e-4 * moved)  # 2e-5 found
    one, other = (specimen_wrenches(run.plant, *x) for x in (found, (run.q, run.v, run.a)))
    np.testing.assert_allclose(one, other, atol=2e-4 * np.abs(other).max())


# ------------------------------------------------------------------------------------------------- decomposition
@pytest.mark.long
@pytest.mark.parametrize("locked", [True, False])
def test_forces_of_a_noise_free_record_give_the_simulations_own_interface_wrench(locked):
    """At every model step the bare table's balance is exact; a driven joint is integrated by another rule."""
    machine = MACHINE.with_specimen(PENDULUM, PLACE, (0.0, 0.0, 0.3), locked=locked)
    record = record_of_run(every_step(machine, 1.6, size=0.04), {"test": "shaken", "title": "Shaken"})
    found = decompose_record(MACHINE, record)  # mounts what the record states
    interface = find_agreement(found).interface
    assert interface is not None and interface.simulated is not None and interface.predicted is not None
    size = np.abs(interface.simulated).max(axis=0)
    forces, moments = size[:3].max(), size[3:].max()
    scale = np.repeat([forces, moments], 3)
    # forces see the velocity of the step, the record that of its end: centripetal terms differ by a dt
    np.testing.assert_allclose(interface.wrench / scale, interface.simulated / scale, atol=1e-3)
    np.testing.assert_allclose(interface.predicted / scale, interface.simulated / scale, atol=1e-3)
    assert not interface.sd.any() and interface.place == PLACE
    assert np.abs(found.forces.residual).max() < 1e-3 * np.abs(found.forces.measured).max()
    entries = agreement_entries(found, find_agreement(found))["interface"]["components"]
    peak = interface.peaks[2]
    assert entries["fz"]["peak"] == peak.value == pytest.approx(-size[2], rel=1e-3)
    assert interface.at(5).linear[2] == interface.wrench[5, 2]


def test_a_specimen_that_does_nothing_is_seldom_distinguished_from_zero_by_its_peaks():
    """The largest of thousands of samples of noise lay outside the interval of an instant in nine cases of ten."""
    rng, n, rate, high = np.random.default_rng(0), 4096, 512.0, 30.0
    draws = []
    for _ in range(50):
        noise = Band(high=high).apply(rng.standard_normal((n + 512, 6)), 1.0 / rate)[256:-256]  # ends are not exact
        noise /= noise.std(axis=0)
        error = 0.5 * rng.standard_normal(6)  # of calibration, in all samples alike
        found = InterfaceWrench(
            time=np.arange(n) / rate, wrench=noise + error, noise=np.ones(6), sensors=np.full((n, 6), 0.5),
            parameters=np.zeros((n, 6)), confidence=0.9, crossings=high * n / rate / 3**0.5, floors=None,
            predicted=None, simulated=None, place=(0.0, 0.0, 0.0), calibrated=0, stated=0,
        )  # fmt: skip
        draws += [(peak.shown, abs(peak.value) > found.half_width[0, 0]) for peak in found.peaks]
    at_once, each = np.mean(draws, axis=0)
    assert at_once <= 0.13 and each == 1.0  # a tenth at most, and two deviations of 300 draws


@pytest.mark.long
def test_with_noise_base_shear_is_right_within_two_percent_and_its_interval_holds_the_truth(block):
    """Calibration known: noise alone, of about 2 kN in base shear, whose RMS is some hundred. Two draws."""
    exact = {path: replace(q, sd=None) for path, q in MACHINE.parameters.quantities.items()}
    machine = replace(MACHINE, parameters=replace(MACHINE.parameters, quantities=exact)).with_specimen(block)
    sensors = replace(load_sensors(), gain_range={}, offset_range={}, delay_range={})
    t, k = np.arange(8192)[:, None] / 2048, np.arange(10)
    wave = 0.25 * np.sin(2 * np.pi * (1.5 + 0.3 * k) * t + k) * np.minimum(1.0, 2 * t)
    run = driven(machine, wave * np.where(k < 4, 1.0, 0.05))
    record = record_of_run(run, {"test": "shaken", "title": "Shaken"})
    inside, error = [], []
    for seed in range(2):
        measured = as_sensed(record, sensors, SensorErrors({}, {}, {}), 512.0, np.random.default_rng(seed))
        assert "specimen_wrench" not in measured  # no sensor measures it
        found = decompose_record(machine, measured, sensors, align=False)
        interface = find_agreement(found, seed=seed).interface
        true = found.comparison.band.apply(record["specimen_wrench"].values, 1 / 2048)[::4][found.inside]
        off = interface.wrench - true
        inside.append((np.abs(off) <= interface.half_width).mean())
        error.append(np.sqrt(np.mean(off**2, axis=0) / np.mean(true**2, axis=0)))
    assert (np.median(error, axis=0)[:2] < 0.02).all()  # base shear
    assert 0.85 < np.mean(inside) < 0.95


# ------------------------------------------------------------------------------------------------- records
def test_a_record_names_its_specimen_and_a_bare_machine_mounts_it(block, tmp_path):
    machine = MACHINE.with_specimen(block, PLACE, (0.0, 0.1, 0.0), locked=True)
    record = record_of_run(driven(machine, np.zeros((4, 10))), {"test": "still"})
    again = MACHINE.as_mounted(record.attrs, "the record")
    assert again.specimen == replace(machine.specimen, file=block.resolve())
    assert machine.as_mounted({"specimen": "none"}, "the record") is machine  # what is mounted stays
    gone = record.attrs | {"specimen_file": str(tmp_path / "gone.urdf")}
    with pytest.raises(RecordError, match=r"gone\.urdf, which is not there; mount it with --specimen"):
        MACHINE.as_mounted(gone, "the record")
    with pytest.raises(RecordError, match="three numbers"):
        MACHINE.as_mounted(record.attrs | {"specimen_rpy": "north"}, "the record")
    with pytest.raises(RecordError, match="mount it with --specimen"):
        MACHINE.as_mounted({"specimen": "tower"}, "the record")


def test_a_shipped_specimen_is_named_not_located():
    machine = MACHINE.with_specimen("pendulum", locked=True)
    record = record_of_run(driven(machine, np.zeros((4, 10))), {"test": "still"})
    assert record.attrs["specimen_file"] == "pendulum" and record.attrs["specimen_locked"] == 1

"""The compiled ports against the report's kinematics written by hand, against Pinocchio and finite differences."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from machine_cases import MACHINES, frame_array, machine_named, plant_named, random_poses

from lhpost6_pin.machine.port_names import PLATEN_PORTS, SWIVEL_TURNS, port_names
from lhpost6_pin.mechanics import kinematics as kin
from lhpost6_pin.mechanics import ports
from lhpost6_pin.mechanics.ports import evaluate_ports, platen_pose

ROUNDING = 1e-13  # some ten operations on numbers below 10 in double precision
CASES = [(name, thrust) for name in MACHINES for thrust in ("report", "normal")]


def names_of(machine):
    return port_names(machine.actuators, machine.struts)


def ports_at(plant, pose, evaluate=evaluate_ports):
    """S (n,), J (n, 6), B (n, 6) of all ports at a pose."""
    n = len(names_of(plant.machine))  # a plant's own arrays may leave the platen ports out
    s, J, B = np.full(n, np.nan), np.full((n, 6), np.nan), np.full((n, 6), np.nan)
    evaluate(frame_array(plant.machine, pose), plant.legs, plant.body, s, J, B)
    return s, J, B


def platen_rows(machine):
    first = names_of(machine).index("platen.x")
    return slice(first, first + 6)


def row_of_force(machine, pose, at, force):
    """Wrench at B in platen axes, Pinocchio's order, of a force in {s} at a point `at` from C in {s}."""
    wrench_c = kin.p_J_c(at).T @ np.concatenate([np.zeros(3), force])
    return kin.to_pinocchio_order(kin.c_J_b(machine, pose).T @ wrench_c)


def test_port_names_are_legs_pads_platen_and_swivels_in_that_order():
    names = names_of(machine_named("lhpost6"))
    assert names[:13] == ("H1", "H2", "H3", "H4", "V1", "V2", "V3", "V4", "V5", "V6", "S1", "S2", "S3")
    assert names[13:17] == ("V1.x", "V1.y", "V2.x", "V2.y")
    assert names[25:31] == PLATEN_PORTS
    assert names[31:] == tuple(f"H{i}.{turn}" for i in range(1, 5) for turn in SWIVEL_TURNS)
    legs = [f"L{i}" for i in range(1, 7)]
    assert names_of(machine_named("stewart"))[:12] == (*legs, *PLATEN_PORTS)


@pytest.mark.parametrize("name, thrust", CASES)
def test_leg_rows_are_the_reports_lengths_and_jacobians(name, thrust):
    machine, plant = machine_named(name, thrust), plant_named(name, thrust)
    for pose in random_poses(machine, 24):
        s, J, B = ports_at(plant, pose)
        c_J_b = kin.c_J_b(machine, pose)
        for i, component in enumerate(machine.components):
            vector = kin.component_vector(machine, pose, component)
            zero = np.linalg.norm(np.subtract(component.platen_point, component.base_point))
            assert s[i] == pytest.approx(np.linalg.norm(vector) - zero, abs=ROUNDING)
            row = kin.length_jacobian(machine, pose, component) @ c_J_b
            assert np.allclose(J[i], kin.to_pinocchio_order(row), rtol=0.0, atol=ROUNDING)
            at = kin.frame_p(machine, pose, component).translation - pose[:3]
            column = row_of_force(machine, pose, at, kin.component_force(machine, pose, component, 1.0))
            assert np.allclose(B[i], column, rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("name, thrust", CASES)
def test_force_columns_are_motion_rows_but_for_the_reports_vertical_thrust_and_pads(name, thrust):
    machine, plant = machine_named(name, thrust), plant_named(name, thrust)
    for pose in random_poses(machine, 12):
        _, J, B = ports_at(plant, pose)
        for port, row, column in zip(names_of(machine), J, B, strict=True):
            bearing = port.split(".")[0] in {a.name for a in machine.actuators if a.mount == "bearing"}
            if not bearing or (thrust == "normal" and "." not in port):
                assert np.allclose(row, column, rtol=0.0, atol=ROUNDING), port


def test_pad_rows_are_the_reports_slip_and_friction():
    machine, plant = machine_named("lhpost6"), plant_named("lhpost6")
    for pose in random_poses(machine, 24):
        s, J, B = ports_at(plant, pose)
        b_J = kin.c_J_b(machine, pose)
        turn = kin.rotation(pose[3:])
        for bearing in machine.actuators[4:]:
            frame = kin.frame_n(machine, pose, bearing)
            at = frame.translation - pose[:3]
            # slip is linear in the twist: its matrix, column by column
            slip = np.array([kin.slip_velocity(machine, pose, bearing, b_J @ unit) for unit in np.eye(6)]).T
            moved = frame.rotation.T @ (turn @ bearing.platen_point - at)
            for k, d in enumerate("xy"):
                i = names_of(machine).index(f"{bearing.name}.{d}")
                assert np.allclose(J[i], kin.to_pinocchio_order(slip[k]), rtol=0.0, atol=ROUNDING)
                column = row_of_force(machine, pose, at, frame.rotation[:, k])
                assert np.allclose(B[i], column, rtol=0.0, atol=ROUNDING)
                assert s[i] == pytest.approx(moved[k], abs=ROUNDING)


@pytest.mark.parametrize("name", MACHINES)
def test_platen_ports_move_with_c_and_carry_the_wrench_there(name):
    machine, plant = machine_named(name), plant_named(name)
    for pose in random_poses(machine, 12):
        s, J, B = ports_at(plant, pose)
        at = platen_rows(machine)
        assert np.allclose(s[at], pose, rtol=0.0, atol=ROUNDING)  # displacement of C and Euler angles
        c_J_b = kin.to_pinocchio_order(kin.to_pinocchio_order(kin.c_J_b(machine, pose)).T).T
        assert np.allclose(J[at], c_J_b, rtol=0.0, atol=ROUNDING)  # twist in {c}: omega, not Euler angle rates
        assert np.array_equal(J[at], B[at])
        for n in (at.start, at.stop):  # arrays without room for platen or swivel ports hold the others alike
            short = np.full(n, np.nan), np.full((n, 6), np.nan), np.full((n, 6), np.nan)
            evaluate_ports(frame_array(machine, pose), plant.legs, plant.body, *short)
            assert all(np.array_equal(x, whole[:n]) for x, whole in zip(short, (s, J, B), strict=True))


class Table(list):
    """Rows of a table whose fields are attributes, as compiled code sees them."""

    def __init__(self, table):
        super().__init__(SimpleNamespace(**{n: row[n] for n in table.dtype.names}) for row in table)
        self.size = len(self)


def test_compiled_ports_are_the_python_they_are_written_in(monkeypatch):
    plant = plant_named("lhpost6")

    def plain(frame, legs, body, s, J, B):
        with monkeypatch.context() as patch:
            patch.setattr(ports, "_swivel_ports", ports._swivel_ports.py_func)
            evaluate_ports.py_func(frame, Table(legs), Table(body), s, J, B)

    for pose in random_poses(plant.machine, 4):
        for fast, slow in zip(ports_at(plant, pose), ports_at(plant, pose, plain), strict=True):
            assert np.allclose(fast, slow, rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("name", MACHINES)
def test_pose_of_a_plant_is_pinocchios_placement_of_the_platen(name):
    plant = plant_named(name)
    data = plant.model.createData()
    for pose in random_poses(plant.machine, 12):
        wanted = frame_array(plant.machine, pose)
        if plant.machine.motion == "free":
            q = pin.SE3ToXYZQUAT(pin.SE3(wanted[:3], wanted[3]))
        else:
            q = pose[plant.axes]
        frame = np.zeros((8, 3))
        platen_pose(q, plant.axes, plant.body, frame)
        assert np.allclose(frame, wanted, rtol=0.0, atol=ROUNDING)
        pin.forwardKinematics(plant.model, data, q)
        assert np.allclose(frame[:3], data.oMi[1].rotation, rtol=0.0, atol=ROUNDING)
        assert np.allclose(frame[3], data.oMi[1].translation, rtol=0.0, atol=ROUNDING)

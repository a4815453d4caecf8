"""The record of a run says what the plant says: forces, lengths, pressures, hidden states, and what was run."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from machine_cases import PENDULUM, STEWART, machine_named
from run_cases import driven

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.layout_faults import layout_faults
from lhpost6_pin.data.records import load_record, save_record
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.machine.recorded_changes import changes_summary
from lhpost6_pin.mechanics.kinematics import inverse_kinematics
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.rehearse import rehearse


@pytest.fixture(scope="module")
def test_run():
    """A rehearsal that moves all six axes at once."""
    target = make_target(find_motion("sfu-like", duration=4.0), scale=0.5)
    return rehearse(
        load_machine(), target, load_controller("lhpost6"), attrs={"test": "sfu"}, engine="fused", beyond_limits=True
    )


def short_run(machine, samples=64, spool=0.02):
    """Open-loop run from rest, the spools a little off their bias."""
    return driven(machine, np.broadcast_to(spool, (samples, len(machine.actuators))), "pinocchio")


def broken(record):
    return [f for f in check_dataset(record) if f.severity == "error"] + layout_faults(record)


# What the plant says --------------------------------------------------------------------------------------------------


def test_actuator_forces_are_pressures_times_areas(test_run):
    machine, record = test_run.run.plant.machine, test_run.record
    for actuator in machine.actuators:
        force = actuator.area_a * record["chamber_pressure_a"].sel(actuator=actuator.name)
        if actuator.area_b is not None:
            force = force - actuator.area_b * record["chamber_pressure_b"].sel(horizontal=actuator.name)
        found = record["actuator_force"].sel(actuator=actuator.name)
        assert np.ptp(found.values) > 1e4
        # rounding of two terms of 4 MN
        assert np.abs(found.values - force.values).max() < 1e-8


def test_chamber_pressures_are_the_plants_states_by_name(test_run):
    run, record = test_run
    for i, state in enumerate(run.plant.states):
        effect, name, what = state.split(".")
        if what == "pressure_a":
            assert np.array_equal(record["chamber_pressure_a"].sel(actuator=name).values, run.z[:, i]), effect
        if what == "pressure_b":
            assert np.array_equal(record["chamber_pressure_b"].sel(horizontal=name).values, run.z[:, i]), effect


def test_actuator_displacements_are_the_reports_inverse_kinematics_of_the_platen(test_run):
    """The hand-written equations of Chapter 3, which the simulation does not use, at some samples."""
    machine, record = test_run.run.plant.machine, test_run.record
    zero = inverse_kinematics(machine, np.zeros(6))
    poses, legs = record["platen_displacement"].values, record["actuator_displacement"].values
    assert np.all(np.abs(poses).max(axis=0) > 1e-3)
    for k in range(0, len(poses), 997):
        # rounding of lengths of 5 m
        assert np.abs(inverse_kinematics(machine, poses[k]) - zero - legs[k]).max() < 1e-13


def test_strut_pressure_follows_the_polytropic_law_of_the_strut_length(test_run):
    """P = P_0 (1 + dL / L_c0)^-n (Eq. 4-8), with dL from the pose alone."""
    machine, record = test_run.run.plant.machine, test_run.record
    pose = record["platen_displacement"].values
    turn = np.array([pin.rpy.rpyToMatrix(*angles) for angles in pose[:, 3:]])
    for strut in machine.struts:
        p, base = np.array(strut.platen_point), np.array(strut.base_point)
        length = np.linalg.norm(pose[:, :3] + turn @ p - base, axis=1)
        stretch = length - np.linalg.norm(p - base)
        expected = strut.pressure * (1.0 + stretch / strut.gas_length) ** -strut.polytropic_index
        found = record["strut_pressure"].sel(strut=strut.name).values
        assert np.ptp(found) > 1e4
        assert np.allclose(found, expected, rtol=1e-13, atol=0.0)  # rounding of lengths of 4 m


def test_velocity_and_acceleration_are_derivatives_of_the_displacement(test_run):
    record, dt = test_run.record, 1.0 / SAMPLE_RATE
    for low, high in (("displacement", "velocity"), ("velocity", "acceleration")):
        x, rate = record[f"platen_{low}"].values, record[f"platen_{high}"].values
        central = (x[2:] - x[:-2]) / (2 * dt)
        # central differences err by (w dt)^2/6: 3e-3 of what is in the oil column's 46 Hz, 1e-4 of the whole; where
        # friction sticks, the acceleration jumps within a sample. A shift by one sample shows far more.
        error = np.sqrt(np.sum((central - rate[1:-1]) ** 2, axis=0) / np.sum(rate**2, axis=0))
        shifted = np.sqrt(np.sum((central - rate[:-2]) ** 2, axis=0) / np.sum(rate**2, axis=0))
        assert np.all(error < (1e-3 if low == "displacement" else 0.1))
        assert np.all(shifted > 3 * error)


def test_reference_and_supply_are_in_the_record(test_run):
    target = make_target(find_motion("sfu-like", duration=4.0), scale=0.5)
    for quantity in ("displacement", "velocity", "acceleration"):
        found = test_run.record[f"reference_{quantity}"]
        assert np.array_equal(found.values, getattr(target, quantity))
        assert found.attrs["units"] and found.attrs["long_name"]
    supply = test_run.run.plant.machine.hydraulics.supply_pressure
    assert np.all(test_run.record["supply_pressure"].values == supply)


def test_hidden_friction_states_are_kept_with_their_names(test_run):
    run, record = test_run
    friction = [i for i, name in enumerate(run.plant.states) if "pressure" not in name]
    found = {}
    for name in (n for n in record.data_vars if str(n).startswith("hidden_")):
        labels = record[name].attrs["states"].split()
        assert len(labels) == record[name].shape[1]
        found |= {f"{str(name)[7:]}.{label}": record[name].values[:, k] for k, label in enumerate(labels)}
    assert set(found) == {run.plant.states[i] for i in friction}
    for i in friction:
        assert np.array_equal(found[run.plant.states[i]], run.z[:, i])
        assert np.abs(run.z[:, i]).max() < 1.01  # a Bouc-Wen state stays within the unit circle
    assert max(np.abs(x).max() for x in found.values()) > 0.9  # and the friction did slide


def test_command_is_in_closed_loop_records_only(test_run):
    assert "spool_command" in test_run.record
    record = record_of_run(short_run(load_machine()), {})
    assert "spool_command" not in record and "reference_displacement" not in record
    assert np.all(record["spool_position"].values[1] > 0.01)


def test_every_variable_has_a_unit_and_a_meaning(test_run):
    for name, variable in test_run.record.data_vars.items():
        assert variable.attrs.get("units"), name
        assert variable.attrs.get("long_name"), name


# What was run ---------------------------------------------------------------------------------------------------------


def test_attributes_say_what_was_run(test_run):
    attrs = test_run.record.attrs
    said = {"kind": "simulated", "test": "sfu", "machine": "LHPOST6", "specimen": "none", "engine": "fused"}
    said |= {"scheme": "semi_implicit", "trouble": "none", "scale": 0.5, "motion": "sfu-like"}
    assert said.items() <= attrs.items() and attrs["source"]
    assert attrs["steps_per_second"] == 8192 and attrs["sample_rate_hz"] == 2048
    assert attrs["valves_per_horizontal_actuator"] == 1


def test_trouble_clipping_valves_and_what_is_given_by_hand_are_in_the_attributes():
    run = short_run(load_machine().with_valves(2), samples=4)
    troubled = replace(run, trouble="stopped at 1 s: V1 left its stroke", clipped=7)
    attrs = record_of_run(troubled, {"kind": "measured", "operator": "me"}).attrs
    assert "V1" in attrs["trouble"] and attrs["spool_values_clipped"] == 7
    assert attrs["kind"] == "measured" and attrs["operator"] == "me" and attrs["valves_per_horizontal_actuator"] == 2


def test_what_was_changed_of_the_machine_is_in_the_attributes_and_shown(tmp_path):
    nominal = load_machine()
    machine = nominal.with_params({"horizontal.leakage": {"value": 5.0, "unit": "l/min/MPa"}, "vertical.viscous": 9e3})
    machine = machine.with_params({"vertical.viscous": nominal.parameters.number("vertical.viscous")})  # as before
    machine = machine.with_effect("stray_spring", ("platen.x",), name="cable", stiffness=2e5).with_effect("backlash")
    record = record_of_run(short_run(machine, samples=4), {})
    assert record.attrs["overrides"] == "horizontal.leakage = 8.33333e-11 m3/s/Pa (was 4.58333e-11 m3/s/Pa)"
    first, second = record.attrs["effects"].split("; ")
    assert first.startswith("cable: stray_spring on platen.x, stiffness = 200000 N/m")
    assert second.startswith("backlash: backlash")
    said = [f.message for f in check_dataset(record) if f.severity == "info"]
    assert f"made with effects: {first}; {second}" in said
    assert any(one.startswith("made with overrides: horizontal.leakage") for one in said)
    assert changes_summary(record.attrs, 1)[0] == f"made with effects: {first}; and 1 more"
    save_record(record, tmp_path / "changed.nc")
    assert load_record(tmp_path / "changed.nc").attrs["effects"] == record.attrs["effects"]
    assert not {"effects", "overrides"} & set(record_of_run(short_run(nominal, samples=4), {}).attrs)


# Other machines and specimens -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["uniaxial", "stewart"])
def test_records_of_other_machines_are_valid_on_disk(tmp_path, name):
    machine = machine_named(name)
    record = record_of_run(short_run(machine), {})
    assert broken(record) == []
    assert list(record["actuator"].values) == list(machine.actuator_names)
    assert list(record["horizontal"].values) == list(machine.double_acting)
    assert "strut_pressure" not in record and "strut" not in record.dims
    save_record(record, tmp_path / "a.nc")
    again = load_record(tmp_path / "a.nc", {"actuator": machine.actuator_names})
    assert again.equals(record)
    if name == "uniaxial":  # guided along X; its wall is at +x; rounding of a length of 1 m
        moved = record["platen_displacement"].values
        assert np.abs(moved[:, 0]).max() > 0 and not moved[:, 1:].any()
        assert np.abs(record["actuator_displacement"].values[:, 0] + moved[:, 0]).max() < 1e-15


def test_a_machine_without_second_chambers_has_a_valid_record(tmp_path):
    """Every actuator single-acting, as in no shipped machine: no chamber B, no number of valves on horizontals."""
    lines = (STEWART).read_text().replace('"4-way"', '"3-way"').splitlines()
    path = tmp_path / "single.toml"
    path.write_text("\n".join(line for line in lines if not line.startswith(("area_b", "chamber_b"))))
    record = record_of_run(short_run(load_machine(path)), {})
    assert "chamber_pressure_b" not in record and "valves_per_horizontal_actuator" not in record.attrs
    assert broken(record) == []


def test_joints_of_an_articulated_specimen_are_recorded():
    machine = load_machine().with_specimen(PENDULUM)
    along_x = np.r_[-0.1, -0.1, 0.1, 0.1, np.zeros(6)]
    run = short_run(machine, samples=512, spool=along_x)
    record = record_of_run(run, {})
    joint = record["specimen_joint_position"]
    assert record.attrs["specimen"] == "pendulum"
    assert list(joint["specimen_joint"].values) == ["pivot"] and joint.attrs["column_units"] == "rad"
    cosine_and_sine = np.stack([np.cos(joint[:, 0]), np.sin(joint[:, 0])], axis=1)
    np.testing.assert_allclose(cosine_and_sine, run.q[:, 7:], rtol=0.0, atol=1e-12)  # rounding
    assert joint[0, 0] == 0.0 and np.abs(joint).max() > 1e-4  # it swings
    assert broken(record) == []
    locked = record_of_run(short_run(load_machine().with_specimen(PENDULUM, locked=True)), {})
    assert locked.attrs["specimen"] == "pendulum" and "specimen_joint_position" not in locked

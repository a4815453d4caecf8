"""Machines other than the LHPOST6: guides along some axes, six legs, single- and double-rod cylinders."""

import numpy as np
import pinocchio as pin
import pytest
from data_files import raw
from machine_cases import plant_named, random_poses

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import ParameterError, RecordError
from lhpost6_pin.core.files import shipped
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.importing import ChannelMap, Source, TestFacts, make_imported_record
from lhpost6_pin.identification.calibration.free_parameters import machine_parameters
from lhpost6_pin.machine.library.family import families
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.instant import displacement_of, legs_at
from lhpost6_pin.mechanics.kinematics import forward_kinematics
from lhpost6_pin.mechanics.linearize import oil_column_modes
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import kinematic_jacobian
from lhpost6_pin.mechanics.rigid_body import platen_inertia
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.bodies import body_poses, joint_positions, load_bodies
from lhpost6_pin.simulation.energy import energy_audit
from lhpost6_pin.simulation.ledger import force_ledger
from lhpost6_pin.simulation.rehearse import rehearse

OTHERS = ("uniaxial", "biaxial", "hexapod")
G = 9.80665


def guided(motion: str) -> Machine:
    """The biaxial machine with its actuators along two other axes."""
    changes: dict[str, object] = {"machine.motion": motion}
    for quantity, value in (("displacement", 0.14), ("velocity", 0.7), ("acceleration", 25.0)):
        changes[f"limits.{quantity}"] = [value] * 3 + [0.0] * 3
    for name, axis in zip(("AX", "AY"), motion, strict=True):
        away = {"x": [1.2, 0.0, -0.15], "y": [0.0, 1.2, -0.15], "z": [0.0, 0.0, -1.35]}[axis]
        changes |= {f"{name}.platen_point": [0.0, 0.0, -0.15], f"{name}.base_point": away}
    return load_machine("biaxial").with_params(changes)


# Kinematics -----------------------------------------------------------------------------------------------------------


def test_legs_of_the_hexapod_are_as_long_as_pinocchios_poses_say():
    """|s_M_c p - b| - L_0 of every leg, with s_M_c a pin.SE3; and the pose is found again from the lengths."""
    plant = plant_named("hexapod")
    machine = plant.machine
    for pose in random_poses(machine, 16):
        placement = pin.SE3(pin.rpy.rpyToMatrix(*pose[3:]), 0.5 * pose[:3])
        point, base = (np.array([getattr(a, f"{end}_point") for a in machine.actuators]) for end in ("platen", "base"))
        length = [np.linalg.norm(placement.act(p) - b) for p, b in zip(point, base, strict=True)]
        elongation, _ = legs_at(plant, placement)
        assert np.allclose(elongation, length - np.linalg.norm(point - base, axis=1), rtol=0.0, atol=1e-12)
        back = forward_kinematics(machine, np.array(length))
        assert np.allclose(back, displacement_of(placement), rtol=0.0, atol=1e-9)  # Gauss-Newton's own tolerance


def test_limits_must_let_a_free_axis_move():
    with pytest.raises(ParameterError, match=r"limits.velocity is 0 in y, where the platen can move"):
        load_machine("biaxial").with_params({"limits.velocity": [0.7, 0.0, 0.0, 0.0, 0.0, 0.0]})


@pytest.mark.parametrize("name", OTHERS)
def test_stated_travel_lies_within_the_stroke_of_every_actuator(name):
    """Guided axes together, those of a free platform one by one; the limits come of the strokes, so they fill them."""
    machine = load_machine(name)
    limits = np.array(machine.limits.displacement)
    poses = (
        [limits, -limits] if machine.motion != "free" else [s * np.diag(limits)[k] for k in range(6) for s in (1, -1)]
    )
    strokes = np.array([a.stroke for a in machine.actuators])
    used = [np.abs(legs_at(plant_named(name), pin.SE3(pin.rpy.rpyToMatrix(*p[3:]), p[:3]))[0]) / strokes for p in poses]
    assert np.max(used) <= 1.0 + 1e-9 and np.max(used) > 0.6


@pytest.mark.parametrize("name", ["uniaxial", "biaxial"])
def test_drawn_guides_carry_the_platen_where_it_is(name):
    machine = load_machine(name)
    bodies = load_bodies(machine)
    poses = random_poses(machine, 8)
    at = body_poses(bodies.model, joint_positions(machine, bodies.model, poses))
    platen = bodies.model.frames[bodies.model.getFrameId("platen")].parentJoint
    assert np.allclose(at[:, platen, :3], poses[:, :3] + machine.platen.centre_of_gravity, rtol=0.0, atol=1e-12)


# Statics --------------------------------------------------------------------------------------------------------------


def test_six_legs_share_the_weight_of_a_centred_platen_alike():
    """By symmetry m g / (6 cos) of the legs' inclination; and their forces and moments about B balance the weight."""
    machine = load_machine("hexapod")
    rest = find_equilibrium(make_plant(machine))
    (leg, *_), weight = machine.actuators, machine.platen.mass[2] * G
    along = np.subtract(leg.platen_point, leg.base_point)
    assert rest.force == pytest.approx(
        weight * np.linalg.norm(along) / (6.0 * along[2]), rel=1e-5
    )  # points of 6 digits
    total = pin.Force.Zero()
    for actuator, force in zip(machine.actuators, rest.force, strict=True):
        u = np.subtract(actuator.platen_point, actuator.base_point)
        lever = np.subtract(actuator.platen_point, machine.platen.centre_of_gravity)
        pushed = force * u / np.linalg.norm(u)
        total += pin.Force(pushed, np.cross(lever, pushed))
    assert np.allclose(total.vector, [0, 0, weight, 0, 0, 0], rtol=0.0, atol=1e-6 * weight)
    a, b = machine.actuators[0].area_a, machine.actuators[0].area_b
    pressures = rest.state.z[:2]  # of L1: P_A A_1 - P_B A_2
    assert pressures[0] * a - pressures[1] * b == pytest.approx(rest.force[0], rel=1e-9)


def test_guides_carry_what_actuators_do_not():
    """Level guides carry the weight: no force, equal pressures half-way between supply and return."""
    machine = load_machine("biaxial")
    rest = find_equilibrium(make_plant(machine))
    assert np.allclose(rest.force, 0.0, atol=1e-6)
    half = 0.5 * (machine.hydraulics.supply_pressure + machine.hydraulics.return_pressure)
    assert rest.state.z[:4] == pytest.approx(half, rel=1e-9)


# Oil columns ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motion", ["xy", "xz", "yz"])
def test_oil_columns_of_two_guided_axes_are_the_textbooks(motion):
    """sqrt(beta (A_1/L_A + A_2/L_B) / m) / 2 pi along each, with the mass that moves along it."""
    masses = dict(zip("xyz", (3000.0, 4500.0, 6000.0), strict=True))
    machine = guided(motion).with_params({"platen.mass": list(masses.values())})
    actuator, oil = machine.actuators[0], machine.hydraulics
    stiffness = oil.bulk_modulus * (actuator.area_a / actuator.chamber_a + actuator.area_b / actuator.chamber_b)
    found = {mode.axis: mode.frequency for mode in oil_column_modes(machine)}
    weight = 1e-3 if "z" in motion else 1e-5  # a leg that carries it turns as the platen moves across
    assert set(found) == set(motion)
    for axis, hertz in found.items():
        assert hertz == pytest.approx(np.sqrt(stiffness / masses[axis]) / (2.0 * np.pi), rel=weight)


def test_oil_columns_of_the_hexapod_are_those_of_its_stiffness_and_inertia():
    """Eigenvalues of M^-1 J^T k J about C, without the weight's geometric stiffness, small against the oil's."""
    machine = load_machine("hexapod")
    plant = make_plant(machine)
    a = machine.actuators[0]
    k = machine.hydraulics.bulk_modulus * (a.area_a / a.chamber_a + a.area_b / a.chamber_b)
    jacobian = kinematic_jacobian(plant)
    to_c = np.eye(6)
    to_c[:3, 3:] = pin.skew(np.array(machine.platen.centre_of_gravity))  # v_C = v_B + omega x rho, rho = -B
    mass = np.linalg.inv(to_c).T @ platen_inertia(plant.model, machine)[1] @ np.linalg.inv(to_c)
    wanted = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, k * jacobian.T @ jacobian)).real) / (2.0 * np.pi)
    found = [mode.frequency for mode in oil_column_modes(machine)]
    assert sorted(found) == pytest.approx(sorted(wanted), rel=2e-3)


# Runs -----------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=OTHERS)
def shaken(request):
    """The Ridgecrest record at a size for the machine, in closed loop with its own controller."""
    machine = load_machine(request.param)
    axes = "xyz" if machine.motion == "free" else machine.motion
    target = make_target(find_motion("ridgecrest"), scale=0.3, axes=axes, window=(18.0, 28.0))
    settings = load_controller(machine.controller)
    return rehearse(machine, target, settings, attrs={"test": "EQ"}, engine="fused", steps_per_second=16384)


@pytest.mark.long
def test_every_example_follows_an_earthquake_with_its_own_controller(shaken):
    run, record = shaken
    assert run.trouble is None
    assert record.attrs["controller"] == load_controller(run.plant.machine.controller).name
    axes = [k for k in run.plant.axes if k < 3]
    wanted = record["reference_displacement"].values[:, axes]
    error = record["platen_displacement"].values[:, axes] - wanted
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) < 0.1 * np.sqrt(np.mean(wanted**2, axis=0)))  # with its delay
    still = [k for k in range(6) if k not in run.plant.axes]
    assert not record["platen_displacement"].values[:, still].any()


@pytest.mark.long
def test_energy_of_every_example_is_accounted_for(shaken):
    """Inflow, stored, dissipated: what the balance leaves is the integration's second order."""
    audit = energy_audit(shaken.run)
    through = np.abs(audit.total("inflow")).max()
    assert np.abs(audit.residual).max() < 1e-4 * through
    assert np.abs(audit.total("created")).max() < 1e-9 * through  # no bearings, one mass


@pytest.mark.long
def test_guides_take_no_force_along_the_axes_that_they_leave_free(shaken):
    ledger = force_ledger(shaken.run)
    if shaken.run.plant.axes.size == 6:
        assert "guides" not in ledger.effects
        return
    held = ledger.wrench[:, ledger.effect("guides")]
    assert not held[:, shaken.run.plant.axes].any()
    weight = shaken.run.plant.machine.platen.mass[2] * G
    assert held[:, 2].mean() == pytest.approx(weight, rel=0.01)  # legs tilt a little as the platen moves across
    sums = ledger.wrench.sum(axis=1) - ledger.inertia
    assert np.abs(sums).max() < 1e-6 * weight


@pytest.mark.long
@pytest.mark.parametrize("motion", ["xy", pytest.param("yz", marks=pytest.mark.slow)])
@pytest.mark.parametrize("scheme", ["semi_implicit", pytest.param("rk4", marks=pytest.mark.slow), "euler"])
def test_both_engines_agree_on_guided_axes(motion, scheme):
    """ABA of Pinocchio's composite joint against the fused engine's inertia, in the same steps."""
    machine = guided(motion)
    target = make_target(
        find_motion("ridgecrest"), scale=0.1, axes=",".join(f"{a}=x" for a in motion), window=(20.0, 22.0)
    )
    runs = [
        rehearse(machine, target, load_controller("biaxial"), attrs={}, engine=engine, scheme=scheme).run
        for engine in ("fused", "pinocchio")
    ]
    assert runs[0].trouble is None
    assert np.allclose(runs[0].q, runs[1].q, rtol=0.0, atol=1e-9 * np.abs(runs[0].q).max())  # rounding, over 2 s


# Channels -------------------------------------------------------------------------------------------------------------


def test_channels_along_axes_that_guides_hold_need_no_map_and_bring_no_warnings():
    """One displacement and one acceleration of a one-axis table make a whole record; of the LHPOST6 they do not."""
    time = np.arange(512) / 256.0
    x = 0.02 * np.sin(2.0 * np.pi * 2.0 * time) * np.minimum(1.0, time) ** 3
    moved = np.column_stack([x, np.gradient(np.gradient(x, time), time)])
    columns = raw(moved, ["m", "m/s2"], time)
    sources = {
        "platen_displacement[x]": Source(column="c1"),
        "platen_acceleration[x]": Source(column="c2"),
    }
    channels = ChannelMap("map.toml", TestFacts(name="a"), sources)
    machine = load_machine("uniaxial")
    record = make_imported_record([columns], channels, machine.labels, machine)
    assert np.array_equal(record["platen_displacement"].values[:, 0], x)
    assert not record["platen_acceleration"].values[:, 1:].any() and "constant" not in record.attrs
    warned = [f.channel for f in check_dataset(record, machine) if f.severity != "info"]
    assert not [channel for channel in warned if "[" in channel and not channel.endswith("[x]")]
    frozen = record.assign(platen_displacement=record["platen_displacement"].copy())
    frozen["platen_displacement"][:, 0] = 0.0  # along its own axis a sensor that stands still is one
    assert any("is constant" in f.message for f in check_dataset(frozen, machine))
    large = load_machine()
    with pytest.raises(RecordError, match=r"platen_displacement has x, but not y, z, roll, pitch, yaw"):
        make_imported_record([columns], channels, large.labels, large)


# Files ----------------------------------------------------------------------------------------------------------------


def test_axes_of_guides_are_named_once_and_in_order():
    for wrong in ("yx", "xx", "roll", ""):
        with pytest.raises(ParameterError, match=r"machine.motion .*should be one of free, x, y, z, xy, xz, yz, xyz"):
            load_machine("biaxial").with_params({"machine.motion": wrong})


@pytest.mark.parametrize(("name", "axes"), [("uniaxial", "x"), ("biaxial", "xy"), ("hexapod", "free")])
def test_effects_act_along_the_axes_that_are_free(name, axes):
    machine = load_machine(name)
    free = [f"platen.{axis}" for axis in ("x", "y", "z", "roll", "pitch", "yaw")][: 6 if axes == "free" else len(axes)]
    found = {c for family in families().values() for c in family.components(machine) if c.startswith("platen.")}
    assert found == set(free) and machine.axis_names == tuple(axis.removeprefix("platen.") for axis in free)
    masses = {p.name for p in machine_parameters(machine) if p.name.startswith("platen.mass")}
    assert masses == {f"platen.mass[{axis}]" for axis in ("xyz" if axes == "free" else axes)}


def test_one_example_of_each_kind_is_shipped():
    kinds = {name: load_machine(name).motion for name in shipped()}
    assert {"x", "xy", "free"} <= set(kinds.values())
    areas = {a.area_a == a.area_b for name in OTHERS for a in load_machine(name).actuators}
    assert areas == {True, False}  # double- and single-rod cylinders

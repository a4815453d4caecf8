"""Specimens of all forms on the table, against closed forms and against each other."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from machine_cases import machine_named
from run_cases import at_rest, smooth_spools
from scipy.interpolate import CubicSpline
from scipy.linalg import eigh

from lhpost6_pin.control import load_controller
from lhpost6_pin.control.controller import controlled
from lhpost6_pin.core.errors import SimulationError
from lhpost6_pin.core.names import SCHEMES
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.machine.specimen_forms import Modes, RigidBody, SpecimenContents, spatial_inertia
from lhpost6_pin.mechanics.linearize import linearize
from lhpost6_pin.mechanics.modal_march import march_modes
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import PlantMotion, platen_motion
from lhpost6_pin.mechanics.rigid_body import platen_inertia
from lhpost6_pin.mechanics.specimen_mount import base_twist
from lhpost6_pin.simulation.energy import energy_audit
from lhpost6_pin.simulation.ledger import force_ledger
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulate import OpenLoop, Run, simulate
from lhpost6_pin.simulation.specimen_response import base_wrench, modes_of_run, point_response, twists_of_run

G = 9.80665
FLOOR, STOREY, BASE = 20e3, 25e6, 5e3  # of shear_frame.toml: kg, N/m, kg
HEIGHTS = (3.2, 6.2, 9.2)  # m


def stiffness_of(storeys: int, k: float) -> np.ndarray:
    return k * (
        2.0 * np.eye(storeys) - np.eye(storeys, k=1) - np.eye(storeys, k=-1) - np.diag([0.0] * (storeys - 1) + [1.0])
    )


def mounted(contents: SpecimenContents, machine: Machine | None = None) -> Machine:
    """Machine with a specimen whose contents are given in place of a file's."""
    table = (machine or load_machine()).with_specimen("shear_frame")
    specimen = replace(table.specimen)
    specimen.__dict__["contents"] = contents
    return replace(table, specimen=specimen)


def frequencies(plant, rest) -> np.ndarray:
    """Undamped frequencies [rad/s] of the linear plant, slowest first."""
    values = np.linalg.eigvals(linearize(plant, rest.state, rest.spool).A)
    return np.sort(np.abs(values[values.imag > 1e-3]))


def moved(machine: Machine, *, scheme="semi_implicit", rate=8192, samples=2048, engine="fused", size=0.15) -> Run:
    """Open-loop run in which all actuators move the table, smoothly, spools held over each model step."""
    plant, rest = at_rest(machine)
    steps = rate // 2048
    wave = smooth_spools((np.arange(samples * steps) + 0.5) / rate, plant.spools, size)
    weak = [1.0 if a.area_b is not None else 0.15 for a in machine.actuators]
    options = {"scheme": scheme, "steps_per_second": rate, "engine": engine}
    run = simulate(plant, OpenLoop(rest.spool + wave * weak, rest.state), samples=samples, **options)
    assert run.trouble is None
    return run


@pytest.fixture(scope="module")
def frame():
    return load_machine().with_specimen("shear_frame", (0.5, -0.8, 0.1), (0.0, 0.0, 0.4))


# ---------------------------------------------------------------------------------------- closed forms
def undamped(machine: Machine) -> Machine:
    kinds = {c.kind for c in machine.components}
    names = ("leakage", "viscous", "seal_friction", "pad_friction")
    found = {f"{k}.{n}": 0.0 for k in kinds for n in names}
    return machine.with_params({name: value for name, value in found.items() if name in machine.parameters})


def test_modes_of_the_matrices_are_those_of_a_shear_frame_on_a_fixed_base():
    modes = load_machine().with_specimen("shear_frame").specimen.modes
    k = np.arange(1, 4)
    closed = np.sqrt(STOREY / FLOOR) * 2.0 * np.sin((2 * k - 1) * np.pi / 14.0)  # uniform shear frame of three storeys
    np.testing.assert_allclose(modes.frequency, closed, rtol=1e-12)
    # effective masses sum to what moves along x; heights to the moment of the floors
    np.testing.assert_allclose((modes.participation[:, 0] ** 2).sum(), 3 * FLOOR, rtol=1e-12)
    np.testing.assert_allclose(modes.participation[:, 0] @ modes.participation[:, 4], FLOOR * sum(HEIGHTS), rtol=1e-12)


def test_frequencies_of_the_frame_on_a_platen_held_and_free_are_those_of_the_generalised_eigenproblem():
    """A platen guided along x on its oil columns: k and m of the oracle, by numpy alone."""
    bare = undamped(machine_named("uniaxial"))
    plant, rest = at_rest(bare)
    oil = frequencies(plant, rest)[-1]  # the oil column of the bare platen
    mass = plant.machine.platen.mass[0]
    m = np.diag([mass + BASE, *[FLOOR] * 3])
    k = np.zeros((4, 4))
    k[1:, 1:] = stiffness_of(3, STOREY)
    k[0, 0], k[0, 1], k[1, 0] = STOREY, -STOREY, -STOREY
    for held in (False, True):
        stiff = k.copy()
        stiff[0, 0] += mass * oil**2
        wanted = np.sqrt(eigh(stiff, m, eigvals_only=True))
        if held:
            wanted = np.sqrt(eigh(k[1:, 1:], m[1:, 1:], eigvals_only=True))
        loaded = bare.with_specimen("shear_frame")
        contents = loaded.specimen.contents
        none = contents.modes._replace(damping=np.zeros((3, 3)))
        plant, rest = at_rest(mounted(contents._replace(modes=none), bare))
        linear = linearize(plant, rest.state, rest.spool)
        if held:  # without the platen's rows
            keep = np.r_[np.arange(len(linear.A) - 6, len(linear.A))]
            values = np.linalg.eigvals(linear.A[np.ix_(keep, keep)])
        else:
            values = np.linalg.eigvals(linear.A)
        found = np.sort(np.abs(values[values.imag > 1e-3]))
        np.testing.assert_allclose(found[-len(wanted) :], wanted, rtol=1e-6)  # as wanted by the issue


def test_a_specimen_at_rest_weighs_what_it_weighs_and_leans_where_its_base_is_tilted():
    machine = load_machine().with_specimen("tall_column", (0.4, 0.2, 0.05), (0.02, -0.03, 0.3))
    plant, rest = at_rest(machine)
    specimen = machine.specimen
    turn = pin.rpy.rpyToMatrix(*specimen.rpy)
    down = turn.T @ [0.0, 0.0, -G]
    part = specimen.modes.participation[:, :3]
    sag = part @ down / specimen.modes.frequency**2
    np.testing.assert_allclose(rest.state.z[-8:-4], sag, rtol=1e-12)
    run = simulate(plant, OpenLoop(np.tile(rest.spool, (64, 1)), rest.state), samples=64, engine="fused")
    body = specimen.contents.body
    held = -base_wrench(run)
    np.testing.assert_allclose(held[-1, :3], body.mass * down, rtol=1e-9, atol=1e-3)  # N of a meganewton's balance
    moment = np.cross(body.centre, body.mass * down) + np.cross(part.T @ sag, down)  # P-delta of what leans
    np.testing.assert_allclose(held[-1, 3:], moment, rtol=1e-9, atol=1e-2)
    assert np.abs(run.z[-1] - run.z[0])[-8:].max() < 1e-9 * np.abs(sag).max()  # it stays at rest


# ---------------------------------------------------------------------------------------- energy and forces
@pytest.fixture(scope="module")
def fine(frame):
    """A run whose states are exact to what its samples can integrate."""
    return moved(frame, scheme="rk4", rate=32768, samples=2048)


def test_energy_over_the_interface_is_what_the_specimen_holds_and_dissipates(fine):
    """Work of the base wrench against the energy of the frame in physical coordinates; to 1e-6 of the turnover."""
    specimen = fine.plant.machine.specimen
    contents, modes = specimen.contents, modes_of_run(fine)
    twist, _, down = twists_of_run(fine)
    to_base = base_twist(fine.plant.machine)
    nu = twist @ to_base.T
    power = np.einsum("ij,ij->i", base_wrench(fine), nu)
    time = fine.time
    work = CubicSpline(time, power).antiderivative()(time)
    spent = CubicSpline(time, modes.dissipation).antiderivative()(time)
    part, inertia = contents.modes.participation, spatial_inertia(contents.body)
    kinetic = 0.5 * np.einsum("ij,jk,ik->i", nu, inertia, nu) + np.einsum("ij,ij->i", nu @ part.T, modes.velocity)
    kinetic += 0.5 * (modes.velocity**2).sum(axis=1)
    elastic = 0.5 * (contents.modes.frequency**2 * modes.displacement**2).sum(axis=1)
    # weight: of the rigid body by its height, of the relative motion by G_lin eta along gravity
    turn = pin.rpy.rpyToMatrix(*specimen.rpy)
    top = pin.SE3(np.eye(3), -np.array(fine.plant.machine.platen.centre_of_gravity))
    base = top * pin.SE3(turn, np.array(specimen.position))
    height = [(pin.XYZQUATToSE3(q) * base).act(np.array(contents.body.centre))[2] for q in fine.q]
    falls = down @ base.rotation  # gravity in base axes
    weight = contents.body.mass * G * np.array(height) - np.einsum("ij,ij->i", modes.displacement @ part[:, :3], falls)
    held = kinetic + elastic + weight
    turnover = np.abs(power).sum() / fine.rate
    assert elastic.max() > 1e-2 * kinetic.max()  # the frame sways
    assert np.abs(work - spent - (held - held[0])).max() < 1e-6 * turnover


def test_the_ledger_sums_to_the_inertia_with_the_reaction_of_modes(fine):
    ledger = force_ledger(fine)
    reaction = ledger.wrench[:, ledger.effect("specimen_modes")]
    assert np.abs(reaction[:, 0]).max() > 1e4
    assert np.abs(ledger.residual).max() < 1e-12 * np.abs(ledger.wrench).max()  # rk4: rounding alone


@pytest.mark.parametrize("name", ["shear_frame", "shear_frame_joints", "tall_column"])
def test_the_energy_audit_closes(name):
    machine = load_machine().with_specimen(name, (0.5, -0.8, 0.1))
    engine = "pinocchio" if "joints" in name else "fused"
    audit = energy_audit(moved(machine, samples=1024, engine=engine))
    kind = "joints" if "joints" in name else "modes"
    assert np.abs(audit.power[:, audit.entry(f"stored.specimen_{kind}")]).max() > 100.0
    wanted = [i for i, e in enumerate(audit.entries) if e.startswith(("inflow.", "delivered."))]
    turnover = np.abs(audit.power[:, wanted]).sum() * (audit.time[1] - audit.time[0])
    # trapezoidal rule at 2048 Hz: (2 pi 20 Hz / 2048 Hz)^2 / 12 = 3e-4 of the liveliest tenth of the flow
    assert np.abs(audit.residual).max() < 1e-4 * turnover


# ---------------------------------------------------------------------------------------- forms against each other
def rrmse(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.linalg.norm(a - b, axis=0) / np.linalg.norm(b - b[0], axis=0)


def test_the_frame_with_joints_and_by_its_matrices_moves_the_table_alike():
    """The rest is what modes neglect: gyroscopic forces and the inertia of displaced floors, which grow with motion.

    0.6 to 1.2 cm of table motion and 3 cm of the roof; z, roll and pitch move by a few mm and mrad and see the floors'
    weight displaced in second order.
    """
    where = (0.5, -0.8, 0.1), (0.0, 0.0, 0.4)
    joints, modes = (
        moved(load_machine().with_specimen(name, *where), engine="pinocchio", samples=2048, size=0.03)
        for name in ("shear_frame_joints", "shear_frame")
    )
    assert np.ptp(modes.q[:, 0]) > 0.005
    one, two = (platen_motion(run.plant, run.q, run.v, run.a) for run in (joints, modes))
    assert (rrmse(one.displacement, two.displacement) < 1e-3).all()  # as wanted by the issue
    assert (rrmse(one.velocity, two.velocity)[[0, 1, 5]] < 5e-4).all()
    assert (rrmse(one.velocity, two.velocity) < 2e-3).all()
    bare = moved(load_machine(), samples=2048, size=0.03)
    assert rrmse(bare.v, modes.v)[0] > 0.03  # the frame is felt
    drift = np.cumsum(joints.q[:, 7:10], axis=1)  # storeys' drifts to floors' displacements
    assert (rrmse(drift, point_response(modes)["displacement"]) < 1e-3).all()


def test_a_specimen_without_modes_is_the_urdf_with_locked_joints():
    where = (0.5, -0.8, 0.1), (0.1, -0.2, 0.7)
    plants = [
        make_plant(load_machine().with_specimen(name, *where, locked=True))
        for name in ("shear_frame_joints", "shear_frame")
    ]
    one, two = (platen_inertia(plant.model, plant.machine)[0] for plant in plants)
    np.testing.assert_allclose(one, two, rtol=1e-7, atol=1e-7 * np.abs(one).max())  # digits of the files
    assert not plants[1].modes.size and not plants[1].flexible
    same = [getattr(plants[1].tables, name).tobytes() for name in ("inertia", "modes")]
    rigid = load_machine().with_specimen("shear_frame", *where).specimen.contents._replace(modes=None)
    table = mounted(rigid)
    other = make_plant(replace(table, specimen=_placed(table.specimen, *where)))
    assert [getattr(other.tables, name).tobytes() for name in ("inertia", "modes")] == same


def test_the_controller_is_that_of_the_mass_carried_whatever_a_specimens_form():
    """The force feedback of a frame with joints had been that of the platen alone, and its loop another one."""
    forms = ("shear_frame_joints", False), ("shear_frame_joints", True), ("shear_frame", False)
    tables = [load_machine().with_specimen(name, locked=locked) for name, locked in forms]
    gains = [controlled(table, load_controller(table.controller))[2].axis["force_gain"] for table in tables]
    bare = controlled(load_machine(), load_controller(load_machine().controller))[2].axis["force_gain"]
    assert (gains[0] < 0.99 * bare).all()
    np.testing.assert_allclose(gains[1:], [gains[0]] * 2, rtol=1e-6)  # digits of the files


def _placed(specimen, position, rpy):
    placed = replace(specimen, position=position, rpy=rpy)
    placed.__dict__["contents"] = specimen.contents
    return placed


def coupled(contents: SpecimenContents) -> SpecimenContents:
    """The frame with a damper in its first storey alone, which couples its modes."""
    modes = contents.modes
    damper = 4e5 * np.outer(modes.shape[0], modes.shape[0])  # N s/m between base and first floor
    return contents._replace(modes=modes._replace(damping=modes.damping + damper))


@pytest.mark.parametrize("scheme", SCHEMES)
def test_both_engines_agree(frame, scheme):
    machine = mounted(coupled(frame.specimen.contents))
    rate = {"euler": 32768}.get(scheme, 8192)
    one, two = (moved(machine, scheme=scheme, rate=rate, samples=256, engine=e) for e in ("pinocchio", "fused"))
    assert np.abs(one.z[:, -6:]).max() > 0.5  # m sqrt(kg) and its rate: the modes move
    for name in ("q", "v", "z"):
        a, b = getattr(one, name), getattr(two, name)
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(b).max())  # rounding over 1024 steps


@pytest.mark.parametrize("damper", [False, True])
def test_the_staggered_scheme_stays_of_second_order(frame, damper):
    contents = frame.specimen.contents
    machine = mounted(coupled(contents) if damper else contents)
    spools = {}

    def final(scheme, rate):
        plant, rest = at_rest(machine)
        wave = spools.setdefault("wave", rest.spool + smooth_spools((np.arange(256) + 0.5) / 2048, plant.spools, 0.1))
        run = simulate(
            plant, OpenLoop(wave, rest.state), samples=256, scheme=scheme, steps_per_second=rate, engine="fused"
        )
        return np.concatenate([run.q[-1, :3], run.z[-1, -6:]])

    exact = final("rk4", 65536)
    errors = [np.linalg.norm((final("semi_implicit", rate) - exact)[3:]) for rate in (8192, 32768)]
    assert np.log2(errors[0] / errors[1]) / 2 == pytest.approx(2.0, abs=0.25)  # kinks of seals that turn round


@pytest.mark.parametrize("ratio", [0.1, 1.0, 5.0, 10.0])
@pytest.mark.parametrize("rate", [2048, 8192])
@pytest.mark.parametrize("name", ["uniaxial", "lhpost6"])
def test_the_coupling_is_stable_at_any_ratio_of_masses(name, ratio, rate):
    """2 s of nearly free vibration after a pulse; the free platen has a supply that lifts ten of it."""
    bare = machine_named(name)
    if name == "lhpost6":
        bare = bare.with_params({"hydraulics.supply_pressure": 60e6})
    contents = load_machine().with_specimen("shear_frame").specimen.contents
    factor = ratio * bare.platen.mass[0] / contents.body.mass
    part = np.sqrt(factor) * contents.modes.participation
    modes = contents.modes._replace(participation=part, damping=np.zeros((3, 3)))
    body = RigidBody(factor * contents.body.mass, contents.body.centre, factor * contents.body.inertia)
    plant, rest = at_rest(mounted(contents._replace(body=body, modes=modes), bare))
    spool = np.tile(rest.spool, (4096, 1))
    pulse = 0.05 * np.sin(np.pi * np.arange(200) / 100)[:, None]
    spool[:200, :4] += pulse * [1, 1, -1, -1][: min(4, plant.spools)]
    run = simulate(plant, OpenLoop(spool, rest.state), samples=4096, steps_per_second=rate, engine="fused")
    assert run.trouble is None
    moving = modes_of_run(run)
    energy = 0.5 * (moving.velocity**2 + modes.frequency**2 * moving.displacement**2).sum(axis=1)
    assert energy[200:1200].max() > 0.0
    assert energy[3000:].max() < 1.05 * energy[200:1200].max()  # nothing is fed in; seals and leaks take a little


def test_guided_machines_and_stiff_modes(frame):
    run = moved(machine_named("uniaxial").with_specimen("shear_frame"), samples=512, size=0.05)
    assert np.abs(modes_of_run(run).displacement).max() > 0.0
    contents = frame.specimen.contents
    stiff = contents.modes._replace(frequency=contents.modes.frequency * [1.0, 1.0, 1000.0])
    with pytest.raises(SimulationError, match=r"modes of shear_frame\.toml reach \d+ Hz .*highest_frequency"):
        moved(mounted(contents._replace(modes=stiff)), samples=8)


def test_modes_marched_along_a_measured_motion_are_those_of_the_run(frame):
    run = moved(mounted(coupled(frame.specimen.contents)), rate=2048, samples=600)
    found = march_modes(run.plant, PlantMotion(run.q, run.v, run.a), 1.0 / run.rate)
    wanted = run.z[:, -6:]
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-7 * np.abs(wanted).max())  # log of the pose: 1e-16 / dt


def test_points_move_as_the_platen_carries_them(frame):
    run = moved(frame, samples=400, scheme="rk4")
    response = point_response(run)
    assert response["displacement"].shape == (400, 3)
    # second derivative of the points' own positions, by splines: floors at their places in {s}, along the base's x
    specimen, platen = frame.specimen, frame.platen
    top = pin.SE3(np.eye(3), -np.array(platen.centre_of_gravity))
    base = top * pin.SE3(pin.rpy.rpyToMatrix(*specimen.rpy), np.array(specimen.position))
    for k, height in enumerate(HEIGHTS):
        place = [
            (pin.XYZQUATToSE3(q) * base).act(np.array([u, 0.0, height]))
            for q, u in zip(run.q, response["displacement"][:, k], strict=True)
        ]
        along = CubicSpline(run.time, np.array(place)).derivative(2)(run.time)
        axis = np.array([pin.XYZQUATToSE3(q).rotation @ base.rotation[:, 0] for q in run.q])
        wanted = np.einsum("ij,ij->i", along, axis)[20:-20]
        found = response["acceleration"][20:-20, k]
        assert np.abs(found - wanted).max() < 0.02 * np.abs(wanted).max()  # splines and small turns


def test_a_modal_specimen_has_a_shape_for_each_point_or_none():
    contents = load_machine().with_specimen("tall_column").specimen.contents
    assert isinstance(contents.modes, Modes) and contents.modes.shape.shape == (4, 4)
    # cantilever with a mass that turns: determinant of the 2 by 2 problem by hand
    m, j, ei, length = 44e3, 66e3, 1.53e9, 10.0
    a, b, c = 12 * ei / length**3, 6 * ei / length**2, 4 * ei / length
    w2 = np.roots([m * j, -(a * j + c * m), a * c - b * b])
    np.testing.assert_allclose(np.unique(np.round(contents.modes.frequency, 6)), np.sort(np.sqrt(w2)), rtol=1e-6)


def test_the_record_holds_the_motion_of_the_points_by_name(frame):
    run = moved(load_machine().with_specimen("tall_column"), samples=64)
    record = record_of_run(run, {"test": "column"})
    assert list(record["specimen_point"].values) == ["top x", "top pitch", "top y", "top roll"]
    assert record["specimen_acceleration"].attrs["column_units"] == "m/s2, rad/s2, m/s2, rad/s2"
    assert record.attrs["specimen"] == "tall_column"
    np.testing.assert_array_equal(record["specimen_displacement"], point_response(run)["displacement"])
    assert not any(name.startswith("hidden_specimen") for name in record)


def test_a_urdf_with_springs_rests_where_they_carry_its_weight(tmp_path):
    """A pendulum upside down on a spring: k phi = m g l sin(phi + tilt); too soft a spring is refused."""
    urdf = tmp_path / "pole.urdf"
    urdf.write_text(
        '<robot name="pole"><link name="foot"><inertial><mass value="100"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<link name="top"><inertial><origin xyz="0 0 2"/><mass value="1000"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="hinge" type="revolute"><parent link="foot"/><child link="top"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1" effort="1e9" velocity="1e9"/></joint></robot>'
    )
    springs = tmp_path / "pole.toml"
    tilt, weight = 0.05, 1000.0 * G * 2.0
    machine = load_machine().with_specimen(urdf, rpy=(0.0, tilt, 0.0))
    springs.write_text('[joint.hinge]\nstiffness = { value = 100, unit = "kN m/rad" }\n')
    plant, rest = at_rest(machine)
    phi = rest.state.q[-1]
    assert 1e5 * phi == pytest.approx(weight * np.sin(phi + tilt), rel=1e-9) and phi > 0.01
    run = simulate(plant, OpenLoop(np.tile(rest.spool, (256, 1)), rest.state), samples=256)
    assert np.abs(run.q[:, -1] - phi).max() < 1e-9
    springs.write_text('[joint.hinge]\nstiffness = { value = 10, unit = "kN m/rad" }\n')
    with pytest.raises(SimulationError, match="specimen pole has no stable rest"):
        at_rest(load_machine().with_specimen(urdf, rpy=(0.0, tilt, 0.0)))


def test_springs_of_joints_give_the_closed_frequency_on_a_platen_held(tmp_path):
    """The frame's joints with the platen's rows taken away: a shear frame on a fixed base."""
    plant, rest = at_rest(undamped(machine_named("uniaxial")).with_specimen("shear_frame_joints"))
    linear = linearize(plant, rest.state, rest.spool)
    nv = linear.nv
    # accelerations of the joints with the platen's force zero are those of a free platen: hold it by its inertia
    mass = pin.crba(plant.model, plant.model.createData(), rest.state.q)
    stiff = -mass @ linear.A[nv : 2 * nv, :nv]
    found = np.sqrt(eigh(stiff[1:, 1:], mass[1:, 1:], eigvals_only=True))
    k = np.arange(1, 4)
    np.testing.assert_allclose(found, np.sqrt(STOREY / FLOOR) * 2 * np.sin((2 * k - 1) * np.pi / 14), rtol=1e-6)

"""The platen's dynamics on Pinocchio against the report's equations, and specimens against closed forms."""

import numpy as np
import pinocchio as pin
import pytest
from machine_cases import FREE_MACHINES, MACHINES, PENDULUM, machine_named, plant_named, platen_se3, random_poses
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.special import ellipk

from lhpost6_pin.core.errors import ParameterError, SimulationError
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.effects.registry import LAWS, law_of
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.machine.port_names import PLATEN_PORTS
from lhpost6_pin.mechanics import kinematics as kin
from lhpost6_pin.mechanics.forward_dynamics import platen_acceleration
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.mechanics.required_wrench import refuse_joints
from lhpost6_pin.mechanics.rigid_body import lumped_inertia, make_model, platen_inertia
from lhpost6_pin.mechanics.schemes import FORCE, TAU, V_SEEN, dexp_inverse, forces_stage, pose_stage
from lhpost6_pin.mechanics.specimen_joints import joints_beyond, specimen_doubts, specimen_joints, specimen_positions
from lhpost6_pin.mechanics.workspace import make_workspace

BOB, ARM, BOB_INERTIA, POST = 500.0, 2.0, 25.0, 200.0  # of pendulum.urdf: kg, m, kg m2 about Y, kg
G = 9.80665
ABOVE = (0.5, -0.3, 0.0)  # where the tests bolt it


def random_states(plant, count, seed=0):
    """q, v, z and spools of violent states: all over the travel range, chambers between return and supply."""
    rng = np.random.default_rng(seed)
    low, high = plant.supply[1], plant.supply[0]
    for pose in random_poses(plant.machine, count, seed):
        if plant.machine.motion == "free":
            q = pin.SE3ToXYZQUAT(platen_se3(plant.machine, pose))
        else:
            q = pose[plant.axes]
        v = (rng.uniform(-1.0, 1.0, 6) * [3.0, 2.0, 0.5, 0.3, 0.3, 0.5])[plant.axes]
        z = np.array([rng.uniform(low, high) if "pressure" in n else rng.uniform(-0.7, 0.7) for n in plant.states])
        yield pose, q, v, z


def forces_at(plant, q, v, z):
    """Workspace with ports, ledger and torques at a state, as every scheme computes them."""
    ws = make_workspace(plant, plant.zero_state())
    ws.q[:], ws.z[:], ws.motion[V_SEEN] = q, z, v
    pose_stage(ws.q, plant.tables, ws)
    forces_stage(plant.tables, ws, ws.z)
    return ws


def report_wrench(plant, pose, ws):
    """Eq. 4-24 from the ledger: axial force and pad friction of every component, hand-derived directions."""
    machine = plant.machine
    axial = {c.name: 0.0 for c in machine.components}
    at_c = np.zeros(6)
    pad = {c.name: np.zeros(2) for c in machine.components}
    for row, force in zip(plant.rows, ws.force, strict=True):
        name = plant.ports[row["port"]].split(".")[0]
        if law_of(row) is LAWS["bouc_wen_2d"]:
            pad[name] += force[:2]
        elif name == "platen":
            at_c[(np.array(PLATEN_PORTS) == plant.ports[row["port"]])[[3, 4, 5, 0, 1, 2]]] += force[0]
        else:
            axial[name] += force[0]
    forces = {c.name: kin.component_force(machine, pose, c, axial[c.name], pad[c.name]) for c in machine.components}
    return kin.external_wrench(machine, pose, forces) + kin.c_J_b(machine, pose).T @ at_c


# The platen against Eqs. 4-24 to 4-30 --------------------------------------------------------------------------------


@pytest.mark.parametrize("thrust", ["report", "normal"])
@pytest.mark.parametrize("name", FREE_MACHINES)
def test_aba_with_directional_mass_bias_and_weight_is_the_reports_equation_of_motion(name, thrust):
    drag = tuple((c,) for c in (1e4, 2e4, 3e4, 1e5, 2e5, 3e5))
    effect = Effect("drag", "viscous", PLATEN_PORTS, drag, "a test of the platen's own ports")
    plant = make_plant(machine_named(name, thrust).with_effect(effect))
    data = plant.model.createData()
    for pose, q, v, z in random_states(plant, 24):
        ws = forces_at(plant, q, v, z)
        a = pin.aba(plant.model, data, q, v, ws.motion[TAU])
        inert = kin.inertial_wrench(plant.machine, kin.to_report_order(v), kin.to_report_order(a))
        external = report_wrench(plant, pose, ws)
        # Eq. 4-30; sums of terms up to 1e7 N and N m, each rounded at 1e-16 of it a few dozen times
        scale = np.abs(ws.port[FORCE]).max() + np.abs(inert).max()
        assert np.abs(inert - external).max() < 1e-13 * scale


LOADED = machine_named("lhpost6").with_specimen(PENDULUM, (2.0, -1.0, 0.1), (0.1, -0.2, 0.7), locked=True)


@pytest.mark.parametrize("machine", [*map(machine_named, MACHINES), LOADED], ids=[*MACHINES, "rigid specimen"])
def test_fused_forward_dynamics_are_pinocchios(machine):
    plant = make_plant(machine)
    table, data = plant.tables.inertia, plant.model.createData()
    a = np.zeros(plant.axes.size)
    for _, q, v, z in random_states(plant, 24):
        ws = forces_at(plant, q, v, z)
        platen_acceleration(table, plant.axes, ws.frame, ws.motion[TAU], np.zeros((2, 6)), a)
        wanted = pin.aba(plant.model, data, q, v, ws.motion[TAU])
        assert np.allclose(a, wanted, rtol=1e-12, atol=1e-11)  # up to 100 m/s2; inverse of a well-conditioned 6x6


def test_a_guided_platen_has_one_coordinate_and_the_mass_along_its_guide():
    plant = make_plant(machine_named("uniaxial").with_params(platen__mass=[4.5e3, 4e3, 5e3]))
    assert plant.model.nq == plant.model.nv == 1
    assert pin.crba(plant.model, plant.model.createData(), np.zeros(1))[0, 0] == plant.machine.platen.mass[0]


def exact_inverse_differential(step):
    """Matrix of dexp_inverse (6, 6), closed form: the inverse of the integral of exp(-s ad) over s from 0 to 1."""
    v, w = pin.skew(step[:3]), pin.skew(step[3:])
    bracket = np.block([[w, v], [np.zeros((3, 3)), w]])
    augmented = np.zeros((12, 12))
    augmented[:6, :6], augmented[:6, 6:] = -bracket, np.eye(6)
    return np.linalg.inv(expm(augmented)[:6, 6:])


def worst_inverse_differential(size, oracle):
    rng = np.random.default_rng(8)
    out, worst = np.zeros(6), 0.0
    for _ in range(20):
        step, v = size * rng.uniform(-1.0, 1.0, 6), rng.uniform(-1.0, 1.0, 6)
        dexp_inverse(step, v, out)
        worst = max(worst, np.abs(out - oracle(step) @ v).max())
    return worst


def test_inverse_exponential_differential_is_exact_for_the_steps_of_a_shake_table():
    # largest turn in 1/2048 s at 0.33 rad/s is 2e-4, largest travel 1.5e-3 m; the next term is x^4/720
    assert worst_inverse_differential(1e-4, exact_inverse_differential) < 1e-15
    assert worst_inverse_differential(1e-3, exact_inverse_differential) < 1e-14
    # fourth order: twice the step, sixteen times the error
    large, half = (worst_inverse_differential(size, exact_inverse_differential) for size in (0.1, 0.05))
    assert large / half == pytest.approx(16.0, rel=0.05)


def test_inverse_exponential_differential_is_pinocchios():
    model = plant_named("lhpost6").model
    q0 = plant_named("lhpost6").zero_state().q

    def theirs(step):
        return pin.dDifference(model, q0, pin.integrate(model, q0, step), pin.ArgumentPosition.ARG1)

    assert worst_inverse_differential(1e-5, theirs) < 1e-15
    # from 1e-4 to 1e-2 rad Pinocchio's own differs from the closed form by up to 4e-9 (cancellation beside its series)
    assert worst_inverse_differential(1e-3, theirs) < 1e-8
    assert worst_inverse_differential(2e-2, theirs) < 1e-8


# Table 4.1 -----------------------------------------------------------------------------------------------------------


def lumped():
    machine = machine_named("lhpost6")
    alone = [machine.parameters[f"estimates.platen_alone.{key}"].value for key in ("mass", "inertia")]
    return machine, lumped_inertia(*alone, machine)


def table_4_1(machine, row):
    mass, inertia = (machine.parameters[f"estimates.{row}.{key}"].value for key in ("mass", "inertia"))
    return np.array([*mass, *inertia])


@pytest.mark.parametrize(
    "kind, tolerance",
    [
        # masses: the lumped masses were derived from these sums; printed to 10 kg
        # inertias: coordinates to 0.01 m of 3 to 6 m give 0.4 %; printed to 10 kg m2
        ("horizontal", [1e-4, 1e-4, 1e-4, 0.03, 0.005, 0.015]),  # I_x: lever 0.44 m drawn, not derived; I_z: 6.19 m
        ("vertical", [None, None, 1e-4, 1e-3, 1e-3, None]),
        ("hold_down", [1e-4, 1e-4, 1e-4, 0.005, None, 0.01]),  # I_y does not fit: see below
    ],
)
def test_moving_parts_at_their_connection_points_are_the_contributions_of_table_4_1(kind, tolerance):
    machine, parts = lumped()
    found, printed = np.diag(parts[kind]), table_4_1(machine, kind)
    for mine, theirs, rel in zip(found, printed, tolerance, strict=True):
        if rel is not None:
            assert mine == pytest.approx(theirs, rel=rel)
    nothing = printed == 0.0
    assert np.allclose(found[nothing], 0.0, atol=1e-9)


def test_struts_pitch_inertia_is_the_one_contribution_that_does_not_fit():
    machine, parts = lumped()
    found, printed = parts["hold_down"][4, 4], table_4_1(machine, "hold_down")[4]
    # 156.2 against 177.88 t m2: the strut pins would have to be 2.6 m below B, I_x says 1.62 m
    assert found / printed == pytest.approx(0.878, abs=0.005)
    mass = table_4_1(machine, "hold_down")
    lever_from_pitch = np.sqrt((printed - 2.0 / 3.0 * mass[2] * 4.89**2) / mass[0])
    lever_from_roll = np.sqrt(mass[3] / mass[1])
    assert lever_from_pitch == pytest.approx(2.6, abs=0.05)
    assert lever_from_roll == pytest.approx(1.62, abs=0.01)


def test_first_estimate_is_the_sum_of_platen_and_moving_parts():
    machine, parts = lumped()
    total, printed = np.diag(sum(parts.values())), table_4_1(machine, "first")
    assert np.allclose(total[:3], printed[:3], rtol=1e-5)  # M_eff,1
    assert np.allclose(total[[3, 5]], printed[[3, 5]], rtol=0.0025)  # 0.01 % in roll, -0.2 % in yaw
    assert total[4] / printed[4] == pytest.approx(0.993, abs=0.001)  # the struts' misfit, in pitch
    # and the report's own rows add up to its sum, to the last digit printed
    rows = sum(table_4_1(machine, row) for row in ("platen_alone", "horizontal", "vertical", "hold_down"))
    assert np.allclose(rows, printed, rtol=0.0, atol=15.0)


def test_moving_parts_couple_no_directions_but_surge_with_pitch_and_sway_with_roll():
    machine, parts = lumped()
    total = sum(parts.values())
    coupling = total - np.diag(np.diag(total))
    pairs = {(0, 4): -1.0, (1, 3): 1.0}
    for (i, j), sign in pairs.items():
        # 13.5 t m: the swivels and pins hang below B, which Table 4.1's diagonal inertia does not show; for B to be the
        # centre of gravity of all, that of the platen alone would lie 0.09 m above it
        assert coupling[i, j] == pytest.approx(sign * 13.5e3, rel=0.01)
        assert abs(coupling[i, j]) / machine.parameters["estimates.platen_alone.mass"].value[0] < 0.1
        coupling[i, j] = coupling[j, i] = 0.0
    assert np.allclose(coupling, 0.0, atol=1e-6)


def test_second_estimate_differs_from_the_first_by_what_the_report_says():
    machine = machine_named("lhpost6")
    off = 100.0 * (table_4_1(machine, "second") / table_4_1(machine, "first") - 1.0)
    assert np.allclose(off, [1.42, 1.50, 1.18, -3.39, -6.20, 6.88], atol=0.006)  # printed to 0.01 %


# Specimens -----------------------------------------------------------------------------------------------------------


def test_locked_specimen_adds_its_mass_and_inertia_to_the_platen():
    machine = machine_named("lhpost6")
    position, rpy = (0.5, -0.3, 0.2), (0.1, -0.2, 0.3)
    plant = make_plant(machine.with_specimen(PENDULUM, position, rpy, locked=True))
    assert plant.model.nv == 6
    assert plant.model.inertias[1].mass == pytest.approx(min(machine.platen.mass) + POST + BOB, rel=1e-15)
    # by hand, at B: each link's inertia about its own centre, turned and moved (parallel axes)
    turn = pin.rpy.rpyToMatrix(*rpy)
    centre = np.array(machine.platen.centre_of_gravity)
    wanted = np.diag([*[min(machine.platen.mass)] * 3, *machine.platen.inertia])
    links = [(POST, [0.0, 0.0, 1.5], [150.0, 150.0, 4.0]), (BOB, [0.0, 0.0, 1.0], [20.0, 25.0, 10.0])]
    for mass, at, inertia in links:
        lever = np.array(position) - centre + turn @ at
        reach = kin.skew(lever)
        wanted += np.block(
            [[mass * np.eye(3), -mass * reach], [mass * reach, turn @ np.diag(inertia) @ turn.T - mass * reach @ reach]]
        )
    plain, full = platen_inertia(plant.model, plant.machine)
    assert np.allclose(plain, wanted, rtol=1e-13, atol=1e-9)
    extra = np.array(machine.platen.mass) - min(machine.platen.mass)
    assert np.allclose(full - plain, np.diag([*extra, 0.0, 0.0, 0.0]), rtol=0.0, atol=1e-9)


def test_free_specimen_joins_the_same_model_with_its_joints():
    plant = make_plant(machine_named("lhpost6").with_specimen(PENDULUM, ABOVE))
    assert list(plant.model.names) == ["universe", "platen", "pivot"]
    assert plant.model.nv == 7 and plant.axes.size == 6
    assert pin.computeTotalMass(plant.model) == pytest.approx(168060.0 + POST + BOB)
    with pytest.raises(SimulationError, match="free joints"):
        refuse_joints(plant)


def pendulum_rate():
    """Small-swing angular frequency of the pendulum on a platen that does not move [rad/s]."""
    return np.sqrt(BOB * G * ARM / (BOB_INERTIA + BOB * ARM**2))


def held_swing(model, angle, rate):
    """Angular acceleration of the pendulum on a platen that does not move, from the equations of the whole model."""
    data = model.createData()
    q = pin.integrate(model, pin.neutral(model), np.array([0.0] * 6 + [angle]))
    v = np.array([0.0] * 6 + [rate])
    # the platen's acceleration is zero: the pendulum's own row of M a + h = 0 is left
    return -pin.nonLinearEffects(model, data, q, v)[6] / pin.crba(model, data, q)[6, 6]


def test_pendulum_swings_wide_with_the_period_of_the_elliptic_integral():
    model = make_model(machine_named("lhpost6").with_specimen(PENDULUM, ABOVE))
    start = 1.2  # rad
    period = 4.0 * ellipk(np.sin(0.5 * start) ** 2) / pendulum_rate()
    options = {"events": lambda _, y: y[0], "rtol": 1e-10, "atol": 1e-12}
    swing = solve_ivp(lambda _, y: [y[1], held_swing(model, *y)], (0.0, 0.3 * period), [start, 0.0], **options)
    assert swing.t_events[0][0] == pytest.approx(0.25 * period, rel=1e-8)  # the solver's tolerance


def test_pendulum_on_a_platen_free_to_roll_swings_faster_by_the_mass_ratio():
    # two masses in one model: omega^2 = m g L / (J - (m L)^2 / (M + m)), J about the pivot
    machine = machine_named("uniaxial").with_specimen(PENDULUM, ABOVE)
    model = make_model(machine)
    data = model.createData()
    angle = 1e-4
    q = pin.integrate(model, pin.neutral(model), np.array([0.0, angle]))
    a = pin.aba(model, data, q, np.zeros(2), np.zeros(2))
    all_mass = machine.platen.mass[0] + POST + BOB
    rate = BOB * G * ARM / (BOB_INERTIA + BOB * ARM**2 - (BOB * ARM) ** 2 / all_mass)
    assert a[1] == pytest.approx(-rate * angle, rel=1e-8)
    # and the centre of mass of all stays: the turn about +Y takes the bob (below the pivot) to -X
    assert all_mass * a[0] - BOB * ARM * np.cos(angle) * a[1] == pytest.approx(0.0, abs=1e-11)


@pytest.mark.parametrize("robot, joints", [("double_pendulum", 2), ("ur5", 6), ("solo12", 12)])
def test_models_of_example_robot_data_mount_as_specimens(robot, joints):
    import example_robot_data  # here: it takes a second to import

    found = example_robot_data.load(robot)
    free = make_plant(machine_named("lhpost6").with_specimen(found.urdf, (1.0, 0.5, 0.0), (0.0, 0.0, 0.4)))
    locked = make_plant(machine_named("lhpost6").with_specimen(found.urdf, (1.0, 0.5, 0.0), locked=True))
    assert free.model.nv == 6 + joints
    assert locked.model.nv == 6
    alone = pin.buildModelFromUrdf(found.urdf)
    total = 168060.0 + sum(i.mass for i in alone.inertias)  # the root link's mass sits on Pinocchio's universe joint
    assert sum(i.mass for i in free.model.inertias) == pytest.approx(total, rel=1e-12)
    assert locked.model.inertias[1].mass == pytest.approx(total, rel=1e-12)
    still = np.zeros(6 + joints)
    assert np.isfinite(pin.aba(free.model, free.model.createData(), pin.neutral(free.model), still, still)).all()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("nowhere", None, "no such URDF"),
        ("broken", "<robot name='x'><link", "not a URDF"),
        ("light", "<robot name='light'><link name='air'/></robot>", "the specimen has no mass"),
        ("clash", PENDULUM.read_text(encoding="utf-8").replace('"pivot"', '"platen"'), ""),
    ],
)
def test_urdf_that_cannot_be_a_specimen_is_refused_with_its_name(tmp_path, name, text, message):
    path = tmp_path / f"{name}.urdf"
    if text:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(ParameterError, match=rf"{name}.urdf.*{message}"):
        make_plant(machine_named("lhpost6").with_specimen(path))


URDF = """<robot name="tower">
  <link name="base">
    <inertial><mass value="{mass}"/><inertia ixx="4e4" iyy="4e4" izz="4e4" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="hinge" type="revolute">
    <parent link="base"/><child link="arm"/><origin xyz="0 0 3"/><axis xyz="0 1 0"/>
    <limit lower="-0.1" upper="0.2" effort="0" velocity="1"/><dynamics friction="{friction}" damping="100"/>
  </joint>
  <link name="arm">
    <inertial><origin xyz="0 0 -2"/><mass value="500"/>
      <inertia ixx="20" iyy="25" izz="10" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="turntable" type="continuous">
    <parent link="base"/><child link="slider"/><origin xyz="0 0 4"/><axis xyz="0 0 1"/>
  </joint>
  <link name="slider">
    <inertial><mass value="10"/><inertia ixx="2" iyy="2" izz="2" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="lift" type="prismatic">
    <parent link="slider"/><child link="load"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="0" velocity="1"/>
  </joint>
  <link name="load">
    <inertial><mass value="10"/><inertia ixx="2" iyy="2" izz="2" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
</robot>
"""


@pytest.fixture
def tower(tmp_path):
    def make(mass: float = 2e4, friction: float = 0.0, at=(0.0, 0.0, 0.0), locked: bool = False) -> Plant:
        path = tmp_path / "tower.urdf"
        path.write_text(URDF.format(mass=mass, friction=friction))
        return make_plant(load_machine().with_specimen(path, at, locked=locked))

    return make


def test_a_specimen_that_the_table_can_carry_raises_no_doubt(tower, plant):
    assert specimen_doubts(plant) == specimen_doubts(tower()) == specimen_doubts(tower(locked=True)) == []


def test_weight_place_and_friction_that_speak_against_a_specimen_are_said(tower):
    capacity = 20e6 / load_machine().platen.gravity - 520.0  # payload of Table 2.2 less the moving links
    assert specimen_doubts(tower(mass=0.999 * capacity)) == []
    (heavy,) = specimen_doubts(tower(mass=1.01 * capacity))
    assert "more than the payload of 20 MN" in heavy
    assert specimen_doubts(tower(at=(6.0, -3.7, 0.0))) == []
    (beside,) = specimen_doubts(tower(at=(0.0, 3.9, 0.0)))
    assert "beside the platen, which is 12.2 by 7.6 m" in beside
    (rubs,) = specimen_doubts(tower(friction=3.0))
    assert "friction of hinge" in rubs
    assert specimen_doubts(tower(friction=3.0, locked=True)) == []  # no joint is left to rub


def test_joints_have_their_names_units_and_unwrapped_positions(tower):
    loaded = tower()
    joints = specimen_joints(loaded)
    assert [(j.name, j.unit) for j in joints] == [("hinge", "rad"), ("turntable", "rad"), ("lift", "m")]
    turned = np.linspace(0.0, 12.0, 50)  # almost two turns
    q = np.tile(loaded.zero_state().q, (50, 1))
    for joint, values in zip(joints, (0.1 * turned, turned, 0.05 * turned), strict=True):
        cosine = len(joint.places) == 2
        q[:, list(joint.places)] = np.stack([np.cos(values), np.sin(values)], axis=1) if cosine else values[:, None]
    expected = np.stack([0.1 * turned, turned, 0.05 * turned], axis=1)
    np.testing.assert_allclose(specimen_positions(loaded, q), expected, rtol=0.0, atol=1e-12)  # rounding
    (beyond,) = joints_beyond(loaded, np.arange(50.0), q)
    assert beyond.startswith("specimen joint hinge went to 1.2 rad at 49.00 s, beyond -0.1 to 0.2 rad")
    assert joints_beyond(loaded, np.arange(8.0), q[:8]) == []


def test_a_run_warns_before_and_reports_what_the_joints_did(lhpost6, tower, tmp_path, caplog):
    tower(friction=3.0)
    asked = ("run", "sine", "--set", "amplitude=0.005", "--set", "cycles=1", "--rate", "2048")
    assert lhpost6(*asked, "--specimen", "tower.urdf", "--out", tmp_path).code == 0
    assert "friction of hinge is in its URDF and not simulated" in caplog.text
    page = (tmp_path / "report.html").read_text()
    assert "Specimen joints over time" in page and "friction of hinge" in page and "specimen joint lift" in page

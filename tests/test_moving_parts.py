"""Moving parts of the legs as bodies: against rods taken apart by hand, Pinocchio's CRBA and RNEA, and the lump."""

import numpy as np
import pinocchio as pin
import pytest
from machine_cases import MACHINES, PENDULUM, machine_named, random_poses
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from test_rigid_body import ABOVE, forces_at, random_states

from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.core.names import ENGINES
from lhpost6_pin.mechanics.derivatives import evaluate_derivatives
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.instant import displacement_of, platen_pose_at, required_wrench_at
from lhpost6_pin.mechanics.leg_bodies import leg_bodies
from lhpost6_pin.mechanics.leg_model import LegModel, make_dynamics
from lhpost6_pin.mechanics.linearize import oil_column_modes
from lhpost6_pin.mechanics.lump_comparison import compare_with_lump, effective_inertia, static_wrench
from lhpost6_pin.mechanics.moving_parts import add_moving_parts, bodies_acceleration
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.ports import platen_pose
from lhpost6_pin.mechanics.pose import PlantMotion, PlatenMotion, plant_motion, rotation
from lhpost6_pin.mechanics.required_wrench import require_alike, required_wrench, rigid_wrenches, wrenches_at_c
from lhpost6_pin.mechanics.rigid_body import platen_inertia
from lhpost6_pin.mechanics.schemes import TAU, A, set_twist
from lhpost6_pin.mechanics.specimen_joints import specimen_doubts
from lhpost6_pin.mechanics.workspace import make_workspace
from lhpost6_pin.simulation.energy import energy_audit
from lhpost6_pin.simulation.ledger import States, force_ledger
from lhpost6_pin.simulation.simulate import OpenLoop, simulate

G = 9.80665
BODIES = ("lumped", "full")
FULL = machine_named("lhpost6").with_bodies("full")
PLANT = make_plant(FULL)
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(3)  # exact for a uniform bar's second moments
SHARES = 0.5 * (1.0 + GAUSS)


# Rods taken apart by hand --------------------------------------------------------------------------------------------


def hat(twist):
    """Matrix (4, 4) of a body twist, linear first."""
    w = twist[3:]
    top = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]], dtype=twist.dtype)
    return np.vstack([np.column_stack([top, twist[:3]]), np.zeros((1, 4))])


def pieces(machine, pose):
    """Masses (n,) and positions (n, 3) in {s} of points that stand for all rods and barrels; pose may be complex.

    pose (4, 4) is that of {b} at B. A leg's points lie on the line of its ends, those of a bearing actuator's rod above
    its base, at the height of the platen's plane there.
    """
    centre = np.array(machine.platen.centre_of_gravity)
    normal, at = pose[:3, 2], pose[:3, 3]
    masses, points = [], []
    for component, body in zip(machine.components, leg_bodies(machine), strict=True):
        base = np.array(component.base_point)
        if getattr(component, "mount", "none") == "bearing":
            foot = at + pose[:3, :3] @ (np.array(machine.platen.bearing_plane) - centre)
            height = (normal @ (foot - base)) / normal[2]
            masses.append(body.rod_mass)
            points.append(base + height * np.array([0.0, 0.0, 1.0]))
            continue
        away = at + pose[:3, :3] @ (np.array(component.platen_point) - centre) - base
        length = np.sqrt(away @ away)
        for share, weight in zip(SHARES, WEIGHTS, strict=True):
            masses += [0.5 * weight * body.rod_mass, 0.5 * weight * body.barrel_mass]
            points += [base + away / length * (length - share * body.rod_length)]
            points += [base + away / length * share * body.barrel_length]
    return np.array(masses), np.array(points)


def pose_of(q):
    turn = pin.Quaternion(q[3:]).toRotationMatrix()
    return np.vstack([np.column_stack([turn, q[:3]]), [0.0, 0.0, 0.0, 1.0]])


def velocities(machine, pose, twist):
    """Velocities (n, 3) of all pieces by a complex step, exact to rounding."""
    step = 1e-30j * twist
    return pieces(machine, pose @ (np.eye(4) + hat(step)))[1].imag / 1e-30


def by_hand(machine, q, v):
    """Mass matrix (6, 6), bias (6,) and weight (6,) from the pieces: sum m J'J, sum m J' x'' and sum m J' g."""
    pose = pose_of(q)
    masses, _ = pieces(machine, pose)
    jacobian = np.stack([velocities(machine, pose, e) for e in np.eye(6)], axis=2)  # (n, 3, 6)
    # x'' along exp(t V): central difference of eighth order of the exact velocities
    at, weights = np.arange(1, 5), np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
    h = 4e-3
    later, before = ([velocities(machine, pose @ expm(sign * k * h * hat(v)), v) for k in at] for sign in (1.0, -1.0))
    second = sum(w * (a - b) for w, a, b in zip(weights, later, before, strict=True)) / h
    down = np.array([0.0, 0.0, -G])
    return (
        np.einsum("n,nik,nil->kl", masses, jacobian, jacobian),
        np.einsum("n,nik,ni->k", masses, jacobian, second),
        np.einsum("n,nik,i->k", masses, jacobian, down),
    )


def compiled_parts(plant, q, v, extra=False):
    frame, M = np.zeros((8, 3)), np.zeros((6, 6))
    bias, weight = np.zeros((2, 6))
    platen_pose(q, plant.axes, plant.body, frame)
    set_twist(v, plant.axes, frame)
    table = plant.tables.inertia.copy()
    if not extra:
        table["extra"] = 0.0
    add_moving_parts(frame, plant.legs, plant.body, table, np.zeros(6), M, bias, weight)
    return M, bias, weight


def close(a, b, tolerance):
    scale = max(np.abs(b).max(), 1.0)
    assert np.abs(a - b).max() < tolerance * scale


def states(count=8, machine=FULL):
    return [(q, v) for _, q, v, _ in random_states(make_plant(machine), count, 3)]


@pytest.mark.parametrize("q, v", states())
def test_mass_matrix_bias_and_weight_are_those_of_the_rods_pieces(q, v):
    M, bias, weight = compiled_parts(PLANT, q, v)
    mass, onward, down = by_hand(FULL, q, v)
    close(M, mass, 1e-13)  # rounding
    close(bias, onward, 1e-10)  # differences of eighth order over 4 ms: 1e-12 of 1e4 N
    close(weight, down, 1e-13)


@pytest.mark.parametrize("q, v", states())
def test_pinocchios_crba_and_rnea_of_the_legs_give_the_same(q, v):
    M, bias, weight = compiled_parts(PLANT, q, v)
    mass, force = LegModel(PLANT).projected(q, v)
    close(M, mass, 1e-13)
    close(bias - weight, force, 1e-13)


@pytest.mark.parametrize("q, v", states(4))
def test_bias_is_the_rate_of_the_kinetic_energy(q, v):
    """V . bias = 1/2 V' dM/dt V at constant V: what the legs' Coriolis forces do is kinetic energy."""
    plant, h = PLANT, 1e-4

    def energy(t):
        moved = pin.integrate(plant.model, q, t * v)
        return 0.5 * v @ compiled_parts(plant, moved, v, extra=True)[0] @ v

    rate = (8.0 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12.0 * h)
    _, bias, _ = compiled_parts(plant, q, v, extra=True)
    assert v @ bias == pytest.approx(rate, rel=1e-7, abs=1e-3)  # rounding of 1e5 J over 1e-4 s


# The lump ------------------------------------------------------------------------------------------------------------


def test_in_the_zero_position_bodies_are_their_lump():
    inertias = [effective_inertia(make_plant(machine_named("lhpost6").with_bodies(w)), np.zeros(6)) for w in BODIES]
    assert np.abs(inertias[1] - inertias[0]).max() < 1e-9  # kg, of 4e6 kg m2: a unit in the last place
    _, stated = platen_inertia(PLANT.model, FULL)
    close(inertias[1], stated, 1e-15)
    close(stated, np.diag([*FULL.platen.mass, *FULL.platen.inertia]), 1e-15)  # the second estimate of Table 4.1


@pytest.mark.parametrize("x, mass, coupling, moment", [(0.5, 0.04, 0.8, 16.0), (0.89, 0.13, 1.5, 29.0)])
def test_masses_along_and_across_that_turn_with_the_leg_but_keep_their_size_give_an_independent_estimate(
    x, mass, coupling, moment
):
    """Its figures are of masses at the ends of the legs; bodies add that J(L)/L^2 changes with the leg's length."""
    turned, still = np.zeros((2, 6, 6))
    centre = np.array(FULL.platen.centre_of_gravity)
    heavy = 0.0
    for c in FULL.components:
        lever, base = np.array(c.platen_point) - centre, np.array(c.base_point)
        for total, moved in ((still, 0.0), (turned, x)):
            bearing = getattr(c, "mount", "none") == "bearing"
            at = lever - [moved, 0.0, 0.0] if bearing else lever
            away = np.array(c.platen_point) + ([0.0, 0.0, 0.0] if bearing else [moved, 0.0, 0.0]) - base
            u = away / np.linalg.norm(away)
            jacobian = np.hstack([np.eye(3), -pin.skew(at)])
            more = (c.mass_along - c.mass_across) * np.outer(u, u)
            total += jacobian.T @ (c.mass_across * np.eye(3) + more) @ jacobian
        heavy += c.mass_along * G * x if getattr(c, "mount", "none") == "bearing" else 0.0
    off = turned - still
    assert 100.0 * off[0, 0] / FULL.platen.mass[0] == pytest.approx(mass, abs=0.006)  # 0.042 and 0.125
    assert off[2, 4] / 1e3 == pytest.approx(coupling, abs=0.05)
    assert heavy / 1e3 == pytest.approx(moment, abs=0.5)
    found = compare_with_lump(FULL, [x, 0.0, 0.0, 0.0, 0.0, 0.0])
    vertical = found.by_kind["vertical"]
    assert vertical.weight[4] == pytest.approx(-heavy, rel=1e-12)  # the rods stay behind
    assert vertical.inertia[2, 4] == pytest.approx(sum(c.mass_along for c in FULL.actuators[4:]) * x, rel=1e-12)
    # of the kinds together: the whole, less what the platen's own mass carries
    close(sum(k.inertia for k in found.by_kind.values()), found.inertia, 1e-12)


def test_weight_of_the_horizontal_actuators_is_more_than_their_inertia_across():
    """A bar on a hinge weighs on its end by its first moment, s/L, and is as inert as by its second, J/L^2 < s/L."""
    found = compare_with_lump(FULL, np.zeros(6))
    more = sum(b.first_moment + b.rod_mass * (5.19 - b.rod_centre) for b in leg_bodies(FULL)[:4]) / 5.19
    more -= sum(c.mass_across for c in FULL.actuators[:4])
    assert found.weight[2] == pytest.approx(-more * G, rel=1e-3)  # 5.19 m is the length to a centimetre
    assert np.abs(found.weight[[0, 1, 3, 4, 5]]).max() < 1e-6  # symmetric: no moments at rest in the middle


# Forward and inverse dynamics ----------------------------------------------------------------------------------------

LOADED = FULL.with_specimen(PENDULUM, (2.0, -1.0, 0.1), (0.1, -0.2, 0.7), locked=True)
NORMAL = FULL.with_params({"machine.thrust": "normal"})


@pytest.mark.parametrize("machine", [FULL, LOADED, NORMAL], ids=["bare", "rigid specimen", "normal thrust"])
def test_compiled_forward_dynamics_are_pinocchios_and_inverse_dynamics_return_the_torque(machine):
    plant = make_plant(machine)
    dynamics = make_dynamics(plant)
    a = np.zeros(6)
    for pose, q, v, z in random_states(plant, 12):
        ws = forces_at(plant, q, v, z)
        tau = ws.motion[TAU].copy()
        bodies_acceleration(plant.tables, ws.frame, tau, np.zeros((9, 6)), a)
        close(dynamics(q, v, tau), a, 1e-12)
        needed = required_wrench(plant, PlantMotion(q[None], v[None], a[None]), rotation(pose[None, 3:]))[0]
        close(needed, tau, 1e-13)


def test_modes_of_a_specimen_take_their_share_of_the_mass_of_bodies_as_of_their_lump():
    plant, lumped = (make_plant(m.with_specimen("shear_frame")) for m in (FULL, machine_named("lhpost6")))
    dynamics, lump, a = make_dynamics(plant), make_dynamics(lumped), np.zeros(6)
    for _, q, v, z in random_states(plant, 12):
        ws = forces_at(plant, q, v, z)
        tau = ws.motion[TAU].copy()
        bodies_acceleration(plant.tables, ws.frame, tau, np.zeros((9, 6)), a)
        close(dynamics(q, v, tau), a, 1e-12)
    q, still, push = plant.zero_state().q, np.zeros(6), np.array([1e5, -2e5, 3e5, 1e5, 2e5, -1e5])
    moved = (own(q, still, push) - own(q, still, still) for own in (dynamics, lump))  # less the weight's
    close(*moved, 1e-9)  # as the masses agree at the zero position


def test_required_wrench_of_one_instant_by_rnea_is_that_of_whole_records():
    pose = platen_pose_at([0.4, -0.2, 0.05, 0.02, -0.01, 0.05])
    twist, rate = pin.Motion(np.array([1.0, -0.5, 0.2, 0.1, 0.2, -0.1])), pin.Motion(np.arange(6.0))
    found = required_wrench_at(PLANT, pose, twist, rate)
    displacement = displacement_of(pose)
    speed = np.linalg.solve(pin.rpy.computeRpyJacobian(displacement[3:], pin.WORLD), twist.angular)
    h = 1e-6
    # second derivatives of Euler angles from the rate of their Jacobian, by differences
    turned = pin.rpy.computeRpyJacobian(displacement[3:] + h * speed, pin.WORLD)
    turned -= pin.rpy.computeRpyJacobian(displacement[3:] - h * speed, pin.WORLD)
    euler = pin.rpy.computeRpyJacobian(displacement[3:], pin.WORLD)
    bent = np.linalg.solve(euler, rate.angular - turned / (2 * h) @ speed)
    rows = ([*pose.translation, *displacement[3:]], [*twist.linear, *speed], [*rate.linear, *bent])
    motion = plant_motion(PLANT, PlatenMotion(*(np.array([x]) for x in rows)))
    turn = rotation(displacement[None, 3:])
    close(found.vector, wrenches_at_c(PLANT, turn, required_wrench(PLANT, motion, turn))[0], 1e-9)


@pytest.mark.parametrize("locked", [True, False])
def test_ledger_balances_with_a_specimen_fixed_or_swinging(locked):
    plant = make_plant(FULL.with_specimen(PENDULUM, ABOVE, locked=locked))
    rng = np.random.default_rng(4)
    _, q6, v6, z = next(random_states(PLANT, 4))
    joints = plant.model.nv - 6
    q, v = plant.zero_state().q, np.concatenate([v6, rng.normal(size=joints)])
    q[:7] = q6
    q = pin.integrate(plant.model, q, np.concatenate([np.zeros(6), 0.3 * np.ones(joints)]))
    ws = forces_at(plant, q, v, z)
    a = make_dynamics(plant)(q, v, ws.motion[TAU])
    ledger = force_ledger(States(plant, np.zeros(1), q[None], v[None], a[None], z[None]))
    close(ledger.residual, np.zeros(6), 1e-12 * np.abs(ledger.inertia).max())
    lumped = make_plant(machine_named("lhpost6").with_specimen(PENDULUM, ABOVE, locked=locked))
    assert specimen_doubts(plant) == specimen_doubts(lumped)  # the specimen's mass is what the model has beyond


def test_equilibrium_holds_the_bodies_where_they_are():
    rest = find_equilibrium(PLANT)
    ws = forces_at(PLANT, rest.state.q, rest.state.v, rest.state.z)
    assert np.abs(make_dynamics(PLANT)(rest.state.q, rest.state.v, ws.motion[TAU])).max() < 1e-11  # of 400 m/s2 of oil
    run = make_workspace(PLANT, rest.state)
    assert evaluate_derivatives(PLANT, run, rest.spool) == 0
    assert np.abs(run.motion[A]).max() < 1e-11  # the compiled projection, as runs start with it
    assert rest.wrench.linear[2] == pytest.approx(  # what the struts pull down, and all weight
        sum(s.pressure * s.area for s in FULL.struts) - static_wrench(PLANT, np.zeros(6))[2], rel=1e-12
    )


def test_energy_of_a_platen_let_go_stays():
    """No forces but weight: platen and legs fall, turn and swing; 0.1 s of Dormand-Prince at 1e-13."""
    plant = PLANT
    dynamics, start = make_dynamics(plant), random_states(plant, 1, 5)
    _, q0, v0, _ = next(iter(start))
    q0 = plant.zero_state().q
    zero = np.zeros(6)

    def rates(_, y):
        q = pin.integrate(plant.model, q0, y[:6])
        local = pin.dDifference(plant.model, q0, q, pin.ArgumentPosition.ARG1)
        return np.concatenate([local @ y[6:], dynamics(q, y[6:], zero)])

    found = solve_ivp(rates, (0.0, 0.1), np.concatenate([zero, v0]), rtol=1e-12, atol=1e-13, t_eval=[0.0, 0.05, 0.1])
    q = np.array([pin.integrate(plant.model, q0, y[:6]) for y in found.y.T])
    v = found.y.T[:, 6:]
    total = []
    for pose, twist in zip(q, v, strict=True):
        mass, _ = LegModel(plant).projected(pose, twist)
        plain = plant.tables.inertia[0]["plain"] + plant.tables.inertia[0]["extra"]
        masses, points = pieces(FULL, pose_of(pose))
        legs = G * masses @ points[:, 2]
        own = pin.computePotentialEnergy(plant.model, plant.model.createData(), pose)
        total.append(0.5 * twist @ (mass + plain) @ twist + own + legs)
    spent = abs(0.5 * v[-1] @ mass @ v[-1] - 0.5 * v[0] @ mass @ v[0])
    assert spent > 1e2  # energy did move
    assert np.ptp(total) < 1e-7 * abs(total[0])  # the pose's local coordinates differ by 4e-9 (see test_rigid_body)


@pytest.mark.long
def test_energy_audit_of_a_run_closes_and_nothing_is_created_by_direction():
    rest = find_equilibrium(PLANT)
    spool = rest.spool + 0.05 * np.sin(2 * np.pi * 3.0 * np.arange(1024)[:, None] / 2048.0 + np.arange(10.0))
    run = simulate(
        PLANT, OpenLoop(spool, rest.state), samples=1024, scheme="rk4", steps_per_second=8192, engine="fused"
    )
    assert run.trouble is None
    audit = energy_audit(run)
    assert not audit.power[:, audit.entry("created.directional_mass")].any()
    moved = np.abs(audit.total("inflow")).max()
    assert np.abs(audit.residual).max() < 1e-4 * moved  # trapezoids of 1/2048 s
    # the ledger balances with the bodies that moved; their lump lacks the weight of what hangs on hinges
    balanced = force_ledger(run)
    close(balanced.residual, np.zeros(6), 1e-11 * np.abs(balanced.inertia).max())
    lump = make_plant(machine_named("lhpost6"))
    lacking = force_ledger(States(lump, run.time, run.q, run.v, run.a, run.z)).residual
    heavier = static_wrench(PLANT, np.zeros(6)) - static_wrench(lump, np.zeros(6))
    assert lacking[:, 2].mean() == pytest.approx(heavier[2], rel=0.01)  # displaced by little


@pytest.mark.long
def test_both_engines_give_the_same_run():
    rest = find_equilibrium(PLANT)
    spool = rest.spool + 0.1 * np.sin(2 * np.pi * 2.0 * np.arange(1024)[:, None] / 2048.0 + np.arange(10.0))
    runs = [simulate(PLANT, OpenLoop(spool, rest.state), samples=1024, engine=engine) for engine in ENGINES]
    assert max(np.abs(runs[0].q[:, 0])) > 1e-3
    for name in ("q", "v", "z"):
        a, b = (getattr(r, name) for r in runs)
        scale = np.maximum(np.abs(a).max(axis=0), 1e-6)
        assert (np.abs(a - b).max(axis=0) / scale).max() < 1e-9, name


# Machines ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [m for m in MACHINES if m not in ("lhpost6", "uniaxial", "stewart")])
def test_massless_legs_leave_a_platen_with_its_effective_inertia(name):
    machine = machine_named(name).with_bodies("full")
    plant = make_plant(machine)
    for pose in random_poses(machine, 3):
        inertia, _ = rigid_wrenches(
            plant,
            PlantMotion(*(np.tile(x, (1, 1)) for x in (plant.zero_state().q, *np.ones((2, plant.axes.size))))),
            rotation(pose[None, 3:]),
        )
        assert np.isfinite(inertia).all()
    _, full = platen_inertia(plant.model, machine)
    close(full, np.diag([*machine.platen.mass, *machine.platen.inertia]), 1e-14)


def test_oil_column_modes_are_those_of_the_lump():
    """Linearised in the zero-position only the weights differ, and with them pressures at rest."""
    lumped, full = (oil_column_modes(machine_named("lhpost6").with_bodies(word)) for word in BODIES)
    for a, b in zip(lumped, full, strict=True):
        assert b.frequency == pytest.approx(a.frequency, rel=2e-3) and a.axis == b.axis


def test_what_cannot_be_split_is_said():
    with pytest.raises(ParameterError, match=r"machine\.bodies = 'half'; it should be one of lumped, full"):
        machine_named("lhpost6").with_bodies("half")
    with pytest.raises(ParameterError, match=r"drive\.rod_length and drive\.barrel_length are missing"):
        make_plant(machine_named("uniaxial").with_bodies("full"))
    with pytest.raises(ParameterError, match="state a longer rod"):
        make_plant(FULL.with_params(hold_down__rod_length=1.0))
    with pytest.raises(ParameterError, match="moves upright only"):
        make_plant(FULL.with_params(vertical__mass_across=1.0))
    with pytest.raises(ParameterError, match="leave the platen no inertia"):
        make_plant(FULL.with_params(horizontal__mass_along=5e4, horizontal__mass_across=5e4))


def test_plants_require_alike_only_with_the_same_legs():
    longer = make_plant(FULL.with_params(horizontal__barrel_length=3.0))
    assert require_alike(PLANT, make_plant(FULL)) and not require_alike(PLANT, longer)
    assert not require_alike(PLANT, make_plant(machine_named("lhpost6")))


@pytest.mark.long
def test_a_record_of_bodies_is_not_analysed_as_lumped_without_a_warning(lhpost6, caplog):
    sine = ("run", "sine", "--set", "amplitude=0.01", "--set", "cycles=1", "--record-rate", 512, "--engine", "fused")
    assert lhpost6(*sine, "--bodies", "full", "--out", "full").code == 0
    for options, warned in (((), True), (("--bodies", "full"), False)):
        caplog.clear()
        assert lhpost6("decompose", "full/record.nc", *options).code == 0
        assert ("made with moving parts of the legs as bodies = full" in caplog.text) == warned

"""The force ledger sums to the inertia; the energy audit closes once three terms that create energy are named."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from run_cases import at_rest, closed_loop, driven, every_step, sine_motion, smooth_spools

from lhpost6_pin.core.errors import UnknownNameError
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.machine.machine import Machine
from lhpost6_pin.mechanics.ports import evaluate_ports, platen_pose
from lhpost6_pin.mechanics.workspace import make_workspace
from lhpost6_pin.simulation.energy import CREATED, Audit, energy_audit
from lhpost6_pin.simulation.ledger import Ledger, force_ledger
from lhpost6_pin.simulation.simulate import Run, simulate

pytestmark = pytest.mark.long

CONSERVING = {"machine.thrust": "normal", "platen.mass": [168100.0, 168100.0, 168100.0], "vertical.pad_friction": 0.0}


def open_loop(machine: Machine, duration: float = 1.0, **options: str) -> Run:
    """A run that moves all six axes, recorded at the controller's rate."""
    t = (np.arange(int(duration * SAMPLE_RATE)) + 0.5) / SAMPLE_RATE
    run = driven(machine, smooth_spools(t, len(machine.actuators)), **options)
    assert run.trouble is None
    return run


def controlled(machine: Machine, target: np.ndarray) -> Run:
    """A closed-loop run of the fused engine."""
    plant, rest = at_rest(machine)
    run = simulate(plant, closed_loop(plant, rest, target), samples=target.shape[1], engine="fused")
    assert run.trouble is None
    return run


@pytest.fixture(scope="module")
def shaken(machine: Machine) -> Run:
    """An open-loop run with the report's settings."""
    return open_loop(machine)


@pytest.fixture(scope="module")
def ledger(shaken: Run) -> Ledger:
    return force_ledger(shaken)


@pytest.fixture(scope="module")
def audit(shaken: Run) -> Audit:
    return energy_audit(shaken)


def turnover(audit: Audit) -> float:
    """Energy that passed through the valves, either way [J]."""
    wanted = [i for i, e in enumerate(audit.entries) if e.startswith("inflow.")]
    return float(np.abs(audit.power[:, wanted]).sum() * (audit.time[1] - audit.time[0]))


# ---------------------------------------------------------------------------------------- forces
def test_all_forces_sum_to_the_inertia(machine: Machine):
    """With rk4 the accelerations are those of the states themselves: only rounding is left."""
    ledger = force_ledger(open_loop(machine, 0.2, scheme="rk4"))
    assert (np.abs(ledger.inertia).max(axis=0) > 1e5).all()  # all six axes are shaken
    assert np.abs(ledger.residual).max() < 1e-13 * np.abs(ledger.wrench).max()


def test_with_the_staggered_scheme_the_sum_closes_with_second_order(machine: Machine):
    """Its accelerations belong to velocities that a half step extrapolates."""
    left = [np.abs(force_ledger(every_step(machine, 0.2, rate)).residual).max(axis=0) for rate in (4096, 8192, 16384)]
    for coarse, fine in pairwise(left):
        np.testing.assert_allclose(coarse / fine, 4.0, rtol=0.02)  # third-order terms
    assert (left[-1] < 1.0).all()  # N, N m, of a meganewton


def test_the_ledger_has_every_effect_on_every_port(machine: Machine, ledger: Ledger):
    assert ledger.effects == (*(e.name for e in machine.effects), "gravity")
    assert ledger.rows[:2] == ("actuators_4_way.H1", "actuators_4_way.H2")
    assert "pad_friction.V3.x" in ledger.rows
    assert "pad_friction.V3.y" in ledger.rows
    assert ledger.force.shape == (len(ledger.time), 4 + 6 + 3 + 10 + 12 + 10 + 10)
    assert len(set(ledger.rows)) == len(ledger.rows)


def test_one_instant_is_a_pin_force_an_effect(ledger: Ledger):
    wrenches = ledger.at(700)
    assert tuple(wrenches) == ledger.effects
    total = sum(wrenches.values(), pin.Force.Zero())
    np.testing.assert_allclose(total.vector, ledger.wrench[700].sum(axis=0), rtol=1e-14)


def test_rows_hold_the_forces_of_the_laws(shaken: Run, ledger: Ledger):
    plant, actuator = shaken.plant, shaken.plant.machine.actuators[2]
    a, b = (shaken.z[:, plant.state_index("actuators_4_way", "H3", f"pressure_{c}")] for c in "ab")
    found = ledger.force[:, ledger.row("actuators_4_way.H3")]
    np.testing.assert_allclose(found, a * actuator.area_a - b * actuator.area_b, atol=1e-9)  # rounding of a meganewton
    z = shaken.z[:, plant.state_index("pad_friction", "V5", "z_y")]
    found = ledger.force[:, ledger.row("pad_friction.V5.y")]
    np.testing.assert_allclose(found, -z * plant.machine.actuators[8].pad_friction, rtol=1e-12)


def test_inertia_is_the_reports_equation_at_b_moved_to_c(machine: Machine, shaken: Run, ledger: Ledger):
    """Eqs. 4-25, 4-26 in platen axes: M (dv/dt + omega x v), I domega/dt + omega x (I omega), full matrices."""
    mass, inertia = np.array(machine.platen.mass), np.array(machine.platen.inertia)
    for k in (100, 700, 1500):
        v, w = shaken.v[k, :3], shaken.v[k, 3:]
        force = mass * (shaken.a[k, :3] + np.cross(w, v))
        moment = inertia * shaken.a[k, 3:] + np.cross(w, inertia * w)
        turn = pin.Quaternion(shaken.q[k, 3:7]).matrix()
        moment = moment + np.cross(np.array(machine.platen.centre_of_gravity), force)
        expected = np.concatenate([turn @ force, turn @ moment])
        # rounding of 1.7 MN of gravity that rnea adds and we take off
        np.testing.assert_allclose(ledger.inertia[k], expected, atol=1e-7, rtol=1e-11)


def test_a_wrench_does_the_work_of_its_forces(shaken: Run, ledger: Ledger):
    """Virtual power of every effect: wrench at C times the twist of C is the sum of force times B v."""
    plant = shaken.plant
    ws = make_workspace(plant, plant.zero_state())
    rho = plant.body[0]["rho_c"]
    for k in (100, 700, 1500):
        platen_pose(shaken.q[k], plant.axes, plant.body, ws.frame)
        evaluate_ports(ws.frame, plant.legs, plant.body, ws.port[0], ws.JB[0], ws.JB[1])
        turn = ws.frame[:3]
        v, w = shaken.v[k, :3], shaken.v[k, 3:]
        twist = np.concatenate([turn @ (v + np.cross(w, rho)), turn @ w])
        for name in ledger.effects[:-1]:
            rows = [i for i, row in enumerate(ledger.rows) if row.startswith(f"{name}.")]
            ports = [plant.ports.index(ledger.rows[i].removeprefix(f"{name}.")) for i in rows]
            power = ledger.force[k, rows] @ (ws.JB[1][ports] @ shaken.v[k])
            scale = np.abs(ledger.force[k, rows]).max()
            assert ledger.wrench[k, ledger.effect(name)] @ twist == pytest.approx(power, abs=1e-12 * scale)


def test_an_unknown_name_lists_the_names(ledger: Ledger, audit: Audit):
    with pytest.raises(UnknownNameError, match=r"no effect named 'magic'.*gravity"):
        ledger.effect("magic")
    with pytest.raises(UnknownNameError, match=r"no force named 'H1'.*actuators_4_way\.H1"):
        ledger.row("H1")
    with pytest.raises(UnknownNameError, match=r"no energy entry named 'leak'.*stored\.kinetic"):
        audit.entry("leak")


def test_datasets_carry_names_and_units(ledger: Ledger, audit: Audit):
    data, energy = ledger.to_dataset(), audit.to_dataset()
    pull = ledger.wrench[:, ledger.effect("hold_down"), 2]
    np.testing.assert_array_equal(data.wrench.sel(effect="hold_down", axis="fz"), pull)
    assert data.force.attrs["units"] == "N, N m" and data.time.attrs["units"] == "s"
    lost = audit.power[:, audit.entry("dissipated.viscous")]
    np.testing.assert_array_equal(energy.power.sel(entry="dissipated.viscous"), lost)
    assert energy.power.attrs["units"] == "W"
    assert set(energy.kind.values) == {"inflow", "stored", "dissipated", "delivered", "created"}


# ---------------------------------------------------------------------------------------- energy
@pytest.mark.parametrize("changes", [{}, CONSERVING], ids=["report", "conserving"])
def test_the_energy_balance_closes_with_the_integrators_second_order(machine: Machine, changes: dict):
    """With the report's settings and the conserving ones alike: the named terms are all that there is.

    Single halvings leave a half to a seventh where seals turn round and spools cross zero within a step (kinks of the
    laws), so the order is taken over four of them.
    """
    left, through = [], 0.0
    for rate in (2048, 32768):
        audit = energy_audit(every_step(machine.with_params(changes), rate=rate))
        left.append(np.abs(audit.residual).max())
        through = turnover(audit)
    assert np.log2(left[0] / left[1]) / 4 == pytest.approx(2.0, abs=0.25)
    assert left[-1] < 1e-6 * through


def test_every_effect_accounts_for_its_own_energy(machine: Machine):
    left = []
    for rate in (4096, 8192):
        audit = energy_audit(every_step(machine, rate=rate))
        delivered = [e for e in audit.entries if e.startswith("delivered.")]
        names = [e.removeprefix("delivered.") for e in delivered]
        left.append([np.abs(audit.effect_residual(name)).max() for name in names])
    through = turnover(audit)
    for name, coarse, fine in zip(names, *left, strict=True):
        if name in ("seal_friction", "pad_friction", "viscous", "bumper"):
            assert coarse == fine == 0.0  # without a potential all work is dissipated, by definition; no bumper is met
        else:
            assert 3.0 < coarse / fine < 5.0
            assert fine < 1e-4 * through


def test_at_controller_samples_the_balance_closes_to_the_quadrature(audit: Audit):
    # trapezoidal rule at 2048 Hz: (2 pi 20 Hz / 2048 Hz)^2 / 12 = 3e-4 of the liveliest tenth of the flow
    assert np.abs(audit.residual).max() < 1e-4 * turnover(audit)


def test_in_closed_loop_the_mean_spool_of_each_sample_is_known(machine: Machine):
    """The 5 ms delay is 10.24 samples: the spool moves within a sample."""
    target = sine_motion([0.05, 0.04, 0.01, 0.002, 0.002, 0.002], [1.0, 1.3, 1.5, 1.1, 0.9, 1.2], 2.0)
    run = controlled(machine, target)
    audit = energy_audit(run)
    known = np.abs(audit.residual).max()
    assert known < 1e-4 * turnover(audit)
    held = np.vstack([np.tile(run.spool[0], (10, 1)), run.command[:-10]])  # ten whole samples late
    late = Run(**{**run.__dict__, "spool": held})
    assert np.abs(energy_audit(late).residual).max() > 5 * known


def test_with_normal_thrust_one_mass_and_no_pad_friction_nothing_is_created(machine: Machine):
    audit = energy_audit(open_loop(machine.with_params(CONSERVING)))
    for name in CREATED:
        assert not audit.power[:, audit.entry(f"created.{name}")].any()
    assert np.abs(audit.residual).max() < 1e-4 * turnover(audit)


@pytest.mark.parametrize(
    ("changes", "alone"),
    [
        ({"machine.thrust": "report"}, "thrust_direction"),
        ({"platen.mass": [168100.0, 150000.0, 190000.0]}, "directional_mass"),
        ({"vertical.pad_friction": 2e5}, "pad_reaction"),
    ],
)
def test_each_entry_names_one_setting_and_the_balance_needs_it(machine: Machine, changes: dict, alone: str):
    """Each of the report's three liberties by itself: the other two entries vanish, without this one nothing closes."""
    target = sine_motion([0.2, 0.15, 0.02, 0.01, 0.008, 0.015], [1.0, 1.1, 1.3, 1.2, 1.0, 0.9], 3.0)
    audit = energy_audit(controlled(machine.with_params({**CONSERVING, **changes}), target))
    for name in CREATED:
        assert audit.power[:, audit.entry(f"created.{name}")].any() == (name == alone)
    left, without = np.abs(audit.residual).max(), np.abs(audit.residual - audit.total("created")).max()
    assert left < 1e-4 * turnover(audit)
    assert without > 2 * left


def test_in_a_violent_motion_the_reports_thrust_direction_creates_tens_of_kilowatts(machine: Machine):
    """Sizes to remember: at 1.4 m/s in X and half a degree of pitch Eq. 4-23 moves 60 kW rms in and out of the platen.

    The direction-dependent mass of Eq. 4-26 does 0.1 kW (1 kW takes faster heave and turning at once), the pads'
    reaction on the rising platen 0.1 kW. Bounds are a factor of five: the motion is one of many.
    """
    target = sine_motion([0.3, 0.0, 0.05, 0.0, 0.010, 0.0], [0.9, 1.0, 0.9, 1.0, 1.8, 1.0], 5.0)
    audit = energy_audit(controlled(machine, target))
    rms = {n: np.sqrt(np.mean(audit.power[2048:, audit.entry(f"created.{n}")] ** 2)) for n in CREATED}
    assert 12e3 < rms["thrust_direction"] < 300e3
    assert 20.0 < rms["directional_mass"] < 2e3
    assert 20.0 < rms["pad_reaction"] < 500.0


def test_at_rest_only_the_leaks_flow(machine: Machine):
    audit = energy_audit(driven(machine, np.zeros((200, 10))))
    inflow = sum(audit.power[:, audit.entry(f"inflow.actuators_{n}_way")] for n in (3, 4))
    lost = sum(audit.power[:, audit.entry(f"dissipated.actuators_{n}_way")] for n in (3, 4))
    np.testing.assert_allclose(inflow, lost, rtol=1e-9)  # rounding of flows
    p = machine.actuators[4].leakage
    a, b, c = 5.504e6, 8.601e6, 2.767e6
    assert lost[0] == pytest.approx(4 * p * (b - a) ** 2 + 6 * p * c**2, rel=1e-2)  # h(P) is P within P / 2 beta


# ------------------------------------------------------------------------ other machines and effects
def test_a_guided_platen_has_its_guides_in_the_ledger_and_its_energy_closes(machine: Machine):
    """The LHPOST6 guided to heave; its horizontal actuators and pads push on the guides."""
    run = open_loop(machine.with_params({"machine.motion": "z"}))
    ledger, audit = force_ledger(run), energy_audit(run)
    assert ledger.effects[-2:] == ("gravity", "guides")
    guides = ledger.wrench[:, ledger.effect("guides")]
    assert not guides[:, 2].any()
    assert np.abs(guides[:, [0, 1, 3, 4, 5]]).max(axis=0).min() > 1e3
    assert np.abs(ledger.inertia[:, 2]).max() > 1e5
    assert np.abs(ledger.residual).max() < 1.0  # N of 10 MN; see the staggered scheme above
    assert np.abs(audit.residual).max() < 1e-4 * turnover(audit)


def test_an_added_effect_appears_under_its_name(machine: Machine):
    drag = Effect("drag", "viscous", ("platen.x", "platen.yaw"), ((2e4,), (1e5,)), "test")
    run = open_loop(machine.with_effect(drag), 0.3)
    ledger, audit = force_ledger(run), energy_audit(run)
    assert ledger.rows[-2:] == ("drag.platen.x", "drag.platen.yaw")
    assert audit.energy[-1, audit.entry("dissipated.drag")] > 0.0
    assert np.abs(audit.residual).max() < 1e-4 * turnover(audit)


PENDULUM = """<robot name="pendulum"><link name="base"><inertial><mass value="100"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="bob"><inertial><origin xyz="0 0 1.5"/><mass value="8000"/>
<inertia ixx="900" iyy="900" izz="300" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="pivot" type="revolute"><parent link="base"/><child link="bob"/><origin xyz="1 0.5 3"/><axis xyz="0 1 0"/>
<limit lower="-3.2" upper="3.2" effort="1e9" velocity="1e9"/><dynamics damping="3000"/></joint></robot>"""


@pytest.mark.parametrize("locked", [True, False])
def test_a_specimen_is_in_the_inertia_the_weight_and_the_energy(machine: Machine, tmp_path, locked: bool):
    """Rigid, or an inverted pendulum with a damped joint that falls while the table shakes."""
    path = tmp_path / "pendulum.urdf"
    path.write_text(PENDULUM)
    spool = smooth_spools(np.arange(800) / SAMPLE_RATE, 10, 0.1)
    run = driven(machine.with_specimen(path, locked=locked), spool, "pinocchio")
    assert run.trouble is None
    ledger, audit = force_ledger(run), energy_audit(run)
    weight = (machine.platen.mass[2] + 8100.0) * machine.platen.gravity
    np.testing.assert_allclose(ledger.wrench[:, ledger.effect("gravity"), 2], -weight, rtol=1e-12)
    assert np.abs(ledger.residual).max() < 20.0  # N of a meganewton; see the staggered scheme above
    assert np.abs(audit.residual).max() < 1e-4 * turnover(audit)
    assert ("dissipated.specimen_joints" in audit.entries) == (not locked)
    if not locked:
        assert audit.energy[-1, audit.entry("dissipated.specimen_joints")] > 0.0

"""A specimen that exchanges motion and wrench with the plant, against one set of equations for both."""

import inspect
import json
import re

import numpy as np
import pinocchio as pin
import pytest
from coupled_cases import FULL, SHEAR, Tower, monolithic, moving, relative, tower
from machine_cases import machine_named
from run_cases import at_rest

from lhpost6_pin.core.errors import ParameterError, SimulationError
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.data.records import load_record
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.coupled import base_at_rest, rigid_wrench
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.interface import apparent_mass
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.simulation.coupling import Continued, CouplingOptions, stability_of
from lhpost6_pin.simulation.running import RunningPlant
from lhpost6_pin.simulation.simulate import OpenLoop, PluggedLoop, simulate

PLATEN = 168e3  # [kg] of Table 4.1
N = 256

SLOW = pytest.mark.slow
"""Of masses between the lightest and the heaviest."""


def carrying(specimen, at=(0.0, 0.0, 0.0), turned=(0.0, 0.0, 0.0)) -> Machine:
    """The table with a supply that can carry ten platens."""
    return load_machine().with_params({"hydraulics.supply_pressure": 60e6}).with_specimen(specimen, at, turned)


@pytest.mark.long
@pytest.mark.parametrize("free", [FULL, SHEAR], ids=["springs along x, y, z", "riding along z"])
@pytest.mark.parametrize("ratio", [0.1, pytest.param(1.0, marks=SLOW), pytest.param(5.0, marks=SLOW), 10.0])
def test_towers_of_any_mass_follow_the_monolithic_equations(ratio, free):
    """The table's motion within 0.1 % of them at one exchange a sample, energy within 1e-4; no more at ten platens.

    Continuing the wrench costs 5/12 (omega h)^2, 4e-4 at 10 Hz; a tower of ten platens moves the table by it.
    """
    plant, rest = at_rest(carrying(tower(ratio * PLATEN, free=free), (0.5, -0.4, 0.0), (0.0, 0.0, 0.3)))
    loop = moving(rest, N)
    run = simulate(plant, loop, samples=N)
    q, _ = monolithic(plant, rest.state, np.repeat(loop.spool, 4, axis=0), 1.0 / (4 * SAMPLE_RATE))
    moved, true = run.q - rest.state.q, q[::4][:N] - rest.state.q
    assert run.trouble is None and np.abs(true[:, :3]).max() > 1e-3
    found = relative(moved[:, :6], true[:, :6])
    assert found < 1e-3 if ratio <= 5.0 else found < 2e-3
    assert abs(run.coupling.energy_error) < 2e-4 and run.coupling.stability.growth < 1e-6


def test_the_exchange_is_of_second_order():
    """Eight exchanges a sample in place of one: 1/64 of the difference; at least a tenth is asked, of the schemes'."""
    plant, rest = at_rest(carrying(tower(5 * PLATEN)))
    loop = moving(rest, 192)
    q, _ = monolithic(plant, rest.state, np.repeat(loop.spool, 8, axis=0), 1.0 / (8 * SAMPLE_RATE))
    errors = []
    for every_step in (False, True):
        options = {"coupling": CouplingOptions(every_step=every_step), "steps_per_second": 8 * SAMPLE_RATE}
        run = simulate(plant, loop, samples=192, **options)
        errors.append(relative(run.q[:, :6] - rest.state.q[:6], q[::8][:192, :6] - rest.state.q[:6]))
    assert errors[1] < 0.1 * errors[0]


@pytest.mark.parametrize("scheme", ["euler", "rk4"])
def test_every_scheme_couples_alike(scheme):
    """To the schemes' own differences, 1 % for forward Euler at 32768 steps a second."""
    plant, rest = at_rest(carrying(tower(PLATEN)))
    loop = moving(rest, 128)
    reference = simulate(plant, loop, samples=128)
    run = simulate(
        plant, loop, samples=128, scheme=scheme, steps_per_second=(4 if scheme == "rk4" else 16) * SAMPLE_RATE
    )
    assert run.trouble is None
    assert relative(run.v[:, :6], reference.v[:, :6]) < 0.01
    assert np.linalg.norm(run.coupling.wrench - reference.coupling.wrench) < 0.01 * np.linalg.norm(
        reference.coupling.wrench - reference.coupling.wrench[0]
    )


def test_at_rest_nothing_moves_and_the_wrench_is_the_weight():
    mass = 2e5
    plant, rest = at_rest(carrying(tower(mass), (1.0, 0.0, 0.0)))
    run = simulate(plant, OpenLoop(np.tile(rest.spool, (64, 1)), rest.state), samples=64)
    assert np.abs(run.q - rest.state.q).max() < 1e-9  # rounding of 1e7 Pa over 31 ms
    weight = mass * plant.machine.platen.gravity
    assert np.allclose(run.coupling.wrench[:, 2], -weight, rtol=1e-9)
    vertical = rest.force[4:].sum() if len(rest.force) == 10 else np.nan
    bare = at_rest(load_machine())[1].force[4:].sum()
    assert vertical - bare == pytest.approx(weight, rel=1e-6)


def test_a_rigid_specimen_in_python_is_the_rigid_body_itself():
    """Its wrench is all inertia of the rigid part, so that nothing is left to exchange: only rounding."""

    class Block:
        inertia = pin.Inertia(1e5, np.array([0.2, 0.1, 1.0]), 1e5 * np.diag([1.0, 2.0, 1.5]))

        def init(self, base, gravity):
            return gravity, self.step(gravity, base, 0.0)

        def step(self, gravity, base, dt):
            a = pin.Motion(
                base.acceleration.linear
                + gravity * base.pose.rotation[2]
                - np.cross(base.twist.angular, base.twist.linear),
                base.acceleration.angular,
            )
            return -(self.inertia * a + base.twist.cross(self.inertia * base.twist))

    plant, rest = at_rest(carrying(Block(), (0.3, 0.2, 0.0)))
    assert np.abs(plant.rest_external).max() < 1e-6
    run = simulate(plant, moving(rest, N), samples=N)
    assert abs(run.coupling.work_platen) < 1e-7 * run.coupling.energy  # 1e-8 of the mass by rounding of the pulses
    assert run.coupling.stability.spectral_radius < 1e-6  # rounding of a wrench of 1e6 N under 1 m/s2


def test_without_the_impedance_the_criterion_tells_stable_from_unstable():
    """Mass that rides on the base along z only: stable while its share of the platen's is below a third."""
    explicit = CouplingOptions(impedance=False)
    for share, stable in ((0.25, True), (0.45, False)):
        own = tower(share * PLATEN, free=SHEAR, rigid=0.0)
        plant, rest = at_rest(carrying(own))
        found, added = stability_of(plant, 1.0 / SAMPLE_RATE, explicit)
        table = apparent_mass(plant)
        by_hand = np.abs(np.linalg.eigvals(np.linalg.solve(table, own.riding))).max()
        assert found.spectral_radius == pytest.approx(by_hand, rel=0.3) and not added.any()
        assert (found.growth < 1.0) == stable
        if stable:
            assert simulate(plant, moving(rest, 64), samples=64, coupling=explicit).trouble is None
            continue
        with pytest.raises(SimulationError, match=r"would be unstable.*interface impedance"):
            simulate(plant, moving(rest, 64), samples=64, coupling=explicit)


def test_the_probe_finds_the_interface_mass():
    """Pulses of one exchange find M_inf and what springs add within it, (omega h)^2 / 6 of their mass."""
    own = tower(PLATEN, free=SHEAR)
    plant = make_plant(carrying(own))
    found = stability_of(plant, 1.0 / SAMPLE_RATE, CouplingOptions())[0].interface_mass
    scale = np.sqrt(np.outer(*[np.diag(own.all.T @ np.diag(own.masses) @ own.all) + 1e4] * 2))
    assert np.abs((found - own.m_inf) / scale).max() < 2e-3
    assert np.abs((found - own.m_inf) / scale)[2, 2] < 1e-6


class Stub:
    """A mass on the base, faulty on request."""

    inertia = pin.Inertia.Zero()

    def __init__(self, sign=-1.0, result=None, fail=False):
        self.sign, self.result, self.fail = sign, result, fail

    def init(self, base, gravity):
        return gravity, pin.Force(np.array([0.0, 0.0, -1e4 * gravity]), np.zeros(3))

    def step(self, memory, base, dt):
        if self.fail:
            raise KeyError("state")
        if self.result is not None:
            return self.result
        a = base.acceleration.linear + memory * base.pose.rotation[2]
        return pin.Force(self.sign * 1e4 * a, np.zeros(3))


@pytest.mark.parametrize(
    "stub, message",
    [
        (Stub(sign=1.0), "Stub grows with the acceleration .* check its sign"),
        (Stub(result=[0.0] * 6), "Stub returned list at rest; a wrench is a pin.Force"),
        (Stub(result=pin.Force(np.full(6, np.nan))), "Stub returned a wrench at rest whose fx is not finite"),
        (Stub(fail=True), r"Stub.step failed at rest: KeyError: 'state' \(.*test_coupling.py, line \d+\)"),
    ],
)
def test_faulty_specimens_are_named_with_what_to_mend(stub, message):
    plant, rest = at_rest(load_machine().with_specimen(stub))
    with pytest.raises(SimulationError, match=message):
        simulate(plant, moving(rest, 8), samples=8)


def test_a_specimen_that_fails_on_the_way_ends_the_run_and_keeps_its_results():
    stub = Stub()
    plant, rest = at_rest(load_machine().with_specimen(stub))
    stub.step, whole = _failing_after(stub.step, 20), moving(rest, 64)
    run = simulate(plant, whole, samples=64)
    assert re.search(r"Stub.step failed at 0.00\d+ s: KeyError: 'state'", run.trouble)
    assert len(run.time) == len(run.coupling.wrench) == len(run.a) and 4 < len(run.time) < 20


def _failing_after(step, calls):
    """A step that fails after some calls; the first ones are the probe's."""
    left = iter(range(calls))

    def limited(*arguments):
        if next(left, None) is None:
            raise KeyError("state")
        return step(*arguments)

    return limited


@pytest.mark.parametrize(
    "text, name, message",
    [
        ("def build(a, b): pass", "build", "build cannot be made without arguments"),
        ("class A:\n  def init(self, base, gravity): pass", "A", r"has no step\(\)"),
        ("class A:\n  init = step = print", "A", "has no inertia; name the rigidly attached part"),
        ("x = 1", "A", "has no 'A'; it has no class or function"),
    ],
)
def test_files_that_hold_no_specimen_are_refused(tmp_path, text, name, message):
    file = tmp_path / "mine.py"
    file.write_text(text)
    with pytest.raises(ParameterError, match=message):
        make_plant(load_machine().with_specimen(f"{file}:{name}"))
    with pytest.raises(ParameterError, match=r"none\.py: no such file; write --specimen FILE\.py:NAME"):
        load_machine().with_specimen("none.py:A")


def test_the_fused_engine_refuses_a_coupled_specimen_with_the_remedy():
    plant, rest = at_rest(load_machine().with_specimen(Stub()))
    with pytest.raises(SimulationError, match="take the engine pinocchio"):
        simulate(plant, moving(rest, 8), samples=8, engine="fused")


class Still:
    """A controller that repeats given spools."""

    def __init__(self, spool):
        self.spool = spool

    def init(self, plant, rest):
        return iter(self.spool)

    def step(self, memory, wanted, sensors):
        return next(memory)


def test_a_running_plant_couples_as_simulate_does():
    plant, rest = at_rest(carrying(tower(PLATEN)))
    spool = moving(rest, 96).spool
    run = simulate(plant, PluggedLoop(Still(spool), *np.zeros((3, 96, 6)), rest), samples=96)
    table = RunningPlant(plant, rest)
    for command, q in zip(spool, run.q, strict=True):
        assert np.array_equal(table.state.q, q)
        table.advance(command)
    assert (
        np.array_equal(table.coupling.wrench[0], run.coupling.wrench[-1]) and np.abs(run.q[-1] - run.q[0]).max() > 1e-5
    )


def test_a_specimen_outside_moves_the_table_as_one_inside_does():
    """Its slab mounted, the rest of its wrench handed over at every sample, by the motion that the plant hands out.

    Inside, springs share their mass with the platen within one exchange, (omega h)^2 / 6 of it: 1e-3 apart.
    """
    own = tower(PLATEN)
    plant, rest = at_rest(carrying(own))

    class Slab:
        inertia = own.inertia

        def init(self, base, gravity):
            return gravity, rigid_wrench(self.inertia, base, gravity)

        def step(self, gravity, base, dt):
            return rigid_wrench(self.inertia, base, gravity)

    outside = RunningPlant(make_plant(carrying(Slab())), rest)
    inside = RunningPlant(plant, rest)
    gravity = plant.machine.platen.gravity
    base, moved = base_at_rest(plant.machine), []
    memory, wrench = own.init(base, gravity)
    for command in moving(rest, 256).spool:
        if outside.sample:
            base = outside.interface_motion()
            wrench = own.step(memory, base, 1.0 / SAMPLE_RATE)
        outside.advance(command, wrench - rigid_wrench(own.inertia, base, gravity))
        inside.advance(command)
        moved.append([outside.state.q[:6], inside.state.q[:6]])
    moved = np.array(moved) - rest.state.q[:6]
    assert relative(moved[:, 0], moved[:, 1]) < 1e-3


@pytest.mark.parametrize("machine", ["lhpost6", "uniaxial"])
def test_a_wrench_from_outside_gives_the_platen_its_momentum(machine):
    """A force for one sample, held: the change of velocity is its impulse over the mass, as long as the oil rests."""
    plant, rest = at_rest(machine_named(machine))
    table = RunningPlant(plant, rest, wrench_order=0, steps_per_second=16 * SAMPLE_RATE)
    bare = RunningPlant(plant, rest, steps_per_second=16 * SAMPLE_RATE)
    push = pin.Force(np.array([1e5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    table.advance(rest.spool, push)
    bare.advance(rest.spool)
    rise = np.zeros(6)
    rise[plant.axes] = table.state.v - bare.state.v
    at_b = np.zeros(6)
    at_b[plant.axes] = table._base.act(push).vector[plant.axes]
    mass = apparent_mass(plant)[np.ix_(plant.axes, plant.axes)]
    # oil and friction in 0.5 ms take 2 %
    expected = np.linalg.solve(mass, at_b[plant.axes]) / SAMPLE_RATE
    assert rise[0] == pytest.approx(expected[0], rel=0.03)
    with pytest.raises(SimulationError, match="whose fx is not finite"):
        table.advance(rest.spool, pin.Force(np.full(6, np.nan)))


def test_a_continued_wrench_is_linear_over_one_interval_and_constant_beyond():
    one = Continued(np.zeros(6), 1)
    one.take(np.ones(6), 0.1)
    assert np.allclose([one.at(t)[0] for t in (0.0, 0.05, 0.1, 1.0)], [1.0, 1.5, 2.0, 2.0])
    one.later(0.05)
    assert np.allclose([one.at(t)[0] for t in (0.0, 0.05, 1.0)], [1.5, 2.0, 2.0])
    one.take(np.ones(6), 0.2)
    assert np.allclose(one.at(0.1), 1.0)
    with pytest.raises(SimulationError, match="order 2"):
        Continued(np.zeros(6), 2)


def test_the_equilibrium_carries_the_tower_off_centre():
    plant, rest = at_rest(carrying(tower(1e5), (2.0, 0.0, 0.0)))
    assert isinstance(plant.coupled, Tower)
    east, west = rest.force[[4, 5]].sum(), rest.force[[8, 9]].sum()
    assert east > west + 1e5 and find_equilibrium(plant).force == pytest.approx(rest.force)


@pytest.mark.long
def test_the_command_line_runs_a_specimen_of_ones_own_and_says_what_it_exchanged(lhpost6, tmp_path):
    stub = inspect.getsource(Stub)
    (tmp_path / "own.py").write_text(f"import numpy as np\nimport pinocchio as pin\n\n\n{stub}")
    wave = ("sine", "--set", "amplitude=0.002", "--set", "period=0.25", "--set", "cycles=1")
    ended = lhpost6("run", *wave, "--specimen", "own.py:Stub", "--specimen-at", "0.5,0,0", "--out", "out", "--json")
    assert ended.code == 0, ended.err
    told = json.loads(ended.out)["interface"]
    assert 0.0 < told["energy"] and abs(told["energy_error"]) < 1e-6 and told["growth"] < 1e-6
    record = load_record(tmp_path / "out" / "record.nc")
    assert record.attrs["specimen"] == "Stub" and record["specimen_wrench"].dims == ("time", "interface_axis")
    assert float(record["specimen_wrench"].sel(interface_axis="fz")[0]) == pytest.approx(-1e4 * 9.80665)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "plot-interface" in page and "growth of errors per exchange" in page and "Notes from the run" not in page
    refused = lhpost6("run", *wave, "--specimen", "own.py:Stub", "--locked")
    assert refused.code == 2 and "no joints or modes to lock" in refused.err

"""The plant sample by sample: the same run as `simulate`'s, what it refuses, and what is seen of it on the way."""

import signal
import time

import numpy as np
import pinocchio as pin
import pytest
from commands import SHORT
from machine_cases import PENDULUM, machine_named
from run_cases import amid_ridgecrest, at_rest

from lhpost6_pin.cli import live_view as live
from lhpost6_pin.core.errors import SimulationError
from lhpost6_pin.core.names import ENGINES, SAMPLE_RATE, SCHEMES
from lhpost6_pin.data.records import load_record
from lhpost6_pin.effects.registry import CODES, LAWS
from lhpost6_pin.interfaces.link.protocol import Datagram, Kind, LinkMode, encode
from lhpost6_pin.interfaces.link.served import ServedPlant
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.coupled import motion_numbers, rigid_wrench
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.gas_pressure import strut_pressures
from lhpost6_pin.mechanics.instant import legs_at
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.viewer import LiveView
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.running import RunningPlant
from lhpost6_pin.simulation.simulate import ClosedLoop, simulate
from lhpost6_pin.simulation.snapshot import EVERY, Snapshot

N = 1024


@pytest.fixture(scope="module")
def strong(plant, rest):
    """Controller and drive of half a second of Ridgecrest."""
    return amid_ridgecrest(plant, rest, N)[:2]


def run_by_samples(table, loop, drive, watch=lambda k: None):
    memory, states, commands, spools = loop.init(), [], [], []
    for k in range(len(drive)):
        state = table.state
        command = loop.step(memory, k, drive, table.sensors())
        watch(k)
        states.append(np.concatenate([state.q, state.v, state.z]))
        commands.append(command)
        table.advance(command)
        spools.append(table.spool)
    return np.array(states), np.array(commands), np.array(spools)


@pytest.mark.parametrize("scheme, rate", [("semi_implicit", 4), ("semi_implicit", 1), ("rk4", 4), ("euler", 8)])
def test_a_run_sample_by_sample_is_that_of_simulate_to_the_last_bit(plant, rest, strong, scheme, rate):
    options = {"scheme": scheme, "steps_per_second": rate * SAMPLE_RATE}
    loop, drive = strong
    run = simulate(plant, ClosedLoop(loop, drive, rest), samples=N, **options)
    assert run.trouble is None and np.abs(run.command - rest.spool).max() > 0.01  # the table moves
    table = RunningPlant(plant, rest, **options)
    states, commands, spools = run_by_samples(table, loop, drive)
    assert np.array_equal(commands, run.command)
    assert np.array_equal(states, np.hstack([run.q, run.v, run.z]))
    assert np.allclose(spools, run.spool, rtol=0.0, atol=1e-15)  # a mean, rounded
    assert (table.sample, table.time, table.clipped) == (N, N / SAMPLE_RATE, run.clipped)


def test_a_plant_that_is_lifted_off_its_bearings_says_so_once_and_goes_on(plant, rest, caplog):
    """A wrench that takes the weight and more: vertical actuators cannot pull."""
    table, lift = RunningPlant(plant, rest), pin.Force(np.array([0.0, 0.0, 2e7, 0.0, 0.0, 0.0]))
    places = [plant.state_index("actuators_3_way", f"V{k}", "pressure_a") for k in range(1, 7)]
    seen, empty = [], []
    for _ in range(60):
        table.advance(rest.spool, lift)
        seen.append(table.trouble)
        empty.append(table.state.z[places].min() < 0.0)
    assert seen[0] == "" and table.trouble.startswith("became unphysical at 0.0")
    assert "chamber A of V" in table.trouble and "would lose contact with the platen" in table.trouble
    (warning,) = caplog.records
    assert table.trouble in warning.message
    first = empty.index(True)
    assert [bool(text) for text in seen] == [False] * first + [True] * (60 - first)
    assert f"at {(first + 1) / SAMPLE_RATE:.4f} s" in table.trouble and len(set(seen)) == 2


@pytest.mark.parametrize("scheme", SCHEMES)
def test_looking_at_the_sensors_changes_nothing(plant, rest, strong, scheme):
    loop, drive = strong
    left, right = (RunningPlant(plant, rest, scheme=scheme, steps_per_second=8 * SAMPLE_RATE) for _ in range(2))
    alone = run_by_samples(left, loop, drive[:200])
    watched = run_by_samples(right, loop, drive[:200], lambda k: [right.sensors() for _ in range(k % 3)])
    for a, b in zip(alone, watched, strict=True):
        assert np.array_equal(a, b)


def test_two_tables_of_one_plant_do_not_disturb_each_other(plant, rest, strong):
    loop, drive = strong
    alone = run_by_samples(RunningPlant(plant, rest), loop, drive[:300])[0]
    table, other = RunningPlant(plant, rest), RunningPlant(plant, rest)
    between = run_by_samples(table, loop, drive[:300], lambda k: other.advance(0.9 * rest.spool))[0]
    assert np.array_equal(alone, between)


@pytest.mark.parametrize(
    "machine", [*map(machine_named, ("uniaxial", "stewart")), load_machine().with_specimen(PENDULUM)]
)
def test_other_machines_and_a_pendulum_on_one_run_sample_by_sample_too(machine):
    plant, rest = at_rest(machine)
    table = RunningPlant(plant, rest)
    for _ in range(200):
        table.advance(rest.spool)
    assert np.abs(table.state.v).max() < 1e-9  # it rests
    assert np.allclose(table.sensors().displacement, 0.0, atol=1e-9)


def test_sensors_at_rest_tell_of_rest(plant, rest):
    sensors = RunningPlant(plant, rest).sensors()
    assert np.allclose(sensors.displacement, 0.0, atol=1e-12)
    assert np.allclose(sensors.force, rest.force, rtol=1e-9)
    assert np.abs(sensors.acceleration).max() < 1e-8  # rounding of 4 MN of weight over 170 t


def test_a_command_beyond_full_stroke_is_clipped_and_counted(plant, rest):
    table, full = RunningPlant(plant, rest), RunningPlant(plant, rest)
    for _ in range(30):
        table.advance(np.where(np.arange(10) == 0, 3.0, rest.spool))
        full.advance(np.where(np.arange(10) == 0, 1.0, rest.spool))
    assert (table.clipped, full.clipped) == (30, 0)
    assert np.array_equal(table.state.q, full.state.q)


def test_a_command_that_is_not_finite_or_of_another_shape_is_refused_and_nothing_moves(plant, rest):
    table = RunningPlant(plant, rest)
    for bad in (*(np.full(10, x) for x in (np.nan, np.inf)), *map(np.zeros, [(9,), (11,), (1, 10), ()])):
        with pytest.raises(SimulationError, match="10 finite spool values"):
            table.advance(bad)
    assert table.sample == 0 and np.array_equal(table.state.q, rest.state.q)


@pytest.mark.parametrize("rate", [0, 1000, 3000, -2048])
def test_a_rate_that_does_not_divide_the_sample_is_refused(plant, rest, rate):
    with pytest.raises(SimulationError, match=rf"multiple of the controller rate, 2048 Hz \(got {rate}\)"):
        RunningPlant(plant, rest, steps_per_second=rate)


def test_a_leg_that_leaves_its_stroke_stops_the_table_by_name(plant, rest):
    table = RunningPlant(plant, rest)
    up = rest.spool.copy()
    up[4:] = 0.6
    with pytest.raises(SimulationError, match=r"stopped at \d\.\d+ s: V\d left its stroke of \+-0.127 m"):
        for _ in range(4 * SAMPLE_RATE):
            table.advance(up)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_table_goes_on_with_the_same_plant_to_the_last_bit(plant, rest, scheme):
    """Also amid a motion with a wrench from outside, and the one that it came from is not disturbed."""
    table = RunningPlant(plant, rest, scheme=scheme, steps_per_second=8 * SAMPLE_RATE)
    push = pin.Force(np.array([1e5, 2e4, -1e5, 1e4, 0.0, 3e4]))
    wave = rest.spool + 0.1 * np.sin(0.02 * np.arange(300))[:, None]
    for k in range(100):
        table.advance(wave[k], (0.01 * k) * push if k % 3 == 0 else None)
    other = table.with_plant(make_plant(plant.machine))
    assert all(np.array_equal(a, b) for a, b in zip(other.sensors(), table.sensors(), strict=True))
    for k in range(100, 300):
        for one in (table, other):
            one.advance(wave[k], (0.01 * k) * push if k % 3 == 0 else None)
        assert all(np.array_equal(a, b) for a, b in zip(other.state, table.state, strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(other.pressures(), table.pressures(), strict=True))
    assert np.abs(table.state.v).max() > 1e-2 and (other.sample, other.clipped) == (300, table.clipped)


EFFECTS = {  # a force, two that are states of the oil, one that lengthens the memory of commands
    "local_viscous": {"coefficient": 2e5},
    "entrained_air": {},
    "line_dynamics": {},
    "transport_delay": {"delay": 0.01},
}


@pytest.mark.parametrize("family", EFFECTS)
def test_an_effect_that_is_switched_on_changes_the_motion_from_then_on_and_the_platen_goes_on(plant, rest, family):
    machine = plant.machine.with_effect(family, ["H1"], **EFFECTS[family])
    along = np.array([-1, -1, 1, 1, 0, 0, 0, 0, 0, 0])  # X
    table, wave = RunningPlant(plant, rest), rest.spool + 0.1 * np.outer(np.sin(0.02 * np.arange(500)), along)
    for k in range(200):
        table.advance(wave[k])
    other = table.with_plant(make_plant(machine))
    before, after = table.state, other.state
    assert np.array_equal(before.q, after.q) and np.array_equal(before.v, after.v)
    assert np.array_equal(other.sensors().force, table.sensors().force)  # pressures go on
    new = set(other.plant.states) - set(plant.states)
    assert all(after.z[other.plant.states.index(name)] == 0.0 for name in new)
    assert bool(new) == (family == "line_dynamics")
    for k in range(200, 500):
        other.advance(wave[k])
        table.advance(wave[k])
    apart = np.abs(other.interface_motion().pose.translation - table.interface_motion().pose.translation).max()
    assert 1e-7 < apart < 0.02  # m: more than rounding, less than the motion itself
    back = other.with_plant(plant)
    assert back.plant is plant and np.array_equal(back.state.q, other.state.q) and back.state.z.shape == before.z.shape


def test_a_plant_of_another_size_is_refused_and_so_is_a_specimen_that_is_a_program(plant, rest):
    table = RunningPlant(plant, rest)
    for machine in (machine_named("uniaxial"), plant.machine.with_specimen(PENDULUM)):
        with pytest.raises(SimulationError, match="a plant of the same machine and specimen"):
            table.with_plant(make_plant(machine))
    coupled = make_plant(plant.machine.with_specimen(Mass()))
    with pytest.raises(SimulationError, match="while a specimen is a program"):
        table.with_plant(coupled)
    with pytest.raises(SimulationError, match="starts in the zero-position"):
        find_equilibrium(coupled, (0, 0, -0.1, 0, 0, 0))


class Mass:
    """A mass of one tonne, rigidly attached."""

    inertia = pin.Inertia(1e3, np.zeros(3), np.eye(3))

    def init(self, base, gravity):
        return gravity, rigid_wrench(self.inertia, base, gravity)

    def step(self, gravity, base, dt):
        return rigid_wrench(self.inertia, base, gravity)


def shaken(machine, effects=()):
    """A running plant of a machine with effects of the library, after a tenth of a second of all its spools."""
    for family in effects:
        machine = machine.with_effect(family)
    own = make_plant(machine)
    table, at_rest = RunningPlant(own, find_equilibrium(own)), find_equilibrium(own).spool
    for k in range(200):
        table.advance(at_rest + 0.1 * np.sin(0.02 * k + np.arange(own.spools)))
    return table


@pytest.mark.parametrize(
    "name, effects",
    [
        ("lhpost6", ()),
        ("lhpost6", ("strut_gas_leak", "gas_heat_transfer")),  # all laws that act on the gas
        ("lhpost6", ("supply_droop", "transport_delay")),
        ("uniaxial", ()),  # guided: it does not turn
    ],
)
def test_readings_in_one_row_are_those_that_are_read_one_by_one(name, effects):
    table = shaken(machine_named(name), effects)
    n, sensors, pressures = table.plant.spools, table.sensors(), table.pressures()
    found = table.readings(pressures=True)
    motion, gas = found[6 + 2 * n :][:18], found[24 + 5 * n : -1]
    for got, own in ((found[:6], sensors.acceleration), (found[6:][:n], sensors.displacement)):
        assert np.array_equal(got, own)  # the same compiled code
    assert np.array_equal(found[6 + n :][:n], sensors.force)
    # Pinocchio's motion: other roundings of the same products of numbers below 10
    np.testing.assert_allclose(motion, motion_numbers(table.interface_motion()), rtol=0.0, atol=1e-13)
    assert np.abs(motion).max() > 1e-3  # it moves
    assert np.array_equal(found[24 + 2 * n :][: 3 * n], np.concatenate([pressures.a, pressures.b, pressures.spool]))
    np.testing.assert_allclose(gas, pressures.strut, rtol=1e-14)  # a power and an exponential, rounded
    assert found[-1] == pytest.approx(pressures.supply, rel=1e-15)
    assert np.array_equal(table.readings(), found[: 24 + 2 * n])
    handled = {int(row["law"]) for row in table.plant.gas_rows}
    if "strut_gas_leak" in effects:
        assert handled == {CODES[name] for name, law in LAWS.items() if law.acts_on_gas}
        assert np.abs(gas / strut_pressures(table.plant.machine, elongations(table)) - 1.0).max() > 1e-6


def elongations(table):
    return legs_at(table.plant, table.interface_motion().pose)[0][table.plant.spools :]


def test_readings_that_are_not_finite_stop_the_run(plant, rest):
    table = RunningPlant(plant, rest)
    table._ws.z[plant.pressure_states[0][0]] = np.nan
    table._evaluate(table._ws, rest.spool)
    with pytest.raises(SimulationError, match=r"stopped at 0\.0000 s: a sensor is not finite"):
        table.readings()


@pytest.mark.parametrize("command", [np.zeros(9), np.full(10, np.nan), np.array([np.inf, *np.zeros(9)])])
def test_a_command_that_is_refused_changes_nothing(plant, rest, command):
    table, other = RunningPlant(plant, rest), RunningPlant(plant, rest)
    with pytest.raises(SimulationError, match="a command is 10 finite spool values"):
        table.advance(command)
    for one in (table, other):
        one.advance(rest.spool + 2.0)
    assert (table.clipped, table.sample) == (other.clipped, other.sample) == (10, 1)
    assert np.array_equal(table.readings(True), other.readings(True))


def test_pressures_give_the_forces_and_those_of_the_struts_the_hold_down(plant, rest):
    table = RunningPlant(plant, rest)
    for k in range(200):
        table.advance(rest.spool + 0.1 * np.sin(0.02 * k))
    found, machine = table.pressures(), plant.machine
    area = np.array([(a.area_a, a.area_b or 0.0) for a in machine.actuators])
    # the same products of pressures and areas: rounding of 4 MN
    np.testing.assert_allclose(
        found.a * area[:, 0] - found.b * area[:, 1], table.sensors().force, rtol=1e-12, atol=1e-6
    )
    gas = table.snapshot().force[plant.spools :]
    np.testing.assert_allclose(found.strut * [s.area for s in machine.struts], -gas, rtol=1e-12)
    assert np.array_equal(found.spool, table.spool) and found.supply == machine.hydraulics.supply_pressure
    droop = make_plant(machine.with_effect("supply_droop"))
    fed = table.with_plant(droop)
    for _ in range(20):
        fed.advance(rest.spool + 0.2)
    assert fed.pressures().supply < found.supply


@pytest.fixture(scope="module")
def loop(controller, rest):
    target = make_target(find_motion("sine", amplitude=0.02, cycles=0.5, ramp_cycles=0.5), rate=float(SAMPLE_RATE))
    drive = controller.drive_for(target.displacement, target.velocity, target.acceleration)
    begin = int(np.argmax(np.abs(drive[:, 0]) > 1e-3 * np.abs(drive[:, 0]).max()))
    return ClosedLoop(controller, drive[begin : begin + 4000], rest)


@pytest.mark.long
@pytest.mark.parametrize("engine", ENGINES)
def test_snapshots_are_those_of_the_record_and_looking_changes_nothing(plant, loop, engine):
    seen: list[Snapshot] = []
    run = simulate(plant, loop, samples=4000, engine=engine, watch=seen.append)
    unseen = simulate(plant, loop, samples=4000, engine=engine)
    for name in ("q", "v", "a", "z", "spool", "command"):
        assert np.array_equal(getattr(run, name), getattr(unseen, name)), name
    record = record_of_run(run, {"test": "sine"})
    assert [one.time for one in seen] == [k / SAMPLE_RATE for k in range(0, 4000, EVERY)]
    places = record.isel(time=slice(0, None, EVERY))
    moved = np.array([one.displacement for one in seen])
    assert np.abs(moved[:, 0]).max() > 1e-3
    np.testing.assert_allclose(moved, places["platen_displacement"].values, atol=1e-15)
    force = np.array([one.force for one in seen])
    # the ledger's forces against pressures times areas: rounding of 1 MN
    np.testing.assert_allclose(force[:, : plant.spools], places["actuator_force"].values, rtol=1e-12, atol=1e-6)
    gas = places["strut_pressure"].values * [s.area for s in plant.machine.struts]
    np.testing.assert_allclose(-force[:, plant.spools :], gas, rtol=1e-12)  # seals of Table 6.1 have no friction


@pytest.mark.long
def test_a_served_plant_shows_itself_now_and_then(plant, rest):
    table, seen = ServedPlant(plant, rest, LinkMode.LOCK_STEP), []
    table.watcher = seen.append
    table.receive(encode(Datagram(Kind.HELLO, 1)), "a", 0)
    n = plant.spools
    for k in range(1, 2 * EVERY + 2):
        frame = Datagram(Kind.COMMAND, 1, actuators=n, valves=n, sequence=k, numbers=rest.spool)
        table.receive(encode(frame), "a", k)
    assert [one.time for one in seen] == [EVERY / SAMPLE_RATE, 2 * EVERY / SAMPLE_RATE]


@pytest.mark.long
def test_a_live_view_is_no_faster_than_the_table(plant):
    still = Snapshot(0.0, np.zeros(6), np.ones(plant.legs.size))
    with LiveView(plant.machine, "still") as view:
        begin = time.monotonic()
        for moment in (3.0, 3.1, 3.3):  # a plant may have run before it is watched
            view.show(still._replace(time=moment))
        assert time.monotonic() - begin >= 0.3


@pytest.mark.long
def test_a_run_can_be_watched_from_the_command_line(lhpost6, monkeypatch, tmp_path, brief):
    monkeypatch.setattr(live, "PATIENCE", 0.0)
    ended = lhpost6("run", *SHORT, "--live", "--no-open", "--out", tmp_path)
    assert ended.code == 0 and "http://127.0.0.1:" in ended.out and "no viewer connected" in ended.err
    assert (tmp_path / "record.nc").is_file()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_that_is_stopped_keeps_what_was_done(plant, loop, engine):
    polled: list[bool] = []

    def stop() -> bool:
        polled.append(len(polled) == 3)
        return polled[-1]

    run = simulate(plant, loop, samples=4000, engine=engine, stop=stop)
    whole = simulate(plant, loop, samples=4000, engine=engine)
    done = 3 * EVERY + (engine == "pinocchio")  # it has recorded the sample at which it ends
    assert len(run.time) == done and len(polled) == 4
    for name in ("q", "v", "a", "z", "spool", "command"):
        assert np.array_equal(getattr(run, name), getattr(whole, name)[:done]), name
    assert run.trouble is not None and run.trouble.startswith(f"stopped at {done / SAMPLE_RATE:.4f} s: interrupted")


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_live_run_ended_by_a_signal_leaves_record_and_report(lhpost6, monkeypatch, tmp_path, number):
    monkeypatch.setattr(live, "PATIENCE", 0.0)
    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]

    def show(self: LiveView, snapshot: Snapshot) -> None:
        if snapshot.time == 8 * EVERY / SAMPLE_RATE:
            signal.raise_signal(number)

    monkeypatch.setattr(LiveView, "show", show)
    ended = lhpost6("run", *SHORT, "--live", "--no-open", "--json", "--out", tmp_path)
    assert ended.code == 1 and "Traceback" not in ended.words
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)] == before
    record = load_record(tmp_path / "record.nc")
    assert record.sizes["time"] == 8 * EVERY and "interrupted by a signal" in record.attrs["trouble"]
    assert "The run stopped at 0.2500 s: interrupted by a signal" in (tmp_path / "report.html").read_text()

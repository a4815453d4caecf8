"""The plant sample by sample: the same run as `simulate`'s, and what it refuses."""

import numpy as np
import pytest
from machine_cases import PENDULUM, plant_named

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.core.errors import SimulationError
from lhpost6_pin.core.names import SAMPLE_RATE, SCHEMES
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.running import RunningPlant
from lhpost6_pin.simulation.simulate import ClosedLoop, simulate

N = 1024


@pytest.fixture(scope="module")
def strong(plant, rest):
    """Controller and drive of half a second of Ridgecrest."""
    target = make_target(find_motion("ridgecrest"), window=(12.0, 13.0), rate=float(SAMPLE_RATE))
    motion = [x[8192 : 8192 + N] for x in (target.displacement, target.velocity, target.acceleration)]
    loop = make_controller(plant, rest, load_controller("lhpost6"))
    return loop, loop.drive_for(*motion)


def run_by_samples(table, loop, drive, watch=lambda k: None):
    """States at each sample, and commands."""
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


@pytest.mark.parametrize("name", ["uniaxial", "stewart"])
def test_other_machines_run_sample_by_sample_too(name):
    plant = plant_named(name)
    rest = find_equilibrium(plant)
    table = RunningPlant(plant, rest)
    for _ in range(200):
        table.advance(rest.spool)
    assert np.abs(table.state.v).max() < 1e-9  # it rests
    assert np.allclose(table.sensors().displacement, 0.0, atol=1e-9)


def test_a_pendulum_on_the_table_runs_sample_by_sample_too():
    plant = make_plant(load_machine().with_specimen(PENDULUM))
    rest = find_equilibrium(plant)
    table = RunningPlant(plant, rest)
    for _ in range(100):
        table.advance(rest.spool)
    assert len(table.state.v) == plant.model.nv > 6


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


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_command_that_is_not_finite_is_refused_and_nothing_moves(plant, rest, bad):
    table = RunningPlant(plant, rest)
    with pytest.raises(SimulationError, match="10 finite spool values"):
        table.advance(np.full(10, bad))
    assert table.sample == 0 and np.array_equal(table.state.q, rest.state.q)


@pytest.mark.parametrize("shape", [(9,), (11,), (1, 10), ()])
def test_a_command_of_another_shape_is_refused(plant, rest, shape):
    with pytest.raises(SimulationError, match="10 finite spool values"):
        RunningPlant(plant, rest).advance(np.zeros(shape))


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

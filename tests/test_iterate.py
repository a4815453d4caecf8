"""Online iteration on a few seconds of an earthquake: the error falls, the drive can be replayed, runs repeat."""

from dataclasses import replace

import numpy as np
import pytest
from run_cases import with_tuning_numbers

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.core.errors import SimulationError
from lhpost6_pin.core.names import AXES
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.pose import platen_motion
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.simulate import ClosedLoop, simulate
from lhpost6_pin.tuning import identify as identify_module
from lhpost6_pin.tuning import iterate as module
from lhpost6_pin.tuning.iterate import Iteration, identify_inverse, iterate

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def table():
    """The LHPOST6 with its shipped settings, from noise shorter than `tuning.toml` has it."""
    for _ in with_tuning_numbers({"iteration.noise_duration": 80.0}, identify_module, module):
        yield identify_inverse(load_machine(), load_controller("lhpost6"))


@pytest.fixture(scope="module")
def strong():
    """Four seconds of Ridgecrest, its largest accelerations among them."""
    return make_target(find_motion("ridgecrest"), window=(12.0, 16.0), pad=1.0)


@pytest.fixture(scope="module")
def found(table, strong):
    return iterate(load_machine(), strong, load_controller("lhpost6"), table=table, most=3)


def test_three_iterations_halve_the_acceleration_error_of_every_axis(found):
    first, best = found.history[0], found.history[found.best]
    assert np.all(best.acceleration[:3] < 0.5 * first.acceleration[:3])
    assert np.isnan(best.acceleration[3:]).all()  # no turn was wanted
    assert found.best >= 1 and len(found.history) <= 4
    assert np.all(best.displacement[:3] < 0.05)


def test_the_best_drive_replayed_gives_the_run_that_was_judged_best(found, plant, rest, strong):
    n = len(strong.time)
    assert found.drives.shape == (len(found.history), n, 6) and found.drive.shape == (n, 6)
    controller = make_controller(plant, rest, found.settings)
    again = simulate(plant, ClosedLoop(controller, found.drive, rest), samples=n, engine="fused")
    assert np.array_equal(again.q, found.best_run.q) and np.array_equal(again.command, found.best_run.command)
    assert found.history[found.best].peak_spool == np.abs(again.command).max()
    wanted = controller.drive_for(strong.displacement, strong.velocity, strong.acceleration)
    assert np.array_equal(found.drives[0], wanted)  # iteration 0 is the motion itself
    motion = platen_motion(plant, again.q, again.v, again.a)
    assert np.abs(motion.displacement[-100:, :3]).max() < 0.02  # it comes to rest where the motion does


def test_the_second_drive_is_the_inverse_of_the_table_and_its_delay(found, table, strong):
    """AIC: no iteration goes into it."""
    told = []
    alone = iterate(load_machine(), strong, found.settings, table=table, most=1, progress=told.append)
    assert np.array_equal(alone.drives, found.drives[:2])
    assert alone.reason == "limit of 1 iterations reached" and alone.table is table
    assert told == sorted(told) and told[-1] == 1.0
    assert 0.0 < table.delay < 0.03 and table.inverse.axes == table.transfer.axes == AXES
    once = iterate(load_machine(), strong, found.settings, table=table, most=0)
    assert len(once.history) == 1 and once.best == 0 and once.best_run is once.first_run


def test_a_run_that_leaves_its_stroke_names_the_iteration(table):
    far = make_target(find_motion("sine", axis="z", amplitude=0.2, period=2.0, cycles=1), pad=1.0)
    with pytest.raises(SimulationError, match=r"iteration 0 stopped at \d\.\d+ s: V\d left its stroke"):
        iterate(load_machine(), far, load_controller("lhpost6"), table=table, most=1)


def test_a_chamber_that_runs_empty_ends_the_iteration(table, strong, monkeypatch):
    """As it does a run: what follows is not physical."""

    def emptied(plant, *loop, **options):
        run = simulate(plant, *loop, **options)
        z = run.z.copy()
        z[100:, plant.state_index("actuators_3_way", "V2", "pressure_a")] = -1e4
        return replace(run, z=z)

    monkeypatch.setattr(module, "simulate", emptied)
    with pytest.raises(SimulationError, match=r"iteration 0 became unphysical at \d.\d+ s: chamber A of V2 fell below"):
        iterate(load_machine(), strong, load_controller("lhpost6"), table=table, most=1)


@pytest.mark.parametrize("gain", [0.0, -0.5, 1.5, np.nan])
def test_a_gain_that_is_none_is_refused(table, strong, gain):
    with pytest.raises(SimulationError, match="gain of the drive's update must be above 0"):
        iterate(load_machine(), strong, load_controller("lhpost6"), table=table, gain=gain)


def test_iterating_stops_when_two_in_turn_have_not_lowered_the_error():
    def history(*errors):
        none = np.full(6, np.nan)
        return [Iteration(k, np.array([e, *none[1:]]), none, none, 0.1, 0) for k, e in enumerate(errors)]

    assert not module._stalled(history(0.3, 0.2, 0.2), 0.05)  # too early to say
    assert not module._stalled(history(0.3, 0.2, 0.15, 0.12), 0.05)
    assert module._stalled(history(0.3, 0.10, 0.098, 0.099), 0.05)
    assert not module._stalled(history(0.3, 0.10, 0.12, 0.09), 0.05)  # one of the two did

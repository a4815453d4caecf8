"""Specimens that move in calibration and search: their wrench along the measured motion is carried by every test."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from run_cases import amid_ridgecrest, at_rest

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import SimulationError
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.identification.calibration import calibration_numbers
from lhpost6_pin.identification.calibration.prepare import as_simulated, prepare_problem
from lhpost6_pin.identification.calibration.sparse_bins import sparse_bins
from lhpost6_pin.identification.prepare import AS_RECORDED, prepare_test
from lhpost6_pin.identification.residuals import evaluate_residuals, follow
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.modal_march import fine_steps, march_modes
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import PlantMotion, plant_motion
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulate import ClosedLoop, fastest_engine, simulate
from lhpost6_pin.simulation.simulated_campaign import simulate_campaign
from lhpost6_pin.simulation.specimen_response import driven_wrenches

pytestmark = pytest.mark.long

N = 1024
FRAMES = ["shear_frame", "shear_frame_joints"]


@pytest.fixture(scope="module", params=FRAMES)
def shaken(request):
    """Half a second of an earthquake on the table with a frame of 65 t: plant and run at every sample."""
    plant, rest = at_rest(load_machine().with_specimen(request.param))
    controller, drive = amid_ridgecrest(plant, rest, N)[:2]
    return plant, simulate(plant, ClosedLoop(controller, drive, rest), samples=N, engine=fastest_engine(plant))


def locked(plant):
    machine = plant.machine
    return make_plant(replace(machine, specimen=replace(machine.specimen, locked=True)))


def test_with_the_carried_wrench_the_balance_of_forces_closes(shaken):
    plant, run = shaken
    test = prepare_test(plant, record_of_run(run, {"test": "t"}), None, AS_RECORDED)
    moved, rigid = plant_motion(plant, test.motion), locked(plant)
    carried = driven_wrenches(plant, moved, test.dt) - driven_wrenches(rigid, moved, test.dt)
    closed = evaluate_residuals(rigid, replace(test, carried=carried), ("wrench",)).wrench
    left = evaluate_residuals(rigid, test, ("wrench",)).wrench
    moving = slice(64, None)
    # the record is of every fourth step, and forces see the velocity of the step before: 0.3 ms of friction and motion
    assert np.std(closed[moving, 0]) < 0.05 * np.std(left[moving, 0])


def test_residuals_of_a_plant_that_carries_what_moves_are_refused(shaken):
    plant, run = shaken
    test = prepare_test(plant, record_of_run(run, {"test": "t"}), None, AS_RECORDED)
    with pytest.raises(SimulationError, match="take a rigid specimen at most"):
        follow(plant, test)


def test_modes_along_a_coarse_record_are_those_of_a_fine_one():
    plant = at_rest(load_machine().with_specimen("shear_frame"))[0]
    t = np.arange(4 * 4096) / 4096.0
    motion = PlantMotion(np.tile(plant.zero_state().q, (len(t), 1)), *np.zeros((2, len(t), 6)))
    motion.q[:, 0] += np.where(t < 0.4, 0.01 * np.sin(np.pi * t / 0.4) ** 4, 0.0)
    due = march_modes(plant, motion, 1 / 4096, substeps=4)[::8]
    few = PlantMotion(*(x[::8] for x in motion))
    assert fine_steps(plant, 1 / 512) > 2

    def error(substeps):
        found = march_modes(plant, few, 1 / 512, substeps=substeps)
        return np.linalg.norm(found[:, :3] - due[:, :3]) / np.linalg.norm(due[:, :3])

    # the midpoint rule's period errs by (w dt)^2 / 12: by a ninth with three steps, beside what the mean twist leaves
    assert 5 * error(fine_steps(plant, 1 / 512)) < error(1)


@pytest.fixture(scope="module")
def campaign():
    """One test of a table with a frame, through sensors without calibration errors."""
    machine, sensors = load_machine().with_specimen("shear_frame"), load_sensors()
    made = simulate_campaign(
        machine, load_controller("lhpost6"), sensors, seed=1, errors=False, tests=("WN",), scale=0.5
    )
    return machine, sensors, made.records


def test_a_table_with_a_specimen_that_moves_is_calibrated_with_it_locked_and_its_sway_carried(campaign, caplog):
    machine, sensors, records = campaign
    numbers = calibration_numbers()
    with caplog.at_level(logging.WARNING):
        problem = prepare_problem(machine, records, sensors, numbers, kinds=("wrench",), jobs=1)
    assert "shear_frame moves on joints or in modes" in caplog.text
    assert problem.machine.specimen.locked and as_simulated(problem, problem.machine).specimen == machine.specimen
    assert problem.tests[0].carried is not None

    plant = problem.plant_at(np.zeros(len(problem.prior)))

    def misfit(test):
        bins, frequency = problem.bins(evaluate_residuals(plant, test, problem.kinds), test)
        white = problem.whitener.apply(0, sparse_bins(bins), frequency).full(bins.shape[1])
        return float(np.mean(np.abs(white) ** 2))

    (test,) = problem.tests
    # noise alone is 1; without the frame's wrench the platen's mass would stand for it
    assert misfit(test) < 1.5
    assert misfit(replace(test, carried=None)) > 20.0

"""The plug point: how a user's controller is found, checked and run, and the LQG example behind it."""

import math
import sys
from dataclasses import dataclass
from itertools import chain, count, repeat
from typing import Any

import numpy as np
import pytest
from commands import own_controller
from machine_cases import SCRIPTS
from run_cases import amid_ridgecrest

from lhpost6_pin.control import Controller, load_controller
from lhpost6_pin.control.plug import checked_command, is_plugged, load_plugged
from lhpost6_pin.core.errors import ControllerError, MotionError, SimulationError
from lhpost6_pin.core.names import AXES, SAMPLE_RATE
from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.signals import align, delay, lowpass_zero_phase, rrmse
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.linearize import oil_column_modes
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.rehearse import rehearse
from lhpost6_pin.simulation.simulate import PluggedLoop, simulate

pytestmark = pytest.mark.long

HOLD = """
from dataclasses import dataclass
@dataclass
class Hold:
    share: float = 1.0
    def init(self, plant, rest): return self.share * rest.spool
    def step(self, memory, wanted, sensors): return memory.tolist()
def made(): return Hold(1.0)
class Needy:
    def __init__(self, gain): pass
class Half:
    def init(self, plant, rest): pass
"""


class Hold:
    """Commands the spools at rest, whatever is wanted."""

    def init(self, plant, rest):
        return rest.spool

    def step(self, memory, wanted, sensors):
        return memory


@dataclass
class Faulty(Hold):
    """Holds for five samples, then commands what it was given."""

    wrong: list[float]

    def init(self, plant, rest):
        """Memory: the commands to come."""
        return chain(repeat(rest.spool, 5), repeat(self.wrong))

    def step(self, memory, wanted, sensors):
        return next(memory)


@dataclass
class Plugged469D:
    """The 469D's own step, called through the plug point."""

    loop: Controller
    drive: np.ndarray

    def init(self, plant, rest):
        return self.loop.init(), count()

    def step(self, memory, wanted, sensors):
        own, samples = memory
        return self.loop.step(own, next(samples), self.drive, sensors)


@dataclass
class DesignedFor:
    """A controller designed for one machine, run on another."""

    controller: Any
    machine: Machine

    def init(self, plant, rest):
        """Design for the machine, not for the plant."""
        own = make_plant(self.machine)
        return self.controller.init(own, find_equilibrium(own))

    def step(self, memory, wanted, sensors):
        return self.controller.step(memory, wanted, sensors)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(HOLD)
    return path


def standing(samples):
    return [np.zeros((samples, 6)) for _ in range(3)]


def test_a_file_and_a_name_mean_a_plugged_controller_and_a_name_alone_means_settings():
    assert is_plugged("mine.py:Mine") and is_plugged("a/b.py:make") and is_plugged("mine.py")
    assert not is_plugged("lhpost6") and not is_plugged("panel.toml")


@pytest.mark.parametrize("name", ["Hold", "made"])
def test_a_class_and_a_function_that_returns_a_controller_hold_the_table_at_rest_alike(file, plant, rest, name):
    run = simulate(plant, PluggedLoop(load_plugged(f"{file}:{name}"), *standing(512), rest), samples=512)
    assert run.trouble is None and run.clipped == 0
    assert np.array_equal(run.command, np.tile(rest.spool, (512, 1)))
    assert np.abs(run.q - rest.state.q).max() < 1e-12  # rounding: 1e-16 m grows with the slow mode of the struts
    assert np.abs(run.v).max() < 1e-12


@pytest.mark.parametrize(
    "name, message",
    [
        ("absent.py:Mine", "absent.py: no such file; write --controller FILE.py:NAME"),
        ("{file}", "mine.py: which class or function in it?"),
        ("{file}:Other", "mine.py has no 'Other'; it has Hold, made, Needy, Half"),
        ("{file}:Needy", "Needy cannot be made without arguments: TypeError: .*gain"),
        ("{file}:Half", r"Half has no step\(\)"),
    ],
)
def test_a_controller_that_cannot_be_loaded_is_refused_by_file_and_reason(file, name, message):
    with pytest.raises(ControllerError, match=message):
        load_plugged(name.format(file=file))


@pytest.mark.parametrize(
    "text, message",
    [
        ("import no_such_module", "mine.py cannot be imported: ModuleNotFoundError: .*no_such_module"),
        ("class Mine:\n  def init(", "mine.py cannot be imported: SyntaxError"),
        ("raise SystemExit('left')", "mine.py cannot be imported: SystemExit: left"),
        ("x = 1", "mine.py has no 'Mine'; it has no class or function"),
    ],
)
def test_a_file_that_is_no_use_is_refused(file, text, message):
    file.write_text(text)
    with pytest.raises(ControllerError, match=message):
        load_plugged(f"{file}:Mine")
    if "cannot be imported" in message:
        assert "lhpost6_plugged_mine" not in sys.modules  # nothing half-made is left behind


@pytest.mark.parametrize(
    "command, message",
    [
        (np.zeros(9), r"Hold returned shape \(9,\) at sample 7; \(10,\) is needed"),
        (0.1, r"Hold returned shape \(\) at sample 7"),
        ([0.0] * 3 + [math.nan] + [0.0] * 6, "Hold returned nan for actuator 4 of 10 at sample 7"),
        ([0.0] * 9 + [-math.inf], "Hold returned -inf for actuator 10 of 10 at sample 7"),
        ("full speed", "Hold returned no numbers at sample 7"),
        (None, r"Hold returned shape \(\) at sample 7"),
        ([[0.0], [0.0, 1.0]], "Hold returned no numbers at sample 7"),
        (np.zeros(10) * 1j, "Hold returned no numbers at sample 7: they are complex"),
    ],
)
def test_what_is_no_command_is_refused_with_controller_and_sample(command, message):
    with pytest.raises(ControllerError, match=message):
        checked_command(Hold(), command, 7, 10)


@pytest.mark.parametrize(
    "init, step, message",
    [
        ("return 1 / 0", "return [0.0] * 10", r"Mine.init failed: ZeroDivisionError: .*mine.py, line 2\)"),
        ("return 1", "raise KeyError('gain')", r"Mine.step failed at sample 0: KeyError: 'gain' .*mine.py, line 3\)"),
        ("return 1", "raise SystemExit('left')", "Mine.step failed at sample 0: SystemExit: left"),
        ("return 1", "wanted.displacement[:] = 1.0", "Mine.step failed at sample 0: ValueError: .*read-only"),
    ],
)
def test_what_a_users_own_code_raises_is_told_with_its_line(file, plant, rest, init, step, message):
    motion = standing(4)
    with pytest.raises(ControllerError, match=message):
        simulate(plant, PluggedLoop(load_plugged(own_controller(file, init, step)), *motion, rest), samples=4)
    assert not np.any(motion)  # what is wanted stays as it was


def test_a_controller_with_other_arguments_than_the_plug_points_is_told_so(file, plant, rest):
    file.write_text("class Mine:\n    def init(self): pass\n    def step(self): pass\n")
    with pytest.raises(ControllerError, match=r"Mine.init failed: TypeError: .*takes 1 positional argument"):
        simulate(plant, PluggedLoop(load_plugged(f"{file}:Mine"), *standing(4), rest), samples=4)


def test_a_faulty_command_stops_a_run_at_its_sample_and_one_beyond_full_stroke_is_clipped_and_counted(plant, rest):
    with pytest.raises(ControllerError, match="Faulty returned nan for actuator 1 of 10 at sample 5"):
        simulate(plant, PluggedLoop(Faulty([math.nan] * 10), *standing(20), rest), samples=20)
    run = simulate(plant, PluggedLoop(Faulty([2.0] * 4 + [0.0] * 6), *standing(20), rest), samples=20)
    assert run.clipped == 4 * 15  # four spools in each of the fifteen samples after the first five
    assert np.abs(run.command).max() == 1.0


@pytest.mark.parametrize("scheme", ["semi_implicit", "rk4"])
def test_the_469d_through_the_plug_point_is_the_compiled_loop_to_the_last_bit(plant, rest, scheme):
    """Same step, same sensors, same delay: only the way in differs."""
    loop = amid_ridgecrest(plant, rest, 1024)
    own = PluggedLoop(Plugged469D(loop.controller, loop.drive), *standing(1024), rest)
    compiled, plugged = (simulate(plant, one, samples=1024, scheme=scheme) for one in (loop, own))
    assert np.abs(compiled.command - rest.spool).max() > 0.01  # the table moves
    for name in ("command", "spool", "q", "v", "z"):
        assert np.array_equal(getattr(compiled, name), getattr(plugged, name)), name


def test_what_is_wanted_must_fit_the_samples_and_be_finite_and_the_engine_run_python(plant, rest):
    motion = standing(8)
    motion[2][3, 1] = math.nan
    for wanted, engine, message in (
        (standing(7), "pinocchio", r"wanted displacement has shape \(7, 6\); \(8, 6\) is needed"),
        (motion, "pinocchio", "wanted acceleration is not finite at sample 3, column 1"),
        (standing(8), "fused", "fused engine runs compiled controllers; take the engine pinocchio"),
    ):
        with pytest.raises(SimulationError, match=message):
            simulate(plant, PluggedLoop(Hold(), *wanted, rest), samples=8, engine=engine)


def test_a_controller_runs_from_the_command_line_by_a_relative_path(lhpost6, file, monkeypatch, brief):
    monkeypatch.chdir(file.parent)
    command = ("run", "sine", "--set", "amplitude=0.01", "--set", "cycles=1", "--controller", "mine.py:Hold")
    assert lhpost6(*command, "--out", "held").code == 0
    record = load_record(file.parent / "held" / "record.nc")
    assert np.abs(record["reference_displacement"].values).max() == pytest.approx(0.01, rel=1e-3)
    assert np.abs(record["platen_displacement"].values).max() < 1e-9  # held, whatever was wanted


# ---------------------------------------------------------------------------------------------- the LQG example
@pytest.fixture(scope="module")
def lqg():
    pytest.importorskip("control", reason="the LQG example needs python-control")
    return load_plugged(f"{SCRIPTS / 'example_5_lqg_controller.py'}:Lqg")


def errors(machine, controller, target):
    """RRMSE of displacement and acceleration of the axes asked to move, 0 to 33 Hz, delay removed; and the delays."""
    test = rehearse(machine, target, controller, attrs={"test": "lqg"})
    assert test.run.trouble is None and test.run.clipped == 0
    dt, moved, found = 1 / SAMPLE_RATE, target.displacement.any(axis=0), {}
    for name in ("displacement", "acceleration"):
        pair = getattr(target, name), test.record[f"platen_{name}"].values
        asked, achieved = (lowpass_zero_phase(x[:, moved], dt, 33.0) for x in pair)
        late = delay(asked, achieved, dt)
        found[name] = rrmse(asked, align(achieved, late, dt)), late
    return found


def sine(axis, amplitude):
    return make_target(find_motion("sine", axis=axis, amplitude=amplitude, period=1.0, cycles=2), pad=1.0)


@pytest.fixture(scope="module")
def strong():
    """Three seconds of Ridgecrest, its largest accelerations among them."""
    return make_target(find_motion("ridgecrest"), window=(12.0, 15.0), pad=1.0)


def test_lqg_follows_a_sine_more_closely_than_the_469d(lqg):
    machine, target = load_machine(), sine("x", 0.1)
    own, panel = (errors(machine, c, target) for c in (lqg, load_controller("lhpost6")))
    # what is left is dry friction at reversals, and the wait for the filter to learn of it
    assert own["displacement"][0] < 0.01 and own["acceleration"][0] < 0.06
    assert own["displacement"][0] < panel["displacement"][0] and own["acceleration"][0] < panel["acceleration"][0]


def test_lqg_follows_an_earthquake_late_by_the_valves_delay_and_a_sample(lqg, strong):
    found = errors(load_machine(), lqg, strong)
    assert np.all(found["displacement"][0] < 0.02) and np.all(found["acceleration"][0] < 0.10)
    # friction shifts where the correlation peaks by less than a millisecond
    assert np.allclose(found["acceleration"][1], 0.005 + 1 / SAMPLE_RATE, rtol=0.0, atol=1e-3)


@pytest.mark.parametrize(
    "changes",
    [
        {"hydraulics.bulk_modulus": 0.75},
        # two seconds each; the changes of stiffness and delay are those that threaten stability
        pytest.param({"horizontal.flow": 0.9, "vertical.flow": 1.1}, marks=pytest.mark.slow),
        {"horizontal.valve_delay": 1.2, "vertical.valve_delay": 1.2},
        pytest.param({"vertical.chamber_a": 1.5}, marks=pytest.mark.slow),
    ],
    ids=lambda changes: ", ".join(changes),
)
def test_lqg_stays_stable_on_a_plant_other_than_it_was_designed_for(lqg, strong, changes):
    machine = load_machine()
    other = machine.with_params({name: factor * machine.parameters[name].value for name, factor in changes.items()})
    found = errors(other, DesignedFor(lqg, machine), strong)
    # the 469D, which inverts the right valves, is at 3 % and 20 to 37 % here
    assert np.all(found["displacement"][0] < 0.03) and np.all(found["acceleration"][0] < 0.20)


def test_lqg_designs_itself_for_another_machine(lqg):
    assert errors(load_machine("uniaxial"), lqg, sine("x", 0.03))["displacement"][0] < 0.01  # friction is small there


def test_lqg_serves_several_runs_with_one_object(lqg, plant, rest):
    target = sine("z", 0.01)
    motion = [x[:2048] for x in (target.displacement, target.velocity, target.acceleration)]
    first, second = (simulate(plant, PluggedLoop(lqg, *motion, rest), samples=2048).command for _ in range(2))
    assert np.array_equal(first, second)


def test_lqg_model_has_the_oil_column_modes_of_the_plant(lqg, plant):
    """The projection keeps what matters: frequencies of the undamped plant's modes, to the damping's small shift."""
    module = sys.modules[type(lqg).__module__]
    poles = np.linalg.eigvals(module.platen_model(plant).a)
    found = np.sort(np.abs(poles[poles.imag > 1.0])) / (2 * np.pi)
    modes = [mode.frequency for mode in oil_column_modes(plant.machine)]
    assert len(found) == len(AXES)
    assert np.allclose(found, modes, rtol=1e-3)  # damping ratios below 1 % shift them by their squares


def test_lqg_refuses_what_its_model_has_no_place_for(lqg):
    machine = load_machine()
    for other, message in (
        (machine.with_specimen("pendulum"), "no place for a specimen's joints; lock them"),
        (machine.with_params({"vertical.valve_delay": 0.004}), "valves with one delay"),
        (machine.with_params({"horizontal.valve_delay": 0.0, "vertical.valve_delay": 0.0}), "valves with one delay"),
    ):
        plant = make_plant(other)
        with pytest.raises(ControllerError, match=message):
            lqg.init(plant, find_equilibrium(plant))


def test_a_name_in_place_of_settings_and_of_a_scale_is_refused_with_what_to_give():
    motion = find_motion("sine", amplitude=0.01, cycles=1)
    with pytest.raises(SimulationError, match=r"settings are 'lhpost6'; give those of load_controller"):
        rehearse(load_machine(), make_target(motion, axes="x"), "lhpost6", attrs={})
    with pytest.raises(MotionError, match="scale is 'a'; give a finite number"):
        make_target(motion, scale="a")

"""A table that is driven by hand: moves, programs, the drive, interlocks and the controller, without processes."""

import re
import threading
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from panel_table import Table

from lhpost6_pin.control import load_controller
from lhpost6_pin.control.plug import Feedback
from lhpost6_pin.core.errors import ControllerError, LhpostError, MotionError, OutOfRangeError
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.interfaces.link import (
    LinkClient,
    LinkMode,
    PlantState,
    Reading,
    ServedPlant,
    open_socket,
    serve,
)
from lhpost6_pin.mechanics.coupled import motion_of_numbers
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.instant import motion_at
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.panel.demand import check_program
from lhpost6_pin.panel.drive import Drive
from lhpost6_pin.panel.engine import Engine, Status
from lhpost6_pin.panel.interlocks import measured_motion
from lhpost6_pin.panel.moves import Moved, at_rest, move_to
from lhpost6_pin.panel.orders import Orders
from lhpost6_pin.panel.programs import Recorded, make_wave
from lhpost6_pin.panel.recording import record_of_rows
from lhpost6_pin.panel.reference import BLOCK, Reference
from lhpost6_pin.panel.ring import ROWS, Ring, RingReader
from lhpost6_pin.panel.rows import Rows
from lhpost6_pin.panel.timekeeping import Timekeeping
from lhpost6_pin.panel.worker import panel_numbers

GENERATOR = {"highest": 33.0, "reversal": 0.08}
NUMBERS = panel_numbers()
number = st.floats(-10.0, 10.0)


# --------------------------------------------------------------------------------------------- moves
@pytest.mark.fast
@given(st.tuples(number, number, number), number, st.floats(0.5, 5.0))
def test_a_move_begins_in_the_motion_that_it_takes_over_and_ends_at_rest_at_its_target(start, target, seconds):
    move = move_to(np.array([target]), 3.0, seconds, Moved(*(np.array([x]) for x in start)))
    first = move.at(np.array([3.0]))
    np.testing.assert_allclose(np.ravel(first), start, atol=1e-9 * max(1.0, *map(abs, start)))
    just = move.at(np.array([3.0 + seconds * (1.0 - 1e-12)]))  # the polynomial itself, not what follows it
    size = 1.0 + abs(target) + sum(abs(x) * seconds**k for k, x in enumerate(start))
    assert abs(just.value[0, 0] - target) < 1e-9 * size
    # the rate ends with its square, the acceleration linearly in what is left of the time
    assert abs(just.rate[0, 0]) * seconds < 1e-9 * size
    assert abs(just.acceleration[0, 0]) * seconds**2 < 1e-8 * size
    late = move.at(np.array([100.0]))
    assert late.value[0, 0] == target and late.rate[0, 0] == late.acceleration[0, 0] == 0.0


@pytest.mark.fast
def test_rates_of_a_move_are_the_derivatives_of_its_values():
    move = move_to(np.array([0.4, -1.0]), 1.0, 2.0, Moved(np.array([0.0, 1.0]), np.array([0.3, 0.0]), np.zeros(2)))
    time = np.linspace(1.0, 3.5, 5001)
    moved = move.at(time)
    for value, rate in ((moved.value, moved.rate), (moved.rate, moved.acceleration)):
        # where the move ends its third derivative falls from 60 times the way over seconds^3: half a step of it
        np.testing.assert_allclose(np.gradient(value, time, axis=0)[1:-1], rate[1:-1], atol=60 * 2.0 / 2.0**3 * 2.5e-4)


# --------------------------------------------------------------------------------------------- programs
@pytest.mark.fast
@pytest.mark.parametrize(
    "wave",
    [("sine", {}), ("triangle", {}), ("sweep", {"to": 8.0, "duration": 5.0}), ("sweep", {"to": 0.1, "duration": 5.0})],
)
def test_a_wave_of_unit_amplitude_has_its_own_derivatives(wave):
    kind, more = wave
    found = make_wave(kind, axes=(0, 5), frequency=1.0, **GENERATOR, **more)
    time = np.arange(0.0, 5.0, 1e-4)
    moved = found.at(time)
    assert not moved.value[:, [1, 2, 3, 4]].any() and np.array_equal(moved.value[:, 0], moved.value[:, 5])
    assert np.abs(moved.value[:, 0]).max() == pytest.approx(1.0, abs=1e-6)
    for value, rate in ((moved.value, moved.rate), (moved.rate, moved.acceleration)):
        scale = np.abs(rate[:, 0]).max()
        # central differences of the highest component, 33 Hz: (2 pi 33 step)^2 / 6
        np.testing.assert_allclose(np.gradient(value[:, 0], time)[1:-1], rate[1:-1, 0], atol=1e-4 * scale)


@pytest.mark.fast
def test_a_triangle_is_that_of_the_motions():
    """Of the library, which is made piece by piece: 0.2 m at 0.25 m/s and 3 m/s2 along x, turned round in 0.26 s."""
    amplitude, speed, acceleration = 0.2, 0.25, 3.0
    motion = make_target(
        find_motion("triangle", amplitude=amplitude, velocity=speed, corner_acceleration=acceleration, cycles=3),
        axes="x",
    )
    x = motion.displacement[:, 0]
    crossings = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0) & (motion.velocity[1:, 0] > 0.5 * speed))
    begin, end = crossings[-2], crossings[-1]  # a period in full swing
    period = (end - begin) / SAMPLE_RATE
    reversal = np.pi * speed / acceleration / period
    wave = make_wave("triangle", axes=(0,), frequency=1.0 / period, highest=400.0, reversal=reversal)
    share = -x[begin] / (x[begin + 1] - x[begin])  # of a sample, to the crossing
    found = wave.at((np.arange(end - begin) - share) / SAMPLE_RATE)
    # crossings are sought to a sample, so the period is off by up to one of it in 6,500: 0.25 m/s of 0.5 ms
    np.testing.assert_allclose(amplitude * found.value[:, 0], x[begin:end], atol=1.3e-4)
    # and the library samples velocities: at 36 m/s3, where a reversal begins, a shift of a sample and a half each way
    np.testing.assert_allclose(amplitude * found.acceleration[:, 0], motion.acceleration[begin:end, 0], atol=0.1)


@pytest.mark.fast
def test_a_sweep_ends_at_its_last_frequency():
    found = make_wave("sweep", axes=(0,), frequency=0.5, **GENERATOR, to=8.0, duration=20.0)
    rate, acceleration = (x[0, 0] for x in found.at(np.array([20.0]))[1:])
    value = found.at(np.array([20.0])).value[0, 0]
    assert np.hypot(rate, 0.0) == pytest.approx(2.0 * np.pi * 8.0 * np.sqrt(1.0 - value**2), rel=1e-6)
    assert np.isfinite(acceleration)


@pytest.mark.fast
@pytest.mark.parametrize(
    "wrong, why",
    [
        ({"wave": "square"}, "no wave named 'square'"),
        ({"axes": ()}, "needs an axis"),
        ({"frequency": 0.0}, "frequency of 0 Hz"),
        ({"frequency": 40.0}, "up to 33 Hz"),
        ({"cycles": -1.0}, "number of cycles of -1"),
        ({"wave": "sweep"}, "give all three"),
        ({"wave": "sweep", "to": 0.5, "duration": 3.0}, "give all three"),
        ({"wave": "sweep", "to": 2.0, "duration": float("inf")}, "duration of inf"),
    ],
)
def test_waves_that_cannot_be_are_refused_with_the_reason(wrong, why):
    given = {"wave": "sine", "axes": (0,), "frequency": 0.5, **GENERATOR} | wrong
    with pytest.raises(MotionError, match=why):
        make_wave(given.pop("wave"), **given)


def recorded(seconds: float = 4.0) -> Recorded:
    """A burst along x and z."""
    time = np.arange(round(seconds * SAMPLE_RATE) + 1) / SAMPLE_RATE
    w, t = 2.0 * np.pi * 1.5, time[:, None]
    ways = np.array([0.05, 0.0, 0.01, 0.0, 0.0, 0.0])
    window, slope = np.sin(np.pi * t / seconds) ** 4, 4.0 * np.pi / seconds
    s, c = np.sin(np.pi * t / seconds), np.cos(np.pi * t / seconds)
    first = slope * s**3 * c
    second = slope * np.pi / seconds * (3.0 * s**2 * c**2 - s**4)
    d = window * np.sin(w * t)
    v = first * np.sin(w * t) + window * w * np.cos(w * t)
    a = second * np.sin(w * t) + 2.0 * first * w * np.cos(w * t) - window * w**2 * np.sin(w * t)
    return Recorded("burst", d * ways, v * ways, a * ways)


@pytest.mark.fast
def test_a_recorded_motion_is_its_samples_and_smooth_between_them():
    program = recorded()
    at = program.at(np.arange(100) / SAMPLE_RATE)
    for found, own in zip(at, (program.displacement, program.velocity, program.acceleration), strict=True):
        np.testing.assert_allclose(found, own[:100], atol=1e-15)
    between = program.at((np.arange(2000) + 0.5) / SAMPLE_RATE)
    exact = recorded().at((np.arange(4000) + 1.0) / (2 * SAMPLE_RATE))
    assert np.abs(between.value - exact.value[::2]).max() < 1e-12
    assert program.duration == 4.0
    beyond = program.at(np.array([-1.0, 9.0]))
    np.testing.assert_allclose(beyond.value, program.displacement[[0, -1]], atol=1e-15)


# --------------------------------------------------------------------------------------------- the drive
def fly(drive: Drive, orders: dict[int, object], blocks: int) -> list[np.ndarray]:
    """Reference of so many blocks, with orders before some of them."""
    found = []
    for k in range(blocks):
        if k in orders:
            orders[k](k * BLOCK)
        found.append(drive.advance(k * BLOCK, BLOCK))
    return [np.concatenate(x) for x in zip(*found, strict=True)]


@pytest.mark.fast
def test_the_scale_of_a_motion_is_not_that_of_a_wave_after_it():
    """Recordings of sines at their full spans stated the scale 0.5 of an earthquake before them."""
    drive = Drive(NUMBERS, np.full(6, 1.0), np.zeros(6))
    drive.load(recorded(30.0), 0.5)
    assert drive.scale == 0.5
    drive.load(make_wave("sine", axes=(0,), frequency=0.7, **GENERATOR))
    assert drive.scale == 1.0


@pytest.mark.fast
@pytest.mark.parametrize("kind", ["wave", "motion"])
def test_the_reference_is_smooth_through_run_hold_span_setpoint_and_stop(kind):
    drive = Drive(NUMBERS, np.full(6, 1.0), np.zeros(6))
    program = make_wave("sine", axes=(0, 2), frequency=0.7, **GENERATOR) if kind == "wave" else recorded(30.0)
    drive.set_span(np.array([0.1, 0.0, 0.03, 0.0, 0.0, 0.0]), 0)
    drive.load(program)
    place = np.array([0.05, -0.02, 0.0, 0.0, 0.0, 0.01])
    orders = {
        4: drive.run,
        200: drive.hold,
        330: drive.run,
        460: lambda k: drive.set_span(np.array([0.05, 0.0, 0.06, 0.0, 0.0, 0.0]), k),
        470: lambda k: drive.set_scale(0.4, k),
        500: lambda k: drive.move_setpoint(place, k),
        520: lambda k: drive.move_setpoint(2.0 * place, k),  # within the move before
        700: drive.stop,
    }
    displacement, velocity, acceleration = fly(drive, orders, 1400)
    for value, rate in ((displacement, velocity), (velocity, acceleration)):
        slopes = np.gradient(value, 1.0 / SAMPLE_RATE, axis=0)
        # where moves begin and end the third derivative changes by about 1 m/s3: half a step of it
        assert np.abs(slopes - rate)[1:-1].max() < 0.5 / SAMPLE_RATE
    assert (
        np.abs(np.diff(acceleration, axis=0)).max() < 0.05
    )  # no jump: 1.5 Hz of 0.1 m change by 0.04 a sample at most
    np.testing.assert_allclose(displacement[-1], 2.0 * place, atol=1e-12)
    assert drive.state(1400 * BLOCK).state == "stopped"
    still = slice(330 * BLOCK - 50, 330 * BLOCK)  # held: two seconds are over
    assert np.abs(velocity[still]).max() == 0.0 and np.abs(displacement[still, 0]).max() > 0.0


@pytest.mark.fast
def test_a_block_that_is_prepared_is_the_one_that_is_computed_when_it_is_needed():
    """Bit by bit, whatever is ordered and missed between; until its first sample the drive is as before."""
    made = []
    for ahead in (False, True):
        drive = Drive(NUMBERS, np.full(6, 1.0), np.zeros(6))
        drive.set_span(np.full(6, 0.1), 0)
        reference = Reference(drive, lambda *moved: np.hstack(moved))
        drive.load(sine(frequency=0.7))
        found, states = [], []
        for k in [*range(1, 1000), *range(1003, 3000)]:
            moved, at, inputs = reference.at(k)
            assert np.array_equal(inputs[at], np.concatenate(moved))
            found.append(inputs[at])
            if ahead:
                reference.prepare(k + 1)
            states.append(reference.drive.state(k))
            for when, do in {64: Drive.run, 1500: Drive.hold, 1537: Drive.run, 2000: Drive.stop}.items():
                if k == when:
                    reference.changed()
                    do(reference.drive, reference.end)
        made.append((np.array(found), states))
    assert np.array_equal(made[0][0], made[1][0]) and made[0][1] == made[1][1]
    assert np.abs(made[0][0][:, :6]).max() > 0.09
    assert {state.state for state in made[0][1]} >= {"running", "holding", "stopping"}


@pytest.mark.fast
def test_a_wave_of_so_many_cycles_ends_by_itself_and_a_motion_at_its_end():
    for program in (make_wave("sine", axes=(1,), frequency=1.0, **GENERATOR, cycles=3.0), recorded()):
        drive = Drive(NUMBERS, np.full(6, 1.0), np.zeros(6))
        drive.set_span(np.full(6, 0.1), 0)
        drive.load(program)
        displacement, velocity, _ = fly(drive, {0: drive.run}, 900)
        assert drive.state(900 * BLOCK).state == "stopped"
        assert np.abs(displacement[-1]).max() < 1e-9 and not velocity[-1].any()
        drive.run(900 * BLOCK)  # once more, from its beginning
        assert drive.advance(900 * BLOCK, 2000).rate.any()


@pytest.mark.fast
def test_a_setpoint_is_approached_at_the_stated_share_of_the_velocity_limits():
    speed = np.array([3.0, 2.0, 0.45, np.inf, np.inf, np.inf])
    drive = Drive(NUMBERS, speed, np.zeros(6))
    drive.move_setpoint(np.array([0.8, 0.1, 0.1, 0.0, 0.0, 0.0]), 0)
    _, velocity, _ = fly(drive, {}, 2000)
    share = np.abs(velocity).max(axis=0)[:3] / speed[:3]
    assert share.max() == pytest.approx(NUMBERS.number("setpoint.speed"), rel=1e-4)  # of the slowest axis, at a sample


# --------------------------------------------------------------------------------------------- the controller
@pytest.fixture
def table(machine):
    found = Table(machine)
    found.do("pressure", to="high")
    return found


def sine(axis: int = 0, frequency: float = 0.5):
    return make_wave("sine", axes=(axis,), frequency=frequency, **GENERATOR)


@pytest.mark.slow
def test_a_wave_over_the_link_is_that_in_one_process_whatever_the_controller_s_delay(table, machine):
    """At nine tenths of real time, and by a controller that stalls: motion and rows are the same to the last bit."""
    table.do("span", axis=0, value=0.1)
    table.do("load", sine(frequency=1.0))
    table.do("run")
    table.step(1.5)
    rest = find_equilibrium(table.plant)
    for stall in (0.0, 0.003):
        served, stop = ServedPlant(table.plant, rest, LinkMode.REAL_TIME), threading.Event()
        engine, rows = Engine(table.plant, rest, load_controller("lhpost6"), NUMBERS, table.rows), []
        with open_socket(port=0) as sock:
            options = {"stop": stop, "pace": 0.9, "patience": 60.0}
            thread = threading.Thread(target=serve, args=(sock, served), kwargs=options)
            thread.start()
            with LinkClient(*sock.getsockname()) as client:
                readings = [client.reading]
                engine.answer(client.reading)
                for do, more in (("pressure", {"to": "high"}), ("span", {"axis": 0, "value": 0.1})):
                    engine.order({"do": do, **more})
                engine.order({"do": "load"}, sine(frequency=1.0))
                engine.order({"do": "run"})
                while len(rows) < len(table.recording.rows()):
                    for reading in readings:
                        client.send(engine.answer(reading))
                        rows.append(engine.row.copy())
                        time.sleep(stall * (reading.sample % 50 == 7))
                    readings = client.wait(1.0, poll=1e-4)
            stop.set()
            thread.join(60.0)
        found, names = np.array(rows)[: len(table.recording.rows())], table.rows
        for name in ("sample", "platen_displacement", "platen_acceleration", "actuator_force", "spool_command"):
            assert np.array_equal(names.of(found, name), table.of(name)), name
    assert np.abs(table.of("platen_displacement")[:, 0]).max() > 0.05


def test_what_is_prepared_between_samples_changes_no_row(machine):
    """Neither through a move and a wave, nor a trip amid a block and the start after it."""
    rows = []
    for prepare in (False, True):
        table = Table(machine)
        if prepare:
            answer = table.engine.answer
            table.engine.answer = lambda reading, a=answer, e=table.engine: (a(reading), e.row, e.prepare())[0]
        table.do("pressure", to="high")
        table.step(0.3)
        for do, more in (("setpoint", {"axis": 0, "value": 0.02}), ("span", {"axis": 0, "value": 0.1})):
            table.do(do, **more)
            table.step(1.01)
        table.do("load", sine(frequency=1.0))
        table.do("run")
        table.step(0.7)
        table.do("trip", who="a test")
        table.step(0.3)
        table.do("reset")
        table.step(0.5)
        rows.append(table.recording.rows())
    names = table.rows
    assert np.array_equal(*rows, equal_nan=True) and np.ptp(names.of(rows[0], "platen_displacement")[:, 0]) > 0.02


@pytest.mark.fast
def test_what_is_measured_is_the_motion_of_pose_and_twist():
    rng = np.random.default_rng(5)
    for _ in range(50):
        interface, force = rng.uniform(-0.5, 0.5, 18), rng.uniform(-1e6, 1e6, 10)
        sensors = Feedback(np.zeros(10), rng.uniform(-9.0, 9.0, 6), force)
        found = measured_motion(Reading(1, PlantState.RUNNING, sensors, 0, 0, interface))
        motion = motion_of_numbers(interface)
        # Pinocchio's way by matrices and back: roundings of numbers below 1
        for got, own in zip(found[:2], motion_at(motion.pose, motion.twist), strict=True):
            np.testing.assert_allclose(got, own, rtol=0.0, atol=1e-14)
        assert np.array_equal(found.acceleration, sensors.acceleration) and np.array_equal(found.force, force)


def test_the_platen_follows_a_wave_of_its_span_and_returns(table):
    table.do("span", axis=0, value=0.1)
    table.do("load", sine())
    table.do("run")
    table.step(4.5)
    x, wanted = table.of("platen_displacement")[:, 0], table.of("reference_displacement")[:, 0]
    assert np.abs(wanted).max() == pytest.approx(0.1, rel=1e-3)
    assert np.sqrt(np.mean((x - wanted) ** 2)) < 0.1 * np.sqrt(np.mean(wanted**2))  # as the report's tests track
    table.do("stop")
    table.step(4.5)
    assert abs(table.of("platen_displacement")[-1, 0]) < 1e-3 and table.engine.status.state == "stopped"
    record = record_of_rows(table.recording.rows(), table.rows, table.plant.machine, {"test": "by hand"})
    assert record.sizes["time"] == 9 * SAMPLE_RATE and record["answered"].values.all()
    np.testing.assert_array_equal(record["platen_displacement"].values[:, 0], table.of("platen_displacement")[:, 0])


@pytest.mark.parametrize(
    "name, limit, wave",
    [
        ("displacement", 0.05, sine()),
        ("velocity", 0.03, sine()),
        ("acceleration", 0.02, sine()),
        ("force", 0.02, sine()),
        ("overturning", 0.02, sine()),
        ("saturation", 0.5, None),
    ],
)
def test_an_interlock_trips_to_safe_hold_within_five_milliseconds(table, name, limit, wave):
    table.do("interlock", name=name, limit=limit)
    table.do("span", axis=0, value=0.1)
    if wave is None:  # a command that the valves cannot follow
        table.engine._interlocks._spool = 0.02
        wave = sine()
    table.do("load", wave)
    table.do("run")
    passed = None
    for _ in range(6 * SAMPLE_RATE):
        table.step()
        passed = table.reading.sample if table.engine.trip and passed is None else passed
        if table.served.state == PlantState.HOLD:
            break
    assert table.served.state == PlantState.HOLD and name in table.engine.trip
    shares = table.of("shares")
    k = ["displacement", "velocity", "acceleration", "force", "overturning", "saturation"].index(name)
    over = int(np.argmax(shares[:, k] > limit))  # the row in which it was seen
    assert (len(shares) - over) / SAMPLE_RATE <= 5e-3
    assert (shares[:over, k] <= limit).all()


def test_after_a_trip_the_platen_comes_to_rest_and_is_taken_over_where_it_is(table):
    table.do("span", axis=0, value=0.1)
    table.do("load", sine())
    table.do("run")
    table.step(2.6)
    table.do("trip", who="Anna")
    table.step(1.5)
    assert "by Anna" in table.engine.trip and table.served.state == PlantState.HOLD
    assert np.abs(table.of("platen_velocity")[-1, 0]) < 5e-3  # spools at rest: leaks and bias remain
    place = table.of("platen_displacement")[-1, 0]
    assert abs(place) > 0.01
    with pytest.raises(ControllerError, match="reset it first"):
        table.do("run")
    table.do("reset")
    begin = len(table.recording.rows())
    table.step(4.5)
    x, acceleration = table.of("platen_displacement")[begin:, 0], table.of("platen_acceleration")[begin:, :3]
    assert abs(x[0] - place) < 1e-3 and abs(x[-1]) < 1e-3
    # no jerk where the controller takes over: an approach of 0.1 m in 2 s has 0.15 m/s2, and friction breaks loose
    assert np.abs(acceleration).max() < 0.6
    assert table.served.state == PlantState.RUNNING and table.engine.status.trip == ""


def test_a_limit_that_is_still_passed_is_named_at_reset(table):
    table.do("setpoint", axis=0, value=0.1)
    table.step(3.0)
    table.do("interlock", name="displacement", limit=0.05)
    table.step(0.1)
    assert "displacement of x" in table.engine.trip
    with pytest.raises(ControllerError, match="still displacement of x") as caught:
        table.do("reset")
    enough = re.search(r"raise the displacement limit to at least (\d+) %$", str(caught.value))
    table.do("interlock", name="displacement", limit=0.01 * int(enough[1]))  # what it says is enough
    table.do("reset")
    table.step(0.1)
    assert table.engine.trip == ""


def test_orders_that_follow_each_other_at_once_keep_what_the_first_has_set(table):
    """A page knows the state only as of its last message."""
    for axis, value in ((0, 0.1), (2, 0.03)):
        table.do("span", axis=axis, value=value)
    for axis, value in ((1, 0.2), (5, 0.01)):
        table.do("setpoint", axis=axis, value=value)
    table.step(0.01)
    assert table.engine.status.span == (0.1, 0.0, 0.03, 0.0, 0.0, 0.0)
    assert table.engine.status.setpoint == (0.0, 0.2, 0.0, 0.0, 0.0, 0.01)


def test_orders_out_of_turn_are_refused_with_what_to_do(machine):
    table = Table(machine)
    for do, why in (("run", "pressure is not high"), ("hold", "nothing runs"), ("reset", "nothing has tripped")):
        with pytest.raises(ControllerError, match=why):
            table.do(do)
    with pytest.raises(ControllerError, match="no order 'jump'"):
        table.do("jump")
    table.do("pressure", to="high")
    with pytest.raises(ControllerError, match="no program"):
        table.do("run")
    with pytest.raises(ControllerError, match="above zero"):
        table.do("interlock", name="force", limit=0.0)
    table.do("load", sine())
    table.do("run")
    table.step(0.2)
    for do, more in (("load", {"program": sine()}), ("pressure", {"to": "off"})):
        with pytest.raises(ControllerError, match="stop it first"):
            table.do(do, **more)


def test_a_program_beyond_the_table_is_refused_before_it_runs(machine):
    plant = make_plant(machine)
    gain = np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
    check_program(plant, sine(), gain, np.zeros(6))
    with pytest.raises(OutOfRangeError, match="displacement"):
        check_program(plant, sine(), gain, np.array([0.7, 0.0, 0.0, 0.0, 0.0, 0.0]))
    with pytest.raises(OutOfRangeError, match="velocity"):
        check_program(plant, sine(frequency=3.0), gain, np.zeros(6))


def test_a_motion_is_loaded_at_its_own_scale_and_runs_by_its_number_alone(table):
    table.do("scale", value=1.0)
    table.do("load", recorded(), number=3, scale=0.2)
    with pytest.raises(ControllerError, match="another program is loaded meanwhile: burst"):
        table.do("run", number=2)
    table.do("run", number=3)
    table.step(0.2)
    assert table.engine.status.scale == 0.2 and table.engine.status.number == 3
    table.step(6.0)
    peak = 0.2 * np.abs(recorded().displacement[:, 0]).max()  # taken between samples: (pi 1.5 / 2048)^2 / 2 of it
    assert np.abs(table.of("reference_displacement")[:, 0]).max() == pytest.approx(peak, rel=1e-5)
    table.do("unload")
    assert table.engine.status.program is None and table.engine.status.number == 0
    with pytest.raises(ControllerError, match="no program"):
        table.do("run")


def test_the_platen_is_parked_or_raised_at_every_pressure(machine):
    low, high = Table(machine, parked=True), Table(machine)
    assert (low.engine.status.platen, high.engine.status.platen) == ("parked", "raised")
    low.do("pressure", to="high")
    assert low.engine.status.platen == "parked"
    low.step(1.0)
    low.do("raise")
    low.step(0.5)
    assert low.engine.status.platen == "moving"
    low.step(6.0)
    assert low.engine.status.platen == "raised"
    low.do("park")
    low.step(7.0)
    assert low.engine.status.platen == "parked"
    low.do("pressure", to="low")
    low.step(5.0)  # a hold in which it sinks a little
    assert low.engine.status.platen == "parked"


def test_a_program_is_checked_about_the_pose_in_which_it_would_run_not_about_the_parked_platen(machine, orders):
    table = Table(machine, parked=True)
    table.do("pressure", to="high")
    table.do("park")
    orders.program = sine()
    status = table.engine.status
    assert (status.platen, status.setpoint[2]) == ("moving", machine.platen.parked)
    message = {"axis": "x", "value": 0.1}
    try:
        assert orders.of("span", message, status)["value"] == 0.1
        with pytest.raises(OutOfRangeError, match="z displacement 120 mm"):  # a setpoint there stays refused
            orders.of("span", message, status._replace(base=status.setpoint))
    finally:
        orders.program = None
    table.do("raise")
    table.step(6.5)
    table.do("setpoint", axis=0, value=0.2)
    assert table.engine.status.base == (0.2, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.slow
def test_a_platen_that_trips_on_its_way_is_held_and_its_present_demand_is_live(machine):
    """Parked with an interlock that is lowered on the way; Reset leaves it there, Raise or Park goes on."""
    table = Table(machine, parked=True)
    table.do("pressure", to="high")
    table.do("raise")
    table.step(2.5)
    assert table.engine.status.platen == "moving"
    table.do("interlock", name="displacement", limit=0.3)
    table.step(0.01)
    assert "displacement of z" in table.engine.trip and table.engine.status.platen == "held"
    table.step(2.0)
    share, place = table.of("shares")[-1], table.of("platen_displacement")[-1]
    assert share[0] == pytest.approx(abs(place[2]) / machine.limits.displacement[2], rel=1e-9)
    assert share[1] < 0.02 and share[5] == 0.0  # it stands, and nothing is commanded
    with pytest.raises(ControllerError, match="still displacement of z"):
        table.do("reset")
    table.do("interlock", name="displacement", limit=0.99)
    table.do("reset")
    table.step(2.5)
    assert table.engine.status.platen == "held" and table.engine.status.base == (0.0,) * 6
    assert table.of("platen_displacement")[-1, 2] == pytest.approx(place[2], abs=1e-3)
    table.do("load", sine())
    with pytest.raises(ControllerError, match="held where it stopped; raise it first"):
        table.do("run")
    table.do("raise")
    table.step(6.0)
    assert table.engine.status.platen == "raised" and table.engine.trip == ""


@pytest.mark.slow
def test_interlocks_that_would_trip_park_raise_or_high_pressure_are_named_before(machine):
    """120 mm of 127 mm where it is parked; such a move takes a tenth of the velocity limit of z."""
    table = Table(machine, parked=True)
    table.do("interlock", name="displacement", limit=0.5)
    with pytest.raises(ControllerError, match="trips at 50 %; raise the displacement limit to at least 95 % first"):
        table.do("pressure", to="high")
    table.do("interlock", name="displacement", limit=0.95)
    table.do("pressure", to="high")
    table.do("interlock", name="velocity", limit=0.1)
    with pytest.raises(ControllerError, match=r"velocity of z .* raise the velocity limit to at least 11 % first"):
        table.do("raise")
    table.do("interlock", name="velocity", limit=0.11)
    assert table.engine.status.barred == ("", "")
    table.do("raise")
    table.step(7.0)
    table.do("interlock", name="displacement", limit=0.5)
    why = "displacement of z would reach 120 mm, 94.5 % of capacity, and the interlock trips at 50 %; "
    why += "raise the displacement limit to at least 95 % first"
    with pytest.raises(ControllerError) as caught:
        table.do("park")
    assert str(caught.value) == why == table.engine.status.barred[1] and table.engine.status.barred[0] == ""
    table.do("interlock", name="displacement", on=False)
    assert table.engine.status.barred == ("", "")
    table.do("interlock", name="displacement", on=True, limit=0.95)  # what it says is enough
    table.do("park")
    table.step(7.0)
    assert table.engine.status.platen == "parked" and table.engine.trip == ""


# --------------------------------------------------------------------------------------------- rows
@pytest.mark.fast
def test_a_ring_hands_over_every_row_once_and_counts_those_that_it_loses(tmp_path):
    ring, width = Ring(tmp_path / "ring", 3), 3
    reader = RingReader(tmp_path / "ring", width)
    for k in range(10):
        ring.write(np.full(width, float(k)))
    np.testing.assert_array_equal(reader.read()[:, 1], np.arange(10.0))
    assert reader.read().shape == (0, width) and reader.lost == 0
    for k in range(ROWS + 5):
        ring.write(np.full(width, float(k)))
    found = reader.read()
    assert len(found) == ROWS // 2 and reader.lost == ROWS + 5 - ROWS // 2
    np.testing.assert_array_equal(found[:, 0], np.arange(ROWS + 5 - ROWS // 2, ROWS + 5))


@pytest.mark.fast
def test_samples_that_were_missed_repeat_the_row_before_and_a_new_session_is_another_record(machine):
    layout = Rows(len(machine.actuators), len(machine.struts))
    rows = np.zeros((8, layout.width))
    rows[:, 0] = [0, 0, 1, 2, 5, 6, 0, 1]  # read twice before the first command; 3 and 4 missed; then another session
    rows[:, layout.places["platen_displacement"].start] = np.arange(8.0)
    record = record_of_rows(rows, layout, machine, {"test": "gaps"})
    assert record.sizes["time"] == 7
    assert record["answered"].values.tolist() == [1, 1, 1, 0, 0, 1, 1]
    assert record["platen_displacement"].values[:, 0].tolist() == [1.0, 2.0, 3.0, 3.0, 3.0, 4.0, 5.0]


@pytest.mark.fast
def test_samples_are_counted_that_are_missed_or_come_late():
    rows, rate = Rows(10, 3), SAMPLE_RATE * 0.5
    samples = np.r_[0:3000, 3010:6000]  # ten missed
    table = np.zeros((len(samples), rows.width))
    delay = 7.0 + 0.3 / rate * (samples % 2)  # [s] of the clock's origin, and a scatter of less than a sample
    delay[4000:4005] += 2.0 / rate
    table[:, 0], table[:, 1] = samples, PlantState.RUNNING
    table[:, rows.places["stamp"]] = (samples / rate + delay)[:, None]
    table[5000:5100, 1] = PlantState.HOLD
    found = Timekeeping(rows, 0.5)
    for part in np.array_split(table, 37):
        found.add(part)
    assert (found.answered, found.missed, found.late, found.holds) == (5989, 10, 5, 1)  # the first sample begins
    table[:, rows.places["stamp"]] *= 1.001  # a clock that is too slow
    found.add(table)
    assert found.late > 0.8 * len(samples) and found.share <= 1.0  # all but the first second of it


@pytest.mark.fast
def test_a_plant_that_waits_for_its_first_command_is_not_late():
    rows = Rows(10, 3)
    table = np.zeros((3001, rows.width))
    table[1:, 0], table[1:, 1] = np.arange(3000), PlantState.RUNNING
    table[1:, rows.places["stamp"]] = (5.0 + np.arange(3000) / SAMPLE_RATE)[:, None]  # [s] after high pressure
    found = Timekeeping(rows, 1.0)
    for part in np.array_split(table, 37):
        found.add(part)
    assert (found.missed, found.late) == (0, 0)


@pytest.mark.fast
def test_moves_at_rest_stay():
    assert np.array_equal(at_rest(np.array([1.0, 2.0]), 5.0).at(np.array([0.0, 5.0, 9.0])).value, [[1.0, 2.0]] * 3)


# --------------------------------------------------------------------------------------------- orders
STATUS = Status(
    "high", "raised", "", None, "stopped", None, (0.0,) * 6, (0.1,) * 6, 1.0, (1.0,) * 6, (True,) * 6, ("",) * 6
)
plain = (
    st.none() | st.booleans() | st.integers(-9, 9) | st.floats() | st.text(max_size=6) | st.sampled_from(["x", "sine"])
)
keys = st.sampled_from(["to", "axis", "value", "wave", "frequency", "cycles", "axes", "name", "limit", "on", "where"])


@pytest.fixture(scope="module")
def orders(machine, tmp_path_factory):
    return Orders(machine, NUMBERS, tmp_path_factory.mktemp("orders"))


@given(
    st.sampled_from(["pressure", "setpoint", "span", "scale", "generator", "interlock", "fault", "run", "jump"]),
    st.dictionaries(keys, plain | st.lists(plain, max_size=3), max_size=5),
    st.sampled_from([STATUS, None]),
)
@settings(max_examples=200, deadline=None)
def test_whatever_a_browser_sends_is_an_order_or_refused(orders, do, message, status):
    try:
        chosen = do == "generator"
        order = orders.choose({"do": do, **message}, status, 1)[0] if chosen else orders.of(do, message, status)
    except (LhpostError, KeyError, TypeError, ValueError):  # what `Session.take` answers with a refusal
        return
    assert order["do"] in (do, "load") and isinstance(order["what"], str)
    if do in ("setpoint", "span"):
        assert order["axis"] in range(6) and np.isfinite(order["value"])


def motion(name: str, scale: float, **more) -> dict:
    return {"do": "motion", "name": name, "scale": scale, **more}


def test_a_motion_by_name_is_written_for_the_controller(orders):
    order, program = orders.choose(motion("ridgecrest-ccc", 0.3, axes="xy"), STATUS, 1)
    rows = np.load(order["file"], mmap_mode="r")
    assert rows.shape[::2] == (3, 6) and rows[0, :, :2].any() and not rows[0, :, 2:].any()
    assert (order["do"], order["number"], order["scale"], program.name) == ("load", 1, 0.3, "ridgecrest-ccc")
    with pytest.raises(OutOfRangeError, match="ridgecrest-ccc at scale 3 exceeds") as caught:
        orders.choose(motion("ridgecrest-ccc", 3.0), STATUS, 2)
    orders.choose(
        motion("ridgecrest-ccc", caught.value.largest_scale), STATUS, 3
    )  # as of the field, not of what it holds
    with pytest.raises(LhpostError, match="no ground motion named"):
        orders.choose(motion("../secret.csv", 1.0), STATUS, 4)
    with pytest.raises(ControllerError, match="pressure is off"):
        orders.choose(motion("ridgecrest-ccc", 1.0), None, 5)


def test_messages_are_in_the_units_of_the_fields(orders):
    """Limits of the report's Table 2.2: 0.89 m of x, 2.22 deg of roll."""
    for do, axis, value, why in (
        ("span", "roll", np.radians(20.0), "span of roll: 20 deg; the limit is 2.22 deg"),
        ("span", "x", 2.0, "span of x: 2000 mm; the limit is 890 mm"),
        ("setpoint", "z", 0.5, "setpoint of z: 500 mm; the limit is 127 mm"),
    ):
        with pytest.raises(ControllerError, match=f"^{why}$"):
            orders.of(do, {"axis": axis, "value": value}, STATUS)
    assert orders.of("span", {"axis": "x", "value": 0.1}, STATUS)["what"] == "sets the span of x to 100 mm"
    turned = orders.of("setpoint", {"axis": "yaw", "value": np.radians(-1.5)}, STATUS)
    assert turned["what"] == "sets the setpoint of yaw to -1.5 deg"


def test_a_refusal_for_capacity_is_in_the_units_of_the_page(machine):
    plant, gain = make_plant(machine), np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
    with pytest.raises(
        OutOfRangeError, match=r"x displacement 1000 mm against 890 mm less the reserve of 6 % at"
    ) as caught:
        check_program(plant, sine(), gain, np.array([0.7, 0.0, 0.0, 0.0, 0.0, 0.0]))
    for frequency in (3.0, 8.0):
        with pytest.raises(OutOfRangeError, match=r"acceleration [\d.]+ g against [\d.]+ g") as caught:
            check_program(plant, sine(frequency=frequency), 3.0 * gain, np.zeros(6))
        assert not re.search(r"\d (m|rad|rad/s|m/s\^2|rad/s\^2|N|N m)\b(?![/^])", str(caught.value)), caught.value


@pytest.mark.parametrize(
    "name, axis, share, words",
    [
        # 5 % of 0.89 m, of 2.22 deg, and a hundredth of the acceleration along x, in g
        ("displacement", 0, 0.05, r"displacement of x 4\d\.\d* mm, limit 44\.5 mm, at"),
        ("displacement", 3, 0.05, r"displacement of roll 0\.11\d* deg, limit 0\.111 deg, at"),
        ("acceleration", 0, 0.02, r"acceleration of x 0\.\d+ g, limit 0\.\d+ g, at"),
    ],
)
def test_a_trip_is_in_the_units_of_the_page(table, name, axis, share, words):
    table.do("interlock", name=name, limit=share)
    table.do("setpoint" if name == "displacement" else "span", axis=axis, value=0.1 if axis == 0 else 0.01)
    if name == "acceleration":
        table.do("load", sine(frequency=1.0))
        table.do("run")
    table.step(3.0)
    assert re.match(words, table.engine.trip), table.engine.trip

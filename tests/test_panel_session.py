"""The session of a panel without processes: what is chosen, checked, loaded and run, whenever browsers send it."""

from concurrent.futures import Executor, Future
from queue import SimpleQueue

import numpy as np
import pytest
from panel_table import Table

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import ControllerError
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.records import load_record
from lhpost6_pin.interfaces.link import PlantState
from lhpost6_pin.panel import session as session_module
from lhpost6_pin.panel.client import Client
from lhpost6_pin.panel.link_state import link_state
from lhpost6_pin.panel.recording import Recording
from lhpost6_pin.panel.ring import Ring
from lhpost6_pin.panel.session import Options, Session
from lhpost6_pin.panel.timekeeping import Timekeeping
from lhpost6_pin.panel.worker import Setup, panel_numbers, program_of, rows_of

MOTION = {"do": "motion", "name": "ridgecrest-ccc", "axes": "xyz"}
SINE = {"do": "generator", "wave": "sine", "frequency": 1.0, "axes": ["x"], "cycles": 2}


class Held(Executor):
    """What is submitted is made when it is released: a computer that is as slow as a test wants."""

    def __init__(self):
        self._tasks = []

    def submit(self, function, /, *args, **more):
        future = Future()
        self._tasks.append((future, function, args, more))
        return future

    def release(self):
        tasks, self._tasks = self._tasks, []
        for future, function, args, more in tasks:
            if future.set_running_or_notify_cancel():
                try:
                    future.set_result(function(*args, **more))
                except Exception as error:
                    future.set_exception(error)


class Control:
    """A controller in this process, with a table that is raised, at high pressure; orders are done when it is asked."""

    table: Table

    def __init__(self, setup):
        self._orders, self.alive = SimpleQueue(), True
        self._ring = Ring(setup.ring, self.table.rows.width)

    def order(self, order):
        self._orders.put(order)

    def news(self):
        found = [("status", self.table.engine.status)]
        while not self._orders.empty():
            order = self._orders.get()
            try:
                self.table.engine.order(order, program_of(order))
            except ControllerError as error:
                found.append(("refusal", (order, str(error))))
            else:
                found += [("status", self.table.engine.status), ("done", order)]
        return found

    def close(self):
        pass


class Panel:
    """A session with an operator, Anna, whose refusals are kept."""

    def __init__(self, machine, folder, monkeypatch):
        self.table, self.work, self.refusals, self.notices = Table(machine), Held(), [], []
        monkeypatch.setattr(Control, "table", self.table, raising=False)
        monkeypatch.setattr(session_module, "ControlProcess", Control)
        self.table.do("pressure", to="high")
        setup = Setup(machine, load_controller("lhpost6"), folder / "ring")
        self.session = Session(setup, folder, self.work, {}, Options(("nowhere", 1)))
        self.session.look()
        self.anna = Client("b1", self.refusals.append, self.notices.append)
        self.session.join(self.anna)
        self.take({"do": "name", "name": "Anna"}, {"do": "take"}, {"do": "span", "axis": "x", "value": 0.1})
        self.session.look()

    def take(self, *messages):
        for message in messages:
            self.session.take(self.anna, message)

    def pass_time(self, seconds):
        """The controller answers so many seconds of samples, and the session sees them."""
        first = len(self.table.recording.rows())
        self.table.step(seconds)
        for row in self.table.recording.rows()[first:]:
            self.session._control._ring.write(row)
        self.session.look()
        self.session.look()

    def refused(self, message, why):
        """Refused by the session at once, or by the controller."""
        count = len(self.refusals)
        self.take(message)
        self.session.look()
        assert len(self.refusals) == count + 1 and why in self.refusals[-1], self.refusals[count:]

    def load(self, message):
        """Choose a program, and wait until it is loaded or refused."""
        self.take(message)
        self.session.look()
        self.work.release()
        self.session.look()
        self.session.look()

    @property
    def state(self):
        return self.table.engine.status

    @property
    def log(self):
        return [entry["what"] for entry in self.session.journal.entries]


@pytest.fixture
def panel(machine, tmp_path, monkeypatch):
    return Panel(machine, tmp_path, monkeypatch)


def ran(panel):
    """A sine has run, and ended."""
    panel.load(SINE)
    panel.take({"do": "run"})
    panel.session.look()
    panel.table.step(7.0)
    panel.session.look()
    assert (panel.state.program, panel.state.state) == ("sine 1 Hz", "stopped") and panel.refusals == []


def test_run_at_once_after_a_choice_does_not_run_the_program_before(panel):
    ran(panel)
    panel.take({**MOTION, "scale": 0.1})
    for _ in range(3):  # before the controller has unloaded the sine, and while the motion is checked
        panel.refused({"do": "run"}, "ridgecrest-ccc is being checked; wait")
        assert panel.state.state == "stopped"
    assert panel.state.program is None and panel.session.choice.name == "ridgecrest-ccc"
    panel.work.release()
    panel.session.look()
    panel.session.look()
    assert panel.state.program == "ridgecrest-ccc" and panel.session.choice.name is None
    panel.take({"do": "run", "number": panel.state.number})
    panel.session.look()
    assert panel.state.state == "running" and panel.state.scale == 0.1
    assert panel.log[-2:] == ["loads ridgecrest-ccc at scale 0.1", "runs the program ridgecrest-ccc"]


def test_a_program_that_is_refused_leaves_nothing_loaded(panel):
    ran(panel)
    panel.load({**MOTION, "scale": 3.0})
    assert "ridgecrest-ccc at scale 3 exceeds the capacity" in panel.refusals[-1]
    assert panel.state.program is None and panel.session.choice.name is None
    panel.refused({"do": "run"}, "no program")
    panel.load({"do": "generator", "axes": ["x"]})
    assert "does not understand" in panel.refusals[-1] and panel.state.program is None


def test_a_program_that_runs_is_not_replaced(panel):
    panel.load(SINE)
    panel.take({"do": "run"}, {**MOTION, "scale": 0.1})  # the session does not know yet that it runs
    panel.session.look()
    assert panel.refusals == ["a program runs; stop it first"]
    assert (panel.state.program, panel.state.state, panel.session.choice.name) == ("sine 1 Hz", "running", None)
    panel.refused({"do": "span", "axis": "x", "value": 0.8}, "exceeds the capacity")  # of the sine, still
    assert "actuator velocity" in panel.refusals[-1] and "span that would fit: x 184 mm" in panel.refusals[-1]
    assert "--valves" not in panel.refusals[-1] and "flow_reading" not in panel.refusals[-1]  # which the page has not


def test_what_the_check_assumes_stays_until_it_ends(panel):
    panel.take({**MOTION, "scale": 0.1})
    for message in (
        {"do": "setpoint", "axis": "x", "value": 0.1},
        {"do": "span", "axis": "y", "value": 0.1},
        {"do": "scale", "value": 0.2},
        {"do": "park"},
    ):
        panel.refused(message, "ridgecrest-ccc is being checked; wait")
    assert panel.state.setpoint == (0.0,) * 6


def test_a_span_that_was_set_just_before_a_choice_counts_in_its_check(panel):
    panel.take({"do": "span", "axis": "x", "value": 0.8})
    panel.load(SINE)
    assert "exceeds the capacity" in panel.refusals[-1] and panel.state.program is None


@pytest.mark.parametrize("do", ["stop", "trip"])
def test_stop_and_trip_cancel_a_check(panel, do):
    panel.take({**MOTION, "scale": 0.1})
    panel.session.look()
    panel.take({"do": do})
    panel.work.release()
    panel.session.look()
    panel.session.look()
    assert panel.state.program is None and panel.session.choice.name is None


def test_the_last_of_two_choices_is_loaded(panel):
    panel.take({**MOTION, "scale": 3.0})
    panel.session.look()
    panel.load(SINE)
    assert (panel.state.program, panel.refusals) == ("sine 1 Hz", [])


def test_another_operator_runs_only_what_his_page_states(panel):
    panel.load(SINE)
    stated = panel.state.number
    panel.load({**SINE, "frequency": 0.5})
    panel.take({"do": "release"})
    said = []
    ben = Client("b2", said.append, said.append)
    panel.session.join(ben)
    for message in ({"do": "take"}, {"do": "run", "number": stated}):
        panel.session.take(ben, message)
    panel.session.look()
    assert said == ["another program is loaded meanwhile: sine 0.5 Hz; choose again"]
    assert panel.state.state == "stopped"


def test_a_browser_that_leaves_just_after_run_stops_the_program(panel):
    panel.load(SINE)
    panel.take({"do": "run"})
    panel.session.leave(panel.anna)  # before the session knows that it runs
    panel.session.look()
    assert panel.state.state == "stopping"


def running(panel, **more):
    panel.load({**SINE, **more})
    panel.take({"do": "run"})
    panel.session.look()
    panel.pass_time(3.0)
    assert panel.state.state == "running"


def ends(panel):
    return [f"{entry['who']}: {entry['what']}" for entry in panel.session.journal.entries if " ended " in entry["what"]]


def test_the_end_of_every_program_is_in_the_journal_with_its_cause(panel):
    running(panel)
    panel.pass_time(4.0)
    # two cycles take 3 s, since its clock takes 2 s to its rate, and 2 s to rest: the time in which the reference moves
    speed = np.abs(panel.table.of("reference_velocity")[:, 0])
    moving = np.ptp(np.flatnonzero(speed > 0.02 * speed.max())) / SAMPLE_RATE  # faster than the return to the setpoint
    assert moving == pytest.approx(5.0, abs=0.6)  # its first and last quarter of a second are slower than that
    assert ends(panel) == ["program: sine 1 Hz ended after 5.0 s: by itself"]
    running(panel, cycles=None)
    panel.take({"do": "stop"})
    panel.session.look()
    assert len(ends(panel)) == 1  # it returns to the setpoint first
    panel.pass_time(5.0)
    assert ends(panel)[1:] == ["program: sine 1 Hz ended after 5.0 s: stopped by Anna"]
    running(panel, cycles=None)
    panel.take({"do": "trip"})
    panel.session.look()
    panel.pass_time(0.1)
    assert ends(panel)[2:] == ["program: sine 1 Hz ended after 3.0 s: the table tripped"]
    panel.pass_time(1.0)
    assert len(ends(panel)) == 3


def test_an_operator_whose_connection_was_lost_is_informed_on_return(panel):
    panel.take({"do": "join", "key": "of Anna"})
    assert panel.notices == []
    running(panel)
    panel.session.leave(panel.anna)
    at = panel.session.journal.entries[-1]["time"]
    found = {number: [] for number in ("b2", "b3")}
    stranger, again = ((found[number], Client(number, print, found[number].append)) for number in found)
    for (_, client), key in ((stranger, "of Ben"), (again, "of Anna")):
        panel.session.join(client)
        panel.session.take(client, {"do": "join", "key": key})
    lost = f"Your connection was lost at {at}; the program sine 1 Hz was stopped, and "
    lost += "the controls are free: take them again."
    assert stranger[0] == [] and again[0] == [lost]
    panel.session.take(again[1], {"do": "join", "key": "of Anna"})
    assert again[0] == [lost]  # once: the page keeps it until it is dismissed


def test_a_page_that_is_back_before_its_loss_is_noticed_is_informed_too(panel):
    panel.take({"do": "join", "key": "of Anna"})
    notices = []
    again = Client("b2", notices.append, notices.append)
    panel.session.join(again)
    panel.session.take(again, {"do": "join", "key": "of Anna"})
    assert notices == []
    panel.session.leave(panel.anna)
    assert len(notices) == 1 and notices[0].endswith("; the controls are free: take them again.")


def test_who_released_the_controls_is_not_informed_of_a_loss_and_another_operator_is_named(panel):
    panel.take({"do": "join", "key": "of Anna"}, {"do": "release"})
    panel.session.leave(panel.anna)
    notices = []
    again, ben = (Client(number, notices.append, notices.append) for number in ("b2", "b3"))
    panel.session.join(again)
    panel.session.take(again, {"do": "join", "key": "of Anna"})
    assert notices == []
    panel.session.take(again, {"do": "take"})
    panel.session.leave(again)
    panel.session.join(ben)
    for message in ({"do": "name", "name": "Ben"}, {"do": "take"}, {"do": "join", "key": "of Anna"}):
        panel.session.take(ben, message)
    assert notices[0].endswith("; Ben has the controls now.")


def test_a_recording_is_listed_at_once_as_one_that_is_being_written(panel):
    panel.take({"do": "record", "on": True, "name": "long"})
    panel.pass_time(1.0)
    panel.take({"do": "record", "on": False})
    assert panel.session.writing == ["long"] and panel.session.recordings == []
    panel.take({"do": "record", "on": True, "name": "long"})  # not the name of the file that is to come
    assert panel.session.recording.name == "long-2"
    panel.work.release()
    assert panel.session.writing == [] and panel.session.recordings[0].endswith("long.nc")


def test_the_record_of_a_trip_states_it_in_its_own_time_also_after_a_reset(panel):
    running(panel, cycles=None)
    panel.take({"do": "record", "on": True, "name": "tripped"})
    panel.pass_time(0.5)
    panel.take({"do": "trip"})
    panel.session.look()
    panel.pass_time(1.0)
    panel.take({"do": "reset"})
    panel.session.look()
    assert not panel.state.trip
    panel.pass_time(0.5)
    panel.take({"do": "record", "on": False}, {"do": "record", "on": True, "name": "sound"})
    panel.pass_time(0.5)
    panel.take({"do": "record", "on": False})
    panel.work.release()
    record, sound = map(load_record, panel.session.recordings)
    assert record.attrs["trouble"] == "tripped at 0.500 s: by Anna" and sound.attrs["trouble"] == "none"
    held = np.flatnonzero(record["plant_state"].values == PlantState.HOLD)
    assert 0.5 * SAMPLE_RATE <= held[0] <= 0.5 * SAMPLE_RATE + 6  # within five samples
    warned = [str(f) for f in check_dataset(record) if f.severity == "warning" and not f.channel]
    assert warned == ["tripped at 0.500 s: by Anna (what follows is not the test's)"]


def test_a_recording_counts_trips_before_it_began_and_none_of_another_session(machine):
    rows = np.zeros((2000, rows_of(machine).width))
    rows[:, 0] = np.r_[500:2000, 0:500]
    recording = Recording("long")
    assert recording.trouble is None
    recording.trip(400, "force of H1 at 104.0 % of capacity, limit 100 %, at 0.195 s")
    recording.add(rows[:1500])
    why = "force of H1 at 104.0 % of capacity, limit 100 %"
    assert recording.trouble == f"tripped before the recording began: {why}"
    recording.trip(1524, "by Anna, at 0.744 s")
    assert recording.trouble == f"tripped before the recording began: {why}; 2 trips in all"
    recording.add(rows[1500:])
    recording.trip(499, "by Anna, at 0.244 s")
    assert recording.trouble == f"tripped before the recording began: {why}; 2 trips in all"


@pytest.mark.parametrize(
    ("late", "own", "text", "advice"),
    [
        (0.001, True, "✓ on time", ""),
        (0.012, True, "✓ 1.2 % late", ""),
        (0.9, True, "! slow computer: 90 % late", "close other programs, or start the panel with --pace 0.5."),
        (0.9, False, "! slow computer: 90 % late", "close other programs."),
    ],
)
def test_the_sign_of_the_link_follows_the_share_of_late_samples(machine, late, own, text, advice):
    time = Timekeeping(rows_of(machine), 1.0)
    time.answered, time.late = 10_000, round(10_000 * late)
    found = link_state("on", time, "of its own", own, panel_numbers())
    assert found["text"] == text and advice in found["title"] and ("too slow" in found["title"]) == bool(advice)
    assert link_state("lost", time, "of its own", own, panel_numbers())["text"].startswith("! lost, ")

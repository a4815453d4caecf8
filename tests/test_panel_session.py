"""The session of a panel without processes: what is chosen, checked, loaded and run, whenever browsers send it."""

from concurrent.futures import Executor, Future
from queue import SimpleQueue

import pytest
from panel_table import Table

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import ControllerError
from lhpost6_pin.panel import session as session_module
from lhpost6_pin.panel.client import Client
from lhpost6_pin.panel.ring import Ring
from lhpost6_pin.panel.session import Options, Session
from lhpost6_pin.panel.worker import Setup, program_of

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
        self.table, self.work, self.refusals = Table(machine), Held(), []
        monkeypatch.setattr(Control, "table", self.table, raising=False)
        monkeypatch.setattr(session_module, "ControlProcess", Control)
        self.table.do("pressure", to="high")
        setup = Setup(machine, load_controller("lhpost6"), folder / "ring")
        self.session = Session(setup, folder, self.work, {}, Options(("nowhere", 1)))
        self.session.look()
        self.anna = Client("b1", self.refusals.append)
        self.session.join(self.anna)
        self.take({"do": "name", "name": "Anna"}, {"do": "take"}, {"do": "span", "axis": "x", "value": 0.1})
        self.session.look()

    def take(self, *messages):
        for message in messages:
            self.session.take(self.anna, message)

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
    ben = Client("b2", said.append)
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

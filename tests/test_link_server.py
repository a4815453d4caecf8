"""Server and client over loopback: the run over the link is the run in one process; and who may connect, and how.

Nothing here depends on how fast things go: waits are guards against a hanging test.
"""

import math
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from unittest import mock

import numpy as np
import pinocchio as pin
import pytest
from commands import own_controller, refused
from run_cases import amid_ridgecrest, at_rest
from test_scripts import script

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.core.checksum import with_crc
from lhpost6_pin.core.errors import LinkError, SimulationError
from lhpost6_pin.data.records import load_record, save_record
from lhpost6_pin.interfaces.link import (
    HOST,
    Datagram,
    Kind,
    LinkClient,
    LinkMode,
    PlantState,
    ServedPlant,
    Timing,
    decode,
    encode,
    make_faults,
    open_socket,
    record_of_link_run,
    run_over_link,
    serve,
)
from lhpost6_pin.interfaces.link.clock import Histogram
from lhpost6_pin.interfaces.link.link_summary import link_entries, print_link, too_slow
from lhpost6_pin.interfaces.link.remote import LinkRun
from lhpost6_pin.interfaces.link.served import MISSED_FRAMES
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.coupled import BaseMotion
from lhpost6_pin.mechanics.equilibrium import find_equilibrium, parked_pose
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.pose import platen_motion
from lhpost6_pin.simulation.running import RunningPlant
from lhpost6_pin.simulation.simulate import ClosedLoop, PluggedLoop, simulate

pytestmark = pytest.mark.long

MODES = list(LinkMode)
MOVING = [LinkMode.REAL_TIME, LinkMode.FREE]
GUARD = 60.0  # [s] no wait is meant to last so long


@contextmanager
def served(plant, rest, mode=LinkMode.LOCK_STEP, **options):
    """Serve a plant in a thread; yields the served plant and its address."""
    table, stop = ServedPlant(plant, rest, mode, faults=options.pop("faults", None)), threading.Event()
    with open_socket(port=0) as sock:
        thread = threading.Thread(target=serve, args=(sock, table), kwargs={"stop": stop, **options})
        thread.start()
        try:
            yield table, sock.getsockname()
        finally:
            stop.set()
            thread.join(GUARD)
    assert not thread.is_alive()


class Proportional:
    """A user's own controller: the actuators' displacement from what leg 1 should do, as a spool."""

    def init(self, plant, rest):
        return rest.spool

    def step(self, memory, wanted, sensors):
        spool = memory.copy()
        spool[:4] += 2.0 * (wanted.displacement[0] - sensors.displacement[:4] * np.array([1, 1, -1, -1]))
        return spool


class Wild(Proportional):
    """A controller that opens all vertical valves."""

    def step(self, memory, wanted, sensors):
        return np.r_[np.zeros(4), np.ones(6)]


def wanted(samples, size=0.02):
    """A smooth start of a motion along X: displacement, velocity, acceleration."""
    t = np.arange(samples) / 2048
    x = np.zeros((3, samples, 6))
    x[0, :, 0], x[1, :, 0], x[2, :, 0] = size * t**2, 2 * size * t, 2 * size
    return x


def test_a_clock_that_waits_delays_the_plant_in_place_of_its_hold(plant, rest):
    """A client that stops for 20 ms, forty samples, now and then, and for two in between: nothing of it is seen."""
    counts, commands = {}, rest.spool + 0.02 * np.sin(0.1 * np.arange(120))[:, None]
    for patience in (0.0, GUARD):
        served_plant = served(plant, rest, LinkMode.REAL_TIME, patience=patience)
        with served_plant as (_, address), LinkClient(*address) as client:
            found = []
            for k, command in enumerate(commands):
                found.append(client.exchange(command).sensors.displacement)
                time.sleep(0.02 if k % 20 == 19 else 0.001 * (k % 2))
            counts[patience] = client.close()
    own, wanted = RunningPlant(plant, rest), []
    for command in commands:
        own.advance(command)
        wanted.append(own.sensors().displacement)
    assert counts[0.0]["holds"] > 0 and counts[0.0]["missed_frames"] > 100
    assert counts[GUARD]["holds"] == counts[GUARD]["missed_frames"] == counts[GUARD]["superseded"] == 0
    assert np.array_equal(found, wanted)  # sample for sample what was commanded


def test_a_clock_that_waits_comes_to_its_hold_once_the_client_is_silent_or_states_that_it_commands_no_more(plant, rest):
    for patience, keeps in ((0.05, False), (GUARD, True)):
        served_plant = served(plant, rest, LinkMode.REAL_TIME, patience=patience)
        with served_plant as (_, address), LinkClient(*address) as client:
            for _ in range(10):
                client.exchange(rest.spool)
            if keeps:
                client.keep()
            end, found = time.monotonic() + 0.5 * GUARD, [client.reading]
            while found[-1].state != PlantState.HOLD:
                assert time.monotonic() < end
                found += client.wait(GUARD)
            first = next(reading.sample for reading in found if reading.state == PlantState.HOLD)
            assert first - 10 == MISSED_FRAMES  # 2.4 ms of its own time


# -------------------------------------------------------------------------------------------------- the same run
def test_the_closed_loop_over_udp_is_the_loop_in_one_process_sample_for_sample(plant, rest, tmp_path):
    loop = amid_ridgecrest(plant, rest, 1500)
    with served(plant, rest) as (_, address), LinkClient(*address) as client:
        run = run_over_link(client, plant, loop)
        counts = client.close()
    alone = simulate(plant, loop, samples=1500)
    assert np.ptp(alone.command, axis=0).min() > 1e-3  # it moves
    assert np.array_equal(run.command, alone.command)
    assert counts["samples"] == 1500 and run.answered.all() and not run.tripped
    assert counts["lost"] == counts["late"] == counts["malformed"] == counts["foreign"] == 0
    assert run.trouble is None
    moved = platen_motion(plant, alone.q, alone.v, alone.a)
    record = record_of_link_run(run, plant, {"test": "link"}, moved)
    for name in ("displacement", "velocity"):  # as they travel: Euler angles, and the twist at C in platen axes
        found, own = record[f"platen_{name}"].values, getattr(moved, name)
        np.testing.assert_allclose(found, own, rtol=0.0, atol=1e-12 * np.abs(own).max())
        assert np.array_equal(record[f"reference_{name}"].values, own)
    save_record(record, tmp_path / "record.nc")
    again = load_record(tmp_path / "record.nc", {"actuator": plant.machine.actuator_names})
    assert np.array_equal(again["spool_command"].values, alone.command)
    assert again.attrs["sample_rate_hz"] == 2048


def test_lost_and_repeated_datagrams_change_nothing_in_lock_step(plant, rest, monkeypatch):
    loop = amid_ridgecrest(plant, rest, 200)
    sent = [0]
    put, get = LinkClient._put, LinkClient._get

    def lossy_put(self, frame):
        sent[0] += 1
        if frame.kind == Kind.HELLO or sent[0] % 20:
            put(self, frame)
        if sent[0] % 30 == 0:
            put(self, frame)  # or twice

    def lossy_get(self, timeout):
        frame = get(self, timeout)
        lose = frame is not None and frame.kind == Kind.SENSORS and sent[0] % 27 == 0
        if lose:
            sent[0] += 1
        return None if lose else frame

    with served(plant, rest) as (_, address), LinkClient(*address, timeout=0.05, tries=200) as client:
        monkeypatch.setattr(LinkClient, "_put", lossy_put)
        monkeypatch.setattr(LinkClient, "_get", lossy_get)
        run = run_over_link(client, plant, loop)
        monkeypatch.undo()
        counts = client.close()
    assert np.array_equal(run.command, simulate(plant, loop, samples=200).command)
    assert client.resent >= 5 and counts["duplicate"] >= 5
    assert counts["samples"] == 200 and counts["lost"] == 0


def test_a_users_own_controller_runs_over_the_link_as_in_one_process(plant, rest):
    loop = PluggedLoop(Proportional(), *wanted(300), rest)
    with served(plant, rest) as (_, address), LinkClient(*address) as client:
        run = run_over_link(client, plant, loop)
    assert np.array_equal(run.command, simulate(plant, loop, samples=300).command)


def test_two_valves_on_each_horizontal_actuator_take_fourteen_commands_and_move_the_same_plant():
    twin, rest = at_rest(load_machine().with_valves(2))
    loop = amid_ridgecrest(twin, rest, 200)
    with served(twin, rest) as (_, address), LinkClient(*address) as client:
        assert client.valves[:4] == ("H1A", "H1B", "H2A", "H2B") and len(client.valves) == 14
        run = run_over_link(client, twin, loop)
    assert np.array_equal(run.command, simulate(twin, loop, samples=200).command)


@pytest.mark.parametrize("mode", MOVING)
def test_a_plant_that_moves_by_itself_is_driven_to_the_end_and_every_sample_is_accounted_for(plant, rest, mode):
    loop = PluggedLoop(Proportional(), *wanted(400), rest)
    with served(plant, rest, mode) as (_, address), LinkClient(*address) as client:
        run = run_over_link(client, plant, loop)
        last, counts = client.reading, client.close()
    assert last.sample >= 400 and counts["samples"] >= last.sample
    assert len(run.command) == int(np.flatnonzero(run.answered)[-1]) + 1 <= 400
    commands = int(run.answered.sum())
    assert 0 <= counts["received"] - commands - 1 <= client.resent  # and one bye, and what was said twice
    used = counts["samples"] - counts["missed_frames"]
    assert 0 <= commands - counts["superseded"] - used <= 1  # one may not have had its sample yet
    held = np.flatnonzero(~run.answered)
    assert np.array_equal(run.command[held], run.command[held - 1])


@pytest.mark.parametrize(
    ("holding", "silent", "trouble"),
    [
        ((), (), None),
        ((), range(100, 104), None),  # four missed samples are bridged
        ((), range(100, 105), "lost its commands: 1 safe hold, the first at 0.0488 s"),
        (range(500, 600), (), "lost its commands: 1 safe hold, the first at 0.2441 s"),
        (
            range(500, 600),
            (*range(300, 350), *range(490, 500)),
            "lost its commands: 2 safe holds, the first at 0.1465 s",
        ),
    ],
)
def test_a_run_that_went_to_its_safe_hold_is_in_trouble(plant, rest, holding, silent, trouble):
    n, none = 1000, np.zeros((1000, 10))
    state, answered = np.full(n, PlantState.RUNNING, np.int8), np.ones(n, bool)
    state[list(holding)], answered[list(silent)] = PlantState.HOLD, False
    still = BaseMotion(pin.SE3.Identity(), pin.Motion.Zero(), pin.Motion.Zero())
    run = LinkRun(none, none, np.zeros((n, 6)), [still] * n, none, state, answered, False, 1.0)
    assert (run.trouble or "none").partition(";")[0] == (trouble or "none")
    assert record_of_link_run(run, plant, {}).attrs["trouble"] == (run.trouble or "none")


def test_the_verdict_counts_the_safe_holds_that_the_server_counted(plant):
    """The controller misses those that end before the next sensors come."""
    n, none = 1000, np.zeros((1000, 10))
    state = np.full(n, PlantState.RUNNING, np.int8)
    still = BaseMotion(pin.SE3.Identity(), pin.Motion.Zero(), pin.Motion.Zero())
    run = LinkRun(none, none, np.zeros((n, 6)), [still] * n, none, state, np.ones(n, bool), False, 1.0, holds=3)
    assert run.trouble is None  # after its end, when commands stop
    state[500:600] = PlantState.HOLD
    assert "3 safe holds, the first at 0.2441 s" in (run.trouble or "")


def test_a_server_that_is_lost_in_mid_run_leaves_the_run_up_to_there(plant, rest):
    samples, stop = 400, 150
    with served(plant, rest) as (table, address):
        client = LinkClient(*address, timeout=0.01, tries=3)
        receive = table.receive

        def until(datagram, sender, at):
            return receive(datagram, sender, at) if table.sample < stop else []

        table.receive = until
        with client:
            run = run_over_link(client, plant, PluggedLoop(Proportional(), *wanted(samples), rest))
    # the command of the last sample was given; sensors after it never came
    assert len(run.answered) == stop + 1 and run.answered.all()
    trouble = (
        f"lost the server at {len(run.answered) / 2048:.4f} s: {address[0]}:{address[1]} answered up to sample {stop}"
    )
    assert (run.trouble or "").startswith(trouble) and "start the plant" not in run.trouble
    record = record_of_link_run(run, plant, {})
    assert record.sizes["time"] == stop + 1 and record.attrs["trouble"] == run.trouble


@pytest.mark.parametrize(("missed", "said"), [(0, False), (5, False), (500, True)])
def test_a_computer_too_slow_for_real_time_is_said_to_be(capsys, missed, said):
    counts = {"samples": 1000, "missed_deadlines": missed}
    print_link("table", counts, {})
    assert ("too slow for real time: 50 % of the samples" in " ".join(capsys.readouterr().out.split())) == said
    assert link_entries(counts, {})["too_slow"] == said
    assert too_slow({}) == ""


def test_a_trip_ends_the_run_and_the_next_client_finds_the_plant_at_rest(plant, rest):
    loop = PluggedLoop(Wild(), *wanted(8000), rest)
    with served(plant, rest) as (_, address):
        with LinkClient(*address) as client:
            run = run_over_link(client, plant, loop)
            assert client.reading.state == PlantState.TRIPPED
        assert run.tripped and 10 < len(run.command) < 8000
        assert (
            record_of_link_run(run, plant, {})
            .attrs["trouble"]
            .startswith(f"stopped at {len(run.command) / 2048:.4f} s: the plant tripped")
        )
        with LinkClient(*address) as client:
            assert client.reading.sample == 0 and client.reading.state == PlantState.WAITING


@pytest.mark.parametrize("mode", MOVING)
def test_a_client_hears_of_a_trip_although_the_samples_stand(plant, rest, mode):
    with served(plant, rest, mode) as (table, address), LinkClient(*address) as client:
        client.exchange(rest.spool)
        table.state = PlantState.TRIPPED
        while client.exchange(rest.spool).state != PlantState.TRIPPED:
            pass  # sensors that were on their way
        assert client.exchange(rest.spool).sample == client.reading.sample


def test_the_newest_sensors_can_be_had_without_waiting(plant, rest):
    with served(plant, rest, LinkMode.REAL_TIME) as (_, address), LinkClient(*address) as client:
        assert client.newest() is None  # the plant waits for its first command
        client.send(rest.spool)
        while (found := client.newest()) is None:
            pass
        assert found is client.reading and found.sample >= 1


# ---------------------------------------------------------------------------------------- pressures, faults, parked
@pytest.mark.parametrize("mode", MODES)
def test_a_client_that_asks_for_pressures_reads_them_and_another_does_not(plant, rest, mode):
    with served(plant, rest, mode) as (_, address):
        with LinkClient(*address, pressures=True) as client:
            for _ in range(3):
                found, area = client.reading.pressures, plant.machine.actuators[0].area_a
                force = found.a[0] * area - found.b[0] * plant.machine.actuators[0].area_b
                # the same products: rounding of 4 MN
                assert force == pytest.approx(client.reading.sensors.force[0], rel=1e-12, abs=1e-6)
                assert [len(x) for x in found[:4]] == [10, 10, 10, 3] and not found.b[4:].any()
                assert found.supply == plant.supply.pressure
                client.exchange(rest.spool + 0.01)
            assert client.reading.motion.pose.translation.shape == (3,)
        with LinkClient(*address) as client:
            assert client.reading.pressures is None and client.exchange(rest.spool).pressures is None


def test_a_client_that_asks_a_server_that_knows_neither_pressures_nor_faults_goes_without(plant, rest, monkeypatch):
    """Such a server overlooks the bit and counts a switch as malformed."""
    answer = ServedPlant.receive

    def older(self, datagram, sender, now):
        if datagram[5] == Kind.SWITCH:
            self.counts["malformed"] += 1
            return []
        return answer(self, with_crc(datagram[:10] + b"\1\0" + datagram[12:], 40), sender, now)

    monkeypatch.setattr(ServedPlant, "receive", older)
    with served(plant, rest) as (_, address), LinkClient(*address, pressures=True) as client:
        client.ask_faults()
        assert client.exchange(rest.spool).pressures is None and client.faults == {}
        assert client.close()["malformed"] == 1


@pytest.mark.parametrize("mode", MODES)
def test_a_client_switches_faults_and_is_told_which_are_on(plant, rest, mode):
    offered = make_faults(plant.machine, ["local_viscous@H1", "piston_leakage"])
    with served(plant, rest, mode, faults=offered) as (table, address), LinkClient(*address) as client:
        assert client.faults == {}
        client.ask_faults()
        while len(client.faults) < 2:
            client.exchange(rest.spool)
        assert client.faults == {"local_viscous@H1": False, "piston_leakage": False}
        client.switch("piston_leakage", True)
        while not client.faults["piston_leakage"]:
            client.exchange(rest.spool)
        assert table.fault == "piston_leakage" and not client.faults["local_viscous@H1"]
        client.switch("dust", True)
        client.switch("piston_leakage", False)
        while client.faults["piston_leakage"]:
            client.exchange(rest.spool)
        assert table.fault == "" and client.ignored == 0
        with pytest.raises(LinkError, match="at most 39 bytes"):
            client.switch("x" * 40, True)


def test_a_run_over_the_link_does_not_begin_at_a_parked_platen(plant):
    parked = find_equilibrium(plant, parked_pose(plant.machine))
    with served(plant, parked) as (_, address), LinkClient(*address) as client:
        low = client.reading.motion.pose.translation
        assert low == pytest.approx([0.0, 0.0, plant.machine.platen.parked], abs=1e-12)  # rounding of a metre
        with pytest.raises(LinkError, match=r"platen is parked.*without --parked"):
            run_over_link(client, plant, PluggedLoop(Proportional(), *wanted(10), parked))


# ------------------------------------------------------------------------------------------------ who may connect
def test_nothing_listens_beyond_this_computer_unless_asked():
    assert HOST == "127.0.0.1"
    with open_socket(port=0) as sock:
        assert sock.getsockname()[0] == "127.0.0.1"
    with open_socket("0.0.0.0", 0) as sock:
        assert sock.getsockname()[0] == "0.0.0.0"


@pytest.mark.parametrize("host, port", [(None, None), ("no.such.host.invalid", 0), ("127.0.0.1", 70000)])
def test_an_address_that_cannot_be_had_is_named(host, port):
    with open_socket(port=0) as taken:
        address = taken.getsockname() if host is None else (host, port)
        with pytest.raises(LinkError, match=f"{address[0]}:{address[1]}.*--port"):
            open_socket(*address)


def test_a_client_that_nobody_answers_says_so():
    with open_socket(port=0) as silent:
        where = silent.getsockname()
        with pytest.raises(LinkError, match="lhpost6 serve"):
            LinkClient(*where, timeout=0.01, tries=2)
    with pytest.raises(LinkError, match="lhpost6 serve"):  # nor anybody listens
        LinkClient(*where, timeout=0.01, tries=2)
    with pytest.raises(LinkError, match=r"no\.such\.host\.invalid:1 cannot be reached"):
        LinkClient("no.such.host.invalid", 1)


@pytest.mark.parametrize("mode", MODES)
def test_one_client_at_a_time_has_the_plant(plant, rest, mode):
    with served(plant, rest, mode) as (_, address):
        with LinkClient(*address) as first:
            first.exchange(rest.spool)
            with pytest.raises(LinkError, match="another client"):
                LinkClient(*address, timeout=0.01, tries=2)
            assert first.exchange(rest.spool).sample >= 2
            assert first.close()["foreign"] == 2
            assert first.close() == {}  # said already
        with LinkClient(*address) as second:
            assert second.reading.sample == 0


@pytest.mark.parametrize("mode", MODES)
def test_noise_from_the_network_stops_neither_server_nor_client(plant, rest, mode):
    rng = np.random.default_rng(1)
    with served(plant, rest, mode) as (_, address), LinkClient(*address) as client:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as noisy:
            for size in (0, 1, 47, 48, 128, 3000):
                noisy.sendto(rng.bytes(size), address)
        assert client.exchange(rest.spool).sample >= 1
        counts = client.close()
    assert counts["short"] == 3 and counts["malformed"] == 3


def test_a_server_that_falls_silent_ends_the_run_with_its_address(plant, rest):
    with served(plant, rest) as (_, address):
        client = LinkClient(*address, timeout=0.01, tries=3)
    with client, pytest.raises(LinkError, match=f"{address[0]}:{address[1]} did not answer"):
        client.exchange(rest.spool)


@pytest.mark.parametrize("mode", MODES)
def test_a_server_ends_when_its_time_is_over_or_by_the_keyboard_and_keeps_its_counts(plant, rest, mode, monkeypatch):
    table = ServedPlant(plant, rest, mode)
    with open_socket(port=0) as sock:
        assert serve(sock, table, seconds=0.05).lateness.count == 0  # nobody came: no sample, no deadline
        monkeypatch.setattr(table, "watch", mock.Mock(side_effect=KeyboardInterrupt))
        assert serve(sock, table).lateness.count == 0
        for seconds in (-1.0, math.nan, math.inf):
            with pytest.raises(LinkError, match="cannot be served for"):
                serve(sock, table, seconds=seconds)


def test_a_run_over_the_link_refuses_a_drive_of_another_width(plant, rest):
    loop = make_controller(plant, rest, load_controller("lhpost6"))
    with served(plant, rest) as (_, where), LinkClient(*where) as client:
        with pytest.raises(SimulationError, match=r"drive has shape \(8, 3\); \(8, 6\) is needed"):
            run_over_link(client, plant, ClosedLoop(loop, np.zeros((8, 3)), rest))


# ---------------------------------------------------------------------------------------- controller and plant alike
def test_a_controller_for_another_machine_and_a_plant_not_at_rest_are_refused(plant, rest):
    loop = PluggedLoop(Proportional(), *wanted(10), rest)
    twin = make_plant(load_machine().with_valves(2))
    with served(plant, rest) as (_, address), LinkClient(*address) as client:
        with pytest.raises(LinkError, match="10 servovalves open, the controller's 14"):
            run_over_link(client, twin, loop)
        client.machine = "another"
        with pytest.raises(LinkError, match="server's machine is another"):
            run_over_link(client, plant, loop)
        client.machine = plant.machine.name
        client.exchange(rest.spool)
        with pytest.raises(LinkError, match="connect again"):
            run_over_link(client, plant, loop)


def test_commands_may_be_given_per_actuator_or_per_valve_and_in_no_other_number(plant):
    twin, rest = at_rest(load_machine().with_valves(2))
    with served(twin, rest) as (table, address), LinkClient(*address) as client:
        client.exchange(np.full(10, 0.1))
        assert np.array_equal(table.spool, np.full(10, 0.1))
        client.exchange(np.full(14, 0.2))
        assert np.array_equal(table.spool, np.full(10, 0.2))
        with pytest.raises(LinkError, match=r"shape \(12,\).*10 actuators and 14 servovalves"):
            client.send(np.zeros(12))


SERVE = "from lhpost6_pin.cli import main; import sys; sys.argv[1:] = {!r}; main()"
SHORT = "sine --scale 0.2 --set amplitude=0.02 --set cycles=0.5 --set ramp_cycles=0.5 --set period=1".split()


@pytest.fixture
def port(plant, rest):
    """Port of a plant served in lock-step by a thread."""
    with served(plant, rest) as (_, address):
        yield address[1]


@pytest.mark.parametrize("mode", [m.label for m in LinkMode])
def test_a_server_says_where_it_listens_and_what_it_met(lhpost6, mode):
    ended = lhpost6("serve", "--mode", mode, "--port", 0, "--seconds", 0.05)
    assert ended.code == 0
    assert "listens at 127.0.0.1:" in ended.words and f", {mode}; Ctrl-C ends" in ended.words
    assert "missed deadlines" in ended.words and "malformed" in ended.words


def test_a_parked_table_with_faults_is_served_from_the_command_line(lhpost6, monkeypatch):
    made, none = [], Timing(Histogram(), Histogram())
    monkeypatch.setattr("lhpost6_pin.interfaces.link.serve", lambda sock, table, **_: made.append(table) or none)
    given = ("--parked", "--fault", "entrained_air@H1", "--fault", "piston_leakage@V1,V2")
    ended = lhpost6("serve", *given, "--port", 0, "--seconds", 0, "--json")
    assert ended.code == 0, ended
    (table,) = made
    assert list(table.faults) == ["entrained_air@H1", "piston_leakage@V1,V2"] and table.fault == ""
    hello = decode(table.receive(encode(Datagram(Kind.HELLO, 1)), "a", 0)[1])
    assert hello.numbers[6 + 4 : 6 + 10] == pytest.approx(np.full(6, -0.12), abs=1e-9)  # rounding of metres


def test_a_motion_runs_across_processes_and_leaves_its_record(tmp_path, lhpost6, brief):
    command = [sys.executable, "-c", SERVE.format(["serve", "--port", "0", "--seconds", str(GUARD)])]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            where = server.stdout.readline()
            port = where.split("127.0.0.1:")[1].split(",")[0]
            ended = lhpost6("link", *SHORT, "--port", port, "--out", tmp_path / "out")
        finally:
            server.kill()
    assert ended.code == 0, ended
    record = load_record(tmp_path / "out" / "record.nc")
    assert record.attrs["title"] == "sine at scale 0.2 over the link"
    assert record.attrs["link_mode"] == "lock-step" and record.attrs["lost"] == 0
    assert record.attrs["scale"] == 0.2 and record.attrs["controller"] == load_controller("lhpost6").name
    peak = np.abs(record["reference_displacement"].values[:, 0]).max()
    assert peak == pytest.approx(0.2 * 0.02, rel=1e-2)  # m
    assert np.abs(record["platen_displacement"].values[:, 0]).max() == pytest.approx(peak, rel=0.3)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Track a motion on 1 of 6 axes" in page and "Demand over capacity" in page
    assert record.attrs["samples"] == record.sizes["time"] and str(tmp_path / "out") in ended.words.replace(" ", "")


def test_a_users_own_controller_can_take_the_place_of_the_469d(tmp_path, lhpost6, port, brief):
    own = own_controller(tmp_path / "mine.py")
    ended = lhpost6("link", *SHORT, "--port", port, "--controller", own)
    assert ended.code == 0, ended
    assert abs(load_record(tmp_path / "out" / "sine_link" / "record.nc")["actuator_displacement"]).max() < 1e-6
    wild = own_controller(tmp_path / "wild.py", step="return [0.0] * 4 + [1.0] * 6")
    ended = lhpost6("link", *SHORT, "--port", port, "--controller", wild)
    assert ended.code == 1 and "the plant tripped" in ended.words
    failing = own_controller(tmp_path / "failing.py", step="return 1 / 0")
    ended = lhpost6("link", *SHORT, "--port", port, "--controller", failing)
    assert refused(ended, "Mine.step failed at sample 0: ZeroDivisionError")


def test_what_cannot_be_done_is_said_and_ends_with_two(lhpost6, port):
    assert refused(lhpost6("serve", "--port", port), f"cannot listen on 127.0.0.1:{port}")
    assert refused(lhpost6("serve", "--mode", "fast"), "free, lock-step, real-time")
    assert refused(lhpost6("serve", "--parked", "--machine", "uniaxial"), "uniaxial.toml: platen.parked is missing")
    assert refused(lhpost6("serve", "--fault", "dust@H1", "--port", 0), "no effect of the library named 'dust'")
    assert refused(lhpost6("serve", "--fault", "@H1", "--port", 0), "EFFECT@WHERE, such as entrained_air@H1")
    assert refused(lhpost6("link", *SHORT, "--port", port, "--valves", 2), "choose --valves alike")


@pytest.mark.slow
def test_the_round_trip_script_measures_and_keeps_its_figures(tmp_path):
    ended = script("link_round_trip.py", "--seconds", "0.2", "--out", tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert "deadlines missed" in ended.stdout and (tmp_path / "link_round_trip.json").is_file()

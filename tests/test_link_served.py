"""What a served plant does on a datagram and at a sample; no sockets, and a clock that the tests turn."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from machine_cases import plant_named

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.control.plug import Feedback
from lhpost6_pin.core.errors import LinkError, ParameterError, SimulationError, UnknownNameError
from lhpost6_pin.interfaces.link.clock import Histogram
from lhpost6_pin.interfaces.link.faults import make_faults
from lhpost6_pin.interfaces.link.protocol import (
    COUNTS,
    SESSION,
    Datagram,
    Kind,
    LinkMode,
    PlantState,
    decode,
    encode,
)
from lhpost6_pin.interfaces.link.served import MISSED_FRAMES, RAMP, ServedPlant
from lhpost6_pin.machine.library import find_family
from lhpost6_pin.mechanics.coupled import motion_numbers, wrench_of
from lhpost6_pin.mechanics.equilibrium import find_equilibrium, parked_pose
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.simulation.running import RunningPlant

pytestmark = pytest.mark.long

SECOND = 10**9
MODES = list(LinkMode)
MOVING = [LinkMode.REAL_TIME, LinkMode.FREE]


class Client:
    """The client's side of a served plant, in the same process and on a clock of its own."""

    def __init__(self, plant, rest, mode, session=1, name="a", **more):
        self.table = ServedPlant(plant, rest, mode, **more)
        self.session, self.name, self.sequence, self.now = session, name, 0, 0

    def say(self, frame, sender=None):
        """Hand a frame to the plant; returns its answers."""
        return [decode(d) for d in self.table.receive(encode(frame), sender or self.name, self.now)]

    def hello(self, session=None, pressures=False):
        """Begin a session; returns welcome and sensors."""
        self.session, self.sequence = session or self.session, 0
        return self.say(Datagram(Kind.HELLO, self.session, pressures=pressures))

    def switch(self, fault="", on=False):
        """Switch a fault, or only ask; returns those that are offered and whether they are on."""
        answers = self.say(Datagram(Kind.SWITCH, self.session, fault=fault, on=on))
        assert {a.kind for a in answers} == {Kind.SWITCH}
        return {a.fault: a.on for a in answers}

    def frame(self, spool, sequence=None):
        """Frame of the next command, or of one with a sequence number of its own."""
        self.sequence = self.sequence + 1 if sequence is None else sequence
        n = len(self.table.plant.machine.actuators)
        return Datagram(Kind.COMMAND, self.session, actuators=n, valves=n, sequence=self.sequence, numbers=spool)

    def command(self, spool, sequence=None):
        """Send a command and let the plant move by one sample; returns the sensors."""
        answers = self.say(self.frame(spool, sequence))
        return answers[0] if self.table.mode == LinkMode.LOCK_STEP else self.tick()

    def tick(self):
        """Let a sample's time pass; returns the sensors, if the plant moves by itself."""
        self.now += SECOND // 2048
        self.table.watch(self.now)
        answer = self.table.tick(self.now)
        return None if answer is None else decode(answer)


@pytest.fixture
def client(plant, rest, request):
    made = Client(plant, rest, request.param)
    made.hello()
    return made


def sensors_of(frame, n=10):
    acceleration, displacement, force, _ = np.split(frame.numbers, [6, 6 + n, 6 + 2 * n])
    return Feedback(displacement, acceleration, force)


def spools(rest, samples, size=0.1):
    """Commands about rest, smooth and different for each actuator."""
    t = np.arange(samples)[:, None] / 2048
    return rest.spool + size * np.sin(2 * np.pi * (3 + np.arange(10)) * t)


# ------------------------------------------------------------------------------------------ the ordinary way
@pytest.mark.parametrize("client", MODES, indirect=True)
def test_a_served_plant_is_the_plant_to_the_last_bit(client, plant, rest):
    own = RunningPlant(plant, rest)
    for k, spool in enumerate(spools(rest, 300)):
        found = client.command(spool)
        own.advance(spool)
        wanted = own.sensors()
        assert all(np.array_equal(a, b) for a, b in zip(sensors_of(found), wanted, strict=True))
        assert (found.sequence, found.acknowledged, found.state) == (k + 1, k + 1, PlantState.RUNNING)
    assert client.table.counts == {**dict.fromkeys(COUNTS, 0), "received": 301, "samples": 300}


@pytest.mark.parametrize("client", MODES, indirect=True)
def test_a_wrench_acts_on_the_served_plant_and_its_interface_moves_as_in_one_process(client, plant, rest):
    """Bit by bit, with gaps in which the last wrench is kept."""
    own, start = RunningPlant(plant, rest), client.hello(2)[1].numbers[-18:]
    assert np.array_equal(start, own.readings()[-18:])
    for k, spool in enumerate(spools(rest, 60)):
        push = np.array([1e5, 2e4, -1e5, 1e4, 0.0, 3e4]) * np.sin(0.1 * k) if k % 4 else None
        found = client.command(spool if push is None else np.concatenate([spool, push]))
        own.advance(spool, None if push is None else wrench_of(push))
        assert np.array_equal(found.numbers, own.readings())
        # Pinocchio's motion, whose numbers are below 1: other roundings of the same products
        np.testing.assert_allclose(found.numbers[-18:], motion_numbers(own.interface_motion()), rtol=0.0, atol=1e-14)
    moved = found.numbers[-18:] - start
    assert np.abs(moved[:3]).max() > 1e-4 and np.abs(moved[12:15]).max() > 1e-2


def test_a_client_of_version_1_is_answered_in_its_version_and_takes_no_place(plant, rest):
    table = ServedPlant(plant, rest, LinkMode.LOCK_STEP)
    old = bytearray(encode(Datagram(Kind.HELLO, 9)))
    old[4] = 1
    welcome, sensors = table.receive(bytes(old), "a", 0)
    assert welcome[4] == sensors[4] == 1 and b"needs protocol version 2" in welcome
    old[5] = Kind.BYE
    assert table.receive(bytes(old), "a", 0) == [] and table.client is None and table.counts["malformed"] == 2


@pytest.mark.parametrize("mode", MODES)
def test_a_hello_is_answered_with_the_machine_and_its_sensors_at_rest(plant, rest, mode):
    client = Client(plant, rest, mode, session=2**32 - 1)
    welcome, sensors = client.hello()
    assert welcome.mode == mode and welcome.welcome.rate == 2048.0 and welcome.welcome.machine == plant.machine.name
    assert welcome.welcome.actuators == plant.machine.actuator_names and welcome.welcome.valves == (1,) * 10
    assert (sensors.state, sensors.sequence, sensors.acknowledged) == (PlantState.WAITING, 0, 0)
    assert all(
        np.array_equal(a, b) for a, b in zip(sensors_of(sensors), RunningPlant(plant, rest).sensors(), strict=True)
    )
    assert client.tick() is None  # until the first command nothing moves and nothing is missed
    assert client.table.counts["missed_frames"] == 0


@pytest.mark.parametrize("client", MOVING, indirect=True)
def test_each_sample_takes_the_newest_command_counts_those_it_replaced_and_returns_its_stamp(client, rest):
    for k, row in enumerate(spools(rest, 3)):
        client.say(client.frame(row)._replace(stamp=121 + k, echo=40))
    found = client.tick()
    assert (found.sequence, found.acknowledged, found.echo, found.stamp) == (1, 3, 123, client.now)
    assert client.table.counts["superseded"] == 2


# ------------------------------------------------------------------------------------- datagrams gone astray
@pytest.mark.parametrize("client", [LinkMode.LOCK_STEP], indirect=True)
def test_in_lock_step_a_command_sent_again_gets_the_same_answer_and_moves_nothing(client, rest):
    row, *_ = spools(rest, 1)
    first = client.table.receive(encode(client.frame(row)), "a", 5)
    again = client.table.receive(encode(client.frame(row, 1)), "a", 9)
    assert first == again and client.table.sample == 1 and client.table.counts["duplicate"] == 1


@pytest.mark.parametrize("client", MODES, indirect=True)
def test_late_commands_are_dropped_and_gaps_counted(client, rest):
    rows = spools(rest, 6)
    client.command(rows[0])
    client.command(rows[1], 5)  # 2, 3, 4 are missing
    assert client.say(client.frame(rows[2], 3)) == []  # and one of them comes after all
    counts = client.table.counts
    assert (counts["lost"], counts["late"], counts["duplicate"], counts["samples"]) == (3, 1, 0, 2)
    client.command(rows[3], 6)
    assert counts["samples"] == 3 and counts["lost"] == 3


@pytest.mark.parametrize("client", MODES, indirect=True)
def test_short_malformed_and_foreign_datagrams_are_counted_and_change_nothing(client, rest):
    table = client.table
    good = encode(client.frame(rest.spool, 1))
    for datagram in (b"", b"LHP6", good[:-1], good[:47]):
        assert table.receive(datagram, "a", 0) == []
    assert table.counts["short"] == 4
    few = Datagram(Kind.COMMAND, 1, actuators=10, valves=4, sequence=1, numbers=np.zeros(4))
    status = Datagram(Kind.STATUS, 1, counts=(0,) * 12)
    for datagram in (b"x" * 128, good + b"\0", good[:50] + b"\xff" + good[51:], encode(status), encode(few)):
        assert table.receive(datagram, "a", 0) == []
    assert table.counts["malformed"] == 5
    assert table.receive(good, "b", 0) == []  # another client
    assert table.receive(encode(client.frame(rest.spool, 1)._replace(session=2)), "a", 0) == []  # an earlier session
    assert table.receive(encode(Datagram(Kind.HELLO, 3)), "b", 0) == []
    assert table.receive(encode(Datagram(Kind.BYE, 1)), "b", 0) == []
    assert table.counts["foreign"] == 4 and table.client == "a"
    assert table.counts["received"] == 14 and table.counts["samples"] == 0 and table.state == PlantState.WAITING


# ------------------------------------------------------------------------------------------------- safe hold
PAD = 0.5  # [s] of rest before and after a motion


def strong_sine(plant, rest, cycles=2):
    """The 469D and its drive for 0.75 m at 0.5 Hz along X."""
    controller = make_controller(plant, rest, load_controller("lhpost6"))
    target = make_target(find_motion("sine", amplitude=0.75, period=2.0, cycles=cycles, ramp_cycles=1), pad=PAD)
    return controller, controller.drive_for(target.displacement, target.velocity, target.acceleration)


@pytest.mark.parametrize("client", MOVING, indirect=True)
def test_the_command_that_answers_the_newest_sensors_is_awaited_of_a_client_that_commands(client, rest):
    table = client.table

    def answer(sample):
        client.say(client.frame(rest.spool)._replace(acknowledged=sample))

    assert not table.awaited  # nothing moves before the first command
    answer(0)
    assert not table.awaited  # it has come
    client.tick()
    assert table.awaited
    answer(0)
    assert table.awaited  # one more for the sample before
    answer(1)
    assert not table.awaited
    client.tick()
    assert table.awaited
    client.tick()
    assert not table.awaited  # a sample passed without one: the client has ceased to command
    answer(3)
    client.tick()
    assert table.awaited
    client.say(Datagram(Kind.HELLO, client.session))
    assert not table.awaited  # and so does a client that says so
    for _ in range(MISSED_FRAMES):
        client.tick()
    assert table.state == PlantState.HOLD and not table.awaited
    answer(table.sample)
    client.tick()
    assert table.awaited  # it commands again


@pytest.mark.parametrize("client", MOVING, indirect=True)
def test_four_missed_frames_are_bridged_and_the_fifth_begins_the_hold(client, rest):
    rows = spools(rest, 2)
    client.command(rows[0])
    for k in range(1, MISSED_FRAMES):
        assert client.tick().state == PlantState.RUNNING
        assert client.table.counts["missed_frames"] == k
    assert client.tick().state == PlantState.HOLD
    assert client.table.counts["holds"] == 1
    assert client.command(rows[1]).state == PlantState.RUNNING
    assert client.table.counts["missed_frames"] == MISSED_FRAMES


@pytest.mark.parametrize(
    "seconds", [pytest.param(4.8, marks=pytest.mark.slow), 6.0, pytest.param(7.2, marks=pytest.mark.slow)]
)
def test_a_table_in_strong_motion_stays_within_its_strokes_and_comes_to_rest_when_commands_stop(plant, rest, seconds):
    """Commands stop in the last full cycle: near its middle, on the way out, and at the end of the stroke."""
    client = Client(plant, rest, LinkMode.REAL_TIME)
    _, found = client.hello()
    controller, drive = strong_sine(plant, rest)
    memory, before = controller.init(), 0.0
    for k in range(int((PAD + seconds) * 2048)):
        sensors = sensors_of(found)
        before = max(before, np.abs(sensors.acceleration[:3]).max())
        found = client.command(controller.step(memory, k, drive, sensors))
    moving = sensors_of(found).displacement
    after, held = 0.0, []
    for _ in range(3 * 2048):
        sensors = sensors_of(client.tick())
        after = max(after, np.abs(sensors.acceleration[:3]).max())
        held.append(sensors.displacement)
    held = np.array(held)
    assert client.table.state == PlantState.HOLD
    assert np.abs(moving).max() > 0.05 and before > 5.0  # a strong motion it was
    assert (np.abs(held).max(axis=0) < 0.9 * plant.legs["stroke"][:10]).all()
    assert after < 1.5 * before  # no blow: the oil column would double it in a stop within one period
    speed = np.abs(np.diff(held, axis=0)).max(axis=1) * 2048
    assert speed[-2048:].max() < 0.01  # m/s: what is left is the creep of leaking oil and the last of the ringing


@pytest.mark.parametrize("client", MOVING, indirect=True)
def test_spools_go_smoothly_to_those_of_rest_and_back_to_the_commands(client, rest, plant):
    rows = spools(rest, 3 * RAMP, size=0.5)
    seen = [(client.command(row), client.table.spool.copy())[1] for row in rows[:100]]
    seen += [(client.tick(), client.table.spool.copy())[1] for _ in range(MISSED_FRAMES + RAMP)]
    assert np.array_equal(seen[-1], rest.spool)
    seen += [(client.command(row), client.table.spool.copy())[1] for row in rows[100 : 100 + RAMP + 5]]
    assert np.array_equal(seen[-1], rows[100 + RAMP + 4])  # from the end of the ramp on, the commands to the last bit
    steps = np.abs(np.diff(seen[100:], axis=0)).max()
    # the ramp is steepest in its middle, 1.5/RAMP of a way of at most one, beside the commands' own largest step
    assert steps < 1.5 / RAMP + np.abs(np.diff(rows, axis=0)).max()


def test_a_link_that_drops_out_again_and_again_still_commands(plant, rest):
    """Seven of every twenty frames are lost in strong motion: a hold each time, and the table follows all the same."""
    client = Client(plant, rest, LinkMode.REAL_TIME)
    _, found = client.hello()
    controller, drive = strong_sine(plant, rest, cycles=0.5)
    memory = controller.init()
    for k in range(len(drive)):
        command = controller.step(memory, k, drive, sensors_of(found))
        found = client.tick() if k % 20 >= 13 else client.command(command)
        assert found.state != PlantState.TRIPPED
    assert abs(client.table.counts["holds"] - len(drive) / 20) < 1
    assert np.abs(sensors_of(found).displacement).max() < 0.02  # m: back home, where the sine ends


@pytest.mark.parametrize("client", MOVING, indirect=True)
def test_a_hold_after_commands_beyond_full_stroke_begins_at_full_stroke(client, rest):
    client.command(np.full(10, -1e300))
    for _ in range(MISSED_FRAMES):
        client.tick()
    assert client.table.state == PlantState.HOLD
    assert (client.table.spool >= -1.0).all() and (client.table.spool < -0.99).all()


@pytest.mark.parametrize("client", [LinkMode.LOCK_STEP], indirect=True)
def test_in_lock_step_time_stands_still_while_a_client_is_silent(client, rest):
    """A client that paused for a second found the plant in its safe hold, and was advised to take lock-step."""
    rows = spools(rest, 30)
    for row in rows[:20]:
        client.command(row)
    client.now += int(SESSION * SECOND)
    client.table.watch(client.now)
    assert (client.table.state, client.table.sample, client.table.counts["holds"]) == (PlantState.RUNNING, 20, 0)
    found = client.command(rows[20])
    assert (found.state, found.sequence) == (PlantState.RUNNING, 21)


# -------------------------------------------------------------------------------------- trips, and who is next
@pytest.mark.parametrize("client", MODES, indirect=True)
def test_a_plant_that_leaves_its_stroke_trips_and_a_new_hello_puts_it_at_rest(client, rest):
    full = np.zeros(10)
    full[4:] = 1.0  # all verticals out
    found = client.command(full)
    for _ in range(4000):
        found = client.command(full)
        if found.state == PlantState.TRIPPED:
            break
    assert found.state == PlantState.TRIPPED and client.table.state == PlantState.TRIPPED
    again = client.command(full)
    assert again.state == PlantState.TRIPPED and again.sequence == found.sequence
    assert np.array_equal(again.numbers, found.numbers)  # the last that made sense
    _, fresh = client.hello(session=2)
    assert (fresh.state, fresh.sequence) == (PlantState.WAITING, 0)
    assert client.command(rest.spool).state == PlantState.RUNNING


@pytest.mark.parametrize("client", MODES, indirect=True)
def test_a_hello_again_does_not_disturb_a_run_and_a_bye_frees_the_place_with_the_counts_of_the_session(client, rest):
    client.table.receive(b"noise", "a", 0)
    client.hello(session=8)  # counts of an earlier session are left out
    for row in spools(rest, 3):
        client.command(row)
    _, sensors = client.say(Datagram(Kind.HELLO, 8))
    assert sensors.sequence == 3 and client.table.state == PlantState.RUNNING
    (status,) = client.say(Datagram(Kind.BYE, 8))
    counts = dict(zip(COUNTS, status.counts, strict=True))
    assert counts["received"] == 5 and counts["samples"] == 3 and counts["short"] == 0
    assert client.say(Datagram(Kind.BYE, 8))[0].counts[0] == 6  # its answer was lost: once more
    assert client.tick() is None and client.table.client is None
    assert len(client.say(Datagram(Kind.HELLO, 9), sender="b")) == 2 and client.table.client == "b"


@pytest.mark.parametrize("client", MODES, indirect=True)
def test_a_client_that_is_silent_too_long_loses_its_place_and_the_plant_stands(client, rest):
    client.command(rest.spool)
    client.table.watch(int(SESSION * SECOND))
    assert client.table.client == "a"
    client.table.watch(int(SESSION * SECOND) + 1)
    assert client.table.client is None and client.table.tick(0) is None
    assert client.say(client.frame(rest.spool)) == [] and client.table.counts["foreign"] == 1
    assert len(client.hello(session=2)) == 2


# ------------------------------------------------------------------------------------- pressures, faults, parked
@pytest.mark.parametrize("mode", MODES)
def test_pressures_are_those_of_the_plant_for_the_session_that_asks_and_for_no_other(plant, rest, mode):
    client, own = Client(plant, rest, mode), RunningPlant(plant, rest)
    _, found = client.hello(pressures=True)
    for spool in (*spools(rest, 20), None):
        assert found.pressures and found.struts == 3
        assert np.array_equal(found.numbers, own.readings(pressures=True))
        np.testing.assert_allclose(found.numbers[44:], np.hstack(own.pressures()), rtol=1e-14)  # a power, rounded
        if spool is not None:
            found = client.command(spool)
            own.advance(spool)
    b = found.numbers[54:64]
    assert np.all(b[4:] == 0.0) and b[:4].min() > plant.supply[1]  # vertical actuators have chamber A only
    _, found = client.hello(1)  # once more without asking: it is the session's first hello that counts
    assert found.pressures
    _, found = client.hello(2)
    assert not found.pressures and client.command(rest.spool).numbers.shape == (44,)


@pytest.fixture(scope="module")
def faults(plant):
    return make_faults(plant.machine, ["stribeck_friction@H1", "entrained_air@V1,V2"])


@pytest.mark.parametrize("mode", MODES)
def test_a_fault_acts_from_the_next_sample_on_one_at_a_time_and_never_in_a_new_session(plant, rest, mode, faults):
    client, own = Client(plant, rest, mode, faults=faults), RunningPlant(plant, rest)
    client.hello()
    rub, air = faults
    none = dict.fromkeys(faults, False)
    plan = {5: (rub, True), 6: (rub, True), 12: (air, True), 14: (rub, False), 15: ("dust", True), 20: (air, False)}
    on = ""
    assert client.switch() == none
    for k, spool in enumerate(spools(rest, 30)):
        if k in plan:
            name, wanted = plan[k]
            now = {5: rub, 6: rub, 12: air, 14: air, 15: air, 20: ""}[k]
            assert client.switch(name, wanted) == {**none, **({now: True} if now else {})}
            if now != on:
                on, own = now, own.with_plant(faults[now] if now else plant)
        found = client.command(spool)
        own.advance(spool)
        assert all(np.array_equal(a, b) for a, b in zip(sensors_of(found), own.sensors(), strict=True))
    client.switch(rub, True)
    client.command(rest.spool)
    assert client.hello()[1].sequence == 31 and client.switch()[rub]  # hello again: the same session
    client.hello(2)
    assert client.switch() == none
    healthy = RunningPlant(plant, rest)
    for spool in spools(rest, 10):
        healthy.advance(spool)
        found = client.command(spool)
    assert np.array_equal(sensors_of(found).force, healthy.sensors().force)


def test_switches_are_answered_where_nothing_is_offered_and_change_nothing_for_others_or_after_a_trip(
    plant, rest, faults
):
    bare = Client(plant, rest, LinkMode.LOCK_STEP)
    bare.hello()
    assert bare.switch("stribeck_friction@H1", True) == {"": False}
    client = Client(plant, rest, LinkMode.LOCK_STEP, faults=faults)
    client.hello()
    frame = Datagram(Kind.SWITCH, client.session, fault="stribeck_friction@H1", on=True)
    assert client.say(frame, sender="b") == client.say(frame._replace(session=9)) == []
    assert client.table.counts["foreign"] == 2 and client.table.fault == ""
    client.table.state = PlantState.TRIPPED
    assert not any(client.switch("stribeck_friction@H1", True).values())


def test_a_fault_that_cannot_be_switched_is_refused_before_a_client_comes(plant, rest):
    with pytest.raises(LinkError, match="at most 39 bytes"):
        ServedPlant(plant, rest, LinkMode.FREE, faults={"x" * 40: plant})
    with pytest.raises(LinkError, match="needs a name"):
        ServedPlant(plant, rest, LinkMode.FREE, faults={"": plant})
    with pytest.raises(SimulationError, match="the same machine"):
        ServedPlant(plant, rest, LinkMode.FREE, faults={"x": plant_named("uniaxial")})
    for name, why in (("@H1", "write EFFECT@WHERE"), ("entrained_air@", "EFFECT@WHERE"), ("entrained_air@S1", "H1")):
        with pytest.raises(ParameterError, match=why):
            make_faults(plant.machine, [name])
    with pytest.raises(UnknownNameError, match="dust"):
        make_faults(plant.machine, ["dust@H1"])


def test_without_a_place_a_fault_is_on_all_components_and_of_typical_size(plant):
    (made,) = make_faults(plant.machine, ["entrained_air"]).values()
    assert np.array_equal(made.actuators.air, np.full(10, find_family("entrained_air").shapes[0].typical))
    (alone,) = make_faults(plant.machine, ["entrained_air@V2"]).values()
    assert np.flatnonzero(alone.actuators.air).tolist() == [5]


@pytest.mark.parametrize("mode", MODES)
def test_a_parked_platen_stays_where_it_is(plant, mode):
    parked = find_equilibrium(plant, parked_pose(plant.machine))
    client = Client(plant, parked, mode)
    _, found = client.hello()
    low = plant.machine.platen.parked
    # rounding of positions of some metres, and of 4 MN of weight on oil of 1 GN/m: far below a nanometre
    assert sensors_of(found).displacement[4:] == pytest.approx(np.full(6, low), abs=1e-9)
    client.command(parked.spool)
    lock_step = mode == LinkMode.LOCK_STEP
    for _ in range(2 * RAMP):  # without a new command where the plant moves by itself
        found = client.command(parked.spool) if lock_step else client.tick()
    assert found.state == (PlantState.RUNNING if lock_step else PlantState.HOLD)
    assert np.array_equal(client.table.spool, parked.spool)
    assert sensors_of(found).displacement[4:] == pytest.approx(np.full(6, low), abs=1e-9)


# ------------------------------------------------------------------------------------------------ statistics
@given(st.lists(st.integers(0, 19_999_999), min_size=1, max_size=200), st.sampled_from([50.0, 90.0, 99.0]))
def test_percentiles_are_those_of_all_times_to_the_bin(times, share):
    histogram = Histogram()
    for t in times:
        histogram.add(t)
    exact = np.percentile(times, share, method="inverted_cdf") * 1e-9
    assert histogram.count == len(times) and histogram.largest == pytest.approx(max(times) * 1e-9)
    assert 0.0 <= histogram.percentile(share) - exact + 1e-12 <= 1e-6 + 2e-12  # a bin is a microsecond wide


def test_no_time_at_all_has_no_percentile_and_one_beyond_the_last_bin_is_still_the_largest():
    histogram = Histogram()
    assert histogram.percentile(50.0) == 0.0
    histogram.add(10**9)
    assert histogram.largest == 1.0 and histogram.percentile(50.0) <= 1.0


@pytest.mark.parametrize("late", [0.0195, 0.05, 2.0, 600.0])
def test_times_beyond_the_fine_bins_have_percentiles_of_their_own(late: float):
    histogram = Histogram()
    for _ in range(9):
        histogram.add(round(late * 1e9))
    histogram.add(round(3.0 * late * 1e9))
    # a bin is one per cent wide from 20 ms on, one microsecond below
    assert late <= histogram.percentile(50.0) <= 1.01 * late + 1e-6
    assert histogram.percentile(99.0) == histogram.largest

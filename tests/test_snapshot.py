"""What is seen of a running plant is what its record says, and looking changes nothing."""

import time

import numpy as np
import pytest
from commands import SHORT

from lhpost6_pin.cli import live_view as live
from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.core.names import ENGINES, SAMPLE_RATE
from lhpost6_pin.interfaces.link.protocol import Datagram, Kind, LinkMode, encode
from lhpost6_pin.interfaces.link.served import ServedPlant
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.viewer import LiveView
from lhpost6_pin.simulation.outputs import record_of_run
from lhpost6_pin.simulation.simulate import ClosedLoop, simulate
from lhpost6_pin.simulation.snapshot import EVERY, Snapshot

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def loop(plant, rest):
    target = make_target(find_motion("sine", amplitude=0.02, cycles=0.5, ramp_cycles=0.5), rate=float(SAMPLE_RATE))
    controller = make_controller(plant, rest, load_controller("lhpost6"))
    drive = controller.drive_for(target.displacement, target.velocity, target.acceleration)
    begin = int(np.argmax(np.abs(drive[:, 0]) > 1e-3 * np.abs(drive[:, 0]).max()))
    return ClosedLoop(controller, drive[begin : begin + 4000], rest)


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


def test_a_served_plant_shows_itself_now_and_then(plant, rest):
    table, seen = ServedPlant(plant, rest, LinkMode.LOCK_STEP), []
    table.watcher = seen.append
    table.receive(encode(Datagram(Kind.HELLO, 1)), "a", 0)
    n = plant.spools
    for k in range(1, 2 * EVERY + 2):
        frame = Datagram(Kind.COMMAND, 1, actuators=n, valves=n, sequence=k, numbers=rest.spool)
        table.receive(encode(frame), "a", k)
    assert [one.time for one in seen] == [EVERY / SAMPLE_RATE, 2 * EVERY / SAMPLE_RATE]


def test_a_live_view_is_no_faster_than_the_table(plant):
    still = Snapshot(0.0, np.zeros(6), np.ones(plant.legs.size))
    with LiveView(plant.machine, "still") as view:
        begin = time.monotonic()
        for moment in (3.0, 3.1, 3.3):  # a plant may have run before it is watched
            view.show(still._replace(time=moment))
        assert time.monotonic() - begin >= 0.3


def test_a_run_can_be_watched_from_the_command_line(lhpost6, monkeypatch, tmp_path):
    monkeypatch.setattr(live, "PATIENCE", 0.0)
    ended = lhpost6("run", *SHORT, "--live", "--no-open", "--out", tmp_path)
    assert ended.code == 0 and "http://127.0.0.1:" in ended.out and "no viewer connected" in ended.err
    assert (tmp_path / "record.nc").is_file()

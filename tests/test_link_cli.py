"""The link from the command line: `lhpost6 serve` in one process, `lhpost6 link` in another."""

import subprocess
import sys
from pathlib import Path

import pytest
from commands import refused
from test_link_server import served

from lhpost6_pin.data.records import load_record
from lhpost6_pin.interfaces.link import LinkMode

pytestmark = pytest.mark.long

SERVE = "from lhpost6_pin.cli import main; import sys; sys.argv[1:] = {!r}; main()"
SHORT = (
    "sine",
    "--scale",
    "0.2",
    *"--set amplitude=0.02 --set cycles=0.5 --set ramp_cycles=0.5 --set period=1".split(),
)
SCRIPT = Path(__file__).parent.parent / "scripts" / "link_round_trip.py"
GUARD = 120  # [s] no wait is meant to last so long


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


def test_a_motion_runs_across_processes_and_leaves_its_record(tmp_path, lhpost6):
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
    assert record.attrs["samples"] == record.sizes["time"] and str(tmp_path / "out") in ended.words.replace(" ", "")


def test_a_users_own_controller_can_take_the_place_of_the_469d(tmp_path, lhpost6, port):
    (tmp_path / "mine.py").write_text(
        "class Mine:\n"
        "    def init(self, plant, rest):\n        return rest.spool\n"
        "    def step(self, memory, wanted, sensors):\n        return memory\n"
    )
    ended = lhpost6("link", *SHORT, "--port", port, "--controller", "mine.py:Mine")
    assert ended.code == 0, ended
    assert abs(load_record(tmp_path / "out" / "sine_link" / "record.nc")["actuator_displacement"]).max() < 1e-6


def test_a_plant_that_trips_ends_the_command_with_one(tmp_path, lhpost6, port):
    (tmp_path / "wild.py").write_text(
        "class Wild:\n"
        "    def init(self, plant, rest):\n        pass\n"
        "    def step(self, memory, wanted, sensors):\n        return [0.0] * 4 + [1.0] * 6\n"
    )
    ended = lhpost6("link", *SHORT, "--port", port, "--controller", "wild.py:Wild")
    assert ended.code == 1 and "the plant tripped" in ended.words


def test_what_cannot_be_done_is_said_and_ends_with_two(lhpost6, port):
    assert refused(lhpost6("serve", "--port", port), f"cannot listen on 127.0.0.1:{port}")
    assert refused(lhpost6("serve", "--mode", "fast"), "free, lock-step, real-time")
    assert refused(lhpost6("link", *SHORT, "--port", port, "--valves", 2), "choose --valves alike")


def test_the_round_trip_script_measures_and_keeps_its_figures(tmp_path):
    command = [sys.executable, str(SCRIPT), "--seconds", "0.2", "--out", str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=GUARD)
    assert ended.returncode == 0, ended.stderr
    assert "deadlines missed" in ended.stdout and (tmp_path / "link_round_trip.json").is_file()


def test_a_controller_that_fails_during_a_link_is_named(tmp_path, lhpost6, port):
    text = "class Mine:\n    def init(self, plant, rest): pass\n    def step(self, *seen): return 1 / 0\n"
    (tmp_path / "mine.py").write_text(text)
    assert refused(
        lhpost6("link", *SHORT, "--port", port, "--controller", "mine.py:Mine"),
        "Mine.step failed at sample 0: ZeroDivisionError",
    )

"""The panel as a whole, its processes and its page: started, driven, tripped, reset, recorded, watched, abandoned."""

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from urllib.request import Request, urlopen

import numpy as np
import pytest
from browser import BROWSER, Tab, browse
from test_scripts import script
from tornado.websocket import websocket_connect

from lhpost6_pin.data.records import load_record
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium, parked_pose
from lhpost6_pin.mechanics.instant import displacement_of
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.panel.worker import panel_numbers
from lhpost6_pin.simulation.running import RunningPlant

pytestmark = pytest.mark.long

PACE = "0.9"
"""Of real time: below it processes keep their ordinary priority. A computer that is slower delays the clock alone."""
HERE = "0100007F"  # 127.0.0.1 in /proc/net
PATIENCE = 120.0  # [s] for what takes seconds on a computer that does nothing else

unless_no_browser = pytest.mark.slow if BROWSER else pytest.mark.long
"""A minute each: one whole panel is driven in every run of the checks, in a browser if there is one."""


class Panel:
    """A panel in a process of its own; `url`, `folder` of its recordings."""

    def __init__(self, folder: Path, *more: str) -> None:
        command = [sys.executable, "-c", "from lhpost6_pin.cli import main; main()", "panel", "--no-open"]
        self.folder = folder / "panel"
        command += ["--out", str(self.folder), "--pace", PACE, *more]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=folder)
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().split()[0]

    def children(self) -> list[int]:
        """Processes of the panel: of the controller and the plant, and Python's own."""
        tasks = Path(f"/proc/{self.process.pid}/task").glob("*/children")
        return [int(word) for task in tasks for word in task.read_text().split()]

    def listens(self) -> set[tuple[str, str]]:
        """Kind and address of all sockets on which it listens."""
        return set().union(*listeners([self.process.pid, *self.children()]).values())

    def close(self, number: int = signal.SIGTERM) -> int:
        if self.process.poll() is None:
            self.process.send_signal(number)
        code = self.process.wait(PATIENCE)
        assert self.process.stdout is not None
        self.process.stdout.close()
        return code


@pytest.fixture
def panel(tmp_path):
    found = Panel(tmp_path, "--trainer")
    yield found
    found.close(signal.SIGKILL)


class Visitor:
    """A browser's place without a browser: what the server sends, and orders."""

    def __init__(self, url: str) -> None:
        self._url = url.replace("http", "ws", 1) + "socket"
        self.state: dict = {}
        self.hello: dict = {}
        self.refusals: list[str] = []
        self.log: list[str] = []

    async def __aenter__(self):
        self._socket = await websocket_connect(self._url)
        self._task = asyncio.create_task(self._listen())
        await self.until(lambda: self.state)
        return self

    async def __aexit__(self, *_):
        self._socket.close()
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.wait_for(self._task, 5.0)

    async def _listen(self):
        while (text := await self._socket.read_message()) is not None:
            message = json.loads(text)
            if message["kind"] == "state":
                self.state = message
                self.log += [f"{entry['who']} {entry['what']}" for entry in message["log"]]
            elif message["kind"] == "hello":
                self.hello = message
            else:
                self.refusals.append(message["what"])

    async def do(self, do: str, **more):
        await self._socket.write_message(json.dumps({"do": do, **more}))

    async def until(self, wanted):
        end = time.monotonic() + PATIENCE
        while not wanted():
            assert time.monotonic() < end, (self.state.get("trip"), self.refusals, self.log)
            await asyncio.sleep(0.02)

    async def refused(self, why: str, do: str, **more):
        count = len(self.refusals)
        await self.do(do, **more)
        await self.until(lambda: len(self.refusals) > count)
        assert why in self.refusals[-1], self.refusals[-1]

    async def start(self, name: str, recording: str = ""):
        """From nothing to a raised platen, recorded if that has a name."""
        await self.do("name", name=name)
        await self.do("take")
        await self.until(lambda: self.state["you"]["role"] == "operator")
        for to in ("low", "high"):
            await self.do("pressure", to=to)
            await self.until(lambda to=to: self.state["pressure"] == to)
            if to == "low" and recording:
                await self.do("record", on=True, name=recording)
                await self.until(lambda: self.state["recording"])
        assert self.state["platen"] == "parked"
        await self.do("raise")
        await self.until(lambda: self.state["platen"] == "raised")
        if recording:
            await self.do("record", on=False)
            await self.until(lambda: self.state["recordings"])


def replayed(record) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (n, 6) of a parked table driven by a record's spool commands alone, and its spools (n, 10)."""
    plant = make_plant(load_machine())
    table = RunningPlant(plant, find_equilibrium(plant, parked_pose(plant.machine)))
    found, spools = [], []
    for command in record["spool_command"].values.astype(float):
        found.append(displacement_of(table.interface_motion().pose))
        table.advance(command)
        spools.append(table.spool)
    return np.array(found), np.array(spools)


@unless_no_browser
def test_a_table_is_started_driven_tripped_reset_and_recorded(panel):
    async def drive():
        async with Visitor(panel.url) as anna:
            await anna.refused("take the controls first", "run")
            await anna.start("Anna", recording="start")
            assert panel.listens() == {("udp", HERE), ("tcp", HERE)}  # to nobody beyond this computer
            await anna.refused("no program", "run")
            await anna.refused("span of x is zero", "generator", wave="sine", frequency=0.5, axes=["x"])
            await anna.refused("span of x: 2000 mm; the limit is 890 mm", "span", axis="x", value=2.0)
            await anna.refused("span of x: -50 mm; it is an amplitude", "span", axis="x", value=-0.05)
            await anna.do("span", axis="x", value=0.1)
            await anna.until(lambda: anna.state["span"][0] == 0.1)
            await anna.refused("exceeds the capacity", "generator", wave="sine", frequency=8.0, axes=["x"])
            await anna.do("record", on=True, name="by hand")
            await anna.do("generator", wave="sine", frequency=1.0, cycles=2, axes=["x"])
            await anna.until(lambda: anna.state["program"]["name"] == "sine 1 Hz")
            await anna.do("fault", name="piston_leakage", where="H2", on=True)
            await anna.until(lambda: any(fault["on"] for fault in anna.state["faults"]))
            await anna.do("run")
            await anna.until(lambda: anna.state["program"]["state"] == "running")
            await anna.refused("stop it first", "motion", name="ridgecrest", scale=0.3, axes="xyz")
            await anna.until(lambda: anna.state["program"]["state"] == "stopped")
            await anna.do("motion", name="ridgecrest", scale=0.1, axes="xyz")
            await anna.refused("ridgecrest is being checked; wait", "run")
            await anna.until(lambda: anna.state["program"]["name"] == "ridgecrest-ccc")
            assert anna.state["program"]["state"] == "stopped" and anna.state["program"]["checking"] is None
            await anna.refused("exceeds the capacity", "motion", name="ridgecrest", scale=3.0, axes="xyz")
            await anna.refused("no program", "run")
            await anna.do("record", on=False)
            await anna.until(lambda: len(anna.state["recordings"]) == 2)
            await anna.do("interlock", name="displacement", limit=0.05)
            await anna.do("setpoint", axis="x", value=0.2)
            await anna.until(lambda: anna.state["trip"])
            assert "displacement of x" in anna.state["trip"]
            await anna.refused("still displacement of x", "reset")
            await asyncio.sleep(1.0)  # of a platen that is held, whose last command was another
            assert max(map(abs, anna.state["bars"]["spool"].values())) < 5e-3
            await anna.do("interlock", name="displacement", limit=1.0)
            await anna.do("setpoint", axis="x", value=0.0)
            await anna.do("reset")
            await anna.until(lambda: anna.state["trip"] is None)
            return anna.state["recordings"], anna.log

    recordings, log = asyncio.run(drive())
    assert panel.close() == 0
    start = load_record(recordings[0])
    # in single precision, as recordings are: 3e-8 of a stroke; a command that came a sample later moves it by 5e-5 m
    moved, spools = replayed(start)
    np.testing.assert_allclose(moved, start["platen_displacement"].values, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(spools[:-1], start["spool_position"].values[:-1], rtol=0.0, atol=1e-7)
    assert start["answered"].values.all() and np.ptp(start["platen_displacement"].values[:, 2]) > 0.1
    record = load_record(recordings[1])
    assert Path(recordings[1]).name == "by_hand.nc"
    wanted, x = (record[f"{who}_displacement"].values[:, 0] for who in ("reference", "platen"))
    assert np.abs(wanted).max() == pytest.approx(0.1, rel=0.01)
    assert np.sqrt(np.mean((x - wanted) ** 2)) < 0.15 * np.sqrt(np.mean(wanted**2))
    assert {"chamber_pressure_a", "spool_position", "strut_pressure", "supply_pressure"} <= set(record.data_vars)
    said = "\n".join(log)
    for words in (
        "Anna sets the pressure high",
        "switches the fault piston_leakage@H2 on",
        "runs the program",
        "trip:",
    ):
        assert words in said
    entries = [json.loads(line) for line in (panel.folder / "journal.jsonl").read_text().splitlines()]
    assert [f"{entry['who']} {entry['what']}" for entry in entries][: len(log)] == log


@pytest.mark.slow  # a minute: the same start, and who may do what is asked of the session itself in test_panel
def test_one_operates_others_watch_and_a_browser_that_leaves_in_mid_run_stops_the_program(panel):
    async def drive():
        async with Visitor(panel.url) as ben:
            async with Visitor(panel.url) as anna:
                await anna.start("Anna")
                await ben.refused("another has the controls", "take")
                await ben.refused("watchers do not drive", "span", axis="x", value=0.1)
                await anna.do("span", axis="y", value=0.05)
                await anna.until(lambda: anna.state["span"][1] == 0.05)
                await anna.do("generator", wave="sine", frequency=0.5, axes=["y"])
                await anna.until(lambda: anna.state["program"]["name"])
                await anna.do("run")
                await ben.until(lambda: ben.state["program"]["state"] == "running")
                assert ben.state["operator"] == "Anna" and ben.state["watchers"] == 1
            await ben.until(lambda: ben.state["program"]["state"] == "stopped")
            assert ben.state["operator"] is None and ben.state["trip"] is None
            await ben.do("take")
            await ben.until(lambda: ben.state["you"]["role"] == "operator")
            await ben.do("trip")  # anybody may
            await ben.until(lambda: ben.state["trip"])
            return ben.log

    assert "Anna left the panel in mid-run: its program is ordered to stop" in asyncio.run(drive())


def listeners(pids: list[int]) -> dict[int, set[tuple[str, str]]]:
    """Kind and address (as in /proc/net) of the sockets on which each process listens."""
    owner = {}
    for pid in pids:
        for link in Path(f"/proc/{pid}/fd").iterdir():
            with contextlib.suppress(OSError):
                owner[os.readlink(link)] = pid
    found: dict[int, set[tuple[str, str]]] = {pid: set() for pid in pids}
    for table in ("tcp", "tcp6", "udp", "udp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            connected = fields[2].split(":")[1] != "0000"
            if (pid := owner.get(f"socket:[{fields[9]}]")) and not connected:
                found[pid].add((table[:3], fields[1].split(":")[0]))
    return found


@pytest.mark.slow  # a minute each
@pytest.mark.parametrize("which", ["plant", "controller"])
def test_a_process_that_dies_is_announced_and_started_anew(panel, which):
    async def drive():
        async with Visitor(panel.url) as anna:
            await anna.start("Anna")
            served = {pid for pid, sockets in listeners(panel.children()).items() if ("udp", HERE) in sockets}
            mapped = {pid for pid in panel.children() if "ring-1" in Path(f"/proc/{pid}/maps").read_text()}
            (victim,) = served if which == "plant" else mapped
            os.kill(victim, signal.SIGKILL)
            await anna.until(lambda: anna.state["pressure"] == "off")
            assert not anna.state["link"]["ok"]
            if which == "controller":  # the plant is free again for another client after ten seconds of silence
                await asyncio.sleep(11.0)
            await anna.start("Anna")
            return anna.log

    said = {"plant": "does not answer", "controller": "the controller's process ended"}[which]
    assert any(said in entry for entry in asyncio.run(drive()))


def test_an_open_panel_listens_to_others_on_its_page_alone_and_needs_its_token(tmp_path):
    panel = Panel(tmp_path, "--host", "0.0.0.0")
    try:
        assert panel.listens() <= {("udp", HERE), ("tcp", "00000000")}
        bare, _, secret = panel.url.partition("?token=")
        bare = bare.replace("0.0.0.0", "127.0.0.1")
        for address in (bare, f"{bare}?token=wrong", f"{bare}view/"):
            with pytest.raises(OSError, match="403"):
                urlopen(address)
        assert b"<html" in urlopen(f"{bare}?token={secret}").read()
        cookie = {"Cookie": f"lhpost6_panel={secret}"}
        assert urlopen(Request(f"{bare}panel.js", headers=cookie)).status == 200
    finally:
        panel.close(signal.SIGKILL)


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this computer")
@pytest.mark.slow
def test_a_page_in_a_browser_drives_the_table(panel, tmp_path):
    async def press(tab: Tab, name: str):
        await wait(tab, f"!document.getElementById('{name}').disabled", name)
        await tab.evaluate(f"document.getElementById('{name}').click()")

    async def enter(tab: Tab, name: str, value: str):
        await wait(tab, f"!document.getElementById('{name}').disabled", name)
        event = "new Event('change', { bubbles: true })"
        await tab.evaluate(
            f"{{ const box = document.getElementById('{name}'); box.value = '{value}'; box.dispatchEvent({event}) }}"
        )

    async def wait(tab: Tab, condition: str, what: str = ""):
        end = time.monotonic() + PATIENCE
        while not await tab.evaluate(f"Boolean({condition})"):
            text = await tab.evaluate("document.getElementById('refusal').textContent")
            assert time.monotonic() < end, (what or condition, text)
            await asyncio.sleep(0.05)

    def reads(name: str, word: str) -> str:
        return f"document.getElementById('{name}').textContent.includes('{word}')"

    async def choose_a_motion(tab: Tab):
        """After a sine, with Run pressed at once: the motion is checked, loaded and run, and the sine is not."""
        await enter(tab, "cycles", "1")
        await press(tab, "run")
        await wait(tab, reads("log", "runs the program sine"))
        await wait(tab, reads("program-state", "stopped"))
        await tab.evaluate("document.getElementById('motion').value = 'ridgecrest-ccc'")
        await enter(tab, "motion-scale", "0.1")
        await press(tab, "run")
        await wait(tab, reads("next-step", "Checking ridgecrest-ccc"))
        assert await tab.evaluate(
            "document.getElementById('run').disabled && !document.getElementById('stop').disabled"
        )
        await wait(tab, reads("program-state", "running"))
        logged = await tab.evaluate("[...document.querySelectorAll('#log span')].map((span) => span.textContent)")
        assert logged[:2] == ["runs the program ridgecrest-ccc", "loads ridgecrest-ccc at scale 0.1"]  # newest first
        await press(tab, "stop")
        await wait(tab, reads("program-state", "stopped"))
        await tab.evaluate("document.getElementById('source-generator').click()")
        await enter(tab, "cycles", "10")

    async def look(tab: Tab):
        await wait(tab, reads("machine", "LHPOST6"))
        await wait(tab, reads("link", "not connected yet"))
        assert await tab.evaluate("document.getElementById('platen-state').textContent") == "unknown"
        await wait(tab, "!document.getElementById('trip').disabled", "anybody may trip the table")
        await enter(tab, "name", "Anna")
        await press(tab, "take")
        for name in ("pressure-low", "pressure-high"):
            await press(tab, name)
            await wait(tab, reads("pressure-state", name.removeprefix("pressure-")))
            assert await tab.evaluate("document.getElementById('platen-state').textContent") == "parked"
        await press(tab, "raise")
        await wait(tab, reads("platen-state", "raised"))
        await tab.evaluate("document.getElementById('span-x').focus()")
        await enter(tab, "span-x", "05")  # what is left of a decimal comma
        await wait(tab, reads("refusal", "enter one in mm, with a decimal point"))
        await wait(tab, "document.getElementById('span-x').value === '0'", "the span as it was")
        assert await tab.evaluate("getSelection().toString()") == "0"  # what is typed next replaces it
        await enter(tab, "span-x", "100")
        await wait(tab, reads("log", "sets the span of x to 100 mm"))
        await enter(tab, "interlock-displacement", "50")
        await wait(tab, "document.getElementById('park').title.includes('limit to at least 95 % first')")
        assert await tab.evaluate("document.getElementById('park').disabled")
        await enter(tab, "interlock-displacement", "100")
        await wait(tab, "!document.getElementById('park').disabled")
        await choose_a_motion(tab)
        await press(tab, "record")
        await enter(tab, "frequency", "0.5")
        await press(tab, "run")
        await wait(tab, reads("program-state", "running"))
        assert panel.listens() == {("udp", HERE), ("tcp", HERE)}  # to nobody beyond this computer
        async with Visitor(panel.url) as ben:
            assert ben.state["operator"] == "Anna"
            await ben.refused("another has the controls", "take")
            await ben.refused("watchers do not drive", "span", axis="x", value=0.1)
        await wait(
            tab, "Math.abs(parseFloat(document.getElementById('feedback-x').textContent.replace('−', '-'))) > 20"
        )
        await tab.key("Escape")
        await wait(tab, "document.body.classList.contains('tripped')")
        await wait(tab, reads("platen-state", "held"))
        sections = "[...document.querySelectorAll('section')].filter((box) => box.scrollWidth > box.clientWidth)"
        assert await tab.evaluate(f"{sections}.map((box) => box.textContent)") == []  # nothing beyond its box
        await press(tab, "reset")
        await wait(tab, "!document.body.classList.contains('tripped')")
        await press(tab, "record")
        await wait(tab, reads("recordings", "test-1.nc"))
        frame = "document.getElementById('view').contentDocument.getElementById('status')"
        await wait(tab, f"{frame}.textContent.includes('force')", "the 3-D view")
        os.kill(panel.process.pid, signal.SIGSTOP)  # a server that falls silent: the page connects anew
        await wait(tab, "document.body.classList.contains('lost')")
        os.kill(panel.process.pid, signal.SIGCONT)
        await wait(tab, reads("notice", "the controls are free: take them again"))
        await wait(tab, reads("role", "watcher"))
        await press(tab, "take")  # an order does not take the notice off the page
        await wait(tab, reads("role", "operator"))
        assert not await tab.evaluate("document.getElementById('notice-box').hidden")
        await tab.evaluate("document.getElementById('notice-close').click()")
        assert await tab.evaluate("document.getElementById('notice-box').hidden")
        return tab.faults

    assert browse(tmp_path, panel.url, look, (1300, 900), 4 * PATIENCE) == []
    (recording,) = panel.folder.glob("*.nc")
    assert np.abs(load_record(recording)["platen_displacement"].values[:, 0]).max() > 0.02


@pytest.mark.slow
def test_a_script_measures_how_a_panel_keeps_time(tmp_path):
    ended = script("panel_pace.py", "--minutes", "0.05", "--no-page", "--out", tmp_path)
    assert ended.returncode == 0, ended.stderr
    found = json.loads((tmp_path / "panel_pace.json").read_text())
    assert found["samples"] > 0 and found["program"] == "running" and found["trip"] is None


@pytest.mark.fast
def test_the_numbers_of_the_panel_have_units_and_sources():
    assert all(quantity.source for quantity in panel_numbers().quantities.values())

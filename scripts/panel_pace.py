"""Whether a panel keeps real time, and how often its page is drawn, while a sine of 100 mm and 0.5 Hz runs along x.

    python scripts/panel_pace.py [--minutes 10] [--no-page] [--no-view] [--out DIR]

Starts a panel, takes its controls over the websocket, raises the platen and runs the sine; a page in Chromium without a
window watches meanwhile, whose frames are counted. Prints the share of samples that were missed or late, safe holds and
frames a second, and writes panel_pace.json; beside it, measured before, the share of samples for which a process that
does nothing else is woken too late by this computer (`bare`), below which no panel can be. Chromium without a window
draws WebGL by the processor, which takes time that it does not take where a graphics card draws; --no-view leaves the
3-D view out of the page.
"""

import asyncio
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from browser import BROWSER, Tab, browse
from tornado.websocket import websocket_connect

from lhpost6_pin.core.files import refuse_folder, write_whole
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.panel.worker import come_first

SIZE = (1300, 900)
ALONE = 60.0  # [s] for which the computer is measured without a panel
PATIENCE = 120.0  # [s] for the start, and for a page to load
COUNT_FRAMES = """{
  window.drawn = [];
  const count = (time) => { window.drawn.push(time); requestAnimationFrame(count); };
  requestAnimationFrame(count);
}"""
"""Keeps the times of the page's frames [ms], to which the 3-D view in it belongs."""


class Operator:
    """Has the controls over the panel's websocket; `state` is what was heard last."""

    def __init__(self, url: str) -> None:
        """Nothing is open until `start`."""
        self._url = url.replace("http", "ws", 1) + "socket"
        self.state: dict[str, Any] = {}

    async def _hear(self) -> None:
        while (text := await self._socket.read_message()) is not None:
            message = json.loads(text)
            if message["kind"] == "refusal":
                raise SystemExit(f"error: the panel refuses: {message['what']}")
            if message["kind"] == "state":
                self.state = message

    async def _do(self, reached: Callable[[dict[str, Any]], bool], do: str, **more: Any) -> None:
        await self._socket.write_message(json.dumps({"do": do, **more}))
        while not (self.state and reached(self.state)):
            if self._hearing.done():
                self._hearing.result()
            await asyncio.sleep(0.05)

    async def start(self) -> None:
        """From nothing to a sine that runs until stopped."""
        self._socket = await websocket_connect(self._url)
        self._hearing = asyncio.create_task(self._hear())
        await self._do(lambda state: state["you"]["role"] == "operator", "take")
        for to in ("low", "high"):
            await self._do(lambda state, to=to: state["pressure"] == to, "pressure", to=to)  # type: ignore[misc]
        await self._do(lambda state: state["platen"] == "raised", "raise")
        await self._do(lambda state: state["span"][0] == 0.1, "span", axis="x", value=0.1)
        await self._do(
            lambda s: s["program"]["name"] == "sine 0.5 Hz", "generator", wave="sine", frequency=0.5, axes=["x"]
        )
        await self._do(lambda state: state["program"]["state"] == "running", "run")


async def watch(url: str, minutes: float, view: bool, tab: Tab | None) -> dict[str, Any]:
    """Drive the table for so long: link at the end, samples and their late share of that time, times of frames [ms]."""
    operator = Operator(url)
    await asyncio.wait_for(operator.start(), PATIENCE)
    before = operator.state["link"]
    if tab is not None:
        if not view:
            await tab.evaluate("document.getElementById('view').style.display = 'none'")
        await tab.evaluate(COUNT_FRAMES)
    await asyncio.sleep(60.0 * minutes)
    after, state = operator.state["link"], operator.state
    samples = after["samples"] - before["samples"]
    late = after["late"] * after["samples"] - before["late"] * before["samples"]
    frames = [] if tab is None else await tab.evaluate("window.drawn")
    return {
        "seconds": 60.0 * minutes,
        "samples": samples,
        "late": late / samples,
        "holds": after["holds"] - before["holds"],
        "trip": state["trip"],
        "program": state["program"]["state"],
        "frames": frames,
        "faults": [] if tab is None else tab.faults,
    }


def bare(seconds: float) -> float:
    """Share of the instants of a panel's samples to which a process that only sleeps is later than one sample."""
    late, start = 0, time.perf_counter()
    samples = round(seconds * SAMPLE_RATE)
    for k in range(samples):
        due = start + k / SAMPLE_RATE
        while (left := due - time.perf_counter()) > 0.0:
            time.sleep(left)
        late += -left > 1.0 / SAMPLE_RATE
    return late / samples


def frames_per_second(times: list[float]) -> dict[str, float]:
    """Mean of all frames, and the fewest in any second."""
    each = np.bincount(((np.array(times) - times[0]) / 1000.0).astype(int))[:-1]
    return {"mean": float(each.mean()), "fewest": float(each.min()), "seconds below 25": float(np.mean(each < 25))}


def main(
    minutes: Annotated[float, typer.Option(help="How long the sine runs.")] = 10.0,
    page: Annotated[bool, typer.Option(help="Open the page in Chromium meanwhile.")] = True,
    view: Annotated[bool, typer.Option(help="With the 3-D view in the page.")] = True,
    out: Annotated[Path, typer.Option(help="Directory of the results.")] = Path("out/panel_pace"),
) -> None:
    """Start a panel, drive it and print how it kept time."""
    if page and BROWSER is None:
        raise SystemExit("error: no Chromium on this computer; --no-page measures without one")
    refuse_folder(out)
    with ProcessPoolExecutor(1, initializer=come_first) as alone:
        woken_late = alone.submit(bare, ALONE).result()
    command = [sys.executable, "-c", "from lhpost6_pin.cli import main; main()", "panel", "--no-open"]
    command += ["--out", str(out / "panel")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as panel:
        try:
            assert panel.stdout is not None
            url = panel.stdout.readline().split()[0]
            if page:
                with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
                    patience = 60.0 * minutes + 3 * PATIENCE
                    found = browse(Path(folder), url, lambda tab: watch(url, minutes, view, tab), SIZE, patience)
            else:
                found = asyncio.run(watch(url, minutes, view, None))
        finally:
            panel.terminate()
    found["bare"] = woken_late
    if frames := found.pop("frames"):
        found["frames"] = frames_per_second(frames)
    text = json.dumps(found, indent=2)
    with write_whole(out / "panel_pace.json") as path:
        path.write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    typer.run(main)

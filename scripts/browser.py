"""A page in Chromium without a window: a picture of it, and what it complains of.

    python scripts/browser.py PAGE.html --out picture.png [--size 1280x800] [--after 2] [--print]

Also the tests' way to a browser, over its DevTools protocol. WebGL is drawn by the processor.
"""

import asyncio
import base64
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from PIL import Image
from tornado.websocket import WebSocketClientConnection, websocket_connect

BROWSER = next((b for b in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if b), None)

FLAGS = "--headless --no-sandbox --use-gl=swiftshader --enable-unsafe-swiftshader --hide-scrollbars"
WAIT = 120.0  # [s] for all that is done with a page: this computer may be busy


class Tab:
    """One page: `faults` are its errors, warnings of the security policy and failed requests, in words."""

    def __init__(self, socket: WebSocketClientConnection) -> None:
        """Speak to the page at the other end."""
        self._socket, self._last = socket, 0
        self.faults: list[str] = []

    async def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Answer to one command of the protocol."""
        self._last += 1
        await self._socket.write_message(json.dumps({"id": self._last, "method": method, "params": parameters}))
        while True:
            answer = json.loads(str(await self._socket.read_message()))
            if answer.get("id") == self._last:
                assert "error" not in answer, answer
                return dict(answer["result"])
            self._note(answer)

    def _note(self, event: dict[str, Any]) -> None:
        what = event.get("params", {})
        if event["method"] == "Runtime.exceptionThrown":
            self.faults.append(str(what["exceptionDetails"]))
        elif event["method"] == "Runtime.consoleAPICalled" and what["type"] in ("error", "assert"):
            self.faults.append(str(what["args"]))
        elif event["method"] == "Log.entryAdded" and what["entry"]["level"] == "error":
            self.faults.append(str(what["entry"]))

    async def evaluate(self, script: str) -> Any:
        """Value of an expression, awaited if it is a promise."""
        found = await self.ask("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    async def key(self, name: str) -> None:
        """Press and release a key."""
        text = {"text": name} if len(name) == 1 else {}
        for kind in ("keyDown", "keyUp"):
            await self.ask("Input.dispatchKeyEvent", type=kind, key=name, **(text if kind == "keyDown" else {}))

    async def picture(self, path: Path) -> np.ndarray:
        """What is seen, as (height, width, 3), and as a PNG file."""
        shot = await self.ask("Page.captureScreenshot")
        path.write_bytes(base64.b64decode(shot["data"]))
        return np.asarray(Image.open(path).convert("RGB")).astype(int)

    async def paper(self, path: Path) -> None:
        """What would be printed, as a PDF file."""
        printed = await self.ask("Page.printToPDF", printBackground=True)
        path.write_bytes(base64.b64decode(printed["data"]))


def browse(
    folder: Path,
    url: str,
    look: Callable[[Tab], Awaitable[Any]],
    size: tuple[int, int] = (1280, 800),
    wait: float = WAIT,
) -> Any:
    """What `look` makes of a page that has loaded, within `wait` [s]; folder takes the browser's profile."""
    command = [str(BROWSER), *FLAGS.split(), f"--window-size={size[0]},{size[1]}", "--remote-debugging-port=0"]
    command += [f"--user-data-dir={folder / 'profile'}", "about:blank"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as browser:
        try:
            assert browser.stderr is not None
            port = next(
                m[1] for line in browser.stderr if (m := re.search(r"listening on ws://127.0.0.1:(\d+)/", line))
            )
            return asyncio.run(asyncio.wait_for(_visit(port, url, look, size), wait))
        finally:
            browser.kill()


async def _visit(port: str, url: str, look: Callable[[Tab], Awaitable[Any]], size: tuple[int, int]) -> Any:
    from tornado.httpclient import AsyncHTTPClient

    pages = json.loads((await AsyncHTTPClient().fetch(f"http://127.0.0.1:{port}/json/list")).body)
    address = next(page["webSocketDebuggerUrl"] for page in pages if page["type"] == "page")
    socket = await websocket_connect(address, max_message_size=2**28)
    tab = Tab(socket)
    for domain in ("Page", "Runtime", "Log"):
        await tab.ask(f"{domain}.enable")
    width, height = size  # a window is wider than a phone, and lower than asked by its frame
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    await tab.ask("Emulation.setDeviceMetricsOverride", **metrics)
    await tab.ask("Page.navigate", url=url)
    while not await tab.evaluate("document.readyState === 'complete' && location.href !== 'about:blank'"):
        await asyncio.sleep(0.05)
    try:
        return await look(tab)
    finally:
        socket.close()


def main(
    page: Annotated[str, typer.Argument(help="HTML file, or an address.")],
    out: Annotated[Path, typer.Option(help="The picture, PNG; with --print the pages, PDF.")] = Path("out/page.png"),
    size: Annotated[str, typer.Option(help="Width and height of the window [pixels].")] = "1280x800",
    after: Annotated[float, typer.Option(help="Seconds to wait for what the page draws.")] = 2.0,
    paper: Annotated[bool, typer.Option("--print", help="As it would be printed.")] = False,
) -> None:
    """Picture a page and say what it complains of; exit code 1 if it does."""
    if BROWSER is None:
        raise SystemExit("error: no Chromium on this computer")
    width, height = (int(x) for x in size.split("x"))
    out.parent.mkdir(parents=True, exist_ok=True)

    async def look(tab: Tab) -> list[str]:
        await asyncio.sleep(after)
        await (tab.paper(out) if paper else tab.picture(out))
        return tab.faults

    url = page if "://" in page else Path(page).resolve().as_uri()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        faults = browse(Path(folder), url, look, (width, height))
    print(out, *faults, sep="\n")
    sys.exit(bool(faults))


if __name__ == "__main__":
    typer.run(main)

"""Chromium without a window, asked over its DevTools protocol: what a page shows, says and complains of."""

import asyncio
import base64
import json
import re
import shutil
import subprocess
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tornado.websocket import WebSocketClientConnection, websocket_connect

BROWSER = next((b for b in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if b), None)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this computer")

FLAGS = "--headless --no-sandbox --use-gl=swiftshader --enable-unsafe-swiftshader --hide-scrollbars"
WAIT = 120.0  # [s] for the browser to start: this computer may be busy


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


def browse(folder: Path, url: str, look: Callable[[Tab], Awaitable[Any]], size: tuple[int, int] = (1280, 800)) -> Any:
    """What `look` makes of a page that has loaded; folder takes the browser's profile."""
    command = [str(BROWSER), *FLAGS.split(), f"--window-size={size[0]},{size[1]}", "--remote-debugging-port=0"]
    command += [f"--user-data-dir={folder / 'profile'}", "about:blank"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as browser:
        try:
            assert browser.stderr is not None
            port = next(
                m[1] for line in browser.stderr if (m := re.search(r"listening on ws://127.0.0.1:(\d+)/", line))
            )
            return asyncio.run(asyncio.wait_for(_visit(port, url, look), WAIT))
        finally:
            browser.kill()


async def _visit(port: str, url: str, look: Callable[[Tab], Awaitable[Any]]) -> Any:
    from tornado.httpclient import AsyncHTTPClient

    pages = json.loads((await AsyncHTTPClient().fetch(f"http://127.0.0.1:{port}/json/list")).body)
    address = next(page["webSocketDebuggerUrl"] for page in pages if page["type"] == "page")
    socket = await websocket_connect(address, max_message_size=2**28)
    tab = Tab(socket)
    for domain in ("Page", "Runtime", "Log"):
        await tab.ask(f"{domain}.enable")
    await tab.ask("Page.navigate", url=url)
    while not await tab.evaluate("document.readyState === 'complete' && location.href !== 'about:blank'"):
        await asyncio.sleep(0.05)
    try:
        return await look(tab)
    finally:
        socket.close()

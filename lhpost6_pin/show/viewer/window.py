"""Where meshcat's commands go: into a page that plays off line, or to browsers on this computer.

meshcat draws into any "window" with a `send`. Its own server listens on all network interfaces and starts a second
process; neither of the two here does. `Recorder` keeps the commands for a page; `LoopbackWindow` serves a page on
127.0.0.1 and sends it the commands as they come, those sent before included.
"""

import asyncio
import json
import socket
import threading
from collections.abc import Mapping
from contextlib import suppress
from types import TracebackType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["HOSTS", "LoopbackWindow", "Placed", "Recorder", "SharedWindow", "Window", "pack_command", "packed_array"]
__all__ += ["write_message"]

FLOAT_ARRAY = 0x17  # meshcat's msgpack extension type for a Float32Array
LOOPBACK = "127.0.0.1"
HOSTS = r"(127\.0\.0\.1|localhost)"  # requests by the name of another site are refused


def pack_command(command: Any) -> bytes:
    """Pack one meshcat command as its page reads it."""
    import umsgpack

    packed: bytes = umsgpack.packb(command.lower())
    return packed


def packed_array(values: NDArray[Any]) -> Any:
    """Values as the typed array of meshcat's page, row after row in single precision."""
    import umsgpack

    return umsgpack.Ext(FLOAT_ARRAY, np.ascontiguousarray(values, "<f4").tobytes())


class Placed:
    """meshcat's command that places an object, with its matrix as one array: packed in a tenth of the time."""

    def __init__(self, path: str, matrix: NDArray[Any]) -> None:
        """Place the object at a path by a matrix (4, 4)."""
        self._path, self._matrix = path, matrix

    def lower(self) -> dict[str, Any]:
        """As meshcat's own commands."""
        return {"type": "set_transform", "path": self._path, "matrix": packed_array(self._matrix.T.ravel())}


class Window(Protocol):
    """What meshcat draws into."""

    def send(self, command: Any) -> None:
        """Take one command."""


class Recorder:
    """A meshcat window that keeps the commands it is sent."""

    def __init__(self) -> None:
        """Begin with no commands."""
        self.commands: list[bytes] = []

    def send(self, command: Any) -> None:
        """Keep one command."""
        self.commands.append(pack_command(command))


class SharedWindow:
    """A meshcat window for any number of browsers, a part of a server: its `handlers`, in a loop that `joins` it.

    A late browser gets the last command of each kind to each object. `send` may be called from any thread.
    """

    def __init__(self, page: str) -> None:
        """Prepare to show a live `page`."""
        self._page = page
        self._commands: dict[tuple[str, str, str], bytes] = {}
        self._browsers: set[Any] = set()
        self._lock = threading.Lock()
        self._ready, self._connected = threading.Event(), threading.Event()
        self.paused = threading.Event()  # by a browser, until one plays again or the last one leaves

    @property
    def watched(self) -> bool:
        """Whether a browser is connected."""
        return bool(self._browsers)

    def wait(self, seconds: float) -> bool:
        """Wait until a browser is connected, at most so long [s]; True if one is."""
        return self._connected.wait(seconds)

    def show_state(self, status: str, meters: Mapping[str, float]) -> None:
        """Show words, and shares of capacities by name (-1 to 1 is within them), in the connected browsers."""
        with self._lock:
            if self._ready.is_set():
                message = json.dumps({"status": status, "meters": meters})
                self._loop.call_soon_threadsafe(self._hand_out, message)

    def send(self, command: Any) -> None:
        """Keep one command for later browsers and send it to those connected."""
        fields = command.lower()
        packed = pack_command(command)
        with self._lock:
            self._commands[fields["type"], fields.get("path", ""), fields.get("property", "")] = packed
            if self._ready.is_set():
                self._loop.call_soon_threadsafe(self._hand_out, packed)

    def join(self, loop: asyncio.AbstractEventLoop) -> None:
        """Send by a loop from now on."""
        self._loop = loop
        self._ready.set()

    def handlers(self, at: str = "/") -> list[Any]:
        """Handlers of a tornado application: the page at an address that ends in ``/``, and its commands below."""
        return _handlers(self, at)

    def _hand_out(self, message: bytes | str) -> None:
        for browser in list(self._browsers):
            write_message(browser, message)

    def _welcome(self, browser: Any) -> None:
        with self._lock:
            self._browsers.add(browser)
            commands = list(self._commands.values())
        for packed in commands:
            write_message(browser, packed)
        self._connected.set()


class LoopbackWindow(SharedWindow):
    """A meshcat window served on 127.0.0.1 and nowhere else, on a free port, while used in a ``with`` block."""

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{LOOPBACK}:{self._port}/"

    def __enter__(self) -> "LoopbackWindow":
        """Start to serve, in a thread of its own. Raises OSError if there is no free port."""
        from tornado.netutil import bind_sockets

        sockets = bind_sockets(0, LOOPBACK, family=socket.AF_INET)
        self._port = int(sockets[0].getsockname()[1])
        self._thread = threading.Thread(target=asyncio.run, args=(self._serve(sockets),), daemon=True)
        self._thread.start()
        self._ready.wait()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop serving."""
        with self._lock:
            self._ready.clear()
            self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()

    async def _serve(self, sockets: list[socket.socket]) -> None:
        from tornado.httpserver import HTTPServer
        from tornado.web import Application

        self._stop = asyncio.Event()
        application = Application()
        application.add_handlers(HOSTS, self.handlers())
        server = HTTPServer(application)
        server.add_sockets(sockets)
        self.join(asyncio.get_running_loop())
        await self._stop.wait()
        server.stop()
        for browser in list(self._browsers):
            browser.close()
        await server.close_all_connections()


def write_message(browser: Any, message: bytes | str) -> None:
    """Send a browser one message, unless it is closing: tornado raises at once, or in the future that it returns."""
    from tornado.websocket import WebSocketClosedError

    with suppress(WebSocketClosedError):
        written = browser.write_message(message, binary=isinstance(message, bytes))
        written.add_done_callback(lambda done: done.cancelled() or done.exception())


def _handlers(window: SharedWindow, at: str) -> list[Any]:
    """Page at an address, commands by websocket at ``commands`` below it."""
    from tornado.web import RequestHandler
    from tornado.websocket import WebSocketHandler

    class Page(RequestHandler):
        def get(self) -> None:
            self.set_header("Cache-Control", "no-store")
            self.finish(window._page)

    class Commands(WebSocketHandler):  # tornado lets only pages of the same origin connect
        def open(self, *_: str, **__: str) -> None:
            window._welcome(self)

        def on_message(self, message: str | bytes) -> None:
            """Pause or play; other messages of a browser are ignored."""
            if message == "pause":
                window.paused.set()
            elif message == "play":
                window.paused.clear()

        def on_close(self) -> None:
            window._browsers.discard(self)
            if not window._browsers:
                window.paused.clear()

    return [(at, Page), (f"{at}commands", Commands)]

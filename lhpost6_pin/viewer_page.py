"""Where meshcat's commands go: a page that plays off line, or browsers that look from this computer.

meshcat draws into any "window" with a `send`. Its own server listens on all network interfaces and starts a second
process; neither of the two here does. `Recorder` keeps the commands, `render_page` puts them into one HTML file.
`LoopbackWindow` serves that page on 127.0.0.1 and hands it the commands as they come, those sent before included.
"""

import asyncio
import base64
import html
import json
import socket
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["LoopbackWindow", "Recorder", "pack_command", "packed_array", "render_page"]

FLOAT_ARRAY = 0x17  # meshcat's msgpack extension type for a Float32Array
LOOPBACK = "127.0.0.1"
HOSTS = r"(127\.0\.0\.1|localhost)"  # a page of another site that points its name here is refused

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'unsafe-inline'; \
style-src 'unsafe-inline'; img-src data: blob:; connect-src {connect}">
<title>{title}</title>
<style>
body {{ margin:0; }}
#meshcat-pane {{ width:100vw; height:100vh; overflow:hidden; }}
#caption {{ position:absolute; left:0; top:0; margin:1rem; padding:.5rem .8rem; max-width:calc(100vw - 300px);
  border-radius:.3rem; background:rgba(255,255,255,.85); color:#1b1f24;
  font:14px/1.45 system-ui,"Liberation Sans",sans-serif; }}
#caption b {{ font-size:1.1em; }}
.kind {{ white-space:nowrap; margin-right:.8em; }}
.mark {{ display:inline-block; width:.75em; height:.75em; margin-right:.3em; border-radius:2px; }}
</style>
</head>
<body>
<div id="meshcat-pane"></div>
<div id="caption"><b>{title}</b><br>{note}<br>{legend}<br>
<small>Drag to turn, wheel to zoom; "Open Controls" has play, pause, time and speed.</small></div>
<script>{library}</script>
<script>
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
for (const packed of {commands})
  viewer.handle_command_bytearray(Uint8Array.from(atob(packed), (c) => c.charCodeAt(0)));
{connection}
</script>
</body>
</html>
"""


def pack_command(command: Any) -> bytes:
    """Pack one meshcat command as its page reads it."""
    import umsgpack

    packed: bytes = umsgpack.packb(command.lower())
    return packed


def packed_array(values: NDArray[Any]) -> Any:
    """Values as the typed array of meshcat's page, row after row in single precision."""
    import umsgpack

    return umsgpack.Ext(FLOAT_ARRAY, np.ascontiguousarray(values, "<f4").tobytes())


def render_page(
    title: str, note: str, legend: Mapping[str, str], commands: Sequence[bytes] = (), *, live: bool = False
) -> str:
    """Return a page that draws `commands` and loads nothing; a live one then asks its own server for more.

    legend maps words to colours such as ``#0072B2``.
    """
    import meshcat

    library = Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js"
    marks = (
        f'<span class="kind"><span class="mark" style="background:{html.escape(colour)}"></span>'
        f"{html.escape(word)}</span> "
        for word, colour in legend.items()
    )
    return PAGE.format(
        connect="'self'" if live else "'none'",
        title=html.escape(title),
        note=html.escape(note),
        legend="".join(marks),
        library=library.read_text(encoding="utf-8").replace("</script", "<\\/script"),
        commands=json.dumps([base64.b64encode(command).decode("ascii") for command in commands]),
        connection="viewer.connect(`ws://${location.host}/commands`);" if live else "",
    )


class Recorder:
    """A meshcat window that keeps the commands it is sent."""

    def __init__(self) -> None:
        """Begin with no commands."""
        self.commands: list[bytes] = []

    def send(self, command: Any) -> None:
        """Keep one command."""
        self.commands.append(pack_command(command))


class LoopbackWindow:
    """A meshcat window served on 127.0.0.1 and nowhere else, while used in a ``with`` block.

    A browser that comes late gets the last command of each kind to each object. `send` may be called from any thread.
    """

    def __init__(self, page: str) -> None:
        """Prepare to serve a live `page` on a port that the system chooses."""
        self._page = page
        self._commands: dict[tuple[str, str, str], bytes] = {}
        self._browsers: set[Any] = set()
        self._lock = threading.Lock()
        self._ready = threading.Event()

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{LOOPBACK}:{self._port}/"

    def send(self, command: Any) -> None:
        """Keep one command for browsers to come and hand it to those that look."""
        fields = command.lower()
        packed = pack_command(command)
        with self._lock:
            self._commands[fields["type"], fields.get("path", ""), fields.get("property", "")] = packed
            if self._ready.is_set():
                self._loop.call_soon_threadsafe(self._hand_out, packed)

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

        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        server = HTTPServer(_application(self))
        server.add_sockets(sockets)
        self._ready.set()
        await self._stop.wait()
        server.stop()
        for browser in list(self._browsers):
            browser.close()
        await server.close_all_connections()

    def _hand_out(self, packed: bytes) -> None:
        from tornado.websocket import WebSocketClosedError

        for browser in list(self._browsers):
            with suppress(WebSocketClosedError):  # one that is just leaving
                browser.write_message(packed, binary=True)

    def _welcome(self, browser: Any) -> None:
        with self._lock:
            self._browsers.add(browser)
            commands = list(self._commands.values())
        for packed in commands:
            browser.write_message(packed, binary=True)


def _application(window: LoopbackWindow) -> Any:
    """Page at ``/``, commands by websocket at ``/commands``, for requests to this computer by name only."""
    from tornado.web import Application, RequestHandler
    from tornado.websocket import WebSocketHandler

    class Page(RequestHandler):
        def get(self) -> None:
            self.set_header("Cache-Control", "no-store")
            self.finish(window._page)

    class Commands(WebSocketHandler):  # tornado lets only pages of the same origin connect
        def open(self, *_: str, **__: str) -> None:
            window._welcome(self)

        def on_message(self, message: str | bytes) -> None:
            """Nothing a browser says is heard."""

        def on_close(self) -> None:
            window._browsers.discard(self)

    application = Application()
    application.add_handlers(HOSTS, [(r"/", Page), (r"/commands", Commands)])
    return application

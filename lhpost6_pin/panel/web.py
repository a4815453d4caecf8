"""The panel's page on a server: files, one websocket for each browser, the 3-D view."""

import asyncio
import json
import re
import secrets
import signal
import socket
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..core.arrays import Array
from ..core.jsonable import jsonable
from ..core.names import AXES, SAMPLE_RATE
from ..mechanics.plant import make_plant
from ..motions import list_motions
from ..show.viewer import LiveScene, SharedWindow
from ..show.viewer.window import HOSTS, write_message
from ..simulation.limit_use import plant_limits, sample_shares
from ..simulation.snapshot import Snapshot
from .client import Client
from .interlocks import INTERLOCKS
from .programs import WAVES
from .session import Session
from .worker import panel_numbers

__all__ = ["PanelServer"]

RATE = 25.0
"""Messages a second to each browser."""
_EVERY = 8  # samples between those drawn by the scopes
_TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; frame-src 'self'; "
    "img-src 'self' data:"
)


class PanelServer:
    """The server of a session's page: on this computer only, or, with a token, at an address for others."""

    def __init__(self, session: Session, host: str, port: int, trainer: bool) -> None:
        """Listen; raises OSError if the address cannot be had."""
        from tornado.netutil import bind_sockets

        self._session, self._trainer = session, trainer
        self._local = host in ("127.0.0.1", "localhost")
        self._token = "" if self._local else secrets.token_urlsafe(16)
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._sockets = bind_sockets(port, host, family=family)
        self._port = int(self._sockets[0].getsockname()[1])
        self._host = host
        self._browsers: dict[str, Any] = {}
        self._sent: dict[str, int] = {}  # entries of the journal by browser
        machine = session.machine
        self._scene = LiveScene(machine, machine.name, self._window, bare=True)
        plant = make_plant(machine)
        self._capacity, self._free = plant_limits(plant), [AXES[k] for k in plant.axes]
        self._number = 0
        self._last = np.zeros(session.layout.width)

    def _window(self, page: str) -> SharedWindow:
        self._shared = SharedWindow(page)
        return self._shared

    @property
    def url(self) -> str:
        """Address of the page, with its token if it needs one."""
        at = f"[{self._host}]" if ":" in self._host else self._host
        return f"http://{at}:{self._port}/" + (f"?token={self._token}" if self._token else "")

    def serve(self) -> None:
        """Serve until Ctrl-C or SIGTERM."""
        asyncio.run(self._run())

    async def _run(self) -> None:
        from tornado.httpserver import HTTPServer
        from tornado.web import Application

        stop, loop = asyncio.Event(), asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, stop.set)
        self._loop = loop
        silence = panel_numbers().number("page.silence")  # after which a page that was cut off has left
        application = Application(cookie_secret=secrets.token_hex(16), websocket_ping_interval=silence)
        handlers = [*_handlers(self), *(_guarded(self, rule) for rule in self._shared.handlers("/view/"))]
        application.add_handlers(HOSTS if self._local else ".*", handlers)
        server = HTTPServer(application)
        server.add_sockets(self._sockets)
        self._shared.join(loop)
        due = loop.time()
        try:
            while not stop.is_set():
                self._look()
                due = max(due + 1.0 / RATE, loop.time())
                await asyncio.sleep(due - loop.time())
        finally:
            server.stop()
            for browser in list(self._browsers.values()):
                browser.close()
            await server.close_all_connections()

    def allows(self, token: str | None) -> bool:
        """Whether a request with this token may look."""
        return not self._token or (token is not None and secrets.compare_digest(token, self._token))

    @property
    def token(self) -> str:
        """The token; empty on this computer."""
        return self._token

    # ------------------------------------------------------------------------------------- browsers
    def open(self, browser: Any) -> Client:
        """Take a browser in."""
        self._number += 1
        number = f"b{self._number}"
        loop = self._loop

        def send(kind: str, what: str) -> None:
            loop.call_soon_threadsafe(_write, browser, {"kind": kind, "what": what})

        client = Client(number, partial(send, "refusal"), partial(send, "notice"))
        self._browsers[number], self._sent[number] = browser, 0
        self._session.join(client)
        _write(browser, self._hello())
        return client

    def left(self, client: Client) -> None:
        """Let a browser go."""
        self._browsers.pop(client.number, None)
        self._sent.pop(client.number, None)
        self._session.leave(client)

    def message(self, client: Client, text: str | bytes) -> None:
        """Take what a browser sends."""
        try:
            message = json.loads(text)
        except ValueError:
            message = None
        if isinstance(message, dict):
            self._session.take(client, message)

    def _hello(self) -> dict[str, Any]:
        machine = self._session.machine
        limits = machine.limits
        return {
            "kind": "hello",
            "machine": machine.name,
            "axes": AXES,
            "units": {axis: "mm" if k < 3 else "deg" for k, axis in enumerate(AXES)},
            "axes_free": self._free,
            "actuators": machine.actuator_names,
            "waves": WAVES,
            "motions": [{"name": m.name, "title": m.title} for m in list_motions() if not m.remedy],
            "limits": {name: getattr(limits, name) for name in ("displacement", "velocity", "acceleration")},
            "parks": machine.platen.parked is not None,
            "trainer": self._trainer,
            "view": "view/",
        }

    # ------------------------------------------------------------------------------------- state
    def _look(self) -> None:
        """Take what is new, and send it to all browsers."""
        session = self._session
        rows = session.look()
        if len(rows):
            self._last = rows[-1]
            if self._shared.watched:
                self._draw()
        state = self._state(rows[::_EVERY])
        for number, browser in list(self._browsers.items()):
            client, entries = session.clients[number], session.journal.entries
            own: dict[str, Any] = {"you": {"id": number, "role": session.role(client), "name": client.name}}
            own["log"] = entries[self._sent[number] :]
            self._sent[number] = len(entries)
            _write(browser, state | own)

    def _draw(self) -> None:
        of = self._session.layout.of
        row = self._last[None]
        machine, pressure = self._session.machine, np.nan_to_num(of(row, "strut_pressure")[0])
        struts = -pressure * np.array([strut.area for strut in machine.struts])
        force = np.concatenate([of(row, "actuator_force")[0], struts])
        self._scene.draw(Snapshot(float(row[0, 0]) / SAMPLE_RATE, of(row, "platen_displacement")[0], force))

    def _state(self, rows: Array) -> dict[str, Any]:
        session, status = self._session, self._session.status
        operator = session.operator
        found: dict[str, Any] = {
            "kind": "state",
            "machine": session.machine.name,
            "server": session.server,
            "time": self._last[0] / SAMPLE_RATE,
            "operator": operator.name if operator else None,
            "watchers": len(session.clients) - (operator is not None),
            "link": session.link_state(),
            "pressure": status.pressure if status else "off",
            "platen": status.platen if status else "unknown",
            "barred": dict(zip(("raise", "park"), status.barred if status else ("", ""), strict=True)),
            "trip": (status and status.trip) or None,
            "setpoint": status.setpoint if status else (0.0,) * 6,
            "span": status.span if status else (0.0,) * 6,
            "scale": status.scale if status else 1.0,
            "recording": {"name": session.recording.name, "seconds": session.recording.seconds}
            if session.recording
            else None,
            "writing": list(session.writing),
            "recordings": session.recordings,
            "faults": [_fault(name, on) for name, on in session.faults.items()] if self._trainer else [],
        }
        found["program"] = {
            "name": status.program if status else None,
            "state": status.state if status else "stopped",
            "time": session.layout.of(self._last[None], "program_time").item(),
            "duration": status.duration if status else None,
            "number": status.number if status else 0,
            "checking": session.choice.name,
        }
        count = len(INTERLOCKS)
        shares = session.layout.of(self._last[None], "shares")[0] if status else np.zeros(count)
        stated = (
            (status.limits, status.on, status.where) if status else ((1.0,) * count, (True,) * count, ("",) * count)
        )
        names = ("name", "share", "limit", "on", "where")
        found["interlocks"] = [
            dict(zip(names, row, strict=True)) for row in zip(INTERLOCKS, shares, *stated, strict=True)
        ]
        found["bars"] = self._bars()
        found["scope"] = self._scope(rows)
        plain: dict[str, Any] = jsonable(found)
        return plain

    def _bars(self) -> dict[str, dict[str, float]]:
        of, row, names = self._session.layout.of, self._last[None], self._session.machine.actuator_names
        force, supply = of(row, "actuator_force")[0], float(of(row, "supply_pressure")[0, 0])
        if self._session.status is None or supply == 0.0:  # no row has come yet
            return {"force": {}, "pressure": {}, "spool": {}, "limits": {}}
        limits, share = sample_shares(self._capacity, of(row, "platen_displacement")[0], force)
        pressures: dict[str, float] = {}
        for letter in "ab":
            column = of(row, f"chamber_pressure_{letter}")[0] / supply
            shown = _named([f"{name} {letter.upper()}" for name in names], column)
            pressures |= {k: v for k, v in shown.items() if letter == "a" or v > 0.0}
        spool, command = (of(row, f"spool_{what}")[0] for what in ("position", "command"))
        return {
            "force": _named(names, share),
            "pressure": pressures,
            "spool": _named(names, np.where(np.isfinite(spool), spool, command)),  # a server may show commands alone
            "limits": _named(AXES, limits),
        }

    def _scope(self, rows: Array) -> dict[str, Any]:
        of = self._session.layout.of
        names = {"reference": "reference_displacement", "feedback": "platen_displacement", "force": "actuator_force"}
        names |= {"acceleration_reference": "reference_acceleration", "acceleration": "platen_acceleration"}
        found: dict[str, Any] = {"t": np.round(rows[:, 0] / SAMPLE_RATE, 4).tolist()}
        return found | {name: np.round(of(rows, column), 6).tolist() for name, column in names.items()}


def _fault(name: str, on: bool) -> dict[str, Any]:
    family, _, where = name.partition("@")
    return {"name": family, "where": where or "all", "on": on}


def _named(names: Any, shares: Array) -> dict[str, float]:
    return {name: round(float(x), 4) for name, x in zip(names, shares, strict=True) if np.isfinite(x)}


def _write(browser: Any, message: Mapping[str, Any]) -> None:
    """Send a browser one message, unless it is closing."""
    write_message(browser, json.dumps(message))


def _handlers(server: PanelServer) -> list[Any]:
    """Files of the page, and its websocket."""
    from tornado.web import RequestHandler
    from tornado.websocket import WebSocketHandler

    class File(RequestHandler):
        def get(self, name: str) -> None:
            if not _admitted(self, server):
                return
            path = Path(__file__).with_name(name or "page.html")
            self.set_header("Content-Type", f"{_TYPES[path.suffix]}; charset=utf-8")
            self.set_header("Content-Security-Policy", _POLICY)
            self.set_header("Cache-Control", "no-store")
            self.set_header("X-Content-Type-Options", "nosniff")
            self.finish(path.read_bytes())

    class Socket(WebSocketHandler):  # tornado lets only pages of the same origin connect
        client: Client | None = None

        def prepare(self) -> None:
            _admitted(self, server)

        def open(self, *_: str, **__: str) -> None:
            self.set_nodelay(True)
            self.client = server.open(self)

        def on_message(self, message: str | bytes) -> None:
            if self.client is not None:
                server.message(self.client, message)

        def on_close(self) -> None:
            if self.client is not None:
                server.left(self.client)

    files = [path.name for path in Path(__file__).parent.iterdir() if path.suffix in _TYPES]
    return [(f"/({'|'.join(map(re.escape, files))}|)", File), ("/socket", Socket)]


def _guarded(server: PanelServer, rule: Any) -> Any:
    """A handler of the view that needs the token, too."""
    address, handler = rule

    def prepare(asked: Any) -> None:
        _admitted(asked, server)

    return address, type("Guarded", (handler,), {"prepare": prepare})


def _admitted(handler: Any, server: PanelServer) -> bool:
    """Whether a request has the token, which is kept in a cookie; else it is answered with 403."""
    given = handler.get_argument("token", None)
    if server.allows(given or handler.get_cookie("lhpost6_panel")):
        if given:
            handler.set_cookie("lhpost6_panel", given, httponly=True, samesite="Strict")
        return True
    handler.set_status(403)
    handler.finish("open the address that the panel printed, with its token")
    return False

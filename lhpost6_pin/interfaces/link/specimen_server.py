"""A specimen in Python, served to a plant in another process (`mechanics.remote_specimen`)."""

import logging
import socket
import threading
import time
from typing import Any

import numpy as np

from ...core.arrays import Array
from ...core.errors import LhpostError
from ...mechanics.coupled import CoupledSpecimen, motion_of_numbers, start_coupled, step_coupled
from ...mechanics.remote_specimen import Message, MessageKind, decode_message, encode_message
from .server import answer_one

__all__ = ["ServedSpecimen", "serve_specimen"]

log = logging.getLogger(__name__)

_IDLE = 0.1  # [s] longest wait before looking at the stop event


class ServedSpecimen:
    """Answers of a specimen to datagrams, without sockets. Attributes: steps; rests, times it was put at rest."""

    def __init__(self, specimen: CoupledSpecimen) -> None:
        """Take a specimen; it begins with the first rest."""
        self._specimen, self._memory = specimen, None
        self._started, self._time = False, 0.0
        self._last: tuple[int, int] | None = None
        self._answer = b""
        self.steps = self.rests = 0

    def receive(self, datagram: bytes) -> bytes | None:
        """Answer to a datagram; None if it is no request."""
        try:
            asked = decode_message(datagram)
        except ValueError as error:
            log.debug("datagram: %s", error)
            return None
        if asked.kind not in (MessageKind.DESCRIBE, MessageKind.REST, MessageKind.STEP):
            return None
        if (asked.session, asked.sequence) == self._last:
            return self._answer
        head = asked.session, asked.sequence
        try:
            kind, numbers = self._done(asked)
            self._answer = encode_message(Message(kind, *head, numbers))
        except (LhpostError, ValueError) as error:
            log.warning("%s", error)
            self._answer = encode_message(Message(MessageKind.FAILED, *head, text=str(error)))
        self._last = head
        return self._answer

    def _done(self, asked: Message) -> tuple[MessageKind, Array]:
        own = self._specimen
        if asked.kind == MessageKind.DESCRIBE:
            state = getattr(own, "interface_mass", None)
            stated = np.ravel(state(float(asked.numbers[0]))) if callable(state) else np.zeros(0)
            return MessageKind.DESCRIPTION, np.concatenate([own.inertia.toDynamicParameters(), stated])
        number, base = float(asked.numbers[0]), motion_of_numbers(asked.numbers[1:])
        wrench: Any
        if asked.kind == MessageKind.REST:
            self._memory, wrench = start_coupled(own, base, number)
            self._started, self._time = True, 0.0
            self.rests += 1
        elif not self._started:
            raise ValueError("a step before the specimen was put at rest")
        else:
            self._time += number
            wrench = step_coupled(own, self._memory, base, number, f"at {self._time:.4f} s")
            self.steps += 1
        return MessageKind.WRENCH, np.array(wrench.vector)


def serve_specimen(
    sock: socket.socket, served: ServedSpecimen, *, stop: threading.Event | None = None, seconds: float | None = None
) -> None:
    """Answer datagrams until `stop` is set, Ctrl-C is pressed or `seconds` are over."""
    stop = stop or threading.Event()
    end = None if seconds is None else time.monotonic() + seconds
    try:
        while not stop.is_set() and (end is None or time.monotonic() < end):
            answer_one(sock, _IDLE, lambda datagram, _: filter(None, [served.receive(datagram)]))
    except KeyboardInterrupt:
        log.info("interrupted")

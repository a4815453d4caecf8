"""A coupled specimen in another process, in any language: its datagrams over UDP, byte by byte, and the plant's side.

`--specimen udp:HOST:PORT` mounts what listens there; `lhpost6 serve-specimen FILE.py:NAME` serves a specimen in Python.

All numbers are little endian, without padding; float64 is IEEE 754 binary64; SI units. The plant sends requests, one at
a time, each again until it is answered; the specimen answers with the request's session and sequence. The same request
again gets the same answer again.

Header, 20 bytes

    offset  type     field      meaning
    0       char[4]  magic      "LHPS"
    4       uint8    version    1
    5       uint8    kind       1 describe, 2 description, 3 rest, 4 step, 5 wrench, 6 failed
    6       uint16   flags      bit 0: a description states the interface mass; the others are 0
    8       uint32   session    any number that the plant chose
    12      uint32   sequence   1, 2, 3 ... within a session
    16      uint32   crc        CRC-32 (IEEE 802.3, as in zlib) of the datagram with these four bytes 0

Payload

    kind         type          content
    describe     float64       interval between two steps [s]
    description  10 x float64  rigidly attached part: mass [kg], mass times centre x, y, z [kg m], moments of inertia
                               about the base xx, xy, yy, xz, yz, zz [kg m2]; all 0 if there is none
                 36 x float64  with bit 0 of flags: mass matrix with which the wrench follows an acceleration at once,
                               row by row, linear first
    rest         float64       gravity [m/s2]
                 18 x float64  motion of the base; the specimen goes to rest on it
    step         float64       time since the last rest or step [s]
                 18 x float64  motion of the base at this instant
    wrench       6 x float64   wrench of the specimen on the platen: force [N], moment [N m]; weight included
    failed       text, UTF-8   why there is no wrench

The motion of the base is its position in {s} [m] and Euler angles [rad], velocity and angular velocity, acceleration
(of the base point, less gravity) and angular acceleration; these and the wrench are at the base, along its axes.
A specimen that states no interface mass is started and stepped seven times before the run, to find it.
"""

import contextlib
import secrets
import select
import socket
import struct
import time
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ..core.arrays import Array
from ..core.checksum import crc_of, with_crc
from ..core.errors import ParameterError, SimulationError
from ..machine.user_specimen import REMOTE
from .coupled import BaseMotion, motion_numbers

__all__ = ["Message", "MessageKind", "RemoteSpecimen", "decode_message", "encode_message"]

MAGIC, VERSION = b"LHPS", 1
MOTION, WRENCH, INERTIA, MASS = 18, 6, 10, 36
"""Numbers of a motion, a wrench, an inertia and a mass matrix."""

_HEADER = struct.Struct("<4sBBHIII")
_CRC_AT, _STATES_MASS = 16, 1
_LARGEST = 2048  # bytes of a datagram that are read
_PATIENCE, _TRIES = 0.5, 20  # [s] until a request is sent again, and how often: a step of a large model takes long


class MessageKind(IntEnum):
    """Kinds of messages."""

    DESCRIBE, DESCRIPTION, REST, STEP, WRENCH, FAILED = range(1, 7)


class Message(NamedTuple):
    """A datagram: header and payload."""

    kind: MessageKind
    session: int
    sequence: int
    numbers: Array = np.zeros(0)
    text: str = ""


_SIZES = {
    MessageKind.DESCRIBE: (1,),
    MessageKind.DESCRIPTION: (INERTIA, INERTIA + MASS),
    MessageKind.REST: (1 + MOTION,),
    MessageKind.STEP: (1 + MOTION,),
    MessageKind.WRENCH: (WRENCH,),
}
"""Numbers that a kind carries."""


def encode_message(message: Message) -> bytes:
    """Datagram of a message, with its CRC-32; raises ValueError for numbers that it may not carry."""
    numbers = np.asarray(message.numbers, "<f8")
    failed = message.kind == MessageKind.FAILED
    if not failed and (numbers.size not in _SIZES[message.kind] or not np.isfinite(numbers).all()):
        raise ValueError(f"a {message.kind.name.lower()} of {numbers.size} numbers, or one that is not finite")
    payload = message.text.encode()[: _LARGEST - _HEADER.size] if failed else numbers.tobytes()
    flags = _STATES_MASS if numbers.size == INERTIA + MASS else 0
    head = _HEADER.pack(MAGIC, VERSION, message.kind, flags, message.session, message.sequence, 0)
    return with_crc(head + payload, _CRC_AT)


def decode_message(datagram: bytes) -> Message:
    """Message of a datagram; raises ValueError that says why it is none."""
    if len(datagram) < _HEADER.size:
        raise ValueError(f"{len(datagram)} bytes are too few; a header takes {_HEADER.size}")
    magic, version, kind, flags, session, sequence, crc = _HEADER.unpack_from(datagram)
    if (magic, version) != (MAGIC, VERSION):
        raise ValueError(f"begins with {magic!r}, version {version}; {MAGIC!r}, version {VERSION}, is needed")
    if crc != crc_of(datagram, _CRC_AT):
        raise ValueError("the CRC-32 does not fit: the datagram was corrupted")
    if kind not in list(MessageKind):
        raise ValueError(f"kind {kind} does not exist")
    payload = datagram[_HEADER.size :]
    if kind == MessageKind.FAILED:
        return Message(MessageKind(kind), session, sequence, text=payload.decode(errors="replace"))
    count = len(payload) // 8
    if len(payload) % 8 or count not in _SIZES[MessageKind(kind)]:
        raise ValueError(f"a {MessageKind(kind).name.lower()} of {len(payload)} bytes")
    if (count == INERTIA + MASS) != bool(flags & _STATES_MASS):
        raise ValueError("its flags and its length do not fit together")
    numbers = np.frombuffer(payload, "<f8").astype(float)
    if not np.isfinite(numbers).all():
        raise ValueError(f"number {int(np.argmin(np.isfinite(numbers))) + 1} is not finite")
    return Message(MessageKind(kind), session, sequence, numbers)


class RemoteSpecimen:
    """A specimen that listens at udp:HOST:PORT; `coupled.CoupledSpecimen`. The plant waits for each of its answers.

    Attributes: address; inertia, of the rigidly attached part.
    """

    def __init__(self, address: str) -> None:
        """Ask it what it is; raises ParameterError for an address that is none or where nothing answers."""
        host, _, port = address.removeprefix(REMOTE).rpartition(":")
        if not (host and port.isdecimal() and 0 < int(port) < 65536):
            raise ParameterError(f"--specimen {address}: write udp:HOST:PORT, such as udp:127.0.0.1:46947")
        self.address = address
        self._session, self._sequence = secrets.randbits(32), 0
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._sock.connect((host, int(port)))
            stated = self._described(1.0)[:INERTIA]
        except OSError as error:
            raise ParameterError(f"--specimen {address} cannot be reached: {error}") from error
        except SimulationError as error:
            raise ParameterError(str(error)) from error
        self.inertia = pin.Inertia.FromDynamicParameters(stated) if stated[0] else pin.Inertia.Zero()

    def __del__(self) -> None:
        """Close its socket."""
        with contextlib.suppress(AttributeError):
            self._sock.close()

    def interface_mass(self, dt: float) -> Array | None:
        """Mass matrix (6, 6) that it states; None if it states none."""
        stated = self._described(dt)[INERTIA:]
        return stated.reshape(6, 6) if stated.size else None

    def init(self, base: BaseMotion, gravity: float) -> tuple[Any, pin.Force]:
        """Put it at rest. It has one state: what was started before is lost."""
        numbers = np.concatenate([[gravity], motion_numbers(base)])
        return None, pin.Force(self._ask(MessageKind.REST, numbers, MessageKind.WRENCH))

    def step(self, memory: Any, base: BaseMotion, dt: float) -> pin.Force:
        """Wrench dt [s] after the last call."""
        numbers = np.concatenate([[dt], motion_numbers(base)])
        return pin.Force(self._ask(MessageKind.STEP, numbers, MessageKind.WRENCH))

    def _described(self, dt: float) -> Array:
        return self._ask(MessageKind.DESCRIBE, np.array([dt]), MessageKind.DESCRIPTION)

    def _ask(self, kind: MessageKind, numbers: Array, wanted: MessageKind) -> Array:
        """Numbers of the answer to a request, which is sent again until it comes; raises SimulationError."""
        self._sequence += 1
        request = encode_message(Message(kind, self._session, self._sequence, numbers))
        for _ in range(_TRIES):
            with contextlib.suppress(ConnectionError):  # nothing listens there yet
                self._sock.send(request)
            deadline = time.monotonic() + _PATIENCE
            while (left := deadline - time.monotonic()) > 0:
                answer = self._answer(left)
                if answer is None:
                    continue
                if answer.kind == MessageKind.FAILED:
                    raise SimulationError(f"the specimen at {self.address} failed: {answer.text}")
                if answer.kind == wanted:
                    return answer.numbers
        raise SimulationError(
            f"no specimen answered at {self.address} within {_PATIENCE * _TRIES:g} s; start it there with "
            "`lhpost6 serve-specimen`"
        )

    def _answer(self, seconds: float) -> Message | None:
        """An answer to the last request, if one comes within a time [s]; None at any other datagram, too."""
        if not select.select([self._sock], [], [], seconds)[0]:
            return None
        try:
            found = decode_message(self._sock.recv(_LARGEST))
        except ConnectionError:  # nothing listens there yet: no reason to ask again at once
            time.sleep(min(seconds, 0.05))
            return None
        except ValueError:
            return None
        return found if (found.session, found.sequence) == (self._session, self._sequence) else None

"""The link's datagrams, byte by byte, for controllers in any language over UDP.

All numbers are little endian, without padding; float64 is IEEE 754 binary64. One frame is one datagram. A frame is a
header of 48 bytes and a payload whose length follows from `kind`, `actuators`, `valves` and `flags`: n, m and k.

Header

    offset  type     field         meaning
    0       char[4]  magic         "LHP6"
    4       uint8    version       2
    5       uint8    kind          1 hello, 2 welcome, 3 command, 4 sensors, 5 bye, 6 status, 7 switch
    6       uint8    mode          0 lock-step, 1 real time, 2 free running; a client sends 0
    7       uint8    state         0 waiting for the first command, 1 running, 2 safe hold, 3 tripped; a client sends 0
    8       uint8    actuators     n, number of actuators; 0 in hello, bye and a client's switch
    9       uint8    valves        m, number of servovalves; 0 in hello, bye and a client's switch
    10      uint16   flags         bit 0: crc is filled in; bit 1: a command carries a wrench; bit 2: a hello asks for
                                   pressures, sensors carry them; bits 8 to 15 in such sensors: k, number of struts;
                                   the others are 0
    12      uint32   session       any number that the client chose for its hello; the same in every frame that follows
    16      uint32   sequence      command: 1, 2, 3 ...; sensors: sample of the plant, 0 at rest; others: 0
    20      uint32   acknowledged  sensors: sequence of the newest command that acted; command: sample it answers to
    24      uint64   stamp         sender's monotonic clock [ns]
    32      uint64   echo          stamp of the frame that is acknowledged; 0: none
    40      uint32   crc           CRC-32 (IEEE 802.3, as in zlib) of the datagram with these four bytes 0; else 0
    44      uint32   reserved      0

Payload

    kind         type             content
    hello, bye                    nothing
    welcome      float64          controller samples a second [Hz]
                 char[32]         machine, UTF-8, filled up with zeros
                 n x 16 bytes     per actuator: char[15] name, UTF-8, filled up with zeros; uint8 number of its valves
    command      m x float64      spool commands [1], -1..1, in the order of the actuators and of their valves
                 6 x float64      with bit 1 of flags: wrench on the platen, force [N] and moment [N m]
    sensors      6 x float64      acceleration of the platen: of C in {s} [m/s2], of the Euler angles [rad/s2]
                 n x float64      actuator displacements from the zero-position [m]
                 n x float64      actuator forces [N]
                 6 x float64      pose of the interface: position of C in {s} [m], Euler angles [rad]
                 6 x float64      its twist: velocity [m/s], angular velocity [rad/s]
                 6 x float64      its acceleration [m/s2], angular acceleration [rad/s2]
                                  with bit 2 of flags also:
                 n x float64      pressures of chambers A [Pa]
                 n x float64      pressures of chambers B [Pa], 0 where an actuator has none
                 n x float64      spool positions [1] after the valve delay, mean over the sample
                 k x float64      pressures of the struts' gas [Pa]
                 float64          supply pressure [Pa]
    status       12 x uint64      the server's counts, in the order of `COUNTS`
    switch       char[39]         name of a fault, UTF-8, filled up with zeros
                 uint8            1 on, 0 off

The interface is at C, the centre of the platen's top, in axes of the platen: wrench, twist and acceleration (that of
the point, less gravity) have their components along these. The wrench is that of what stands on the platen and is not
part of the server's plant, weight included, at the sample of the last sensors. It is continued linearly over the
sample; without a new one it is kept. Mount the rigid part of a heavy specimen at the server (`lhpost6 serve
--specimen`) and send the rest, w - w_rigid: `simulation.coupling` states the criterion of stability.

An actuator with one valve has one command; one with two has two, A and B, side by side. Sequence numbers and samples
go on at 0 after 4294967295. Nothing but finite numbers may be sent.

What happens

    client                              server
    hello (again until answered)   ->   the plant is put at rest, without faults
                                   <-   welcome, then sensors of sample 0
    command 1                      ->   the plant takes it for sample 0
                                   <-   sensors of sample 1
    ...
    bye (again until answered)     ->   the client's place is free
                                   <-   status

In lock-step the plant moves one sample for each new command, and waits for it; the same command again gets the same
sensors again, so a client without an answer sends it again. In any mode ten seconds without a datagram free the place.
In real time and free running the plant moves by itself from the first command on, takes the newest command at each
sample and sends sensors after each. A hello with another session number puts the plant at rest again, also a tripped
one. Rest is in the zero-position, or where the server parks the platen: the pose in the sensors of sample 0 says
which.

Pressures. A client that sets bit 2 in its hello gets them with all sensors of its session, others get sensors without.
A server that does not know the bit sends sensors without: a client looks at the flags of each frame.

Faults are effects that a server offers to add to its plant. In answer to a switch it sends one for each fault that it
offers, with its name and whether it is on, or one with an empty name and 0 if it offers none. An empty name in the
question only asks. A switch acts at the next sample; motion and pressures go on from where they are. One fault at a
time is on: another that is switched on replaces it. A switch to what is already so, of an unknown name, or of a plant
that has tripped changes nothing. A switch may be lost like any datagram: a client repeats it until the answer is as
wanted. A server that knows no switch counts it as malformed and does not answer.

Version 1 had neither wrench nor interface motion. A hello of version 1 is answered by a welcome of version 1 to a
machine without actuators whose name is the version that is needed.
"""

import math
import struct
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from ...core.arrays import Array
from ...core.checksum import crc_of, with_crc
from ...core.errors import LinkError, UnknownNameError

__all__ = ["COUNTS", "MOTION", "SESSION", "VERSION", "Datagram", "Kind", "LinkMode", "PlantState", "ShortDatagramError"]
__all__ += ["VersionError", "Welcome"]
__all__ += ["decode", "encode", "find_mode", "is_newer", "refusal"]


MAGIC, VERSION = b"LHP6", 2
MOTION = 18
"""Numbers of the motion of the interface: pose, twist, acceleration."""
SESSION = 10.0
"""Silence [s] after which a client's place is free and the plant stops moving."""
COUNTS = {
    "received": "datagrams received",
    "late": "commands older than one before",
    "duplicate": "commands received again",
    "lost": "commands never received",
    "superseded": "commands replaced by a newer one before the plant took them",
    "short": "datagrams shorter than their frame",
    "malformed": "malformed datagrams, or frames that a client may not send",
    "foreign": "frames of another client or session",
    "missed_frames": "samples without a new command",
    "holds": "transitions to safe hold",
    "missed_deadlines": "samples that ended after the next was due",
    "samples": "samples of the plant",
}
"""Counts of a server with their meaning, in the order of a status frame."""

_HEADER = struct.Struct("<4s6BH3I2Q2I")
_WELCOME = struct.Struct("<d32s")
_ACTUATOR = struct.Struct("<15sB")
_SWITCH = struct.Struct("<39sB")
_CRC_AT, _HAS_CRC, _HAS_WRENCH, _HAS_PRESSURES, _STRUTS, _WRAP = 40, 1, 2, 4, 8, 1 << 32
_WRENCH = 6
_NUMBER = np.dtype("<f8")
_FAULT = 39
"""Bytes of a fault's name at most."""


class Kind(IntEnum):
    """Kinds of frames."""

    HELLO, WELCOME, COMMAND, SENSORS, BYE, STATUS, SWITCH = range(1, 8)


class LinkMode(IntEnum):
    """How the plant's time advances."""

    LOCK_STEP, REAL_TIME, FREE = range(3)

    @property
    def label(self) -> str:
        """Its name on the command line."""
        return self.name.lower().replace("_", "-")


class PlantState(IntEnum):
    """States of the plant."""

    WAITING, RUNNING, HOLD, TRIPPED = range(4)


_KINDS, _MODES, _STATES = tuple(Kind), tuple(LinkMode), tuple(PlantState)
_WITH_NUMBERS = Kind.COMMAND, Kind.SENSORS


class ShortDatagramError(LinkError):
    """A datagram ends before its frame does."""


class VersionError(LinkError):
    """A frame of another version of the protocol.

    Attributes: version; kind, as a number; session.
    """

    def __init__(self, version: int, kind: int, session: int) -> None:
        """What its header says."""
        super().__init__(f"a frame of version {version}; version {VERSION} is needed: update lhpost6-pin")
        self.version, self.kind, self.session = version, kind, session


class Welcome(NamedTuple):
    """Content of a welcome: samples a second [Hz], machine, actuator names, valves of each actuator."""

    rate: float
    machine: str
    actuators: tuple[str, ...]
    valves: tuple[int, ...]


class Datagram(NamedTuple):
    """A frame: header and payload. Of the payloads only the one of its kind is not empty."""

    kind: Kind
    session: int
    mode: LinkMode = LinkMode.LOCK_STEP
    state: PlantState = PlantState.WAITING
    actuators: int = 0
    valves: int = 0
    sequence: int = 0
    acknowledged: int = 0
    stamp: int = 0
    echo: int = 0
    numbers: Array | None = None  # command (m,) or, with a wrench, (m + 6,); or sensors (6 + 2 n + 18 [+ 3 n + k + 1],)
    welcome: Welcome | None = None
    counts: tuple[int, ...] = ()
    pressures: bool = False  # a hello asks for them, sensors carry them
    struts: int = 0  # k of sensors with pressures
    fault: str = ""  # of a switch
    on: bool = False

    @property
    def wrench(self) -> Array | None:
        """Wrench (6,) of a command, if it carries one."""
        beyond = () if self.numbers is None else self.numbers[self.valves :]
        return np.asarray(beyond) if self.kind == Kind.COMMAND and len(beyond) else None


def find_mode(label: str) -> LinkMode:
    """LinkMode by its name on the command line; raises UnknownNameError."""
    found = {mode.label: mode for mode in LinkMode}
    if label not in found:
        raise UnknownNameError("mode of a link", label, list(found))
    return found[label]


def is_newer(sequence: int, than: int) -> bool:
    """Whether a sequence number comes after another, also past the largest of 32 bits."""
    return 0 < (sequence - than) % _WRAP < _WRAP // 2


def encode(frame: Datagram) -> bytes:
    """Datagram of a frame, with its CRC-32; raises LinkError for numbers that do not fit its kind and counts."""
    flags = _HAS_CRC
    if frame.kind in _WITH_NUMBERS:
        payload = _finite(frame.numbers).tobytes()
        if frame.kind == Kind.COMMAND and len(payload) > 8 * frame.valves:
            flags |= _HAS_WRENCH
    elif frame.kind == Kind.SWITCH:
        payload = _SWITCH.pack(_fault_name(frame.fault), frame.on)
    elif frame.kind == Kind.WELCOME and frame.welcome is not None:
        rate, machine, names, valves = frame.welcome
        payload = _WELCOME.pack(rate, _cut(machine, 32))
        payload += b"".join(_ACTUATOR.pack(_cut(n, 15), v) for n, v in zip(names, valves, strict=True))
    else:
        payload = struct.pack(f"<{len(frame.counts)}Q", *frame.counts)
    if frame.pressures:
        flags |= _HAS_PRESSURES | frame.struts << _STRUTS
    size = _payload_size(frame.kind, frame.actuators, frame.valves, flags)
    if len(payload) != size:
        counts = f"{frame.actuators} actuators and {frame.valves} valves"
        raise LinkError(f"a {frame.kind.name.lower()} frame of {counts} takes {size} bytes, not {len(payload)}")
    return _packed(VERSION, frame, flags, payload)


def refusal(session: int) -> list[bytes]:
    """Welcome and sensors of version 1 that name the version that is needed, in answer to a hello of version 1."""
    needed = _WELCOME.pack(1.0, _cut(f"needs protocol version {VERSION}", 32))
    welcome, sensors = Datagram(Kind.WELCOME, session), Datagram(Kind.SENSORS, session)
    return [_packed(1, welcome, _HAS_CRC, needed), _packed(1, sensors, _HAS_CRC, bytes(48))]


def _packed(version: int, frame: Datagram, flags: int, payload: bytes) -> bytes:
    head = (frame.kind, frame.mode, frame.state, frame.actuators, frame.valves, flags, frame.session)
    numbers = (frame.sequence % _WRAP, frame.acknowledged % _WRAP, frame.stamp, frame.echo)
    return with_crc(_HEADER.pack(MAGIC, version, *head, *numbers, 0, 0) + payload, _CRC_AT)


def decode(datagram: bytes) -> Datagram:
    """Frame of a datagram; raises ShortDatagramError if it ends too early, VersionError, LinkError."""
    if len(datagram) < _HEADER.size:
        raise ShortDatagramError(f"{len(datagram)} bytes are too few for a frame; its header takes {_HEADER.size}")
    magic, version, kind, mode, state, actuators, valves, flags, session, *rest = _HEADER.unpack_from(datagram)
    sequence, acknowledged, stamp, echo, crc, _ = rest
    if magic != MAGIC:
        raise LinkError(f"a frame begins with {MAGIC!r}, not {magic!r}")
    if version != VERSION:
        raise VersionError(version, kind, session)
    if not (1 <= kind <= len(_KINDS) and mode < len(_MODES) and state < len(_STATES)):
        raise LinkError(f"kind {kind}, mode {mode}, state {state}: one of them does not exist")
    size = _HEADER.size + _payload_size(kind, actuators, valves, flags)
    if len(datagram) < size:
        raise ShortDatagramError(f"{len(datagram)} bytes of a frame of {size}")
    if len(datagram) > size:
        raise LinkError(f"{len(datagram)} bytes are too many for a frame of {size}")
    if crc != (crc_of(datagram, _CRC_AT) if flags & _HAS_CRC else 0):
        raise LinkError("the CRC-32 does not fit: the frame was corrupted")
    counts = actuators, valves, sequence, acknowledged, stamp, echo
    head = _KINDS[kind - 1], session, _MODES[mode], _STATES[state], *counts
    pressures = bool(flags & _HAS_PRESSURES) and kind in (Kind.HELLO, Kind.SENSORS)
    if kind in _WITH_NUMBERS:
        numbers = _finite(np.frombuffer(datagram, _NUMBER, offset=_HEADER.size)).astype(np.float64)
        return Datagram(*head, numbers=numbers, pressures=pressures, struts=flags >> _STRUTS if pressures else 0)
    if kind == Kind.WELCOME:
        return Datagram(*head, welcome=_unpacked_welcome(datagram, valves))
    if kind == Kind.SWITCH:
        name, on = _SWITCH.unpack_from(datagram, _HEADER.size)
        if on > 1:
            raise LinkError(f"a fault switched to {on}; 1 is on, 0 off")
        return Datagram(*head, fault=_text(name), on=bool(on))
    if kind == Kind.HELLO:
        return Datagram(*head, pressures=pressures)
    return Datagram(*head, counts=struct.unpack_from(f"<{(size - _HEADER.size) // 8}Q", datagram, _HEADER.size))


def _payload_size(kind: int, actuators: int, valves: int, flags: int) -> int:
    if kind == Kind.SENSORS:
        pressures = 3 * actuators + (flags >> _STRUTS) + 1 if flags & _HAS_PRESSURES else 0
        return 8 * (6 + 2 * actuators + MOTION + pressures)
    if kind == Kind.COMMAND:
        return 8 * (valves + (_WRENCH if flags & _HAS_WRENCH else 0))
    if kind == Kind.WELCOME:
        return _WELCOME.size + actuators * _ACTUATOR.size
    return {Kind.STATUS: 8 * len(COUNTS), Kind.SWITCH: _SWITCH.size}.get(Kind(kind), 0)


def _unpacked_welcome(datagram: bytes, valves: int) -> Welcome:
    rate, machine = _WELCOME.unpack_from(datagram, _HEADER.size)
    if not (math.isfinite(rate) and rate > 0.0):
        raise LinkError(f"a rate of {rate} samples a second")
    rows = list(_ACTUATOR.iter_unpack(datagram[_HEADER.size + _WELCOME.size :]))
    counts = tuple(count for _, count in rows)
    if sum(counts) != valves:
        raise LinkError(f"{valves} valves, of which the actuators have {sum(counts)}")
    return Welcome(rate, _text(machine), tuple(_text(name) for name, _ in rows), counts)


def _fault_name(name: str) -> bytes:
    if len(name.encode()) > _FAULT:
        raise LinkError(f"the name of a fault takes at most {_FAULT} bytes; {name!r} has {len(name.encode())}")
    return name.encode()


def _finite(numbers: Array | None) -> Array:
    values = np.asarray(() if numbers is None else numbers, _NUMBER)
    if not np.isfinite(values).all():
        raise LinkError(f"number {int(np.argmin(np.isfinite(values))) + 1} of a frame is not finite")
    return values


def _cut(text: str, size: int) -> bytes:
    """Text in UTF-8, cut to whole characters within a size."""
    return text.encode()[:size].decode(errors="ignore").encode()


def _text(content: bytes) -> str:
    return content.rstrip(b"\0").decode(errors="replace")

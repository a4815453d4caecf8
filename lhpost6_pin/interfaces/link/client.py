"""A client that commands a served plant.

Any function of its readings will do:

    with LinkClient() as table:
        reading = table.reading  # sample 0, at rest
        while reading.sample < n:
            reading = table.exchange(command(reading))

At the end of the block the plant is free for others.
"""

import secrets
import select
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from ...control.plug import Feedback
from ...control.valves import valve_names
from ...core.arrays import Array
from ...core.errors import LinkError
from ...mechanics.coupled import BaseMotion, motion_of_numbers, wrench_of
from ...simulation.running import PressureReading
from .clock import SECOND, Histogram, now
from .protocol import COUNTS, MOTION, SESSION, Datagram, Kind, LinkMode, PlantState, decode, encode, is_newer
from .server import HOST, PORT

__all__ = ["LinkClient", "Reading"]


_LARGEST = 16384  # bytes of a datagram that are read; every frame is shorter


class Reading(NamedTuple):
    """Sensors and state of the plant after a sample."""

    sample: int
    state: PlantState
    sensors: Feedback
    acknowledged: int  # sequence of the newest command that acted
    stamp: int  # the server's clock [ns]
    interface: Array  # (18,) motion of the platen at C, position and Euler angles first (`coupled.motion_numbers`)
    pressures: PressureReading | None = None  # where the client asked for them and the server knows them

    @property
    def motion(self) -> BaseMotion:
        """Motion of the interface, at C in axes of the platen."""
        return motion_of_numbers(self.interface)


class LinkClient:
    """A connection to a served plant, which it puts at rest in the zero-position, or where the server parks it.

    Attributes: machine; mode; rate [Hz]; actuators and valves, their names; counts, servovalves of each actuator;
    reading, the newest; resent, commands sent again; sensors_lost, samples whose sensors never came; ignored, datagrams
    that were no frame of this session; round_trip, from the sending of a command to the coming of sensors it acted on;
    faults, those that the server offered last and whether each is on, empty until it answered `ask_faults` or `switch`.
    """

    def __init__(
        self,
        host: str = HOST,
        port: int = PORT,
        *,
        timeout: float = 0.2,
        tries: int = 25,
        pressures: bool = False,
    ) -> None:
        """Greet the server; raises LinkError if none answers `tries` datagrams within `timeout` [s] each.

        pressures: ask for chamber, strut and supply pressures and spools with each reading.
        """
        self._where, self._timeout, self._tries = f"{host}:{port}", timeout, tries
        self._session, self._sequence = secrets.randbits(32), 0
        self.resent = self.sensors_lost = self.ignored = 0
        self.round_trip, self.faults = Histogram(), dict[str, bool]()
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._sock.connect((host, port))
            self._sock.setblocking(False)
            found: dict[Kind, Datagram] = {}

            def complete(frame: Datagram) -> bool:
                found[frame.kind] = frame
                return {Kind.WELCOME, Kind.SENSORS} <= set(found) and (
                    found[Kind.WELCOME].actuators == found[Kind.SENSORS].actuators
                )

            self._request(Datagram(Kind.HELLO, self._session, pressures=pressures), complete)
        except OSError as error:
            self._sock.close()
            raise LinkError(f"{self._where} cannot be reached: {error}") from error
        except BaseException:
            self._sock.close()
            raise
        welcome = found[Kind.WELCOME].welcome
        assert welcome is not None
        self.mode, self.rate = found[Kind.WELCOME].mode, welcome.rate
        self.machine, self.actuators = welcome.machine, welcome.actuators
        self.counts = np.array(welcome.valves, np.int64)
        self.valves = valve_names(self.actuators, self.counts)
        self._actuator = np.repeat(np.arange(len(self.counts)), self.counts)  # of each valve
        self.reading = self._read(found[Kind.SENSORS])

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Give the plant back and close."""
        self.close()

    def send(self, command: Array, wrench: ArrayLike | None = None) -> None:
        """Send a command, per actuator (n_actuators,) or per servovalve (n_valves,), -1..1, without waiting.

        wrench: on the platen at C in its axes at the sample of the newest reading, a `pin.Force` or (6,), force first;
        of what stands on the platen and is not part of the server's plant.
        """
        self._put(self._command(command, wrench))

    def newest(self) -> Reading | None:
        """The newest sensors that have come since the last look, or None; does not wait."""
        found = self._arrived()
        return found[-1] if found else None

    def wait(self, seconds: float, poll: float = 0.0) -> list[Reading]:
        """All sensors that have come since the last look, once some have; none if none come within a time [s].

        poll: time [s] before, in which they are taken a wake-up (about 0.05 ms) sooner and the processor does not rest.
        """
        found = self._arrived()
        if not found and poll:
            until = now() + round(poll * SECOND)
            while not found and now() < until:
                found = self._arrived()
        if not found:
            select.select([self._sock], [], [], seconds)
            found = self._arrived()
        return found

    def _arrived(self) -> list[Reading]:
        found = []
        while (frame := self._get(0.0)) is not None:
            if (reading := self._take(frame)) is not None:
                found.append(reading)
        return found

    def keep(self) -> None:
        """Keep the plant without commanding it: a server frees one whose client is silent for ten seconds.

        One that waits for commands (`serve` with patience) waits no longer, and goes to its safe hold.
        """
        self._put(Datagram(Kind.HELLO, self._session))

    def exchange(self, command: Array, wrench: ArrayLike | None = None) -> Reading:
        """Send a command, with a wrench as `send` takes it, and return the next sensors.

        In lock-step those of the very next sample; a command is sent again until they come. In real time and free
        running the newest of those that come. Raises LinkError if none do.
        """
        frame = self._command(command, wrench)
        if self.mode == LinkMode.LOCK_STEP:
            self._request(frame, lambda f: self._take(f) is not None and f.acknowledged == frame.sequence)
            return self.reading
        self._put(frame)
        for answer in self._frames(self._timeout * self._tries):
            if self._take(answer) is not None:
                self.newest()
                return self.reading
        raise LinkError(self._silence())

    def switch(self, name: str, on: bool) -> None:
        """Ask for a fault to be on or off, without waiting; the answer comes into `faults` with the next readings.

        A datagram may be lost: switch again until `faults` is as wanted. Raises LinkError for a name that is too long.
        """
        self._put(Datagram(Kind.SWITCH, self._session, fault=name, on=on))

    def ask_faults(self) -> None:
        """Ask which faults the server offers, without waiting; the answer comes as that to `switch` does."""
        self.switch("", False)

    def close(self) -> Mapping[str, int]:
        """Give the plant back; returns the server's counts of this session, empty if it does not answer."""
        if self._sock.fileno() < 0:
            return {}
        self._tries = min(self._tries, 5)
        try:
            status = self._request(Datagram(Kind.BYE, self._session), lambda f: f.kind == Kind.STATUS)
        except LinkError:
            return {}
        finally:
            self._sock.close()
        return dict(zip(COUNTS, status.counts, strict=True))

    def _command(self, command: Array, wrench: ArrayLike | None) -> Datagram:
        values = np.asarray(command, float)
        if values.shape == self.counts.shape:
            values = values.take(self._actuator)
        elif values.shape != (len(self.valves),):
            raise LinkError(
                f"a command of shape {values.shape}; {self.machine} has {len(self.actuators)} actuators and "
                f"{len(self.valves)} servovalves"
            )
        if wrench is not None:
            values = np.concatenate([values, wrench_of(wrench).vector])
        self._sequence = (self._sequence + 1) % (1 << 32)
        return Datagram(
            Kind.COMMAND,
            self._session,
            actuators=len(self.actuators),
            valves=len(self.valves),
            sequence=self._sequence,
            acknowledged=self.reading.sample,
            echo=self.reading.stamp,
            numbers=values,
        )

    def _request(self, frame: Datagram, is_answer: Callable[[Datagram], bool]) -> Datagram:
        """Answer to a frame, which is sent again until it comes; raises LinkError if none does."""
        for attempt in range(self._tries):
            self.resent += attempt > 0
            self._put(frame)
            for answer in self._frames(self._timeout):
                if is_answer(answer):
                    return answer
        raise LinkError(self._silence())

    def _frames(self, seconds: float) -> Iterator[Datagram]:
        """Frames of this session as they arrive within a time [s]."""
        deadline = now() + round(seconds * SECOND)
        while (left := deadline - now()) > 0:
            if (frame := self._get(left / SECOND)) is not None:
                yield frame

    def _silence(self) -> str:
        reading: Reading | None = getattr(self, "reading", None)  # none before the server has answered once
        if reading is not None and reading.sample:
            return (
                f"{self._where} answered up to sample {reading.sample} and was silent for "
                f"{self._timeout * self._tries:g} s after it; the server has ended, or freed the plant after "
                f"{SESSION:g} s without a command, or the network fails"
            )
        return (
            f"{self._where} did not answer within {self._timeout * self._tries:g} s; start the plant there with "
            "`lhpost6 serve` of this version, or wait until another client has left it"
        )

    def _put(self, frame: Datagram) -> None:
        try:
            self._sock.send(encode(frame._replace(stamp=now())))
        except (ConnectionError, BlockingIOError):  # no server yet, or no room: a lost datagram like any other
            pass

    def _get(self, timeout: float) -> Datagram | None:
        """A frame of this session, if a datagram comes within a time [s]."""
        try:
            frame = decode(self._sock.recv(_LARGEST))
        except BlockingIOError:
            return self._get(0.0) if timeout > 0.0 and select.select([self._sock], [], [], timeout)[0] else None
        except ConnectionError:  # no server: no reason to retry at once
            time.sleep(timeout)
            return None
        except LinkError:
            frame = None
        if frame is None or frame.session != self._session:
            self.ignored += 1
            return None
        if frame.kind == Kind.SWITCH and frame.fault:
            self.faults[frame.fault] = frame.on
        return frame

    def _take(self, frame: Datagram) -> Reading | None:
        """Keep sensors that are newer than the last, or of a plant that has tripped."""
        if frame.kind != Kind.SENSORS or frame.actuators != len(self.actuators):
            return None
        last, tripped = self.reading, frame.state == PlantState.TRIPPED
        if not (is_newer(frame.sequence, last.sample) or tripped):
            return None
        if not tripped:
            self.sensors_lost += (frame.sequence - last.sample) % (1 << 32) - 1
        if frame.echo and frame.acknowledged != last.acknowledged:
            self.round_trip.add(now() - frame.echo)
        self.reading = self._read(frame)
        return self.reading

    def _read(self, frame: Datagram) -> Reading:
        assert frame.numbers is not None
        numbers, n, at = frame.numbers, len(self.actuators), 6 + 2 * len(self.actuators)
        sensors = Feedback(numbers[6 : 6 + n], numbers[:6], numbers[6 + n : at])
        pressures = None
        if frame.pressures:
            own = numbers[at + MOTION :]
            pressures = PressureReading(
                own[:n], own[n : 2 * n], own[2 * n : 3 * n], own[3 * n : 3 * n + frame.struts], float(own[-1])
            )
        interface = numbers[at : at + MOTION]
        return Reading(frame.sequence, frame.state, sensors, frame.acknowledged, frame.stamp, interface, pressures)

"""A plant that a remote client commands: its response to datagrams and samples, without sockets and clocks.

Safe hold. After five samples without a new command the spools go over to those that hold the platen at rest, along a
smooth ramp of 0.2 s: twice the period of the softest oil column, so that the oil decelerates the platen without
impact. When commands return they are blended in from the spools as they are, along a ramp as long as the hold was, at
most as long as the one into it: smooth after a long silence, and a link that drops out again and again still commands.
In lock-step time stands still between commands: there is no hold.

Faults. Each is a plant of its own, made before a client comes. To go over to it (`RunningPlant.with_plant`) takes
0.25 ms on an idle core, twice as much on a busy one, beside the sample's own 0.1 ms: the one sample of a switch
may be late in real time, usually by less than a sample, and is then counted as a missed deadline. Two faults at once
would need a plant for each pair, so one at a time is on.
"""

import logging
from collections.abc import Hashable, Mapping

from ...control.valves import per_actuator, valve_counts
from ...core.arrays import Array
from ...core.errors import LinkError, SimulationError
from ...core.names import SAMPLE_RATE
from ...mechanics.coupled import wrench_of
from ...mechanics.equilibrium import Equilibrium
from ...mechanics.plant import Plant
from ...simulation.coupling import CouplingOptions
from ...simulation.running import RunningPlant
from ...simulation.snapshot import EVERY, Watch
from .clock import SECOND, Histogram
from .protocol import (
    COUNTS,
    SESSION,
    Datagram,
    Kind,
    LinkMode,
    PlantState,
    ShortDatagramError,
    VersionError,
    Welcome,
    decode,
    encode,
    is_newer,
    refusal,
)

__all__ = ["MISSED_FRAMES", "RAMP", "ServedPlant"]

log = logging.getLogger(__name__)


MISSED_FRAMES = 5
"""Samples in a row without a new command after which the plant goes to its safe hold."""

RAMP = round(0.2 * SAMPLE_RATE)
"""Samples over which the spools go over to the hold; the most that they take back to the commands."""


class ServedPlant:
    """The state of one served plant; every method returns at once, `now` is the caller's clock [ns].

    Attributes: mode; state; sample; spool, which the plant took last; counts; answer_time, from the sending of sensors
    to the coming of the command that answers them; watcher, shown the plant as it moves; faults, plants by the name of
    the fault that they have; fault, the one that is on from the next sample on, or "".
    """

    def __init__(
        self,
        plant: Plant,
        rest: Equilibrium,
        mode: LinkMode,
        coupling: CouplingOptions | None = None,
        *,
        faults: Mapping[str, Plant] | None = None,
    ) -> None:
        """Put the plant at rest and run its first samples, so that all is compiled before a client comes.

        rest: in the zero-position, or in the pose where the platen is parked; its spools are also those of safe hold.
        faults: the plant with each effect that a client may switch on, by a name of at most 39 bytes (`link.faults`).
        Raises LinkError for another name; SimulationError for a fault's plant of another machine.
        """
        self.plant, self.mode, self._rest, self._coupling = plant, mode, rest, coupling
        self.faults = dict(faults or {})
        self.counts, self.answer_time = dict.fromkeys(COUNTS, 0), Histogram()
        self.watcher: Watch | None = None
        self._owner: Hashable = None  # current or last client
        self._taken = False
        self._session, self._at_hello, self._heard = 0, self.counts, 0
        self._valves, self._curves = valve_counts(plant.machine), plant.actuators.flow_curve
        self._width, self._spools, self._struts = int(self._valves.sum()), plant.spools, len(plant.machine.struts)
        self._pressures = False
        self._begin()
        for name, faulty in self.faults.items():
            if not name:
                raise LinkError("a fault needs a name; an empty one only asks")
            encode(Datagram(Kind.SWITCH, 0, fault=name))
            self._table.with_plant(faulty)
        for name in ("", *self.faults):
            self._begin()
            self.fault = name
            for _ in range(8):
                self._move(0)
        self._begin()
        self.counts = dict.fromkeys(COUNTS, 0)

    def _begin(self) -> None:
        """A plant at rest that waits for its first command."""
        self._table = RunningPlant(self.plant, self._rest, coupling=self._coupling)
        self.state, self.sample, self._sensed = PlantState.WAITING, 0, self._table.readings(self._pressures)
        self.fault = self._acting = ""
        self._newest = self._acted = self._acted_stamp = self._newest_stamp = self._missed = 0
        self._fresh, self._asked = False, self._rest.spool
        self._answers, self._commanding = 0, False  # sample that the newest command answers; whether more will come
        self.spool, self._from = self._rest.spool, self._rest.spool
        self._ramp = self._on_ramp = RAMP  # samples of the ramp, and those done
        self._answer = b""
        self._wrench: Array | None = None  # from outside, that the plant has not taken yet

    @property
    def client(self) -> Hashable:
        """The address that has the plant, or None."""
        return self._owner if self._taken else None

    @property
    def moving(self) -> bool:
        """Whether the plant moves by itself: it has a client and a first command, and it is not in lock-step."""
        return self.mode != LinkMode.LOCK_STEP and self._taken and self.state != PlantState.WAITING

    @property
    def awaited(self) -> bool:
        """Whether the command that answers the newest sensors has yet to come, of a client that commands the plant.

        A client ceases to command it by a hello of the same session, or by a sample that passes without a command.
        """
        answered = self._fresh and self._answers == self.sample
        return self._taken and self.state == PlantState.RUNNING and self._commanding and not answered

    def receive(self, datagram: bytes, sender: Hashable, now: int) -> list[bytes]:
        """Take a datagram; returns what to send back to its sender. Never raises."""
        self.counts["received"] += 1
        try:
            frame = decode(datagram)
        except ShortDatagramError:
            self.counts["short"] += 1
            return []
        except VersionError as error:
            self.counts["malformed"] += 1
            log.warning("%s: %s", sender, error)
            return refusal(error.session) if (error.version, error.kind) == (1, Kind.HELLO) else []
        except LinkError as error:
            self.counts["malformed"] += 1
            log.debug("datagram of %s: %s", sender, error)
            return []
        if frame.kind == Kind.HELLO and self.client in (None, sender):
            return self._hello(frame, sender, now)
        known = sender == self._owner and frame.session == self._session
        if frame.kind == Kind.BYE and known:  # also once more, should the status be lost
            self._taken = False
            return [self._status()]
        if not known or not self._taken:
            self.counts["foreign"] += 1
            return []
        if frame.kind == Kind.SWITCH:
            self._heard = now
            return self._switch(frame)
        if frame.kind != Kind.COMMAND or frame.valves != self._width:
            self.counts["malformed"] += 1
            return []
        self._heard = now
        return self._command(frame, now)

    def tick(self, now: int) -> bytes | None:
        """Move a plant that moves by itself by one sample, with the newest command; returns sensors for the client."""
        if not self.moving:
            return None
        if self._fresh:
            self._missed, self._fresh = 0, False
            self._resume()
        else:
            self._missed, self._commanding = self._missed + 1, False
            self.counts["missed_frames"] += 1
            if self._missed == MISSED_FRAMES:
                self._hold()
        return self._move(now)

    def watch(self, now: int) -> None:
        """Check that the client is still there; to be called repeatedly."""
        if self._taken and (now - self._heard) / SECOND > SESSION:
            log.warning("no datagram from %s for %g s: the plant is free for another client", self._owner, SESSION)
            self._taken = False

    def _hello(self, frame: Datagram, sender: Hashable, now: int) -> list[bytes]:
        self._heard, self._commanding = now, False
        if not self._taken or frame.session != self._session:
            self._pressures = frame.pressures
            self._begin()
            self._owner, self._taken = sender, True
            self._session, self._at_hello = frame.session, dict(self.counts)
            log.info("%s has the plant", sender)
        machine = self.plant.machine
        about = Welcome(float(SAMPLE_RATE), machine.name, machine.actuator_names, tuple(map(int, self._valves)))
        return [encode(self._frame(Kind.WELCOME)._replace(welcome=about)), self._measured(now)]

    def _command(self, frame: Datagram, now: int) -> list[bytes]:
        assert frame.numbers is not None
        if not is_newer(frame.sequence, self._newest):
            same = frame.sequence == self._newest
            self.counts["duplicate"] += same
            self.counts["late"] += not same
            return [self._answer] if same and self._answer and self.mode == LinkMode.LOCK_STEP else []
        self.counts["lost"] += (frame.sequence - self._newest - 1) % (1 << 32)
        self.counts["superseded"] += self._fresh
        self._newest, self._newest_stamp = frame.sequence, frame.stamp
        self._answers, self._commanding = frame.acknowledged, True
        values = frame.numbers[: self._width]
        self._asked = per_actuator(values, self._valves, self._curves).clip(-1.0, 1.0)
        self._wrench = frame.wrench if frame.wrench is not None else self._wrench
        if frame.echo:
            self.answer_time.add(now - frame.echo)
        if self.state == PlantState.WAITING:
            self.state = PlantState.RUNNING
        if self.mode == LinkMode.LOCK_STEP:
            self._resume()
            return [self._move(now)]
        self._fresh = True
        return []

    def _switch(self, frame: Datagram) -> list[bytes]:
        """Switch a fault; returns which are on."""
        if frame.fault in self.faults and self.state != PlantState.TRIPPED and frame.on != (self.fault == frame.fault):
            self.fault = frame.fault if frame.on else ""
            log.info("%s switches %s %s", self._owner, frame.fault, "on" if frame.on else "off")
        head = self._frame(Kind.SWITCH)
        return [encode(head._replace(fault=name, on=bool(name) and name == self.fault)) for name in self.faults or [""]]

    def _hold(self) -> None:
        if self.state == PlantState.RUNNING:
            self.state = PlantState.HOLD
            self.counts["holds"] += 1
            self._from, self._ramp, self._on_ramp = self.spool, RAMP, 0

    def _resume(self) -> None:
        """Apply the newest command."""
        self._acted, self._acted_stamp = self._newest, self._newest_stamp
        if self.state == PlantState.HOLD:
            self.state = PlantState.RUNNING
            self._from, self._ramp, self._on_ramp = self.spool, self._on_ramp, 0

    def _move(self, now: int) -> bytes:
        """One sample of the plant, unless it is tripped; returns the sensors after it."""
        if self.state != PlantState.TRIPPED:
            target = self._rest.spool if self.state == PlantState.HOLD else self._asked
            self.spool, self._on_ramp = target, min(self._on_ramp + 1, self._ramp)
            if self._on_ramp < self._ramp:
                share = self._on_ramp / self._ramp
                self.spool = self._from + share * share * (3.0 - 2.0 * share) * (target - self._from)
            try:
                if self.fault != self._acting:
                    self._table = self._table.with_plant(self.faults[self.fault] if self.fault else self.plant)
                    self._acting = self.fault
                self._table.advance(self.spool, None if self._wrench is None else wrench_of(self._wrench))
                self._wrench = None
                if self.watcher is not None and self._table.sample % EVERY == 0:
                    self.watcher(self._table.snapshot())
                self._sensed = self._table.readings(self._pressures)
                self.sample = self._table.sample
                self.counts["samples"] += 1
            except SimulationError as error:
                self.state = PlantState.TRIPPED
                log.warning("tripped: %s", error)
        self._answer = self._measured(now)
        return self._answer

    def _frame(self, kind: Kind) -> Datagram:
        return Datagram(kind, self._session, self.mode, self.state, self.plant.spools, self._width)

    def _measured(self, now: int) -> bytes:
        counts = self._spools, self._width, self.sample, self._acted, now, self._acted_stamp
        head = Kind.SENSORS, self._session, self.mode, self.state, *counts
        struts = self._struts if self._pressures else 0
        return encode(Datagram(*head, numbers=self._sensed, pressures=self._pressures, struts=struts))

    def _status(self) -> bytes:
        since = tuple(number - self._at_hello[name] for name, number in self.counts.items())
        return encode(self._frame(Kind.STATUS)._replace(counts=since))

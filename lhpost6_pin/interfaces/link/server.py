"""The plant as a UDP server: sockets and clocks around a `ServedPlant`."""

import logging
import math
import select
import socket
import threading
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from typing import Any, NamedTuple

from ...core.errors import LinkError
from ...core.names import SAMPLE_RATE
from .clock import SECOND, Histogram, now, undisturbed
from .protocol import LinkMode
from .served import ServedPlant

__all__ = ["HOST", "PORT", "Timing", "answer_one", "open_socket", "serve"]

log = logging.getLogger(__name__)

HOST, PORT = "127.0.0.1", 46946
"""Default address: this computer only, at a port of the private range."""

_IDLE = 0.1  # [s] longest wait before looking at the stop event
_POLL = 150_000  # [ns] of polling for an awaited command before sleeping, which takes 0.05 ms to wake up from
_CATCHING_UP = 20_000_000  # [ns] most that a clock is behind by a disturbance; one further behind is always too slow
_BEHIND = 0.1  # [s] most that a clock that waits catches up with
_LARGEST = 2048  # bytes of a datagram that are read; every frame is shorter
_BURST = 64  # datagrams taken at most before the plant moves on


class Timing(NamedTuple):
    """Lateness of the samples of a served plant, and the time each took from its deadline to sending."""

    lateness: Histogram
    work: Histogram


def open_socket(host: str = HOST, port: int = PORT) -> socket.socket:
    """Socket that listens at an address (port 0: any free one) and never waits; LinkError if it cannot be bound."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setblocking(False)
    try:
        sock.bind((host, port))
    except (OSError, OverflowError) as error:
        sock.close()
        raise LinkError(f"cannot listen on {host}:{port}: {error}; choose another with --host or --port") from error
    return sock


def serve(
    sock: socket.socket,
    served: ServedPlant,
    *,
    stop: threading.Event | None = None,
    seconds: float | None = None,
    pace: float = 1.0,
    patience: float = 0.0,
    polled: float = 150e-6,
) -> Timing:
    """Answer datagrams and move the plant until `stop` is set, Ctrl-C is pressed or `seconds` are over.

    Real time: sample k of a run is due k/2048 s after its first command came, whatever became of those before; `pace`
    is a factor on the speed of that clock, below one for a computer that is too slow. With `patience` [s] every sample
    waits for the command that answers the sensors before it, up to that long, and the clock catches up with at most
    0.1 s afterwards: the run is that of lock-step on any computer, which delays it where it is too slow. The last
    `polled` [s] before a deadline are polled, not slept, since sleep ends up to 0.1 ms late; less of it leaves more of
    the processor to others. The plant goes to its safe hold where a client is silent for longer, or states by
    `LinkClient.keep` that it does not command. The counts are in `served.counts`. Raises LinkError for a time that is
    negative or not finite, or a pace that is not positive.
    """
    if not 0.0 < pace < math.inf:
        raise LinkError(f"a pace of {pace:g}; give a number above zero, 1 for real time")
    if seconds is not None and not 0.0 <= seconds < math.inf:
        raise LinkError(f"a plant cannot be served for {seconds:g} s; give a number, zero or more, or leave it out")
    stop, timing = stop or threading.Event(), Timing(Histogram(), Histogram())
    end = None if seconds is None else now() + round(seconds * SECOND)
    begin, sample = 0, -1  # sample: of those due since `begin`; -1: the plant stands
    with undisturbed() if served.mode != LinkMode.LOCK_STEP else nullcontext():
        try:
            while not stop.is_set() and (end is None or now() < end):
                served.watch(now())
                if not served.moving:
                    sample = -1
                    _listen(sock, served, _IDLE)
                    continue
                begin, sample = (now(), 0) if sample < 0 else (begin, sample + 1)
                if served.mode == LinkMode.FREE:
                    _listen_until(sock, served, now(), 0)
                    _tick(sock, served)
                    continue
                due = begin + round(sample * SECOND / (SAMPLE_RATE * pace))
                _listen_until(sock, served, due, round(polled * SECOND))
                if patience:
                    _await(sock, served, due, patience, stop)
                    begin += max(0, now() - due - round(_BEHIND * SECOND))
                started = now()
                _tick(sock, served)
                ended = now()
                timing.lateness.add(started - due)
                timing.work.add(ended - started)
                served.counts["missed_deadlines"] += ended > due + SECOND / (SAMPLE_RATE * pace)
        except KeyboardInterrupt:
            log.info("interrupted")
    return timing


def _tick(sock: socket.socket, served: ServedPlant) -> None:
    client = served.client
    answer = served.tick(now())
    if answer is not None:
        _send(sock, answer, client)


def _listen_until(sock: socket.socket, served: ServedPlant, due: int, polled: int) -> None:
    """Receive until a time [ns], polling at last for as long as stated [ns], and what has arrived by then."""
    while (left := due - now()) > 0:
        _listen(sock, served, max(0, left - polled) / SECOND)
    for _ in range(_BURST):
        if not _listen(sock, served, 0.0):
            break


def _await(sock: socket.socket, served: ServedPlant, due: int, seconds: float, stop: threading.Event) -> None:
    """Receive until an awaited command of a sample due at a time [ns] has come, a time [s] is over, or `stop` is set.

    It is awaited beyond that time by a plant that is behind; one that catches up polls at first.
    """
    begin = now()
    end, sleeps = begin + round(seconds * SECOND), begin + (_POLL if begin - due < _CATCHING_UP else 0)
    while served.awaited and (left := end - now()) > 0 and not stop.is_set():
        _listen(sock, served, min(left / SECOND, _IDLE) if now() >= sleeps else 0.0)


def _listen(sock: socket.socket, served: ServedPlant, timeout: float) -> bool:
    """Receive one datagram for the plant within a time [s]; False if there was none."""
    return answer_one(sock, timeout, lambda datagram, sender: served.receive(datagram, sender, now()))


def answer_one(sock: socket.socket, timeout: float, answers: Callable[[bytes, Any], Iterable[bytes]]) -> bool:
    """Receive one datagram within a time [s] and send its sender the answers to it; False if there was none."""
    try:
        datagram, sender = sock.recvfrom(_LARGEST)
    except BlockingIOError:
        return timeout > 0.0 and bool(select.select([sock], [], [], timeout)[0]) and answer_one(sock, 0.0, answers)
    except OSError:  # some systems report here that an earlier answer could not be delivered
        return True
    for answer in answers(datagram, sender):
        _send(sock, answer, sender)
    return True


def _send(sock: socket.socket, datagram: bytes, receiver: Any) -> None:
    try:
        sock.sendto(datagram, receiver)
    except OSError as error:  # unreachable: a lost datagram like any other
        log.debug("nothing sent to %s: %s", receiver, error)

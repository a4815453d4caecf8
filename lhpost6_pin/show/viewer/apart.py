"""A live view in a process of its own, so that drawing cannot delay a plant that keeps the clock."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection

from ...machine.machine import Machine
from ...simulation.snapshot import Snapshot, Watch
from .frames import AS_IT_IS, Look
from .live import LiveView

__all__ = ["view_apart"]

MOST_UNSEEN = 8
"""Sights sent and not yet drawn from which on further ones are left out."""


@contextmanager
def view_apart(machine: Machine, title: str, look: Look = AS_IT_IS) -> Iterator[tuple[str, Watch]]:
    """Yield the address of a page that shows a plant, and what to call with its sights; that never waits.

    A view that fell behind, or was ended, misses sights. Raises ParameterError as `Look.refuse`.
    """
    look.refuse()
    spawn = get_context("spawn")  # a copy of a process with threads may hang
    here, there = spawn.Pipe()
    process = spawn.Process(target=_draw, args=(there, machine, title, look), daemon=True)
    process.start()
    there.close()
    unseen = 0

    def show(snapshot: Snapshot) -> None:
        nonlocal unseen
        with suppress(OSError, EOFError):  # the view has ended
            while here.poll():
                here.recv()
                unseen -= 1
            if unseen < MOST_UNSEEN:
                here.send(snapshot)
                unseen += 1

    try:
        yield here.recv(), show
    finally:
        here.close()
        process.join()


def _draw(plant: Connection, machine: Machine, title: str, look: Look) -> None:
    """Draw what comes from the plant until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the plant, and that this
    with LiveView(machine, title, look, real_time=False) as view, suppress(OSError, EOFError):
        plant.send(view.url)
        while True:
            view.show(plant.recv())
            plant.send(None)

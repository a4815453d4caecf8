"""A live view of a moving table: a simulation, or the plant behind the UDP link."""

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from types import TracebackType

import numpy as np
import pinocchio as pin

from ...core.names import AXES
from ...machine.machine import Machine
from ...mechanics.plant import make_plant
from ...simulation.limit_use import plant_limits, sample_shares
from ...simulation.snapshot import Snapshot, Watch
from ..bodies import body_name, body_poses, joint_positions, load_bodies
from ..urdf import legs
from .arrows import OPACITY, arrow_colours, arrow_sizes, kilonewtons, largest_force
from .frames import AS_IT_IS, Look
from .scene import draw_arrows, draw_machine, draw_names, table_of
from .show import machine_legend
from .viewer_page import Caption, render_page
from .window import LoopbackWindow, Placed, SharedWindow

__all__ = ["LiveScene", "LiveView", "view_apart"]

PAUSE = 0.05  # [s] between looks at whether a pause has ended
MOST_UNSEEN = 8  # snapshots sent and not yet drawn, from which on further ones are dropped


class LiveScene:
    """A plant as it moves, in a window of its own page.

    Arrows are scaled by the forces at the start: the largest of them is drawn at half the longest length. Meters show
    displacements and actuator forces over their capacities.
    """

    def __init__(
        self,
        machine: Machine,
        title: str,
        window: Callable[[str], SharedWindow],
        look: Look = AS_IT_IS,
        *,
        bare: bool = False,
    ) -> None:
        """Draw the machine in a `window`, `bare` without words; raises ParameterError as `Look.refuse`."""
        look.refuse()
        self._limits = plant_limits(make_plant(machine))
        self._machine, self._look = machine, look
        self._bodies = load_bodies(machine)
        self._names = [leg.name for leg in legs(machine)]
        note = f"{machine.name}, live, {look.size}; +X to the right"
        self._window = window(render_page(Caption(title, note, machine_legend(machine), bare=bare), live=True))
        draw_machine(self._window, machine, self._bodies)
        draw_arrows(self._window, self._names)
        draw_names(self._window, machine)
        shaped = {shape.parentJoint for shape in self._bodies.shapes}
        self._table = table_of(self._window)
        self._moving = {j: body_name(self._bodies.model, j) for j in shaped if j > 0}  # by joint
        self._largest = 0.0  # force of the longest arrow [N]; 0 before the first snapshot
        self._still = np.zeros(len(self._names))  # forces that are not drawn [N]

    def draw(self, snapshot: Snapshot) -> None:
        """Draw one snapshot at once."""
        if not self._largest:
            self._largest = 2.0 * largest_force(snapshot.force)
            self._still = snapshot.force if self._look.change else self._still
        q = joint_positions(self._machine, self._bodies.model, self._look.amplify * snapshot.displacement)
        poses = body_poses(self._bodies.model, q)[0]
        for joint, name in self._moving.items():
            self._window.send(Placed(self._table[name].path.lower(), pin.XYZQUATToSE3(poses[joint]).homogeneous))
        force = snapshot.force - self._still
        sizes, colours = arrow_sizes(self._machine, force, self._largest), arrow_colours(force, self._largest)
        for name, size, colour in zip(self._names, sizes, colours, strict=True):
            arrow = self._table[f"{name}_rod"]["force"]
            arrow.set_property("scale", size.tolist())
            arrow.set_property("color", [*colour.tolist(), OPACITY])
        words = f"{snapshot.time:.1f} s, largest force {kilonewtons(largest_force(force))}"
        self._window.show_state(words, self._meters(snapshot))

    def _meters(self, snapshot: Snapshot) -> dict[str, float]:
        """Displacements along the axes, and forces of the actuators, over their capacities; without one, none."""
        actuators = len(self._machine.actuators)
        displacements, forces = sample_shares(self._limits, snapshot.displacement, snapshot.force[:actuators])
        named = zip([*AXES, *self._machine.actuator_names], [*displacements, *forces], strict=True)
        return {name: round(float(np.clip(share, -9.99, 9.99)), 3) for name, share in named if not np.isnan(share)}


class LiveView(LiveScene):
    """A page on this computer that shows a plant as it moves, while used in a ``with`` block.

    A browser may pause: with `real_time` the plant waits.
    """

    def __init__(
        self,
        machine: Machine,
        title: str,
        look: Look = AS_IT_IS,
        *,
        real_time: bool = True,
        ended: Callable[[], bool] = lambda: False,
    ) -> None:
        """Prepare the page; with `real_time` motion is no faster than real, and a pause lasts until `ended` at most.

        Raises ParameterError as `Look.refuse`.
        """
        super().__init__(machine, title, self._open, look)
        self._ended, self._real_time = ended, real_time
        self._begin: float | None = None  # by the clock [s], of the plant's time zero

    def _open(self, page: str) -> SharedWindow:
        self._served = LoopbackWindow(page)
        return self._served

    @property
    def url(self) -> str:
        """Address of the page."""
        return self._served.url

    def __enter__(self) -> "LiveView":
        """Start to serve."""
        self._served.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop serving."""
        self._served.__exit__(kind, error, trace)

    def wait(self, seconds: float) -> bool:
        """Wait until a browser is connected, at most so long [s]; True if one is."""
        return self._served.wait(seconds)

    def show(self, snapshot: Snapshot) -> None:
        """Draw one snapshot; returns at once, or in real time when it is due."""
        if self._served.paused.is_set():
            if not self._real_time:
                return  # the plant goes on, its picture rests
            since = time.monotonic()
            while self._served.paused.is_set() and not self._ended():
                time.sleep(PAUSE)
            self._begin = None if self._begin is None else self._begin + time.monotonic() - since
        if self._begin is None:
            self._begin = time.monotonic() - snapshot.time
        if self._real_time:
            time.sleep(max(0.0, self._begin + snapshot.time - time.monotonic()))
        self.draw(snapshot)


@contextmanager
def view_apart(machine: Machine, title: str, look: Look = AS_IT_IS) -> Iterator[tuple[str, Watch]]:
    """Yield the address of a page that shows a plant, and a function that takes its snapshots and never waits.

    The view runs in a process of its own, so that drawing cannot delay a plant in real time. A view that fell behind,
    or was ended, misses snapshots. Raises ParameterError as `Look.refuse`.
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
    """Draw the snapshots of the plant until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the plant, which ends this
    with LiveView(machine, title, look, real_time=False) as view, suppress(OSError, EOFError):
        plant.send(view.url)
        while True:
            view.show(plant.recv())
            plant.send(None)

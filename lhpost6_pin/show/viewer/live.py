"""A table watched while it moves: a simulation, or the plant behind the UDP link."""

import time
from types import TracebackType

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ...machine.machine import Machine
from ...simulation.snapshot import Snapshot
from ..bodies import body_name, body_poses, joint_positions, load_bodies
from ..urdf import legs
from .arrows import OPACITY, arrow_colours, arrow_sizes, largest_force
from .frames import AS_IT_IS, Look
from .scene import draw_arrows, draw_machine, draw_names, table_of
from .show import machine_legend
from .viewer_page import Caption, render_page
from .window import LoopbackWindow

__all__ = ["LiveView"]

Array = NDArray[np.float64]


class LiveView:
    """A page on this computer that shows a plant as it moves, while used in a ``with`` block.

    Arrows are scaled by what holds the table at the start: the largest of those forces is drawn half as long as can be.
    """

    def __init__(self, machine: Machine, title: str, look: Look = AS_IT_IS, *, real_time: bool = True) -> None:
        """Prepare the page; in `real_time` motion is no faster than it is. Raises ParameterError as `Look.refuse`."""
        look.refuse()
        self._machine, self._look, self._real_time = machine, look, real_time
        self._bodies = load_bodies(machine)
        self._names = [leg.name for leg in legs(machine)]
        note = f"{machine.name}, live, {look.size}; +X to the right"
        self._window = LoopbackWindow(render_page(Caption(title, note, machine_legend(machine)), live=True))
        draw_machine(self._window, machine, self._bodies)
        draw_arrows(self._window, self._names)
        draw_names(self._window, machine)
        shaped = {shape.parentJoint for shape in self._bodies.shapes.geometryObjects}
        self._table = table_of(self._window)
        self._moving = {j: body_name(self._bodies.model, j) for j in shaped if j > 0}  # by joint
        self._begin: float | None = None  # by the clock [s], of the plant's time zero
        self._largest = 1.0  # force of the longest arrow [N]
        self._still = np.zeros(len(self._names))  # forces that are not drawn [N]

    @property
    def url(self) -> str:
        """Address of the page."""
        return self._window.url

    def __enter__(self) -> "LiveView":
        """Start to serve."""
        self._window.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop serving."""
        self._window.__exit__(kind, error, trace)

    def wait(self, seconds: float) -> bool:
        """Wait until somebody looks, at most so long [s]; whether somebody does."""
        return self._window.wait(seconds)

    def show(self, snapshot: Snapshot) -> None:
        """Draw one snapshot; returns at once, or in real time when its moment has come."""
        if self._begin is None:
            self._begin, self._largest = time.monotonic() - snapshot.time, 2.0 * largest_force(snapshot.force)
            self._still = snapshot.force if self._look.change else self._still
        if self._real_time:
            time.sleep(max(0.0, self._begin + snapshot.time - time.monotonic()))
        q = joint_positions(self._machine, self._bodies.model, self._look.amplify * snapshot.displacement)
        poses = body_poses(self._bodies.model, q)[0]
        for joint, name in self._moving.items():
            self._table[name].set_transform(pin.XYZQUATToSE3(poses[joint]).homogeneous)
        force = snapshot.force - self._still
        sizes, colours = arrow_sizes(self._machine, force, self._largest), arrow_colours(force, self._largest)
        for name, size, colour in zip(self._names, sizes, colours, strict=True):
            arrow = self._table[f"{name}_rod"]["force"]
            arrow.set_property("scale", size.tolist())
            arrow.set_property("color", [*colour.tolist(), OPACITY])
        self._window.say(f"{snapshot.time:.1f} s, largest force {largest_force(force) / 1e3:,.0f} kN")

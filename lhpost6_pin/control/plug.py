"""The interface of a user's own controller, and loading one by file and name.

    class Mine:
        def init(self, plant, rest):
            return {"last": rest.spool.copy()}          # its memory, for one run

        def step(self, memory, wanted, sensors):
            return spools                               # (n_actuators,), -1..1

`lhpost6 run MOTION --controller mine.py:Mine` runs it in place of the 469D; so does `PluggedLoop` in Python.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..core.arrays import Array
from ..core.errors import ControllerError
from ..core.user_code import call_user, is_python, load_attribute, make_attribute
from ..mechanics.equilibrium import Equilibrium
from ..mechanics.plant import Plant
from .loop import Feedback

__all__ = ["Feedback", "UserController", "Wanted", "checked_command", "is_plugged", "load_plugged"]
__all__ += ["start_plugged"]


is_plugged = is_python
"""Whether the name of a controller is a class or function in a Python file rather than settings."""


class Wanted(NamedTuple):
    """Target at one sample: motion of C in {s} and Euler angles, (6,) each, read only."""

    displacement: Array
    velocity: Array
    acceleration: Array


class UserController(Protocol):
    """A controller at 2048 Hz. It may hold its state in `memory`, so that one object serves many runs."""

    def init(self, plant: Plant, rest: Equilibrium) -> Any:
        """Memory of one run of a plant that rests in the zero-position."""

    def step(self, memory: Any, wanted: Wanted, sensors: Feedback) -> ArrayLike:
        """Spool commands (n_actuators,), -1..1, of one sample; called once a sample, in order."""


def load_plugged(name: str) -> UserController:
    """Controller from ``file.py:Name``, a class without arguments or a function that returns one.

    Raises ControllerError naming the file and what is wrong with it.
    """
    made = load_attribute(name, "--controller", ControllerError)
    controller: UserController = make_attribute(name, made, ControllerError)
    for method in ("init", "step"):
        if not callable(getattr(controller, method, None)):
            raise ControllerError(f"{name} has no {method}(); a controller has init(plant, rest) and step(...)")
    return controller


def start_plugged(
    controller: UserController, plant: Plant, rest: Equilibrium, motion: Sequence[Array]
) -> Callable[[int, Feedback], Array]:
    """Start a user's controller; return its command (n_actuators,) by sample and sensors.

    motion: target displacement, velocity and acceleration (n, 6) of C and Euler angles, which the controller sees
    through read-only views. Raises ControllerError, now or later, naming the controller, the sample and the actuator
    where it fails or returns no finite numbers.
    """
    views = [values.view() for values in motion]
    for values in views:
        values.flags.writeable = False
    memory = call_user(controller, "init", "", ControllerError, plant, rest)

    def command(sample: int, sensors: Feedback) -> Array:
        wanted = Wanted(*(values[sample] for values in views))
        when = f" at sample {sample}"
        given = call_user(controller, "step", when, ControllerError, memory, wanted, sensors)
        return checked_command(controller, given, sample, plant.spools)

    return command


def checked_command(controller: UserController, command: ArrayLike, sample: int, spools: int) -> Array:
    """Command (n_actuators,) as numbers; raises ControllerError naming the controller, the sample and the actuator."""
    name = type(controller).__name__
    try:
        if np.iscomplexobj(command):
            raise TypeError("they are complex")
        values = np.asarray(command, float)
    except (TypeError, ValueError) as error:
        raise ControllerError(f"{name} returned no numbers at sample {sample}: {error}") from error
    if values.shape != (spools,):
        raise ControllerError(f"{name} returned shape {values.shape} at sample {sample}; ({spools},) is needed")
    if not np.isfinite(values).all():
        at = int(np.argmin(np.isfinite(values)))
        raise ControllerError(f"{name} returned {values[at]} for actuator {at + 1} of {spools} at sample {sample}")
    return values

"""The interface of a user's own controller, and loading one by file and name.

    class Mine:
        def init(self, plant, rest):
            return {"last": rest.spool.copy()}          # its memory, for one run

        def step(self, memory, wanted, sensors):
            return spools                               # (n_actuators,), -1..1

`lhpost6 run MOTION --controller mine.py:Mine` runs it in place of the 469D; so does `PluggedLoop` in Python.
"""

import importlib.util
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..core.arrays import Array
from ..core.errors import ControllerError, LhpostError
from ..mechanics.equilibrium import Equilibrium
from ..mechanics.plant import Plant
from .loop import Feedback

__all__ = ["Feedback", "UserController", "Wanted", "checked_command", "is_plugged", "load_plugged"]
__all__ += ["start_plugged"]


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


def is_plugged(name: str) -> bool:
    """Whether the name of a controller is a class or function in a Python file rather than settings."""
    return ".py:" in name or name.endswith(".py")


def load_plugged(name: str) -> UserController:
    """Controller from ``file.py:Name``, a class without arguments or a function that returns one.

    Raises ControllerError naming the file and what is wrong with it.
    """
    file, colon, attribute = name.rpartition(":")
    if not colon:
        raise ControllerError(f"{name}: which class or function in it? write --controller {name}:NAME")
    path = Path(file)
    if not path.is_file():
        raise ControllerError(f"{path}: no such file; write --controller FILE.py:NAME")
    spec = importlib.util.spec_from_file_location(f"lhpost6_plugged_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ControllerError(f"{path} cannot be imported as Python")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses and pickle look up modules there
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # whatever a user's file raises
        del sys.modules[spec.name]
        raise ControllerError(f"{path} cannot be imported: {type(error).__name__}: {error}") from error
    if not hasattr(module, attribute):
        names = [n for n, v in vars(module).items() if callable(v) and getattr(v, "__module__", "") == module.__name__]
        raise ControllerError(f"{path} has no {attribute!r}; it has {', '.join(names) or 'no class or function'}")
    try:
        controller = getattr(module, attribute)()
    except (Exception, SystemExit) as error:  # likewise
        raise ControllerError(f"{name} cannot be made without arguments: {type(error).__name__}: {error}") from error
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
    memory = _call(controller, "init", "", plant, rest)

    def command(sample: int, sensors: Feedback) -> Array:
        wanted = Wanted(*(values[sample] for values in views))
        given = _call(controller, "step", f" at sample {sample}", memory, wanted, sensors)
        return checked_command(controller, given, sample, plant.spools)

    return command


def _call(controller: UserController, method: str, when: str, *arguments: Any) -> Any:
    """Result of a user's method; an exception becomes a ControllerError with the line of the file that raised it."""
    try:
        return getattr(controller, method)(*arguments)
    except LhpostError:
        raise
    except (Exception, SystemExit) as error:  # whatever a user's code raises
        lines = [f for f in traceback.extract_tb(error.__traceback__) if f.filename != __file__]
        where = f" ({lines[-1].filename}, line {lines[-1].lineno})" if lines else ""
        what = f"{type(error).__name__}: {error}{where}"
        raise ControllerError(f"{type(controller).__name__}.{method} failed{when}: {what}") from error


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

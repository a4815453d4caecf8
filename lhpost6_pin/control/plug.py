"""The plug point: what a user's own controller looks like, and how one is found by file and name.

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
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import ControllerError, LhpostError
from ..mechanics.equilibrium import Equilibrium
from ..mechanics.plant import Plant
from .loop import Feedback

__all__ = ["Feedback", "UserController", "Wanted", "checked_command", "is_plugged", "load_plugged"]
__all__ += ["start_plugged", "step_plugged", "wanted_from"]

Array = NDArray[np.float64]


class Wanted(NamedTuple):
    """What is wanted of the platen at one sample: motion of C in {s} and Euler angles, (6,) each, read only."""

    displacement: Array
    velocity: Array
    acceleration: Array


class UserController(Protocol):
    """A controller at 2048 Hz. It may keep its state in `memory`, so that one object serves many runs."""

    def init(self, plant: Plant, rest: Equilibrium) -> Any:
        """Memory of one run of a plant that rests in the zero-position."""

    def step(self, memory: Any, wanted: Wanted, sensors: Feedback) -> ArrayLike:
        """Spool commands (n_actuators,), -1..1, of one sample; called once a sample, in order."""


def is_plugged(name: str) -> bool:
    """True if a name given for a controller means a Python file and a class or function in it, not settings."""
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
    sys.modules[spec.name] = module  # dataclasses and pickle look their module up there
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # whatever a user's file raises
        del sys.modules[spec.name]
        raise ControllerError(f"{path} cannot be imported: {type(error).__name__}: {error}") from error
    if not hasattr(module, attribute):
        names = [n for n, v in vars(module).items() if callable(v) and getattr(v, "__module__", "") == module.__name__]
        raise ControllerError(f"{path} has no {attribute!r}; it has {', '.join(names) or 'nothing that can be called'}")
    try:
        controller = getattr(module, attribute)()
    except (Exception, SystemExit) as error:  # likewise
        raise ControllerError(f"{name} cannot be made without arguments: {type(error).__name__}: {error}") from error
    for method in ("init", "step"):
        if not callable(getattr(controller, method, None)):
            raise ControllerError(f"{name} has no {method}(); a controller has init(plant, rest) and step(...)")
    return controller


def wanted_from(displacement: Array, velocity: Array, acceleration: Array) -> Callable[[int], Wanted]:
    """Function that gives what is wanted at a sample of a motion, (n, 6) each, that no controller can change."""
    motion = [values.view() for values in (displacement, velocity, acceleration)]
    for values in motion:
        values.flags.writeable = False
    return lambda sample: Wanted(*(values[sample] for values in motion))


def start_plugged(controller: UserController, plant: Plant, rest: Equilibrium) -> Any:
    """Memory of a user's controller for one run; raises ControllerError where its init does."""
    try:
        return controller.init(plant, rest)
    except LhpostError:  # it says itself what is wrong
        raise
    except (Exception, SystemExit) as error:  # whatever a user's code raises
        raise _failed(controller, "init", "", error) from error


def step_plugged(controller: UserController, memory: Any, sample: int, wanted: Wanted, sensors: Feedback) -> Array:
    """Command (n_actuators,) of a user's controller at a sample, as finite numbers.

    Raises ControllerError naming the controller, the sample and the actuator where there is none.
    """
    try:
        command = controller.step(memory, wanted, sensors)
    except LhpostError:
        raise
    except (Exception, SystemExit) as error:  # likewise
        raise _failed(controller, "step", f" at sample {sample}", error) from error
    return checked_command(controller, command, sample, sensors.displacement.size)


def _failed(controller: UserController, method: str, when: str, error: BaseException) -> ControllerError:
    """What a user's method raised, with the line of the file where it did."""
    lines = [f for f in traceback.extract_tb(error.__traceback__) if f.filename != __file__]
    where = f" ({lines[-1].filename}, line {lines[-1].lineno})" if lines else ""
    name = type(controller).__name__
    return ControllerError(f"{name}.{method} failed{when}: {type(error).__name__}: {error}{where}")


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

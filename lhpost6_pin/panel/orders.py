"""Orders of the controller from messages of a page, within what the table can do, in the units of the page."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import ControllerError
from ..core.names import AXES, SAMPLE_RATE
from ..data.motion_files import motion_of
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..mechanics.plant import make_plant
from ..motions import make_target
from .demand import check_program
from .engine import Status
from .interlocks import INTERLOCKS
from .page_units import in_page_units, place_unit
from .programs import Program, Recorded, make_wave

__all__ = ["Orders", "pressed"]


class Orders:
    """Makes orders, plain entries with `what` in words for the journal.

    Attribute `program`: the one that the controller has loaded, or None; whoever sends the orders sets it.
    """

    def __init__(self, machine: Machine, numbers: Parameters, folder: Path) -> None:
        """Take the limits of a machine; motions are written into the folder for the controller."""
        self._machine, self._numbers, self._folder = machine, numbers, folder
        self._plant = make_plant(machine)
        self.program: Program | None = None

    def of(self, do: str, message: Mapping[str, Any], status: Status | None) -> dict[str, Any]:
        """The order of a message in a state of the table; None: the pressure is off.

        Raises ControllerError, MotionError or OutOfRangeError with the reason for what cannot be, and KeyError,
        TypeError or ValueError for what no page sends.
        """
        if do == "pressure":
            return {"do": do, "to": str(message["to"]), "what": f"sets the pressure {message['to']}"}
        if do in ("setpoint", "span"):
            return self._six(do, str(message["axis"]), float(message["value"]), pressed(status))
        if do == "scale":
            return self._scale(float(message["value"]), pressed(status))
        if do == "run":
            stated = {"number": int(message["number"])} if message.get("number") is not None else {}
            return {"do": do, **stated, "what": f"runs the program {self.program.name if self.program else ''}".strip()}
        if do == "interlock":
            if message["name"] not in INTERLOCKS:
                raise ControllerError(f"no interlock {message['name']!r}; there are {', '.join(INTERLOCKS)}")
            limit = f" limit {100.0 * float(message['limit']):g} % of capacity" if "limit" in message else ""
            on = f" {'on' if message['on'] else 'off'}" if "on" in message else ""
            return {**message, "what": f"sets the interlock {message['name']}:{limit}{on}"}
        if do == "fault":
            where = str(message.get("where", "all"))
            name = str(message["name"]) if where == "all" else f"{message['name']}@{where}"
            what = f"switches the fault {name} {'on' if message['on'] else 'off'}"
            return {"do": do, "name": name, "on": bool(message["on"]), "what": what}
        words = {"raise": "raises the platen", "park": "parks the platen", "reset": "resets"}
        words |= {"hold": "holds the program", "stop": "stops the program", "trip": "trips the table"}
        if do not in words:
            raise ControllerError(f"no order {do!r}")
        return {"do": do, "what": words[do]}

    def choose(self, message: Mapping[str, Any], status: Status | None, number: int) -> tuple[dict[str, Any], Program]:
        """The order that loads the program which a message chooses, and that program, checked in a state of the table.

        `number` tells choices apart. Takes seconds for a long motion; raises as `of`.
        """
        if message["do"] == "generator":
            order, program = self._wave(message, pressed(status))
        else:
            scale, axes = float(message["scale"]), message.get("axes")
            order, program = self._motion(str(message["name"]), axes, scale, pressed(status), number)
        return {**order, "do": "load", "number": number}, program

    def _six(self, do: str, axis: str, value: float, status: Status) -> dict[str, Any]:
        """A setpoint or span of one axis, within what the table can do."""
        at = AXES.index(axis)
        limit = self._machine.limits.displacement[at] if at in self._plant.axes else 0.0
        wanted, most = in_page_units(value, place_unit(axis)), in_page_units(limit, place_unit(axis))
        if not abs(value) <= limit:
            raise ControllerError(f"{do} of {axis}: {wanted}; the limit is {most}")
        if do == "span" and value < 0.0:
            raise ControllerError(f"span of {axis}: {wanted}; it is an amplitude, zero or more")
        if self.program is not None and self.program.by_span:
            both = {"span": np.array(status.span), "setpoint": np.array(status.base)}
            both[do][at] = value
            check_program(self._plant, self.program, both["span"], both["setpoint"])
        what = f"sets the {do} of {axis} to {wanted}"
        return {"do": do, "axis": at, "value": value, "what": what}

    def _scale(self, value: float, status: Status) -> dict[str, Any]:
        if self.program is not None and not self.program.by_span:
            check_program(self._plant, self.program, np.full(6, value), np.array(status.base))
        return {"do": "scale", "value": value, "what": f"sets the scale of the motion to {value:g}"}

    def _wave(self, message: Mapping[str, Any], status: Status) -> tuple[dict[str, Any], Program]:
        """A wave on axes that have a span."""
        axes = tuple(AXES.index(str(axis)) for axis in message["axes"])
        given = {key: float(message[key]) for key in ("cycles", "to", "duration") if message.get(key) is not None}
        given |= {name: self._numbers.number(f"generator.{name}") for name in ("highest", "reversal")}
        wave = make_wave(str(message["wave"]), axes=axes, frequency=float(message["frequency"]), **given)
        still = [AXES[k] for k in axes if status.span[k] == 0.0]
        if still:
            raise ControllerError(f"the span of {', '.join(still)} is zero; set one first")
        check_program(self._plant, wave, np.array(status.span), np.array(status.base))
        return {"wave": wave, "what": f"loads {wave.name} on {', '.join(AXES[k] for k in axes)}"}, wave

    def _motion(
        self, name: str, axes: str | None, scale: float, status: Status, number: int
    ) -> tuple[dict[str, Any], Program]:
        """A motion by name, as rows in a file."""
        own = None if self._machine.motion == "free" else self._machine.motion
        target = make_target(motion_of(name, []), axes=axes or own, rate=float(SAMPLE_RATE))
        program = Recorded(target.reference.motion, target.displacement, target.velocity, target.acceleration)
        check_program(self._plant, program, np.full(6, scale), np.array(status.base))
        file = self._folder / f"motion-{number}.npy"
        np.save(file, np.stack([target.displacement, target.velocity, target.acceleration]))
        what = f"loads {program.name} at scale {scale:g}"
        return {"file": str(file), "name": program.name, "scale": scale, "what": what}, program


def pressed(status: Status | None) -> Status:
    """The state of a table under pressure; raises ControllerError for one without."""
    if status is None:
        raise ControllerError("the pressure is off; set it low, then high")
    return status

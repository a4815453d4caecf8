"""What a set of sensors can tell of a machine, and what it cannot: a rule per quantity.

A rule names the channels that a quantity needs and what fixes its scale. A pressure measures a force only through a
piston area that the machine file states: what follows from it is known as a ratio to that area.
"""

from collections.abc import Collection
from typing import Literal, NamedTuple

from ..machine.machine import Machine

__all__ = ["Observable", "observable"]

Verdict = Literal["yes", "ratio", "no"]


_OIL = "pressures, or a load cell on a piston of equal areas"


class Observable(NamedTuple):
    """One quantity: whether its value can be identified, only a ratio or a sum, or nothing; and why."""

    quantity: str
    verdict: Verdict
    why: str


class _Channels(NamedTuple):
    """Channels of a campaign, by what they measure."""

    machine: Machine
    present: Collection[str]

    def any(self, *names: str) -> bool:
        return bool(set(names) & set(self.present))

    @property
    def motion(self) -> bool:
        return self.any("platen_displacement", "actuator_displacement")

    @property
    def pressures(self) -> bool:
        both = self.any("chamber_pressure_b") or not self.machine.double_acting
        return self.any("pressure_difference") or (self.any("chamber_pressure_a") and both)

    @property
    def difference(self) -> bool:
        """Whether the pressure difference is known: measured, or from the load cell of a piston of equal areas."""
        return self.pressures or (self.force and self.machine.equal_areas)

    @property
    def force(self) -> bool:
        return self.any("actuator_force")

    @property
    def valve(self) -> bool:
        return self.any("spool_position", "valve_command")


def observable(machine: Machine, present: Collection[str]) -> tuple[Observable, ...]:
    """What the channels `present` in every test can tell."""
    have = _Channels(machine, present)
    rules = (_mass, _friction, _direction, _valve, _leakage, _lag, _oil, _specimen, _supply, _struts, _accelerometer)
    return tuple(found for rule in rules if (found := rule(have)))


def _by_force(quantity: str, c: _Channels, of: str) -> Observable:
    """A quantity of the balance of forces: its scale is that of the force."""
    if not c.motion:
        return Observable(quantity, "no", "needs platen_displacement or actuator_displacement")
    if c.force:
        return Observable(quantity, "yes", f"{of}; scale: calibration of actuator_force")
    if c.pressures:
        return Observable(
            quantity, "ratio", f"{of}, over the piston area that the machine file states; no actuator_force"
        )
    return Observable(quantity, "no", "no force: needs actuator_force, chamber pressures or pressure_difference")


def _mass(c: _Channels) -> Observable:
    fast = "" if c.any("platen_acceleration") else "; no accelerometer, so only from motion of a few hertz"
    return _by_force("moving mass", c, f"force against acceleration{fast}")


def _friction(c: _Channels) -> Observable:
    return _by_force("friction law", c, "force against velocity, at all speeds of the tests")


def _direction(c: _Channels) -> Observable | None:
    """On guides: legs of a platform push against each other, which tells an offset from friction."""
    if c.machine.motion == "free" or not (c.motion and (c.force or c.pressures)):
        return None
    sensor = "actuator_force" if c.force else "a pressure"
    why = f"only beyond the offset of {sensor} that the sensors file allows: both shift the force alike"
    return Observable("friction by direction", "ratio", why)


def _lacking(c: _Channels) -> str:
    """What a valve's flow needs and is not there; empty if nothing is."""
    valve, motion = "" if c.valve else "spool_position or valve_command", "" if c.motion else "displacement"
    return " and ".join(filter(None, [valve, motion]))


def _valve(c: _Channels) -> Observable:
    name = "valve gain and null"
    if missing := _lacking(c):
        return Observable(name, "no", f"needs {missing}")
    if not c.difference:
        return Observable(name, "no", f"needs {_OIL}: without them the load shifts the flow as a null does")
    return Observable(name, "ratio", "flow against command; null in full command, gain over the piston area")


def _by_flow(quantity: str, c: _Channels, of: str) -> Observable:
    """A quantity of the balance of flow, over the piston area."""
    if missing := " and ".join(filter(None, [_lacking(c), "" if c.difference else _OIL])):
        return Observable(quantity, "no", f"needs {missing}")
    return Observable(quantity, "ratio", of)


def _leakage(c: _Channels) -> Observable:
    return _by_flow("leakage", c, "flow without motion against pressure, over the piston area")


def _lag(c: _Channels) -> Observable:
    name = "valve delay and lag"
    if c.any("spool_command") and c.any("spool_position"):
        return Observable(name, "yes", "spool_position against spool_command")
    if c.any("valve_command") and c.motion and not c.difference:
        return Observable(name, "no", f"needs {_OIL}: without them a load that varies delays the motion, too")
    if c.any("valve_command") and c.motion:
        return Observable(name, "ratio", "only their sum: the spool between command and motion is not measured")
    return Observable(name, "no", "needs a command, and the spool or the motion that it causes")


def _oil(c: _Channels) -> Observable:
    return _by_flow("oil stiffness", c, "rate of pressure against flow, over area and chamber lengths")


def _specimen(c: _Channels) -> Observable:
    name = "specimen"
    if c.any("floor_acceleration"):
        if not c.machine.floors:
            return Observable(name, "no", "needs the floors' masses, [floor.NAME] of the machine's file")
        return Observable(name, "yes", "base shear: floor masses times floor_acceleration")
    if c.motion and (c.force or c.pressures):
        return Observable(name, "ratio", "its base shear as what the bare table lacks; no floor_acceleration")
    return Observable(name, "no", "needs floor_acceleration, or forces on the table")


def _supply(c: _Channels) -> Observable:
    if c.any("supply_pressure"):
        return Observable("droop of the supply", "yes", "supply_pressure")
    return Observable("droop of the supply", "no", "needs supply_pressure; taken as constant")


def _struts(c: _Channels) -> Observable | None:
    if not c.machine.struts:
        return None
    if c.any("strut_pressure") and c.motion:
        return Observable("gas of the struts", "yes", "strut_pressure against displacement")
    return Observable("gas of the struts", "no", "needs strut_pressure and displacement")


def _accelerometer(c: _Channels) -> Observable | None:
    if not c.any("platen_acceleration"):
        return None
    if c.motion:
        return Observable("gain and delay of accelerometers", "yes", "against the measured displacement")
    return Observable("gain and delay of accelerometers", "no", "needs platen_displacement")

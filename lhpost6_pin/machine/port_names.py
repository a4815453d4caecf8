"""Names of a machine's ports: where a force can act on the platen (`mechanics.ports`)."""

from collections.abc import Sequence

from .components import Actuator, Strut

__all__ = ["PLATEN_PORTS", "SWIVEL_TURNS", "place_of", "place_port", "port_names"]

PLATEN_PORTS = ("platen.x", "platen.y", "platen.z", "platen.roll", "platen.pitch", "platen.yaw")
"""Platen ports: displacement of C along {s}, and rotation; their forces are the wrench at C in {c}."""


SWIVEL_TURNS = ("base_1", "base_2", "tip_1", "tip_2", "tip_3")
"""Swivel ports of an actuator: its rod's turn in the base, about two axes across it, and the platen's in the rod, about
the same and about the rod."""


_PLACE = "at("
"""Start of the name of a port at a place of the platen."""


def place_port(place: Sequence[float], along: Sequence[float]) -> str:
    """Name of a port at a place of the platen (x, y, z from C) [m] along a direction fixed in {s}, a unit vector."""
    return f"{_PLACE}{','.join(repr(float(x)) for x in place)};{','.join(repr(float(x)) for x in along)})"


def place_of(port: str) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    """Place and direction of a port with a name of `place_port`; None of any other."""
    if not port.startswith(_PLACE):
        return None
    place, along = port[len(_PLACE) : -1].split(";")
    return tuple(map(float, place.split(","))), tuple(map(float, along.split(",")))


def port_names(actuators: Sequence[Actuator], struts: Sequence[Strut]) -> tuple[str, ...]:
    """Names of all ports: actuators, struts, pads (``V1.x``, ``V1.y``), platen, swivels of actuators (``H1.tip_1``)."""
    pads = [f"{a.name}.{d}" for a in actuators if a.mount == "bearing" for d in "xy"]
    turns = [f"{a.name}.{turn}" for a in actuators if a.mount == "swivel" for turn in SWIVEL_TURNS]
    return (*(a.name for a in actuators), *(s.name for s in struts), *pads, *PLATEN_PORTS, *turns)

"""The structure of a machine: its platen, actuators, struts, oil and limits as plain data, without effects."""

from dataclasses import dataclass, field

from ..core.names import AXES
from .components import Accelerometer, Actuator, Floor, Hydraulics, Limits, Platen, PowerSupply, Strut
from .parameters import Parameters

__all__ = ["BODIES", "ESTIMATES", "FLOW_READINGS", "MOTIONS", "VALVE_PORTS", "Structure"]

MOTIONS = ("free", "x", "y", "z", "xy", "xz", "yz", "xyz")
"""Freedom of a platen: six degrees of freedom, or displacements along guides, which hold it against turning."""

BODIES = ("lumped", "full")
"""Moving parts of the legs: lumped to the platen (Table 4.1), or bodies of their own."""

ESTIMATES = ("first", "second")
"""Estimates of the effective inertia (Table 4.1): M_eff,1, computed, and M_eff,2, identified."""

FLOW_READINGS = ("printed", "full_stroke")
"""Readings of Eq. 4-2: `flow` is the factor as printed, or the flow at full stroke of the spool."""

VALVE_PORTS = ("both_ways", "one_way")
"""Ports P and T of servovalves: Eq. 4-2 with either sign of the pressure drop, or no flow back (Section 4.1.2)."""

EQUAL_AREAS = 0.01
"""Relative difference of a piston's areas up to which its rod counts as double."""


@dataclass(frozen=True)
class Structure:
    """What a shake table is made of; numbers are plain floats in SI, whose sources are in `parameters`."""

    name: str
    title: str
    motion: str
    thrust: str
    bodies: str  # moving parts of the legs: "lumped" to the platen, or "full", as bodies of their own
    flow_reading: str  # what `flow` means in Eq. 4-2: one of `FLOW_READINGS`
    valve_ports: str  # ports P and T of the servovalves: one of `VALVE_PORTS`
    controller: str  # shipped name of its settings; empty: none
    sensors: str  # shipped name of its sensors file; empty: none
    platen: Platen
    hydraulics: Hydraulics
    actuators: tuple[Actuator, ...]
    struts: tuple[Strut, ...]
    floors: tuple[Floor, ...]
    accelerometers: tuple[Accelerometer, ...]  # that the acceleration feedback comes from; none: the platen's own
    limits: Limits
    power_supply: PowerSupply
    parameters: Parameters
    size: tuple[int, ...] | None = field(default=None, compare=False)
    """That families of the library scale with (`library.size_of`); None: its own."""

    @property
    def axes(self) -> tuple[int, ...]:
        """Numbers, of x y z roll pitch yaw, of the axes in which the platen can move."""
        return tuple(range(6)) if self.motion == "free" else tuple("xyz".index(axis) for axis in self.motion)

    @property
    def components(self) -> tuple[Actuator | Strut, ...]:
        """Actuators, then struts: the order of legs."""
        return (*self.actuators, *self.struts)

    @property
    def actuator_names(self) -> tuple[str, ...]:
        """Names of actuators in file order."""
        return tuple(a.name for a in self.actuators)

    @property
    def strut_names(self) -> tuple[str, ...]:
        """Names of struts in file order."""
        return tuple(s.name for s in self.struts)

    @property
    def double_acting(self) -> tuple[str, ...]:
        """Names of the actuators that have a chamber B; the `horizontal` dimension of records."""
        return tuple(a.name for a in self.actuators if a.area_b is not None)

    @property
    def equal_areas(self) -> bool:
        """Whether every piston has the same area on both sides: its force is that of the pressure difference."""
        areas = [(a.area_a, a.area_b) for a in self.actuators]
        return all(b is not None and abs(b / a - 1.0) <= EQUAL_AREAS for a, b in areas)

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the axes in which the platen can move."""
        return tuple(AXES[k] for k in self.axes)

    @property
    def labels(self) -> dict[str, tuple[str, ...]]:
        """Names along the dimensions of its records."""
        more: dict[str, tuple[Floor | Accelerometer, ...]]
        more = {"floor": self.floors, "accelerometer": self.accelerometers}
        found = {dim: tuple(part.name for part in parts) for dim, parts in more.items() if parts}
        return {"actuator": self.actuator_names, "horizontal": self.double_acting, "strut": self.strut_names, **found}

"""The parts of a machine, typed: platen, oil, actuators, struts, limits. Points in {s}, control zero-position."""

from dataclasses import dataclass

from .schema import quantity_field

__all__ = ["Actuator", "Floor", "Hydraulics", "Limits", "Platen", "PowerSupply", "Strut", "Vec3"]

Vec3 = tuple[float, float, float]


@dataclass(frozen=True)
class Platen:
    """Effective rigid body: platen and the moving parts lumped to it (Table 4.1), frame {b} at B."""

    mass: Vec3 = quantity_field("kg", length=3, bound="positive")
    inertia: Vec3 = quantity_field("kg m2", length=3, bound="positive")
    centre_of_gravity: Vec3 = quantity_field("m", length=3)
    bearing_plane: Vec3 = quantity_field("m", length=3)
    size: tuple[float, float] = quantity_field("m", length=2, bound="positive")
    gravity: float = quantity_field("m/s2", bound="nonnegative")
    parked: float | None = quantity_field("m", optional=True)  # displacement along Z where it is parked

    @property
    def isotropic_mass(self) -> float:
        """Part of the directional masses that an Inertia can hold [kg]."""
        return min(self.mass)

    @property
    def directional_mass(self) -> Vec3:
        """What the masses along X, Y, Z have beyond it [kg]."""
        x, y, z = self.mass
        return x - self.isotropic_mass, y - self.isotropic_mass, z - self.isotropic_mass


@dataclass(frozen=True)
class Hydraulics:
    """Oil and supply shared by all actuators."""

    supply_pressure: float = quantity_field("Pa", bound="positive")
    return_pressure: float = quantity_field("Pa", bound="nonnegative")
    rated_pressure: float = quantity_field("Pa", bound="positive")
    bulk_modulus: float = quantity_field("Pa", bound="positive")
    root_regularisation: float = quantity_field("Pa", bound="positive")


@dataclass(frozen=True)
class Actuator:
    """One servo-hydraulic actuator; points in {s}, control zero-position.

    mount: "swivel" (its end follows a platen point) or "bearing" (it stays vertical, the platen slides on it).
    valve: "4-way" (two chambers) or "3-way" (chamber A only). `chamber_b` and `area_b` are None without chamber B,
    pad quantities None without a bearing. full_command, if stated, is the voltage of an open valve. `load_cell_share`
    is the share of the oil's force that moves what is ahead of a load cell, piston and rod. An elastic bumper, if
    stated, begins where the stroke ends. Rod and barrel lengths from the platen and the base point are needed where its
    moving parts are bodies (`mechanics.leg_bodies`).
    """

    name: str
    kind: str
    mount: str
    valve: str
    valves: int
    platen_point: Vec3 = quantity_field("m", length=3)
    base_point: Vec3 = quantity_field("m", length=3)
    area_a: float = quantity_field("m2", bound="positive")
    flow: float = quantity_field("m3/s", bound="positive")
    flow_curve: float = quantity_field("1", bound="positive")
    leakage: float = quantity_field("m3/s/Pa", bound="nonnegative")
    chamber_a: float = quantity_field("m", bound="positive")
    stroke: float = quantity_field("m", bound="positive")
    valve_delay: float = quantity_field("s", bound="nonnegative")
    seal_friction: float = quantity_field("N", bound="nonnegative")
    seal_yield: float = quantity_field("m", bound="positive")
    seal_shape: float = quantity_field("1", bound="fraction")
    viscous: float = quantity_field("N s/m", bound="nonnegative")
    mass_along: float = quantity_field("kg", bound="nonnegative")
    mass_across: float = quantity_field("kg", bound="nonnegative")
    area_b: float = quantity_field("m2", bound="positive", optional=True)
    chamber_b: float = quantity_field("m", bound="positive", optional=True)
    full_command: float = quantity_field("V", bound="positive", optional=True)
    pad_friction: float = quantity_field("N", bound="nonnegative", optional=True)
    pad_yield: float = quantity_field("m", bound="positive", optional=True)
    pad_shape: float = quantity_field("1", bound="fraction", optional=True)
    load_cell_share: float = quantity_field("1", bound="fraction", optional=True)
    rod_length: float = quantity_field("m", bound="positive", optional=True)
    barrel_length: float = quantity_field("m", bound="positive", optional=True)
    bumper_stiffness: float = quantity_field("N/m", bound="positive", optional=True)
    bumper_travel: float = quantity_field("m", bound="positive", optional=True)

    @property
    def room(self) -> float:
        """Elongation at which the shorter chamber holds no more oil [m]."""
        return min(c for c in (self.chamber_a, self.chamber_b) if c is not None)

    @property
    def hard_stop(self) -> float:
        """Largest elongation either way [m]: the stroke and its bumper, or half the way to the end of a chamber."""
        if self.bumper_travel is None:
            return self.stroke
        return min(self.stroke + self.bumper_travel, 0.5 * (self.stroke + self.room))


@dataclass(frozen=True)
class Strut:
    """One nitrogen hold-down strut (Eq. 4-8); points in {s}, control zero-position."""

    name: str
    kind: str
    platen_point: Vec3 = quantity_field("m", length=3)
    base_point: Vec3 = quantity_field("m", length=3)
    area: float = quantity_field("m2", bound="positive")
    pressure: float = quantity_field("Pa", bound="nonnegative")
    gas_length: float = quantity_field("m", bound="positive")
    polytropic_index: float = quantity_field("1", bound="positive")
    seal_friction: float = quantity_field("N", bound="nonnegative")
    seal_yield: float = quantity_field("m", bound="positive")
    seal_shape: float = quantity_field("1", bound="fraction")
    mass_along: float = quantity_field("kg", bound="nonnegative")
    mass_across: float = quantity_field("kg", bound="nonnegative")
    rod_length: float = quantity_field("m", bound="positive", optional=True)
    barrel_length: float = quantity_field("m", bound="positive", optional=True)


@dataclass(frozen=True)
class Floor:
    """A floor of a specimen whose acceleration is measured: its mass times that is its share of the base shear.

    `along` is the platen axis, x, y or z, of its accelerometer; point is where its mass is, in platen axes from C. On
    guides, which take the overturning moment, it may be left out.
    """

    name: str
    along: str
    mass: float = quantity_field("kg", bound="positive")
    point: Vec3 | None = quantity_field("m", length=3, optional=True)


@dataclass(frozen=True)
class Accelerometer:
    """An accelerometer on the platen: where it is and its sensitive direction, both in platen axes.

    It reads acceleration less gravity along its direction, and is zero at rest in the zero-position: gravity comes in
    by tilt.
    """

    name: str
    point: Vec3 = quantity_field("m", length=3)  # from C
    direction: Vec3 = quantity_field("1", length=3)  # of any length


@dataclass(frozen=True)
class Limits:
    """Stated limits of the machine (Table 2.2), axis order x y z roll pitch yaw."""

    displacement: tuple[float, ...] = quantity_field("m | rad", length=6, bound="nonnegative")
    velocity: tuple[float, ...] = quantity_field("m/s | rad/s", length=6, bound="nonnegative")
    acceleration: tuple[float, ...] = quantity_field("m/s2 | rad/s2", length=6, bound="nonnegative")
    bandwidth: float = quantity_field("Hz", bound="positive")
    valve_reserve: float = quantity_field("1", bound="fraction")
    stroke_reserve: float = quantity_field("1", bound="fraction")


@dataclass(frozen=True)
class PowerSupply:
    """Pumps and accumulators behind the supply, as far as they are stated; None where they are not.

    The gas of the accumulators: pressure without oil, charged, and the lowest at which the table is to run.
    """

    pump_flow: float | None = quantity_field("m3/s", bound="positive", optional=True)  # of all pumps
    accumulators: float | None = quantity_field("m3", bound="positive", optional=True)  # their volume
    precharge: float | None = quantity_field("Pa", bound="positive", optional=True)
    charged: float | None = quantity_field("Pa", bound="positive", optional=True)
    lowest: float | None = quantity_field("Pa", bound="positive", optional=True)
    gas_index: float | None = quantity_field("1", bound="positive", optional=True)  # of a test: 1.4 adiabatic

"""What a case hides: the laws of the effects, as scalars of one leg or of the platen.

A leg (four horizontal actuators, six vertical ones, three struts) and the platen are records of numbers; an effect
sets some of their fields, which are zero without it. Laws are smooth, and none is the textbook form of its family.
Forces act on the platen along the leg, positive in extension [N]; flows go into a chamber [m3/s].
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit

__all__ = ["LEG_FIELDS", "PLATEN_FIELDS", "Effect", "switch_on"]

LEG_FIELDS = (
    *("stribeck_force", "stribeck_speed", "drag", "drag_speed", "power", "power_exponent", "power_speed"),
    *("asymmetry", "load_seal", "load_pad", "load_rest", "swivel_moment", "swivel_rate"),
    *("stop_stiffness", "stop_start", "stop_width", "gap", "gap_stiffness", "gap_damping", "gap_mass"),
    *("warm_fraction", "warm_energy", "warm_time", "damping", "damping_speed", "pad_extra", "seal_extra"),
    *("pad_warm_fraction", "pad_warm_energy", "pad_warm_time"),
    *("leak", "leak_pressure", "jet", "jet_exponent", "external_a", "external_b", "air", "air_pressure", "dead"),
    *("overlap", "underlap", "underlap_width", "bias", "lag", "late", "port_asymmetry", "port_width", "bulge"),
    *("line_inertance", "line_frequency", "line_damping", "gas_rate", "gas_leak"),
    *("ripple", "ripple_length", "ripple_phase", "creep", "creep_rate", "creep_width"),
    *("memory", "memory_time", "memory_width", "memory_level", "drift", "drift_time"),
)
PLATEN_FIELDS = (
    *("spring_x", "spring_y", "spring_z", "spring_reach", "weight", "weight_x", "weight_y"),
    *("added_mass", "added_x", "added_y", "added_z", "product_xy", "product_xz", "product_yz"),
    *("structure_mass", "structure_frequency", "structure_damping", "structure_x", "structure_y", "structure_z"),
    *("specimen_mass", "specimen_frequency", "specimen_damping", "specimen_x", "specimen_y", "specimen_z"),
    *("thrust", "droop", "droop_time", "back", "back_exponent", "surge"),
)


@dataclass(frozen=True)
class Effect:
    """One hidden effect: its family, the legs it sits in (none: the platen or the supply), its size in its fields."""

    family: str
    components: tuple[str, ...]
    strength: float
    fields: dict[str, float] = field(default_factory=dict)


def switch_on(effect: Effect, legs: np.ndarray, platen: np.ndarray, names: tuple[str, ...]) -> None:
    """Write an effect's numbers into the records of its legs or of the platen, on top of those there."""
    rows = [names.index(name) for name in effect.components]
    for name, value in effect.fields.items():
        if name in PLATEN_FIELDS:
            platen[name] += value
        else:
            legs[name][rows] += value


@njit(cache=True)
def soft_gap(x, half, width):
    """Contact beyond +-half, rounded over `width`: the excess, zero inside."""
    up, down = (x - half) / width, (-x - half) / width
    above = up if up > 30.0 else math.log1p(math.exp(up))
    below = down if down > 30.0 else math.log1p(math.exp(down))
    return width * (above - below)


@njit(cache=True)
def seal_plateau(leg, v, load, heat):
    """Friction force of a seal at speed v under a hydraulic force `load`, `heat` of its warm-up [N]."""
    plateau = leg.seal + leg.seal_extra
    if leg.stribeck_force != 0.0:
        plateau += leg.stribeck_force / (1.0 + (v / leg.stribeck_speed) ** 2)
    if leg.load_seal != 0.0:
        plateau += leg.load_seal * math.sqrt(load * load + 1e6)
    return plateau * (1.0 - leg.warm_fraction * heat / (1.0 + heat))


@njit(cache=True)
def pad_plateau(leg, load, heat):
    """Friction force of a bearing pad under its thrust `load`, `heat` of its own warm-up [N]."""
    plateau = max(leg.pad * (1.0 + leg.pad_extra) + leg.load_pad * (load - leg.load_rest), 0.0)
    return plateau * (1.0 - leg.pad_warm_fraction * heat / (1.0 + heat))


@njit(cache=True)
def leg_force(leg, x, v, z, past):
    """What acts along a leg besides its seal, its viscous force and its pressure [N]; states: bristle z, memory."""
    force = 0.0
    if leg.drag != 0.0:
        force -= leg.drag * v * math.sqrt(v * v + leg.drag_speed**2)
    if leg.power != 0.0:
        force -= leg.power * v * (v * v + leg.power_speed**2) ** (0.5 * (leg.power_exponent - 1.0))
    if leg.asymmetry != 0.0:
        force -= leg.asymmetry * z * z
    if leg.damping != 0.0:
        force -= leg.damping * leg.damping_speed * math.asinh(v / leg.damping_speed)
    if leg.stop_stiffness != 0.0:
        force -= leg.stop_stiffness * soft_gap(x, leg.stop_start, leg.stop_width)
    if leg.ripple != 0.0:
        force -= leg.ripple * math.sin(2.0 * math.pi * x / leg.ripple_length + leg.ripple_phase)
    if leg.memory != 0.0:
        force -= leg.memory * math.tanh(past / leg.memory_level)
    return force


@njit(cache=True)
def memory_rate(leg, x, v, past):
    """Fading memory of where the leg was busy [m/s]: speed, signed by the side of the stroke."""
    return (abs(v) * math.tanh(x / leg.memory_width) - past) / leg.memory_time


@njit(cache=True)
def creep_rate(leg, stretch, k):
    """Flow of creep element k under its stretch: nothing at first, then ever faster [m/s]."""
    return leg.creep_rate * math.sinh(max(min(stretch / (leg.creep_width * 2.0**k), 15.0), -15.0))


@njit(cache=True)
def spool_at_ports(leg, x):
    """Spool the ports feel: shifted by the null bias, swallowed by the overlap [1]."""
    x += leg.bias
    if leg.overlap != 0.0:
        x -= leg.overlap * math.tanh(x / leg.overlap)
    return x


@njit(cache=True)
def opening(leg, x):
    """Share of the full flow at spool x [1]."""
    share = 1.0 - math.exp(-leg.flow_curve * abs(x))
    if leg.bulge != 0.0:
        share *= 1.0 + leg.bulge * math.cos(math.pi * min(abs(x), 1.0))
    if leg.port_asymmetry != 0.0:
        share *= 1.0 + leg.port_asymmetry * math.tanh(x / leg.port_width)
    return share


@njit(cache=True)
def leakage(leg, drop):
    """Flow across the piston under a pressure drop: the nominal leak, a worn seal, a jet through a score [m3/s]."""
    flow = leg.leakage * drop
    if leg.leak != 0.0:
        flow += leg.leak * drop / (1.0 + abs(drop) / leg.leak_pressure)
    if leg.jet != 0.0:
        flow += leg.jet * drop * (drop * drop + 1e6) ** (0.5 * (leg.jet_exponent - 1.0)) / 1e7**leg.jet_exponent
    return flow


@njit(cache=True)
def compliance(leg, pressure):
    """Compliance of aerated oil over that of oil [1]."""
    if leg.air == 0.0:
        return 1.0
    return 1.0 + leg.air / (1.0 + max(pressure, 0.0) / leg.air_pressure) ** 2

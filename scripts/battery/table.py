"""The shake table, written a second time and independent of the package: its numbers, geometry, valves, friction.

Frames and signs are the report's: X longitudinal, Y transverse, Z up, R = Rz Ry Rx, origin C at the top of the platen.
Friction is of Dahl's form where the report has Bouc-Wen's. SI units.
"""

import math
import tomllib
from pathlib import Path

import numpy as np
from numba import njit

from .hidden import LEG_FIELDS, PLATEN_FIELDS, opening, spool_at_ports

__all__ = ["ACTUATORS", "LEGS", "lengths", "load_model", "make_table", "mass_matrix", "nominal_values", "rotation"]

ACTUATORS = (*(f"H{i}" for i in range(1, 5)), *(f"V{i}" for i in range(1, 7)))
LEGS = (*ACTUATORS, "S1", "S2", "S3")
KINDS = ("horizontal", "vertical", "hold_down")
POSITIONS = ("px", "py", "pz", "ax", "ay", "az")
BASE_FIELDS = (
    *("area_a", "area_b", "flow", "flow_curve", "leakage", "chamber_a", "chamber_b", "valve_delay"),
    *("seal", "seal_yield", "seal_exponent", "viscous", "pad", "pad_yield"),
    *("gas_area", "gas_pressure", "gas_length", "gas_index"),
)
PLATEN_BASE = (
    *("mass_x", "mass_y", "mass_z", "inertia_x", "inertia_y", "inertia_z", "cog_x", "cog_y", "cog_z", "plane"),
    *("gravity", "supply", "back_pressure", "rated", "bulk"),
)
LEG = np.dtype([("kind", "i8"), *((name, "f8") for name in (*POSITIONS, "length", *BASE_FIELDS, *LEG_FIELDS))])
PLATEN = np.dtype([(name, "f8") for name in (*PLATEN_BASE, *PLATEN_FIELDS)])


def load_model(path: Path) -> dict[str, dict]:
    """Tables of `models/lhpost6.toml` by name ("platen", "kind.horizontal", "component.H1"), entries as they stand."""
    with path.open("rb") as file:
        raw = tomllib.load(file)
    flat = {"platen": raw["platen"], "hydraulics": raw["hydraulics"]}
    for group in ("kind", "component"):
        flat |= {f"{group}.{name}": table for name, table in raw[group].items()}
    return flat


def nominal_values(model: dict[str, dict]) -> dict[str, dict]:
    """The values alone, lists as arrays: what `make_table` takes."""

    def plain(entry: object) -> object:
        value = entry["value"] if isinstance(entry, dict) else entry
        return np.array(value, dtype=float) if isinstance(value, list) else value

    return {name: {key: plain(entry) for key, entry in table.items()} for name, table in model.items()}


def make_table(values: dict[str, dict[str, np.ndarray]], yield_factor: float) -> tuple[np.ndarray, np.ndarray]:
    """Records of the thirteen legs and of the platen (one row) from values by table and key, nothing hidden."""
    legs, platen = np.zeros(13, dtype=LEG), np.zeros(1, dtype=PLATEN)
    body, oil = values["platen"], values["hydraulics"]
    for name, stem in (("mass", "mass"), ("inertia", "inertia"), ("centre_of_gravity", "cog")):
        for axis, value in zip("xyz", body[name], strict=True):
            platen[f"{stem}_{axis}"] = value
    platen["plane"], platen["gravity"] = body["bearing_plane"][2], body["gravity"]
    platen["supply"], platen["back_pressure"] = oil["supply_pressure"], oil["return_pressure"]
    platen["rated"], platen["bulk"] = oil["rated_pressure"], oil["bulk_modulus"]
    for i, name in enumerate(LEGS):
        leg, own = legs[i], values[f"component.{name}"]
        kind = values[f"kind.{own['kind']}"]
        leg["kind"] = KINDS.index(own["kind"])
        leg["px"], leg["py"], leg["pz"] = own["platen_point"]
        leg["ax"], leg["ay"], leg["az"] = own["base_point"]
        for key in BASE_FIELDS:
            leg[key] = kind.get({"seal": "seal_friction", "pad": "pad_friction"}.get(key, key), 0.0)
        leg["seal_exponent"] = values.get("friction", {}).get("exponent", 1.0)
        leg["seal_yield"] *= yield_factor
        leg["pad_yield"] *= yield_factor
        if leg["kind"] == 2:
            leg["gas_area"], leg["gas_pressure"] = kind["area"], kind["pressure"]
            leg["gas_length"], leg["gas_index"] = kind["gas_length"], kind["polytropic_index"]
            leg["viscous"] = 0.0
    legs["length"] = 0.0
    legs["length"] = lengths(np.zeros(6), legs, platen)
    return legs, platen


def mass_matrix(platen: np.ndarray) -> np.ndarray:
    """Inertia on body axes about B, linear first (6x6), with a point mass and products of inertia added."""
    body = platen[0]
    matrix = np.diag([body[f"{stem}_{axis}"] for stem in ("mass", "inertia") for axis in "xyz"])
    for i, j, name in ((0, 1, "product_xy"), (0, 2, "product_xz"), (1, 2, "product_yz")):
        matrix[3 + i, 3 + j] -= body[name]
        matrix[3 + j, 3 + i] -= body[name]
    x, y, z = (body[f"added_{axis}"] - body[f"cog_{axis}"] for axis in "xyz")
    arm = np.hstack([np.eye(3), -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])])
    return matrix + body["added_mass"] * arm.T @ arm


@njit(cache=True)
def rotation(pose):
    """R = Rz(yaw) Ry(pitch) Rx(roll), body to space."""
    ca, sa, cb, sb = math.cos(pose[3]), math.sin(pose[3]), math.cos(pose[4]), math.sin(pose[4])
    cg, sg = math.cos(pose[5]), math.sin(pose[5])
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa
    R[1, 0], R[1, 1], R[1, 2] = sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa
    R[2, 0], R[2, 1], R[2, 2] = -sb, cb * sa, cb * ca
    return R


@njit(cache=True)
def turned(R, x, y, z):
    """A body vector on axes of space."""
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@njit(cache=True)
def leg_line(leg, pose, R, plane):
    """Length of a leg, its direction and the arm from C to where it touches the platen, on axes of space."""
    if leg.kind == 1:  # the cylinder stays upright under the platen's sliding plane
        nx, ny, nz = turned(R, 0.0, 0.0, 1.0)
        reach = (pose[0] - leg.ax) * nx + (pose[1] - leg.ay) * ny + (pose[2] - leg.az) * nz + plane
        length = reach / nz
        return length, 0.0, 0.0, 1.0, leg.ax - pose[0], leg.ay - pose[1], leg.az + length - pose[2]
    x, y, z = turned(R, leg.px, leg.py, leg.pz)
    dx, dy, dz = pose[0] + x - leg.ax, pose[1] + y - leg.ay, pose[2] + z - leg.az
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    return length, dx / length, dy / length, dz / length, x, y, z


@njit(cache=True)
def lengths(pose, legs, platen):
    """Extension of all legs in a pose against the control zero-position (13)."""
    R = rotation(pose)
    out = np.empty(13)
    for i in range(13):
        out[i] = leg_line(legs[i], pose, R, platen[0].plane)[0] - legs[i].length
    return out


@njit(cache=True)
def root(drop):
    """Signed square root of a pressure drop, straight within some 100 Pa of zero [Pa^0.5]."""
    return drop / (drop * drop + 1e4) ** 0.25


@njit(cache=True)
def valve(leg, x, pa, pb, supply, back, rated):
    """Flows into A and B through the spool's edges, and what was taken from the supply and given back [m3/s]."""
    x = spool_at_ports(leg, x)
    most = leg.flow / math.sqrt(rated)
    gain = most * opening(leg, x)
    four_way = leg.kind == 0
    ratio = leg.area_b / leg.area_a if four_way else 1.0
    w1 = math.sqrt(ratio)
    b = 0.0
    if x > 0.0:
        a = gain * w1 * root(supply - pa)
        taken, given = a, 0.0
        if four_way:
            b = -gain * w1 * ratio * root(pb - back)
            given = -b
    else:
        a = -gain * root(pa - back)
        taken, given = 0.0, -a
        if four_way:
            b = gain * ratio * root(supply - pb)
            taken = b
    if leg.underlap != 0.0:
        seep = most * leg.underlap / (1.0 + (x / leg.underlap_width) ** 2)
        a += seep * (root(supply - pa) - root(pa - back))
        if four_way:
            b += seep * (root(supply - pb) - root(pb - back))
    return a, b, taken, given


@njit(cache=True)
def bristle(z, v, span, exponent):
    """Dahl's friction: a bristle bends with the motion and slips at one [1/s]."""
    return v / span * max(1.0 - math.copysign(z, v * z), 0.0) ** exponent

"""A complete machine from the few numbers that a laboratory knows of its table.

What is stated is `measured`; what follows from it is `derived`; the rest is `assumed`: of a typical size in
proportion to the machine (`models/templates/new_machine.toml`), with a standard deviation that spans what is common.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...core.errors import ParameterError
from ...core.files import models_folder
from ...laws.orifice import opening
from ..machine import Machine, build_machine
from ..parameters import Parameters, load_parameters
from ..quantity import Quantity, Value
from ..structure import MOTIONS
from .asked import refuse_alternatives
from .cylinder import CYLINDERS, cylinder_areas, cylinder_numbers
from .legs import Leg, guided_legs, largest_travel, leg_rows, plan_distance, platform_legs
from .typical import Basis, first, vector

__all__ = ["draft_machine"]

KIND = "drive"
"""Name of the actuators' kind in the file."""

_PLACES = ("platen_radius", "base_radius", "platen_spread", "base_spread", "length")


def draft_machine(
    name: str, known: Mapping[str, Quantity], *, motion: str = "x", cylinder: str = "double-rod", title: str = ""
) -> Machine:
    """Machine from quantities by the names of `asked.ASKED` (`slope`, `voltage`), as `asked.read_answers` reads them.

    motion: the guided axes, or "free" for a platform on six legs. Raises ParameterError for what makes no machine, and
    for two numbers that determine the same quantity.
    """
    for word, given, valid in (("--motion", motion, MOTIONS), ("--cylinder", cylinder, CYLINDERS)):
        if given not in valid:
            raise ParameterError(f"{word} {given!r} is not one of {', '.join(valid)}")
    refuse_alternatives({"speed" if key == "slope" else key for key in known})
    basis = Basis(known, load_parameters(models_folder() / "templates" / "new_machine.toml"))
    platen = _platen(basis, motion)
    oil = _oil(basis)
    areas = cylinder_areas(basis, cylinder)
    area_a, area_b = first(areas[0].value), first(areas[1].value)
    high, low = first(oil["supply_pressure"].value), first(oil["return_pressure"].value)
    if low >= high:
        assumed = "" if "return_pressure" in known else ", assumed"
        raise ParameterError(
            f"--supply-pressure is {high:g} Pa, not above the return pressure of {low:g} Pa{assumed}; correct its "
            "unit, or give --return-pressure"
        )
    drive = cylinder_numbers(basis, areas, area_a * (high - low), motion != "free")
    valve, speed = _valve(basis, (area_a, area_b), (high, low))
    legs = _legs(basis, motion, vector(platen["size"]), -vector(platen["bearing_plane"])[2])
    limits = _limits(basis, legs, motion, platen, speed, (area_a * (high - low), area_b * (high - low)))
    if "slope" in known:
        slope, fast = basis.number("slope"), limits["velocity"]
        why = f"{fast.source}; by the assumed flow curve {speed / slope:.3g} of the {slope:.4g} m/s of a straight one"
        limits["velocity"] = replace(fast, source=why)
    sections = {"platen": platen, "hydraulics": oil, KIND: {**drive, **valve}, **_ends(basis, legs), "limits": limits}
    numbers = {
        f"{section}.{key}": replace(q, value=_rounded(q.value), sd=None if q.sd is None else _rounded(q.sd))
        for section, quantities in sections.items()
        for key, q in quantities.items()
    }
    table = "Platform on six legs" if motion == "free" else f"Shake table on guides along {' and '.join(motion)}"
    words: dict[str, str | int] = {
        "machine.name": name,
        "machine.title": title or f"{table}, {cylinder} cylinders",
        "machine.motion": motion,
        "machine.thrust": "report",
        "machine.controller": "cautious",
        **{f"{KIND}.{key}": word for key, word in (("role", "actuator"), ("mount", "swivel"), ("valve", "4-way"))},
        f"{KIND}.valves": 1,
        **{f"{leg.name}.kind": KIND for leg in legs},
    }
    return build_machine(Parameters(numbers, words, name))


# --------------------------------------------------------------------------------------------- sections
def _platen(basis: Basis, motion: str) -> dict[str, Quantity]:
    """Mass, inertia, places and size."""
    stated = basis.with_sd(basis.known["mass"], basis.rule("stated.mass"))
    masses, sds = _by_axis(stated.value, motion), _by_axis(stated.sd, motion)
    size = basis.known.get("size") or _size(basis, max(masses))
    x, y = vector(size)
    rule = basis.typical["platen.depth"]
    depth = basis.rule("platen.depth") * 0.5 * (x + y)
    why = f"{basis.rule('platen.depth'):g} of the mean side deep; {rule.source}"
    inertia = basis.known.get("inertia")
    if inertia is None:
        squares = (y**2 + depth**2, x**2 + depth**2, x**2 + y**2)
        moments = tuple(m * square / 12.0 for m, square in zip(masses, squares, strict=True))
        source = basis.typical["platen.inertia"].source + ("" if motion == "free" else "; no part in a guided motion")
        inertia = basis.with_sd(Quantity(moments, "kg m2", "derived", source), basis.spread("platen.inertia"))
    return {
        "mass": Quantity(masses, "kg", stated.evidence, stated.source, sds),
        "inertia": basis.with_sd(inertia, basis.rule("stated.inertia")),
        "centre_of_gravity": Quantity((0.0, 0.0, -0.5 * depth), "m", "assumed", f"half the depth; {why}", depth / 4.0),
        "bearing_plane": Quantity((0.0, 0.0, -depth), "m", "assumed", f"underside; {why}"),
        "size": size,
        "gravity": basis.typical["platen.gravity"],
    }


def _oil(basis: Basis) -> dict[str, Quantity]:
    """Supply and oil."""
    drop = basis.known_or("rated_drop", "valve.rated_drop")
    why = f"half of {first(drop.value) / 1e6:g} MPa, across one path of the valve; {drop.source}"
    evidence = "derived" if "rated_drop" in basis.known else "assumed"
    return {
        "supply_pressure": basis.known["supply_pressure"],
        "return_pressure": basis.known_or("return_pressure", "oil.return_pressure"),
        "rated_pressure": Quantity(0.5 * first(drop.value), "Pa", evidence, why),
        "bulk_modulus": basis.with_sd(basis.known_or("bulk_modulus", "oil.bulk_modulus"), 0.0),
        "root_regularisation": basis.typical["oil.root_regularisation"],
    }


def _valve(
    basis: Basis, areas: tuple[float, float], pressures: tuple[float, float]
) -> tuple[dict[str, Quantity], float]:
    """Flow at rated pressure, its curve, leak and delay; and the piston's speed [m/s] without load at full opening.

    Extending without load, both orifices alike, it is k / A_1 sqrt(r (P_S - r P_R) / (1 + r)) times the opening, with
    r = A_2 / A_1 and k = q / sqrt(P_rated) (Eqs. 4-1 to 4-5).
    """
    curve, (high, low) = basis.rule("valve.flow_curve"), pressures
    ratio = areas[1] / areas[0]
    rated = 0.5 * first(basis.known_or("rated_drop", "valve.rated_drop").value)
    speed_per_flow = math.sqrt(ratio * (high - ratio * low) / (1.0 + ratio) / rated) / areas[0]
    full = float(opening(1.0, curve))
    if "rated_flow" in basis.known:
        stated = basis.with_sd(basis.known["rated_flow"], basis.rule("stated.rated_flow"))
        factor, how = 1.0 / full, "over the flow curve at full opening"
    else:
        name = "slope" if "slope" in basis.known else "speed"
        stated = basis.known.get(name) or basis.typical["valve.speed"]
        stated = basis.with_sd(stated, basis.rule("stated.speed"))
        factor = 1.0 / speed_per_flow / (curve if name == "slope" else full)
        how = "speed without load times area, at rated pressure, over the flow curve"
    flow, bent = first(stated.value) * factor, basis.typical["valve.flow_curve"]
    # the slope at null is flow times curve: an uncertain curve leaves the flow as uncertain
    sd = math.hypot(first(stated.sd) * factor, flow * first(bent.sd) / first(bent.value))
    speed = flow * full * speed_per_flow
    evidence = "derived" if stated.evidence == "measured" else "assumed"
    found = {
        "flow": Quantity(flow, "m3/s", evidence, f"{how}; {stated.source}; with the deviation of the curve", sd),
        "flow_curve": basis.typical["valve.flow_curve"],
        "leakage": basis.assumed(
            "cylinder.leakage", "m3/s/Pa", areas[0] * speed / high, "full flow over supply pressure"
        ),
        "valve_delay": basis.known_or("valve_delay", "valve.delay"),
        **({"full_command": basis.known["voltage"]} if "voltage" in basis.known else {}),
    }
    return found, speed


def _legs(basis: Basis, motion: str, size: tuple[float, ...], depth: float) -> list[Leg]:
    length = first(basis.known_or("length", "cylinder.length", basis.number("stroke"), "the half stroke").value)
    if motion != "free":
        return guided_legs(motion, (size[0], size[1]), depth, length)
    under = first(basis.known_or("platen_radius", "platform.platen_radius", min(size), "the smaller side").value)
    base = first(basis.known_or("base_radius", "platform.base_radius", under, "the radius under the platen").value)
    above, below = (first(basis.known_or(name, f"platform.{name}").value) for name in _PLACES[2:4])
    radii, spreads = (under, base), (above, below)
    if "length" not in basis.known:  # typical of the stroke, but the legs must reach
        length = max(length, basis.rule("platform.leg_length") * plan_distance(radii, spreads))
    return platform_legs(radii, spreads, depth, length)


def _ends(basis: Basis, legs: Sequence[Leg]) -> dict[str, dict[str, Quantity]]:
    """Ends of the actuators, by component."""
    names = _PLACES if len(legs) == 6 else _PLACES[-1:]
    where = "legs in pairs" if len(legs) == 6 else "along its axis, from the edge of the platen"
    groups = {
        "as stated": [n for n in names if n in basis.known],
        "typical": [n for n in names if n not in basis.known],
    }
    choices = [f"{how}: {', '.join(chosen)}".replace("_", " ") for how, chosen in groups.items() if chosen]
    evidence = "derived" if groups["as stated"] else "assumed"
    rest = evidence, "; ".join([where, *choices]), basis.rule("stated.leg_point")
    return {
        leg.name: {
            "platen_point": Quantity(tuple(leg.platen_point.tolist()), "m", *rest),
            "base_point": Quantity(tuple(leg.base_point.tolist()), "m", *rest),
        }
        for leg in legs
    }


def _limits(
    basis: Basis,
    legs: Sequence[Leg],
    motion: str,
    platen: Mapping[str, Quantity],
    speed: float,
    forces: tuple[float, float],
) -> dict[str, Quantity]:
    """What stroke, speed [m/s] and forces [N] (pushing, pulling) of the actuators give along each free axis alone.

    Raises ParameterError if they do not carry the weight.
    """
    levers, free = np.abs(leg_rows(legs)), motion == "free"
    axes = range(6) if free else ["xyz".index(axis) for axis in motion]
    stroke = basis.number("stroke")
    inertia = [*vector(platen["mass"]), *vector(platen["inertia"])]
    travel = basis.rule("limits.travel") if free else 1.0
    share = basis.rule("limits.force")
    moved, fast, strong = np.zeros((3, 6))
    for k in axes:
        moved[k] = travel * largest_travel(legs, stroke, [k] if free else axes)
        fast[k] = speed / levers[:, k].max()
        weight = inertia[2] * basis.rule("platen.gravity") if k == 2 else 0.0
        push, pull = (share * force * levers[:, k].sum() for force in forces)
        usable = push if k == 2 else min(push, pull)
        if usable <= weight:
            raise ParameterError(
                f"--mass: {weight / 1e3:.4g} kN to be carried, and {share:g} of the actuators' force is "
                f"{usable / 1e3:.4g} kN; check --mass, --area and --supply-pressure"
            )
        strong[k] = min(usable - weight, pull + weight) / inertia[k]  # the weight helps downwards
    admitted = f"{f'{travel:g} of what ' if free else ''}the actuators' stroke admits"
    if not free and len(axes) > 1:
        admitted += ", all axes at their ends at once"
    reasons = {
        "displacement": (moved, "m | rad", admitted),
        "velocity": (fast, "m/s | rad/s", "speed of the actuators without load, over their lever"),
        "acceleration": (
            strong,
            "m/s2 | rad/s2",
            f"{share:g} of the actuators' force, less the weight upwards, over the inertia",
        ),
    }
    found = {
        key: Quantity(tuple(map(_floor, values)), unit, "derived", source)
        for key, (values, unit, source) in reasons.items()
    }
    usual = ("bandwidth", "valve_reserve", "stroke_reserve")
    return {**found, **{key: basis.typical[f"limits.{key}"] for key in usual}}


# --------------------------------------------------------------------------------------------- numbers
def _size(basis: Basis, mass: float) -> Quantity:
    """A square of the usual mass by area."""
    rule = basis.typical["platen.mass_of_area"]
    side = float(f"{math.sqrt(mass / basis.rule('platen.mass_of_area')):.2g}")
    return Quantity(
        (side, side), "m", "assumed", f"square of {basis.rule('platen.mass_of_area'):g} kg/m2; {rule.source}"
    )


def _by_axis(value: Value | None, motion: str) -> tuple[float, float, float]:
    """Mass along x, y and z: one for all, or one for each free axis; the largest on the others."""
    given = [0.0] if value is None else list(value) if isinstance(value, tuple) else [value]
    axes = "xyz" if motion == "free" else motion
    if len(given) not in (1, len(axes)):
        raise ParameterError(f"--mass: {len(given)} numbers for the axes {axes}; give one, or {len(axes)}")
    along = dict(zip(axes, given * (len(axes) // len(given)), strict=True))
    x, y, z = (along.get(axis, max(given)) for axis in "xyz")
    return x, y, z


def _rounded(value: Value) -> Value:
    """To six digits."""
    return tuple(float(f"{v:.6g}") for v in value) if isinstance(value, tuple) else float(f"{value:.6g}")


def _floor(value: float) -> float:
    """To three digits, never above: a limit is not to be exceeded."""
    if value <= 0.0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.floor(value / unit + 1e-6) * unit

"""The cylinder of a drafted machine: areas, chambers, seals."""

import math
from dataclasses import replace

from ...core.errors import ParameterError
from ..quantity import Quantity
from .typical import Basis, first, vector

__all__ = ["CYLINDERS", "cylinder_areas", "cylinder_numbers"]

CYLINDERS = ("double-rod", "single-rod")


def cylinder_areas(basis: Basis, cylinder: str) -> tuple[Quantity, Quantity]:
    """Piston areas of chambers A and B, from area or bore, and rod; raises ParameterError for what cannot be."""
    known, double = basis.known, cylinder == "double-rod"
    rod = math.pi / 4.0 * basis.number("rod") ** 2 if "rod" in known else None
    if "area" in known:
        area = known["area"]
    else:
        bore = math.pi / 4.0 * basis.number("bore") ** 2
        if double and rod is None:
            raise ParameterError("--rod is missing: a double-rod cylinder's area is that of the bore less the rod's")
        if rod is not None and rod >= bore:
            raise ParameterError("--rod: the rod is not thinner than --bore")
        stated = "; ".join(known[key].source for key in ("bore", "rod") if key in known and (double or key == "bore"))
        how = "section of the bore less the rod's" if double else "section of the bore"
        area = Quantity(bore - (rod or 0.0) if double else bore, "m2", "derived", f"{how}; {stated}")
    if double:
        return area, replace(area, evidence="derived", source=f"double-rod cylinder: as area A; {area.source}")
    if rod is None:
        rule, value = basis.typical["cylinder.rod_share"], first(area.value)
        share, sd = basis.rule("cylinder.rod_share"), value * first(rule.sd)
        why = f"area A less the rod's, {share:g} of it; {rule.source}"
        return area, Quantity(value * (1.0 - share), "m2", "assumed", why, sd)
    if rod >= first(area.value):
        raise ParameterError("--rod: the rod's section is not smaller than the piston's area")
    return area, Quantity(first(area.value) - rod, "m2", "derived", f"area A less the rod's; {known['rod'].source}")


def cylinder_numbers(basis: Basis, areas: tuple[Quantity, Quantity], force: float, guided: bool) -> dict[str, Quantity]:
    """Numbers of an actuator's kind but for its valve; force [N] is its rated force, guided a platen on guides."""
    rated = f"the rated force, {force / 1e3:.4g} kN"
    chamber = basis.assumed("cylinder.chamber", "m", basis.number("stroke"), "the half stroke")
    friction = basis.known.get("friction") or _friction(basis, force, rated, guided)
    none = Quantity(0.0, "kg", "derived", "part of the platen's mass, as stated")
    return {
        "area_a": areas[0],
        "area_b": areas[1],
        "chamber_a": chamber,
        "chamber_b": chamber,
        "stroke": basis.known["stroke"],
        "seal_friction": basis.with_sd(friction, basis.spread("cylinder.friction")),
        "seal_yield": basis.with_sd(
            basis.known_or("presliding", "cylinder.seal_yield"), basis.spread("cylinder.seal_yield")
        ),
        "seal_shape": basis.typical["cylinder.seal_shape"],
        "viscous": basis.assumed("cylinder.viscous", "N s/m", force, rated),
        "mass_along": none,
        "mass_across": none,
        "load_cell_share": basis.typical["cylinder.load_cell_share"],
    }


def _friction(basis: Basis, force: float, rated: str, guided: bool) -> Quantity:
    """Friction of seals, and of the guides that carry the weight."""
    seals = basis.assumed("cylinder.friction", "N", force, rated)
    if not guided:
        return seals
    rule = basis.rule("cylinder.guide_friction")
    weight = max(vector(basis.known["mass"])) * basis.rule("platen.gravity")
    why = f"guides: {rule:g} of the weight, {basis.typical['cylinder.guide_friction'].source}"
    more = Quantity(rule * weight, "N", "assumed", why, rule * weight)
    source = f"seals: {seals.source}; {more.source}"
    return Quantity(first(seals.value) + rule * weight, "N", "assumed", source, first(seals.sd) + first(more.sd))

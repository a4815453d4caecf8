"""Tables drawn anew: the nominal table with other sizes, and what its lab knows of it.

Mass, lengths in plan, piston areas, valves, chambers, oil and friction are those of the LHPOST6 times factors drawn
between the bounds of `numbers.toml`, [anew]; deviations that are stated as shares stay so. The loop's gains follow the
frequencies of the oil columns.
"""

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np

__all__ = ["changed_values", "draw_anew", "loop_of"]

Model = dict[str, dict[str, Any]]
"""Tables by name ("platen", "kind.horizontal", "component.H1"), entries as in `models/lhpost6.toml`."""

HORIZONTAL, VERTICAL = "kind.horizontal", "kind.vertical"
FRICTION = ("seal_friction", "pad_friction", "viscous", "leakage")
UPRIGHT = slice(2, 5)
"""Axes that the vertical actuators drive: z, roll, pitch."""


def draw_anew(model: Model, rule: Mapping[str, list[float]], random: np.random.Generator) -> Model:
    """A table like `model`, other in size; `rule` gives the bounds of each factor."""
    drawn = {name: float(np.exp(random.uniform(*np.log(span)))) for name, span in rule.items()}
    new = copy.deepcopy(model)

    def scale(table: str, key: str, factor: float | list[float]) -> None:
        if key in new[table]:
            value = np.array(new[table][key]["value"], dtype=float) * factor
            new[table][key]["value"] = value.tolist()

    scale("platen", "mass", drawn["mass"])
    scale("platen", "inertia", drawn["mass"] * drawn["size"] ** 2)
    scale("platen", "size", drawn["size"])
    scale("hydraulics", "bulk_modulus", drawn["bulk"])
    for kind, table in (("horizontal", HORIZONTAL), ("vertical", VERTICAL)):
        area = drawn[f"{kind}_area"] * (drawn["mass"] if kind == "vertical" else 1.0)
        for key, factor in (("area_a", area), ("area_b", area), ("flow", area * drawn[f"{kind}_speed"])):
            scale(table, key, factor)
        for key in ("chamber_a", "chamber_b"):
            scale(table, key, drawn[f"{kind}_chamber"])
        for key in FRICTION:
            scale(table, key, float(np.exp(random.uniform(*np.log(rule["friction"])))))
    for table in (name for name in new if name.startswith("component.")):
        for key in ("platen_point", "base_point"):
            scale(table, key, [drawn["size"], drawn["size"], 1.0])
    return new


def loop_of(model: Model, nominal: Model, loop: Mapping[str, Any]) -> dict[str, Any]:
    """The battery's controller for a table, from its settings for the nominal one.

    Frequencies go with those of the oil columns, sqrt(bulk area / (chamber mass)); so do the gains that these bound.
    """
    factor = np.ones(6)
    for axes, kind in ((slice(None), HORIZONTAL), (UPRIGHT, VERTICAL)):
        stiffness = [
            m["hydraulics"]["bulk_modulus"]["value"] * m[kind]["area_a"]["value"] / m[kind]["chamber_a"]["value"]
            for m in (model, nominal)
        ]
        mass = [m["platen"]["mass"]["value"][0] for m in (model, nominal)]
        factor[axes] = np.sqrt(stiffness[0] / stiffness[1] * mass[1] / mass[0])
    slower = np.minimum(factor, 1.0)
    scaled = {
        "oil_frequency": factor,
        "proportional": slower,
        "low_pass": slower,
        "damping": 1.0 / np.maximum(factor, 1.0),
    }
    return {**loop, **{name: (np.array(loop[name]) * by).tolist() for name, by in scaled.items()}}


def changed_values(model: Model, nominal: Model) -> dict[str, Any]:
    """Values that differ from the nominal table's, by path of a machine file."""
    return {
        f"{table.split('.')[-1]}.{key}": entry["value"]
        for table, entries in model.items()
        for key, entry in entries.items()
        if isinstance(entry, dict) and entry["value"] != nominal[table][key]["value"]
    }

"""A first channel map from the columns' names, such as `Long Displ ref` or `H1 Press A`: to be read and edited."""

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from ...core.errors import RecordError
from ...core.names import AXES
from ...core.units import quantity_unit
from ..channels import channel_unit
from .channel_map import ChannelMap, Source, TestFacts, channels_of
from .channel_units import without_unit
from .raw import RawTest, shown

__all__ = ["Guess", "guess_map", "is_export"]

Labels = Mapping[str, Sequence[str]]

_AXIS_WORDS = {
    "x": ("x", "long", "longitudinal", "lon"),
    "y": ("y", "lat", "lateral", "trans", "transverse", "tran"),
    "z": ("z", "vert", "vertical"),
    "roll": ("roll", "rx"),
    "pitch": ("pitch", "ry"),
    "yaw": ("yaw", "rz"),
}
_QUANTITY_WORDS = {
    "displacement": ("displ", "disp", "displacement", "position", "pos", "stroke", "lvdt", "length", "d"),
    "velocity": ("vel", "velocity", "v"),
    "acceleration": ("accel", "acc", "acceleration", "a"),
    "pressure": ("press", "pressure", "pres", "prs", "p", "pa", "pb"),
    "force": ("force", "load", "cell", "loadcell"),
    "spool": ("spool", "valve", "servovalve"),
}
_BY_UNIT = {
    "m": "displacement",
    "rad": "displacement",
    "m/s": "velocity",
    "rad/s": "velocity",
    "m/s2": "acceleration",
    "rad/s2": "acceleration",
    "Pa": "pressure",
    "N": "force",
}
_ROLES = {
    "wanted": ("ref", "reference", "cmd", "command", "target", "desired"),
    "other": ("err", "error", "delta", "diff", "dp", "dof"),
}
_SUPPLY = ("supply", "hps", "hsm", "system", "accumulator")
_FAMILIES = {"x": "H", "z": "V", "strut": "S", "holddown": "S", "down": "S", "actuator": "", "act": ""}
"""Words before a number that name a component otherwise: X1 is H1, Z3 is V3, strut 2 is S2."""


class Guess(NamedTuple):
    """A first map, and a remark on each column and channel that is not in it."""

    channels: ChannelMap
    remarks: tuple[str, ...]


def is_export(raws: Sequence[RawTest]) -> bool:
    """Whether the files were written by `export_record` or are records, whose columns are named by channel."""
    return all("layout_version" in raw.facts for raw in raws)


def guess_map(raws: Sequence[RawTest], labels: Labels) -> Guess:
    """Make the map that the columns' names suggest, the first column for each channel.

    Raises RecordError if not a single column is recognised.
    """
    known = channels_of(labels)
    found: dict[str, Source] = {}
    remarks: list[str] = []
    for raw, name, number in ((r, n, k) for r in raws for k, n in enumerate(r.names, 1)):
        unit = raw.units[number - 1]
        channel = _channel(name, unit, labels, known)
        where = f"{raw.source}: {name!r} in {unit or 'an unknown unit'}"
        if channel is None:
            remarks.append(f"not recognised: column {number} of {where}")
        elif channel in found:
            remarks.append(f"also like {channel}: column {number} of {where}")
        else:
            found[channel] = _source(raws, raw, name, number, unit)
            if unit is None:
                remarks.append(f"add the unit of {channel}: column {number} of {where}")
    if not found:
        columns = shown([name for raw in raws for name in raw.names], 20)
        raise RecordError(f"{raws[0].source}: no column's name is recognised among {columns}; write the map by hand")
    partly = {known[name][0] for name in found}
    for name, (variable, _) in known.items():
        if variable in partly and name not in found:
            unit = channel_unit(name)
            remarks.append(f'not found: "{name}" = {{ constant = 0.0, unit = "{unit}" }}  # if it is known to be zero')
    facts = {key: value for raw in reversed(raws) for key, value in raw.facts.items()}
    ordered = {name: found[name] for name in known if name in found}
    return Guess(ChannelMap("guessed map", _test(facts), ordered), tuple(remarks))


def _source(raws: Sequence[RawTest], raw: RawTest, name: str, number: int, unit: str | None) -> Source:
    alone = sum(other.names.count(name) for other in raws) == 1
    if alone:
        return Source(column=name, unit=unit)
    file = None if len(raws) == 1 else re.split(r"[\\/]", raw.source)[-1]
    return Source(column=name if raw.names.count(name) == 1 else number, unit=unit, file=file)


def _test(facts: Mapping[str, str]) -> TestFacts:
    valves = facts.get("valves_per_horizontal_actuator", "1")
    kind = facts.get("kind", "measured")
    return TestFacts(
        name=facts.get("test"),
        kind=kind if kind in ("measured", "simulated") else "measured",
        valves_per_horizontal_actuator=int(valves) if valves in ("1", "2") else 1,
        specimen=facts.get("specimen", "none"),
    )


# --------------------------------------------------------------------------------------------- names
def _channel(name: str, unit: str | None, labels: Labels, known: Mapping[str, tuple[str, str | None]]) -> str | None:
    """Channel of a column by its name; None if there is none, or its unit does not fit."""
    plain = without_unit(name)
    own = next((c for c, (v, label) in known.items() if plain in (c, v if label is None else f"{v}_{label}")), None)
    if own:
        return own
    words = _words(plain)
    quantity = _quantity(words, unit)
    if quantity is None or set(words) & set(_ROLES["other"]):
        return None
    wanted = bool(set(words) & set(_ROLES["wanted"]))
    component = _component(words, labels)
    if component:
        channel = _of_component(quantity, component, words, wanted, labels)
    elif quantity == "pressure" and set(words) & set(_SUPPLY):
        channel = "supply_pressure"
    else:
        axis = next((axis for axis in AXES if set(words) & set(_AXIS_WORDS[axis])), None)
        variable = "reference_displacement" if wanted else f"platen_{quantity}"
        channel = f"{variable}[{axis}]" if axis and not (wanted and quantity != "displacement") else None
    if channel is None or channel not in known:
        return None
    si = quantity_unit(unit)
    return channel if si in (None, channel_unit(channel)) else None


def _words(name: str) -> list[str]:
    """Lower-case words of a name: `AccelX`, `accel_x` and `Ax` are acceleration and x."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    words = [word.lower() for word in re.findall(r"[^\W_]+", spaced)]
    parts = []
    for word in words:
        match = re.fullmatch(r"(displ?|vel|acc(?:el)?|[dva])([xyz]|rx|ry|rz)", word)
        parts += list(match.groups()) if match else [word]
    return parts


def _quantity(words: Sequence[str], unit: str | None) -> str | None:
    """Quantity by a word of the name, else by the unit; single letters count only beside an axis or a chamber."""
    for quantity, known in _QUANTITY_WORDS.items():
        if any(len(word) > 1 and word in known for word in words):
            return quantity
    si = quantity_unit(unit)
    if si in _BY_UNIT:
        return _BY_UNIT[si]
    return next((q for q, known in _QUANTITY_WORDS.items() if words and words[0] in known), None)


def _component(words: Sequence[str], labels: Labels) -> str | None:
    every = {label.lower(): label for dim in ("actuator", "strut") for label in labels.get(dim, ())}
    joined = [*words, *(a + b for a, b in pairwise(words) if b[-1].isdigit())]
    for word in joined:
        if word in every:
            return every[word]
        match = re.fullmatch(r"([a-z]+)(\d+)", word)
        if match and match[1] in _FAMILIES:
            other = f"{_FAMILIES[match[1]]}{match[2]}".lower()
            if other in every:
                return every[other]
    return None


def _of_component(quantity: str, component: str, words: Sequence[str], wanted: bool, labels: Labels) -> str | None:
    if component in labels.get("strut", ()):
        return f"strut_pressure[{component}]" if quantity == "pressure" else None
    if quantity == "spool":
        return f"spool_{'command' if wanted else 'position'}[{component}]"
    if wanted:
        return None
    if quantity == "pressure":
        chambers = [c for c in "ab" if set(words) & {c, f"p{c}"}]
        single = component not in labels.get("horizontal", ())
        chamber = chambers[0] if len(chambers) == 1 else "a" if single and not chambers else None
        return f"chamber_pressure_{chamber}[{component}]" if chamber else None
    return f"actuator_{quantity}[{component}]"

"""Words of column names, as labs write them: axes, quantities, roles, floors; and what words stand for."""

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise

from ...core.names import AXES
from ...core.units import quantity_unit

__all__ = ["Labels", "axis_in", "chamber_in", "component_in", "floor_in", "is_unlike", "is_wanted", "quantity_in"]
__all__ += ["SUPPLY", "words_of"]

Labels = Mapping[str, Sequence[str]]

_AXIS_WORDS = {
    "x": ("x", "long", "longitudinal", "lon", "ew"),
    "y": ("y", "lat", "lateral", "trans", "transverse", "tran", "ns"),
    "z": ("z", "vert", "vertical", "ud"),
    "roll": ("roll", "rx"),
    "pitch": ("pitch", "ry"),
    "yaw": ("yaw", "rz"),
}
_QUANTITY_WORDS = {
    "valve_command": ("voltage", "volt", "volts", "servocommand", "valvecmd", "valvecommand", "servovoltage"),
    "displacement": ("displ", "disp", "dis", "displacement", "position", "pos", "stroke", "lvdt", "length", "d"),
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
_DIFFERENCE = ("dp", "deltap", "dpress", "pl")
_DIFFERENT = ("delta", "diff", "differential", "difference", "load")
"""Words that make a pressure the difference across a piston."""
_WANTED = ("ref", "reference", "cmd", "command", "target", "desired", "demand", "setpoint", "soll")
_OTHER = ("err", "error", "delta", "diff", "dp", "dof")
_FLOOR = re.compile(r"(?P<number>\d{1,2})(?:f|fl|flr|st|nd|rd|th)|f(?:l|lr)?(?P<after>\d{1,2})|(?P<roof>rf|roof)")
_FLOOR_NAMES = ("floor", "fl", "story", "storey", "level")
_FAMILIES = {"x": "H", "z": "V", "strut": "S", "holddown": "S", "down": "S", "actuator": "", "act": ""}
"""Words before a number that name a component otherwise: X1 is H1, Z3 is V3, strut 2 is S2."""
SUPPLY = frozenset(("supply", "hps", "hsm", "system", "accumulator"))
"""Words of the supply pressure."""


def words_of(name: str) -> list[str]:
    """Lower-case words of a name: `AccelX`, `accel_x` and `Ax` are acceleration and x; `PosT` is pos and t."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.replace("Δ", "delta ").replace("∆", "delta "))
    parts = []
    for word in (word.lower() for word in re.findall(r"[^\W_]+", spaced)):
        match = re.fullmatch(r"(displ?|dis|vel|acc(?:el)?|[dva])([xyz]|rx|ry|rz|\d{1,2}f|f\d{1,2}|rf)", word)
        parts += list(match.groups()) if match else [word]
    return parts


def is_wanted(words: Sequence[str]) -> bool:
    """Whether a column is what the test asks for."""
    return bool(set(words) & set(_WANTED))


def is_unlike(words: Sequence[str]) -> bool:
    """Whether a column is an error, a difference or of a degree of freedom: no channel of a record."""
    return bool(set(words) & set(_OTHER))


def axis_in(words: Sequence[str]) -> str | None:
    """Axis that a word names."""
    return next((axis for axis in AXES if set(words) & set(_AXIS_WORDS[axis])), None)


def quantity_in(words: Sequence[str], unit: str | None) -> str | None:
    """Quantity by a word of the name, else by the unit; single letters count only beside an axis or a chamber."""
    si = quantity_unit(unit)
    if si in (None, "Pa") and _is_difference(words, si == "Pa"):
        return "pressure_difference"
    for quantity, known in _QUANTITY_WORDS.items():
        if any(len(word) > 1 and word in known for word in words):
            commanded = quantity == "spool" and unit in ("V", "mA") and is_wanted(words)
            return "valve_command" if commanded else quantity
    if si in _BY_UNIT:
        return _BY_UNIT[si]
    if unit in ("V", "mA") and is_wanted(words):
        return "valve_command"
    return next((q for q, known in _QUANTITY_WORDS.items() if words and words[0] in known), None)


def _is_difference(words: Sequence[str], in_pressure: bool) -> bool:
    pressure = in_pressure or bool(set(words) & set(_QUANTITY_WORDS["pressure"]))
    symbol = bool(set(words) & set(_DIFFERENCE)) or ("d", "p") in pairwise(words)  # dP
    return symbol or (pressure and bool(set(words) & set(_DIFFERENT)))


def floor_in(words: Sequence[str]) -> str | None:
    """Floor of a specimen: `1F`, `F2`, `floor 3`, `roof` as 1F, 2F, 3F, RF."""
    for word in words:
        if match := _FLOOR.fullmatch(word):
            return "RF" if match["roof"] else f"{int(match['number'] or match['after'])}F"
    for word, after in pairwise(words):
        if word in _FLOOR_NAMES and after.isdecimal():
            return f"{int(after)}F"
    return "" if set(words) & {*_FLOOR_NAMES, "specimen", "structure"} else None


def component_in(words: Sequence[str], labels: Labels) -> str | None:
    """Actuator or strut that words name."""
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


def chamber_in(words: Sequence[str], single: bool) -> str | None:
    """Chamber of a pressure; that of an actuator with a `single` one needs no word."""
    chambers = [c for c in "ab" if set(words) & {c, f"p{c}"}]
    return chambers[0] if len(chambers) == 1 else "a" if single and not chambers else None

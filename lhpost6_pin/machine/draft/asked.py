"""What `lhpost6 new-machine` asks of a table, in order: its prompts, its options and what is checked follow from it."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from ...core.errors import ParameterError
from ..quantity import Quantity
from .stated import read_stated

__all__ = ["ASKED", "Asked", "alternatives_of", "option_of", "read_answers", "refuse_alternatives"]


@dataclass(frozen=True)
class Asked:
    """One number that is asked for."""

    unit: str
    question: str
    needed: bool = False
    sizes: tuple[int, ...] = (1,)  # how many numbers it may have
    when: str = ""  # "free": only of a six-leg platform
    example: str = ""  # of an answer, where it has several numbers


ASKED: Mapping[str, Asked] = {
    "mass": Asked("kg", "Moving mass: table, fittings, pistons; one number, or one an axis", True, (1, 2, 3)),
    "size": Asked("m", "Table in plan, along x and y, as in '2 3 m'", sizes=(2,), example="2 3 m"),
    "inertia": Asked(
        "kg m2",
        "Moments of inertia about x, y, z through the centre of gravity, as in '80 90 150 kg m2'",
        sizes=(3,),
        when="free",
        example="80 90 150 kg m2",
    ),
    "area": Asked("m2", "Piston area that the oil acts on (of a single-rod cylinder that without the rod)"),
    "bore": Asked("m", "Bore of the cylinder, in place of the area"),
    "rod": Asked("m", "Diameter of the rod"),
    "stroke": Asked("m", "Stroke each way from the middle", True),
    "length": Asked("m", "Actuator from swivel to swivel at mid-stroke"),
    "supply_pressure": Asked("Pa", "Supply pressure", True),
    "return_pressure": Asked("Pa", "Return pressure"),
    "speed": Asked(
        "m/s", "Speed of the piston without load at full command, or per volt (--voltage): its slope at null"
    ),
    "rated_flow": Asked("m3/s", "Rated flow of the valve, all valves of an actuator together; in place of the speed"),
    "rated_drop": Asked("Pa", "Pressure drop over both paths of the valve at which that flow is rated"),
    "valve_delay": Asked("s", "Delay of the valve, from command to spool"),
    "friction": Asked("N", "Friction of one actuator with its share of the guides"),
    "presliding": Asked("m", "Slip over which that friction builds up after a reversal"),
    "bulk_modulus": Asked("Pa", "Effective bulk modulus of the oil"),
    "platen_radius": Asked("m", "Radius of the joints under the platen", when="free"),
    "base_radius": Asked("m", "Radius of the joints on the base", when="free"),
    "platen_spread": Asked("rad", "Angle between the joints of a pair under the platen", when="free"),
    "base_spread": Asked("rad", "Angle between the joints of a pair on the base", when="free"),
}
"""By name; an option is the name with hyphens."""

_ALTERNATIVES = (
    ("area", "bore", "the piston's area", "if the bore was measured, else"),
    ("speed", "rated_flow", "the flow of the valve", "if the valve's rated flow is known, else"),
)
"""Two names of numbers that determine the same quantity; that quantity, and when the first is to be left out."""


def read_answers(texts: Mapping[str, str], voltage: float | None = None) -> dict[str, Quantity]:
    """Quantities of what was answered, by name, in SI; `voltage` [V] is the full command, for a speed per volt.

    Such a speed becomes `slope`: at full command, if the valve's flow were proportional to it as at null. A measured
    speed per volt is one of small commands; a speed at full command has no volt. The voltage itself is among the
    quantities, too.
    Raises ParameterError naming the option for what cannot be read or is not positive, or all that are missing.
    """
    found = {}
    if voltage is not None and not voltage > 0.0:
        raise ParameterError(f"--voltage {voltage:g}: must be positive")
    for name, text in texts.items():
        asked, option = ASKED[name], option_of(name)
        source = f"stated to lhpost6 new-machine: {' '.join(text.split())}"
        if name == "speed" and text.rstrip().split("+")[0].rstrip().endswith("V"):
            name = "slope"
            found[name] = _per_volt(text, voltage, option, source)
        else:
            found[name] = read_stated(text, asked.unit, option, source, asked.example)
        value = found[name].value
        numbers = value if isinstance(value, tuple) else (value,)
        if len(numbers) not in asked.sizes:
            example = f", as in '{asked.example}'" if asked.example else ""
            raise ParameterError(
                f"{option}: {text!r} should be {' or '.join(map(str, asked.sizes))} number(s){example}"
            )
        if min(numbers) < 0.0 or (min(numbers) == 0.0 and name not in ("return_pressure", "valve_delay", "friction")):
            raise ParameterError(f"{option}: {text!r} must be positive")
    if voltage is not None:
        found["voltage"] = Quantity(voltage, "V", "measured", f"stated to lhpost6 new-machine: --voltage {voltage:g}")
    lacking = [
        f"{option_of(name)} is missing: {asked.question.lower()} [{asked.unit}]"
        for name, asked in ASKED.items()
        if asked.needed and name not in found
    ]
    if "area" not in found and "bore" not in found:
        lacking.append("--area is missing: the piston area that the oil acts on, or --bore and --rod")
    if lacking:
        raise ParameterError("; ".join(lacking))
    return found


def refuse_alternatives(names: Collection[str]) -> None:
    """Raise ParameterError, naming both options, if two of these numbers determine the same quantity."""
    for first, second, what, when in _ALTERNATIVES:
        if first in names and second in names:
            one, other = option_of(first), option_of(second)
            raise ParameterError(f"{one} and {other} both determine {what}: leave out {one} {when} {other}")


def alternatives_of(name: str) -> tuple[str, ...]:
    """Names of the numbers that determine the same quantity as the number `name`."""
    pairs = [(first, second) for first, second, *_ in _ALTERNATIVES if name in (first, second)]
    return tuple(other for pair in pairs for other in pair if other != name)


def option_of(name: str) -> str:
    """The option on the command line that states a number."""
    return f"--{name.replace('_', '-')}"


def _per_volt(text: str, voltage: float | None, option: str, source: str) -> Quantity:
    if voltage is None:
        raise ParameterError(f"{option}: {text!r} is per volt; give the command's full voltage with --voltage")
    slope = read_stated(text, "m/s/V", option, source)
    if isinstance(slope.value, tuple) or isinstance(slope.sd, tuple):
        raise ParameterError(f"{option}: {text!r} should be 1 number")
    sd = None if slope.sd is None else slope.sd * voltage
    return Quantity(slope.value * voltage, "m/s", "measured", f"{source}, slope at null, times {voltage:g} V", sd)

"""From a family's name, its components and its numbers to an effect of a machine."""

from collections.abc import Mapping, Sequence

from ...core.errors import ParameterError, instead_of
from ...effects.effect import Effect
from ...effects.registry import LAWS
from ...laws.contract import parameter_units
from ..parameters import EffectEntry, Quantity, to_unit
from ..structure import Structure
from .composed import COMPOSED
from .family import Family, Shape, find_family
from .scaled import in_size_of

__all__ = ["effect_entry", "make_effect", "make_named_effect"]

Made = tuple[str, Sequence[str], Sequence[tuple[float, ...]]]


def make_effect(
    machine: Structure,
    family: str,
    components: Sequence[str] = (),
    values: Mapping[str, float] | None = None,
    *,
    name: str = "",
    source: str = "given by hand",
) -> Effect:
    """An effect of a family on some components (none: the first of its groups); values in SI, typical ones else.

    Raises UnknownNameError for a family that the library has not; ParameterError for a component that it cannot act on
    and for a number that it does not have or that is out of its bounds.
    """
    known = in_size_of(find_family(family), machine)
    if not known.law and family not in COMPOSED:
        raise ParameterError(f"{family} is no part of a machine: state it in the file of the sensors or the controller")
    possible = known.components(machine)
    chosen = tuple(components) or next(iter(known.groups(machine)), ())
    if wrong := [c for c in chosen if c not in possible]:
        raise ParameterError(
            f"{family}: cannot act on {', '.join(wrong)}; it can on {', '.join(possible) or 'nothing'}"
        )
    numbers = _numbers(known, values or {})
    law, ports, params = (
        _of_law(machine, chosen, numbers, known) if known.law else COMPOSED[family](machine, chosen, numbers)
    )
    return Effect(name or family, law, tuple(ports), tuple(params), source, family=family)


def _of_law(machine: Structure, components: Sequence[str], values: Mapping[str, float], family: Family) -> Made:
    """The parameters of the family's law by name: its numbers, else the component's; or as `parameters` states."""
    law, known = LAWS[family.law], {c.name: vars(c) for c in machine.components}
    stated = [family.parameters.get(name, name) for name, _ in parameter_units(law)]
    rows = []
    for component in components:
        numbers = {**known.get(component, {}), **values}
        if lacking := [name for name in stated if isinstance(name, str) and name not in numbers]:
            raise ParameterError(
                f"{family.name}: {lacking[0]} of law {family.law} is no number of the family or of {component}; "
                "state it under `parameters` in models/library"
            )
        rows.append(tuple(numbers[name] if isinstance(name, str) else name for name in stated))
    return family.law, [f"{c} -" for c in components] if law.ports == (1, 2) else components, rows


def make_named_effect(machine: Structure, name: str, entry: EffectEntry) -> Effect:
    """The effect that a section ``[effect.NAME]`` states; raises what `make_effect` does, with its name."""
    shapes = {shape.name: shape for shape in find_family(entry.family).shapes}
    values, sources = {}, []
    for key, quantity in entry.values.items():
        unit = shapes[key].unit if key in shapes else quantity.unit
        value = to_unit(quantity.value, quantity.unit, unit, f"effect.{name}.{key}")
        if isinstance(value, tuple):
            raise ParameterError(f"effect.{name}.{key}: {value!r} should be one number")
        values[key] = value
        sources.append(f"{quantity.evidence}: {quantity.source}")
    source = "; ".join(dict.fromkeys(sources)) or "typical numbers of the library"
    return make_effect(machine, entry.family, entry.components, values, name=name, source=source)


def effect_entry(
    machine: Structure, family: str, components: Sequence[str], values: Mapping[str, float]
) -> EffectEntry:
    """What a machine's file would state for these values in SI; raises UnknownNameError or ParameterError."""
    shapes = {shape.name: shape for shape in in_size_of(find_family(family), machine).shapes}
    _refuse_unknown(family, values, shapes)
    stated = {
        key: Quantity(float(values[key]), shape.unit, "override", "given by hand")
        if key in values
        else Quantity(shape.typical, shape.unit, "assumed", f"typical of the library: {shape.source}")
        for key, shape in shapes.items()
    }
    return EffectEntry(family, tuple(components), stated)


def _refuse_unknown(family: str, values: Mapping[str, float], shapes: Mapping[str, Shape]) -> None:
    for key in values:
        if key not in shapes:
            raise ParameterError(f"{family}: has no number {key!r}; {instead_of(key, list(shapes))}")


def _numbers(family: Family, values: Mapping[str, float]) -> dict[str, float]:
    shapes = {shape.name: shape for shape in family.shapes}
    _refuse_unknown(family.name, values, shapes)
    found = {}
    for key, shape in shapes.items():
        value = float(values.get(key, shape.typical))
        rounding = 1e-6 * (shape.high - shape.low)  # of a search that ends at a bound
        if shape.low - rounding <= value <= shape.high + rounding:
            value = min(max(value, shape.low), shape.high)
        else:
            raise ParameterError(
                f"{family.name}: {key} = {value:g} {shape.unit} is not between {shape.low:g} and {shape.high:g}"
            )
        found[key] = value
    return found

"""Numbers with unit, evidence and source, read from TOML and checked; overrides give a changed copy.

A machine file is a tree of sections (``[platen]``, ``[kind.horizontal]``, ``[component.H1]``, ...). Here it becomes
one flat mapping from a path such as ``platen.mass``, ``horizontal.area_a`` or ``H1.base_point`` to a `Quantity`;
`machine.py` gives the paths their meaning.
"""

import logging
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..core.errors import ParameterError, UnknownNameError
from ..core.files import find_shipped, read_toml, reason_of
from .quantity import EVIDENCE, LARGEST, Quantity, Value, read_number, read_quantity, to_unit, unusable, vector_length

__all__ = [
    "EVIDENCE",
    "LARGEST",
    "EffectEntry",
    "Parameters",
    "Quantity",
    "Value",
    "load_parameters",
    "override_parameters",
    "to_unit",
    "unusable",
]

log = logging.getLogger(__name__)

_GROUPS = ("kind", "component", "floor", "accelerometer", "estimates")
"""Sections that hold named sub-sections; the sub-section's name is the path's first part."""

_FAR = 2.9
"""Decades from what is stated beyond which a number without unit is doubted: mm for m are three. Judgement."""

_PREFIXED = ("accelerometer", "estimates")
"""Those whose sub-sections keep the group's name in front of theirs."""


@dataclass(frozen=True, slots=True)
class EffectEntry:
    """An effect of the library as a machine file states it in a section ``[effect.NAME]``."""

    family: str
    components: tuple[str, ...]  # empty: all that the family can act on
    values: Mapping[str, Quantity]


@dataclass(frozen=True, slots=True)
class Parameters(Mapping[str, Quantity]):
    """All quantities of a machine by path, and the plain words (kinds, mounts, options) beside them."""

    quantities: Mapping[str, Quantity]
    words: Mapping[str, str | int]
    origin: str
    effects: Mapping[str, EffectEntry] = field(default_factory=dict)  # by name
    replaced: Mapping[str, Quantity | str | int] = field(default_factory=dict, compare=False)  # by overrides

    def __getitem__(self, path: str) -> Quantity:
        """Return the quantity at `path`; raises UnknownNameError that lists the section's paths."""
        try:
            return self.quantities[path]
        except KeyError:
            raise _unknown_parameter(path, self.quantities) from None

    def number(self, path: str) -> float:
        """Scalar at `path`; raises UnknownNameError, or ParameterError if it is a vector."""
        value = self[path].value
        if isinstance(value, tuple):
            raise ParameterError(f"{self.origin}: {path} is a vector, not a number")
        return value

    def vector(self, path: str) -> tuple[float, ...]:
        """Vector at `path`; raises UnknownNameError, or ParameterError if it is a scalar."""
        value = self[path].value
        if not isinstance(value, tuple):
            raise ParameterError(f"{self.origin}: {path} is a number, not a vector")
        return value

    def __contains__(self, path: object) -> bool:
        """True if there is a quantity at `path`."""
        return path in self.quantities

    def __iter__(self) -> Iterator[str]:
        """Iterate over paths in file order."""
        return iter(self.quantities)

    def __len__(self) -> int:
        """Count quantities."""
        return len(self.quantities)


def load_parameters(name_or_path: str | Path) -> Parameters:
    """Read a machine file by shipped name (``lhpost6``) or by path.

    Raises ParameterError that names file and key for anything that is not a complete quantity.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = find_shipped("machine", str(name_or_path))
    return _flatten(_read_toml(path), path.name)


def override_parameters(parameters: Parameters, changes: Mapping[str, Any] | str | Path) -> Parameters:
    """Return a copy with some values replaced.

    `changes` maps a path to a number or array in the file's unit, which is SI (with a warning where it is far from what
    is stated), or to a table ``{value, unit, source, ...}`` of
    which only value is needed; or it is the path of a small TOML file of such tables, with units. A component's path
    (``H3.seal_friction``) may be new if its kind has that key, and a number of an effect that is there
    (``effect.NAME.KEY``); anything else must exist. A file may add effects, ``[effect.NAME]``. Raises ParameterError
    naming the key and the file; or UnknownNameError for what is given by hand.
    """
    if not isinstance(changes, str | Path):
        return _overridden(parameters, changes, {}, "given by hand")
    path = Path(changes)
    tree = _read_toml(path)
    entries, added = _entries(tree, path.name), _effects(tree, path.name)
    try:
        return _overridden(parameters, entries, added, path.name, in_a_file=True)
    except (ParameterError, UnknownNameError) as error:
        raise ParameterError(f"{path.name}: {error}") from None


def _overridden(
    parameters: Parameters,
    entries: Mapping[str, Any],
    added: Mapping[str, EffectEntry],
    origin: str,
    in_a_file: bool = False,
) -> Parameters:
    quantities, words = dict(parameters.quantities), dict(parameters.words)
    effects, replaced = {**parameters.effects, **added}, dict(parameters.replaced)
    for key, entry in entries.items():
        if key.startswith("effect."):
            _override_effect(effects, key, entry, origin)
            continue
        inherited = _of_kind(parameters, key)
        if key in words or inherited in words:
            if isinstance(entry, bool) or not isinstance(entry, str | int):
                raise ParameterError(f"{key}: {entry!r} should be a word or a whole number")
            replaced.setdefault(key, words.get(key, words.get(inherited, entry)))
            words[key] = entry
            continue
        base = quantities.get(key) or quantities.get(inherited)
        if base is None:
            raise _unknown_parameter(key, (*quantities, *words))
        replaced.setdefault(key, base)
        quantities[key] = _changed(base, entry, key, origin)
        if in_a_file and base.unit != "1" and not (isinstance(entry, Mapping) and "unit" in entry):
            raise ParameterError(f"{key}: has no unit; write {{ value = ..., unit = '{base.unit}' }}")
        if not isinstance(entry, Mapping | Quantity):
            _doubt_unit(key, quantities[key].value, base)
    origins = f"{parameters.origin.removesuffix(f' + {origin}')} + {origin}"
    return Parameters(quantities, words, origins, effects, replaced)


def _doubt_unit(key: str, value: Value, base: Quantity) -> None:
    """Warn where a number, or a vector as a whole, without unit is far from the one stated, as in another unit."""
    new, old = (math.hypot(*x) if isinstance(x, Iterable) else abs(x) for x in (value, base.value))
    if base.unit != "1" and new and old and abs(math.log10(new / old)) > _FAR:
        log.warning(
            "%s: %r has no unit and is taken in %s, where %r is stated; write {'value': ..., 'unit': ...}",
            *(key, value, base.unit, base.value),
        )


def _unknown_parameter(path: str, known: Iterable[str]) -> UnknownNameError:
    """Error for a path that is not `known`, with those of its section if there is such a section."""
    section = [p for p in known if p.split(".")[0] == path.split(".")[0]]
    return UnknownNameError("parameter", path, section or list(known), "`lhpost6 info` lists all of a machine")


def _override_effect(effects: dict[str, EffectEntry], key: str, entry: Any, origin: str) -> None:
    """Change a number of an effect in place, ``effect.NAME.KEY``; it must be stated."""
    name, _, number = key.removeprefix("effect.").rpartition(".")
    if name not in effects:
        raise UnknownNameError("effect of the machine", name, list(effects))
    known = effects[name]
    if number not in known.values:
        raise UnknownNameError(f"number of effect {name}", number, list(known.values))
    changed = _changed(known.values[number], entry, key, origin)
    effects[name] = replace(known, values={**known.values, number: changed})


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return read_toml(path)
    except FileNotFoundError:
        raise ParameterError(f"{path}: no such file") from None
    except ValueError as error:  # of TOML and of UTF-8
        raise ParameterError(f"{path}: not a TOML file: {error}") from None
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read: {reason_of(error)}") from None


def _flatten(tree: Mapping[str, Any], file: str) -> Parameters:
    quantities: dict[str, Quantity] = {}
    words: dict[str, str | int] = {}
    for path, entry in _entries(tree, file).items():
        if isinstance(entry, dict):
            quantities[path] = read_quantity(entry, f"{file}: {path}")
        elif isinstance(entry, str | int) and not isinstance(entry, bool):
            words[path] = entry
        else:
            raise ParameterError(
                f"{file}: {path} = {entry!r} has no unit; write {path.split('.')[-1]} = "
                '{ value = ..., unit = "...", evidence = "...", source = "..." }'
            )
    return Parameters(quantities, words, file, _effects(tree, file))


def _effects(tree: Mapping[str, Any], file: str) -> dict[str, EffectEntry]:
    """Effects of the library that a file names, ``[effect.NAME]``."""
    found = {}
    if not isinstance(tree.get("effect", {}), dict):
        raise ParameterError(f"{file}: effect must be sections [effect.NAME]")
    for name, table in tree.get("effect", {}).items():
        key = f"{file}: effect.{name}"
        if not isinstance(table, dict) or not isinstance(table.get("family"), str):
            raise ParameterError(f"{key} must be a section with family = a name of the library")
        components = table.get("components", [])
        if not isinstance(components, list) or not all(isinstance(c, str) for c in components):
            raise ParameterError(f'{key}: components = {components!r} should be a list of names, such as ["H1"]')
        entries = {k: v for k, v in table.items() if k not in ("family", "components")}
        for k, v in entries.items():
            if not isinstance(v, dict):
                raise ParameterError(f"{key}: {k} = {v!r} has no unit; write {k} = {{ value = ..., unit = ... }}")
        values = {
            k: read_quantity({"evidence": "override", "source": file, **v}, f"{key}.{k}") for k, v in entries.items()
        }
        found[name] = EffectEntry(table["family"], tuple(components), values)
    return found


def _entries(tree: Mapping[str, Any], file: str) -> dict[str, Any]:
    """Entries of a file by path, as they stand."""
    found: dict[str, Any] = {}
    for section, table in _sections(tree, file):
        for key, entry in table.items():
            path = f"{section}.{key}"
            if path in found:
                raise ParameterError(f"{file}: {path} is given twice; kinds, components and sections share names")
            if "." in key:
                raise ParameterError(f"{file}: {path}: a key may not hold a dot")
            found[path] = entry
    return found


def _sections(tree: Mapping[str, Any], file: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for name, table in tree.items():
        if name == "effect":
            continue  # `_effects` reads these
        if "." in name:
            section, _, key = name.rpartition(".")
            raise ParameterError(f'{file}: "{name}": write it without quotation marks, or {key} under [{section}]')
        if not isinstance(table, dict) or "value" in table:
            where = "put it under that of its part, as in [horizontal] or [platen]; `lhpost6 info` lists section.name"
            raise ParameterError(f"{file}: {name} stands outside any section; {where}")
        if name not in _GROUPS:
            yield name, table
            continue
        for sub, inner in table.items():
            if not isinstance(inner, dict):
                raise ParameterError(f"{file}: {name}.{sub} must be a section [{name}.{sub}]")
            if not sub.replace("_", "").isalnum():
                raise ParameterError(f"{file}: {name}.{sub}: use letters, digits and underscores for a name")
            yield (f"{name}.{sub}" if name in _PREFIXED else sub), inner


def _of_kind(parameters: Parameters, key: str) -> str:
    """Path that component key ``H3.seal_friction`` inherits from: its kind's; empty for anything else."""
    component, _, name = key.partition(".")
    kind = parameters.words.get(f"{component}.kind")
    return f"{kind}.{name}" if kind is not None else ""


def _changed(base: Quantity, entry: Any, key: str, origin: str) -> Quantity:
    if isinstance(entry, Quantity):
        new = entry
    elif isinstance(entry, Mapping):
        new = read_quantity({"unit": base.unit, "evidence": "override", "source": origin, **entry}, key)
    else:
        new = Quantity(read_number(entry, key), base.unit, "override", f"{origin}; was {base.value!r} ({base.source})")
    value = read_number(to_unit(new.value, new.unit, base.unit, key), key)
    sd = base.sd if new.sd is None else to_unit(new.sd, new.unit, base.unit, key)
    if vector_length(value) != vector_length(base.value) or (
        sd is not None and vector_length(sd) not in (0, vector_length(value))
    ):
        raise ParameterError(f"{key}: {new.value!r} does not have the shape of {base.value!r}")
    return replace(new, value=value, unit=base.unit, sd=sd)

"""Changes of a machine against its file, as attributes of its records: effects added, numbers overridden."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .parameters import EffectEntry
from .quantity import Quantity, Value

if TYPE_CHECKING:
    from .machine import Machine

__all__ = ["change_facts", "changes_summary"]

_KEYS = ("effects", "overrides")


def change_facts(machine: "Machine") -> dict[str, str]:
    """Attributes of a record: `effects` with components and numbers, `overrides` with values before; none: omitted.

    Effects that the machine's own file states are among them; an override that changes nothing is not.
    """
    parameters = machine.parameters
    effects = [_effect(name, entry) for name, entry in parameters.effects.items()]
    effects += [f"{e.name}: {e.law} on {' '.join(e.ports)}, made by hand" for e in machine.own_effects]
    overrides = []
    for path, before in parameters.replaced.items():
        now = parameters.quantities[path] if isinstance(before, Quantity) else parameters.words[path]
        new, old = _shown(now), _shown(before)
        if new != old:
            overrides.append(f"{path} = {new} (was {old})")
    return {key: "; ".join(texts) for key, texts in zip(_KEYS, (effects, overrides), strict=True) if texts}


def changes_summary(attrs: Mapping[str, Any], most: int | None = None) -> list[str]:
    """What a record was made with beyond its machine's file, a sentence each, of at most so many changes."""
    found = []
    for key in (key for key in _KEYS if key in attrs):
        each = str(attrs[key]).split("; ")
        more = f"; and {len(each) - most} more" if most is not None and len(each) > most else ""
        found.append(f"made with {key}: {'; '.join(each[:most])}{more}")
    return found


def _effect(name: str, entry: EffectEntry) -> str:
    """An effect of the library, as in `worn: seal_wear on H1 H2, amplitude = 900 N`."""
    where = f" on {' '.join(entry.components)}" if entry.components else ""
    numbers = [f"{key} = {_shown(q)}" for key, q in entry.values.items()] or ["typical numbers of the library"]
    return ", ".join([f"{name}: {entry.family}{where}", *numbers])


def _shown(value: Quantity | str | int) -> str:
    """A number with its unit, or a word."""
    return f"{_digits(value.value)} {value.unit}" if isinstance(value, Quantity) else str(value)


def _digits(value: Value) -> str:
    return f"[{', '.join(f'{v:.6g}' for v in value)}]" if isinstance(value, tuple) else f"{value:.6g}"

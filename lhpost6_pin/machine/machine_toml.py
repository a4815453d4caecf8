"""A machine as a TOML file that loads everywhere: its numbers with their sources, its effects of the library."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

from ..core.errors import ParameterError
from ..core.files import write_whole
from .machine import Machine
from .parameters import Quantity, Value

__all__ = ["machine_toml", "quantity_toml", "save_machine_toml", "section_of", "sections_toml"]


def save_machine_toml(machine: Machine, path: Path, title: str = "") -> Path:
    """Write a machine, whole or not at all; `title` is a comment on top.

    Raises ParameterError for an effect made by hand, which no file can state.
    """
    if machine.own_effects:
        names = ", ".join(effect.name for effect in machine.own_effects)
        raise ParameterError(f"{names}: made by hand, not of the library; a machine file cannot hold it")
    with write_whole(path) as beside:
        beside.write_text(machine_toml(machine, title), encoding="utf-8")
    return path


def machine_toml(machine: Machine, title: str = "") -> str:
    """The text of a machine's file; a specimen is not in it."""
    parameters = machine.parameters
    groups: dict[str, list[str]] = {}
    for path, word in parameters.words.items():
        section, key = section_of(machine, path)
        groups.setdefault(section, []).append(f"{key} = {json.dumps(word, ensure_ascii=False)}")
    for path, quantity in parameters.items():
        section, key = section_of(machine, path)
        groups.setdefault(section, []).append(f"{key} = {quantity_toml(quantity)}")
    for name, entry in parameters.effects.items():
        rows = [f"family = {json.dumps(entry.family)}", f"components = {json.dumps(list(entry.components))}"]
        rows += [f"{key} = {quantity_toml(value)}" for key, value in entry.values.items()]
        groups[f"effect.{name}"] = rows
    return sections_toml([" ".join(title.split())] if title else [], groups)


def sections_toml(comments: Iterable[str], groups: Mapping[str, Iterable[str]]) -> str:
    """Comments, then sections with their rows."""
    lines = [f"# {line}" for line in comments]
    for section, rows in groups.items():
        lines += ["", f"[{section}]", *rows]
    return "\n".join(lines).lstrip("\n") + "\n"


def quantity_toml(quantity: Quantity) -> str:
    """A number as a table with its unit, evidence and source."""
    entries = [f"value = {_number(quantity.value)}", f"unit = {_text(quantity.unit)}"]
    entries += [f"evidence = {_text(quantity.evidence)}", f"source = {_text(quantity.source)}"]
    if quantity.sd is not None:
        entries.append(f"sd = {_number(quantity.sd)}")
    if quantity.printed is not None:
        entries.append(f"printed = {_text(quantity.printed)}")
    return f"{{ {', '.join(entries)} }}"


def section_of(machine: Machine, path: str) -> tuple[str, str]:
    """Section and key of a parameter's path in a file."""
    section, _, key = path.rpartition(".")
    if section in {c.kind for c in machine.components}:
        return f"kind.{section}", key
    if section in {c.name for c in machine.components}:
        return f"component.{section}", key
    return section, key


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # TOML's basic strings are JSON's


def _number(value: Value) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(repr(float(v)) for v in value)}]"
    return repr(float(value))

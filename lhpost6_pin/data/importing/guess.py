"""A first channel map from the columns' names, such as `Long Displ ref` or `H1 Press A`: to be read and edited."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

from ...core.names import AXES
from ...core.units import quantity_unit
from ..channels import LAYOUT, channel_unit
from .channel_map import ChannelMap, Source, TestFacts, channels_of, source_line, with_labels
from .channel_units import without_unit
from .guess_words import (
    SUPPLY,
    Labels,
    axis_in,
    chamber_in,
    component_in,
    floor_in,
    is_unlike,
    is_wanted,
    quantity_in,
    words_of,
)
from .raw import RawTest, shown

__all__ = ["Guess", "guess_map", "is_export", "other_columns"]

_PLACEHOLDER = "CHANNEL"
_FURTHER = ("reference_velocity", "reference_acceleration", "supply_flow")
"""Columns of an export of which a record has no channel: variables that a simulation adds."""
_FLOORS, _SHARE = "floor_acceleration", "valve_command"
_FEW_SENSORS = ("pressure_difference", _SHARE, _FLOORS)
"""Kinds of channels that a remark names even where a record of the machine does not have them."""


class Guess(NamedTuple):
    """A first map, and remarks: a line to complete for each column and channel that is not in it."""

    channels: ChannelMap
    remarks: tuple[str, ...]


class _Machine(NamedTuple):
    """What is known of the machine: names along dimensions, axes that move, channels, full commands [V]."""

    labels: Labels
    axes: tuple[str, ...]
    known: Mapping[str, tuple[str, str | None]]
    full: Mapping[str, float]


def is_export(raws: Sequence[RawTest]) -> bool:
    """Whether the files were written by `export_record` or are records, whose columns are named by channel.

    A record need not state its layout: one is recognised by its columns, all channels of the layout with unit and time.
    """
    return all("layout_version" in raw.facts or _of_layout(raw) for raw in raws)


def _of_layout(raw: RawTest) -> bool:
    """Whether all columns of a file are channels of a record, such as platen_acceleration_x, with unit and time."""
    known = (name in LAYOUT or name.rpartition("_")[0] in LAYOUT for name in raw.names)
    return raw.time is not None and None not in raw.units and bool(raw.names) and all(known)


def guess_map(
    raws: Sequence[RawTest],
    labels: Labels,
    moves: Sequence[str] = AXES,
    full_commands: Mapping[str, float] = MappingProxyType({}),
) -> Guess:
    """Make the map that the columns' names suggest, the first column for each channel.

    `labels` are the machine's; the platen `moves` in some axes, the others need no map. A column
    without a word for its axis or actuator is of the only one, where there is one. Columns that are not recognised
    become remarks with the channels that they could be. A valve's command in volts needs its full one, by actuator [V].
    """
    words = [words_of(without_unit(name)) for raw in raws for name in raw.names]
    stated = set(labels.get("floor", ()))
    labels = with_labels(labels, [f"{_FLOORS}[{floor}]" for w in words if (floor := floor_in(w))])
    machine = _Machine(labels, tuple(moves), channels_of(labels), full_commands)
    found: dict[str, Source] = {}
    unknown: list[tuple[Source, str]] = []
    remarks: list[str] = []
    bare: dict[str, str] = {}
    for raw, name, number, unit in ((r, *one) for r in raws for one in zip(r.names, r.numbers, r.units, strict=True)):
        channel, like = _channel(name, unit, machine)
        source = _source(raws, raw, name, number, unit)
        where = f"column {number} of {_file_name(raw)}"
        if channel and channel.startswith(_SHARE) and quantity_unit(unit) != "1":
            if (gain := _share(channel, unit, machine)) and channel not in found:
                found[channel] = replace(source, unit="1", gain=gain)
                continue
            line = source_line(channel, replace(source, unit="1"))
            remarks.append(f"{line}  # add gain = 1 / full command, in the unit of {where}; 0.1 for 10 V")
        elif channel is None:
            why = f"; like {like}, which a record of this machine does not have" if like else ""
            unknown.append((source, f"not recognised: {where}{why}"))
        elif channel in found:
            remarks.append(f"{source_line(channel, source)}  # also like {channel}: {where}")
        else:
            found[channel] = source
            if unit is None:
                bare[channel] = f"{where}, {name!r}"
    if bare:
        remarks.append(_without_units(bare))
    partly = {machine.known[name][0] for name in found}
    for name, (variable, label) in machine.known.items():
        if variable in partly and name not in found and not _is_still(label, machine):
            zero = Source(constant=0.0, unit=channel_unit(name))
            remarks.append(f"{source_line(name, zero)}  # not found; if it is known to be zero")
    free = [n for n, (_, label) in machine.known.items() if n not in found and not _is_still(label, machine)]
    further = [source for source, _ in unknown if str(source.column).startswith(_FURTHER)]
    unknown = [(source, why) for source, why in unknown if source not in further]
    if further:
        names = shown([str(s.column) for s in further])
        remarks.append(f"{names}: further variables of an export; an import leaves them out")
    remarks += [f"{source_line(_PLACEHOLDER, source)}  # {why}{_possible(source, free)}" for source, why in unknown]
    if unknown:
        remarks.append(f"{_PLACEHOLDER} is one of: {_short(free)}")
    remarks += _without_masses(found, stated)
    remarks += [f"add file_rate, in Hz, to [test]: {_file_name(raw)} has no time" for raw in raws if raw.time is None]
    facts = {key: value for raw in reversed(raws) for key, value in raw.facts.items()}
    ordered = {name: found[name] for name in machine.known if name in found}
    return Guess(ChannelMap("guessed map", _test(facts), ordered), tuple(remarks))


def other_columns(first: Sequence[RawTest], other: Sequence[RawTest]) -> str:
    """Return in what the columns of one file differ from those of another, for a remark; empty if in nothing."""
    ours, theirs = ([name for raw in raws for name in raw.names] for raws in (first, other))
    more, less = [n for n in theirs if n not in ours], [n for n in ours if n not in theirs]
    parts = [f"{word} {shown(names)}" for word, names in (("has also", more), ("lacks", less)) if names]
    return f"{other[0].source}: {'; '.join(parts)}" if parts else ""


def _without_units(columns: Mapping[str, str]) -> str:
    """A remark on all channels whose columns have no unit."""
    channel, column = next(iter(columns.items()))
    if len(columns) == 1:
        return f"add the unit of {channel}: {column}"
    how = 'to the line of each, such as unit = "mm"'
    return f"add the units of {len(columns)} channels, {how}: {_short([*columns])}; the first is {column}"


def _without_masses(found: Mapping[str, Source], stated: set[str]) -> list[str]:
    """A remark on floors whose accelerations are measured, and which the machine's file does not state."""
    floors = [name.rpartition("[")[2].rstrip("]") for name in found if name.startswith(_FLOORS)]
    new = [f"[floor.{name}]" for name in floors if name not in stated]
    mass = 'mass = { value = 100.0, unit = "kg", evidence = "measured", source = "weighed", rel_sd = 0.1 }'
    what = f'add {", ".join(new)} to the machine\'s file, each with lines as along = "x" and {mass}'
    more = "; where no guides take the overturning moment, with point, too: its place from C"
    return [f"{_FLOORS} is not used without masses: {what}{more}"] if new else []


def _is_still(label: str | None, machine: _Machine) -> bool:
    """Whether a label is an axis on which the machine does not move."""
    return label in AXES and label not in machine.axes


def _share(channel: str, unit: str | None, machine: _Machine) -> float | None:
    """Share of full command that a volt of a valve command is; None in another unit, or where that is not stated."""
    full = machine.full.get(channel.rpartition("[")[2].rstrip("]"))
    return float(f"{1.0 / full:.6g}") if full and _is_voltage(unit) else None


def _possible(source: Source, free: Sequence[str]) -> str:
    """Channels that a column of this unit could be."""
    si = quantity_unit(source.unit)
    volts = _is_voltage(source.unit)
    reference = str(source.column).casefold().startswith("ref")  # a reference is no drive, whatever its unit
    free = [name for name in free if not (reference and name.startswith("drive"))]
    fitting = [name for name in free if (name.startswith(_SHARE) if volts else channel_unit(name) == si)]
    return f"; by its unit: {_short(fitting)}" if fitting else ""


def _is_voltage(unit: str | None) -> bool:
    return (unit or "").strip().casefold() in ("v", "volt", "volts")


def _short(names: Sequence[str]) -> str:
    """Channels for a remark, those of a variable together: `actuator_force[H1, H2]`."""
    together: dict[str, list[str]] = {}
    for name in names:
        variable, _, label = name.rstrip("]").partition("[")
        together.setdefault(variable, []).append(label)
    return ", ".join(f"{v}[{', '.join(labels)}]" if labels[0] else v for v, labels in together.items())


def _source(raws: Sequence[RawTest], raw: RawTest, name: str, number: int, unit: str | None) -> Source:
    alone = sum(other.names.count(name) for other in raws) == 1
    if alone:
        return Source(column=name, unit=unit)
    file = None if len(raws) == 1 else _file_name(raw)
    return Source(column=name if raw.names.count(name) == 1 else number, unit=unit, file=file)


def _file_name(raw: RawTest) -> str:
    return re.split(r"[\\/]", raw.source)[-1]


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
def _channel(name: str, unit: str | None, machine: _Machine) -> tuple[str | None, str | None]:
    """Channel of a column by its name, None if there is none or its unit does not fit; and one that is not known."""
    known, plain = machine.known, without_unit(name)
    own = next((c for c, (v, label) in known.items() if plain in (c, v if label is None else f"{v}_{label}")), None)
    if own:
        return own, None
    words = words_of(plain)
    quantity = quantity_in(words, unit)
    if quantity is None or (is_unlike(words) and quantity != "pressure_difference"):
        return None, None
    channel = _meant(quantity, words, machine)
    if channel is None or channel not in known:
        return None, channel if channel and channel.startswith(_FEW_SENSORS) else None
    si = quantity_unit(unit)
    return (channel if si in (None, channel_unit(channel)) else None), None


def _meant(quantity: str, words: Sequence[str], machine: _Machine) -> str | None:
    """Channel that a quantity and words stand for, be it in the layout or not."""
    wanted, moves = is_wanted(words), quantity in ("displacement", "velocity", "acceleration")
    floor = floor_in(words) if moves else None
    if floor is not None:  # of the specimen, never of the platen
        return f"{_FLOORS}[{floor}]" if quantity == "acceleration" and floor else None
    component = component_in(words, machine.labels)
    if quantity == "pressure" and not component and set(words) & SUPPLY:
        return "supply_pressure"
    actuators = machine.labels.get("actuator", ())
    if not component and len(actuators) == 1 and (not moves or "actuator" in words):
        component = actuators[0]
    if component:
        return _of_component(quantity, component, words, wanted, machine.labels)
    axis = axis_in(words) or (machine.axes[0] if len(machine.axes) == 1 else None)
    if axis is None or (wanted and quantity != "displacement"):
        return None
    return f"{'reference_displacement' if wanted else f'platen_{quantity}'}[{axis}]"


def _of_component(quantity: str, component: str, words: Sequence[str], wanted: bool, labels: Labels) -> str | None:
    if component in labels.get("strut", ()):
        return f"strut_pressure[{component}]" if quantity == "pressure" else None
    if quantity in ("valve_command", "pressure_difference"):
        return f"{quantity}[{component}]"
    if quantity == "spool":
        return f"spool_{'command' if wanted else 'position'}[{component}]"
    if wanted:
        return None
    if quantity == "pressure":
        chamber = chamber_in(words, single=component not in labels.get("horizontal", ()))
        return f"chamber_pressure_{chamber}[{component}]" if chamber else None
    return f"actuator_{quantity}[{component}]"

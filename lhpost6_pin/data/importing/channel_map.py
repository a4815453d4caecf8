"""The channel map: a TOML file that assigns columns of data files to channels of a record.

[test]
name = "EQ1"
valves_per_horizontal_actuator = 1

[channel]
"platen_displacement[x]" = { column = "Long Displ fbk", unit = "in" }
"actuator_force[H1]" = { column = "H1 Force", unit = "kip", sign = -1, gain = 1.002, offset = 3.5 }
"point_acceleration[AX1]" = { column = "A1", unit = "g", point = [0.0, 3.5, -0.5], direction = [1.0, 0.0, 0.0] }
"""

import fnmatch
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, get_args

from ...core.errors import RecordError, instead_of, meant
from ...core.files import read_toml, reason_of, write_whole
from ...core.names import AXES
from ...machine.components import Vec3
from ..channels import LAYOUT, channel_unit
from ..layout_faults import FASTEST, SLOWEST
from .raw import RawTest, shown

__all__ = ["ChannelMap", "Source", "TestFacts", "channels_of", "check_map", "find_column", "load_map", "save_map"]
__all__ += ["source_line", "still_channels", "with_labels"]

_KINDS = {str: "a text", int: "a whole number", float: "a finite number"}

Labels = Mapping[str, Sequence[str]]


@dataclass(frozen=True)
class Source:
    """Source of a channel: a column, or a known constant.

    Its value in SI is sign · gain · (column + offset), offset in the column's unit. `column` is a name, a pattern
    (`Long*fbk`) or the column's number in the file from 1, a column of time counted; `file` a pattern for the file's
    name. The default `unit` is the file's.
    """

    column: str | int | None = None
    unit: str | None = None
    sign: int = 1
    gain: float = 1.0
    offset: float = 0.0
    file: str | None = None
    constant: float | None = None  # in `unit`, instead of a column
    point: Vec3 | None = None  # of an accelerometer, from C in platen axes [m]
    direction: Vec3 | None = None  # of its sensitivity, in platen axes


@dataclass(frozen=True)
class TestFacts:
    """Facts about a test that its files lack."""

    name: str | None = None  # else the first file's name
    kind: str = "measured"
    valves_per_horizontal_actuator: int = 1
    specimen: str = "none"
    rate: float | None = None  # [Hz] of the record; else the highest of the files
    file_rate: float | None = None  # [Hz] of files without time
    fill_gaps: int = 0  # longest run of missing samples that is interpolated

    __test__ = False  # no test of pytest's


@dataclass(frozen=True)
class ChannelMap:
    """Sources by channel, as in `platen_displacement[x]`; `origin` is the map's file, for messages."""

    origin: str
    test: TestFacts
    channels: Mapping[str, Source]


# --------------------------------------------------------------------------------------------- disk
def load_map(path: Path | str) -> ChannelMap:
    """Read a channel map; raises RecordError naming file and key of what cannot be understood."""
    origin = str(path)
    try:
        tree = read_toml(path)
    except OSError as error:
        raise RecordError(f"{origin}: cannot be read: {reason_of(error)}; --guess writes a first map") from None
    except ValueError as error:  # of TOML and of UTF-8
        raise RecordError(f"{origin}: not a TOML file: {error}") from None
    _known(tree, ("test", "channel"), origin)
    sections: dict[str, Any] = {"test": {}, "channel": {}, **tree}
    for name, section in sections.items():
        if not isinstance(section, dict):
            raise RecordError(f"{origin}: {name} must be a section [{name}]")
    if not sections["channel"]:
        raise RecordError(
            f"{origin}: [channel] names no channel; write one, or complete the lines that --guess put there"
        )
    test = _typed(TestFacts, sections["test"], f"{origin}, [test]")
    channels = {}
    for name, entry in sections["channel"].items():
        where = f"{origin}, [channel] {name}"
        if not isinstance(entry, dict):
            raise RecordError(f'{where}: write {{ column = "...", unit = "..." }}')
        channels[name] = _typed(Source, entry, where)
        _check_source(channels[name], where)
    _check_test(test, f"{origin}, [test]")
    return ChannelMap(origin, test, channels)


def save_map(channels: ChannelMap, path: Path | str, remarks: Sequence[str] = ()) -> None:
    """Write a channel map to edit; `remarks` become comment lines at its end, which may be lines to uncomment."""
    test = {f.name: getattr(channels.test, f.name) for f in fields(TestFacts)}
    lines = [
        "# Which column of the data files is which channel of a record. A channel's value in SI is",
        "# sign * gain * (column + offset), offset in the column's unit; constant = 0 instead of a column for what is",
        "# known and was not measured. column is a name, a pattern (Long*fbk) or its number in the",
        "# file from 1, a column of time counted.",
        "",
        "[test]",
        *(f"{key} = {_toml(value)}" for key, value in test.items() if value is not None),
        "",
        "[channel]",
    ]
    lines += [source_line(name, source) for name, source in channels.channels.items()]
    lines += [*(re.sub(r"[\x00-\x1f\x7f]+", " ", f"# {remark}") for remark in remarks)]
    with write_whole(path) as beside:
        beside.write_text("\n".join(lines) + "\n", encoding="utf-8")


def source_line(name: str, source: Source) -> str:
    """Return the line of a map that gives a channel its source."""
    given = {f.name: getattr(source, f.name) for f in fields(Source) if getattr(source, f.name) != f.default}
    return f"{_toml(name)} = {{ {', '.join(f'{key} = {_toml(value)}' for key, value in given.items())} }}"


def _toml(value: object) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


# --------------------------------------------------------------------------------------------- checks
def _known(table: Mapping[str, Any], valid: Sequence[str], where: str) -> None:
    unknown = [key for key in table if key not in valid]
    if unknown:
        raise RecordError(f"{where}: unknown key {unknown[0]!r}; {instead_of(unknown[0], valid)}")


def _typed(cls: type[Any], table: Mapping[str, Any], where: str) -> Any:
    """Fill a dataclass from a TOML table, each value of its field's type."""
    _known(table, [f.name for f in fields(cls)], where)
    values = {}
    for spec in fields(cls):
        if spec.name not in table:
            continue
        value, kinds = table[spec.name], get_args(spec.type) or (spec.type,)
        if spec.name in ("point", "direction"):
            values[spec.name] = _three(value, f"{where}: {spec.name}")
            continue
        if isinstance(value, int) and not isinstance(value, bool) and int not in kinds:
            value = float(value) if float in kinds else value
        endless = isinstance(value, float) and not math.isfinite(value)
        if isinstance(value, bool) or not isinstance(value, kinds) or endless:
            wanted = " or ".join(text for kind, text in _KINDS.items() if kind in kinds)
            raise RecordError(f"{where}: {spec.name} = {value!r} must be {wanted}")
        values[spec.name] = value
    return cls(**values)


def _three(value: Any, where: str) -> Vec3:
    numbers = value if isinstance(value, list) else []
    good = [isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) for x in numbers]
    if len(good) != 3 or not all(good):
        raise RecordError(f"{where} = {value!r} must be three finite numbers, such as [1.0, 0.0, 0.0]")
    x, y, z = map(float, numbers)
    return x, y, z


def _check_source(source: Source, where: str) -> None:
    if (source.column is None) == (source.constant is None):
        raise RecordError(f"{where}: give a column, or else a constant")
    if source.constant is not None and source.unit is None:
        raise RecordError(f"{where}: a constant needs a unit")
    if source.sign not in (-1, 1):
        raise RecordError(f"{where}: sign = {source.sign} must be 1 or -1")
    places = source.point, source.direction
    if any(places) and None in places:
        raise RecordError(f"{where}: an accelerometer needs both point [m] and direction, from C in platen axes")
    if source.direction is not None and not any(source.direction):
        raise RecordError(f"{where}: direction is zero; write one such as [1.0, 0.0, 0.0]")
    if any(places) and not where.partition("[channel] ")[2].startswith("point_acceleration["):
        raise RecordError(f"{where}: point and direction are for point_acceleration[NAME] only")
    if source.gain == 0:
        raise RecordError(f"{where}: gain = 0 leaves nothing; give constant = 0 for a channel that is known to be zero")


def _check_test(test: TestFacts, where: str) -> None:
    rates = f"must be positive, from {SLOWEST:g} to {FASTEST:g} Hz"
    faults = {
        "kind": test.kind not in ("measured", "simulated") and "must be measured or simulated",
        "valves_per_horizontal_actuator": test.valves_per_horizontal_actuator not in (1, 2) and "must be 1 or 2",
        "rate": test.rate is not None and not SLOWEST <= test.rate <= FASTEST and rates,
        "file_rate": test.file_rate is not None and not SLOWEST <= test.file_rate <= FASTEST and rates,
        "fill_gaps": test.fill_gaps < 0 and "must be 0 or more samples",
    }
    for key, fault in faults.items():
        if fault:
            raise RecordError(f"{where}: {key} = {getattr(test, key)!r} {fault}")


# --------------------------------------------------------------------------------------------- meaning
def channels_of(labels: Labels) -> dict[str, tuple[str, str | None]]:
    """All channels that a record of a machine can have, in order: variable and label by name."""
    known = {"axis": AXES, **labels}
    found: dict[str, tuple[str, str | None]] = {}
    for variable, channel in LAYOUT.items():
        if len(channel.dims) == 1:
            found[variable] = variable, None
        else:
            found |= {f"{variable}[{label}]": (variable, label) for label in known.get(channel.dims[1], ())}
    return found


def with_labels(labels: Labels, names: Sequence[str]) -> dict[str, Sequence[str]]:
    """Labels, and those that the `names` of channels give along dimensions that are not the machine's: floors."""
    found: dict[str, list[str]] = {}
    for name in names:
        variable, _, label = name.rstrip("]").partition("[")
        dims = LAYOUT[variable].dims[1:] if variable in LAYOUT else ()
        if label and dims and dims[0] not in ("axis", *labels):
            found.setdefault(dims[0], []).append(label)
    return {**labels, **{dim: list(dict.fromkeys(own)) for dim, own in found.items()}}


def still_channels(labels: Labels, moves: Sequence[str] = AXES) -> tuple[str, ...]:
    """Channels along axes in which the platen cannot move, where it `moves` in some: zero unless they are mapped."""
    every = channels_of(labels).items()
    return tuple(name for name, (v, label) in every if "axis" in LAYOUT[v].dims and label not in moves)


def check_map(channels: ChannelMap, labels: Labels, moves: Sequence[str] = AXES) -> None:
    """Raise RecordError for a channel that no record of the machine has, or a variable with a channel missing.

    Axes in which the platen cannot move, those not in `moves`, may be missing.
    """
    known, still = channels_of(labels), still_channels(labels, moves)
    where = f"{channels.origin}, [channel]"
    for name in channels.channels:
        if name not in known:
            near = [other for other in known if other.split("[")[0] == name.split("[")[0]]
            valid = near or list(dict.fromkeys(variable for variable, _ in known.values()))
            raise RecordError(f"{where} {name}: is no channel of a record; {instead_of(name, valid)}")
    for variable in dict.fromkeys(known[name][0] for name in channels.channels):
        every = {name: str(label) for name, (v, label) in known.items() if v == variable}
        missing = [name for name in every if name not in channels.channels and name not in still]
        if missing:
            have = ", ".join(label for name, label in every.items() if name not in missing)
            lacks, unit = ", ".join(every[name] for name in missing), channel_unit(missing[0])
            raise RecordError(
                f"{where}: {variable} has {have}, but not {lacks}; map them too, or omit {variable}, or give "
                f'{{ constant = 0, unit = "{unit}" }} for what is known to be zero'
            )


def find_column(source: Source, raws: Sequence[RawTest], where: str) -> tuple[int, int]:
    """File and column of a source; raises RecordError if there is none, or more than one."""
    files = [k for k, raw in enumerate(raws) if _like(Path(raw.source).name, source.file or "*")]
    if not files:
        raise RecordError(f"{where}: no file is called {source.file!r}; files are {shown([r.source for r in raws])}")
    if isinstance(source.column, int):
        first = raws[files[0]]
        if len(files) > 1:
            raise RecordError(f'{where}: column {source.column} of which file? add file = "..."')
        if source.column not in first.numbers:
            held = ", ".join(f"{n} {name!r}" for n, name in zip(first.numbers[:12], first.names, strict=False))
            more = "" if len(first.numbers) <= 12 else f" to {first.numbers[-1]}"
            raise RecordError(
                f"{where}: column {source.column} of {first.source} is no channel; these are {held}{more}"
            )
        return files[0], first.numbers.index(source.column)
    every = [(k, j, name) for k in files for j, name in enumerate(raws[k].names)]
    wanted, names = str(source.column), [name for *_, name in every]
    found = [(k, j) for k, j, name in every if (name == wanted if wanted in names else _like(name, wanted))]
    if len(found) == 1:
        return found[0]
    if not found:
        near, files_ = meant(wanted, names), shown([raws[k].source for k in files])
        raise RecordError(f"{where}: no column {wanted!r} in {files_}; {near}columns are {shown(names, 40)}")
    places = ", ".join(
        f"{Path(raws[k].source).name} column {raws[k].numbers[j]} {raws[k].names[j]!r}" for k, j in found[:6]
    )
    raise RecordError(f'{where}: {wanted!r} could be any of {places}; give the column\'s number, or file = "..."')


def _like(name: str, pattern: str) -> bool:
    return name == pattern or fnmatch.fnmatchcase(name, pattern)

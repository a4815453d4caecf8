"""Content of a data file before its channels are mapped: named columns, their units as written, time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module

from ...core.arrays import Array
from ...core.errors import RecordError
from ...core.optional import INSTALL

__all__ = ["RawTest", "make_raw", "need_package", "shown"]


@dataclass(frozen=True)
class RawTest:
    """Columns of one file that were sampled together.

    `names` and `units` (k,) are as written in the file, a unit is None where the file gives none. `values` (n, k) are
    in those units, NaN where a sample is missing. `time` (n,) [s] is None where the file has none. `facts` are the
    other attributes of the file. `numbers` (k,) are the columns' places in the file from 1, a column of time counted.
    """

    source: str
    form: str
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    values: Array
    time: Array | None
    facts: Mapping[str, str]
    numbers: tuple[int, ...]


def make_raw(
    source: str,
    form: str,
    names: Sequence[str],
    units: Sequence[str | None],
    values: Array,
    time: Array | None,
    facts: Mapping[str, str] | None = None,
    *,
    numbers: Sequence[int] | None = None,
) -> RawTest:
    """Make a `RawTest`, its columns numbered as they come unless `numbers` (k,) are given.

    Raises RecordError if there is no channel, or fewer than two samples.
    """
    if not names:
        raise RecordError(f"{source}: holds no channel; a test needs at least one column beside time")
    if len(values) < 2:
        raise RecordError(f"{source}: holds {len(values)} sample(s); a test needs at least two")
    tidy = tuple(unit.strip() or None if unit else None for unit in units)
    every = tuple(range(1, len(names) + 1) if numbers is None else numbers)
    return RawTest(source, form, tuple(name.strip() for name in names), tidy, values, time, dict(facts or {}), every)


def shown(names: Sequence[str], most: int = 12) -> str:
    """Return the first few names for a message."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(repr(name[:60]) for name in names[:most]) + more


def need_package(name: str, job: str) -> None:
    """Raise RecordError if an optional package is not installed."""
    try:
        import_module(name)
    except ModuleNotFoundError as error:
        raise RecordError(f"{job} needs {name}: {INSTALL[name]}") from error

"""Campaigns: tests of one machine in one state, in one folder."""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from ..core.errors import RecordError
from ..machine.machine import Machine
from .layout_faults import layout_faults
from .records import load_record, save_record

__all__ = ["Campaign", "SkippedTest", "load_campaign", "save_campaign", "skipped_summary"]

log = logging.getLogger(__name__)


class SkippedTest(NamedTuple):
    """A test that is not used, and why."""

    test: str
    why: str


class Campaign(NamedTuple):
    """Tests of one machine in one state."""

    name: str
    records: tuple[xr.Dataset, ...]
    skipped: tuple[SkippedTest, ...] = ()


def load_campaign(folder: Path | str, machine: Machine) -> Campaign:
    """Read all records (.nc) of a folder, in the order of their names; a record without a name is called by its file.

    A damaged record, or one that breaks the layout, is skipped with a warning. Raises RecordError naming the folder if
    it is none or holds no record, the file of a record of another machine or of the first if all are damaged, and tests
    that differ in their open servovalves or specimen.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise RecordError(f"{folder}: not a directory; a campaign is a directory of records (.nc) of the same machine")
    files = sorted(folder.glob("*.nc"))
    if not files:
        raise RecordError(f"{folder}: holds no record (.nc); import measured data with `lhpost6 import`")
    records: dict[Path, xr.Dataset] = {}
    skipped: list[SkippedTest] = []
    for path in files:
        try:
            record = load_record(path)
        except RecordError as error:
            skipped.append(SkippedTest(path.stem, str(error)))
            continue
        if faults := layout_faults(record, machine.labels):
            raise RecordError(f"{path}: {faults[0]}")
        record.attrs.setdefault("test", path.stem)
        records[path] = record
    if not records:
        raise RecordError(skipped[0].why)
    for one in skipped:
        log.warning("test %s is skipped: %s", one.test, one.why)
    for fact in ("valves_per_horizontal_actuator", "specimen"):
        found = {str(r.attrs.get(fact, "not stated")): path.name for path, r in records.items()}
        if len(found) > 1:
            stated = "; ".join(f"{name}: {value}" for value, name in found.items())
            why = "a campaign is of one machine in one state: give each state a folder, or correct the attribute"
            raise RecordError(f"{folder}: tests differ in {fact} ({stated}); {why}")
    return Campaign(folder.resolve().name, tuple(records.values()), tuple(skipped))


def skipped_summary(skipped: Sequence[SkippedTest]) -> str:
    """Which tests are not used, and why, in a sentence; empty where all are."""
    return f"Skipped: {'; '.join(f'{test} ({why})' for test, why in skipped)}." if skipped else ""


def save_campaign(campaign: Campaign, folder: Path) -> list[Path]:
    """Write each record as TEST.nc; returns the paths. Raises RecordError for one that breaks the layout."""
    paths = [folder / f"{record.attrs['test']}.nc" for record in campaign.records]
    for record, path in zip(campaign.records, paths, strict=True):
        save_record(record, path)
    return paths

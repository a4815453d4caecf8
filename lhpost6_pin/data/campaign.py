"""Campaigns: tests of one machine in one state, in one folder."""

from pathlib import Path
from typing import NamedTuple

import xarray as xr

from ..core.errors import RecordError
from ..machine.machine import Machine
from .records import load_record, save_record

__all__ = ["Campaign", "load_campaign", "save_campaign"]


class Campaign(NamedTuple):
    """Tests of one machine in one state."""

    name: str
    records: tuple[xr.Dataset, ...]


def load_campaign(folder: Path | str, machine: Machine) -> Campaign:
    """Read all records (.nc) of a folder, in the order of their names; a record without a name is called by its file.

    Raises RecordError naming the folder if it is none or holds no record, the file of a record that breaks the layout
    or is of another machine, and tests that differ in their open servovalves or specimen.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise RecordError(f"{folder}: not a directory; a campaign is a directory of records (.nc) of the same machine")
    files = sorted(folder.glob("*.nc"))
    if not files:
        raise RecordError(f"{folder}: holds no record (.nc); import measured data with `lhpost6 import`")
    records = []
    for path in files:
        record = load_record(path, machine.labels)
        record.attrs.setdefault("test", path.stem)
        records.append(record)
    for fact in ("valves_per_horizontal_actuator", "specimen"):
        found = {str(r.attrs.get(fact, "not stated")): p.name for r, p in zip(records, files, strict=True)}
        if len(found) > 1:
            stated = "; ".join(f"{name}: {value}" for value, name in found.items())
            why = "a campaign is of one machine in one state: give each state a folder, or correct the attribute"
            raise RecordError(f"{folder}: tests differ in {fact} ({stated}); {why}")
    return Campaign(folder.resolve().name, tuple(records))


def save_campaign(campaign: Campaign, folder: Path) -> list[Path]:
    """Write each record as TEST.nc; returns the paths. Raises RecordError for one that breaks the layout."""
    paths = [folder / f"{record.attrs['test']}.nc" for record in campaign.records]
    for record, path in zip(campaign.records, paths, strict=True):
        save_record(record, path)
    return paths

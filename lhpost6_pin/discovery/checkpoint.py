"""A search that was interrupted goes on where it stood: what it has is kept in a file until it has ended."""

import hashlib
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import joblib

from .. import __version__
from ..core.files import write_whole
from ..data.sensors import SensorSet
from ..machine.machine import Machine
from ..machine.machine_toml import machine_toml
from .search_state import Search

__all__ = ["Checkpoint", "SearchCheckpoint", "make_checkpoint"]


log = logging.getLogger(__name__)


class SearchCheckpoint(NamedTuple):
    """Where a search stands between two steps."""

    machine: Machine  # as delivered, in the state that was tested
    held: tuple[int, ...]  # places of the tests that are held out
    search: Search


@dataclass(frozen=True)
class Checkpoint:
    """Keeps the place of one search; without a path it keeps nothing."""

    path: Path | None

    def read(self) -> SearchCheckpoint | None:
        """The place that was kept last; None if there is none."""
        if self.path is None or not self.path.is_file():
            return None
        place: SearchCheckpoint = joblib.load(self.path)
        log.warning("goes on where the search was interrupted, with %d effects found", len(place.search.added))
        return place

    def write(self, place: SearchCheckpoint) -> None:
        """Keep a place, whole or not at all."""
        if self.path is not None:
            with write_whole(self.path) as beside:
                joblib.dump(place, beside)

    def remove(self) -> None:
        """Keep nothing any more: the search has ended."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)


def make_checkpoint(
    folder: Path | None,
    machine: Machine,
    sensors: SensorSet,
    hashes: Mapping[str, str],
    hold_out: Sequence[str] | None,
    seed: int,
) -> Checkpoint:
    """A bookmark in a folder for a search with these inputs, named by them: any other search does not see it.

    No effect made by hand has a name that says what it does: a machine with one gets a bookmark that keeps nothing.
    """
    if folder is None or machine.own_effects:
        return Checkpoint(None)
    inputs = (__version__, machine_toml(machine), repr(machine.specimen), repr(sensors), dict(hashes), hold_out, seed)
    digest = hashlib.sha256(repr(inputs).encode()).hexdigest()
    return Checkpoint(folder / f".unfinished-{digest[:16]}.joblib")

"""Checkpoint of a search: an interrupted search resumes from it and reaches the same verdict."""

import hashlib
import logging
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from ..core.files import sources_digest, write_whole
from ..identification.calibration.problem import Problem
from ..machine.machine import Machine
from ..machine.machine_toml import machine_toml
from .search_state import Search

__all__ = ["Checkpoint", "SearchCheckpoint", "make_checkpoint"]

log = logging.getLogger(__name__)


class SearchCheckpoint(NamedTuple):
    """State of a search between two steps."""

    machine: Machine  # as delivered, in the state that was tested
    held: tuple[int, ...]  # places of the tests that are held out
    held_problem: Problem | None  # those tests with the noise of all; None without any
    search: Search


@dataclass(frozen=True)
class Checkpoint:
    """File that holds the state of one search; without a path nothing is written."""

    path: Path | None

    def read(self) -> SearchCheckpoint | None:
        """The last state; None if there is none."""
        if self.path is None or not self.path.is_file():
            return None
        with self.path.open("rb") as file:
            state: SearchCheckpoint = pickle.load(file)
        log.warning("resuming the interrupted search, with %d effects found", len(state.search.added))
        return state

    def write(self, state: SearchCheckpoint) -> None:
        """Write a state, whole or not at all."""
        if self.path is not None:
            with write_whole(self.path) as beside, beside.open("wb") as file:
                pickle.dump(state, file, pickle.HIGHEST_PROTOCOL)  # many small arrays, which joblib writes one by one

    def remove(self) -> None:
        """Remove the file: the search has ended."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)


def make_checkpoint(folder: Path | None, machine: Machine, *inputs: object) -> Checkpoint:
    """A checkpoint in a folder for a search with a machine and other inputs, named by the hash of their `repr`.

    Another state of the package does not find it, as its objects may differ from those pickled. An effect made by hand
    cannot be hashed: a machine with one gets a checkpoint without a path.
    """
    if folder is None or machine.own_effects:
        return Checkpoint(None)
    known = repr((sources_digest(), machine_toml(machine), machine.specimen, *inputs))
    return Checkpoint(folder / f".unfinished-{hashlib.sha256(known.encode()).hexdigest()[:16]}.pickle")

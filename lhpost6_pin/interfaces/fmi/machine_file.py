"""A machine with all that was changed on it, as files in a folder: what an FMU carries of its machine."""

import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ... import __version__
from ...core.errors import ParameterError
from ...effects.effect import Effect
from ...machine.machine import Machine, build_machine
from ...machine.parameters import EffectEntry, Parameters, Quantity
from ...machine.specimen import Specimen
from ...machine.user_specimen import UserSpecimen

__all__ = ["MACHINE_FILE", "load_machine_file", "save_machine_file"]

MACHINE_FILE = "machine.json"


def save_machine_file(machine: Machine, folder: Path) -> list[Path]:
    """Write a machine, and its specimen's files if it carries one, into a folder; returns the files.

    Numbers are written so that they read back to the last bit.
    """
    known: dict[str, Any] = {
        "lhpost6_pin": __version__,
        "origin": machine.parameters.origin,
        "words": dict(machine.parameters.words),
        "quantities": {path: asdict(quantity) for path, quantity in machine.parameters.items()},
        "effects": {name: asdict(entry) for name, entry in machine.parameters.effects.items()},
        "own_effects": [asdict(effect) for effect in machine.own_effects],
    }
    files = [folder / MACHINE_FILE]
    if isinstance(machine.specimen, UserSpecimen):
        raise ParameterError(
            f"{machine.specimen.source}: an FMU carries numbers, not a specimen in Python; export the table without it "
            "and couple it through the inputs interface_wrench_*"
        )
    if machine.specimen is not None:
        file = machine.specimen.file
        if not file.is_file():
            raise ParameterError(f"{file}: no such {'URDF' if file.suffix == '.urdf' else 'specimen'} file")
        known["specimen"] = {**asdict(machine.specimen), "file": file.name}
        files += [Path(shutil.copy2(each, folder)) for each in machine.specimen.files]
    files[0].write_text(json.dumps(known, indent=1), encoding="utf-8")
    return files


def load_machine_file(folder: Path) -> tuple[Machine, str]:
    """Read a machine that `save_machine_file` wrote, and the version of lhpost6_pin that wrote it."""
    known = json.loads((folder / MACHINE_FILE).read_text(encoding="utf-8"), object_hook=_with_tuples)
    effects = {
        name: EffectEntry(entry["family"], entry["components"], _quantities(entry["values"]))
        for name, entry in known["effects"].items()
    }
    specimen = None
    if entry := known.get("specimen"):
        entry = dict(entry)
        name = entry.pop("urdf", None) or entry.pop("file")  # FMUs of older versions carry a URDF
        specimen = Specimen(folder / name, **entry)
    machine = build_machine(
        Parameters(_quantities(known["quantities"]), known["words"], known["origin"], effects),
        added_effects=tuple(Effect(**entry) for entry in known["own_effects"]),
        specimen=specimen,
    )
    return machine, known["lhpost6_pin"]


def _quantities(entries: Mapping[str, Any]) -> dict[str, Quantity]:
    return {path: Quantity(**entry) for path, entry in entries.items()}


def _with_tuples(entry: dict[str, Any]) -> dict[str, Any]:
    """Entry with tuples in place of the lists that JSON makes of them."""

    def again(value: Any) -> Any:
        return tuple(map(again, value)) if isinstance(value, list) else value

    return {key: again(value) for key, value in entry.items()}

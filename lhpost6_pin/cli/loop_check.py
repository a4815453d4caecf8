"""The control loop checked before a run: stability and margins with the mounted specimen, and what mends them."""

import logging
import shlex
import time
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import ParameterError
from .app import progress_bar, repeating_command, stderr
from .options import SpecimenOptions

if TYPE_CHECKING:
    from ..control import ControllerSettings
    from ..control.inverse import InverseFilter
    from ..control.plug import UserController
    from ..machine.machine import Machine
    from ..tuning.interaction import Interaction
    from ..tuning.stability import LoopCheck
    from ..tuning.tune import Tuning

log = logging.getLogger(__name__)

LOOP_FACTS = ("loop", "loop_summary", "loop_remedy")
"""Attributes of a record on its control loop; a remedy only where it is not stable."""

TUNING_FILES = ("controller.toml", "tuning.html")
"""What `retuned` writes."""

__all__ = ["TUNING_FILES", "checked_loop", "interaction_of", "loop_entries", "loop_facts", "retuned"]


def checked_loop(
    table: "Machine", settings: "ControllerSettings | UserController", machine: SpecimenOptions, *, retune: bool = False
) -> "LoopCheck | None":
    """Stability and margins of the 469D on a table; a warning with the remedy if they are unstable or thin.

    None for a user's own controller, of which no linear model is known. `retune`: the command has an option --retune.
    """
    from ..control import ControllerSettings, controlled
    from ..tuning.stability import check_loop

    if not isinstance(settings, ControllerSettings):
        return None
    _, _, controller = controlled(table, settings)
    found = check_loop(controller)
    if found.falls:
        log.warning("%s", found.summary)
    elif found.verdict != "stable":
        again = f", or repeat with --retune: `{repeating_command()} --retune`" if retune else ""
        log.warning("%s. Tune the controller for this table: `%s`%s", found.summary, _remedy(machine), again)
    return found


def loop_facts(found: "LoopCheck | None", machine: SpecimenOptions) -> dict[str, Any]:
    """Attributes of a record on the loop that it was made with."""
    if found is None:
        return {}
    facts = {"loop": found.verdict, "loop_summary": found.summary}
    return facts if found.falls or found.verdict == "stable" else {**facts, "loop_remedy": _remedy(machine)}


def loop_entries(attrs: Mapping[str, Any]) -> dict[str, Any]:
    """What attributes of a record state on its control loop, for `--json`; None where they do not."""
    return {key: attrs.get(key) for key in LOOP_FACTS}


def retuned(
    table: "Machine", settings: "ControllerSettings | UserController", folder: Path, leave_out: Collection[str] = ()
) -> tuple["ControllerSettings", "Tuning", list[Path]]:
    """Settings tuned for a table with its specimen; writes those of `TUNING_FILES` that are not left out.

    Says the time it took.
    """
    from dataclasses import replace

    from ..control import ControllerSettings, save_controller
    from ..show.report.tune_report import write_tune_report
    from ..tuning.tune import tune

    if not isinstance(settings, ControllerSettings):
        raise ParameterError("--retune tunes the 469D; a controller of your own is not tuned")
    load = table.specimen.name if table.specimen else "bare"
    start = time.perf_counter()
    with progress_bar(f"tuning for {table.name}, {load}") as progress:
        found = tune(table, settings, progress=progress)
    stderr().print(f"tuned for {table.name}, {load}, in {time.perf_counter() - start:.0f} s", markup=False)
    tuned = replace(found.after, name=f"tuned for {table.name}, {load}")
    settings_file, report = (folder / name for name in TUNING_FILES)
    save_controller(tuned, settings_file, f"lhpost6 run --retune on {table.name}, {load}")
    if report.name in leave_out:
        return tuned, found, [settings_file]
    write_tune_report(found, report, command=repeating_command())
    return tuned, found, [settings_file, report]


def interaction_of(
    table: "Machine",
    before: "ControllerSettings | UserController",
    used: "ControllerSettings | UserController",
    inverse: "InverseFilter | None",
) -> "Interaction | None":
    """Interaction of table and specimen under the 469D; None for a bare table or a user's own controller.

    before: settings that were not used, if they differ: those before tuning, else those that the machine names.
    """
    from ..control import ControllerSettings, load_controller
    from ..tuning.interaction import find_interaction

    if table.specimen is None or not isinstance(used, ControllerSettings):
        return None
    if before == used and table.controller:
        before = load_controller(table.controller)
    return find_interaction(table, used, before if isinstance(before, ControllerSettings) else None, inverse)


def _remedy(machine: SpecimenOptions) -> str:
    return shlex.join(["lhpost6", "tune", *machine.words])

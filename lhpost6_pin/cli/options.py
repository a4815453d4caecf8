"""Options shared by commands, and the machine, motion and controller that they select."""

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import MotionError, ParameterError
from .completion import (
    complete_controller,
    complete_engine,
    complete_machine,
    complete_motion,
    complete_scheme,
    complete_sensors,
    complete_specimen,
)

if TYPE_CHECKING:
    from ..control import ControllerSettings
    from ..control.plug import UserController
    from ..machine.machine import Machine
    from ..motions import GroundMotion, Target

log = logging.getLogger(__name__)

__all__ = ["Axes", "Beyond", "ControllerName", "EngineName", "HighPass", "Locked", "LowPass", "MachineName", "Motion"]
__all__ += [
    "Json",
    "Out",
    "Override",
    "Rate",
    "Scale",
    "Scheme",
    "Set",
    "SettingsName",
    "SpecimenAt",
    "SpecimenName",
    "Valves",
]
__all__ += ["find_controller", "find_machine", "find_settings", "find_target", "find_table", "folder_for"]
__all__ += ["refuse_no_jobs", "refuse_stepping"]

MachineName = Annotated[
    str, typer.Option("--machine", help="Shipped machine name, or a TOML file.", autocompletion=complete_machine)
]
Override = Annotated[
    Path | None, typer.Option("--override", help="TOML file with parameters to replace, effects to add.")
]
Scheme = Annotated[
    str,
    typer.Option(help="Integration scheme: semi_implicit, euler or rk4.", autocompletion=complete_scheme),
]
Rate = Annotated[int, typer.Option(help="Model steps per second, a multiple of 2048.")]
EngineName = Annotated[
    str,
    typer.Option("--engine", help="pinocchio (per step) or fused (one compiled loop).", autocompletion=complete_engine),
]
SpecimenName = Annotated[
    str | None,
    typer.Option(
        "--specimen",
        help="Specimen bolted to the platen: shipped name, or a URDF file.",
        autocompletion=complete_specimen,
    ),
]
SpecimenAt = Annotated[
    str | None,
    typer.Option("--specimen-at", help=r"Place of its root from C: x,y,z \[m], or with roll,pitch,yaw \[rad]."),
]
Locked = Annotated[bool, typer.Option("--locked", help="Lock the specimen's joints: one rigid body.")]
SensorsName = Annotated[
    str,
    typer.Option(
        "--sensors",
        help="Noise and calibration ranges of the sensors: shipped name, or a TOML file.",
        autocompletion=complete_sensors,
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON and nothing else.")]
Out = Annotated[Path | None, typer.Option(help="Directory of the results; default: out/NAME.")]
Valves = Annotated[
    int, typer.Option(min=0, max=2, help="Open servovalves per horizontal actuator; 0: as in the machine file.")
]
Motion = Annotated[
    list[str],
    typer.Argument(help="Name (see `lhpost6 motions`), file(s), or name and file(s).", autocompletion=complete_motion),
]
Scale = Annotated[float, typer.Option(help="Scale factor of the motion.")]
Axes = Annotated[str | None, typer.Option(help="Axes, such as xyz, x, or x=y (the table's x moved by component y).")]
HighPass = Annotated[float | None, typer.Option(help="High-pass corner of the motion [Hz].")]
LowPass = Annotated[float | None, typer.Option(help="Low-pass corner of the motion [Hz].")]
Set = Annotated[list[str] | None, typer.Option("--set", help="Option of a generated motion, key=value.")]
Beyond = Annotated[bool, typer.Option("--beyond-limits", help="Run a motion beyond the limits of the table.")]
SettingsName = Annotated[
    str | None,
    typer.Option(
        "--controller",
        help="Controller settings: name or TOML file; default: those of the machine.",
        autocompletion=complete_controller,
    ),
]
ControllerName = Annotated[
    str | None,
    typer.Option(
        "--controller",
        help="Controller settings: name or TOML file; or your own, FILE.py:NAME.",
        autocompletion=complete_controller,
    ),
]


def find_machine(name: str, override: Path | None) -> "Machine":
    """Machine by shipped name or file, with the numbers of an override file."""
    from ..machine.machine import load_machine

    return load_machine(name, override)


def find_table(
    machine: str, override: Path | None, valves: int, specimen: str | None, at: str | None, locked: bool
) -> "Machine":
    """Machine with its open valves and its specimen, if any; warnings about the specimen are logged."""
    from ..mechanics.plant import make_plant
    from ..mechanics.specimen_joints import specimen_doubts

    table = find_machine(machine, override).with_valves(valves)
    if specimen is None:
        if locked or at:
            raise ParameterError("--locked and --specimen-at are about a specimen; name it with --specimen")
        return table
    try:
        place = [float(x) for x in at.split(",")] if at else [0.0] * 3
    except ValueError:
        place = []
    if len(place) not in (3, 6):
        raise ParameterError(f"--specimen-at {at}: write x,y,z in metres, or x,y,z,roll,pitch,yaw with radians")
    x, y, z, roll, pitch, yaw = (*place, 0.0, 0.0, 0.0)[:6]
    loaded = table.with_specimen(specimen, (x, y, z), (roll, pitch, yaw), locked=locked)
    for doubt in specimen_doubts(make_plant(loaded)):
        log.warning("%s", doubt)
    return loaded


def find_settings(name: str | None, table: "Machine") -> "ControllerSettings":
    """Settings by name or file; default: those named by the machine."""
    from ..control import load_controller
    from ..control.plug import is_plugged

    if name and is_plugged(name):
        raise ParameterError(
            f"--controller {name}: this command works with the 469D's own settings, a name or a TOML file; "
            "your own controller goes with `lhpost6 run` and `lhpost6 link`"
        )
    chosen = name or table.controller
    if not chosen:
        raise ParameterError(f"{table.name} names no controller; give one with --controller")
    return load_controller(chosen)


def find_controller(name: str | None, table: "Machine") -> "ControllerSettings | UserController":
    """A user's own controller as FILE.py:NAME, else settings as `find_settings`."""
    from ..control.plug import is_plugged, load_plugged

    return load_plugged(name) if name and is_plugged(name) else find_settings(name, table)


def find_target(
    names: list[str],
    settings: list[str] | None,
    table: "Machine",
    *,
    scale: float,
    axes: str | None,
    high_pass: float | None = None,
    low_pass: float | None = None,
) -> "Target":
    """Target at the controller's rate from a motion by name, file(s), or name and file(s)."""
    from ..core.names import SAMPLE_RATE
    from ..motions import make_target

    ground = _motion(names, settings or [])
    own = None if table.motion == "free" else table.motion
    return make_target(
        ground, scale=scale, axes=axes or own, high_pass=high_pass, low_pass=low_pass, rate=float(SAMPLE_RATE)
    )


def refuse_no_jobs(jobs: int, what: str = "threads") -> None:
    """Raise ParameterError for zero jobs; `what` is the unit in the message."""
    if jobs == 0:
        raise ParameterError(f"--jobs 0: give a number of {what}, or -1 for as many as there are cores")


def refuse_stepping(
    table: "Machine",
    scheme: str,
    rate: int,
    engine: str,
    controller: "ControllerSettings | UserController | None" = None,
) -> None:
    """Raise the errors of `simulate` for invalid options before anything long begins."""
    from ..control import ControllerSettings
    from ..mechanics.plant import make_plant
    from ..simulation.simulate import check_options

    plugged = controller is not None and not isinstance(controller, ControllerSettings)
    check_options(make_plant(table), scheme=scheme, steps_per_second=rate, engine=engine, plugged=plugged)


def folder_for(out: Path | None, name: str) -> Path:
    """Directory of the results, out/NAME by default; raises OSError at once if it cannot be written."""
    from ..core.files import refuse_folder

    folder = out or Path("out") / name
    refuse_folder(folder)
    return folder


def _motion(names: list[str], settings: list[str]) -> "GroundMotion":
    """Motion by name, from one file or three component files, or by name from such files."""
    from ..motions import find_motion, load_motion

    options: dict[str, Any] = {}
    for item in settings:
        key, equals, value = item.partition("=")
        if not equals:
            raise MotionError(f"--set {item}: write key=value")
        options[key.strip()] = _number_or_text(value.strip())
    first, *files = names
    if not _is_file(first) and files and not any(map(_is_file, files)):
        raise MotionError(f"one motion at a time; got {', '.join(names)}, none of which is a file")
    return load_motion(names, **options) if _is_file(first) else find_motion(first, files, **options)


def _is_file(name: str) -> bool:
    return bool(Path(name).suffix) or Path(name).is_file()


def _number_or_text(text: str) -> int | float | str:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text

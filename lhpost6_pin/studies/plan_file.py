"""A plan of an ensemble from a TOML file.

    name = "suite"
    machine = "lhpost6"                  # shipped name, or a file beside the plan; `override`, a file, on top
    machines = 200                       # drawn from the stated uncertainties; 1: as stated
    draw = "lhs"                         # or "sobol"; with `seed`
    uncertain = ["*"]                    # patterns of the numbers drawn
    scales = [0.5, 0.75, 1.0]
    quantities = ["tracking", "limits", "forces", "spectra", "base"]

    [[motion]]                           # name or files; label, axes, high_pass, low_pass, options
    name = "ridgecrest"                  # rotate_by [deg], time_scale, match_spectrum (a file), spectrum_damping
                                         # taper [s]; of files dt [s], unit, channels, rotate [deg], rotation_factor

    [[specimen]]                         # name or file ("none": bare table); label, at, rpy, locked
    name = "none"

    [[controller]]                       # name or file; label
    name = "lhpost6"

The command line makes a mapping of the same entries from its options.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..control import load_controller
from ..core.errors import ParameterError, instead_of
from ..core.files import models_folder, read_toml, reason_of
from ..core.names import SAMPLE_RATE, SCHEMES
from ..data.motion_files import motion_of
from ..machine.machine import Machine, load_machine
from ..machine.parameters import load_parameters
from ..motions import adjust_motion, load_spectrum
from .draws import DESIGNS, draw_machines
from .plan import EnsemblePlan, PlannedMotion
from .quantities import DEFAULT

__all__ = ["NONE", "OF_FILES", "beside", "load_plan", "plan_from"]

OF_FILES = {"dt": "time_step", "unit": "units", "channels": "channels", "rotate": "rotate"}
OF_FILES |= {"rotation_factor": "rotation_factor"}
"""Keys of a motion from files, named as the options of commands, with the options of `load_motion` that they are."""

NONE = "none"
"""Name of the specimen of a bare table."""

_KINDS: Mapping[str, tuple[type, ...]] = {
    **dict.fromkeys(("name", "machine", "override", "draw", "engine", "scheme"), (str,)),
    **dict.fromkeys(("machines", "seed", "rate"), (int,)),
    **dict.fromkeys(("uncertain", "scales", "quantities", "motion", "specimen", "controller"), (list,)),
}
_MOTION: Mapping[str, tuple[type, ...]] = {
    **dict.fromkeys(("name", "label", "axes", "match_spectrum", "unit", "channels"), (str,)),
    **dict.fromkeys(("high_pass", "low_pass", "rotate_by", "time_scale", "taper", "spectrum_damping"), (float, int)),
    **dict.fromkeys(("dt", "rotate", "rotation_factor"), (float, int)),
    "files": (list,),
    "options": (dict,),
}
_SPECIMEN: Mapping[str, tuple[type, ...]] = {
    **dict.fromkeys(("name", "label"), (str,)),
    **dict.fromkeys(("at", "rpy"), (list,)),
    "locked": (bool,),
}
_CONTROLLER: Mapping[str, tuple[type, ...]] = dict.fromkeys(("name", "label"), (str,))


def load_plan(path: Path, given: Mapping[str, Any] | None = None) -> EnsemblePlan:
    """Read the plan in a TOML file, some entries replaced by those given; files that it names are beside it.

    Raises ParameterError that names the file and the key of what is wrong, and what the parts of the plan raise.
    """
    try:
        entries = read_toml(path)
    except (OSError, ValueError) as error:
        raise ParameterError(f"{path}: {reason_of(error)}") from error
    return plan_from({"name": path.stem, **entries, **(given or {})}, path.parent, str(path))


def plan_from(entries: Mapping[str, Any], folder: Path, source: str) -> EnsemblePlan:
    """The plan of some entries, as in a file, whose files are in a folder; `source` names them in messages.

    Raises ParameterError for a key that does not exist or a value of another kind; what its parts raise.
    """
    _check(entries, _KINDS, source)
    if not entries.get("motion"):
        raise ParameterError(f"{source}: has no [[motion]]; name one at least")
    numbers = load_parameters(models_folder() / "procedures" / "ensemble.toml")
    override = entries.get("override")
    machine = load_machine(beside(folder, entries.get("machine", "lhpost6")), override and folder / override)
    draws = draw_machines(
        machine,
        _at_least(1, entries, "machines", 1, source),
        design=entries.get("draw", DESIGNS[0]),
        seed=_at_least(0, entries, "seed", 0, source),
        reach=numbers.number("draw.reach"),
        uncertain=entries.get("uncertain", ["*"]),
    )
    default = [{"name": machine.controller}] if machine.controller else []
    return EnsemblePlan(
        name=entries.get("name", "ensemble"),
        machine=machine,
        draws=draws,
        motions=_labelled([_motion(one, folder, source) for one in entries["motion"]], "motion", source),
        scales=tuple(map(float, entries.get("scales", [1.0]))),
        specimens=_labelled(
            [_specimen(machine, one, folder, source) for one in entries.get("specimen", [{"name": NONE}])],
            *("specimen", source),
        ),
        controllers=_labelled(
            [_controller(one, folder, source) for one in entries.get("controller", default)], "controller", source
        ),
        groups=tuple(entries.get("quantities", DEFAULT)),
        numbers=numbers,
        scheme=entries.get("scheme", SCHEMES[0]),
        steps_per_second=_at_least(1, entries, "rate", 4 * SAMPLE_RATE, source),
        engine=entries.get("engine"),
    )


def beside(folder: Path, name: str) -> str:
    """A shipped name as it is, a file (with what follows a colon) with a folder before it."""
    file, colon, rest = name.partition(":")
    return f"{folder / file}{colon}{rest}" if Path(file).suffix else name


def _check(entries: Mapping[str, Any], kinds: Mapping[str, tuple[type, ...]], where: str) -> None:
    """Raise ParameterError for an unknown key, or a value that is not of its kind."""
    if not isinstance(entries, Mapping):
        raise ParameterError(f"{where}: is {entries!r}; write a table of {', '.join(kinds)}")
    for key, value in entries.items():
        if key not in kinds:
            raise ParameterError(f"{where}: no key {key!r}; {instead_of(key, list(kinds))}")
        if not isinstance(value, kinds[key]) or (isinstance(value, bool) and bool not in kinds[key]):
            raise ParameterError(f"{where}: {key} is {value!r}; give {kinds[key][0].__name__}")
    for key in ("scales", "at", "rpy"):
        if any(isinstance(x, bool) or not isinstance(x, int | float) for x in entries.get(key, [])):
            raise ParameterError(f"{where}: {key} is {entries[key]!r}; give numbers")
    for key in ("uncertain", "quantities", "files"):
        if not all(isinstance(x, str) for x in entries.get(key, [])):
            raise ParameterError(f"{where}: {key} is {entries[key]!r}; give texts")


def _at_least(least: int, entries: Mapping[str, Any], key: str, default: int, source: str) -> int:
    value: int = entries.get(key, default)
    if value < least:
        raise ParameterError(f"{source}: {key} is {value}; give {least} at least")
    return value


def _labelled(pairs: Sequence[tuple[str, Any]], kind: str, source: str) -> dict[str, Any]:
    """Parts by their labels; raises ParameterError for one that is there twice."""
    found: dict[str, Any] = {}
    for label, value in pairs:
        if label in found:
            raise ParameterError(f"{source}: two of [[{kind}]] are {label!r}; give each a `label` of its own")
        found[label] = value
    return found


def _motion(entry: Mapping[str, Any], folder: Path, source: str) -> tuple[str, PlannedMotion]:
    _check(entry, _MOTION, f"{source}: [[motion]]")
    files = [folder / str(name) for name in entry.get("files", [])]
    if "name" not in entry and not files:
        raise ParameterError(f"{source}: [[motion]]: give a name or files")
    spectrum = entry.get("match_spectrum")
    if spectrum is None and "spectrum_damping" in entry:
        raise ParameterError(f"{source}: [[motion]]: spectrum_damping is that of match_spectrum; give both")
    options, of_files = entry.get("options", {}), [key for key in OF_FILES if key in entry]
    if of_files and not files:
        raise ParameterError(
            f"{source}: [[motion]]: {of_files[0]} is for motions from files; give files, or leave it out"
        )
    if twice := [key for key in of_files if OF_FILES[key] in options]:
        raise ParameterError(f"{source}: [[motion]]: {twice[0]} is in options, too, as {OF_FILES[twice[0]]}; give one")
    corners = {key: entry.get(key) for key in ("high_pass", "low_pass")}
    motion, _ = adjust_motion(
        motion_of(entry.get("name"), files, **options, **{OF_FILES[key]: entry[key] for key in of_files}),
        rotate_by=entry.get("rotate_by"),
        time_scale=entry.get("time_scale"),
        taper=entry.get("taper"),
        spectrum=load_spectrum(folder / spectrum, entry.get("spectrum_damping")) if spectrum else None,
        **corners,
    )
    label = entry.get("label", entry.get("name", motion.name))
    return label, PlannedMotion(motion, entry.get("axes"), **corners)


def _specimen(machine: Machine, entry: Mapping[str, Any], folder: Path, source: str) -> tuple[str, Machine]:
    _check(entry, _SPECIMEN, f"{source}: [[specimen]]")
    if "name" not in entry:
        raise ParameterError(f"{source}: [[specimen]]: give a name or a file, or {NONE!r} for a bare table")
    name = str(entry["name"])
    label = entry.get("label", Path(name).stem)
    if name == NONE:
        return label, machine
    place = [entry.get(key, [0.0, 0.0, 0.0]) for key in ("at", "rpy")]
    if any(len(three) != 3 for three in place):
        raise ParameterError(f"{source}: [[specimen]] {label}: at and rpy are three numbers each")
    (x, y, z), (roll, pitch, yaw) = (map(float, three) for three in place)
    locked = entry.get("locked", False)
    return label, machine.with_specimen(beside(folder, name), (x, y, z), (roll, pitch, yaw), locked=locked)


def _controller(entry: Mapping[str, Any], folder: Path, source: str) -> tuple[str, Any]:
    _check(entry, _CONTROLLER, f"{source}: [[controller]]")
    if "name" not in entry:
        raise ParameterError(f"{source}: [[controller]]: give a name or a file")
    return entry.get("label", Path(entry["name"]).stem), load_controller(beside(folder, entry["name"]))

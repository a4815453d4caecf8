"""Controller settings, those of a panel, in TOML."""

import json
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ..core.errors import ParameterError, instead_of
from ..core.files import find_shipped, write_whole
from ..machine.parameters import Parameters, Quantity, load_parameters
from ..machine.schema import build_section, quantity_field
from .filters import MODES, NOTCHES

__all__ = ["ControllerSettings", "Notch", "load_controller", "save_controller"]

Six = tuple[float, ...]
"""A number for each degree of freedom x y z roll pitch yaw."""


@dataclass(frozen=True)
class Notch:
    """N = 1 + d B s / (s^2 + B s + w0^2) per degree of freedom: w0/2pi, B/2pi, d; no notch where d is zero."""

    frequency: Six = quantity_field("Hz", length=6, bound="positive")
    bandwidth: Six = quantity_field("Hz", length=6, bound="positive")
    depth: Six = quantity_field("1", length=6)


@dataclass(frozen=True)
class ControllerSettings:
    """Settings of three-variable control, force feedback and force balance (`loop`, `filters`)."""

    name: str
    mode: str
    notches: tuple[Notch, ...]
    stated: Parameters = field(compare=False, repr=False)  # numbers as read, with evidence and source
    rate: float = quantity_field("Hz", bound="positive")
    spool_limit: float = quantity_field("1", bound="fraction")
    master_gain: Six = quantity_field("1", length=6, bound="nonnegative")
    reference_high_pass: Six = quantity_field("Hz", length=6, bound="positive")
    reference_damping: Six = quantity_field("1", length=6, bound="positive")
    reference_low_pass: Six = quantity_field("Hz", length=6, bound="positive")
    displacement_feedforward: Six = quantity_field("1/s", length=6)
    velocity_feedforward: Six = quantity_field("1", length=6)
    acceleration_feedforward: Six = quantity_field("s", length=6)
    jerk_feedforward: Six = quantity_field("s2", length=6)
    crossover: Six = quantity_field("Hz", length=6, bound="positive")
    displacement_gain: Six = quantity_field("1/s", length=6, bound="nonnegative")
    velocity_gain: Six = quantity_field("1", length=6, bound="nonnegative")
    acceleration_gain: Six = quantity_field("s", length=6, bound="nonnegative")
    reset_gain: Six = quantity_field("1/s2", length=6, bound="nonnegative")
    reset_limit: Six = quantity_field("m/s | rad/s", length=6, bound="nonnegative")
    force_damping: Six = quantity_field("1", length=6, bound="nonnegative")
    force_cut_in: float = quantity_field("Hz", bound="positive")
    balance_gain: float = quantity_field("1/s", bound="nonnegative")


_GAINS = tuple(f"{name}_gain" for name in ("displacement", "velocity", "acceleration", "reset"))
_SECTIONS = {
    "loop": ("rate", "spool_limit", "master_gain"),
    "reference": ("reference_high_pass", "reference_damping", "reference_low_pass"),
    "feedforward": tuple(f"{x}_feedforward" for x in ("displacement", "velocity", "acceleration", "jerk")),
    "feedback": ("crossover", *_GAINS, "reset_limit"),
    "force": ("force_damping", "force_cut_in", "balance_gain"),
}
"""Sections of a panel's file and their quantities, in order."""
_NOTCH = tuple(f.name for f in fields(Notch))


def load_controller(name_or_path: str | Path) -> ControllerSettings:
    """Read controller settings by shipped name or path.

    Raises UnknownNameError, or ParameterError naming file and key.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = find_shipped("controller settings", str(name_or_path), "controllers")
    if not path.is_file():
        raise ParameterError(f"{path}: no such file of controller settings")
    stated = load_parameters(path)
    mode = str(stated.words.get("controller.mode", ""))
    if mode not in MODES:
        raise ParameterError(f"{stated.origin}: controller.mode {mode!r} is not one of {', '.join(MODES)}")
    sections = {key.split(".")[0] for key in stated} - set(_SECTIONS)
    names = [f"notch_{k}" for k in range(1, NOTCHES + 1)][: len(sections)]
    if sections != set(names):
        wrong = sorted(sections - set(names)) or sorted(sections)
        raise ParameterError(
            f"{stated.origin}: no place for [{wrong[0]}]; besides {', '.join(_SECTIONS)} there are notches, numbered "
            f"from notch_1 without a gap, {NOTCHES} at most"
        )
    every = {**_SECTIONS, **dict.fromkeys(names, _NOTCH), "controller": ("name", "mode")}
    known = {f"{section}.{key}" for section, keys in every.items() for key in keys}
    stray = sorted({*stated, *stated.words} - known)
    if stray:
        own = [key for key in sorted(known) if key.split(".")[0] == stray[0].split(".")[0]]
        raise ParameterError(f"{stated.origin}: {stray[0]} is not a controller setting; {instead_of(stray[0], own)}")
    for missing in sorted(known - {*stated, *stated.words, "controller.name"}):
        raise ParameterError(f"{stated.origin}: {missing} is missing")
    notches = tuple(build_section(Notch, stated, (name,)) for name in names)
    settings = build_section(
        ControllerSettings,
        stated,
        tuple(_SECTIONS),
        mode=mode,
        notches=notches,
        name=str(stated.words.get("controller.name", path.stem)),
        stated=stated,
    )
    corners = {key: getattr(settings, key) for key in ("reference_low_pass", "reference_high_pass", "crossover")}
    corners["force_cut_in"] = (settings.force_cut_in,)
    corners |= {f"{name}.frequency": notch.frequency for name, notch in zip(names, notches, strict=True)}
    for key, values in corners.items():
        if max(values) >= settings.rate / 2:
            raise ParameterError(f"{stated.origin}: {key} must lie below half the controller's rate")
    if any(low >= high for low, high in zip(settings.reference_high_pass, settings.reference_low_pass, strict=True)):
        raise ParameterError(f"{stated.origin}: reference_high_pass must lie below reference_low_pass")
    for name, notch in zip(names, notches, strict=True):
        if min(notch.depth) < -1.0:
            raise ParameterError(f"{stated.origin}: {name}.depth is below -1, which would turn the sign at the notch")
    return settings


def save_controller(settings: ControllerSettings, path: Path, changed: str) -> Path:
    """Write settings as a panel's file, whole or not at all.

    A number that equals the one read keeps its evidence and source; any other is `calibrated`, with source `changed`.
    """
    lines = [
        "# Settings of a three-variable controller; lists are per degree of freedom, x y z roll pitch yaw.",
        "",
        "[controller]",
        f"name = {_text(settings.name)}",
        f"mode = {_text(settings.mode)}",
    ]
    holders: dict[str, Any] = dict.fromkeys(_SECTIONS, settings)
    holders |= {f"notch_{k}": notch for k, notch in enumerate(settings.notches, 1)}
    for section, holder in holders.items():
        names = _SECTIONS.get(section, _NOTCH)
        lines += ["", f"[{section}]", *(_line(holder, settings.stated, f"{section}.{n}", changed) for n in names)]
    with write_whole(path) as beside:
        beside.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _line(holder: Any, stated: Parameters, key: str, changed: str) -> str:
    name = key.split(".")[1]
    value = getattr(holder, name)
    unit = next(f.metadata["unit"] for f in fields(holder) if f.name == name)
    as_read = stated[key] if key in stated else None
    if as_read is None or as_read.value != value:
        as_read = Quantity(value, unit, "calibrated", changed)
    numbers = list(map(float, value)) if isinstance(value, tuple) else float(value)
    texts = ", ".join(f"{k} = {_text(getattr(as_read, k))}" for k in ("unit", "evidence", "source"))
    return f"{name} = {{ value = {numbers!r}, {texts} }}"


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # TOML's basic strings are JSON's

"""Ground-motion data files: a quantity is a table {value, unit, source}, converted to SI on reading."""

from pathlib import Path
from typing import Any

from ..core.errors import MotionError
from ..core.files import read_toml

__all__ = ["load_toml", "si_unit", "values_of"]


_SI = ("", "1", "m", "m/s", "m/s^2", "rad", "s", "Hz")  # "" for texts and switches


def load_toml(path: "Path | str") -> dict[str, Any]:
    """Contents of a TOML file; raises MotionError naming the file and line."""
    try:
        return read_toml(path)
    except (OSError, ValueError) as error:
        raise MotionError(f"{path}: {error}") from error


def values_of(table: dict[str, Any], section: str) -> dict[str, Any]:
    """Quantities of a section in SI by name; plain entries (texts, whole numbers) stay as they are."""
    found = {}
    for key, entry in table[section].items():
        if not isinstance(entry, dict):
            found[key] = entry
            continue
        try:
            found[key] = _si(entry["value"], entry["unit"])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise MotionError(f"tests.toml, [{section}] {key}: {error!r}; write {{ value, unit, source }}") from error
    return found


def si_unit(unit: str) -> str:
    """SI unit that a value given in `unit` is converted to."""
    if unit in _SI:
        return unit
    import pint

    base = pint.get_application_registry().Quantity(1.0, unit).to_base_units().units
    return f"{base:~C}".replace("**", "^")


def _si(value: Any, unit: str) -> Any:
    """Value or list of values in SI base units."""
    if unit in _SI:
        return value
    import pint

    registry = pint.get_application_registry()
    factor = float(registry.Quantity(1.0, unit).to_base_units().magnitude)
    return [factor * item for item in value] if isinstance(value, list) else factor * value

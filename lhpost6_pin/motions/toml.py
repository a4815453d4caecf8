"""Ground-motion data files: a quantity is a table {value, unit, source}, converted to SI on reading."""

from pathlib import Path
from typing import Any

from ..core.errors import MotionError
from ..core.files import read_toml

__all__ = ["load_toml", "si_unit", "values_of"]


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
            value, factor = entry["value"], _to_si(entry["unit"])[0]
            if factor != 1.0:
                value = [factor * item for item in value] if isinstance(value, list) else factor * value
            found[key] = value
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise MotionError(f"tests.toml, [{section}] {key}: {error!r}; write {{ value, unit, source }}") from error
    return found


def si_unit(unit: str) -> str:
    """SI unit that a value given in `unit` is converted to."""
    return _to_si(unit)[1]


def _to_si(unit: str) -> tuple[float, str]:
    """Factor to SI base units, and their product."""
    if unit in ("", "1", "m", "m/s", "m/s^2", "rad", "s", "Hz"):  # "" for texts and switches
        return 1.0, unit
    import pint

    one = pint.get_application_registry().Quantity(1.0, unit).to_base_units()
    return float(one.magnitude), f"{one.units:~C}".replace("**", "^")

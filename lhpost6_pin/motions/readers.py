"""Reading a ground-motion file of any supported kind."""

from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any

from ..core.errors import MotionError, instead_of
from .at2 import is_at2, load_at2
from .csv import load_csv
from .motion import GroundMotion
from .text import read_text
from .v1 import is_v1, load_v1

__all__ = ["MotionFiles", "load_motion"]

MotionFiles = Path | str | Sequence[Path | str] | Mapping[str, Path | str]
"""One file, components for x, y, z in this order, or components by axis."""


def load_motion(paths: MotionFiles, **options: Any) -> GroundMotion:
    """Read a motion from a PEER .AT2, COSMOS/CSMIP V1 or CSV file, recognised by its content.

    Several paths (a sequence for x, y, z or a mapping by axis) are components in PEER files; one alone may hold all
    axes. `options` go to the reader of the kind found: `load_at2`, `load_v1` or `load_csv`.

    Raises MotionError naming the file and what to do.
    """
    if isinstance(paths, Sequence) and not isinstance(paths, str) and len(paths) == 1:
        paths = paths[0]
    if not isinstance(paths, str | Path):
        return _call(load_at2, paths, options)
    text = read_text(paths)
    suffix = Path(paths).suffix.lower()  # an incomplete file is refused by the reader of its suffix
    if is_at2(text) or suffix == ".at2":
        return _call(load_at2, paths, options)
    if is_v1(text) or suffix in (".v1", ".raw"):
        return _call(load_v1, paths, options)
    return _call(load_csv, paths, options)


_KINDS: dict[str, tuple[Any, str]] = {
    "name": (str, "a text"),
    "units": (str | Mapping, "a unit for all axes, such as g or mm, or from Python one by axis"),
    "time_step": (Real, "a number of seconds"),
    "columns": (Mapping, "columns by axis from Python, or name the axes in the file's header"),
    "channels": (Mapping, "axes by channel from Python"),
}
"""Types of the readers' options, in Python and in words."""


def _call(reader: Any, paths: Any, options: dict[str, Any]) -> GroundMotion:
    """Read; raises MotionError for options that the reader does not take."""
    known = set(reader.__kwdefaults__)
    unknown = sorted(set(options) - known)
    if unknown:
        raise MotionError(
            f"{paths}: option {unknown[0]!r} does not apply to this kind of file; "
            f"{instead_of(unknown[0], sorted(known))}"
        )
    for key, value in options.items():
        kind, wanted = _KINDS[key]
        if value is not None and not isinstance(value, kind):
            raise MotionError(f"{paths}: option {key} is {value!r}; give {wanted}")
    motion: GroundMotion = reader(paths, **options)
    return motion

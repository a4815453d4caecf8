"""Target response spectra in CSV files: period or frequency, and spectral acceleration for each axis or for all."""

import re
from pathlib import Path

import numpy as np

from ..core.errors import MotionError
from ..core.number_table import read_rows
from .columns import COMMAS, without_comments
from .csv import header_names
from .motion_units import acceleration_in_si
from .process import processing
from .target_spectrum import TargetSpectrum
from .text import read_text

__all__ = ["EXAMPLE", "load_spectrum"]

_ABSCISSA = re.compile(r"(?P<what>period|t|frequency|freq|f)(?:[\s_]*[\[(]?(?:s|sec|hz)[\])]?)?", re.I)
_ORDINATE = re.compile(
    r"(?:p?sa|acceleration)?_?(?P<axis>[xyz])?(?:[\s_]*[\[(](?P<bracketed>[^\])]*)[\])]|[_ ](?P<suffix>.+))?", re.I
)
_HORIZONTAL = "xy"
EXAMPLE = "name the columns, as in period_s,sa_g or frequency_hz,x_g,y_g,z_g"


def load_spectrum(path: Path | str, damping: float | None = None) -> TargetSpectrum:
    """Read a target spectrum, of oscillators with a share of critical `damping` (5 % by default).

    A header row names the columns: `period_s` or `frequency_hz`, then spectral acceleration with its unit, either one
    column for x and y (`sa_g`), or one for each axis (`x_g`, `sa_z_m_s2`). Raises MotionError naming the file and the
    column or row that cannot be, or a damping outside [0, 1).
    """
    where = str(path)
    damping = processing()["damping"] if damping is None else damping
    if not 0 <= damping < 1:
        raise MotionError(f"{where}: damping is {damping}; give a share of critical damping, such as 0.05")
    rows = without_comments(read_text(path, "response spectrum"))
    if len(rows) < 3:
        raise MotionError(f"{where}: fewer than two rows of a spectrum below a header row; {EXAMPLE}")
    (line, header), rows = rows[0], rows[1:]
    names, dialect = header_names(header)
    abscissa = _ABSCISSA.fullmatch(names[0])
    if abscissa is None or len(names) < 2:
        raise MotionError(f"{where}, line {line}: begins with no column of period or frequency; {EXAMPLE}")
    table = read_rows(rows, names, dialect, where, error=MotionError, commas=COMMAS, correct="correct it")
    if not (table > 0).all() or not np.isfinite(table).all():
        row, column = np.argwhere(~((table > 0) & np.isfinite(table)))[0]
        raise MotionError(
            f"{where}, line {rows[row][0]}, column {names[column]!r}: is {table[row, column]:g}; give a number above "
            "zero, or leave the row out"
        )
    frequency = table[:, 0] if abscissa["what"].lower().startswith("f") else 1 / table[:, 0]
    order = np.argsort(frequency)
    if (np.diff(frequency[order]) <= 0).any():
        twice = table[order[int(np.argmin(np.diff(frequency[order])))], 0]
        raise MotionError(f"{where}: two rows for {names[0]} {twice:g}; leave one out")
    spectra: dict[str, np.ndarray] = {}
    for name, values in zip(names[1:], table[order].T[1:], strict=True):
        for axis, found in _ordinates(name, values, f"{where}, line {line}").items():
            if axis in spectra:
                raise MotionError(f"{where}, line {line}: two columns for axis {axis}; leave one out")
            spectra[axis] = found
    return TargetSpectrum(frequency[order], spectra, damping, Path(path).name)


def _ordinates(name: str, values: np.ndarray, where: str) -> dict[str, np.ndarray]:
    """Spectral accelerations [m/s^2] of a column by axis."""
    match = _ORDINATE.fullmatch(name)
    unit = match and (match["bracketed"] or match["suffix"])
    if match is None or not unit:
        raise MotionError(f"{where}: column {name!r} is no spectral acceleration with a unit; {EXAMPLE}")
    found = acceleration_in_si(values, unit, f"{where}, column {name!r}", EXAMPLE)
    return dict.fromkeys(match["axis"].lower() if match["axis"] else _HORIZONTAL, found)

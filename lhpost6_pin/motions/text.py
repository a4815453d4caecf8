"""Reading text files whole, and turning blocks of numbers into arrays with errors that name the line."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..core.errors import MotionError
from ..core.files import reason_of

__all__ = ["READABLE", "Rows", "number_rows", "parse_fixed_width", "parse_numbers", "read_text"]

READABLE = (
    "PEER .AT2; CSMIP and COSMOS V1 and V2 (.v1, .RAW, .v2, .V2c); K-NET and KiK-net (.EW, .NS, .UD); CSV whose header "
    "row names time and axes with units (time_s,x_g); any other columns of numbers in text with --dt and --unit "
    "(from Python time_step and units)"
)
"""The formats that are read, for messages."""

Rows = Sequence[tuple[int, str]]
"""Lines that are not blank, each with its number in the file, from 1."""


def read_text(path: "Path | str", what: str = "ground motion") -> str:
    """Text of a file of `what`; raises MotionError when it is missing, unreadable or not text.

    Lines that end twice (CR CR LF, after a transfer between systems) end once.
    """
    try:
        data = Path(path).read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        raise MotionError(f"cannot read {what} {path}: {reason_of(error)}") from error
    if b"\0" in data[:4096]:
        raise MotionError(f"{path}: not a text file, of unknown format; known are {READABLE}")
    return re.sub(r"\r+\n", "\n", data.decode("utf-8-sig", errors="replace"))


def number_rows(text: str) -> Rows:
    """Lines of a text with their numbers, without blank ones."""
    return [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]


def parse_numbers(rows: Rows, where: str) -> np.ndarray:
    """Numbers separated by blanks (n,); raises MotionError naming the line."""
    try:
        return np.array(" ".join(line for _, line in rows).split(), dtype=float)
    except ValueError:
        return np.array([_number(token, where, number) for number, line in rows for token in line.split()])


def parse_fixed_width(rows: Rows, width: int, where: str) -> np.ndarray:
    """Numbers in columns of `width` characters (n,), as Fortran writes them: without blanks where full."""
    values = [
        _number(line[start : start + width], where, number)
        for number, line in ((number, line.rstrip()) for number, line in rows)
        for start in range(0, len(line), width)
    ]
    return np.array(values, dtype=float)


def _number(token: str, where: str, line: int) -> float:
    try:
        return float(token)
    except ValueError:
        raise MotionError(f"{where}, line {line}: {token.strip()[:40]!r} is not a number; correct it") from None

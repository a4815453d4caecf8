"""Reading text files whole, and turning blocks of numbers into arrays with errors that name the line."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..core.errors import MotionError
from ..core.files import reason_of

__all__ = ["parse_fixed_width", "parse_numbers", "read_text"]


def read_text(path: "Path | str") -> str:
    """Text of a file; raises MotionError when it is missing, unreadable or not text."""
    try:
        data = Path(path).read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        raise MotionError(f"cannot read ground motion {path}: {reason_of(error)}") from error
    if b"\0" in data[:4096]:
        raise MotionError(f"{path}: not a text file; give PEER .AT2, CSV, or COSMOS/CSMIP V1")
    return data.decode("utf-8-sig", errors="replace")


def parse_numbers(lines: Sequence[str], where: str, first_line: int) -> np.ndarray:
    """Numbers separated by blanks (n,); the error names the line, counted from `first_line`."""
    try:
        return np.array(" ".join(lines).split(), dtype=float)
    except ValueError:
        return np.array(
            [_number(token, where, k) for k, line in enumerate(lines, first_line) for token in line.split()]
        )


def parse_fixed_width(lines: Sequence[str], width: int, where: str, first_line: int) -> np.ndarray:
    """Numbers in columns of `width` characters (n,), as Fortran writes them: without blanks where full."""
    values = [
        _number(line[start : start + width], where, number)
        for number, line in enumerate(map(str.rstrip, lines), first_line)
        for start in range(0, len(line), width)
    ]
    return np.array(values, dtype=float)


def _number(token: str, where: str, line: int) -> float:
    try:
        return float(token)
    except ValueError:
        raise MotionError(f"{where}, line {line}: {token.strip()[:40]!r} is not a number; correct it") from None

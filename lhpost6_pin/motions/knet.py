"""K-NET and KiK-net files (.EW, .NS, .UD): a component a file, 17 header lines, whole numbers times a scale factor."""

import re
from pathlib import Path

import numpy as np

from ..core.errors import MotionError
from .components import Component, direction_of
from .motion_units import acceleration_in_si
from .text import number_rows, parse_numbers

__all__ = ["is_knet", "read_knet"]

_LABELS = 18  # characters that a header line's label takes
_SCALE = re.compile(r"([\d.]+)\s*\((\w+)\)\s*/\s*([\d.]+)")
_RATE = re.compile(r"([\d.]+)\s*Hz", re.IGNORECASE)
_KIKNET = {"1": "N-S", "2": "E-W", "3": "U-D", "4": "N-S", "5": "E-W", "6": "U-D"}  # borehole, then surface


def is_knet(text: str) -> bool:
    """Whether the text begins as a K-NET file does."""
    return text.lstrip().startswith("Origin Time") and "Scale Factor" in text[:2000]


def read_knet(text: str, where: str) -> Component:
    """The component of a K-NET or KiK-net file, with the offset that the recorder gave it.

    Raises MotionError naming the file, and the header line or number that is missing or wrong.
    """
    rows = number_rows(text)
    end = next((k for k, (_, line) in enumerate(rows) if line.startswith("Memo")), None)
    if end is None:
        raise MotionError(f"{where}: no line 'Memo.' ends the header of this K-NET file; download it again")
    head = {line[:_LABELS].strip(): line[_LABELS:].strip() for _, line in rows[:end]}
    scale, rate = _SCALE.match(head.get("Scale Factor", "")), _RATE.match(head.get("Sampling Freq(Hz)", ""))
    try:
        factor, step = (float(scale[1]) / float(scale[3]), 1 / float(rate[1])) if scale and rate else (0.0, 0.0)
    except (ValueError, ZeroDivisionError):
        factor = step = 0.0
    if scale is None or not (0 < factor < np.inf and 0 < step < np.inf):
        raise MotionError(
            f"{where}: K-NET header lacks 'Scale Factor 3920(gal)/6182761' or 'Sampling Freq(Hz) 100Hz'; correct it"
        )
    values = parse_numbers(rows[end + 1 :], where)
    seconds = re.match(r"[\d.]+", head.get("Duration Time(s)", ""))
    announced = round(float(seconds[0]) / step) if seconds and seconds[0].count(".") < 2 else 0
    if len(values) < announced:
        raise MotionError(
            f"{where}: header announces {announced} samples, the file has {len(values)}; it is truncated: download it "
            "again"
        )
    pointing = head.get("Dir.", "")
    direction = direction_of(_KIKNET.get(pointing, pointing))
    if direction is None:
        raise MotionError(f"{where}: direction (Dir.) is {pointing[:20]!r}; N-S, E-W, U-D and 1 to 6 are known")
    si = acceleration_in_si(factor * values, scale[2], where, "a K-NET file is in gal")
    return Component(f"{where} ({Path(where).suffix.lstrip('.') or pointing})", ("1",), direction, step, si)

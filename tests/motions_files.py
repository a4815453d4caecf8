"""Small ground-motion files of each format, written as the agencies write them."""

from collections.abc import Sequence

import numpy as np


def at2_text(values: np.ndarray, step: float = 0.005, *, old: bool = False) -> str:
    """PEER file of accelerations (n,) [g]."""
    count = f"{len(values):5d}    {step:.4f}    NPTS, DT" if old else f"NPTS=  {len(values)}, DT=   {step:.4f} SEC,"
    lines = [
        "PEER NGA STRONG MOTION DATABASE RECORD",
        "Closed form, 1/1/2000, NOWHERE, 090",
        "ACCELERATION TIME SERIES IN UNITS OF G",
        count,
    ]
    for start in range(0, len(values), 5):
        lines.append("".join(f"{value:15.7E}" for value in values[start : start + 5]))
    return "\n".join(lines) + "\n"


def csmip_text(channels: Sequence[tuple[str, np.ndarray]], rate: int = 100) -> str:
    """CSMIP V1 file of channels (orientation, accelerations (n,) [g]); full columns leave no blanks."""
    lines = []
    for number, (orientation, values) in enumerate(channels, 1):
        lines += [
            "Uncorrected Accelerogram Data             Processed: 01/01/00, XYZ",
            "Station Id. XYZ     35.000N, 117.000W    Q330    s/n 1    (3 Chns of  3 at Sta)",
            f"Chan  {number}: {orientation:20s}",
            "   1  100    1    3    3  100 -999    3    1    0  605 4114    050599   41    0",
            " 1.0000000-999.00000-8.0000000-999.00000",
            f" {len(values)} Accelerogram points at {rate} pts/sec in units of g.       Format: (8f9.6)  ",
            *_rows(values, 8, "9.6f"),
            f"/&  ----------  End of Data for Station Channel   {number}  ----------",
        ]
    return "\r\n".join(lines) + "\r\n"


def cosmos_text(channels: Sequence[tuple[int, np.ndarray]], step: float = 0.005) -> str:
    """COSMOS V1 file of channels (azimuth or 400, accelerations (n,) [cm/s^2])."""
    lines = []
    for number, (azimuth, values) in enumerate(channels, 1):
        integers = np.full(100, -999)
        integers[53] = azimuth
        reals = np.full(100, -999.0)
        reals[61] = 1000 * step
        lines += [
            "Uncorrected acceleration      (Format v01.20 with 13 text lines)",
            f"Sta Chan   {number}:          (Rcrdr Chan  {number}) Location:",
            " 100 Integer-header values follow on  10 lines, Format= (10I8)",
            *_rows(integers, 10, "8d"),
            " 100 Real-header values follow on  20 lines, Format= (5F15.6)",
            *_rows(reals, 5, "15.6f"),
            '   1 Comment line(s) follow, each starting with a "|":',
            "| nothing",
            f"   {len(values)} acceleration pts, approx   1 secs, units=cm/sec2(04),Format=(8F10.5)",
            *_rows(values, 8, "10.5f"),
            f"End-of-data for Chan {number:2d} acceleration",
        ]
    return "\n".join(lines) + "\n"


def _rows(values: np.ndarray, per_line: int, form: str) -> list[str]:
    return [
        "".join(format(value, form) for value in values[start : start + per_line])
        for start in range(0, len(values), per_line)
    ]

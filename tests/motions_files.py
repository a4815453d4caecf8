"""Small ground-motion files of each format, written as the agencies write them."""

from collections.abc import Sequence

import numpy as np


def at2_text(
    values: np.ndarray, step: float = 0.005, *, old: bool = False, component: str = "090", end: str = "\n"
) -> str:
    """PEER file of accelerations (n,) [g]."""
    count = f"{len(values):5d}    {step:.4f}    NPTS, DT" if old else f"NPTS=  {len(values)}, DT=   {step:.4f} SEC,"
    lines = [
        "PEER NGA STRONG MOTION DATABASE RECORD",
        f"Closed form, 1/1/2000, NOWHERE, {component}",
        "ACCELERATION TIME SERIES IN UNITS OF G",
        count,
    ]
    return end.join([*lines, *_rows(values, 5, "15.7E")]) + end


def old_at2_text(values: np.ndarray, step: float = 0.01, *, component: str = "180", end: str = "\n") -> str:
    """PEER file of the first database, as that of El Centro 1940: unit with a full stop, filter points, a station."""
    lines = [
        "PACIFIC ENGINEERING AND ANALYSIS STRONG-MOTION DATA",
        f" CLOSED FORM 05/19/40 0439, NOWHERE ARRAY #9, {component} (USGS STATION 117)",
        " ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.2 Hz LP=15.0 Hz",
        f" NPTS=  {len(values)}, DT= {f'{step:.5f}'.lstrip('0')} SEC",
    ]
    numbers = [row.replace("0.", " .") for row in _rows(values, 5, "15.7E")]  # old Fortran drops the zero
    return end.join([*lines, *numbers]) + end


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


def film_text(channels: Sequence[tuple[str, np.ndarray, np.ndarray]]) -> str:
    """CSMIP V1 file of digitised film, as in 1994: channels (orientation, times (n,) [s], accelerations (n,) [g])."""
    lines = []
    for number, (orientation, times, values) in enumerate(channels, 1):
        pairs = np.column_stack([times, 10 * values]).ravel()
        lines += [
            "UNCORRECTED ACCELEROGRAM DATA              PROCESSED: 02/08/94, CDMG QN00A000   ",
            "CLOSED FORM EARTHQUAKE",
            "JANUARY 1, 2000 04:31 PST               (ORIGIN(CIT): 01/01/00, 12:30:55.4 GMT) ",
            "00000-S0000-00001.02               TRIGGER TIME: 01/01/00, 12:31:04.1 UTC       ",
            "STATION NO. 00000   33.929N, 118.260W     SMA-1  S/N 0000                       ",
            "NOWHERE - SCHOOL",
            f"CHAN  {number}:  {orientation}",
            "CLOSED FORM EARTHQUAKE     JANUARY 1, 2000 04:31 PST                            ",
            "HYPOCENTER(CIT): 34.215N, 118.538W, H=18KM. ML=6.6, MW=6.7(CIT); MS=6.7(NEIC)   ",
            "INSTR PERIOD =  .0397 SEC,  DAMPING =  .592,  SENSITIVITY = 1.77 CM/G.          ",
            f"NO. OF POINTS =  {len(values):5d}  RECORD LENGTH = {times[-1]:6.3f} SEC                              ",
            "UNITS OF UNCOR ACCEL ARE SEC AND G/10.     MAX  =  -.200 G, AT  11.576 SEC.     ",
            "RMS ACCEL OF COMPLETE RECORD =  .021 G.                                         ",
            *_rows(np.ones(100, int), 16, "5d"),
            *_fortran(np.full(50, 25.2), 8, 10, 3),
            *_fortran(pairs, 10, 7, 3),
            f"/&  ----------  END OF DATA FOR CHANNEL  {number}  ----------",
        ]
    return "\r\n".join(lines) + "\r\n"


def v2_text(channels: Sequence[tuple[str, np.ndarray]], step: float = 0.02, *, old: bool = False) -> str:
    """CSMIP V2 file of channels (orientation, accelerations (n,) [cm/s^2]), of 2014 or, `old`, of 1983."""
    lines = []
    for number, (orientation, values) in enumerate(channels, 1):
        n, spaced = len(values), f"{step:.3f}".lstrip("0")
        digits = 3 if old else 6
        text = [
            f"Corrected accelerogram   00000-S0000-00001.01       Chan  {number}:  {orientation}     from   ",
            "Uncorrected Accelerogram Data             Processed: 01/01/00, CGS  000bv000    ",
            "Rcrd of Sat Jan  1, 2000 03:20:33.0 PDT               (Avol1 v0.8, 5/14 CSMIP)  ",
            "Station No. 00000   37.973N, 122.038W    Etna    s/n 0000  (3 Chns of  3 at Sta)",
            f"Chan  {number}:  {orientation}                                                  ",
            "Accelerogram bandpass filtered with 3 dB pts at   .07 and 40.00 cyc/sec         ",
            f"{n:6d} points of instrument- and baseline-corrected accel, veloc and displ data ",
            f"At equally-spaced intervals of    {spaced}  sec.                                ",
            "Peak acceleration =    27.114    cm/sec/sec  at   32.570   sec.                 ",
            f"00000-S0000-00001.01      Nowhere   Chan  {number}:  {orientation}              ",
            "                                                                                ",
            *_rows(np.ones(100, int), 16, "5d"),
            *_fortran(np.full(100, 624.0), 8, 10, 3),
        ]
        for quantity, unit, part in (("accel", "cm/sec2", 1), ("veloc", "cm/sec", 2), ("displ", "cm", 3)):
            new = f"{n:6d} points of {quantity} data equally spaced at  {spaced} sec, in {unit}. (8f10.6)    "
            older = f"{n:5d} points of {quantity} data equally spaced at  {spaced} sec.  (units: cm/sec/sec)"
            text += [older if old else new, *_fortran(values / part, 8, 10, digits)]
        lines += [line.upper() if old else line for line in text]
        lines.append(f"/&  ---------- End of data for channel  {number} ----------")
    return "\n".join(lines) + "\n"


def knet_text(values: np.ndarray, direction: str = "E-W", rate: int = 100, scale: str = "3920(gal)/6182761") -> str:
    """K-NET file of whole numbers (n,)."""
    lines = [
        "Origin Time       2000/01/01 08:43:00",
        "Lat.              39.028",
        "Long.             140.880",
        "Depth. (km)       8",
        "Mag.              7.2",
        "Station Code      AAA000",
        "Station Lat.      40.6363",
        "Station Long.     139.9284",
        "Station Height(m) 42",
        "Record Time       2000/01/01 08:44:18",
        f"Sampling Freq(Hz) {rate}Hz",
        f"Duration Time(s)  {len(values) // rate}",
        f"Dir.              {direction}",
        f"Scale Factor      {scale}",
        "Max. Acc. (gal)   16.452",
        "Last Correction   2000/01/01 08:44:03",
        "Memo.             ",
    ]
    return "\n".join([*lines, *(f"{row} " for row in _rows(values, 8, "8.0f"))]) + "\n"


def cosmos_text(channels: Sequence[tuple[int, np.ndarray]], step: float = 0.005, *, comment: str = "| nothing") -> str:
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
            comment,
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


def _fortran(values: np.ndarray, per_line: int, width: int, digits: int) -> list[str]:
    """Rows as old Fortran prints them: ` .040`, `-.008`."""
    cells = [f"{value:.{digits}f}" for value in values]
    cells = [cell.replace("0.", ".", 1) if cell.lstrip("-").startswith("0.") else cell for cell in cells]
    return ["".join(cell.rjust(width) for cell in cells[k : k + per_line]) for k in range(0, len(cells), per_line)]

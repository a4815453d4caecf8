"""Records that are not shipped: which one a test wants from the user, where it can be had, what to type then."""

from typing import NamedTuple

__all__ = ["WantedRecord", "request"]


class WantedRecord(NamedTuple):
    """A record that the user brings, in words, as `models/ground_motions/index.toml` describes it."""

    event: str
    station: str
    record: str  # what it is known by, in a few words
    files: str
    where: str
    command: str  # FILE, or FILE_X FILE_Y FILE_Z, stand for the user's files


def request(name: str, wanted: WantedRecord, first: str = "") -> str:
    """Message that asks for the files of test `name`; `first` says what else can be done."""
    order = "   (longitudinal, transverse, vertical; or one FILE of all axes)" if "FILE_X" in wanted.command else ""
    lines = (
        f"{name}: {first}run it from your own file",
        f"  earthquake: {wanted.event}",
        f"  station:    {wanted.station}",
        f"  wanted:     {wanted.record}: {wanted.files}",
        f"  from:       {wanted.where}",
        f"  then type:  {wanted.command}{order}",
    )
    return "\n".join(lines)

"""Measured tests from data files of any usual format into records, and records out again.

`load_raw` reads a file, `guess_map` or `load_map` assigns its columns to channels, `make_imported_record` makes the
record; `find_tests` finds the files of many tests.
"""

from .build import described_sources, make_imported_record
from .channel_map import ChannelMap, Source, TestFacts, load_map, save_map
from .exporting import FORMATS, channel_units, export_record, refuse_what_is_no_export
from .guess import Guess, guess_map, is_export, other_columns
from .many import FileOfTest, find_tests
from .raw import RawTest
from .raw_files import READABLE, load_raw

__all__ = ["FORMATS", "READABLE", "ChannelMap", "FileOfTest", "Guess", "RawTest", "Source", "TestFacts"]
__all__ += [
    "channel_units",
    "described_sources",
    "export_record",
    "find_tests",
    "guess_map",
    "is_export",
    "load_map",
    "load_raw",
]
__all__ += ["make_imported_record", "other_columns", "refuse_what_is_no_export", "save_map"]

"""Files and folders of many tests: which files are a test, and the name of each."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ...core.errors import RecordError
from ...core.files import reason_of
from .text_tables import is_note

__all__ = ["FileOfTest", "find_tests"]

_NO_DATA = {".md", ".toml", ".pdf", ".png", ".jpg", ".jpeg", ".html", ".py", ".m", ".doc", ".docx", ".zip", ".nc"}
_NO_DATA |= {".json", ".jsonl", ".tdms_index"}
"""Suffixes of files that a folder of tests may hold beside its data: records (.nc) are imported already."""

_TEXT = {".txt", ".csv", ".tsv", ".dat", ".asc", ".log"}
"""Suffixes of files that may be tables or notes."""

_BEGINNING = 200_000  # bytes of a file that are looked at


class FileOfTest(NamedTuple):
    """The file of one test, and its name."""

    name: str
    file: Path


def find_tests(paths: Sequence[Path]) -> list[FileOfTest]:
    """Tests of files and folders, each data file one; folders give the files directly in them, in order of names.

    Texts in a folder that hold no row of numbers are notes, and none.

    A test is called as its file; where two files are called alike, by folder and file. Raises RecordError for a folder
    without data files, or a file given twice.
    """
    files: list[Path] = []
    for path in paths:
        files += _inside(path) if path.is_dir() else [path]
    places = [file.resolve() for file in files]
    if len(set(places)) < len(places):
        twice = next(place for place in places if places.count(place) > 1)
        raise RecordError(f"{twice}: is given twice; give each test once")
    names = [file.stem for file in files]
    if len(set(names)) < len(names):
        names = [f"{file.resolve().parent.name}_{file.stem}" for file in files]
    if len(set(names)) < len(names):
        names = [f"{name}{file.suffix.replace('.', '_')}" for name, file in zip(names, files, strict=True)]
    if len(set(names)) < len(names):
        same = next(name for name in names if names.count(name) > 1)
        raise RecordError(f"two tests would be called {same}; rename a file, or import its folder apart")
    return [FileOfTest(name, file) for name, file in zip(names, files, strict=True)]


def _inside(folder: Path) -> list[Path]:
    try:
        inside = sorted(folder.iterdir())
    except OSError as error:
        raise RecordError(f"{folder}: cannot be read: {reason_of(error)}") from None
    data = [p for p in inside if p.is_file() and not p.name.startswith(".") and p.suffix.lower() not in _NO_DATA]
    files = [p for p in data if not _is_note(p)]
    if not files:
        below = [p.name for p in inside if p.is_dir()]
        remedy = f"name the folders in it: {', '.join(below[:8])}" if below else "name the folder of the data files"
        if any(p.suffix.lower() == ".nc" for p in inside):
            remedy = f"its records (.nc) need no import: `lhpost6 check {folder}`"
        raise RecordError(f"{folder}: holds no data file; {remedy}")
    return files


def _is_note(path: Path) -> bool:
    """Whether a file in a folder is a text without numbers; one that cannot be read is judged when it is imported."""
    if path.suffix.lower() not in _TEXT:
        return False
    try:
        with path.open("rb") as file:
            return is_note(file.read(_BEGINNING))
    except OSError:
        return False

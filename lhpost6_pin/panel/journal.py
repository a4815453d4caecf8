"""The journal of a panel: who did what when, on the page and in a file of one JSON entry a line."""

import json
from datetime import datetime
from pathlib import Path
from typing import TypedDict

__all__ = ["Entry", "Journal"]


class Entry(TypedDict):
    """An entry: local time, name of who did it, and what."""

    time: str
    who: str
    what: str


class Journal:
    """All entries since the panel was opened, also in a file that only grows; attribute `entries`."""

    def __init__(self, path: Path) -> None:
        """Go on in a file, or begin it."""
        self._path = path
        self.entries: list[Entry] = []

    def note(self, who: str, what: str) -> None:
        """Append an entry."""
        now = datetime.now()
        self.entries.append({"time": now.strftime("%H:%M:%S"), "who": who, "what": what})
        entry = {"time": now.isoformat(timespec="milliseconds"), "who": who, "what": what}
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry, ensure_ascii=False) + "\n")

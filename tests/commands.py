"""What the tests of commands share: what a command leaves on the terminal, and a motion that is short to run."""

import re
from pathlib import Path
from typing import NamedTuple

SHORT = ("sine", "--set", "amplitude=0.02", "--set", "cycles=0.5", "--set", "ramp_cycles=0.5", "--engine", "fused")
COARSE = (*SHORT, "--rate", "2048", "--record-rate", "512")


class Ended(NamedTuple):
    """What a command left behind on the terminal."""

    code: int
    out: str
    err: str

    @property
    def words(self) -> str:
        """All text with line breaks and table rules taken out, for phrases that may be wrapped."""
        return " ".join(re.sub(r"[\u2500-\u257f]", " ", self.out + self.err).split())


def refused(ended: Ended, *phrases: str) -> bool:
    """Whether a command ended with one clear message on stderr that holds all phrases."""
    assert ended.code == 2, ended
    assert "Traceback" not in ended.err
    for phrase in phrases:
        assert phrase in ended.words, (phrase, ended.words)
    return True


def own_controller(path: Path, init: str = "return rest.spool", step: str = "return memory") -> str:
    """Write a user's own controller and return what `--controller` takes."""
    methods = f"    def init(self, plant, rest): {init}\n    def step(self, memory, wanted, sensors): {step}\n"
    path.write_text(f"class Mine:\n{methods}")
    return f"{path}:Mine"

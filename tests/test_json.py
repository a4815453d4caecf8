"""What commands print with --json is what its page of the documentation says, refusals too."""

import json
import re
import sys
from pathlib import Path

import pytest
from machine_cases import DATA

from lhpost6_pin.cli import main

PAGE = Path(__file__).parents[1] / "scripts" / "docs" / "pages" / "reference" / "json.md"
PRACTICE = str(DATA / "records" / "practice_a_TX.nc")
QUICK = ("--engine", "fused", "--rate", "2048")
SINE = ("sine", "--set", "amplitude=0.01", "--set", "cycles=1")


def documented(command: str) -> set[str]:
    """Fields in the table of a command."""
    for section in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
        head, _, rest = section.partition("\n")
        if f"`{command}`" in head:
            cells = re.findall(r"^\| (`[^|]*) \|", rest, re.MULTILINE)
            return {name for cell in cells for name in re.findall("`([^`]*)`", cell)}
    raise AssertionError(f"{command} is not on the page")


@pytest.fixture
def said(tmp_path, monkeypatch, capsys):
    """Runs a command as the shell would: its exit code, and what it printed."""

    def run(*words: str) -> tuple[int, dict]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["lhpost6", *words, "--json"])
        with pytest.raises(SystemExit) as ended:
            main()
        return int(ended.value.code or 0), json.loads(capsys.readouterr().out)

    return run


@pytest.mark.parametrize(
    ("words", "others"),
    [
        (("run", *SINE, *QUICK), {"against_record"}),
        (("open-loop", PRACTICE, *QUICK), {"verdict", "level", "tracking", "spools", "limits", "channels_missing"}),
        (("decompose", PRACTICE), set()),
        (("check", PRACTICE), {"channels", "files"}),
        (("export", PRACTICE, "--to", "csv", "--out", "a.csv"), {"campaign", "tests", "counts", "times", "tripped"}),
    ],
    ids=lambda words: words[0] if isinstance(words, tuple) else "",
)
def test_the_page_has_every_field_of_a_command_and_no_other(said, words, others):
    code, entries = said(*words)
    assert code == 0
    assert set(entries) == documented(words[0]) - others


def test_the_page_has_the_fields_of_what_only_looks(said):
    wanted = documented("info")
    found = [set(said(*words)[1]) for words in (("info",), ("capacity",), ("motions",), ("doctor",))]
    found.append(set(said("motions", "sine")[1]))
    assert set.union(*found) == wanted


@pytest.mark.parametrize(
    ("words", "kind", "message"),
    [
        (("info", "--machine", "nothing"), "UnknownNameError", "no machine named 'nothing'"),
        (("decompose", "not_there.nc"), "RecordError", "not_there.nc"),
        (("run", "sine", "--set", "amplitude=5"), "OutOfRangeError", "more than the table can give"),
        (("export", PRACTICE, "--to", "csv", "--out", "/proc/none/a.csv"), "OSError", "/proc/none"),
    ],
)
def test_a_refusal_is_an_object_too(said, words, kind, message):
    code, entries = said(*words)
    assert code == 2 and set(entries) == {"error"}
    assert entries["error"]["kind"] == kind and message in entries["error"]["message"]
    fits = entries["error"].get("largest_scale")
    assert (fits is not None and 0.0 < fits < 1.0) == (kind == "OutOfRangeError")

"""The tutorial of one's own table: its commands give what it shows, name what was hidden, and are few and quick."""

import json
import re
import resource
from pathlib import Path
from typing import NamedTuple

import pytest
from doc_pages import PAGES, run_snippet, snippets
from page_cases import Reader

pytestmark = pytest.mark.slow  # the battery searches one-axis tables in every run of the checks

PAGE = PAGES / "tutorials" / "own_table.md"
MOST_COMMANDS, LONGEST = 8, 600.0  # [s] of machine time: issue 22
CLOSE = 0.05
"""Relative difference of a printed number from that of the page: fits on other processors differ in late digits."""


class Followed(NamedTuple):
    """The tutorial, followed to its end."""

    folder: Path
    shown: list[tuple[str, str]]  # each block of output on the page, and all that its commands printed
    seconds: float  # of processors: nothing but the commands, whatever else the machine does


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> Followed:
    folder, shown, printed, start = tmp_path_factory.mktemp("own"), [], "", _used()
    for snippet in snippets(PAGE):
        if snippet.language == "bash":
            ended = run_snippet(snippet, folder)
            assert ended.returncode == 0, f"{snippet.text}\n{ended.stdout}\n{ended.stderr}"
            assert "Traceback" not in ended.stderr
            printed = ended.stdout
        else:
            shown.append((snippet.text, printed))
    return Followed(folder, shown, _used() - start)


def _used() -> float:
    """Processor time of all commands so far [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def alike(shown: str, printed: str) -> bool:
    """Whether a line says the same, numbers within `CLOSE`; what is shown may end early with three dots."""
    wanted, found = (re.sub(r"[\u2500-\u257f]", " ", line).split() for line in (shown, printed))
    if wanted and wanted[-1] == "...":
        wanted.pop()
        found = found[: len(wanted)]
    return len(wanted) == len(found) and all(map(_same, wanted, found))


def _same(word: str, other: str) -> bool:
    try:
        return float(other) == pytest.approx(float(word), rel=CLOSE)
    except ValueError:
        return word == other


def test_lines_are_compared_word_by_word_and_numbers_within_a_tolerance():
    assert alike("│ speed │ 0.0120 │ ...", "│ speed  │ 0.01203 │ 0.0119 to 0.0121 │ m/s │")
    assert not alike("│ speed │ 0.0120 │ ...", "│ speed  │ 0.0131 │ 0.0119 to 0.0121 │ m/s │")
    assert not alike("Effect identified: backlash ...", "Effect identified: drag")
    assert not alike("wrote a", "wrote a b")


def test_every_line_of_output_on_the_page_is_printed_in_its_order(followed):
    assert len(followed.shown) == 7
    missing = []
    for shown, printed in followed.shown:
        lines = printed.splitlines()
        for line in shown.strip().splitlines():
            at = next((k for k, other in enumerate(lines) if alike(line, other)), None)
            missing += [line] if at is None else []
            lines = lines[at + 1 :] if at is not None else lines
    assert not missing, "\n".join([*missing, "", *(printed for _, printed in followed.shown)])


def test_it_names_what_was_hidden_and_nothing_else(followed):
    """Friction falling with speed, and the valve's null within a tenth (issue 22)."""
    rows = re.findall(r"^\| `([\w.]+)` \| (\S+) \| (.+) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(rows) == 5
    verdict = json.loads((followed.folder / "found" / "verdict.json").read_text())
    assert {one["family"] for one in verdict["effects"]} == {"stribeck_friction", "spool_null_bias"}
    found = {name: value for one in verdict["effects"] for name, value in one["parameters"].items()}
    found |= verdict["parameters_changed"]
    for name, hidden, unit in rows:
        assert found[name]["value"] == pytest.approx(float(hidden), rel=0.1), name
        assert found[name]["unit"] == unit
    model = (followed.folder / "found" / "model.toml").read_text()
    assert "fitted to campaign campaign by lhpost6 discover" in model and "given by hand" not in model


def test_calibration_alone_leaves_the_flow_unexplained_and_both_reports_show_the_curves(followed):
    words = [Reader(followed.folder / name / "report.html") for name in ("calibration", "found")]
    assert re.search(r"above sensor noise: an effect is missing", words[0].words)
    for page in words:
        assert {"friction-curves", "valve-curves"} <= set(page.figures)


def test_it_takes_few_commands_and_little_time(followed):
    typed = "".join(snippet.text for snippet in snippets(PAGE) if snippet.language == "bash")
    assert len(re.findall(r"^lhpost6 ", typed, re.MULTILINE)) <= MOST_COMMANDS
    assert followed.seconds < LONGEST

"""The README: its example runs, its commands, files and numbers exist, and it is short."""

import re
from pathlib import Path

import pytest
from doc_pages import check_commands

from lhpost6_pin import __version__
from lhpost6_pin.cli.app import JOBS
from lhpost6_pin.machine.machine import load_machine

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_python_example_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = re.search(r"```python\n(.*?)```", README, re.DOTALL).group(1)
    names: dict[str, object] = {}
    exec(code, names)  # the project's own text
    assert names["test"].record.attrs["test"] == "half Ridgecrest"
    assert names["test"].run.trouble is None


def test_it_fits_on_a_few_screens_with_small_pictures():
    assert len(README.splitlines()) <= 160
    pictures = re.findall(r"!\[(.+?)\]\((.+?)\)", README, re.DOTALL)
    assert len(pictures) == 2 and all(len(alt) > 60 for alt, _ in pictures)
    assert sum((ROOT / path).stat().st_size for _, path in pictures) < 600_000


def test_the_table_of_commands_is_that_of_the_help():
    rows = re.findall(r"^\| ([\w ]*?) ?\| `lhpost6 ([\w-]+)", README, re.MULTILINE)
    jobs: dict[str, tuple[str, ...]] = {}
    for job, command in rows:
        last = job or next(reversed(jobs))
        jobs[last] = (*jobs.get(last, ()), command)
    assert list(jobs.items()) == list(JOBS.items())


def test_examples_are_commands_with_options_that_exist():
    blocks = "".join(re.findall(r"```bash\n(.*?)```", README, re.DOTALL)).replace(".venv/bin/", "")
    assert check_commands(blocks) > 8


def test_every_assumed_number_is_listed_with_its_value_and_unit():
    for path, quantity in load_machine().parameters.items():
        if quantity.assumed:
            unit = "" if quantity.unit == "1" else f" {quantity.unit}"
            assert f"`{path}` {quantity.value:g}{unit}" in README, f"{path} is assumed; list it in the README"


@pytest.mark.parametrize("name", sorted(set(re.findall(r"\(?((?:models|scripts)/[\w./]+)", README))))
def test_files_that_are_named_are_there(name):
    assert (ROOT / name).exists()


def test_continuous_integration_calls_exactly_the_test_command():
    (command,) = (line for line in README.splitlines() if "scripts/checks.py" in line and line.startswith("python3"))
    assert command in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()


def test_the_citation_is_of_this_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version: {__version__}\n" in text and "cff-version: 1.2.0" in text

"""What the README says runs, and what it lists is there."""

import re
from pathlib import Path

import pytest

from lhpost6_pin import __version__
from lhpost6_pin.cli import app
from lhpost6_pin.machine.machine import load_machine

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_python_example_runs():
    code = re.search(r"```python\n(.*?)```", README, re.DOTALL).group(1)
    names: dict[str, object] = {}
    exec(code, names)  # the project's own text
    assert names["record"].attrs["test"] == "half Ridgecrest"
    assert names["run"].trouble is None


def test_commands_of_the_table_exist():
    known = {c.name or c.callback.__name__ for c in app.registered_commands}
    told = set(re.findall(r"`lhpost6 ([\w-]+)", README))
    assert told == known  # all that exist are told, all that are told exist


def test_every_assumed_number_is_listed_with_its_value():
    for path, quantity in load_machine().parameters.items():
        if quantity.assumed:
            row = next((line for line in README.splitlines() if line.startswith("|") and f"`{path}`" in line), None)
            assert row is not None, f"{path} is assumed; list it in the README"
            assert f"{quantity.value:g}" in row


@pytest.mark.parametrize("name", sorted(set(re.findall(r"\(?((?:models|scripts)/[\w./]+)", README))))
def test_files_that_are_named_are_there(name):
    assert (ROOT / name).exists()


def test_continuous_integration_calls_exactly_the_test_command():
    (command,) = (line for line in README.splitlines() if "scripts/checks.py" in line and line.startswith("python3"))
    assert command in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()


def test_the_citation_is_of_this_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version: {__version__}\n" in text and "cff-version: 1.2.0" in text

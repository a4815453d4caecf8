"""Directories of results: no command replaces a file of an earlier one without a warning."""

import ast
import shutil
from pathlib import Path

import pytest

import lhpost6_pin.discovery
import lhpost6_pin.studies.ensemble
from lhpost6_pin.cli.results_folder import folder_for
from lhpost6_pin.core.errors import RecordError

RECORDS = Path(__file__).parent / "data" / "records"
CLI = Path(lhpost6_pin.__file__).parent / "cli"
WARNING = "report.html of an earlier command will be replaced; --out names another directory"
NAMED = ("report.html", "RUN_FILES", "written")  # `written` of `run`: those of RUN_FILES that are wanted
ELSEWHERE = {"retuned", "save_run"}  # write into the directory of the command that calls them


def _stopped(*_: object, **__: object) -> None:
    raise RecordError("stopped here")


@pytest.mark.parametrize("command", ["discover", "ensemble"])
def test_the_report_of_another_command_is_replaced_with_a_warning(lhpost6, tmp_path, monkeypatch, caplog, command):
    monkeypatch.setattr(lhpost6_pin.discovery, "discover", _stopped)
    monkeypatch.setattr(lhpost6_pin.studies.ensemble, "run_ensemble", _stopped)
    for name in ("practice_a_TX.nc", "practice_a_WN.nc"):
        (tmp_path / "camp").mkdir(exist_ok=True)
        shutil.copy(RECORDS / name, tmp_path / "camp")
    words = ("camp",) if command == "discover" else ("sine", "--machines", 2)
    for there in (False, True):
        folder = tmp_path / f"results {there}"
        folder.mkdir()
        if there:
            (folder / "report.html").write_text("of another command")
        caplog.clear()
        ended = lhpost6(command, *words, "--out", folder)
        assert "stopped here" in ended.words
        assert (WARNING in caplog.text) == there


def test_results_that_are_resumed_are_no_other_command_s(tmp_path, caplog):
    (tmp_path / "report.html").touch()
    (tmp_path / "ensemble.nc").touch()
    folder_for(tmp_path, "", "report.html", own="ensemble.nc")
    assert not caplog.text
    folder_for(tmp_path, "", "report.html", own="other.nc")
    assert WARNING in caplog.text


def test_every_command_that_writes_a_report_names_it_before():
    """By the source: a function that calls save_discovery or write_*_report gives `folder_for` the report's name."""
    checked = []
    for path in sorted(CLI.glob("*.py")):
        for function in [node for node in ast.parse(path.read_text()).body if isinstance(node, ast.FunctionDef)]:
            calls = [node for node in ast.walk(function) if isinstance(node, ast.Call)]
            called = {ast.unparse(call.func).rpartition(".")[2]: call for call in calls}
            writes = [name for name in called if name == "save_discovery" or name.endswith("_report")]
            if not writes or function.name in ELSEWHERE:
                continue
            assert "folder_for" in called, (path.name, function.name)
            given = ast.unparse(called["folder_for"])
            assert any(name in given for name in NAMED), (path.name, function.name, given)
            checked.append(function.name)
    assert {"discover", "demo", "ensemble", "calibrate", "validate", "decompose", "tune", "sine"} <= set(checked)

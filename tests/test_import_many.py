"""Many files and folders at once: each a test of a campaign, and what cannot be read is said."""

import json
from pathlib import Path

import numpy as np
import pytest
from commands import refused

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.data.campaign import load_campaign
from lhpost6_pin.data.importing import find_tests
from lhpost6_pin.data.records import load_record, save_record
from lhpost6_pin.machine.machine import load_machine

TIME = np.arange(300) / 256
PRACTICE = Path(__file__).parent / "data" / "records" / "practice_a_TX.nc"
UNIAXIAL = ("--machine", "uniaxial")


def table(amplitude: float, unit: str = "mm") -> str:
    """A lab's table of a one-axis test of 2 Hz, in its words."""
    rows = (f"{t:.8f},{amplitude * np.sin(4 * np.pi * t):.6f},0.5\n" for t in TIME)
    return f"Time (s),Table disp ({unit}),Oil temp (degC)\n" + "".join(rows)


@pytest.fixture
def campaign(tmp_path) -> Path:
    """A folder of two tests with notes beside them, and a folder in it."""
    folder = tmp_path / "t1"
    (folder / "old").mkdir(parents=True)
    (folder / "old" / "noise.csv").write_text(table(9))
    (folder / "noise.csv").write_text(table(1))
    (folder / "EQ 1.csv").write_text(table(2))
    for name in ("README.md", "notes.pdf", ".hidden.csv"):
        (folder / name).write_text("not data")
    return folder


def test_a_folder_becomes_a_campaign_by_the_command_that_the_guess_prints(lhpost6, tmp_path, campaign):
    ended = lhpost6("import", "t1", "--guess", *UNIAXIAL)
    assert ended.code == 0 and "lhpost6 import t1 --machine uniaxial --map t1_map.toml" in ended.words
    assert '# "CHANNEL" = { column = "Oil temp (degC)" }' in (tmp_path / "t1_map.toml").read_text()
    ended = lhpost6("import", "t1", *UNIAXIAL, "--map", "t1_map.toml", "--out", "made")
    assert ended.code == 0, ended
    made = load_campaign(tmp_path / "made", load_machine("uniaxial"))
    tests = {record.attrs["test"]: record for record in made.records}
    assert set(tests) == {"EQ 1", "noise"}
    for name, amplitude in (("noise", 1), ("EQ 1", 2)):
        found = tests[name]["platen_displacement"].sel(axis="x")
        # printed to 1e-6 mm
        np.testing.assert_allclose(found, 1e-3 * amplitude * np.sin(4 * np.pi * TIME), atol=1e-9)


def test_files_are_tests_of_their_own_where_it_is_said(lhpost6, tmp_path, campaign):
    files = ("t1/noise.csv", "t1/EQ 1.csv")
    assert lhpost6("import", *files, "--each", "--guess", "--out", "m.toml", *UNIAXIAL).code == 0
    assert lhpost6("import", *files, "--each", "--map", "m.toml", "--out", "made", *UNIAXIAL).code == 0
    assert sorted(path.name for path in (tmp_path / "made").iterdir()) == ["EQ 1.nc", "noise.nc"]


def test_a_file_that_cannot_be_read_does_not_keep_the_others_from_it(lhpost6, tmp_path, campaign):
    (campaign / "short.csv").write_text("Time (s),Table disp (mm),Oil temp (degC)\n0,1,2\n")
    (campaign / "other.csv").write_text("Time (s),Position (mm)\n0,1\n1,2\n2,3\n")
    assert lhpost6("import", "t1", "--guess", "--out", "m.toml", *UNIAXIAL).code == 0
    said = (tmp_path / "m.toml").read_text()
    assert (
        "other.csv: has also 'Position (mm)'; lacks 'Table disp (mm)'" in said and "short.csv: holds 1 sample" in said
    )
    ended = lhpost6("import", "t1", "--map", "m.toml", *UNIAXIAL)
    assert ended.code == 1 and sorted(p.stem for p in (tmp_path / "out" / "t1").glob("*.nc")) == ["EQ 1", "noise"]
    assert "not imported: short.csv: t1/short.csv: holds 1 sample" in ended.words
    assert "not imported: other.csv: " in ended.words and "no column 'Table disp (mm)'" in ended.words


def test_where_nothing_can_be_imported_it_is_an_error(lhpost6, tmp_path, campaign):
    assert refused(lhpost6("import", "t1", *UNIAXIAL), "This command with --guess writes a first map")
    assert not list((tmp_path / "out").rglob("*.nc"))


def test_notes_in_a_folder_are_passed_over_and_damaged_tables_are_not(tmp_path):
    texts = {
        "README.txt": "Notes of the day\n\nTest 3: oil at 38 degrees, repeated at 14:30\n",
        "log.csv": "date,who,what\nMonday,JC,second run of TX after a trip\n",
        "table.csv": "t,x\n0.0,1.0\n0.01,1.1\n",
        "damaged.csv": "t,x,y,z\n0.0,1.0,abc,2.0\n0.01,1.1,abc,2.0\n",
        "commas.csv": 't,x\n"0,0","1,0"\n"0,01","1,1"\n',
        "empty.txt": "",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    found = {test.file.name for test in find_tests([tmp_path])}
    assert found == {"table.csv", "damaged.csv", "commas.csv", "empty.txt"}
    assert [test.file.name for test in find_tests([tmp_path / "README.txt"])] == ["README.txt"]  # named, it is data


def test_names_of_tests_tell_them_apart(tmp_path, campaign):
    other = tmp_path / "t2"
    other.mkdir()
    (other / "noise.csv").write_text("")
    (other / "noise.txt").write_text("")
    assert [test.name for test in find_tests([campaign])] == ["EQ 1", "noise"]
    names = [test.name for test in find_tests([campaign, other / "noise.csv"])]
    assert names == ["t1_EQ 1", "t1_noise", "t2_noise"]
    assert [test.name for test in find_tests([other])] == ["t2_noise_csv", "t2_noise_txt"]
    with pytest.raises(RecordError, match=r"noise\.csv: is given twice"):
        find_tests([other, other / "noise.csv"])
    records = tmp_path / "panel"
    records.mkdir()
    for name in ("EQTEST.nc", "journal.jsonl"):
        (records / name).write_text("")
    with pytest.raises(RecordError, match=r"its records \(\.nc\) need no import: `lhpost6 check .*panel`"):
        find_tests([records])
    with pytest.raises(RecordError, match="holds no data file; name the folders in it: panel, t1, t2"):
        find_tests([tmp_path])
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordError, match="empty: holds no data file; name the folder of the data files"):
        find_tests([tmp_path / "empty"])


def test_an_import_warns_of_redundant_sensors_that_contradict_each_other_as_a_check_does(lhpost6, tmp_path):
    record = load_record(PRACTICE)
    record["actuator_displacement"].loc[{"actuator": "H2"}] *= 25.0
    (folder := tmp_path / "tests").mkdir()
    save_record(record, tmp_path / "TX.nc")
    assert lhpost6("export", tmp_path / "TX.nc", "--to", "csv", "--out", folder / "TX.csv").code == 0
    imported = lhpost6("import", folder / "TX.csv", "--out", tmp_path / "again.nc")
    assert refused(lhpost6("import", folder / "TX.csv", "--out", tmp_path / "again.csv"), "name it again.nc")
    checked = lhpost6("check", tmp_path / "again.nc")
    (words,) = (line for line in checked.out.splitlines() if line.startswith("warning: actuator_displacement[H2]"))
    assert "correct its unit or factor in the channel map" in words and words in imported.out
    for more in ([folder / "TX.csv", "--out", tmp_path / "again.nc"], [folder, "--out", tmp_path / "campaign"]):
        (found,) = json.loads(lhpost6("import", *more, "--json").out)["contradictions"]
        assert f"warning: {found}" in words
    assert words in lhpost6("import", folder, "--out", tmp_path / "campaign").out

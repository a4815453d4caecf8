"""Exported records hold units in their names and come back the same; the two commands from end to end."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import xarray as xr
from commands import refused
from data_files import LABELS, binary_469d, header, sines, typical_channels
from machine_cases import PRACTICE

from lhpost6_pin.core.errors import RecordError, UnknownNameError
from lhpost6_pin.core.names import AXES
from lhpost6_pin.data.channels import LAYOUT
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.filled_samples import filled_samples
from lhpost6_pin.data.importing import export_record, guess_map, is_export, load_raw, make_imported_record
from lhpost6_pin.data.records import is_measured, load_record, make_record
from lhpost6_pin.machine.machine import load_machine


@pytest.fixture(scope="module")
def record() -> xr.Dataset:
    return load_record(PRACTICE).isel(time=slice(512))


def imported(path) -> xr.Dataset:
    raws = load_raw(path)
    assert is_export(raws)
    return make_imported_record(raws, guess_map(raws, LABELS).channels, LABELS)


@pytest.mark.parametrize("form", ["csv", "mat", "parquet"])
def test_an_exported_record_comes_back_without_a_map_to_the_last_bit(tmp_path, record, form):
    if form == "parquet":
        pytest.importorskip("pyarrow")
    path = tmp_path / f"run.{form}"
    export_record(record, path, form)
    back = imported(path)
    for name in ("time", *(n for n in LAYOUT if n in record)):
        assert back[name].dims == record[name].dims
        np.testing.assert_array_equal(back[name], record[name])
    for key in ("test", "kind", "specimen", "valves_per_horizontal_actuator", "sample_rate_hz"):
        assert back.attrs[key] == record.attrs[key]


def test_a_simulated_record_with_noise_comes_back_with_it(tmp_path, record):
    """Without the attribute it had been taken for one without noise."""
    noisy = record.assign_attrs(
        kind="simulated", noise="simulated: usual instruments", machine="LHPOST6", cut="ends in motion"
    )
    export_record(noisy, tmp_path / "run.csv", "csv")
    back = imported(tmp_path / "run.csv")
    assert is_measured(back)
    for key in ("kind", "noise", "machine", "cut"):
        assert back.attrs[key] == noisy.attrs[key]


def test_a_gap_that_is_filled_makes_no_finding(tmp_path):
    """Five channels had been called stuck elsewhere, and a displacement turned, for a gap of 0.2 s in motion."""
    whole = load_record(PRACTICE)
    export_record(whole, tmp_path / "run.csv", "csv")
    lines = (tmp_path / "run.csv").read_text().splitlines(keepends=True)
    first = next(k for k, line in enumerate(lines) if line[0] not in "#t")
    (tmp_path / "run.csv").write_text("".join(lines[: first + 3000] + lines[first + 3100 :]))
    raws = load_raw(tmp_path / "run.csv")
    channels = guess_map(raws, LABELS).channels
    filled = replace(channels, test=replace(channels.test, fill_gaps=100))
    back = make_imported_record(raws, filled, LABELS)
    assert np.flatnonzero(filled_samples(back)).tolist() == [*range(3000, 3100)]
    before, after = ([f for f in check_dataset(r, load_machine()) if f.severity != "info"] for r in (whole, back))
    assert after == before


def test_every_column_of_a_table_names_its_unit(tmp_path, record):
    export_record(record, tmp_path / "run.csv", "csv")
    head = next(line for line in (tmp_path / "run.csv").read_text().splitlines() if not line.startswith("#"))
    names = head.split(",")
    assert names[:2] == ["time [s]", "platen_displacement_x [m]"]
    assert "platen_velocity_yaw [rad/s]" in names and "spool_command_H1 [1]" in names
    assert all(name.endswith("]") for name in names)


def test_every_matlab_variable_names_its_unit_and_is_a_column(tmp_path, record):
    export_record(record, tmp_path / "run.mat", "mat")
    content = scipy.io.loadmat(tmp_path / "run.mat")
    assert content["platen_acceleration_yaw_rad_s2"].shape == (512, 1)
    assert {"time_s", "spool_command_H1_fraction", "facts"} <= set(content)


def test_what_a_record_holds_beyond_the_layout_is_exported_too(tmp_path, record):
    more = record.assign(extra=(("time", "k"), np.zeros((512, 2)), {"units": "m"}), note=("k", np.zeros(2)))
    export_record(more, tmp_path / "run.csv", "csv")
    (raw,) = load_raw(tmp_path / "run.csv")
    assert raw.names[-2:] == ("extra_0 [m]", "extra_1 [m]")


def test_columns_of_different_units_are_exported_and_listed_with_their_own(tmp_path, record):
    """Moments of a specimen were labelled N, and shared a range with its forces."""
    labels, units = ["fx", "mx"], {"units": "N, N m", "column_units": "N, N m"}
    wrench = xr.DataArray(
        np.outer(1.0 + np.arange(512.0), [1.0, -1.0]), {"interface_axis": labels}, ("time", "interface_axis")
    )
    more = record.assign(specimen_wrench=wrench.assign_attrs(units))
    export_record(more, tmp_path / "run.csv", "csv")
    (raw,) = load_raw(tmp_path / "run.csv")
    assert raw.names[-2:] == ("specimen_wrench_fx [N]", "specimen_wrench_mx [N m]")
    said = [str(f) for f in check_dataset(more, load_machine()) if "specimen_wrench" in str(f)]
    assert len(said) == 2 and "N, 512 x 1, 1 to 512" in said[0] and "N m, 512 x 1, -512 to -1" in said[1]


def test_an_unknown_format_a_broken_record_and_a_missing_package_are_refused(tmp_path, record, monkeypatch):
    with pytest.raises(UnknownNameError, match="csv, mat, parquet"):
        export_record(record, tmp_path / "run.xls", "xls")
    broken = make_record([0.0, 0.1], {"supply_pressure": [1.0, 2.0]}, {}, {}).assign_coords(time=[0.1, 0.0])
    with pytest.raises(RecordError, match="does not increase"):
        export_record(broken, tmp_path / "run.csv", "csv")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(RecordError, match=rf"^{tmp_path}/run.parquet: .*pip install pyarrow"):
        export_record(record, tmp_path / "run.parquet", "parquet")
    long = record.assign({"x" * 64: ("time", np.zeros(512))})
    with pytest.raises(RecordError, match=rf"^{tmp_path}/run.mat: x+_ is longer than the 63 characters"):
        export_record(long, tmp_path / "run.mat", "mat")
    assert not list(tmp_path.iterdir())


# --------------------------------------------------------------------------------------------- commands
def test_guess_then_import_shows_source_unit_and_range_of_every_channel(lhpost6, tmp_path):
    typical = typical_channels()
    values = sines(512, len(typical))
    columns = [(t.description, t.unit, values[:, k]) for k, t in enumerate(typical)]
    (tmp_path / "EQ1.bin").write_bytes(binary_469d(header(columns, 1 / 256), values))
    ended = lhpost6("import", "EQ1.bin", "--guess")
    assert ended.code == 0 and "lhpost6 import EQ1.bin --map EQ1_map.toml" in ended.words
    assert lhpost6("import", "EQ1.bin", "--guess").code == 2  # the map may have been edited
    ended = lhpost6("import", "EQ1.bin", "--map", "EQ1_map.toml", "--out", "EQ1.nc")
    assert ended.code == 0
    assert "platen_displacement[x] EQ1.bin: Long Displ fbk [in] m" in ended.words
    record = load_record(tmp_path / "EQ1.nc", LABELS)
    assert record.attrs["sample_rate_hz"] == 256
    column = next(k for k, t in enumerate(typical) if t.channel == "platen_acceleration[y]")
    found = record["platen_acceleration"].sel(axis="y")
    np.testing.assert_allclose(found, 9.80665 * values[:, column], rtol=2.0**-23, atol=0)  # rounding of a float32
    assert "platen_acceleration[y] = EQ1.bin: Lat Accel fbk [g]" in record.attrs["columns"]


def test_a_wrong_unit_is_seen_after_the_import(lhpost6, tmp_path):
    rows = "".join(f"{k / 256},{20 * np.sin(k / 40):.6f},0\n" for k in range(600))
    (tmp_path / "run.csv").write_text("time [s],x,other\n" + rows)
    zeros = "".join(f'"platen_displacement[{a}]" = {{ constant = 0.0, unit = "rad" }}\n' for a in AXES[3:])
    zeros += "".join(f'"platen_displacement[{a}]" = {{ constant = 0.0, unit = "m" }}\n' for a in "yz")
    given = '[channel]\n"platen_displacement[x]" = { column = "x", unit = "m" }\n'
    (tmp_path / "map.toml").write_text(given + zeros)
    ended = lhpost6("import", "run.csv", "--map", "map.toml")
    assert ended.code == 0 and "wrote out/run.nc" in ended.words
    assert "reaches 20: mm or in for m?" in ended.words


def test_data_that_are_no_export_are_not_overwritten(lhpost6, tmp_path, record):
    record.to_netcdf(tmp_path / "run7.nc", engine="h5netcdf")
    own = "time [s],Table disp [in]\n0,1\n1,2\n"
    (tmp_path / "run7.csv").write_text(own)
    assert refused(lhpost6("export", "run7.nc", "--to", "csv"), "run7.csv: is there and is no earlier export")
    assert (tmp_path / "run7.csv").read_text() == own
    assert refused(lhpost6("export", "run7.nc", "--to", "csv", "--out", "run7.mat"), "of format csv ends in .csv")
    for _ in range(2):  # an earlier export is written again
        assert lhpost6("export", "run7.nc", "--to", "csv", "--out", "run8.csv").code == 0


def test_an_export_is_imported_without_a_map(lhpost6, tmp_path, record):
    record.to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    assert lhpost6("export", "a.nc", "--to", "csv")[:2] == (0, "wrote a.csv\n")
    before = (tmp_path / "a.csv").read_bytes()
    assert refused(lhpost6("import", "a.csv", "--out", "a.csv"), "is one of the files to import")
    assert (tmp_path / "a.csv").read_bytes() == before
    ended = lhpost6("import", "a.csv", "--out", "b.nc")
    assert ended.code == 0 and "0 errors" in ended.words
    np.testing.assert_array_equal(load_record(tmp_path / "b.nc")["actuator_force"], record["actuator_force"])


@pytest.mark.parametrize(
    ("arguments", "phrase"),
    [
        (("import", "gone.csv"), "gone.csv: no such file"),
        (("import", "run.csv"), "with --guess writes a first map"),
        (("import", "run.csv", "--guess", "--map", "m.toml"), "give one of them"),
        (("import", "run.csv", "--map", "gone.toml"), "gone.toml: cannot be read"),
        (("export", "gone.nc", "--to", "csv"), "gone.nc: no such file"),
        (("export", "gone.nc", "--to", "xls"), "no such file"),
    ],
)
def test_a_command_that_cannot_go_on_says_why(lhpost6, tmp_path, arguments, phrase):
    (tmp_path / "run.csv").write_text("time [s],x\n0,1\n1,2\n")
    assert refused(lhpost6(*arguments), phrase)


def test_the_first_line_of_an_exported_table_that_is_no_comment_names_columns_with_units(tmp_path, record):
    """As `tutorials/data.md` shows it."""
    export_record(record, tmp_path / "a.csv", "csv")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    names = next(line for line in lines if not line.startswith("#")).split(",")
    assert names[0] == "time [s]" and all(name.endswith("]") for name in names)
    page = (Path(__file__).parents[1] / "scripts/docs/pages/tutorials/data.md").read_text()
    assert "grep -v '^#' TX_si.csv | head -n 1" in page

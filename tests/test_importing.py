"""Data files of every format give the numbers that were put in; bad ones are refused with file, place and remedy."""

import contextlib
import re
import struct
from dataclasses import replace
from pathlib import Path
from unittest import mock

import h5py
import numpy as np
import pytest
import scipy.io
import xarray as xr
from data_files import LABELS, binary_469d, header, raw, sines, text_469d, typical_channels
from hypothesis import given
from hypothesis import strategies as st

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.core.units import quantity_unit
from lhpost6_pin.data import channels as channels_module
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.filled_samples import stated_constants
from lhpost6_pin.data.importing import (
    ChannelMap,
    Source,
    TestFacts,
    guess_map,
    load_map,
    load_raw,
    make_imported_record,
    save_map,
)
from lhpost6_pin.data.importing.channel_units import si_factor, unit_in_name
from lhpost6_pin.data.importing.raw import RawTest, make_raw
from lhpost6_pin.data.records import load_record, save_record
from lhpost6_pin.machine.machine import load_machine

SINGLE = 2.0**-24  # relative: the rounding of a float32
VALUES = sines(400, 3)
NAMES = ("Long Displ fbk", "Lat Accel fbk", "H1 Press A")
UNITS = ("in", "g", "psi")
CHANNELS = [(name, unit, VALUES[:, k]) for k, (name, unit) in enumerate(zip(NAMES, UNITS, strict=True))]
RATE = 256.0
TIME = np.arange(400) / RATE


def put(folder: Path, name: str, content: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def one(path: Path):
    (found,) = load_raw(path)
    return found


# --------------------------------------------------------------------------------------------- 469D
@pytest.mark.parametrize("order", ["<", ">"])
def test_a_binary_469d_file_gives_its_channels_in_either_byte_order(tmp_path, order):
    found = one(put(tmp_path, "run.bin", binary_469d(header(CHANNELS, 1 / RATE), VALUES, order)))
    assert (found.names, found.units) == (NAMES, UNITS)
    np.testing.assert_allclose(found.values, VALUES, rtol=SINGLE, atol=0)
    np.testing.assert_array_equal(found.time, TIME)
    assert found.facts["FILE_INFO"] == "closed form"


@pytest.mark.parametrize("announced", [True, False], ids=["EXTENDED_HEADER_RECORDS", "not announced"])
def test_further_header_records_are_facts_and_not_samples(tmp_path, announced):
    further = {"TABLE": "LHPOST6", "SPECIMEN": "none"}
    extended = {"FILE_TYPE": "TIME_SERIES_WITH_EXTENDED_HEADER", "EXTENDED_HEADER_RECORDS": "2"} if announced else {}
    found = one(put(tmp_path, "run", binary_469d(header(CHANNELS, 1 / RATE, extended | further), VALUES)))
    assert found.facts["TABLE"] == "LHPOST6"
    np.testing.assert_allclose(found.values, VALUES, rtol=SINGLE, atol=0)


@pytest.mark.parametrize("between", ["", ": ", " = ", "\t", ","])
@pytest.mark.parametrize("separator", [" ", "\t", ", "])
def test_a_text_469d_file_is_read_however_it_separates(tmp_path, between, separator):
    found = one(put(tmp_path, "run.txt", text_469d(header(CHANNELS, 1 / RATE), VALUES, between, separator)))
    assert (found.names, found.units) == (NAMES, UNITS)
    np.testing.assert_allclose(found.values, VALUES, rtol=1e-8, atol=0)  # nine digits were written
    np.testing.assert_array_equal(found.time, TIME)


GOOD = header(CHANNELS, 1 / RATE)
BAD_469D = {
    "cut in a number": (GOOD, lambda b: b[:-3], ("float32", "cut short")),
    "cut in a sample": (GOOD, lambda b: b[:-4], ("sample 399", "2 of 3 channels")),
    "cut in the header": (GOOD, lambda b: b[: 7 * 128 + 50], ("DESC.CHAN_2", "missing")),
    "no samples": (GOOD, lambda b: b[: 11 * 128], ("0 sample",)),
    "a key given twice": (GOOD, lambda b: b[:128] + b, ("byte 128: FILE_TYPE is given twice",)),
    "too many channels": (header(CHANNELS, 1 / RATE, {"CHANNELS": "4"}), bytes, ("CHANNELS is 4", "DESC.CHAN_4")),
    "far too many": (header(CHANNELS, 1 / RATE, {"CHANNELS": 8 * "9"}), bytes, ("CHANNELS is 99999999", "are 3")),
    "too few channels": (header(CHANNELS, 1 / RATE, {"CHANNELS": "2"}), bytes, ("CHANNELS is 2", "3")),
    "channels no number": (header(CHANNELS, 1 / RATE, {"CHANNELS": "three"}), bytes, ("CHANNELS is 'three'",)),
    "no channels": (header(CHANNELS, 1 / RATE, {"CHANNELS": None}), bytes, ("CHANNELS is missing",)),
    "no step": (header(CHANNELS, 1 / RATE, {"DELTA_T": None}), bytes, ("DELTA_T is missing",)),
    "step no number": (header(CHANNELS, "fast"), bytes, ("DELTA_T is 'fast'",)),
    "step negative": (header(CHANNELS, -0.1), bytes, ("DELTA_T is '-0.1'",)),
    "records missing": (GOOD | {"EXTENDED_HEADER_RECORDS": "9"}, bytes, ("9 more records",)),
}


@pytest.mark.parametrize("case", BAD_469D)
def test_a_damaged_469d_file_is_refused_with_its_key_or_sample(tmp_path, case):
    entries, change, phrases = BAD_469D[case]
    path = put(tmp_path, "run.bin", change(binary_469d(entries, VALUES)))
    with pytest.raises(RecordError) as caught:
        load_raw(path)
    assert str(path) in str(caught.value)
    for phrase in phrases:
        assert phrase in str(caught.value)


def test_a_signalling_nan_of_a_binary_469d_file_is_a_hole_like_any_other(tmp_path):
    """In double precision it becomes a quiet one, of which numpy warns; warnings fail tests here."""
    content = binary_469d(GOOD, VALUES)[:-4] + struct.pack("<I", 0x7FA00000)
    found = one(put(tmp_path, "run.bin", content))
    assert np.argwhere(np.isnan(found.values)).tolist() == [[len(VALUES) - 1, len(CHANNELS) - 1]]


@pytest.mark.parametrize(
    ("change", "phrase"),
    [
        (lambda t: t.replace(b"\r\n0 ", b"\r\nzero ", 1), "line 12, number 1: 'zero' is not a number"),
        (lambda t: t[: t.rstrip().rfind(b" ")], "line 411: 2 numbers for 3 channels"),
    ],
)
def test_a_damaged_text_469d_file_is_refused_with_its_line(tmp_path, change, phrase):
    content = text_469d(GOOD, VALUES)
    with pytest.raises(RecordError, match=phrase):
        load_raw(put(tmp_path, "run.txt", change(content)))


# --------------------------------------------------------------------------------------------- tables
def table(separator=",", decimal=".", head=None) -> str:
    head = head or ["time [s]", *(f"{n} [{u}]" for n, u in zip(NAMES, UNITS, strict=True))]
    rows = [separator.join(map(repr, row)).replace(".", decimal) for row in np.column_stack([TIME, VALUES]).tolist()]
    return "\n".join([separator.join(head), *rows, ""])


@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("|", "."), (", ", ".")]
)
def test_a_table_in_text_is_read_to_the_last_digit_whatever_its_marks(tmp_path, separator, decimal):
    found = one(put(tmp_path, "run.csv", "# test: EQ1\n\n" + table(separator, decimal)))
    assert [name.split(" [")[0] for name in found.names] == list(NAMES)
    assert found.units == UNITS
    np.testing.assert_array_equal(found.values, VALUES)
    np.testing.assert_array_equal(found.time, TIME)
    assert found.facts["test"] == "EQ1"


def test_blanks_may_separate_and_the_header_may_be_a_comment(tmp_path):
    rows = [f"  {1000 * t:.9f}   {a:.9e}  {b:.9e}" for t, (a, b, _) in zip(TIME, VALUES, strict=True)]
    found = one(put(tmp_path, "run.txt", "\n".join(["# time_ms x_mm y_g", *rows])))
    assert (found.names, found.units) == (("x_mm", "y_g"), ("mm", "g"))
    np.testing.assert_allclose(found.time, TIME, atol=1e-12)  # nine decimals of a millisecond


@pytest.mark.parametrize("units", ["s,in,g,psi", "[s],[in],[g],[psi]", "(s),(in),(g),(psi)"])
def test_units_may_stand_in_a_row_below_the_names(tmp_path, units):
    text = table(head=["Time", *NAMES]).split("\n", 1)
    found = one(put(tmp_path, "run.csv", f"recorded at noon\n{text[0]}\n{units}\n{text[1]}"))
    assert (found.names, found.units) == (NAMES, UNITS)
    np.testing.assert_array_equal(found.values, VALUES)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_a_degree_sign_is_read_in_each_usual_encoding(tmp_path, encoding):
    found = one(put(tmp_path, "run.csv", "t [s],Roll [°]\n0,1\n1,2\n".encode(encoding)))
    assert found.units == ("°",)


def test_each_line_may_end_with_a_separator_and_holes_are_nan(tmp_path):
    found = one(put(tmp_path, "run.csv", "time [s],a [m],b [m],\n0,1,2,\n1,,3,\n2,nan,4,\n"))
    assert found.names == ("a [m]", "b [m]")
    np.testing.assert_array_equal(found.values, [[1, 2], [np.nan, 3], [np.nan, 4]])


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        ("", "is empty"),
        (" \n\n", "is empty"),
        ("a,b\nc,d\n", "no row of numbers"),
        ("t [s],x [m],state\n0.0,0.1,OK\n0.1,0.2,OK\n", "line 2, column 3: 'OK' is neither a number"),
        ("t [s];x [m];state\n0,0;0,1;OK\n0,1;0,2;OK\n", "line 2, column 3: 'OK' is neither a number"),
        ("1,2\n3,4\n", "no header row of 2 names"),
        ("s,m\n1,2\n3,4\n", "units above the numbers, but no names"),
        ("time [s],x [m]\n0,1\n1,2\n2,two\n", r"line 4, column 'x \[m\]': 'two' is not a number"),
        ("time [s],x [m]\n0,1\n1,2\n2\n", "line 4: 1 fields, the header has 2"),
        ("time [s],x [m]\n0,1\n1,2\n2,3,4\n", "line 4: 3 fields"),
        ("time [s],t [s],x [m]\n0,0,1\n1,1,2\n", "all named as time"),
        ("time [s],x [m]\n0,1\n", "1 sample"),
        ("time [s]\n0\n1\n", "no channel"),
    ],
)
def test_a_bad_table_is_refused_with_line_and_column(tmp_path, text, phrase):
    with pytest.raises(RecordError, match=phrase):
        load_raw(put(tmp_path, "run.csv", text))


# --------------------------------------------------------------------------------------------- clock times
def stamped(rate: float, digits: int, start: str, count: int = 400, form: str = "%Y-%m-%d %H:%M:%S.%f") -> list[str]:
    """Times as a logger writes them, to `digits` of six."""
    exact = np.datetime64(start, "ns") + np.rint(np.arange(count) / rate * 1e9).astype("timedelta64[ns]")
    shown = (exact + np.timedelta64(5 * 10 ** (8 - digits), "ns")).astype("datetime64[us]").tolist()
    return [t.strftime(form)[: len(t.strftime(form)) - 6 + digits] for t in shown]


def of_logger(stamps: list[str], separator: str = ",", head: str = "Timestamp") -> str:
    rows = [separator.join([t, repr(x)]) for t, x in zip(stamps, VALUES[:, 0].tolist(), strict=True)]
    return "\n".join([separator.join([head, "x [m]"]), *rows, ""])


@pytest.mark.parametrize("head", ["Timestamp", "Date/Time", "Time", "Uhrzeit"])
@pytest.mark.parametrize(
    ("form", "separator"),
    [
        ("%Y-%m-%d %H:%M:%S.%f", ","),
        ("%Y-%m-%dT%H:%M:%S.%f", "\t"),
        ("%d.%m.%Y %H:%M:%S,%f", ";"),
        ("%H:%M:%S.%f", ","),
    ],
)
def test_clock_times_are_read_as_seconds_since_the_first(tmp_path, head, form, separator):
    """Also past midnight; to the microsecond that is written."""
    for start in ("2026-01-01T12:00:00", "2026-12-31T23:59:59.500000"):
        found = one(put(tmp_path, "run.csv", of_logger(stamped(RATE, 6, start, form=form), separator, head)))
        assert found.names == ("x [m]",)
        np.testing.assert_allclose(found.time, TIME, rtol=0, atol=1.01e-6)
        np.testing.assert_array_equal(found.values[:, 0], VALUES[:, 0])


def test_clock_times_to_the_millisecond_stand_for_uniform_times(tmp_path):
    found = one(put(tmp_path, "run.csv", of_logger(stamped(RATE, 3, "2026-01-01T23:59:59"))))
    record = make_imported_record([replace_units(found)], supply(), LABELS)
    # the fit averages 400 rounding errors of at most half a millisecond, and of the first stamp
    np.testing.assert_allclose(np.diff(record["time"]), 1.0 / RATE, rtol=1e-4)


def replace_units(found: RawTest) -> RawTest:
    """The column as one of `supply`."""
    return raw(found.values, ["Pa"], found.time)


def test_hours_of_half_a_day_are_those_of_noon(tmp_path):
    stamps = ["1/2/2026 11:59:59.5 AM", "1/2/2026 12:00:00.0 PM", "1/2/2026 12:00:00.5 PM"]
    found = one(put(tmp_path, "run.csv", "When,x [m]\n" + "".join(f"{t},{k}\n" for k, t in enumerate(stamps))))
    np.testing.assert_array_equal(found.time, [0.0, 0.5, 1.0])


def test_a_named_column_of_seconds_is_taken_before_clock_times(tmp_path):
    text = "Stamp,time [s],x [m]\n12:00:00.0,0,1\n12:00:00.5,0.5,2\n"
    np.testing.assert_array_equal(one(put(tmp_path, "run.csv", text)).time, [0.0, 0.5])


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
def test_a_date_in_a_column_of_its_own_is_read_with_the_time_of_day_beside_it(tmp_path, separator):
    rows = ["Date Time x_[m]", "31.12.2026 23:59:59.5 1", "01.01.2027 00:00:00.0 2", "01.01.2027 00:00:00.5 3"]
    found = one(put(tmp_path, "run.csv", "\n".join(row.replace(" ", separator) for row in rows) + "\n"))
    np.testing.assert_array_equal(found.time, [0.0, 0.5, 1.0])
    assert list(found.names) == ["x_[m]"]
    np.testing.assert_array_equal(found.values[:, 0], [1.0, 2.0, 3.0])


def test_dates_without_times_of_day_are_refused(tmp_path):
    with pytest.raises(RecordError, match="'Date' has dates, and no column has times of day; leave it out"):
        one(put(tmp_path, "run.csv", "Date,x [m]\n2026-01-01,1\n2026-01-01,2\n"))


def test_a_header_of_another_length_is_named(tmp_path):
    with pytest.raises(RecordError, match=r"line 2: no header row of 3 names.*has 2 \(time \[s\], x \[m\]\)"):
        one(put(tmp_path, "run.csv", "time [s],x [m]\n0,1,2\n0.5,2,3\n"))


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        ("12:00:00,1\n12:00:00,2\n", "line 3, column 'Stamp': .* coarser than the samples; .* file_rate"),
        ("12:00:00,1\nnoon,2\n", "line 3, column 'Stamp': 'noon' is no time"),
        ("2026-01-01 12:00:00,1\n2026-01-02 12:00:01,2\n", "line 3, .* another day, without midnight between"),
        ("2026-01-01 23:00:00,1\n2026-01-01 01:00:00,2\n", "line 3, .* is earlier on the day of the line before; sort"),
    ],
)
def test_clock_times_that_are_no_time_axis_are_refused_with_line_and_column(tmp_path, text, phrase):
    with pytest.raises(RecordError, match=phrase):
        load_raw(put(tmp_path, "run.csv", "Stamp,x [m]\n" + text))


def test_a_column_that_is_no_number_is_named(tmp_path):
    text = "State,Time,x [m],y [m]\nrun_1,12:00:00.0,1,2\nrun_1,12:00:00.5,1,2\n"
    with pytest.raises(RecordError, match=r"line 2, column 1: 'run_1' is neither .* leave it out"):
        load_raw(put(tmp_path, "run.csv", text))


@pytest.mark.parametrize(
    "text",
    [
        "time [s],x [m]\n0,00,0,1\n0,01,0,2\n0,02,0,3\n",
        "time [s],x [m]\n0,0\n1,1\n2,3\n3,0,05\n",
        'time [s],x [m]\n"0,00","0,1"\n"0,01","0,2"\n',
        "time [s];x [m]\n0.00;0.1\n0.01;0.2\n0.02;0,3\n",
    ],
    ids=["between commas", "one between commas", "in quotes", "one among points"],
)
def test_decimal_commas_that_cannot_be_told_from_separators_are_named(tmp_path, text):
    advice = r"write decimals with points, as 0\.01, or all of them with commas and semic"
    with pytest.raises(RecordError, match=advice):
        load_raw(put(tmp_path, "run.csv", text))
    as_advised = put(tmp_path, "same.csv", "time [s];x [m]\n0,00;0,1\n0,01;0,2\n0,02;0,3\n")
    np.testing.assert_array_equal(one(as_advised).values[:, 0], [0.1, 0.2, 0.3])


def test_a_parquet_table_is_read_with_its_units(tmp_path):
    pd = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    frame = pd.DataFrame({"x [mm]": VALUES[:, 0], "note": "text"}, index=pd.Index(TIME, name="time [s]"))
    frame.to_parquet(tmp_path / "run.parquet")
    found = one(tmp_path / "run.parquet")
    assert (found.names, found.units) == (("x [mm]",), ("mm",))
    np.testing.assert_array_equal(found.time, TIME)


# --------------------------------------------------------------------------------------------- MATLAB, HDF5, TDMS
@pytest.mark.parametrize("version", ["4", "5"])
def test_matlab_variables_share_a_time_vector(tmp_path, version):
    more = {"scalar": 3.0, "about": "a test"} if version == "5" else {}
    scipy.io.savemat(tmp_path / "run.mat", {"time": TIME, "x_in": VALUES[:, 0], **more}, format=version)
    found = one(tmp_path / "run.mat")
    assert (found.names, found.units) == (("x_in",), ("in",))
    np.testing.assert_array_equal(found.time, TIME)
    np.testing.assert_array_equal(found.values[:, 0], VALUES[:, 0])
    assert version == "4" or found.facts["about"] == "a test"


@pytest.mark.parametrize("transposed", [False, True])
def test_a_matlab_struct_may_hold_a_table_with_names_units_and_a_rate(tmp_path, transposed):
    names, units = (np.array(texts, dtype=object) for texts in (NAMES, UNITS))
    content = {"data": VALUES.T if transposed else VALUES, "names": names, "units": units, "fs": RATE}
    content["calibration"] = np.eye(2)
    scipy.io.savemat(tmp_path / "run.mat", {"run1": content})
    found = load_raw(tmp_path / "run.mat")[0]
    assert found.names == tuple(f"{n} [{u}]" for n, u in zip(NAMES, UNITS, strict=True))
    assert found.units == UNITS
    np.testing.assert_array_equal(found.values, VALUES)
    np.testing.assert_array_equal(found.time, TIME)


@pytest.mark.parametrize("names", ["chanNames", "channel_names", "ChNames", "signalNames"])
@pytest.mark.parametrize("clock", ["time", "sampleRate", "column"])
def test_a_matlab_table_may_stand_beside_names_and_units_of_its_channels(tmp_path, names, clock):
    content = {"data": VALUES, names: np.array(NAMES, object), "units": np.array(UNITS, object)}
    if clock == "column":
        labels, units = ([first, *texts] for first, texts in (("Time", NAMES), ("ms", UNITS)))
        content |= {"data": np.column_stack([1e3 * TIME, VALUES])}
        content |= {names: np.array(labels, object), "units": np.array(units, object)}
    content |= {"time": {"time": TIME}, "sampleRate": {"sampleRate": RATE}, "column": {}}[clock]
    scipy.io.savemat(tmp_path / "run.mat", content)
    found = one(tmp_path / "run.mat")
    assert found.names == tuple(f"{n} [{u}]" for n, u in zip(NAMES, UNITS, strict=True))
    assert found.units == UNITS
    np.testing.assert_array_equal(found.values, VALUES)
    np.testing.assert_allclose(found.time, TIME, rtol=1e-14)


@pytest.mark.parametrize("cells", [[np.arange(3.0), np.arange(2.0)], [np.array(["a", "b"], object), "c"]])
def test_cells_that_are_no_texts_are_no_names_and_no_damage(tmp_path, cells):
    labels = np.empty(len(cells), object)
    labels[:] = cells
    scipy.io.savemat(tmp_path / "run.mat", {"data": VALUES[:, :2], "time": TIME, "channels": labels})
    np.testing.assert_array_equal(one(tmp_path / "run.mat").values, VALUES[:, :2])


def test_a_unit_that_was_left_empty_leaves_the_others(tmp_path):
    units = np.array([UNITS[0], *[np.zeros(0)] * (len(UNITS) - 1)], object)
    scipy.io.savemat(tmp_path / "run.mat", {"data": VALUES, "chanNames": np.array(NAMES, object), "units": units})
    assert one(tmp_path / "run.mat").units == (UNITS[0], *[None] * (len(UNITS) - 1))


def test_matlab_structs_of_two_rates_are_two_samplings(tmp_path):
    slow = {"t": TIME[::2], "x": VALUES[::2, 0]}
    scipy.io.savemat(tmp_path / "run.mat", {"fast": {"t": TIME, "x": VALUES[:, 0]}, "slow": slow})
    fast, slow = load_raw(tmp_path / "run.mat")
    assert (fast.names, slow.names) == (("fast.x",), ("slow.x",))
    np.testing.assert_array_equal(slow.time, TIME[::2])


def test_a_matlab_file_of_version_7_3_is_read_as_one_of_version_5(tmp_path):
    with h5py.File(tmp_path / "run.mat", "w", userblock_size=512) as file:  # as MATLAB lays it out: axes reversed
        names = [
            file.create_dataset(f"#refs#/{k}", data=np.array([list(map(ord, n))], np.uint16).T)
            for k, n in enumerate(NAMES)
        ]
        for text in names:
            text.attrs["MATLAB_class"] = np.bytes_("char")
        group = file.create_group("run1")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        group["data"] = VALUES.T
        group["time"] = TIME[None]
        cell = group.create_dataset("names", (1, 3), dtype=h5py.ref_dtype)
        cell[0] = [text.ref for text in names]
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
    with (tmp_path / "run.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116))
    found = one(tmp_path / "run.mat")
    assert found.names == NAMES
    np.testing.assert_array_equal(found.values, VALUES)
    np.testing.assert_array_equal(found.time, TIME)


@pytest.mark.parametrize("clock", ["time", "dt of the dataset", "rate of the file"])
def test_hdf5_datasets_take_time_from_beside_or_from_an_attribute(tmp_path, clock):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        group = file.create_group("table")
        data = group.create_dataset("disp", data=VALUES[:, 0])
        data.attrs["units"] = "mm"
        if clock == "time":
            group["time"] = TIME
        elif clock == "rate of the file":
            file.attrs["sample_rate"] = RATE
        else:
            data.attrs["dt"] = 1 / RATE
    found = one(tmp_path / "run.h5")
    assert (found.names, found.units) == (("table.disp",), ("mm",))
    np.testing.assert_array_equal(found.time, TIME)


@pytest.mark.parametrize("engine", ["scipy", "h5netcdf"])
def test_netcdf_tables_have_a_column_for_each_label(tmp_path, engine):
    values = (("time", "place"), VALUES, {"units": "mm, g, psi"})
    xr.Dataset({"sensor": values}, {"time": ("time", TIME, {"units": "s"}), "place": ["p", "q", "r"]}).to_netcdf(
        tmp_path / "run.nc", engine=engine
    )
    found = one(tmp_path / "run.nc")
    assert found.names == ("sensor_p", "sensor_q", "sensor_r")
    assert found.units == ("mm", "g", "psi")
    np.testing.assert_array_equal(found.values, VALUES)


def test_tdms_channels_bring_unit_and_interval(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    about = {"wf_increment": 1 / RATE, "unit_string": "g"}
    with nptdms.TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment([nptdms.ChannelObject("Table", "Ax", VALUES[:, 0], properties=about)])
        writer.write_segment([nptdms.ChannelObject("Table", "slow", VALUES[:8, 0], properties={"wf_increment": 1.0})])
    fast, slow = load_raw(tmp_path / "run.tdms")
    assert (fast.names, fast.units, slow.names) == (("Ax",), ("g",), ("slow",))
    np.testing.assert_array_equal(fast.values[:, 0], VALUES[:, 0])
    np.testing.assert_array_equal(slow.time, np.arange(8))


# --------------------------------------------------------------------------------------------- any file
@pytest.mark.parametrize(
    ("content", "phrase"),
    [
        (b"", "is empty"),
        (b"\x00\x01\x02" * 99, "unknown format; readable are MTS 469D"),
        (b"MATLAB 5.0 MAT-file" + b"\x07" * 200, "not a MATLAB file, or damaged"),
        (b"MATLAB 7.3 MAT-file" + b"\x07" * 600, "not a MATLAB v7.3 file"),
        (b"\x89HDF\r\n\x1a\n" + b"\x07" * 200, "not an HDF5 file"),
        (b"CDF\x01" + b"\x07" * 200, "not a netCDF file"),
        (b"TDSm" + b"\x07" * 200, "holds no array of samples"),
        (b"PAR1" + b"\x07" * 200, "not a Parquet file"),
    ],
)
def test_a_file_that_is_not_what_it_begins_as_is_refused_by_name(tmp_path, content, phrase):
    path = put(tmp_path, "run.dat", content)
    with pytest.raises(RecordError, match=re.escape(str(path)) + ".*" + phrase):
        load_raw(path)


def test_a_folder_a_missing_file_and_one_that_may_not_be_read_are_refused(tmp_path, monkeypatch):
    with pytest.raises(RecordError, match="is a folder"):
        load_raw(tmp_path)
    with pytest.raises(RecordError, match="no such file"):
        load_raw(tmp_path / "gone.csv")
    path = put(tmp_path, "run.csv", table())
    monkeypatch.setattr(Path, "read_bytes", mock.Mock(side_effect=PermissionError(13, "Permission denied")))
    with pytest.raises(RecordError, match=r"run.csv: cannot be read: .*Permission denied"):
        load_raw(path)


@pytest.mark.parametrize(("module", "content"), [("nptdms", b"TDSm1234"), ("pyarrow", b"PAR11234")])
def test_a_missing_package_is_named_with_how_to_install_it(tmp_path, monkeypatch, module, content):
    monkeypatch.setitem(__import__("sys").modules, module, None)  # importing it now fails
    with pytest.raises(RecordError, match=rf"needs {module}: pip install {module}"):
        load_raw(put(tmp_path, "run.dat", content))


# --------------------------------------------------------------------------------------------- units
@pytest.mark.parametrize(
    ("unit", "si", "factor"),
    [
        ("in", "m", 0.0254),
        ("IN", "m", 0.0254),
        ("g", "m/s2", 9.80665),
        ("G", "m/s2", 9.80665),
        ("in/sec^2", "m/s2", 0.0254),
        ("m_s2", "m/s2", 1),
        ("m s-2", "m/s2", 1),
        ("deg/s", "rad/s", np.pi / 180),
        ("°", "rad", np.pi / 180),
        ("mrad", "rad", 1e-3),
        ("psi", "Pa", 6894.757293168361),
        ("MPA", "Pa", 1e6),
        ("mPa", "Pa", 1e-3),
        ("kips", "N", 4448.2216152605),
        ("KN", "N", 1e3),
        ("%", "1", 0.01),
        ("ms", "s", 1e-3),
    ],
)
def test_units_as_facilities_spell_them_have_their_size(unit, si, factor):
    assert quantity_unit(unit) == si
    assert si_factor(unit, si) == pytest.approx(factor, rel=1e-12)  # products of a few floats


@pytest.mark.parametrize(
    "unit", ["V", "degC", "dB", "counts", "furlong/fortnight^9", "import os", "m**m", "", "1e9 m", "rad"]
)
def test_what_is_no_unit_of_acceleration_is_refused(unit):
    with pytest.raises(RecordError):
        si_factor(unit, "m/s2")


@given(st.text(max_size=12))
def test_any_text_is_a_unit_or_a_clear_error(text):
    with contextlib.suppress(RecordError):
        assert si_factor(text, "m") > 0


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("time [s]", "s"),
        ("Ax (g)", "g"),
        ("accel_x_g", "g"),
        ("accel_x_m_s2", "m_s2"),
        ("supply_flow_m3_s", "m3_s"),
        ("flow_l_min", "l_min"),
        ("H1 Press (A)", None),
        ("chamber_pressure_b", None),
        ("force_V6", None),
        ("x [flob]", "flob"),
        ("platen_displacement[x]", None),
    ],
)
def test_a_name_gives_its_unit_only_if_it_holds_one(name, unit):
    assert unit_in_name(name) == unit


# --------------------------------------------------------------------------------------------- maps
def mapped(channels: dict[str, Source], **test) -> ChannelMap:
    return ChannelMap("map.toml", TestFacts(**test), channels)


def supply(source: Source | None = None, **test) -> ChannelMap:
    """Map of the one channel that needs no others beside it."""
    return mapped({"supply_pressure": source or Source("c1")}, **test)


def test_sign_gain_offset_and_unit_make_a_channel(tmp_path):
    source = Source("c1", "psi", sign=-1, gain=2.0, offset=3.0)
    record = make_imported_record([raw(VALUES[:, :1], ["bar"], TIME)], supply(source), LABELS)
    expected = -2.0 * 6894.757293168361 * (VALUES[:, 0] + 3.0)
    np.testing.assert_allclose(record["supply_pressure"], expected, rtol=1e-12)  # a few roundings


def test_a_map_that_was_saved_is_loaded_the_same(tmp_path):
    sources = {
        "supply_pressure": Source('P "supply" \\ *', "MPa", -1, 1.5, 0.25, "run*.csv"),
        "platen_displacement[roll]": Source(constant=0.0, unit="rad"),
        "platen_displacement[x]": Source(column=3),
    }
    channels = mapped(sources, name="EQ1", valves_per_horizontal_actuator=2, rate=512.0, fill_gaps=3)
    save_map(channels, tmp_path / "map.toml", ["a remark"])
    loaded = load_map(tmp_path / "map.toml")
    assert (loaded.test, loaded.channels) == (channels.test, channels.channels)
    assert "# a remark" in (tmp_path / "map.toml").read_text()


GOOD_MAP = '[test]\nname = "EQ1"\n[channel]\nsupply_pressure = { column = "c1", unit = "Pa" }\n'


@pytest.mark.parametrize(
    ("old", "new", "phrase"),
    [
        ("[test]", "[test", "not a TOML file"),
        ("[test]", "[tests]", "unknown key 'tests'; did you mean 'test'. valid names: test, channel"),
        ("name", "nmae", r"\[test\]: unknown key 'nmae'"),
        ('"EQ1"', "1", "name = 1 must be a text"),
        ('name = "EQ1"', "fill_gaps = 1.5", "fill_gaps = 1.5 must be a whole number"),
        ('name = "EQ1"', "fill_gaps = -1", "fill_gaps = -1 must be 0 or more"),
        ('name = "EQ1"', "rate = nan", "rate = nan must be a finite number"),
        ('name = "EQ1"', "rate = 0", "rate = 0.0 must be positive"),
        ('name = "EQ1"', 'kind = "dreamt"', "kind = 'dreamt' must be measured or simulated"),
        ('name = "EQ1"', "valves_per_horizontal_actuator = 3", "must be 1 or 2"),
        ('column = "c1"', 'colunm = "c1"', "supply_pressure: unknown key 'colunm'"),
        ('column = "c1"', "column = true", "column = True must be a text or a whole number"),
        ('column = "c1", ', "", "give a column, or else a constant"),
        ('unit = "Pa"', "sign = 2", "sign = 2 must be 1 or -1"),
        ('unit = "Pa"', "gain = 0.0", "gain = 0 leaves nothing"),
        ('column = "c1", unit = "Pa"', "constant = 0.0", "a constant needs a unit"),
        ('{ column = "c1", unit = "Pa" }', '"c1"', "supply_pressure: write"),
        ('supply_pressure = { column = "c1", unit = "Pa" }', "", "names no channel"),
    ],
)
def test_a_bad_map_is_refused_with_file_and_key(tmp_path, old, new, phrase):
    path = put(tmp_path, "map.toml", GOOD_MAP.replace(old, new))
    with pytest.raises(RecordError, match=phrase) as caught:
        load_map(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("channels", "phrase"),
    [
        ({"supply": Source("c1")}, r"\[channel\] supply: is no channel of a record; valid names: platen_displacement"),
        ({"strut_pressure[S9]": Source("c1")}, r"valid names: strut_pressure\[S1\], strut_pressure\[S2\]"),
        ({"strut_pressure[S1]": Source("c1")}, "has S1, but not S2, S3; map them too"),
        ({"supply_pressure": Source("c9")}, "no column 'c9' in 'run.csv'; columns are 'c1', 'c2', 'c3'"),
        ({"supply_pressure": Source("c*")}, "'c\\*' could be any of run.csv column 1 'c1', run.csv column 2"),
        ({"supply_pressure": Source(4)}, "column 4 of run.csv is no channel; these are 1 'c1', 2 'c2', 3 'c3'"),
        ({"supply_pressure": Source("c1", file="other*")}, "no file is called 'other\\*'; files are 'run.csv'"),
        ({"supply_pressure": Source("c2")}, "'c2' of run.csv: unit 'g' cannot be converted to Pa"),
        ({"supply_pressure": Source("c1", "flob")}, "unknown unit 'flob'"),
        ({"supply_pressure": Source("c3")}, "'c3' of run.csv has no unit in the file; add unit"),
        ({"supply_pressure": Source(constant=1.0, unit="g")}, "every channel is constant"),
    ],
)
def test_a_map_that_does_not_fit_is_refused_with_its_key(channels, phrase):
    with pytest.raises(RecordError, match=phrase) as caught:
        make_imported_record([raw(VALUES, ["Pa", "g", None], TIME)], mapped(channels), LABELS)
    assert "map.toml" in str(caught.value)


def test_a_column_has_the_number_that_it_has_in_the_file(tmp_path):
    path = put(tmp_path, "run.csv", "p [Pa],time [s],q [Pa]\n5,0,7\n5,1,7\n")
    for number, value in ((1, 5.0), (3, 7.0)):
        record = make_imported_record(load_raw(path), supply(Source(number)), LABELS)
        assert np.all(record["supply_pressure"] == value)
    with pytest.raises(
        RecordError, match=r"column 2 of .*run\.csv is no channel; these are 1 'p \[Pa\]', 3 'q \[Pa\]'"
    ):
        make_imported_record(load_raw(path), supply(Source(2)), LABELS)


def test_two_columns_of_one_name_need_a_number(tmp_path):
    path = put(tmp_path, "run.csv", "time [s],p [Pa],p [Pa]\n0,1,2\n0.1,3,4\n")
    with pytest.raises(RecordError, match=r"could be any of .* give the column's number"):
        make_imported_record(load_raw(path), supply(Source("p [[]Pa]")), LABELS)
    record = make_imported_record(load_raw(path), supply(Source(3)), LABELS)
    np.testing.assert_array_equal(record["supply_pressure"], [2, 4])


def test_a_channel_that_is_known_to_be_zero_is_said_to_be_stated():
    zero = {f"platen_displacement[{axis}]": Source(constant=0.0, unit="deg") for axis in ("roll", "pitch", "yaw")}
    zero |= {f"platen_displacement[{axis}]": Source(constant=2.0, unit="in") for axis in "yz"}
    channels = mapped({"platen_displacement[x]": Source("c1")} | zero)
    record = make_imported_record([raw(VALUES, ["mm"] * 3, TIME)], channels, LABELS)
    assert (record["platen_displacement"].sel(axis="z") == 0.0508).all()
    np.testing.assert_array_equal(record["platen_displacement"].sel(axis="x"), 1e-3 * VALUES[:, 0])
    assert "platen_displacement[yaw]" in record.attrs["constant"]
    assert stated_constants(record) == zero.keys() and not stated_constants(record.drop_attrs())
    measured = record.assign_attrs(kind="measured")  # no sensor to check, nor to omit
    assert not any("is constant" in one.message for one in check_dataset(measured))
    assert any("is constant" in one.message for one in check_dataset(measured.assign_attrs(constant="")))


def test_a_force_that_was_not_measured_is_not_written_and_one_written_before_is_not_read(tmp_path):
    names = [f"chamber_pressure_a[{a}]" for a in LABELS["actuator"]]
    names += [f"chamber_pressure_b[{a}]" for a in LABELS["horizontal"]]
    channels = mapped({name: Source(k + 1, "MPa") for k, name in enumerate(names)})
    columns = [raw(sines(400, 14), [None] * 14, TIME)]
    record = make_imported_record(columns, channels, LABELS, load_machine())
    assert {"chamber_pressure_a", "chamber_pressure_b"} == set(record.data_vars)
    before = record.assign(actuator_force=record["chamber_pressure_a"].assign_attrs(units="N"))
    save_record(before.assign_attrs(derived="actuator_force from chamber pressures"), tmp_path / "before.nc")
    assert set(load_record(tmp_path / "before.nc").data_vars) == set(record.data_vars)
    save_record(before, tmp_path / "cell.nc")
    assert "actuator_force" in load_record(tmp_path / "cell.nc")


# --------------------------------------------------------------------------------------------- time, gaps, rates
def test_a_file_that_says_nothing_of_time_needs_its_rate():
    columns = [raw(VALUES[:, :1], ["Pa"], None)]
    with pytest.raises(RecordError, match=r"has no time; .* file_rate"):
        make_imported_record(columns, supply(), LABELS)
    assert make_imported_record(columns, supply(file_rate=RATE), LABELS).attrs["sample_rate_hz"] == RATE


@pytest.mark.parametrize(
    ("start", "stamped"),
    [
        (0.0, lambda t: np.round(t, 4)),  # a step of 0.488 ms, written to 0.1 ms
        (200.0, lambda t: t.astype("f4").astype(float)),  # float32 holds 200 s to 8 us, 1.6 % of a step
        (9.0, lambda t: np.array([float(f"{x:.6g}") for x in t])),  # to 0.1 ms from 10 s on
        (0.0, lambda t: np.array([float(f"{x:.5g}") for x in t])),  # to 0.1 ms from 1 s on
    ],
    ids=["few decimals", "single precision", "six digits", "five digits"],
)
def test_rounded_stamps_stand_for_uniform_times(start, stamped):
    time = start + np.arange(4000) / 2048
    record = make_imported_record([raw(sines(4000, 1), ["Pa"], stamped(time))], supply(), LABELS)
    # the fit averages rounding errors of at most 0.05 ms over 4000 stamps
    np.testing.assert_allclose(record["time"], time, atol=1e-5)


@pytest.mark.parametrize(
    ("change", "phrase"),
    [
        (lambda t: t[::-1], "sample 1: does not increase"),
        (lambda t: np.concatenate([t[:9], t[8:-1]]), "sample 9: does not increase"),
        (lambda t: np.where(np.arange(400) == 7, np.nan, t), "sample 7: nan is no time in seconds"),
        (lambda t: t + 0.3 / RATE * (np.arange(400) == 50), "sample 50: .* 0.3 of a sample off its place"),
        (lambda t: t + 5 / RATE * (np.arange(400) >= 50), r"sample 50: 5 samples are missing .* fill_gaps = 5"),
        (lambda t: t * 1e308, "sample 1: 3.90625e.305 is no time in seconds"),
    ],
)
def test_time_that_is_not_uniform_is_refused_with_the_sample(change, phrase):
    with pytest.raises(RecordError, match=f"run.csv, time, {phrase}"):
        make_imported_record([raw(VALUES[:, :1], ["Pa"], change(TIME))], supply(fill_gaps=2), LABELS)


def test_a_gap_in_time_is_filled_where_the_map_allows_it_and_said():
    keep = np.delete(np.arange(400), [100, 101, 102])
    columns = [raw(VALUES[keep, :1], ["Pa"], TIME[keep])]
    with pytest.raises(RecordError, match="sample 100: 3 samples are missing"):
        make_imported_record(columns, supply(fill_gaps=2), LABELS)
    record = make_imported_record(columns, supply(fill_gaps=3), LABELS)
    assert record.attrs["filled"] == "interpolated samples: run.csv: 3 from sample 100"
    np.testing.assert_allclose(record["time"], TIME, atol=1e-12)  # a straight line through exact stamps
    # a cubic over 4 steps of h: |x''''| (4 h)^4 / 384 = (2 pi)^4 (4 / 256)^4 / 384 = 2e-7 for 1 Hz
    np.testing.assert_allclose(record["supply_pressure"], VALUES[:, 0], atol=2.5e-7)


@pytest.mark.parametrize(
    ("place", "allowed", "phrase"),
    [
        (slice(200, 202), 0, r"supply_pressure \(column 'c1'\), sample 200: 2 samples .* fill_gaps = 2"),
        (slice(0, 1), 9, "sample 0: 1 samples at the start"),
        (slice(399, 400), 9, "sample 399: 1 samples at the end"),
    ],
)
def test_a_hole_in_a_channel_is_filled_where_the_map_allows_it_but_not_at_an_end_and_said(place, allowed, phrase):
    values = VALUES[:, :1].copy()
    values[place] = np.nan if allowed == 0 else np.inf
    columns = [raw(values, ["Pa"], TIME)]
    with pytest.raises(RecordError, match=f"run.csv, {phrase}" if allowed == 0 else phrase):
        make_imported_record(columns, supply(fill_gaps=allowed), LABELS)
    if allowed == 0:
        record = make_imported_record(columns, supply(fill_gaps=2), LABELS)
        assert record.attrs["filled"] == "interpolated samples: supply_pressure: 2 from sample 200"
        np.testing.assert_allclose(record["supply_pressure"], VALUES[:, 0], atol=2.5e-7)  # as above, fewer steps


def two_rates(frequency: float) -> tuple[list, np.ndarray]:
    """A sine sampled at 2048 Hz in one file and at 512 Hz in another."""
    fast, slow = np.arange(8192) / 2048, np.arange(2048) / 512
    wave = {"fast": fast, "slow": slow}
    return [raw(np.sin(2 * np.pi * frequency * t)[:, None], ["Pa"], t, name) for name, t in wave.items()], fast


def struts(file: str, **test) -> ChannelMap:
    channels = {f"strut_pressure[S{k}]": Source("c1", file=file) for k in (1, 2, 3)}
    return mapped({"supply_pressure": Source("c1", file="fast"), **channels}, **test)


def test_files_of_different_rates_meet_at_the_highest():
    files, fast = two_rates(20.0)
    record = make_imported_record(files, struts("slow"), LABELS)
    assert record.attrs["sample_rate_hz"] == 2048
    np.testing.assert_array_equal(record["supply_pressure"], np.sin(40 * np.pi * fast)[: record.sizes["time"]])
    inner = record.isel(time=slice(200, -200))  # clear of the ends by 48 samples of the slow file
    expected = np.sin(40 * np.pi * inner["time"])
    # the resampling is good to 1e-7 of the amplitude
    np.testing.assert_allclose(inner["strut_pressure"].sel(strut="S2"), expected, atol=1e-7)


@pytest.mark.parametrize(("frequency", "left"), [(50.0, 1.0), (400.0, 0.0)])
def test_going_down_to_a_rate_keeps_what_it_can_hold_and_drops_what_would_fold(frequency, left):
    files, _ = two_rates(frequency)
    record = make_imported_record(files[:1], supply(rate=512.0), LABELS)
    assert record.attrs["sample_rate_hz"] == 512
    inner = record["supply_pressure"].isel(time=slice(100, -100))
    # the filter at 0.4 of the new rate, 204.8 Hz, has gain 1 / (1 + (f / 204.8)^16): 1 - 2e-10 at 50 Hz, 2e-5 at 400 Hz
    np.testing.assert_allclose(inner, left * np.sin(2 * np.pi * frequency * inner["time"]), atol=4e-5)


def test_files_that_share_no_stretch_of_time_are_refused():
    files, _ = two_rates(20.0)
    later = raw(files[1].values, ["Pa"], files[1].time + 100, "slow")
    with pytest.raises(RecordError, match=r"do not overlap in time: 0 to 3.99951 s, 100 to 103.998 s"):
        make_imported_record([files[0], later], struts("slow"), LABELS)


# --------------------------------------------------------------------------------------------- guess
def test_a_typical_channel_list_is_guessed_right(tmp_path):
    typical = typical_channels()
    columns = [(t.description, t.unit, np.zeros(1)) for t in typical]
    path = put(tmp_path, "run.bin", binary_469d(header(columns, 1 / RATE), sines(8, len(columns))))
    channels, remarks = guess_map(load_raw(path), LABELS)
    found = {source.column: name for name, source in channels.channels.items()}
    assert {t.description: found.get(t.description) for t in typical} == {t.description: t.channel for t in typical}
    unmatched = [t.description for t in typical if t.channel is None]
    lines = [remark for remark in remarks if remark.startswith('"CHANNEL" = ')]
    assert len(lines) == len(unmatched)
    assert all(any(f'column = "{name}"' in line for line in lines) for name in unmatched)


@pytest.mark.parametrize(
    ("name", "unit", "channel"),
    [
        ("Ax (g)", "g", "platen_acceleration[x]"),
        ("accel_x_g", "g", "platen_acceleration[x]"),
        ("TableAccelY", "g", "platen_acceleration[y]"),
        ("X", "mm", "platen_displacement[x]"),
        ("rx", "deg", "platen_displacement[roll]"),
        ("V1 Press", "psi", "chamber_pressure_a[V1]"),
        ("P_A H3", "bar", "chamber_pressure_a[H3]"),
        ("actuator_force_V6 [kN]", "kN", "actuator_force[V6]"),
        ("Actuator H2 stroke", "mm", "actuator_displacement[H2]"),
        ("H1 Press", "psi", None),  # of which chamber?
        ("Long Displ fbk", "g", None),  # the unit says otherwise
        ("H1 Delta P", "psi", "pressure_difference[H1]"),
        ("Humidity", "%", None),
        ("Acc 1F x", "g", "floor_acceleration[1F]"),
        ("Roof accel Y (g)", "g", "floor_acceleration[RF]"),
        ("F1", "kN", None),  # not floor 1, and of which actuator?
        ("Long dis cmd", "mm", "reference_displacement[x]"),
        ("AccX", "g", "platen_acceleration[x]"),
    ],
)
def test_one_name_is_guessed_as(name, unit, channel):
    columns = raw(VALUES, ["Pa", unit, None], TIME)
    columns = replace(columns, names=("Supply Press", name, "?"))
    found = guess_map([columns], LABELS).channels.channels
    assert set(found) - {"supply_pressure"} == ({channel} if channel else set())


def test_a_guess_says_what_it_left_open(tmp_path):
    path = put(tmp_path, "run.csv", "time,Long Displ,Long Displ fbk [in],Foo\n0,1,2,3\n1,2,3,4\n")
    _, remarks = guess_map(load_raw(path), LABELS)
    text = "\n".join(remarks)
    assert "add the unit of platen_displacement[x]: column 2" in text  # after time
    assert "also like platen_displacement[x]: column 3" in text
    assert '"CHANNEL" = { column = "Foo" }  # not recognised: column 4 of run.csv' in text
    assert (
        '"platen_displacement[yaw]" = { unit = "rad", constant = 0.0 }  # not found; if it is known to be zero' in text
    )


def test_columns_without_units_share_one_remark_with_their_number():
    names = [
        f"{quantity} {axis}" for quantity in ("Displ", "Accel") for axis in ("x", "y", "z", "roll", "pitch", "yaw")
    ]
    found = guess_map([columns_called(names)], LABELS)
    assert len(found.channels.channels) == 12
    (remark,) = [one for one in found.remarks if "unit" in one]
    assert remark.startswith("add the units of 12 channels")
    assert "platen_displacement[x, y, z, roll, pitch, yaw], platen_acceleration[x, y, z, roll, pitch, yaw]" in remark
    assert remark.endswith("the first is column 1 of run.csv, 'Displ x'")


ONE = {"actuator": ("A1",), "horizontal": ("A1",), "strut": ()}
"""Labels of a table with one actuator, which moves in x alone."""
SMALL = ("Table disp (mm)", "Table acc (mm/s2)", "Delta P (MPa)", "Voltage command (V)", "Dis command (mm)")
SMALL += ("Acc 1F (mm/s2)", "AccRF (mm/s2)")
"""Columns of a small laboratory's table with a specimen."""


def columns_called(names, units=None) -> RawTest:
    values = sines(400, len(names))
    return make_raw("run.csv", "table", names, units or [unit_in_name(n) for n in names], values, TIME)


def guessed(names, units=None) -> dict[str, str]:
    """Column by channel, as guessed for the table with one actuator."""
    channels, _ = guess_map([columns_called(names, units)], ONE, ("x",))
    return {name: source.column for name, source in channels.channels.items() if source.constant is None}


def test_columns_of_a_table_with_one_axis_need_no_word_for_it():
    names = ["PosT", "acc", "vel (m/s)", "load cell (kN)", "Press A (bar)", "pressure b (bar)", "actuator stroke"]
    expected = ["platen_displacement[x]", "platen_acceleration[x]", "platen_velocity[x]", "actuator_force[A1]"]
    expected += ["chamber_pressure_a[A1]", "chamber_pressure_b[A1]", "actuator_displacement[A1]"]
    assert guessed(names) == dict(zip(expected, names, strict=True))


def test_what_a_guided_table_cannot_do_is_zero_and_makes_a_record():
    raws = [columns_called(SMALL)]
    channels, remarks = guess_map(raws, ONE, ("x",))
    assert not any(source.constant is not None for source in channels.channels.values())  # what is held needs no map
    record = make_imported_record(raws, channels, ONE, load_machine("uniaxial"))
    np.testing.assert_allclose(record["platen_displacement"].sel(axis="x"), 1e-3 * raws[0].values[:, 0], rtol=1e-12)
    assert not record["platen_displacement"].sel(axis=["y", "z", "roll", "pitch", "yaw"]).any()
    assert "constant" not in record.attrs
    assert not any("velocity[y]" in remark or "not found" in remark for remark in remarks)


def test_kinds_of_channels_that_a_layout_has_are_matched_by_their_words():
    """Words for kinds that the layout lacks match nothing, and are said; with the kinds in it they match."""
    kinds = {
        "pressure_difference": channels_module.Channel(dims=("time", "actuator"), units="Pa", long_name="d"),
        "valve_command": channels_module.Channel(dims=("time", "actuator"), units="1", long_name="v"),
        "floor_acceleration": channels_module.Channel(dims=("time", "floor"), units="m/s2", long_name="f"),
    }
    without = {name: c for name, c in channels_module.LAYOUT.items() if name not in kinds}
    wanted = {"pressure_difference[A1]": SMALL[2]}
    wanted |= {"floor_acceleration[1F]": SMALL[5], "floor_acceleration[RF]": SMALL[6]}
    raws = [columns_called(SMALL)]
    with mock.patch.dict(channels_module.LAYOUT, without, clear=True):
        channels, remarks = guess_map(raws, ONE, ("x",))
        assert not set(wanted) & set(channels.channels)
        text = "\n".join(remarks)
        for name in ("valve_command[A1]", *wanted):
            assert f"like {name}, which a record of this machine does not have" in text
    with mock.patch.dict(channels_module.LAYOUT, kinds):
        channels, remarks = guess_map(raws, ONE, ("x",))
        assert {name: channels.channels[name].column for name in wanted} == wanted
        line = '"valve_command[A1]" = { column = "Voltage command (V)", unit = "1" }  # add gain = 1 / full command'
        assert any(remark.startswith(line) for remark in remarks)
        assert "floor_acceleration is not used without masses: add [floor.1F], [floor.RF]" in remarks[-1]
        assert not any("masses" in r for r in guess_map(raws, {**ONE, "floor": ("1F", "RF")}, ("x",)).remarks)
        floors = make_imported_record(raws, channels, ONE, load_machine("uniaxial"))["floor_acceleration"]
        assert floors["floor"].values.tolist() == ["1F", "RF"]
        np.testing.assert_allclose(floors.sel(floor="RF"), 1e-3 * raws[0].values[:, 6], rtol=1e-12)
        for words in ("dP (bar)", "A1 diff press (bar)", "Load pressure (bar)", "ΔP (bar)", "Differential pressure"):
            found, _ = guess_map([columns_called([words])], ONE, ("x",))
            assert set(found.channels) == {"pressure_difference[A1]"}, words
        for words in ("servo voltage", "Valve cmd", "cmd"):
            _, remarks = guess_map([columns_called([words], ["V"])], ONE, ("x",))
            assert remarks[0].startswith('"valve_command[A1]" = '), words


def test_a_command_in_volts_is_a_share_of_the_full_one_that_the_machine_states():
    for name, unit in (("Voltage command (V)", None), ("Valve cmd", "V"), ("cmd [V]", "V"), ("Cmd(V)", None)):
        found, remarks = guess_map([columns_called([name], unit and [unit])], ONE, ("x",), {"A1": 10.0})
        source = found.channels["valve_command[A1]"]
        assert (source.column, source.unit, source.gain) == (name, "1", 0.1)
        assert not any("valve_command[A1]" in remark for remark in remarks)
    _, remarks = guess_map([columns_called(["cmd [mA]"], ["mA"])], ONE, ("x",), {"A1": 10.0})
    assert remarks[0].startswith('"valve_command[A1]" = ')
    _, remarks = guess_map([columns_called(["Ventil"], ["V"])], ONE, ("x",), {"A1": 10.0})
    assert remarks[0].endswith("; by its unit: valve_command[A1]")  # a word of another language


def test_a_table_in_another_language_has_a_time_and_one_without_is_told_how_to_give_it(tmp_path):
    """Semicolons, decimal commas, a head of three lines, units in a line of their own, as German loggers write them."""
    rows = [f"{k / 256:.6f};{0.01 * k:.3f};{2.0 - 0.5 * k:.2f}".replace(".", ",") for k in range(20)]
    head = "Versuch: Rauschen\nDatum: 12.03.2024\nRate: 256 Hz\n\n"
    clock = ("Zeit", "[s]"), ("Dauer der Messung", "[ms]"), ("Nr", "[-]")
    for (name, unit), factor in zip(clock, (1.0, 1e-3, None), strict=True):
        path = put(tmp_path, "r.csv", head + f"{name};Weg Tisch;Soll Weg\n{unit};[mm];[mm]\n" + "\n".join(rows) + "\n")
        (read,) = load_raw(path)
        channels, remarks = guess_map([read], ONE, ("x",))
        found = {key: source.column for key, source in channels.channels.items()}
        assert found == {"platen_displacement[x]": "Weg Tisch", "reference_displacement[x]": "Soll Weg"}
        assert read.values[3, -2:].tolist() == [0.03, 0.5]
        if factor is None:
            assert read.time is None and remarks[-1] == "add file_rate, in Hz, to [test]: r.csv has no time"
        else:
            np.testing.assert_allclose(read.time, factor * np.arange(20) / 256, atol=1e-6 * factor)  # as written
            assert not any("file_rate" in remark for remark in remarks)


def test_a_map_is_written_even_where_no_column_is_recognised_and_says_what_they_could_be(tmp_path):
    channels, remarks = guess_map([columns_called(["CH1", "CH 2  x", "CH3"], [None, "bar", "V"])], ONE, ("x",))
    assert not channels.channels
    save_map(channels, tmp_path / "map.toml", remarks)
    text = (tmp_path / "map.toml").read_text()
    assert '# "CHANNEL" = { column = "CH 2  x", unit = "bar" }  # not recognised: column 2' in text
    assert (
        "by its unit: chamber_pressure_a[A1], chamber_pressure_b[A1], supply_pressure, pressure_difference[A1]" in text
    )
    assert "CHANNEL is one of: platen_displacement[x], platen_velocity[x]" in text
    with pytest.raises(RecordError, match="names no channel; write one, or complete the lines that --guess put there"):
        load_map(tmp_path / "map.toml")
    completed = text.replace('# "CHANNEL" = { column = "CH 2', '"supply_pressure" = { column = "CH 2')
    (tmp_path / "map.toml").write_text(completed)
    assert load_map(tmp_path / "map.toml").channels == {"supply_pressure": Source("CH 2  x", unit="bar")}

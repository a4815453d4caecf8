"""The record layout: what it accepts, what it refuses and with which words, and that nothing else comes out."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from data_files import LABELS
from machine_cases import PRACTICE

from lhpost6_pin.core.errors import RecordError, UnknownNameError
from lhpost6_pin.core.names import AXES
from lhpost6_pin.data import layout_faults as layout_faults_module
from lhpost6_pin.data import records
from lhpost6_pin.data.channels import LAYOUT, LAYOUT_VERSION, channel_name, same_unit
from lhpost6_pin.data.layout_faults import layout_faults
from lhpost6_pin.data.records import load_record, make_record, open_record, require, save_record

RECORDS = Path(__file__).parent / "data" / "records"
SIZES = {"axis": 6} | {dim: len(labels) for dim, labels in LABELS.items()}


Change = Callable[[xr.Dataset], xr.Dataset]


def full_record(count: int = 64, rate: float = 2048.0) -> xr.Dataset:
    """Every channel of the layout, random."""
    rng = np.random.default_rng(1)
    shapes = {name: (count, *(SIZES[dim] for dim in channel.dims[1:])) for name, channel in LAYOUT.items()}
    channels = {name: rng.standard_normal(shape) for name, shape in shapes.items()}
    return make_record(np.arange(count) / rate, channels, LABELS, {"kind": "simulated", "test": "noise"})


def write_anyway(dataset: xr.Dataset, path: Path) -> Path:
    """Write whatever it is, valid or not."""
    dataset.to_netcdf(path, engine="h5netcdf")
    return path


# ---------------------------------------------------------------------------------------- older layouts
def test_there_is_a_step_from_every_older_layout_to_the_next_and_a_record_of_each():
    assert set(records.STEPS) == set(range(1, LAYOUT_VERSION))
    assert len([*RECORDS.glob("layout_*.nc")]) == LAYOUT_VERSION


@pytest.mark.parametrize("path", sorted(RECORDS.glob("layout_*.nc")), ids=lambda path: path.stem)
def test_a_record_of_every_layout_so_far_is_read(path):
    """Kept from when the layout was new; `full_record(8)` has the numbers that are in it."""
    record = load_record(path, LABELS)
    later = {
        "pressure_difference",
        "valve_command",
        "floor_acceleration",
        "point_acceleration",
    }  # came after layout 1 was new
    later |= {"spool_command_b", "spool_position_b", *(n for n in LAYOUT if n.startswith("drive_"))}
    assert record.attrs["layout_version"] == LAYOUT_VERSION and set(LAYOUT) - later <= set(record)
    np.testing.assert_array_equal(record["strut_pressure"], full_record(8)["strut_pressure"])


def test_a_record_of_an_older_layout_is_brought_to_todays_step_by_step(tmp_path, monkeypatch):
    def renamed(old: xr.Dataset) -> xr.Dataset:
        return old.rename(legs="actuator_displacement")

    def in_metres(old: xr.Dataset) -> xr.Dataset:
        legs = (1e-3 * old["actuator_displacement"]).assign_attrs(units="m")
        return old.assign(actuator_displacement=legs)

    new = full_record(16)
    legs = (1e3 * new["actuator_displacement"]).assign_attrs(units="mm")
    old = new.assign(actuator_displacement=legs).rename(actuator_displacement="legs")
    path = write_anyway(old, tmp_path / "old.nc")
    written = path.read_bytes()
    for module in (records, layout_faults_module):
        monkeypatch.setattr(module, "LAYOUT_VERSION", 3)
    monkeypatch.setattr(records, "STEPS", {1: renamed, 2: in_metres})
    found = load_record(path, LABELS)
    np.testing.assert_allclose(found["actuator_displacement"], new["actuator_displacement"], rtol=1e-15)
    assert found.attrs["layout_version"] == 3 and found.attrs["written_in_layout"] == 1
    assert path.read_bytes() == written


# --------------------------------------------------------------------------------------- what is accepted
@pytest.mark.parametrize("path", sorted(RECORDS.glob("*.nc")), ids=lambda p: p.stem)
def test_measured_and_reference_records_are_valid(path: Path) -> None:
    record = load_record(path, LABELS)
    assert tuple(record["axis"].values) == AXES
    assert all(record[name].dtype == np.float64 for name in LAYOUT if name in record)


def test_a_record_comes_back_from_disk_as_it_went(tmp_path: Path) -> None:
    record = full_record()
    save_record(record, tmp_path / "new" / "record.nc")
    xr.testing.assert_identical(load_record(tmp_path / "new" / "record.nc"), record)


def test_units_names_rate_and_version_are_filled_in() -> None:
    record = full_record(rate=2048.0)
    assert record["platen_acceleration"].attrs["units"] == "m/s2, rad/s2"
    assert all(record[name].attrs["long_name"] for name in LAYOUT)
    assert record.attrs["sample_rate_hz"] == 2048.0
    assert record.attrs["layout_version"] == 1


def test_a_record_holds_what_was_measured_and_may_hold_more(tmp_path: Path) -> None:
    time = np.arange(9) / 512
    channels = {
        "supply_pressure": np.full(9, 2e7),
        "oil_temperature": (("time",), np.full(9, 40.0), {"units": "degC"}),
        "pad_state": (("time", "pad"), np.zeros((9, 12))),
        "note": ((), "warm"),
    }
    save_record(make_record(time, channels, {}, {}), tmp_path / "r.nc")
    assert set(load_record(tmp_path / "r.nc").data_vars) == set(channels)


def test_another_machine_has_other_actuators_and_no_struts(tmp_path: Path) -> None:
    channels = {"platen_displacement": np.zeros((9, 6)), "chamber_pressure_b": np.ones((9, 1))}
    one = {"actuator": ["A1"], "horizontal": ["A1"]}
    save_record(make_record(np.arange(9) / 512, channels, one, {}), tmp_path / "uniaxial.nc")
    load_record(tmp_path / "uniaxial.nc", one)
    with pytest.raises(RecordError, match=r"horizontal: has labels A1 \(they must be H1 H2 H3 H4"):
        load_record(tmp_path / "uniaxial.nc", LABELS)


def test_packed_and_single_precision_channels_are_loaded_in_double(tmp_path: Path) -> None:
    record = full_record()
    packing = {"dtype": "int16", "scale_factor": 1e-3, "_FillValue": -32768}
    encoding = {"actuator_force": packing, "strut_pressure": {"dtype": "float32"}}
    record.to_netcdf(tmp_path / "p.nc", engine="h5netcdf", encoding=encoding)
    loaded = load_record(tmp_path / "p.nc")
    assert loaded["actuator_force"].dtype == loaded["strut_pressure"].dtype == np.float64
    np.testing.assert_allclose(loaded["actuator_force"], record["actuator_force"], atol=0.5e-3)  # half a step


@pytest.mark.parametrize(
    ("given_", "wanted", "same"),
    [
        ("m/s^2, rad/s^2", "m/s2, rad/s2", True),
        ("m s-2, rad s-2", "m/s2, rad/s2", True),
        ("meter/second**2, radian/second**2", "m/s2, rad/s2", True),
        ("N/m^2", "Pa", True),
        ("pascal", "Pa", True),
        ("", "1", True),
        ("dimensionless", "1", True),
        ("mm, rad", "m, rad", False),
        ("m, deg", "m, rad", False),
        ("m", "m, rad", False),
        ("bar", "Pa", False),
        ("kN", "N", False),
        ("percent", "1", False),
        ("furlongs per fortnight", "m/s", False),
        ("9**9**9**9", "1", False),
        ("__import__('os')", "1", False),
        (1.0, "1", False),
    ],
)
def test_units_are_compared_by_meaning(given_: object, wanted: str, same: bool) -> None:
    assert same_unit(given_, wanted) is same


# ---------------------------------------------------------------------------------------- what is refused
def _set(name: str, sample: int, column: int, value: float) -> Change:
    def change(record: xr.Dataset) -> xr.Dataset:
        values = record[name].values.copy()
        values[sample, column] = value
        return record.assign({name: record[name].copy(data=values)})

    return change


def _time(sample: int, value: float) -> Change:
    def change(record: xr.Dataset) -> xr.Dataset:
        time = record["time"].values.copy()
        time[sample] = value
        return record.assign_coords(time=time)

    return change


def _units(name: str, units: object) -> Change:
    def change(record: xr.Dataset) -> xr.Dataset:
        record = record.copy()
        record[name].attrs = {} if units is None else {"units": units}
        return record

    return change


BREAKAGES: dict[str, tuple[Change, str]] = {
    "no time": (lambda r: r.drop_vars("time"), "time: is missing"),
    "one sample": (lambda r: r.isel(time=[0]), "time: is not a row of at least two numbers"),
    "a late sample": (_time(20, 20.3 / 2048), "time, sample 20: is not uniform"),
    "a gap": (lambda r: r.drop_isel(time=range(10, 15)), "time, sample 10: .* a gap of 5 missing samples"),
    "time turning back": (_time(30, 0.0), "time, sample 30: does not increase"),
    "time not a number": (_time(7, np.nan), "time, sample 7: is not a number"),
    "another rate": (lambda r: r.assign_attrs(sample_rate_hz=2000), "2048 Hz, sample_rate_hz is 2000"),
    "a rate in words": (lambda r: r.assign_attrs(sample_rate_hz="fast"), "sample_rate_hz is fast"),
    "not a number": (_set("platen_velocity", 33, 5, np.nan), r"platen_velocity\[yaw\], sample 33: is not finite"),
    "infinite": (_set("chamber_pressure_b", 3, 2, -np.inf), r"chamber_pressure_b\[H3\], sample 3: is not finite"),
    "transposed": (lambda r: r.transpose("axis", ...), r"platen_displacement: has dimensions \('axis', 'time'\)"),
    "another dimension": (lambda r: r.assign(actuator_force=r["supply_pressure"]), "actuator_force: has dimensions"),
    "axes out of order": (lambda r: r.isel(axis=[1, 0, 2, 3, 4, 5]), "axis: has labels y x z roll pitch yaw"),
    "five axes": (lambda r: r.isel(axis=range(5)), "axis: has labels x y z roll pitch .they must be x y z"),
    "no axis labels": (lambda r: r.drop_vars("axis"), "axis: has no labels"),
    "actuators out of order": (
        lambda r: r.isel(actuator=[0, 2, 1, *range(3, 10)]),
        "actuator: has labels H1 H3 H2 .*th",
    ),
    "an actuator twice": (lambda r: r.isel(strut=[0, 1, 1]), "strut: has labels that repeat"),
    "an unknown horizontal": (lambda r: r.assign_coords(horizontal=[*"abcd"]), "horizontal: has labels a b c d"),
    "no units": (_units("strut_pressure", None), "strut_pressure: has no units .give it in 'Pa'"),
    "other units": (_units("platen_displacement", "in, deg"), "platen_displacement: has units 'in, deg'"),
    "milliseconds": (_units("time", "ms"), "time: has units 'ms'"),
    "text": (
        lambda r: r.assign(supply_pressure=("time", [*"20 MPa90"] * 8, {"units": "Pa"})),
        "supply_pressure: holds",
    ),
    "three valves": (lambda r: r.assign_attrs(valves_per_horizontal_actuator=3), "valves_per_horizontal_actuator is 3"),
    "a later layout": (lambda r: r.assign_attrs(layout_version=2), "layout_version is 2"),
}


@pytest.mark.parametrize("name", BREAKAGES)
def test_a_broken_record_is_refused_with_file_channel_and_sample(name: str, tmp_path: Path) -> None:
    breakage, message = BREAKAGES[name]
    path = write_anyway(breakage(full_record()), tmp_path / "broken.nc")
    with pytest.raises(RecordError, match=re.escape(str(path)) + ".*" + message):
        load_record(path)


def test_several_faults_are_named_at_once() -> None:
    record = _units("strut_pressure", None)(_set("platen_velocity", 5, 0, np.nan)(full_record()))
    assert [fault.channel for fault in layout_faults(record)] == ["platen_velocity[x]", "strut_pressure"]


def test_what_is_not_there_or_not_netcdf_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "table.nc").write_text("time,force\n0,1\n")
    (tmp_path / "empty.nc").touch()
    (tmp_path / "hdf5.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(range(256)))
    (tmp_path / "cdf.nc").write_bytes(b"CDF\x01" + bytes(range(256)))
    with pytest.raises(RecordError, match="no such file"):
        load_record(tmp_path / "absent.nc")
    for name in ("table", "empty", "hdf5", "cdf"):
        with pytest.raises(RecordError, match=rf"{name}\.nc: not a netCDF-4"):
            load_record(tmp_path / f"{name}.nc")


def test_an_invalid_record_is_neither_made_nor_written_over_a_good_one(tmp_path: Path) -> None:
    good = full_record()
    save_record(good, tmp_path / "r.nc")
    with pytest.raises(RecordError, match=r"r\.nc: .*platen_velocity\[x\], sample 5"):
        save_record(_set("platen_velocity", 5, 0, np.nan)(good), tmp_path / "r.nc")
    xr.testing.assert_identical(load_record(tmp_path / "r.nc"), good)
    with pytest.raises(RecordError, match="sample 3"):
        make_record(np.arange(9.0), {"supply_pressure": np.where(np.arange(9) == 3, np.inf, 1)}, {}, {})


@pytest.mark.parametrize(
    ("name", "shape", "message"),
    [
        ("platen_velocity", (9,), "platen_velocity: has shape"),
        ("platen_velocity", (9, 5), "do not fit together"),
        ("actuator_force", (9, 2), "actuator: has no labels"),
        ("platten_displacement", (9, 6), "platen_displacement"),
    ],
)
def test_arrays_that_do_not_fit_the_layout_are_refused(name, shape, message) -> None:
    with pytest.raises((RecordError, UnknownNameError), match=message):
        make_record(np.arange(9) / 512, {name: np.zeros(shape)}, {}, {})


def test_a_missing_channel_is_asked_for_by_name(tmp_path: Path) -> None:
    save_record(full_record().drop_vars(["strut_pressure", "spool_position"]), tmp_path / "r.nc")
    record = load_record(tmp_path / "r.nc")
    require(record, "actuator_force", "time")
    with pytest.raises(RecordError, match=r"r\.nc: has no spool_position, strut_pressure; it has"):
        require(record, "actuator_force", "spool_position", "strut_pressure")


def test_a_column_is_named_by_its_label() -> None:
    force, pressure = (full_record()[name] for name in ("actuator_force", "supply_pressure"))
    assert (channel_name(force, 4), channel_name(pressure, 0)) == ("actuator_force[V1]", "supply_pressure")
    assert channel_name(force.drop_vars("actuator"), 4) == "actuator_force[4]"


def test_a_record_in_single_precision_keeps_time_units_and_seven_figures(tmp_path):
    record = load_record(PRACTICE).isel(time=slice(0, 500))
    save_record(record, tmp_path / "whole.nc")
    save_record(record, tmp_path / "half.nc", single=True)
    found = load_record(tmp_path / "half.nc")
    np.testing.assert_array_equal(found["time"].values, record["time"].values)
    for name, column in record.data_vars.items():
        assert found[name].attrs == column.attrs
        np.testing.assert_allclose(found[name].values, column.values, rtol=2**-24)  # half a unit of the last place
    sizes = [(tmp_path / name).stat().st_size for name in ("half.nc", "whole.nc")]
    assert sizes[0] < 0.7 * sizes[1]  # half, and what the file says of itself


def test_what_is_no_record_is_named_with_what_to_do(tmp_path):
    """A directory, one of data files, and a data file of another format."""
    data, records = tmp_path / "data", tmp_path / "records"
    for folder in (data, records):
        folder.mkdir()
    (data / "TX.csv").write_text("time,x\n0,0\n")
    (records / "TX.nc").write_bytes(PRACTICE.read_bytes())
    for path, words in (
        (data, "is a directory without records .*`lhpost6 import`"),
        (records, "is a directory; name one record of it, such as .*TX.nc"),
        (data / "TX.csv", "not a netCDF-4 .*`lhpost6 import` makes records of measured data"),
        (data / "TY.csv", "no such file"),
    ):
        with pytest.raises(RecordError, match=words):
            open_record(path)

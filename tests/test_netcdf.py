"""The bytes of a record's file against those that xarray writes, and what writing them imports."""

import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from lhpost6_pin.data.netcdf import netcdf_content

AXES = ["x", "yaw"]
MOTION = ("time", "axis"), np.arange(8.0).reshape(4, 2), {"units": "m", "long_name": "Verschiebung größer"}
COORDS = {"time": ("time", 0.5 * np.arange(4), {"units": "s"}), "axis": AXES}
PLAIN = xr.Dataset({"motion": MOTION}, COORDS, {"title": "a test", "rate": 2048.0, "count": 3, "list": [1.0, 2.0]})


def read(content: memoryview, path) -> xr.Dataset:
    path.write_bytes(content)
    with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as lazy:
        return lazy.load()


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"single": MOTION[1][:, 0].astype(np.float32)},
        {"whole": np.arange(4)},
        {"gaps": np.array([1.0, np.nan, np.inf, 0.0])},
        {"words": np.array(["one", "größer", "", "four"])},
        {"objects": np.array(["one", "größer", "", "four"], object)},
        {"switch": np.array([True, False, True, True])},
        {"date": np.array(["2019-07-06"] * 4, "datetime64[ns]")},
    ],
    ids=lambda more: next(iter(more), "plain"),
)
def test_a_file_reads_as_the_one_that_xarray_writes(more, tmp_path):
    dataset = PLAIN.assign({name: ("time", values) for name, values in more.items()})
    written = dataset.to_netcdf(engine="h5netcdf", encoding={n: {"_FillValue": None} for n in dataset.data_vars})
    own, other = read(netcdf_content(dataset), tmp_path / "own.nc"), read(written, tmp_path / "other.nc")
    xr.testing.assert_identical(own, other)
    assert list(own.variables) == list(other.variables) and list(own.attrs) == list(other.attrs)
    assert {n: v.encoding["dtype"] for n, v in own.variables.items()} == {
        n: v.encoding["dtype"] for n, v in other.variables.items()
    }


@pytest.mark.parametrize("coord", [{"place": ("axis", [1.0, 2.0])}, {"station": 7.0}])
def test_a_coordinate_that_is_no_dimension_stays_one(coord, tmp_path):
    dataset = PLAIN.assign_coords(coord)
    xr.testing.assert_identical(read(netcdf_content(dataset), tmp_path / "r.nc"), dataset)


def test_to_make_and_write_a_record_imports_neither_dask_nor_pint(tmp_path):
    code = f"""
import sys
import numpy as np
from lhpost6_pin.data.records import make_record, save_record
channels = {{"platen_displacement": np.zeros((4, 6)), "hidden": (("time",), np.ones(4), {{"units": "1"}})}}
for single in (False, True):
    save_record(make_record(np.arange(4) / 8, channels, {{}}, {{}}), {str(tmp_path / "r.nc")!r}, single=single)
print([name for name in ("dask", "distributed", "pint") if name in sys.modules])
"""
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"

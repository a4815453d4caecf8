"""Drive files: what is written comes back, what is no drive is refused, another machine's too."""

import logging

import numpy as np
import pytest
import xarray as xr

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.data.records import open_record
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.motions import find_motion, make_target, with_time_scale
from lhpost6_pin.tuning.drives import check_circumstances, circumstances, load_drive, save_drive


@pytest.fixture(scope="module")
def target():
    return make_target(find_motion("sine", cycles=1, ramp_cycles=1))


@pytest.fixture
def path(target, tmp_path):
    facts = circumstances(load_machine(), "a panel")
    return save_drive(target.acceleration, "acceleration", target, tmp_path / "drive.nc", facts)


def changed(path, change):
    data = change(xr.load_dataset(path, engine="h5netcdf"))
    data.to_netcdf(path.with_name("changed.nc"), engine="h5netcdf")
    return path.with_name("changed.nc")


def with_value(data, name, value):
    values = data[name].values.copy()
    values[5, ...] = value
    return data.assign({name: (data[name].dims, values)})


def test_a_drive_comes_back_from_its_file(path, target):
    back = load_drive(path)
    assert back.mode == "acceleration" and np.array_equal(back.values, target.acceleration)
    for name in ("time", "displacement", "velocity", "acceleration"):
        assert np.array_equal(getattr(back.target, name), getattr(target, name))
    assert back.target.reference == target.reference
    assert {key: back.attrs[key] for key in ("machine", "specimen", "servovalves", "controller")} == {
        "machine": "LHPOST6",
        "specimen": "none",
        "servovalves": "10",
        "controller": "a panel",
    }


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda d: d.assign_attrs(kind="simulated"), "is not a drive file; make one with `lhpost6 iterate`"),
        (lambda d: d.isel(axis=slice(0, 3)), "is damaged or incomplete"),
        (lambda d: d.drop_vars("wanted_velocity"), "is damaged or incomplete: .*wanted_velocity"),
        (lambda d: d.assign_attrs(axes=""), "is damaged or incomplete"),
        (lambda d: d.assign_attrs(mode="jerk"), "mode 'jerk' is not one of"),
        (lambda d: with_value(d, "drive", np.nan), "drive is not finite in x at sample 5"),
        (lambda d: with_value(d, "time", np.nan), "its samples are not those of the controller, 2048 Hz"),
        (lambda d: d.isel(time=slice(0, None, 2)), "its samples are not those of the controller, 2048 Hz"),
    ],
)
def test_what_is_no_drive_is_refused_by_file_and_reason(path, change, message):
    with pytest.raises(RecordError, match=f"changed.nc: .*{message}|changed.nc: {message}"):
        load_drive(changed(path, change))
    path.write_bytes(path.read_bytes()[:20000])  # half a file
    with pytest.raises(RecordError, match=r"drive.nc: not a netCDF-4"):
        load_drive(path)


def test_another_machine_is_refused_and_another_load_warned_of(path, caplog):
    made_with, machine = load_drive(path).attrs, load_machine()
    check_circumstances("drive.nc", made_with, machine, "a panel")
    check_circumstances("old.nc", {}, machine, "a panel")  # says nothing about itself
    assert not caplog.records
    with pytest.raises(RecordError, match=r"drive.nc: was made on LHPOST6, not on uniaxial; choose --machine"):
        check_circumstances("drive.nc", made_with, load_machine("uniaxial"), "a panel")
    with caplog.at_level(logging.WARNING):
        check_circumstances("drive.nc", made_with, machine.with_specimen("pendulum", locked=True), "another")
    told = [record.getMessage() for record in caplog.records]
    assert len(told) == 2 and "made with specimen none, this run has pendulum" in told[0]
    assert "made with controller a panel, this run has another" in told[1]


def test_a_drive_states_the_time_scale_of_its_motion_and_one_from_before_has_none(tmp_path):
    target = make_target(with_time_scale(find_motion("sine", amplitude=0.01), 0.5), axes="x")
    path = save_drive(target.acceleration, "acceleration", target, tmp_path / "drive.nc", {})
    assert load_drive(path).target.reference.time_scale == 0.5
    data = open_record(path)
    del data.attrs["time_scale"]
    data.to_netcdf(tmp_path / "old.nc", engine="h5netcdf")
    assert load_drive(tmp_path / "old.nc").target.reference.time_scale == 1.0

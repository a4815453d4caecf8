"""One column of a file mapped to two channels is found; what may be equal by nature is not."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.records import load_record, make_record
from lhpost6_pin.data.repeated_columns import repeated_columns

RECORD = Path(__file__).parent / "data" / "records" / "practice_a_TX.nc"


@pytest.fixture(scope="module")
def measured() -> xr.Dataset:
    return load_record(RECORD)


def copied(record: xr.Dataset, source: str, to: str, factor: float = 1.0) -> xr.Dataset:
    """The record with the column `source`, as in `strut_pressure[S2]`, in place of `to`."""
    (name, label), (target, place) = (channel.rstrip("]").split("[") for channel in (source, to))
    values = record[target].copy(deep=True)
    values.loc[{values.dims[1]: place}] = factor * record[name].sel({record[name].dims[1]: label}).values
    return record.assign({target: values})


@pytest.mark.parametrize(
    ("source", "to"),
    [
        ("actuator_force[V2]", "actuator_force[V1]"),
        ("strut_pressure[S2]", "strut_pressure[S1]"),
        ("chamber_pressure_a[V2]", "chamber_pressure_a[V1]"),
        ("chamber_pressure_a[H1]", "chamber_pressure_b[H1]"),
        ("platen_displacement[x]", "platen_displacement[y]"),
        ("spool_command[H1]", "spool_position[H1]"),
    ],
)
def test_one_column_in_two_channels_is_a_warning_that_names_both(measured, source, to):
    if source.startswith("spool"):
        noise = np.random.default_rng(0).normal(0.0, 0.1, (2, measured.sizes["time"], 10))
        names = ("spool_command", "spool_position")
        spools = {name: (("time", "actuator"), x) for name, x in zip(names, noise, strict=True)}
        measured = measured.assign(spools)
    (found,) = repeated_columns(copied(measured, source, to))
    assert {found[0], found[2].split(" at every")[0].removeprefix("is the same as ")} == {source, to}


def test_a_column_repeated_with_its_sign_turned_or_thrice_is_found_in_each_further_channel(measured):
    (found,) = repeated_columns(copied(measured, "actuator_force[H1]", "actuator_force[H2]", -1.0))
    assert "but for the sign" in found[2] and found[0] == "actuator_force[H2]"
    thrice = copied(measured, "actuator_force[V1]", "actuator_force[V2]")
    thrice = copied(thrice, "actuator_force[V1]", "actuator_force[V3]")
    assert [channel for channel, *_ in repeated_columns(thrice)] == ["actuator_force[V2]", "actuator_force[V3]"]


def test_the_check_states_it_as_a_warning(measured):
    found = check_dataset(copied(measured, "actuator_force[V2]", "actuator_force[V1]"))
    (finding,) = (f for f in found if "one column of the file" in f.message)
    assert finding.severity == "warning" and "channel map" in finding.remedy


def test_sound_constant_simulated_and_commanded_columns_may_be_equal(measured):
    assert list(repeated_columns(measured)) == []
    same = copied(measured, "actuator_force[V2]", "actuator_force[V1]")
    clean = {key: value for key, value in measured.attrs.items() if key != "noise"} | {"kind": "simulated"}
    same.attrs = clean
    assert list(repeated_columns(same)) == []
    constant = measured["actuator_force"].copy(data=np.full(measured["actuator_force"].shape, 3.0))
    assert list(repeated_columns(measured.assign(actuator_force=constant))) == []
    time = np.arange(512) / 256
    command = np.sin(time)[:, None] * np.ones(6)
    record = make_record(time, {"reference_displacement": command}, {}, {"kind": "measured"})
    assert list(repeated_columns(record)) == []


def test_one_sensor_may_serve_the_platen_and_the_one_actuator_of_a_table(measured):
    shared = copied(measured, "platen_displacement[x]", "actuator_displacement[H1]")
    assert list(repeated_columns(shared)) == []

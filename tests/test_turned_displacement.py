"""A turned axis of the platen's displacement is named itself, not the channels that contradict it."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lhpost6_pin.data.campaign_check import check_campaign
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.turned_displacement import turned_displacement
from lhpost6_pin.machine.machine import load_machine

RECORDS = Path(__file__).parent / "data" / "records"
MACHINE = load_machine()


@pytest.fixture(scope="module")
def tests() -> dict[str, xr.Dataset]:
    return {name: load_record(RECORDS / f"practice_a_{name}.nc") for name in ("TX", "WN")}


def turned(record: xr.Dataset, name: str, *labels: str, factor: float = -1.0) -> xr.Dataset:
    """The record with columns of a variable times -1, all of them without labels."""
    values = record[name].copy(deep=True)
    values.loc[{values.dims[1]: list(labels) or values[values.dims[1]].values}] *= factor
    return record.assign({name: values})


def faults(record: xr.Dataset) -> list[str]:
    return [finding.channel for finding in check_dataset(record, MACHINE) if finding.severity != "info"]


def test_the_one_that_all_others_contradict_is_the_only_finding(tests):
    record = turned(tests["TX"], "platen_displacement", "x")
    (finding,) = (f for f in check_dataset(record, MACHINE) if f.severity != "info")
    assert (finding.severity, finding.channel) == ("error", "platen_displacement[x]")
    assert finding.message == (
        "is turned against platen_velocity[x], platen_acceleration[x], actuator_displacement[H1, H2, H3, H4], "
        "actuator_force[H1, H2, H3, H4]"
    )
    assert "sign = -1" in finding.remedy
    checked = check_campaign(MACHINE, [record], "lhpost6")
    assert checked is not None and checked.contradictions == ()


def test_several_axes_are_named_each_and_a_turned_force_beside_them(tests):
    record = turned(tests["WN"], "platen_displacement", "x", "z", "yaw")
    assert faults(record) == [f"platen_displacement[{axis}]" for axis in ("x", "z", "yaw")]
    both = turned(turned(tests["TX"], "platen_displacement", "x"), "actuator_force", "H2")
    found = faults(both)
    assert found[:2] == ["platen_displacement[x]", "actuator_force[H2]"]
    assert not {"actuator_force[H1]", "actuator_force[H3]", "platen_velocity[x]"} & set(found)


@pytest.mark.parametrize(
    ("others", "labels"),
    [
        (("platen_velocity",), ("x",)),
        (("platen_acceleration",), ("x",)),
        (("platen_velocity", "platen_acceleration"), ("x",)),
        (("actuator_force",), ()),
        (("actuator_displacement",), ()),
        (("actuator_displacement", "actuator_force"), ()),
        (("actuator_displacement",), ("H2",)),
    ],
)
def test_the_displacement_is_not_blamed_where_another_channel_agrees_with_it(tests, others, labels):
    record = tests["TX"]
    for name in others:
        record = turned(record, name, *labels)
    found, same = turned_displacement(record, MACHINE)
    assert found == [] and same is record


def test_one_against_one_is_in_doubt_and_both_are_named_as_before(tests):
    alone = tests["TX"][["platen_displacement", "platen_velocity"]]
    record = turned(alone, "platen_displacement", "x")
    assert turned_displacement(record, MACHINE)[0] == []
    (finding,) = (f for f in check_dataset(record, MACHINE) if f.severity == "warning")
    assert finding.channel == "platen_velocity[x]" and "platen_displacement[x]" in finding.message


def test_without_a_machine_velocity_and_acceleration_together_decide(tests):
    (finding,), back = turned_displacement(turned(tests["WN"], "platen_displacement", "y"), None)
    assert finding.channel == "platen_displacement[y]"
    np.testing.assert_array_equal(back["platen_displacement"], tests["WN"]["platen_displacement"])


def test_sound_short_and_wrongly_scaled_records_have_no_turned_axis(tests):
    for record in (*tests.values(), *(tests["TX"].isel(time=slice(n)) for n in (1, 2, 9, 300))):
        assert turned_displacement(record, MACHINE)[0] == []
    scaled = turned(tests["TX"], "platen_displacement", factor=1e3)
    assert turned_displacement(scaled, MACHINE)[0] == []

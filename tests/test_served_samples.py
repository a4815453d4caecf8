"""Recordings of a served plant: samples that show no sensor blame none, and what happened is stated."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lhpost6_pin.data.campaign import Campaign
from lhpost6_pin.data.campaign_check import contradicting_sensors
from lhpost6_pin.data.check import check_dataset
from lhpost6_pin.data.records import load_record, make_record
from lhpost6_pin.data.served_samples import SAFE_HOLD, cut_notes, part_compared
from lhpost6_pin.identification.calibration import usable_tests
from lhpost6_pin.interfaces.link import PlantState
from lhpost6_pin.machine.machine import load_machine

TABLE = load_machine("uniaxial")
RATE, TRIP = 2048, 3000
INT = {"units": "1", "long_name": "of the served plant"}


def recorded(missed: slice = slice(0), **attrs: str) -> xr.Dataset:
    """A smooth test that trips, from where on its spool is at rest; the samples `missed` repeat the one before."""
    t = np.arange(2 * RATE) / RATE
    phase = 2 * np.pi * 2.5 * t
    x, force = np.zeros((len(t), 6)), 1e4 * np.sin(phase)[:, None]
    x[:, 0] = 0.01 * (phase - np.sin(phase)) / phase[-1]
    spool = 0.1 * np.sin(phase)[:, None]
    spool[TRIP:] = spool[TRIP]
    every = np.arange(len(t))
    every[missed] = missed.start - 1 if missed.stop else 0
    answered = np.ones(len(t), np.int8)
    answered[missed] = 0
    state = np.where(np.arange(len(t)) < TRIP, PlantState.RUNNING, PlantState.HOLD).astype(np.int8)
    channels = {"platen_displacement": x, "actuator_force": force, "spool_position": spool}
    channels = {name: values[every] for name, values in channels.items()}
    channels |= {"answered": (("time",), answered, INT), "plant_state": (("time",), state, INT)}
    return make_record(t, channels, TABLE.labels, {"kind": "simulated", "test": "panel", **attrs})


def warned(record: xr.Dataset) -> list[str]:
    return [str(f) for f in check_dataset(record, TABLE) if f.severity != "info"]


def test_the_safe_hold_is_that_of_the_link():
    assert SAFE_HOLD == PlantState.HOLD


@pytest.mark.parametrize("count", [1, 7, 40])
def test_unanswered_samples_are_one_line_and_no_fault_of_a_sensor(count):
    record = recorded(slice(1500, 1500 + count))
    stated = f"{count} sample{'s'[: count != 1]} without an answer of the controller (`answered`)"
    assert warned(record) == [f"sample 1500: {stated} (all channels repeat the sample before)"]
    assert len(warned(record.drop_vars("answered"))) > 0  # the repeats are findings otherwise


def test_a_spool_at_rest_in_the_safe_hold_is_not_clipped_and_the_trip_is_stated():
    record = recorded(trouble="tripped at 1.465 s: by Anna")
    assert warned(record) == ["tripped at 1.465 s: by Anna (what follows is not the test's)"]
    assert any("spool_position" in found and "samples" in found for found in warned(record.drop_vars("plant_state")))


def test_a_sensor_that_is_stuck_for_longer_than_the_unanswered_samples_is_found():
    record = recorded(slice(1500, 1507))
    force = record["actuator_force"].values.copy()
    force[1490:1530] = force[1490]
    found = warned(record.assign(actuator_force=record["actuator_force"].copy(data=force)))
    assert len(found) == 2 and "is stuck at" in found[1] and "for 40 samples" in found[1]


# ------------------------------------------------------------------------------------------ up to a trip
@pytest.mark.parametrize(
    ("trouble", "count"),  # of samples that are left
    [
        ("tripped at 1.465 s: by Anna", 3001),
        ("tripped before the recording began: by Anna", 2),
        ("tripped at 9 s", None),
    ],
)
def test_a_recording_is_used_up_to_its_trip_once(trouble, count, caplog):
    """At 2048 Hz sample 3000 is at 1.46484 s, the last before the trip."""
    record = recorded(trouble=trouble)
    record.encoding["source"] = "panel.nc"
    part = part_compared(record)
    assert part.sizes["time"] == (2 * RATE if count is None else count) and part.encoding["source"] == "panel.nc"
    assert bool(cut_notes(part)) == (count is not None) == ("test panel tripped" in caplog.text)
    assert part_compared(part).identical(part)
    assert not cut_notes(record.assign_attrs(cut="ends in motion")) and part_compared(recorded()).identical(recorded())


def test_a_test_that_tripped_is_calibrated_up_to_its_trip_or_skipped(caplog):
    early, late = (recorded(trouble=f"tripped at {t} s: by Anna", test=n) for t, n in ((0.01, "early"), (1.8, "late")))
    campaign = usable_tests(Campaign("c", (early, late)))
    (kept,) = campaign.records
    assert kept.attrs["test"] == "late" and kept.sizes["time"] < 2 * RATE
    assert [one.test for one in campaign.skipped] == ["early"]


def test_sensors_are_compared_up_to_a_trip():
    """After it the valves are the plant's own, and the last command stays: spools were "wrong by a factor"."""
    test = load_record(Path(__file__).parent / "data" / "records" / "practice_a_TX.nc")
    command, spool = (test[name].values.copy() for name in ("spool_command", "spool_position"))
    n = int(np.abs(command[:, 0]).argmax())
    trip = f"tripped at {float(test['time'][n] - test['time'][0]):.3f} s: by Anna"
    command[n:], spool[n:] = command[n], 0.02 * spool[n:]
    after = test.assign(spool_command=test["spool_command"].copy(data=command))
    after = after.assign(spool_position=test["spool_position"].copy(data=spool))
    assert any("spool against command" in words for words in contradicting_sensors(load_machine(), [after]))
    assert contradicting_sensors(load_machine(), [after.assign_attrs(trouble=trip)]) == ()

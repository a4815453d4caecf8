"""Sound records pass in silence; each way of breaking one is found at the right channel and sample."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lhpost6_pin.data import campaign_check
from lhpost6_pin.data.check import check_dataset, check_record
from lhpost6_pin.data.layout_faults import RecordFinding
from lhpost6_pin.data.records import load_record, make_record
from lhpost6_pin.data.summary import summarise_records
from lhpost6_pin.machine.machine import load_machine

pytestmark = pytest.mark.long

RECORDS = Path(__file__).parent / "data" / "records"
PRACTICE = sorted(RECORDS.glob("practice_*.nc"))
MACHINE = load_machine()


@pytest.fixture(scope="module")
def tests():
    return {path.stem.split("_")[2]: load_record(path) for path in PRACTICE}


def faults(found: list[RecordFinding]) -> list[tuple[str, str, int | None]]:
    return [(f.severity, f.channel, f.sample) for f in found if f.severity != "info"]


def put(record: xr.Dataset, name: str, values: np.ndarray) -> xr.Dataset:
    return record.assign({name: record[name].copy(data=values)})


def change(record: xr.Dataset, channel: str, values: object, start: int = 0) -> xr.Dataset:
    """Set values of `channel`, as in `platen_velocity[y]`, from `start` on."""
    name, label = channel.rstrip("]").split("[")
    copy = record[name].copy(deep=True)
    values = np.atleast_1d(values)
    copy.values[start : start + len(values), list(copy[copy.dims[1]].values).index(label)] = values
    return record.assign({name: copy})


def series(record: xr.Dataset, channel: str) -> np.ndarray:
    name, label = channel.rstrip("]").split("[")
    return record[name].sel({record[name].dims[1]: label}).values.copy()


# ----------------------------------------------------------------------------------------- sound records
@pytest.mark.parametrize("path", PRACTICE, ids=lambda p: p.stem)
def test_a_noisy_measured_record_gives_neither_errors_nor_warnings(path: Path):
    assert faults(check_record(path)) == []


def test_the_reference_record_gives_one_warning_that_is_true():
    found = check_record(RECORDS / "open_loop_ridgecrest.nc")
    assert faults(found) == [("warning", "spool_position[H1]", 3071)]  # held at 0.99749 for 12 samples
    assert "12 samples" in next(f.message for f in found if f.severity == "warning")


def test_the_contents_are_listed_with_units_ranges_rate_and_duration():
    lines = [str(f) for f in check_record(RECORDS / "practice_a_TX.nc") if f.severity == "info"]
    assert "measured TX" in lines[0] and "5632 samples" in lines[0] and "512 Hz" in lines[0]
    assert any(line.startswith("platen_displacement[x, y, z]: m, 5632 x 3, -0.200") for line in lines)


def test_metres_and_radians_have_a_range_each():
    lines = [str(f) for f in check_record(RECORDS / "practice_a_TX.nc") if f.severity == "info"]
    turned = next(line for line in lines if line.startswith("platen_displacement[roll, pitch, yaw]: rad, 5632 x 3, "))
    assert max(abs(float(word)) for word in turned.split(", ")[-1].split(" to ")) < 0.01
    assert not any(f"{unit}, rad" in line for line in lines for unit in ("m", "m/s", "m/s2"))


def test_what_a_record_cannot_be_used_for_is_said(tests):
    found = check_dataset(tests["TX"].drop_vars("spool_position"))
    assert any("open loop is not possible without spool_position" in f.message for f in found)


def test_further_variables_are_listed_and_not_judged(tests):
    extra = tests["TX"].assign(oil_temperature=("time", np.full(5632, np.nan)), note=((), "hot"))
    assert faults(check_dataset(extra)) == []
    ours = tests["TX"].assign(supply_flow=("time", np.ones(5632)))  # the package's own
    listed = next(f.message for f in check_dataset(ours) if f.channel == "supply_flow")
    assert listed.endswith(", a further channel")


def test_noise_free_rest_and_motion_along_one_axis_are_not_taken_for_dead_or_stuck_channels():
    t = np.arange(4096) / 1024
    ramp = np.clip(t - 1, 0, 1) ** 3 * np.sin(2 * np.pi * 2 * (t - 1))  # one second at rest, exactly
    motion = np.zeros((4096, 6))
    motion[:, 0] = 0.1 * ramp
    motion[:, 4] = 1e-19 * np.cumsum(np.sign(np.sin(40 * t)))  # what rounding leaves on an axis at rest
    record = make_record(t, {"platen_displacement": motion}, {}, {"kind": "simulated"})
    assert faults(check_dataset(record)) == []


# ---------------------------------------------------------------------------------------- broken channels


@pytest.mark.parametrize(
    ("test", "channel", "sample", "value", "size"),
    [
        ("TX", "actuator_force[H2]", 777, 1.0, 2e5),
        ("EQ", "platen_acceleration[y]", 5000, 1.0, -8.0),
        ("WN", "platen_displacement[z]", 2500, 1.0, 2e-3),
        ("EQ", "chamber_pressure_b[H4]", 4, 1.0, 1e6),
        ("EQ", "strut_pressure[S3]", 3000, 0.0, 0.0),
        ("WN", "strut_pressure[S2]", None, 0.0, 1.5e7),
    ],
    ids=["force", "acceleration", "displacement", "pressure", "dropout to zero", "never changes"],
)
def test_a_spike_a_dropout_and_a_channel_that_never_changes_are_found(tests, channel, test, sample, value, size):
    record = tests[test]
    start = sample or 0
    values = value * series(record, channel)[start : None if sample is None else start + 1] + size
    assert faults(check_dataset(change(record, channel, start=start, values=values))) == [("warning", channel, start)]


@pytest.mark.parametrize(
    ("kind", "share", "found"), [("simulated", 5e-4, 0), ("simulated", 5e-3, 1), ("measured", 5e-4, 1)]
)
def test_a_spike_of_a_record_without_noise_has_a_least_size(kind, share, found):
    """Where friction changes, a model's acceleration has kinks that no other sample shows: 1e-4 of the span."""
    t = np.arange(4096) / 2048
    x = np.zeros((len(t), 6))
    x[:, 4] = 0.05 * np.sin(2 * np.pi * 1.5 * t) * np.sin(np.pi * t / t[-1]) ** 2
    x[1234, 4] += share * np.ptp(x[:, 4])
    record = make_record(t, {"platen_acceleration": x}, MACHINE.labels, {"kind": kind, "test": "kink"})
    spikes = [f for f in check_dataset(record, MACHINE) if f.remedy == "interpolate it"]
    assert [(f.channel, f.sample) for f in spikes] == found * [("platen_acceleration[pitch]", 1234)]


def test_a_step_of_the_spool_and_a_kink_of_the_pressure_are_no_spikes():
    t = np.arange(4096) / 2048
    spool = np.where(t < 1, 0.3, -0.1) * np.sin(2 * np.pi * 3 * t + 0.5) + 0.01 * np.sin(170 * t)
    pressure = 5e6 + 1e5 * np.sin(40 * t) + 4e7 * np.maximum(t - 1, 0)
    channels = {"spool_position": spool[:, None], "chamber_pressure_a": pressure[:, None]}
    assert faults(check_dataset(make_record(t, channels, {"actuator": ["A1"]}, {}))) == []


def test_a_stuck_channel_is_found_where_it_stops(tests):
    record, channel = tests["EQ"], "actuator_displacement[H3]"
    x = series(record, channel)
    start = 3000 + int(np.argmax(np.abs(np.diff(x[3000:4000]))))  # it freezes while it moves fast
    found = check_dataset(change(record, channel, start=start, values=np.full(40, x[start])))
    assert ("warning", channel, start) in faults(found)
    assert any("stuck" in f.message and "40 samples" in f.message for f in found)


def test_a_clipped_channel_is_found_at_its_first_clipped_peak(tests):
    record, channel = tests["TX"], "actuator_displacement[H1]"
    x = series(record, channel)
    limit = 0.6 * x.max()
    found = check_dataset(change(record, channel, values=np.minimum(x, limit)))
    assert faults(found) == [("warning", channel, int(np.argmax(x >= limit)))]
    assert any("clipped" in f.message for f in found)


def test_a_saturated_spool_is_found_at_the_first_sample_at_its_end(tests):
    record = tests["EQ"]
    command = np.clip(4 * record["spool_command"].values, -1, 1)
    first = int(np.argmax(np.abs(command[:, 0]) == 1))
    found = faults(check_dataset(put(record, "spool_command", command)))
    assert ("warning", "spool_command[H1]", first) in found
    assert {channel for _, channel, _ in found} <= {f"spool_command[{a}]" for a in record["actuator"].values}


def test_a_record_that_begins_during_the_motion_is_found(tests):
    cut = tests["EQ"].isel(time=slice(4000, None))
    found = faults(check_dataset(cut))
    assert ("warning", "platen_displacement[x]", 0) in found
    assert ("warning", "platen_velocity[y]", 0) in found


@pytest.mark.parametrize(("roll", "said"), [(2e-6, False), (2e-3, True)])
def test_rounding_of_an_axis_that_hardly_moves_is_no_start_in_motion(roll: float, said: bool):
    """2 micro-radians move an edge of the platen by 0.01 mm, in a test of 0.5 m."""
    t = np.arange(4096) / 1024
    moved = np.clip(t - 1, 0, 1) ** 3 * np.sin(2 * np.pi * 2 * (t - 1))
    motion = np.zeros((4096, 6))
    motion[:, 0] = 0.5 * moved
    motion[:, 3] = roll * (1 + 0.3 * moved)
    record = make_record(t, {"platen_displacement": motion}, {}, {"kind": "measured"})
    assert (("warning", "platen_displacement[roll]", 0) in faults(check_dataset(record))) == said


def test_unfiltered_noise_up_to_half_the_sampling_rate_is_found(tests):
    record, channel = tests["EQ"], "platen_acceleration[z]"
    x = series(record, channel)
    noise = np.random.default_rng(5).normal(0, x.std(), len(x))
    assert faults(check_dataset(change(record, channel, start=100, values=(x + noise)[100:]))) == [
        ("warning", channel, None)
    ]


def test_a_record_sampled_too_slowly_is_found(tests):
    slow = tests["EQ"].isel(time=slice(None, None, 8)).assign_attrs(sample_rate_hz=64)
    assert ("warning", "time", None) in faults(check_dataset(slow))


# ------------------------------------------------------------------------------------------ forgotten units
@pytest.mark.parametrize(
    ("test", "name", "factor", "said"),
    [
        ("TX", "platen_displacement", 1e3, "mm"),
        ("TX", "chamber_pressure_a", 1e-5, "bar"),
        ("TX", "chamber_pressure_b", 1e-6, "MPa"),
        ("TX", "strut_pressure", 1 / 6894.76, "psi"),
        ("TX", "spool_position", 100.0, "%"),
        ("WN", "platen_acceleration[y]", 1 / 9.80665, "in g"),
        ("WN", "platen_velocity[x]", 1e3, "in mm"),
        ("WN", "platen_velocity[z]", 1 / 0.0254, "in inches"),
        ("WN", "platen_velocity[yaw]", 180 / np.pi, "in degrees"),
        ("WN", "platen_velocity[y]", -1.0, "opposite signs"),
        ("WN", "platen_velocity[x]", 25.4, "or platen_displacement[x] in inches, taken for mm?"),
        ("WN", "platen_velocity[x]", 1 / 25.4, "or platen_displacement[x] in mm, taken for inches?"),
        ("WN", "platen_acceleration[x]", 9.80665, "in m/s2, taken for g?"),
    ],
)
def test_values_of_another_unit_or_sign_are_found_with_the_likely_reason(tests, test, name, factor, said):
    """By their size, or by what contradicts a derivative."""
    record = tests[test]
    whole = "[" not in name
    values = factor * (record[name].values if whole else series(record, name))
    found = check_dataset(put(record, name, values) if whole else change(record, name, values=values))
    assert any(f.severity == "warning" and f.channel.startswith(name) and said in f.message for f in found)


def test_a_gain_error_within_calibration_is_not_a_finding(tests):
    record = tests["WN"]
    slightly = put(record, "platen_acceleration", 1.02 * record["platen_acceleration"].values)
    assert faults(check_dataset(slightly)) == []  # 2 %: four times the sensors' 0.5 %


def test_swapped_accelerometers_are_found(tests):
    record = tests["EQ"]
    swapped = record["platen_acceleration"].values[:, [1, 0, 2, 3, 4, 5]]
    found = [f for f in check_dataset(put(record, "platen_acceleration", swapped)) if f.severity == "warning"]
    assert {f.channel for f in found} == {"platen_acceleration[x]", "platen_acceleration[y]"}
    assert any("platen_displacement[y]" in f.message for f in found if f.channel.endswith("[x]"))


def test_forces_agree_with_pressures_times_areas(tests):
    record = tests["EQ"]
    assert faults(check_dataset(record, MACHINE)) == []
    flipped = change(record, "actuator_force[H2]", values=-series(record, "actuator_force[H2]"))
    turned = [("error", "actuator_force[H2]", None), ("warning", "actuator_force[H2]", None)]  # motion, pressures
    assert faults(check_dataset(flipped, MACHINE)) == turned
    assert faults(check_dataset(flipped)) == []  # without areas nothing can be said


def test_noise_is_not_taken_for_a_wrong_gain_of_forces(tests):
    record, rng = tests["EQ"], np.random.default_rng(4)
    force, pressure = series(record, "actuator_force[V3]"), series(record, "chamber_pressure_a[V3]")
    size = len(force)
    noisy = change(record, "actuator_force[V3]", values=force + 0.2 * force.std() * rng.standard_normal(size))
    assert faults(check_dataset(noisy, MACHINE)) == []
    still = change(record, "actuator_force[V3]", values=force.mean() + 500.0 * rng.standard_normal(size))
    still = change(still, "chamber_pressure_a[V3]", values=pressure.mean() + 3000.0 * rng.standard_normal(size))
    assert faults(check_dataset(still, MACHINE)) == []  # 1.5 kN beside the others' tens
    halved = change(record, "actuator_force[V3]", values=0.5 * force)
    assert faults(check_dataset(halved, MACHINE)) == [("warning", "actuator_force[V3]", None)]


def at_rest(record: xr.Dataset, actuators: tuple[str, ...], motion: float = 0.0) -> xr.Dataset:
    """The record with a share of the motion of some actuators, in force and pressures of the noise of their sensors."""
    rng = np.random.default_rng(7)
    for name, noise in (("actuator_force", 1300.0), ("chamber_pressure_a", 3100.0), ("chamber_pressure_b", 3100.0)):
        for actuator in actuators:
            if name == "chamber_pressure_b" and actuator.startswith("V"):
                continue
            x = series(record, f"{name}[{actuator}]")
            x = x.mean() + motion * (x - x.mean()) + noise * rng.standard_normal(len(x))
            record = change(record, f"{name}[{actuator}]", values=x)
    return record


def contradicting_pressures(record: xr.Dataset) -> set[str]:
    return {f.channel for f in check_dataset(record, MACHINE) if f.severity == "warning" and "P_A" in f.message}


@pytest.mark.parametrize("motion", [0.0, 0.003, 0.01, 0.03])
def test_forces_of_actuators_that_hardly_move_in_a_test_are_not_doubted(tests, motion):
    quiet = at_rest(tests["EQ"], ("H1", "H2", "H3", "H4"), motion)
    assert contradicting_pressures(quiet) == set()


def test_a_record_of_noise_alone_has_no_doubtful_force(tests):
    still = at_rest(tests["EQ"], tuple(MACHINE.actuator_names))
    assert contradicting_pressures(still) == set()


def test_forces_of_two_actuators_that_are_swapped_are_found(tests):
    forces = {name: series(tests["EQ"], f"actuator_force[{name}]") for name in ("H1", "V2")}
    swapped = change(tests["EQ"], "actuator_force[H1]", values=forces["V2"])
    swapped = change(swapped, "actuator_force[V2]", values=forces["H1"])
    assert contradicting_pressures(swapped) == {"actuator_force[H1]", "actuator_force[V2]"}


def test_a_campaign_has_a_summary_of_its_tests(tests):
    first, second = summarise_records([tests["TX"], tests["WN"].drop_vars("platen_velocity")])
    assert (first.test, first.rate_hz, first.seconds) == ("TX", 512.0, pytest.approx(5631 / 512))
    moved = tests["TX"]["platen_displacement"]
    assert first.peaks["displacement"]["x"] == float(abs(moved.sel(axis="x")).max())
    assert first.peaks["displacement"]["yaw"] == float(abs(moved.sel(axis="yaw")).max())
    assert "velocity" not in second.peaks
    assert first.channels == second.channels + 6


# -------------------------------------------------------------------------------------------------- errors
def test_errors_of_the_layout_come_first_and_leave_the_sound_channels_judged(tests):
    record = change(tests["TX"], "platen_velocity[y]", start=1234, values=np.nan)
    record = change(record, "strut_pressure[S1]", start=2000, values=0.0)
    wrong = [("error", "platen_velocity[y]", 1234), ("warning", "strut_pressure[S1]", 2000)]
    assert faults(check_dataset(record)) == wrong


def test_a_gap_in_time_is_found_with_its_length(tests):
    gap = tests["TX"].drop_isel(time=range(1000, 1012))
    found = check_dataset(gap)
    assert faults(found) == [("error", "time", 1000)]
    assert "12 missing samples" in found[0].message


@pytest.mark.parametrize("count", [1, 2, 3, 9, 70, 300])
def test_a_record_of_any_length_can_be_checked(tests, count: int):
    found = faults(check_dataset(tests["TX"].isel(time=slice(0, count)), MACHINE))
    assert [severity for severity, channel, _ in found if channel == "time"] == ["error"] * (count == 1)


def test_what_cannot_be_opened_is_one_error_that_names_the_file(tmp_path: Path):
    (tmp_path / "notes.nc").write_text("not a record")
    for name in ("notes.nc", "absent.nc"):
        (finding,) = check_record(tmp_path / name)
        assert finding.severity == "error" and name in finding.message


def test_lengths_of_turned_sign_or_in_a_wrong_unit_contradict_the_pose(tests):
    right = campaign_check.check_campaign(MACHINE, [tests["EQ"]], "lhpost6")
    assert right is not None and right.contradictions == ()
    length, place = "actuator_displacement", {"actuator": "H2"}
    remedies = "turned; correct its sign", "correct its unit or factor", "it does not respond; mend the sensor"
    for factor, remedy in zip((-1.0, 25.4, 0.0), remedies, strict=True):
        wrong = tests["EQ"].copy(deep=True)
        wrong[length].loc[place] *= factor
        found = campaign_check.check_campaign(MACHINE, [wrong], "lhpost6")
        assert found is not None
        (words,) = (words for words in found.contradictions if words.startswith(f"{length}[H2]: "))
        assert remedy in words and f"gain {factor:.2g}" in words


@pytest.mark.parametrize("factor", [39.37, 1 / 25.4])
def test_a_displacement_in_a_wrong_unit_is_named_and_not_the_channels_that_disagree_with_it(tests, factor: float):
    wrong = tests["EQ"].copy(deep=True)
    wrong["platen_displacement"] *= factor
    found = campaign_check.check_campaign(MACHINE, [wrong], "lhpost6")
    assert found is not None
    (words,) = found.contradictions
    assert words.startswith("platen_displacement: actuator_displacement (gain ") and "platen_acceleration" in words
    assert words.endswith("disagree with it alike: correct its unit or factor in the channel map, and import again")


def test_pressures_in_a_wrong_unit_leave_it_open_whether_forces_are(tests):
    wrong = tests["EQ"].copy(deep=True)
    for name in ("chamber_pressure_a", "chamber_pressure_b"):
        wrong[name] *= 1e3
    found = campaign_check.check_campaign(MACHINE, [wrong], "lhpost6")
    assert found is not None
    (words,) = found.contradictions
    assert words.startswith("actuator_force: force against pressures: gain 0.001")
    assert "its unit or factor, or that of chamber_pressure, is wrong" in words


def test_a_spool_in_per_cent_is_a_matter_of_its_unit_and_not_of_the_test(tests):
    percent = tests["EQ"].copy(deep=True)
    percent["spool_position"] *= 100.0
    words = [str(finding) for finding in check_dataset(percent, MACHINE) if "spool_position" in finding.channel]
    assert any("V or % for the share of full stroke?" in one for one in words)
    assert not any("reduce the scale" in one for one in words)

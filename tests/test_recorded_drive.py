"""Recorded drives and servovalves recorded apart: replayed as they were, scaled, compared in phase III."""

import numpy as np
import pytest
from commands import refused

from lhpost6_pin.control import load_controller
from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.data.campaign import Campaign
from lhpost6_pin.data.records import load_record, make_record
from lhpost6_pin.data.replay_comparison import compare
from lhpost6_pin.data.valve_pairs import with_joint_spools
from lhpost6_pin.identification.validation import validate
from lhpost6_pin.laws.orifice import opening
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.report.open_loop_report import comparison_table, write_open_loop_report
from lhpost6_pin.simulation.rehearse import rehearse, replay
from lhpost6_pin.tuning.drives import Drive, circumstances, save_drive, scaled_drive

pytestmark = pytest.mark.long
SETTINGS = load_controller("lhpost6")


@pytest.fixture(scope="module")
def target():
    motion = find_motion("triangle", axis="x", amplitude=0.1, velocity=0.2, corner_acceleration=3.0, cycles=1)
    return make_target(motion)


@pytest.fixture(scope="module")
def driven(machine, target):
    """A run by a drive that is not the target's: larger, and with some yaw."""
    drive = 1.1 * target.acceleration
    drive[:, 5] = 0.05 * target.acceleration[:, 0]
    return rehearse(machine, target, SETTINGS, attrs={"test": "TX"}, drive=drive, engine="fused").record


def closed_loop(machine, record):
    return validate(machine, Campaign("driven", (record,)), phases=[3]).phase("TX", 3)


def test_phase_three_follows_the_recorded_drive(machine, driven, target):
    assert np.array_equal(driven["drive_acceleration"].values[:, 0], 1.1 * target.acceleration[:, 0])
    phase = closed_loop(machine, driven)
    assert "driven by the recorded drive" in phase.notes
    assert max(a.rrmse for a in phase.agreement if a.moves) < 1e-9  # the same run; the drive is resampled onto itself
    without = closed_loop(machine, driven.drop_vars("drive_acceleration"))
    assert max(a.rrmse for a in without.of("displacement") if a.moves) > 0.05  # a tenth less drive


def test_a_drive_of_another_mode_is_refused(machine, driven):
    other = driven.rename(drive_acceleration="drive_displacement")
    with pytest.raises(RecordError, match=r"the recorded drive is for displacement mode; .* has acceleration mode"):
        closed_loop(machine, other)


def test_commands_of_servovalves_b_are_compared_on_their_own(machine, driven):
    names = list(machine.double_acting)
    command = driven["spool_command"].sel(actuator=names).values
    record = driven.assign(spool_command_b=(("time", "horizontal"), command + 0.01))
    found = closed_loop(machine, record).of("spool_command_b")
    assert [a.column for a in found] == names
    assert all(a.error == pytest.approx(0.01, rel=1e-6) for a in found)


# Spools of two valves ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def paired(machine, target):
    """A run with two servovalves, its record as if A were 0.02 further open than the joint spool, and B less."""
    both = machine.with_valves(2)
    record = rehearse(both, target, SETTINGS, attrs={"test": "TX"}, engine="fused").record
    joint, apart = record["spool_position"], record["spool_position"].copy(deep=True)
    names, curve = list(both.double_acting), both.actuators[0].flow_curve
    a = joint.sel(actuator=names).values + 0.02
    wanted = 2.0 * np.vectorize(opening)(joint.sel(actuator=names).values, curve) - np.vectorize(opening)(a, curve)
    b = np.copysign(-np.log1p(-np.abs(wanted)) / curve, wanted)
    apart.loc[{"actuator": names}] = a
    return both, record, record.assign(spool_position=apart, spool_position_b=(("time", "horizontal"), b))


def test_a_replay_is_judged_by_the_axes_that_its_test_moves(tmp_path):
    """Noise of 1 urad in yaw has an RRMSE of several hundred per cent, the motion in x one of 1 %."""
    t = np.arange(2048) / 512
    moved, noise = np.zeros((2048, 6)), 1e-6 * np.random.default_rng(0).standard_normal((2048, 6))
    moved[:, 0] = 0.1 * np.sin(2 * np.pi * t)
    facts = {"kind": "simulated", "test": "TX", "title": "TX", "specimen": "none", "machine": "m", "source": "s"}
    channels = {"reference_displacement": moved, "platen_displacement": moved + noise}
    measured = make_record(t, channels, {}, facts)
    simulated = make_record(t, {"platen_displacement": 1.01 * moved + 4.0 * noise[::-1]}, {}, facts)
    compared = compare(measured, simulated)
    assert compared[5].largest_difference > 2e-6  # noise, over noise several times as much
    assert [not np.isnan(one.rrmse) for one in compared] == [True, *[False] * 5]
    assert [row[3] for row in comparison_table(compared).rows][1:] == ["at rest"] * 5
    verdict, _ = write_open_loop_report(measured, simulated, compared, tmp_path / "report.html")
    assert "displacement 1.00\N{NO-BREAK SPACE}% (x) at most; displacement of the axes that move (x)." in verdict
    clipped = simulated.assign_attrs(spool_values_clipped=7)
    for shown, word in (
        (clipped, "at most"),
        (clipped.assign_attrs(trouble="stopped at 2 s: V6"), "The replay stopped"),
    ):
        verdict, _ = write_open_loop_report(measured, shown, compared, tmp_path / "clipped.html")
        assert word in verdict and "7 recorded spool values beyond full stroke were clipped" in verdict
    page = (tmp_path / "report.html").read_text()
    assert "x, of the axes that move (x)" in page and "Axes at rest (5)" in page


def test_two_valves_that_open_apart_move_the_table_as_their_joint_spool_does(paired):
    both, record, apart = paired
    together = with_joint_spools(both, apart)["spool_position"]
    assert np.abs(together.values - record["spool_position"].values).max() < 1e-14  # rounding of exp and log
    _, one = replay(both, record, attrs={}, engine="fused")
    _, two = replay(both, apart, attrs={}, engine="fused")
    assert np.abs(one["platen_displacement"].values - two["platen_displacement"].values).max() < 1e-10
    _, wrong = replay(both, apart.drop_vars("spool_position_b"), attrs={}, engine="fused")
    assert np.abs(wrong["platen_displacement"].values - one["platen_displacement"].values).max() > 1e-3


def test_a_valve_that_is_shut_counts_for_nothing_and_b_needs_a(machine, paired):
    _, _, apart = paired
    alone = machine.with_valves(1)
    assert np.array_equal(with_joint_spools(alone, apart)["spool_position"], apart["spool_position"])
    with pytest.raises(RecordError, match="of servovalve A, is missing"):
        with_joint_spools(alone, apart.drop_vars("spool_position"))


# Scaled drives -------------------------------------------------------------------------------------------------------


def test_a_scaled_drive_has_its_target_scaled_with_it(target):
    drive = scaled_drive(Drive(target.acceleration, "acceleration", target, {}), 0.5)
    assert np.array_equal(drive.values, 0.5 * target.acceleration)
    assert np.array_equal(drive.target.displacement, 0.5 * target.displacement)
    assert drive.target.reference.scale == 0.5 * target.reference.scale
    for factor in (0.0, np.nan, np.inf):
        with pytest.raises(RecordError, match="cannot be scaled by"):
            scaled_drive(drive, factor)


def test_the_command_replays_at_another_scale_within_the_limits(lhpost6, machine, target, tmp_path):
    facts = circumstances(machine, SETTINGS.name)
    path = save_drive(target.acceleration, "acceleration", target, tmp_path / "drive.nc", facts)
    assert lhpost6("replay", path, "--scale", "0.5", "--engine", "fused", "--out", tmp_path / "half").code == 0
    record = load_record(tmp_path / "half" / "record.nc")
    assert record.attrs["scale"] == 0.5
    assert np.array_equal(record["reference_displacement"].values, (0.5 * target.displacement).astype(np.float32))
    assert np.array_equal(record["drive_acceleration"].values, (0.5 * target.acceleration).astype(np.float32))
    assert refused(lhpost6("replay", path, "--scale", "20"), "exceeds", "The largest scale that fits")

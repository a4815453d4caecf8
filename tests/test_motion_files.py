"""Records, their exports and files of arrays as motions: round trips; refusals name the file and the remedy."""

import numpy as np
import pytest
from commands import COARSE, refused
from scipy.io import savemat

from lhpost6_pin.core.errors import MotionError, RecordError
from lhpost6_pin.data.importing import export_record
from lhpost6_pin.data.motion_files import load_any_motion, motion_of
from lhpost6_pin.data.records import load_record, make_record, save_record
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.studies.plan_file import plan_from
from lhpost6_pin.tuning.drives import save_drive

GRAVITY = 9.80665
TIME = np.arange(400) * 0.005
WAVE = 0.1 * np.sin(np.arange(400) / 9) * np.sin(np.pi * TIME / 2) ** 2


@pytest.fixture(scope="module")
def target():
    return make_target(find_motion("ridgecrest"), scale=0.4, window=(5.0, 12.0))


@pytest.fixture(scope="module")
def record(target):
    """A record with target and platen motion, which is not the target."""
    channels = {
        "reference_displacement": target.displacement,
        "platen_displacement": 0.9 * target.displacement,
        "platen_acceleration": 0.9 * target.acceleration,
        "actuator_displacement": target.displacement[:, :1],
    }
    return make_record(target.time, channels, {"actuator": ["H1"]}, {"kind": "measured", "test": "EQ"})


def saved(record, folder, form):
    path = folder / f"record.{form}"
    save_record(record, path) if form == "nc" else export_record(record, path, form)
    return path


# --------------------------------------------------------------------------------------------- records
@pytest.mark.parametrize("form", ["nc", "csv", "mat"])
def test_a_record_and_its_exports_move_the_table_as_their_test_was_commanded(tmp_path, record, target, form):
    motion = load_any_motion(saved(record, tmp_path, form))
    assert (motion.quantity, motion.axes) == ("displacement", ("x", "y", "z"))
    assert "record file record" in motion.source
    np.testing.assert_array_equal(motion.samples, target.displacement)
    again = make_target(motion, low_pass=200.0)
    lead = round(-again.reference.start * 2048)
    inner = again.displacement[lead : lead + len(target.time)]
    assert np.abs(inner - target.displacement).max() < 1e-6 * np.abs(target.displacement).max()


def test_a_record_of_another_program_that_states_no_layout_is_a_record(tmp_path, record, target):
    """All attributes of a record are optional; `check` finds no error in it."""
    path = tmp_path / "other.nc"
    foreign = record.copy()
    foreign.attrs = {"kind": "measured"}
    foreign.to_netcdf(path, engine="h5netcdf")
    assert load_record(path).sizes["time"] == len(target.time)
    motion = load_any_motion(path)
    np.testing.assert_array_equal(motion.samples, target.displacement)


@pytest.mark.parametrize("form", ["nc", "csv", "mat"])
def test_a_record_without_target_moves_the_table_as_the_platen_moved(tmp_path, record, target, form):
    measured = record.drop_vars("reference_displacement")
    motion = load_any_motion(saved(measured, tmp_path, form))
    assert motion.quantity == "acceleration"
    np.testing.assert_array_equal(motion.samples, 0.9 * target.acceleration)
    moved = load_any_motion(saved(measured.drop_vars("platen_acceleration"), tmp_path, form))
    assert moved.quantity == "displacement"
    np.testing.assert_array_equal(moved.samples, 0.9 * target.displacement)


@pytest.mark.parametrize("form", ["nc", "csv", "mat"])
def test_channels_of_a_record_are_chosen_by_name(tmp_path, record, target, form):
    path = saved(record, tmp_path, form)
    chosen = load_any_motion(path, channels="x=platen_acceleration,z=platen_acceleration[y]")
    assert chosen.quantity == "acceleration"
    np.testing.assert_array_equal(chosen.samples[:, [0, 2]], 0.9 * target.acceleration[:, :2])
    leg = load_any_motion(path, channels={"y": "actuator_displacement[H1]"})
    np.testing.assert_array_equal(leg.samples[:, 1], target.displacement[:, 0])
    with pytest.raises(MotionError, match=rf"record\.{form}: no column 'platen_jerk' for axis x; columns are"):
        load_any_motion(path, channels="x=platen_jerk")
    with pytest.raises(MotionError, match=rf"record\.{form}: this kind of file says its units itself; leave --unit"):
        load_any_motion(path, units="g")


def test_a_record_without_motion_is_refused(tmp_path, record):
    path = saved(record[["actuator_displacement"]], tmp_path, "nc")
    with pytest.raises(MotionError, match=r"a record with none of reference_displacement, .* --channels x="):
        load_any_motion(path)


# --------------------------------------------------------------------------------------------- MATLAB
def test_a_mat_file_with_columns_named_after_axes_needs_no_more(tmp_path):
    savemat(tmp_path / "m.mat", {"t": TIME, "ax_g": WAVE, "acc_z_m_s2": 2 * WAVE})
    motion = load_any_motion(tmp_path / "m.mat")
    assert motion.time_step == pytest.approx(0.005, rel=1e-12) and "MATLAB file m.mat" in motion.source
    np.testing.assert_allclose(motion.samples[:, [0, 2]], np.outer(WAVE, [GRAVITY, 2]), rtol=1e-12)


def test_a_unit_that_contradicts_that_of_a_data_file_is_refused(tmp_path):
    savemat(tmp_path / "m.mat", {"t": TIME, "ax_g": WAVE})
    with pytest.raises(MotionError, match=r"m\.mat, 'ax_g': states the unit g, and --unit is m/s2; leave --unit out"):
        load_any_motion(tmp_path / "m.mat", units="m/s2")
    np.testing.assert_array_equal(
        load_any_motion(tmp_path / "m.mat", units="g").samples, load_any_motion(tmp_path / "m.mat").samples
    )


@pytest.mark.parametrize("version", ["4", "5"])
def test_one_series_of_a_mat_file_takes_step_and_unit_from_options(tmp_path, version):
    path = tmp_path / "one.mat"
    savemat(path, {"ag": WAVE}, format=version)
    motion = load_any_motion(path, time_step=0.005, units="g")
    np.testing.assert_allclose(motion.samples[:, 0], GRAVITY * WAVE, rtol=1e-12)
    assert load_any_motion(path, time_step=0.005, units="g", channels="y=ag").axes == ("y",)
    with pytest.raises(MotionError, match=r"one\.mat, 'ag': no unit in the file; give it, as --unit g"):
        load_any_motion(path, time_step=0.005)
    with pytest.raises(MotionError, match=r"one\.mat, 'ag': no time in the file; give the step .* --dt 0\.01"):
        load_any_motion(path, units="g")


def test_columns_of_a_table_in_a_mat_file_are_chosen_by_number(tmp_path):
    savemat(tmp_path / "t.mat", {"dt": 0.005, "acc": np.outer(WAVE, [1, 2, 3])})
    motion = load_any_motion(tmp_path / "t.mat", units="g", channels="x=3,y=acc_1")
    assert motion.time_step == 0.005
    np.testing.assert_allclose(motion.samples[:, :2], GRAVITY * np.outer(WAVE, [3, 1]), rtol=1e-12)
    with pytest.raises(MotionError, match=r"3 columns of which not each names an axis .* from 'acc_1', 'acc_2'"):
        load_any_motion(tmp_path / "t.mat", units="g")


def test_mat_files_may_be_one_for_each_component_and_stand_for_a_named_record(tmp_path):
    paths = [tmp_path / f"{name}.mat" for name in ("e", "n", "rec_up")]
    for k, path in enumerate(paths, 1):
        savemat(path, {"dt": 0.01, "a_g": k * WAVE})
    motion = motion_of("tabas", paths)
    assert motion.name == "tabas" and motion.time_step == 0.01
    np.testing.assert_allclose(motion.samples[:, :3], GRAVITY * np.outer(WAVE, [1, 2, 3]), rtol=1e-12)
    assert motion_of(None, paths[:1]).axes == ("x",)
    assert motion_of("sine", amplitude=0.02).name == "sine"


def test_a_damaged_file_of_arrays_is_named(tmp_path):
    path = tmp_path / "m.mat"
    savemat(path, {"t": TIME, "ax_g": WAVE})
    path.write_bytes(path.read_bytes()[:900])
    with pytest.raises(RecordError, match=r"m\.mat: not a MATLAB file, or damaged"):
        load_any_motion(path)


# --------------------------------------------------------------------------------------------- commands
def test_a_plan_takes_records_and_adjusts_motions(tmp_path, record):
    saved(record, tmp_path, "nc")
    (tmp_path / "design.csv").write_text("period_s,sa_g\n0.1,0.5\n0.5,1.0\n1.0,0.5\n")
    motions = [
        {"files": ["record.nc"], "label": "again", "time_scale": 0.5},
        {"name": "ridgecrest", "rotate_by": 30, "match_spectrum": "design.csv"},
    ]
    plan = plan_from({"motion": motions}, tmp_path, "a plan")
    again = plan.motions["again"].motion
    assert again.quantity == "displacement" and again.time_scale == 0.5
    assert "matched to design.csv" in plan.motions["ridgecrest"].motion.source


@pytest.mark.long
def test_a_run_is_run_again_from_its_record_and_never_over_it(lhpost6, tmp_path):
    assert lhpost6("run", *COARSE, "--out", "first").code == 0
    fast = ("--engine", "fused", "--rate", "2048", "--record-rate", "512")
    assert refused(lhpost6("run", "first/record.nc", *fast, "--out", "first"), "first/record.nc would be replaced")
    assert lhpost6("run", "first/record.nc", *fast).code == 0
    first, again = (load_record(tmp_path / name / "record.nc") for name in ("first", "out/record"))
    peaks = [np.abs(one["reference_displacement"].values).max() for one in (first, again)]
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-3)
    assert again.attrs["time_scale"] == 1.0 and again.attrs["motion"] == "record"


def test_a_drive_is_no_motion_and_says_what_runs_it(tmp_path, target):
    path = save_drive(target.acceleration, "acceleration", target, tmp_path / "drive.nc", {})
    with pytest.raises(MotionError, match=r"this is a drive, which `lhpost6 replay .*drive\.nc` runs"):
        load_any_motion(path)

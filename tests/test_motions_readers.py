"""Ground-motion files: what is in them comes out in SI, and no content gives an error that is not ours."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motions_files import at2_text, cosmos_text, csmip_text

from lhpost6_pin.core.errors import MotionError
from lhpost6_pin.motions import AXES, GroundMotion, load_csv, load_motion
from lhpost6_pin.motions.motion_units import to_si
from lhpost6_pin.motions.time_steps import uniform_step

GRAVITY = 9.80665
WAVE = 0.3 * np.sin(np.arange(203) / 7)
CSV = "# a comment\ntime_s,ax_g,z [mm/s^2],roll_deg_s2\n0.00,0.1,1000,180\n0.01,0.2,2000,0\n0.02,-0.1,0,-180\n"
PRINTED = 1e-6  # [g] digits of the formats: 8 significant (AT2), 6 decimals (V1)


def written(folder: Path, name: str, text: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("old", [False, True])
def test_a_peer_file_is_read_in_both_of_its_header_forms(tmp_path, old):
    motion = load_motion(written(tmp_path, "A.AT2", at2_text(WAVE, 0.005, old=old)))
    assert motion.time_step == 0.005 and motion.quantity == "acceleration" and motion.axes == ("x",)
    np.testing.assert_allclose(motion.samples[:, 0], WAVE * GRAVITY, atol=PRINTED * GRAVITY)


def test_three_peer_files_go_to_x_y_z_and_are_cut_to_the_shortest(tmp_path):
    texts = [at2_text((i + 1) * WAVE[: 200 - i], component=c) for i, c in enumerate(("090", "360", "UP"))]
    paths = [written(tmp_path, f"{i}.AT2", text) for i, text in enumerate(texts)]
    motion = load_motion(paths)
    assert motion.samples.shape == (198, 6)
    for i in range(3):
        np.testing.assert_allclose(motion.samples[:, i], (i + 1) * WAVE[:198] * GRAVITY, atol=PRINTED * GRAVITY)
    assert load_motion({"y": paths[0], "z": paths[2]}).axes == ("y", "z")
    with pytest.raises(MotionError, match="time steps differ"):
        load_motion([paths[0], written(tmp_path, "slow.AT2", at2_text(WAVE, 0.01))])


def test_csmip_orientations_become_axes_with_their_sign(tmp_path):
    text = csmip_text([("270 Deg", WAVE - 1.5), (" 360 Deg", 2 * WAVE), ("Up", 3 * WAVE)])
    motion = load_motion(written(tmp_path, "station.RAW", text))
    assert motion.time_step == 0.01
    np.testing.assert_allclose(
        motion.samples[:, :3] / GRAVITY, np.stack([1.5 - WAVE, 2 * WAVE, 3 * WAVE], axis=1), atol=PRINTED
    )


def test_cosmos_headers_give_azimuth_and_interval(tmp_path):
    path = written(tmp_path, "station.v1", cosmos_text([(90, 10 * WAVE), (0, 20 * WAVE), (401, 30 * WAVE)]))
    motion = load_motion(path)
    assert motion.time_step == pytest.approx(0.005, rel=1e-12)
    # five decimals of cm/s^2
    np.testing.assert_allclose(motion.samples[:, :3], np.outer(WAVE, [0.1, 0.2, -0.3]), atol=1e-7)


def test_a_station_at_another_angle_needs_and_takes_a_channel_mapping(tmp_path):
    path = written(tmp_path, "station.v1", csmip_text([("35 Deg", WAVE), ("125 Deg", WAVE), ("Up", WAVE)]))
    with pytest.raises(MotionError, match=r"channel 1: orientation 35 deg is not along an axis.*--channels x=1"):
        load_motion(path)
    assert load_motion(path, channels={"x": 2, "z": 3}).axes == ("x", "z")
    with pytest.raises(MotionError, match="no channel 7 for axis x; channels are 1, 2, 3"):
        load_motion(path, channels={"x": 7})


def test_csv_columns_carry_axis_and_unit_in_their_names(tmp_path):
    motion = load_motion(written(tmp_path, "m.csv", CSV))
    assert motion.time_step == pytest.approx(0.01, rel=1e-12) and motion.quantity == "acceleration"
    np.testing.assert_allclose(motion.samples[:, 0], [0.1 * GRAVITY, 0.2 * GRAVITY, -0.1 * GRAVITY], rtol=1e-12)
    np.testing.assert_allclose(motion.samples[:, 2], [1, 2, 0], rtol=1e-12)
    np.testing.assert_allclose(motion.samples[:, 3], [np.pi, 0, -np.pi], rtol=1e-12)
    assert not motion.samples[:, [1, 4, 5]].any()


def test_csv_columns_and_units_can_be_given(tmp_path):
    path = written(tmp_path, "m.csv", "n;east;extra\n1;10;5\n2;20;5\n")
    motion = load_csv(path, channels={"y": "east"}, units="cm", time_step=0.5)
    assert motion.quantity == "displacement" and motion.axes == ("y",) and motion.time_step == 0.5
    np.testing.assert_allclose(motion.samples[:, 1], [0.1, 0.2], rtol=1e-12)
    motion = load_csv(written(tmp_path, "m.csv", "time [ms],z_m\n0,0\n5,1\n10,2\n"))
    assert motion.time_step == pytest.approx(0.005, rel=1e-12)


V1 = csmip_text([("90 Deg", WAVE), ("360 Deg", WAVE), ("Up", WAVE)])
SOUND = {"AT2": at2_text(WAVE), "v1": V1, "csv": CSV}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("NPTS=  203", "NPTS=  204"), "204 points, the file has 203"),
        (("UNITS OF G", "UNITS OF CM"), "CM is not an acceleration"),
        (("ACCELERATION", "VELOCITY"), r"use the \.AT2 file"),
        (("NPTS=", "POINTS="), "NPTS"),
        (("DT=   0.0050", "DT=   0.0000"), "time step"),
        (("  0.0000000E+00", "  0.00x0000E+00"), "line 5.*0.00x0000E.00"),
        (("  0.0000000E+00", "  nan            "), "channel x, sample 0"),
        (("units of g", "units of counts"), "line 6.*counts"),
        (("at 100 pts/sec", "at 0 pts/sec"), "line 6.*no sampling rate"),
        ((" 203 Acc", " 999 Acc"), "channel 1, line 6: announces 999 points"),
        (("Chan  2: 360", "Chan  2: 90"), "channel 2: a second channel for axis x"),
        ((" 0.000000", " 0.00?000"), "channel 1, line 7"),
        (("0.2,", "nan,"), "line 4, column 'ax_g': value is nan"),
        (("0.2,", ","), "line 4, column 'ax_g': '' is not a number; fill the gap"),
        (("0.2,2000", "0.2"), "line 4: 3 fields, the header has 4"),
        (("0.02,", "0.05,"), "before sample 1"),
        (("0.02,", "-9,"), "must increase"),
        (("ax_g", "ax_kg"), "column 'ax_kg': unit 'kg' does not fit axis x"),
        (("ax_g", "ax_m"), "mixed"),
        (("ax_g", "ax"), "has no unit"),
        (("ax_g", "q_g"), "'q_g' names no axis"),
        (("roll_deg_s2", "roll_m_s2"), "does not fit axis roll"),
        (("z [mm/s^2]", "x_g"), "two columns for axis x"),
        (("time_s", "y_g"), "no time column"),
        (("0.01,0.2,2000,0\n0.02,-0.1,0,-180\n", ""), "at least 2"),
        (("0.2,", "1e308,"), "channel x, sample 1"),
    ],
)
def test_a_damaged_file_is_refused_with_the_place_and_a_remedy(tmp_path, change, message):
    suffix = [suffix for suffix, text in SOUND.items() if change[0] in text][-1]
    with pytest.raises(MotionError, match=message) as caught:
        load_motion(written(tmp_path, f"bad.{suffix}", SOUND[suffix].replace(*change)))
    assert "bad" in str(caught.value)


@given(
    st.lists(st.tuples(*[st.decimals(-9, 9, places=3)] * 2), min_size=2, max_size=5),
    st.sampled_from([";", "\t", ",", ", "]),
    st.sampled_from(["", '"']),
)
def test_decimal_commas_are_named_as_such_and_points_are_read(tmp_path_factory, rows, separator, quote):
    folder = tmp_path_factory.mktemp("csv")
    times = [f"{0.01 * k:.2f}" for k in range(len(rows))]
    lines = [[t, *(f"{x:f}" for x in row)] for t, row in zip(times, rows, strict=True)]
    head = separator.join(["time_s", "x_m", "y_m"])
    points = [separator.join(line) for line in lines]
    commas = [separator.join(f"{quote}{x.replace('.', ',')}{quote}" for x in line) for line in lines]
    found = load_motion(written(folder, "points.csv", "\n".join([head, *points])))
    np.testing.assert_array_equal(found.samples[:, :2], np.array(rows, float))
    with pytest.raises(MotionError, match=r"commas.csv, line 2.*; decimal commas are not read: write points"):
        load_motion(written(folder, "commas.csv", "\n".join([head, *commas])))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,00;0,1\n0,01;0,2\n", "line 1: no header row"),
        ("0.0,0.0\n0.01,0.1\n", "line 1: no header row"),
        ("t,x_m\n0,1\n1,2,3\n2,3\n", "line 3: 3 fields, the header has 2; correct it"),
    ],
)
def test_numbers_alone_have_no_header_and_a_field_too_many_is_no_decimal_comma(tmp_path, text, message):
    with pytest.raises(MotionError, match=message):
        load_motion(written(tmp_path, "a.csv", text))


@pytest.mark.parametrize("head", ["X Accel [g]", "x acceleration (g)", "x_acc_g", "East Acc g", "Acc X (g)"])
def test_the_word_of_a_quantity_before_its_unit_is_no_part_of_the_unit(tmp_path, head):
    motion = load_motion(written(tmp_path, "m.csv", f"time_s,{head}\n0,0\n0.01,0.5\n0.02,0\n"))
    assert motion.samples[1, 0] == pytest.approx(0.5 * 9.80665) and motion.quantity == "acceleration"
    with pytest.raises(MotionError, match="has no unit"):
        load_motion(written(tmp_path, "n.csv", "time_s,X Accel\n0,0\n0.01,0.5\n"))


@pytest.mark.parametrize("mark", ["\t", ",", ";"])
def test_names_with_blanks_are_separated_by_their_mark(tmp_path, mark):
    rows = [("Time (s)", "Acc X (g)", "Acc Y (g)"), (0, 0, 0), (0.01, 0.5, 0.25), (0.02, 0, 0)]
    motion = load_motion(written(tmp_path, "m.txt", "".join(mark.join(map(str, row)) + "\n" for row in rows)))
    assert motion.samples[1, :2] == pytest.approx([0.5 * 9.80665, 0.25 * 9.80665])


def test_a_gap_in_time_is_named_where_it_is(tmp_path):
    """A gap moves the mean step, by which every step of the file would be wrong; it does not move the median."""
    time = [0.01 * k for k in range(300)] + [3.5 + 0.01 * k for k in range(700)]
    text = "time_s,ax_g\n" + "".join(f"{t:.2f},0.1\n" for t in time)
    with pytest.raises(MotionError, match=r"before sample 300 \(t = 3.5 s\) is 0.51 s, the median is 0.01 s"):
        load_motion(written(tmp_path, "gap.csv", text))


def test_an_option_of_another_reader_and_a_column_that_is_not_there_are_refused(tmp_path):
    with pytest.raises(MotionError, match=r"A\.AT2: this kind of file says its units itself; leave --unit out"):
        load_motion(written(tmp_path, "A.AT2", at2_text(WAVE)), units="g")
    with pytest.raises(MotionError, match=r"no column 'up_g' for axis z; columns are time_s, ax_g"):
        load_motion(written(tmp_path, "m.csv", CSV), channels={"z": "up_g"})


def test_a_missing_or_binary_file_is_a_motion_error(tmp_path):
    for path in (tmp_path / "none.csv", tmp_path, written(tmp_path, "b.csv", b"time\0x")):
        with pytest.raises(MotionError):
            load_motion(path)


@pytest.mark.parametrize(
    ("unit", "axis", "factor", "quantity"),
    [
        ("g", "z", 9.80665, "acceleration"),
        ("gal", "x", 0.01, "acceleration"),
        ("cm/sec2", "y", 0.01, "acceleration"),
        ("mm", "x", 0.001, "displacement"),
        ("in", "x", 0.0254, "displacement"),
        ("deg", "yaw", np.pi / 180, "displacement"),
        ("mrad/s^2", "roll", 0.001, "acceleration"),
        *(
            (unit, "x", 1.0, "acceleration")
            for unit in ("m_s2", "m/s2", "m/s^2", "m/s**2", "m/s/s", "M/SEC2", "m/sec/sec")
        ),
    ],
)
def test_units_have_their_size(unit, axis, factor, quantity):
    found, kind = to_si(np.ones(1), unit, axis)
    assert found[0] == pytest.approx(factor, rel=1e-12) and kind == quantity


def test_samples_of_a_wrong_shape_are_no_motion_and_those_of_one_cannot_be_changed():
    for shape in ((5,), (5, 3), (1, 6)):
        with pytest.raises(MotionError):
            GroundMotion("m", 0.01, np.zeros(shape), "acceleration", "test")
    given_samples = np.zeros((4, 6))
    motion = GroundMotion("m", 0.01, given_samples, "displacement", "test")
    given_samples[0] = 1
    assert not motion.samples.any()
    with pytest.raises(ValueError, match="read-only"):
        motion.samples[0] = 1


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=20), st.sampled_from(AXES))
def test_any_text_is_a_unit_or_a_motion_error(text, axis):
    try:
        factor, quantity = to_si(np.ones(1), text, axis)
    except MotionError:
        return
    assert factor[0] > 0 and quantity in ("acceleration", "displacement")


@pytest.mark.parametrize(
    ("head", "stated", "channels"),
    [("x_g", "m/s2", None), ("X Accel [g]", "m/s2", None), ("x_mm", "m", None), ("Accel_g", "gal", "x=2")],
)
def test_a_unit_stated_that_contradicts_the_header_is_refused_with_both_and_an_equal_one_passes(
    tmp_path, head, stated, channels
):
    """Read as m/s2, a motion in g is 9.81 times too small, and nothing else shows it."""
    own = "mm" if "mm" in head else "g"
    path = written(tmp_path, "m.csv", f"time_s,{head}\n0,0\n0.01,0.5\n0.02,0\n")
    with pytest.raises(
        MotionError, match=rf"m\.csv, column '.*': states the unit {own}, and --unit is {stated}; leave"
    ):
        load_motion(path, units=stated, channels=channels)
    with pytest.raises(MotionError, match=f"states the unit {own}, and --unit is {stated}"):
        load_motion(path, units={"x": stated}, channels=channels)
    alone, same = (load_motion(path, units=units, channels=channels) for units in (None, own))
    np.testing.assert_array_equal(alone.samples, same.samples)
    assert alone.samples[1, 0] == pytest.approx(0.5 * (1e-3 if own == "mm" else GRAVITY))


def test_an_equal_unit_in_another_spelling_passes_and_words_that_are_no_unit_give_way(tmp_path):
    text = "time_s,{}\n0,0\n0.01,0.5\n0.02,0\n"
    gal = load_motion(written(tmp_path, "gal.csv", text.format("x_cm_s2")), units="gal")
    assert gal.samples[1, 0] == pytest.approx(0.005)
    for head in ("x_filtered", "x (raw)", "x"):
        motion = load_motion(written(tmp_path, "words.csv", text.format(head)), units="g")
        assert motion.samples[1, 0] == pytest.approx(0.5 * GRAVITY)
    with pytest.raises(MotionError, match="'xyzzy' does not fit axis x"):
        load_motion(written(tmp_path, "g.csv", text.format("x_g")), units="xyzzy")


@pytest.mark.parametrize(("rate", "form"), [(1024.0, "{:.6g}"), (256.0, "{:.4f}"), (1024.0, "{:.5f}")])
def test_times_that_are_rounded_stand_for_uniform_ones(rate, form):
    time = np.arange(12000) / rate
    rounded = np.array([float(form.format(t)) for t in time])
    assert uniform_step(rounded, "run.csv") == pytest.approx(1.0 / rate, rel=1e-6)  # a line through 12000 stamps
    late = float(form.format(time[5000] + 0.3 / rate))
    for broken in (np.delete(rounded, 5000), np.where(np.arange(12000) == 5000, late, rounded)):
        with pytest.raises(MotionError, match=r"time step before sample 500[01]"):
            uniform_step(broken, "run.csv")

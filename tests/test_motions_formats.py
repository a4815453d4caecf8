"""Ground-motion files as agencies and labs have them: true layouts, closed-form waves, every component on its axis."""

from pathlib import Path

import numpy as np
import pytest
from motions_files import at2_text, cosmos_text, csmip_text, film_text, knet_text, old_at2_text, v2_text

from lhpost6_pin.core.errors import MotionError
from lhpost6_pin.motions import load_motion
from lhpost6_pin.motions.components import direction_of

GRAVITY = 9.80665
WAVE = 0.3 * np.sin(np.arange(203) / 7)
EIGHT_DIGITS = 1e-7 * GRAVITY  # of values below 1 g


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_bytes(text.encode())
    return path


# --------------------------------------------------------------------------------------------- PEER
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r\r\n", "\n\n", "\n \n"])
def test_an_old_peer_file_is_read_whatever_its_line_ends(tmp_path, end):
    motion = load_motion(written(tmp_path, "I-ELC180.AT2", old_at2_text(WAVE, end=end)))
    assert (motion.time_step, motion.quantity, motion.axes) == (0.01, "acceleration", ("x",))
    np.testing.assert_allclose(motion.samples[:, 0], WAVE * GRAVITY, atol=EIGHT_DIGITS)


@pytest.mark.parametrize(
    ("name", "component", "sign"),
    [("a", "UP", 1), ("a", "DWN", -1), ("a", "V", 1), ("a", "VERTICAL", 1), ("I-ELC-UP", "NO COMPONENT SAID", 1)],
)
def test_a_vertical_peer_component_goes_to_z_wherever_it_stands(tmp_path, name, component, sign):
    up = written(tmp_path, f"{name}.AT2", old_at2_text(WAVE, component=component))
    east, north = (
        written(tmp_path, f"{c}.AT2", old_at2_text(k * WAVE, component=c)) for k, c in ((2, "090"), (3, "000"))
    )
    assert load_motion(up).axes == ("z",)
    for paths in ([up, east, north], [east, up, north], [east, north, up]):
        found = load_motion(paths).samples[:, :3] / GRAVITY
        np.testing.assert_allclose(found, np.outer(WAVE, [2, 3, sign]), atol=EIGHT_DIGITS)
    with pytest.raises(MotionError, match=rf"{name}\.AT2: is vertical, not for axis x; .* --axes x=z"):
        load_motion({"x": up, "y": north})
    with pytest.raises(MotionError, match=r"000\.AT2: is horizontal \(0 deg\), not for axis z"):
        load_motion({"z": north})
    with pytest.raises(MotionError, match=r"a third horizontal component"):
        load_motion([east, north, east])


# --------------------------------------------------------------------------------------------- CSMIP, COSMOS
def test_digitised_film_of_the_nineties_comes_out_in_g_at_a_uniform_step(tmp_path):
    """Steps of 3 to 7 ms, 5 on average, printed to 1 ms; G/10."""
    steps = np.random.default_rng(1).integers(3, 8, 600) / 1000
    times = np.round(np.concatenate([[0], np.cumsum(steps)]), 3)
    waves = [0.2 * np.sin(2 * np.pi * times), 0.1 * np.cos(5 * times), 0.05 * np.sin(3 * times)]
    parts = [(name, times, wave) for name, wave in zip(("90 DEG", "UP", "360 DEG"), waves, strict=True)]
    motion = load_motion(written(tmp_path, "STATION.RAW", film_text(parts)))
    assert motion.time_step == pytest.approx(times[-1] / 600, rel=1e-12) and len(motion.samples) == 601
    t = motion.time
    expected = np.stack([0.2 * np.sin(2 * np.pi * t), 0.05 * np.sin(3 * t), 0.1 * np.cos(5 * t)], axis=1)
    # half the last digit, 5e-5 g, and linear interpolation over 7 ms: 0.2 g (2 pi 7e-3)^2 / 8 = 5e-5 g
    np.testing.assert_allclose(motion.samples[:, :3] / GRAVITY, expected, atol=1e-4)


@pytest.mark.parametrize("old", [False, True], ids=["2014", "1983"])
def test_corrected_files_give_their_acceleration_and_not_what_follows(tmp_path, old):
    parts = [(name, k * 100 * WAVE) for k, name in ((1, "360 Deg"), (2, "Up"), (3, "90 Deg"))]
    motion = load_motion(written(tmp_path, "CE00000.V2", v2_text(parts, old=old)))
    assert motion.time_step == 0.02 and len(motion.samples) == len(WAVE)
    digits = 5e-4 if old else 5e-7  # half the last printed digit [cm/s^2]
    np.testing.assert_allclose(motion.samples[:, :3] * 100, np.outer(100 * WAVE, [3, 1, 2]), atol=digits)
    assert "V2 file CE00000.V2" in motion.source


@pytest.mark.parametrize("end", ["\r\r\n", "\n\n"])
def test_doubled_line_ends_do_not_shift_fixed_columns(tmp_path, end):
    text = csmip_text([("90 Deg", WAVE - 1.5)]).replace("\r\n", end)
    found = load_motion(written(tmp_path, "station.v1", text)).samples[:, 0]
    np.testing.assert_allclose(found / GRAVITY, WAVE - 1.5, atol=1e-6)  # six decimals


def test_a_vertical_seed_channel_with_azimuth_zero_is_vertical(tmp_path):
    """As agencies convert SEED to COSMOS: azimuth 0, and the channel's code in a comment alone."""
    comment = "|<SCNL>BMR.BNZ.AK.--    <AUTH> 2019/02/01 21:38:15.000"
    motion = load_motion(written(tmp_path, "AKBMR.BNZ.V2c", cosmos_text([(0, 10 * WAVE)], comment=comment)))
    assert motion.axes == ("z",)
    north = load_motion(written(tmp_path, "n.V2c", cosmos_text([(0, 10 * WAVE)], comment=comment.replace("Z", "N"))))
    assert north.axes == ("y",)


# --------------------------------------------------------------------------------------------- K-NET
@pytest.mark.parametrize("names", [("E-W", "N-S", "U-D"), ("2", "1", "3"), ("5", "4", "6")])
def test_knet_components_go_where_they_point_in_any_order(tmp_path, names):
    counts = np.round(1e6 * WAVE[:200])
    paths = [
        written(tmp_path, f"AAA.{k}", knet_text(k * counts, name, scale="2000(gal)/8388608"))
        for k, name in enumerate(names, 1)
    ]
    motion = load_motion(paths[::-1])
    assert motion.time_step == 0.01 and "K-NET files" in motion.source
    expected = np.outer(counts, [1, 2, 3]) * 2000 / 8388608 / 100
    np.testing.assert_allclose(motion.samples[:, :3], expected, rtol=1e-12)


# --------------------------------------------------------------------------------------------- odd angles
def station(first: float, second: float) -> tuple[str, np.ndarray, np.ndarray]:
    """A V1 file of a station with two horizontal channels at these azimuths, and true east and north [g]."""
    east, north = WAVE, 0.1 * np.cos(np.arange(203) / 11)
    along = [east * np.sin(np.radians(a)) + north * np.cos(np.radians(a)) for a in (first, second)]
    channels = [(f"{first:g} Deg", along[0]), ("Up", 0.5 * WAVE), (f"{second:g} Deg", along[1])]
    return csmip_text(channels), east, north


@pytest.mark.parametrize(("first", "second"), [(35, 125), (125, 35), (215, 305), (20, 80), (0, 90)])
def test_rotating_a_station_to_ninety_gives_east_and_north(tmp_path, first, second):
    text, east, north = station(first, second)
    found = load_motion(written(tmp_path, "s.v1", text), rotate=90).samples[:, :3] / GRAVITY
    # six decimals, doubled where the channels stand at 60 degrees
    np.testing.assert_allclose(found, np.stack([east, north, 0.5 * WAVE], axis=1), atol=2e-6)


def test_rotating_to_a_channel_s_own_azimuth_gives_that_channel(tmp_path):
    path = written(tmp_path, "s.v1", station(35, 125)[0])
    turned, chosen = load_motion(path, rotate=125), load_motion(path, channels="x=3,y=1,z=2")
    np.testing.assert_allclose(turned.samples, chosen.samples, atol=1e-12)
    assert "x turned to azimuth 125 deg" in turned.source
    with pytest.raises(MotionError, match=r"orientation 35 deg is not along an axis.*--rotate AZIMUTH"):
        load_motion(path)
    with pytest.raises(MotionError, match=r"channel 2: is vertical, not for axis y"):
        load_motion(path, channels="x=1,y=2")
    with pytest.raises(MotionError, match="here are 1; choose with --channels"):
        load_motion(path, channels="x=1,z=2", rotate=90)
    with pytest.raises(MotionError, match="parallel"):
        load_motion(written(tmp_path, "p.v1", station(35, 216)[0]), rotate=90)


def test_a_table_of_axes_is_turned_from_east_and_north_with_its_vertical_left_alone(tmp_path):
    path = written(tmp_path, "m.csv", "time_s,x_m,y_m,z_m\n0,1,0,5\n1,0,2,6\n")
    found = load_motion(path, rotate=0)  # x is north, y is west
    np.testing.assert_allclose(found.samples[:, :3], [[0, -1, 5], [2, 0, 6]], atol=1e-15)
    with pytest.raises(MotionError, match="does not turn roll and pitch"):
        load_motion(written(tmp_path, "r.csv", "time_s,x_m,y_m,roll_rad\n0,1,0,5\n1,0,2,6\n"), rotate=0)


@pytest.mark.parametrize(
    ("text", "direction"),
    [
        *(("90 Deg", 90.0), ("360", 0.0), (" S00E", 180.0), ("N21E", 21.0), ("S69E", 111.0), ("N45W", 315.0)),
        *(("UP", "up"), ("U-D", "up"), ("HNZ", "up"), ("Down", "down"), ("401", "down"), ("BNE", 90.0)),
        *(("H1", None), ("TRANSVERSE", None), ("", None), ("361", None)),
    ],
)
def test_words_of_directions(text, direction):
    assert direction_of(text) == direction


# --------------------------------------------------------------------------------------------- plain columns
def rows(*columns: np.ndarray, per_line: int = 0, separator: str = " ") -> str:
    table = np.column_stack(columns).ravel()
    width = per_line or len(columns)
    return "".join(separator.join(f"{x:.6f}" for x in table[k : k + width]) + "\n" for k in range(0, len(table), width))


@pytest.mark.parametrize("head", ["", "El Centro\nacceleration, in g, from somewhere\n", "# 0.02 s\n\n"])
def test_one_column_needs_step_and_unit(tmp_path, head):
    path = written(tmp_path, "elcentro.txt", head + rows(WAVE))
    motion = load_motion(path, time_step=0.02, units="g")
    assert (motion.time_step, motion.axes) == (0.02, ("x",))
    np.testing.assert_allclose(motion.samples[:, 0] / GRAVITY, WAVE, atol=5e-7)  # six decimals
    assert load_motion(path, time_step=0.02, units="g", channels="y=1").axes == ("y",)
    with pytest.raises(MotionError, match=r"no time among the columns; .* --dt 0\.01"):
        load_motion(path, units="g")
    with pytest.raises(MotionError, match=r"known are PEER" if "El" in head else r"--unit g"):
        load_motion(path, time_step=0.02)


@pytest.mark.parametrize("separator", [" ", ",", ";", "\t"])
def test_many_columns_are_chosen_by_number_and_the_first_may_be_time(tmp_path, separator):
    time = np.arange(203) * 0.005
    path = written(tmp_path, "run.dat", rows(time, WAVE, 2 * WAVE, 3 * WAVE, separator=separator))
    motion = load_motion(path, units="m/s2", channels="x=3,z=2")
    assert motion.time_step == pytest.approx(0.005, rel=1e-12)
    np.testing.assert_allclose(motion.samples[:, :3], np.outer(WAVE, [2, 0, 1]), atol=5e-7)
    with pytest.raises(MotionError, match="3 columns without names; choose them, as in --channels x=2,y=3"):
        load_motion(path, units="m/s2")
    with pytest.raises(MotionError, match=r"steps of 0\.005 s, not 0\.01 s; leave --dt out"):
        load_motion(path, units="g", time_step=0.01, channels="x=2")
    with pytest.raises(MotionError, match="no column '1' of values for axis x; 2 to 4 are"):
        load_motion(path, units="g", channels="x=1")


def test_a_series_along_the_rows_is_one_component(tmp_path):
    ragged = written(tmp_path, "nisee.txt", rows(WAVE, per_line=8))  # 203 = 25 * 8 + 3
    even = written(tmp_path, "even.txt", rows(WAVE[:200], per_line=8))
    for path, channels in ((ragged, None), (ragged, "x=all"), (even, "x=all")):
        motion = load_motion(path, time_step=0.02, units="g", channels=channels)
        np.testing.assert_allclose(motion.samples[:, 0] / GRAVITY, WAVE[: len(motion.samples)], atol=5e-7)
    with pytest.raises(MotionError, match=r"8 columns without names; .* --channels x=all for one series"):
        load_motion(even, time_step=0.02, units="g")


def test_files_of_one_column_each_go_to_x_and_y_and_a_vertical_by_its_name(tmp_path):
    names = ("elc_ver.txt", "elc_ns.txt", "elc_ew.txt")
    paths = [written(tmp_path, name, rows(k * WAVE)) for k, name in enumerate(names, 1)]
    found = load_motion(paths, time_step=0.02, units="g").samples[:, :3] / GRAVITY
    np.testing.assert_allclose(found, np.outer(WAVE, [2, 3, 1]), atol=2e-6)
    with pytest.raises(MotionError, match="no azimuth in the file, so it cannot be turned"):
        load_motion(paths, time_step=0.02, units="g", rotate=90)


def test_a_csv_may_be_separated_by_blanks_and_chosen_by_number(tmp_path):
    path = written(tmp_path, "a.txt", "time a_long a_tran\n0 1 2\n0.1 3 4\n")
    motion = load_motion(path, units="g", channels="y=2,x=a_tran")
    np.testing.assert_allclose(motion.samples[:, :2] / GRAVITY, [[2, 1], [4, 3]], rtol=1e-12)


# --------------------------------------------------------------------------------------------- refused
@pytest.mark.parametrize(
    "text",
    [
        "2 CORRECTED ACCELEROGRAM\n*\nUSGS National Strong-Motion Program\n     1994      17\n 0.1 0.2\n",  # SMC
        "<html><body>please log in, first</body></html>\n",
        '{"time": [0, 1], "x": [0, 1]}\n',
        "Accelerograms, columns time_s, x, y in m/s2\nand cut, from others\n",
    ],
)
@pytest.mark.parametrize("name", ["a.smc", "a", "a.txt"])
def test_an_unknown_format_is_called_so_and_the_known_ones_are_listed(tmp_path, name, text):
    with pytest.raises(MotionError) as caught:
        load_motion(written(tmp_path, name, text))
    said = str(caught.value)
    assert f"{name}: unknown format; known are PEER .AT2" in said and "fill the gap" not in said
    for form in ("V1", "V2", "K-NET", "CSV", "--dt and --unit"):
        assert form in said


COUNTS = np.round(1e6 * WAVE[:200])
FILM = film_text([("90 DEG", np.arange(203) * 0.005, WAVE)])


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.EW", knet_text(COUNTS)[:-80], r"announces 200 samples, the file has 19\d"),
        ("a.EW", knet_text(COUNTS).replace("E-W", "H-1"), r"\(Dir\.\) is 'H-1'; N-S, E-W, U-D and 1 to 6"),
        ("a.EW", knet_text(COUNTS, scale="none/none"), "lacks 'Scale Factor"),
        ("a.EW", knet_text(COUNTS, scale="1(gal)/0"), "lacks 'Scale Factor"),
        ("a.EW", knet_text(COUNTS).replace("Memo.", "Nota."), "no line 'Memo.'"),
        ("a.EW", knet_text(COUNTS, rate=100).replace("  299999", "  2x9999"), "line 1?[0-9]+: '2x9999'"),
        ("a.RAW", FILM.replace("=    203", "=    204"), "channel 1, line 12: announces 408 points, 406 follow"),
        ("a.RAW", FILM.replace("   .010", "   .004", 1), "channel 1, sample 2: time does not increase"),
        ("a.V2", v2_text([("H1", WAVE)]), "channel 1: orientation unknown is not along an axis"),
        ("a.V2", "nothing\n", "no line announces acceleration data"),
        ("a.txt", "1 2\n3 x\n", "a.txt, line 2, column '2': 'x' is not a number"),
        ("a.txt", "1 2 3\n3 4\n4 5 6\n", "line 2: 2 fields, the header has 3"),
    ],
)
def test_a_damaged_file_names_the_place_and_a_remedy(tmp_path, name, text, message):
    stated = {"time_step": 0.01, "units": "g", "channels": "x=1"} if name.endswith("txt") else {}
    with pytest.raises(MotionError, match=message):
        load_motion(written(tmp_path, name, text), **stated)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"time_step": 0.01}, "says its time step itself; leave --dt out"),
        ({"rotate": float("nan")}, "--rotate nan: give the azimuth"),
        ({"channels": "x"}, "--channels x: write axis=channel"),
        ({"channels": "x=1,x=2"}, "each axis once"),
        ({"channels": "w=1"}, "no axis 'w'; valid names: x, y"),
        ({"chanels": "x=1"}, "option 'chanels' does not exist; did you mean 'channels'"),
    ],
)
def test_options_that_cannot_be_are_refused(tmp_path, options, message):
    paths = [written(tmp_path, f"{c}.AT2", at2_text(WAVE, component=c)) for c in ("090", "000")]
    with pytest.raises(MotionError, match=message):
        load_motion(paths, **options)

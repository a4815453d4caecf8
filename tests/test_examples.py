"""Every numbered example and the demonstration run from the command line, and do what they say."""

import json
import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import Ended
from machine_cases import PRACTICE, SCRIPTS
from test_scripts import script

from lhpost6_pin.data.campaign import load_campaign
from lhpost6_pin.data.check import check_record
from lhpost6_pin.data.records import load_record
from lhpost6_pin.discovery.demonstration import hidden_effect
from lhpost6_pin.machine.library import find_family
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.tuning.drives import load_drive

pytestmark = pytest.mark.long

EXAMPLES = sorted(SCRIPTS.glob("example_*.py"))


@pytest.fixture
def here(monkeypatch, capsys):
    """Run a script as a command does, but in this process: to load the package takes seconds."""

    def run_here(path: Path, *arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", [str(path), *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            runpy.run_path(str(path), run_name="__main__")
        return Ended(int(end.value.code or 0), *capsys.readouterr())

    return run_here


@pytest.fixture
def run(here):
    """What an example prints, by its number."""

    def run_example(number: int, *arguments: object) -> str:
        (path,) = SCRIPTS.glob(f"example_{number}_*.py")
        ended = here(path, *arguments)
        assert ended.code == 0, ended
        return ended.out

    return run_example


def test_every_example_is_run_here():
    here = Path(__file__).read_text()
    for k, path in enumerate(EXAMPLES, start=1):
        assert path.name.startswith(f"example_{k}_") and f"run({k}, " in here


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_an_example_that_cannot_find_what_it_is_given_says_so_in_a_line(here, path):
    if "control" in path.name:
        pytest.importorskip("control")
    ended = here(path, "absent")
    assert ended.code == 1 and ended.out == ""
    assert re.fullmatch(r"error: .*\babsent\b.*\n", ended.err)


@pytest.mark.slow
def test_1_a_motion_is_rehearsed(run, tmp_path):
    said = run(1, "sine", "--scale", "0.2", "--out", tmp_path)
    assert [f for f in check_record(tmp_path / "record.nc") if f.severity == "error"] == []
    record = load_record(tmp_path / "record.nc")
    asked, achieved = (record[f"{who}_displacement"].values[:, 0] for who in ("reference", "platen"))
    error = 100 * np.sqrt(np.sum((achieved - asked) ** 2) / np.sum(asked**2))
    assert f"x: displacement RRMSE {error:.2f} %" in said
    assert "y: displacement" not in said
    assert str(tmp_path / "report.html") in said and (tmp_path / "report.html").is_file()


def test_2_a_motion_of_ones_own_moves_a_specimen(run, tmp_path):
    said = run(2, "--scale", "0.5", "--out", tmp_path)
    bare, loaded = (load_record(tmp_path / f"{name}.nc") for name in ("bare", "loaded"))
    assert bare.attrs["specimen"] == "none" and loaded.attrs["specimen"] == "shear_frame"
    force = float(abs(loaded["actuator_force"]).max()) / 1e3
    assert force > 1.05 * float(abs(bare["actuator_force"]).max()) / 1e3  # 65 t on a platen of 168 t: it shows
    assert "loaded: acceleration RRMSE" in said and f"largest force {force:.0f} kN" in said
    assert "actuator velocity:" in said and (tmp_path / "view.html").is_file()


def test_2_a_motion_that_does_not_fit_is_refused_with_the_scale_that_would(tmp_path):
    ended = script("example_2_own_motion_and_specimen.py", "--scale", "5", "--out", tmp_path)  # a process of its own
    assert ended.returncode == 1 and "largest scale that fits" in ended.stderr and "Traceback" not in ended.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["pulse.csv"]


def test_3_a_record_is_taken_apart(run, tmp_path):
    said = run(3, PRACTICE, "--out", tmp_path)
    assert "pad_friction: -" in said and {"ledger.nc", "report.html"} <= {p.name for p in tmp_path.iterdir()}


def test_4_iterating_makes_the_table_follow_more_closely(run, tmp_path):
    said = run(4, "sine", "--scale", "0.2", "--machine", "uniaxial", "--most", "1", "--out", tmp_path)
    first, best = (float(x) for x in re.findall(r"iteration .*RRMSE x ([\d.]+) %", said))
    assert best < first
    plain, inverse = (float(x) for x in re.findall(r"^sine, .*RRMSE ([\d.]+) %", said, re.MULTILINE))
    assert inverse < plain
    assert load_drive(tmp_path / "drive.nc").attrs["machine"] == "uniaxial"


@pytest.mark.slow
def test_5_lqg_is_compared_with_the_469d(run, tmp_path):
    pytest.importorskip("control")
    said = run(5, "sine", "--scale", "0.2", "--axes", "x", "--out", tmp_path)
    panel, own = (float(x) for x in re.search(r"displacement x.*? ([\d.]+) %.*? ([\d.]+) %", said).groups())
    assert own < panel and "acceleration x: RRMSE" in said and "spool values clipped" in said
    text = (tmp_path / "lqg.html").read_text(encoding="utf-8")
    assert re.search(r"LQG follows more closely than the 469D in \d of 2 quantities", text)
    assert all(f'id="{name}"' in text for name in ("displacement-x", "acceleration-x", "peak-x"))


@pytest.mark.slow  # an ensemble
def test_6_uncertain_numbers_give_an_interval(run, tmp_path):
    said = run(6, "sine", "--scales", "0.1,0.2", "--machines", "4", "--out", tmp_path)
    assert "probability of a saturated valve at scale 0.2: 0%" in said
    rows = np.loadtxt(tmp_path / "forces.csv", delimiter=",", skiprows=1)
    assert rows.shape == (4, 2) and len(set(rows[:, 0])) == 4 and np.all(rows[:, 1] > rows[:, 0])


@pytest.mark.slow  # the battery hides and finds effects in every run of the checks
def test_7_a_hidden_effect_is_found(run, tmp_path):
    said = run(7, "bearing_thrust_direction", "--out", tmp_path)
    assert find_family("bearing_thrust_direction").title in said
    verdict = json.loads((tmp_path / "verdict.json").read_text())
    assert verdict["verdict"] == "named"
    (effect,) = verdict["effects"]
    assert effect["family"] == "bearing_thrust_direction"
    low, high = effect["parameters"]["share"]["ci90"]
    assert low < 1.0 < high  # the typical size is what is hidden
    (added,) = load_machine(tmp_path / "model.toml").modifiers
    assert added.name.startswith("bearing_thrust_direction")


@pytest.mark.slow
def test_the_demonstration_finds_what_it_hides(lhpost6, tmp_path):
    ended = lhpost6("demo", "--no-open", "--out", tmp_path)
    assert ended.code == 0, ended
    family, component, numbers = hidden_effect()
    verdict = json.loads((tmp_path / "verdict.json").read_text())
    (effect,) = verdict["effects"]
    assert verdict["verdict"] == "named" and effect["family"] == family and effect["components"] == [component]
    (number,) = effect["parameters"].values()
    assert number["ci90"][0] < numbers["leakage"] < number["ci90"][1] or (
        # one draw of noise in ten is outside of a 90 % interval: then not by far
        abs(number["value"] - numbers["leakage"]) < 2 * (number["ci90"][1] - number["ci90"][0])
    )
    before, after = map(float, re.search(r"by ([\d.]+) mm .*?\s([\d.]+) mm with", ended.out, re.DOTALL).groups())
    assert after < 0.1 * before
    machine = load_machine()
    assert len(load_campaign(tmp_path / "measured", machine).records) == 3
    assert f"{family}_{component}" in {e.name for e in load_machine(str(tmp_path / "model.toml")).modifiers}
    for page in ("report.html", "view.html"):
        assert (tmp_path / page).read_text().startswith("<!DOCTYPE html>")

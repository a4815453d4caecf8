"""Every script runs from the command line, and the plain loop, an independent account of a step, agrees with ours."""

import json
import re
import runpy
import subprocess
import sys

import numpy as np
import pytest
from c_step import CPlant, compiler
from machine_cases import SCRIPTS, machine_named
from plain_loop import PlainPlant
from run_cases import at_rest

from lhpost6_pin.core.files import models_folder
from lhpost6_pin.core.names import ENGINES, SAMPLE_RATE, SCHEMES
from lhpost6_pin.simulation.simulate import OpenLoop, simulate

pytestmark = pytest.mark.long

IMPORTED = ("c_step.py", "plain_loop.py")
"""Scripts without options of their own."""

ROUNDING = (2e-14, 2e-14, 4e-7, 4e-7, 1e-12, 1e-12)
"""Of pose, twist, pressures in A and B, seals and pads over a run: rounding of numbers near 1, 1 and 2e7, ten times.

Seals (yield 0.2 mm) amplify that of the lengths.
"""


def script(name: str, *arguments: object) -> subprocess.CompletedProcess:
    command = [sys.executable, str(SCRIPTS / name), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)


@pytest.mark.parametrize("path", sorted(SCRIPTS.glob("*.py")), ids=lambda path: path.name)
def test_every_script_says_what_it_is_for_and_has_a_main(path):
    text = path.read_text()
    assert text.startswith('"""')
    if path.name not in IMPORTED:  # imported by the benchmarks, and below
        assert "def main(" in text and '__name__ == "__main__"' in text


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(p.name, marks=pytest.mark.slow) if p.name == "build_docs.py" else p.name  # needs its packages
        for p in sorted(SCRIPTS.glob("*.py"))
        if p.name not in ("checks.py", *IMPORTED)  # take no options
    ],
)
def test_every_script_explains_its_options(name, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(SCRIPTS / name), run_name="__main__")
    assert not ended.value.code and "--out" in capsys.readouterr().out


@pytest.mark.slow
def test_the_benchmarks_run_and_keep_their_figures(tmp_path):
    ended = script("bench.py", "--quick", "--out", tmp_path)
    assert ended.returncode == 0, ended.stderr
    rows = json.loads((tmp_path / "bench.json").read_text())["rows"]
    named = {row["what"] for row in rows}
    for engine in ENGINES:
        assert {f"{engine} {scheme} {loop} loop" for scheme in SCHEMES for loop in ("open", "closed")} <= named
    assert all(row["value"] > 0 for row in rows)
    assert any("solve_ivp" in what for what in named) and any("plain" in what for what in named)


@pytest.mark.slow
def test_the_audit_balances_energy_and_repeats_bit_by_bit(tmp_path):
    ended = script("audit.py", "--seconds", "6", "--out", tmp_path / "audit.md")
    assert ended.returncode == 0, ended.stderr
    text = (tmp_path / "audit.md").read_text()
    assert text.strip() == ended.stdout.strip() and "DIFFERENT" not in text and text.count("| the same |") == 2
    over = float(re.search(r"\| ([\d.e+-]+) \|$", text, re.MULTILINE)[1])
    assert over < 2e-3  # the trapezoidal rule at 2048 Hz over flows that jump with the spool
    report, view = re.findall(r"^\| (?:report|animation.*?) \| ([\d.]+) \|$", text, re.MULTILINE)
    assert float(report) < 6.0 and float(view) < 6.0  # [MB], of 40 s


@pytest.mark.slow
def test_the_convergence_study_runs_and_keeps_its_errors(tmp_path):
    ended = script("convergence.py", "--seconds", "0.5", "--out", tmp_path)
    assert ended.returncode == 0, ended.stderr
    found = json.loads((tmp_path / "convergence.json").read_text())
    assert set(found) == set(SCHEMES)
    for rows in found.values():
        assert [row["steps_per_second"] for row in rows] == [k * SAMPLE_RATE for k in (1, 2, 4, 8, 16, 32)]
    finest = {scheme: rows[-1]["displacement_rrmse"] for scheme, rows in found.items()}
    assert finest["rk4"] < finest["semi_implicit"] < finest["euler"]


@pytest.mark.parametrize("name, option", [("bench.py", "--quick"), ("convergence.py", "--seconds=0.5")])
def test_a_study_is_refused_a_folder_it_could_not_write_before_it_begins(tmp_path, name, option):
    (tmp_path / "file").write_text("")
    ended = script(name, option, "--out", tmp_path / "file" / "below")
    assert ended.returncode == 1 and "NotADirectoryError" in ended.stderr and ended.stdout == ""


def test_the_shipped_urdf_is_what_its_script_writes(tmp_path):
    ended = script("make_urdf.py", "lhpost6", "--out", tmp_path / "a.urdf")
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "a.urdf").read_bytes() == (models_folder() / "lhpost6.urdf").read_bytes()
    lost = script("make_urdf.py", "absent", "--out", tmp_path / "b.urdf")
    assert lost.returncode == 1 and "absent" in lost.stderr and "Traceback" not in lost.stderr


def test_cutting_records_without_the_wheel_says_which_wheel_to_give(tmp_path):
    (tmp_path / "no.whl").write_text("no wheel")
    for name in ("absent.whl", "no.whl"):
        ended = script("cut_ridgecrest.py", tmp_path / name, "--out", tmp_path / "out")
        assert ended.returncode == 1 and "give the wheel of gmprocess 2.8.0" in ended.stderr
        assert "Traceback" not in ended.stderr
    assert not (tmp_path / "out").exists()


def shaken_for_the_plain_loop():
    """Plant, rest, spools (160, 10), the plain loop's state at rest, and steps a sample with their length [s]."""
    plant, rest = at_rest(machine_named("lhpost6"))
    samples, steps = 160, 16
    rng = np.random.default_rng(1)
    t = np.arange(samples) / SAMPLE_RATE
    size = np.r_[np.full(4, 0.1), np.full(6, 0.02)]
    spool = rest.spool + size * np.sin(2 * np.pi * np.outer(t, rng.uniform(3, 12, 10)) + rng.uniform(0, 6, 10))
    return plant, rest, spool, PlainPlant.at_rest(rest.state), (steps, 1.0 / (steps * SAMPLE_RATE))


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_the_step_in_c_is_that_of_the_plain_loop():
    """The yardstick of time does the whole work: to rounding, a hundred times that of one step and one compiler."""
    plant, _, spool, state, (steps, dt) = shaken_for_the_plain_loop()
    plain = PlainPlant(plant.machine)
    found, wanted = CPlant(plain).run(state, spool[:40], steps, dt), state
    for row in spool[:40]:
        for _ in range(steps):
            wanted = plain.step(*wanted, row, dt)
    for ours, theirs, near in zip(found, wanted, ROUNDING, strict=True):
        assert np.abs(ours - theirs).max() < 100.0 * near


def test_the_plain_loop_is_the_fused_engines_euler_to_rounding():
    """NumPy over components, written from the equations: it shares no law, port or stage with the package.

    Sixteen steps a sample, every actuator driven by a sine of its own; the pads and seals slide, no orifice's drop
    comes below the 500 Pa at which ours rounds the root off (theirs does not).
    """
    plant, rest, spool, state, (steps, dt) = shaken_for_the_plain_loop()
    samples = len(spool)
    plain, supply = PlainPlant(plant.machine), plant.supply
    least, slid = np.inf, np.zeros(2)
    for row in spool:
        for _ in range(steps):
            state = plain.step(*state, row, dt)
        pressures = np.concatenate(state[2:4])
        least = min(least, (supply[0] - pressures).min(), (pressures - supply[1]).min())
        slid = np.maximum(slid, [np.abs(state[4]).max(), np.linalg.norm(state[5], axis=1).max()])
    assert least > 500.0 and slid.min() > 0.9
    drive = OpenLoop(np.vstack([spool, spool[-1:]]), rest.state)  # a run records the start of each sample
    run = simulate(
        plant, drive, samples=samples + 1, scheme="euler", steps_per_second=steps * SAMPLE_RATE, engine="fused"
    )
    q, ours = state[0], run.z[-1]
    assert np.abs(q[:3] - rest.state.q[:3]).max() > 1e-3 and np.abs(q[3:6]).max() > 1e-4
    # our hidden states: A and B of H1..H4 in turn, A of V1..V6, seals, pads
    pressures = np.r_[ours[0:8:2], ours[8:14]], ours[1:8:2]
    fused = run.q[-1], run.v[-1], *pressures, ours[14:24], ours[24:36].reshape(6, 2)
    for ours, theirs, near in zip(fused, state, ROUNDING, strict=True):
        assert np.abs(ours - theirs).max() < near

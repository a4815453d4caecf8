"""Simulation against the converged reference run, of the engines against each other, and of each scheme's order."""

import logging
import re
from dataclasses import replace

import numpy as np
import pytest
from machine_cases import PENDULUM, REFERENCE
from page_cases import Reader
from run_cases import closed_loop, sine_motion

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.control.tables import CANCELLER
from lhpost6_pin.core.errors import SimulationError, UnknownNameError
from lhpost6_pin.core.names import ENGINES, SAMPLE_RATE, SCHEMES
from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.signals import rrmse
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.mechanics.valve_delay import delayed_spools
from lhpost6_pin.motions import find_motion, make_target
from lhpost6_pin.show.run_results import notes_of_run, run_remarks, write_test_report
from lhpost6_pin.show.tables import print_run
from lhpost6_pin.simulation.divergence import amplified_mode
from lhpost6_pin.simulation.rehearse import rehearse, replay
from lhpost6_pin.simulation.simulate import ClosedLoop, OpenLoop, diagnosis, fastest_engine, simulate, simulate_many
from lhpost6_pin.tuning.margins import without_dry_friction

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def reference():
    return load_record(REFERENCE)


def six_axis(seconds, size=1.0):
    peak = size * np.array([0.2, 0.1, 0.02, 0.004, 0.003, 0.02])
    return sine_motion(peak, [0.7, 0.9, 1.1, 1.1, 0.8, 0.6], seconds)


def spools_of(plant, rest, seconds):
    """Spool positions of a closed-loop run, to drive open-loop ones."""
    motion = six_axis(seconds)
    run = simulate(plant, closed_loop(plant, rest, motion), samples=len(motion[0]), engine="fused")
    assert run.trouble is None
    return run.spool


# The yardstick -------------------------------------------------------------------------------------------------------


def test_rk4_follows_the_converged_reference_to_its_own_rounding(reference):
    """An independent RK4 simulation of the same equations at 1/65536 s, converged to 1e-11 m and 0.06 Pa."""
    fine = {"scheme": "rk4", "steps_per_second": 16 * SAMPLE_RATE, "engine": "fused"}
    run, record = replay(load_machine(), reference, attrs={}, **fine)
    assert run.trouble is None
    difference = np.abs(record["platen_displacement"].values - reference["platen_displacement"].values)
    # required: 1e-7 m, 1e-7 rad and 100 Pa; ours at 1/32768 s is a thousand times closer, which pins every term
    assert difference.max() < 1e-10
    for pressure in ("chamber_pressure_a", "chamber_pressure_b", "strut_pressure"):
        assert np.abs(record[pressure].values - reference[pressure].values).max() < 1.0
    speed = np.abs(record["platen_velocity"].values - reference["platen_velocity"].values)
    assert speed.max() < 1e-8


def test_default_scheme_stays_close_to_the_reference_at_the_default_rate(reference):
    run, record = replay(load_machine(), reference, attrs={})
    assert run.trouble is None
    assert (run.scheme, run.steps_per_second, run.engine) == ("semi_implicit", 8192, "pinocchio")
    errors = rrmse(reference["platen_displacement"].values, record["platen_displacement"].values)
    assert errors.max() < 1e-5  # required: 1e-4


def test_default_scheme_at_the_controller_rate_is_closer_than_the_reports_at_four_times_that(reference):
    _, coarse = replay(load_machine(), reference, attrs={}, steps_per_second=SAMPLE_RATE, engine="fused")
    _, euler = replay(load_machine(), reference, attrs={}, scheme="euler", engine="fused")
    exact = reference["platen_displacement"].values
    ours, theirs = (rrmse(exact, r["platen_displacement"].values) for r in (coarse, euler))
    assert np.all(ours < 0.1 * theirs)


# Two engines ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", SCHEMES)
def test_both_engines_give_the_same_run(plant, rest, scheme):
    """The fused engine's rigid-body algebra against Pinocchio's, over some seconds of every axis."""
    motion = six_axis(3.0)
    rate = (8 if scheme == "euler" else 4) * SAMPLE_RATE
    options = {"samples": len(motion[0]), "scheme": scheme, "steps_per_second": rate}
    runs = [simulate(plant, closed_loop(plant, rest, motion), engine=engine, **options) for engine in ENGINES]
    for name in ("q", "v", "z", "spool"):
        a, b = (getattr(r, name) for r in runs)
        scale = np.maximum(np.abs(a).max(axis=0), 1e-6)  # columns that stay at zero have no scale of their own
        assert (np.abs(a - b).max(axis=0) / scale).max() < 1e-9, name


def test_batch_gives_bit_for_bit_the_same_whatever_the_threads(plant, rest):
    jobs = [(plant, closed_loop(plant, rest, six_axis(0.5, size))) for size in (0.3, 0.6, 1.0)]
    one, many = (simulate_many(jobs, samples=1024, threads=n) for n in (1, 3))
    alone = simulate(*jobs[2], samples=1024, engine="fused")
    for a, b in zip(one, many, strict=True):
        assert np.array_equal(a.q, b.q) and np.array_equal(a.z, b.z)
    assert np.array_equal(many[2].q, alone.q)


# Schemes -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "scheme, order, rates", [("semi_implicit", 2, (2, 4)), ("rk4", 4, (1, 2)), ("euler", 1, (64, 128))]
)
def test_each_scheme_converges_with_its_order(plant, rest, scheme, order, rates):
    """Errors of two step sizes against RK4 at a fine one, without friction, whose kinks no scheme's order survives.

    Euler is judged where it is stable at all.
    """
    spool = spools_of(plant, rest, 1.2)
    kinds = ("horizontal.seal_friction", "vertical.seal_friction", "vertical.pad_friction")
    smooth = make_plant(load_machine().with_params(dict.fromkeys(kinds, 0.0)))
    drive = OpenLoop(spool, find_equilibrium(smooth).state)

    def positions(name, steps):
        options = {"scheme": name, "steps_per_second": steps * SAMPLE_RATE, "engine": "fused"}
        run = simulate(smooth, drive, samples=len(spool), **options)
        assert run.trouble is None
        return run.q[:, :3]

    exact = positions("rk4", 16)
    coarse, fine = (np.abs(positions(scheme, r) - exact).max() for r in rates)
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.2)  # the next order's share at these steps


# Valve delay ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0.0, 0.2e-3, 1 / 2048, 5e-3, 7.77e-3])
@pytest.mark.parametrize("steps", [1, 4, 7])
def test_spool_is_the_delayed_command_averaged_over_each_step(delay, steps):
    """Against the integral of the held command over each delayed step, by brute force on a fine grid."""
    rng = np.random.default_rng(3)
    command = rng.normal(size=(40, 1))
    fine = 20_000
    for sample in (0, 3, 25, 39):
        window = np.zeros((steps, 1))
        delayed_spools(command, 0, sample, np.array([delay]), 2048.0, window)
        for j in range(steps):
            at = (sample + (j + (np.arange(fine) + 0.5) / fine) / steps) / 2048 - delay
            held = command[np.clip(np.floor(at * 2048).astype(int), 0, 39), 0]
            # the grid can misplace a jump by one cell
            assert window[j, 0] == pytest.approx(held.mean(), abs=10.0 / fine)


# Rest, saturation, trouble -------------------------------------------------------------------------------------------


def test_internal_forces_do_not_drift(plant, rest):
    """A squeeze put into the null space of the motion at the start decays under the force balance."""
    z = rest.state.z.copy()
    z[0:8:2] += 5e5  # [Pa] in A of H1..H4: all push alike, which by symmetry is no wrench
    n = 4 * SAMPLE_RATE
    start = rest._replace(state=rest.state._replace(z=z))
    settings = load_controller("lhpost6")

    def left(gain):
        loop = make_controller(plant, start, replace(settings, balance_gain=gain))
        run = simulate(plant, ClosedLoop(loop, np.zeros((n, 6)), start), samples=n, engine="fused")
        force = run.z[:, 0:8:2] * 0.2027 - run.z[:, 1:8:2] * 0.1297
        return np.abs(force[-1]).max() / np.abs(force[0]).max()

    # leakage alone brings it down, slowly; what the balance leaves is the shifted mean pressure, which it cannot see
    assert left(settings.balance_gain) < 0.05
    assert left(settings.balance_gain) < 0.3 * left(0.0)


def test_saturated_spool_is_clipped_counted_and_warned_of(plant, rest, caplog):
    spool = np.tile(rest.spool, (64, 1))
    spool[10:20, 4] = 1.7
    with caplog.at_level(logging.WARNING):
        run = simulate(plant, OpenLoop(spool, rest.state), samples=64)
        simulate(plant, OpenLoop(spool, rest.state), samples=64, label="TX")
    assert run.clipped == 10 and run.spool.max() == 1.0
    assert [message[:20] for message in caplog.messages] == ["10 spool values beyo", "TX: 10 spool values "]


@pytest.mark.parametrize("engine", ENGINES)
def test_run_that_leaves_a_stroke_stops_with_time_and_component_and_keeps_what_was_done(plant, rest, engine, caplog):
    spool = np.tile(rest.spool, (4 * SAMPLE_RATE, 1))
    spool[:, 4:] = 0.6  # all vertical actuators up
    with caplog.at_level(logging.WARNING):
        run = simulate(plant, OpenLoop(spool, rest.state), samples=len(spool), engine=engine)
    assert run.trouble is not None
    assert "V" in run.trouble and "0.127" in run.trouble and "in open loop" in run.trouble
    assert 100 < len(run.time) < len(spool)
    assert np.all(np.isfinite(run.q)) and np.all(np.isfinite(run.z))
    said = float(re.search(r"stopped at ([\d.]+) s", run.trouble).group(1))
    assert said == pytest.approx(run.time[-1], abs=2 / SAMPLE_RATE)  # within the sample that failed


@pytest.mark.parametrize("engine", ENGINES)
def test_run_that_diverges_stops_and_names_a_remedy(plant, rest, engine):
    """The report's Euler on an oil column of 0.30 m is unstable at 2048 Hz: evidence for a longer chamber."""
    n, loop = 4 * SAMPLE_RATE, closed_loop(plant, rest, six_axis(4.0))
    run = simulate(plant, loop, samples=n, scheme="euler", steps_per_second=SAMPLE_RATE, engine=engine)
    assert run.trouble is not None and len(run.time) < n
    assert np.all(np.isfinite(run.q))
    assert run.diverged and "scheme euler at 2048 steps a second amplifies" in run.trouble
    assert "take semi_implicit, or more steps (--rate)" in run.trouble and "left its stroke" not in run.trouble


def test_a_mode_that_euler_amplifies_grows_in_simulation_as_it_says(plant, rest):
    """Growth of the platen's speed over a second of Euler at 2048 Hz from a small push; Runge-Kutta amplifies none."""
    smooth = make_plant(without_dry_friction(load_machine()))
    _, growth = amplified_mode(smooth, "euler", SAMPLE_RATE)
    start = find_equilibrium(smooth)
    pushed = start.state._replace(v=1e-6 * np.ones(6))
    spool = np.tile(start.spool, (SAMPLE_RATE, 1))
    run = simulate(
        smooth,
        OpenLoop(spool, pushed),
        samples=len(spool),
        scheme="euler",
        steps_per_second=SAMPLE_RATE,
        engine="fused",
    )
    early, late = (np.sqrt(np.mean(part**2)) for part in (run.v[768:1280, 3], run.v[-512:, 3]))
    seconds = (len(run.v) - 256 - 1024) / SAMPLE_RATE
    assert np.log(late / early) / seconds == pytest.approx(growth, rel=0.1)  # another mode of roll beside it
    assert (
        amplified_mode(plant, "rk4", SAMPLE_RATE) == amplified_mode(plant, "semi_implicit", SAMPLE_RATE) == (0.0, 0.0)
    )


def test_a_run_that_diverges_prints_and_reports_no_table_and_no_remark(plant, rest, capsys, tmp_path):
    target = make_target(find_motion("sine", amplitude=0.05, cycles=1), axes="x")
    options = {"scheme": "euler", "steps_per_second": SAMPLE_RATE, "engine": "fused"}
    test = rehearse(load_machine(), target, load_controller("lhpost6"), attrs={}, **options)
    assert test.run.diverged and not run_remarks(test)
    print_run(test.run, write_test_report(test.run.plant, test.record, None, notes_of_run(test.run, [])))
    printed = " ".join(capsys.readouterr().out.split())
    assert "diverged before" in printed and "Peak" not in printed and "capacity" not in printed
    write_test_report(test.run.plant, test.record, tmp_path / "report.html", notes_of_run(test.run, []))
    page = Reader(tmp_path / "report.html")
    assert "diverged before" in page.verdict[1] and "Why there are no results" in page.words
    assert not page.figures and "Peak achieved" not in page.words and "Demand / capacity" not in page.words
    assert "horizontal.leakage" in page.words and "spool_command" in page.words  # the machine, what the record holds


@pytest.mark.parametrize(
    "change, message",
    [
        ({"scheme": "magic"}, "no scheme named 'magic'"),
        ({"engine": "steam"}, "no engine named 'steam'"),
        ({"steps_per_second": 1000}, "got 1000"),
        ({"steps_per_second": 3000}, "got 3000"),
        ({"samples": 0}, "nothing to simulate"),
        ({"samples": 3}, "spool has 4 rows"),
        ({"record_every": 0}, "record_every must be at least 1"),
    ],
)
def test_what_cannot_be_run_is_refused(plant, rest, change, message):
    options = {"samples": 4, **change}
    with pytest.raises((SimulationError, UnknownNameError), match=message):
        simulate(plant, OpenLoop(np.zeros((4, 10)), rest.state), **options)
    spool = np.zeros((4, 10))
    spool[2, 7] = np.nan
    for wrong, words in ((spool, "V4 is not finite at row 2"), (np.zeros((4, 9)), r"takes \(n, 10\)")):
        with pytest.raises(SimulationError, match=words):
            simulate(plant, OpenLoop(wrong, rest.state), samples=4)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_drive_of_another_size_or_machine_is_refused(plant, rest, engine):
    motion = np.zeros((8, 6))
    loop = closed_loop(plant, rest, (motion,) * 3)
    small = make_plant(load_machine("uniaxial"))
    learning = loop.controller._replace(canceller=np.zeros(1, CANCELLER))
    other = closed_loop(small, find_equilibrium(small), (motion,) * 3)
    for drive, message in (
        (loop._replace(drive=np.zeros((8, 5))), r"drive has shape \(8, 5\); \(8, 6\) is needed"),
        (loop._replace(drive=np.zeros((8, 13))), r"drive has shape \(8, 13\)"),
        (loop._replace(drive=np.zeros((7, 6))), r"drive has shape \(7, 6\)"),
        (loop._replace(controller=learning), r"drive has shape \(8, 6\); \(8, 13\) is needed"),
        (loop._replace(controller=other.controller), "the controller was made for uniaxial; make one for LHPOST6"),
        (loop._replace(rest=other.rest), "start from a state of another plant than LHPOST6"),
        (OpenLoop(np.zeros((8, 10)), other.rest.state), "start from a state of another plant than LHPOST6"),
    ):
        with pytest.raises(SimulationError, match=message):
            simulate(plant, drive, samples=8, engine=engine)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_drive_of_whole_numbers_in_another_order_runs_alike(plant, rest, engine):
    loop = closed_loop(plant, rest, (np.zeros((8, 6)),) * 3)
    runs = [
        simulate(plant, loop._replace(drive=drive), samples=8, engine=engine)
        for drive in (np.ones((8, 6)), np.ones((8, 6), int, order="F"))
    ]
    assert np.array_equal(runs[0].command, runs[1].command)


def test_only_free_joints_of_a_specimen_need_the_per_step_engine(plant):
    assert not plant.articulated and fastest_engine(plant) == "fused"
    for locked, engine in ((True, "fused"), (False, "pinocchio")):
        loaded = make_plant(load_machine().with_specimen(str(PENDULUM), locked=locked))
        assert loaded.articulated == (not locked) and fastest_engine(loaded) == engine


# Effects and specimens -----------------------------------------------------------------------------------------------


def test_only_a_run_with_a_controller_is_told_to_scale_its_motion_down(plant):
    """A replay has no motion that could be scaled, and starts from its record's pressures already."""
    closed, replayed = (
        diagnosis(plant, 1, 1.0, "semi_implicit", 8192, replayed=replayed) for replayed in (False, True)
    )
    assert "scale the motion down" in closed and "record" not in closed
    assert "scale" not in replayed and "drifts from its record" in replayed

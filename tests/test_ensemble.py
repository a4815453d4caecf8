"""Ensembles: draws, plans, runs over workers, interruption, and what results show."""

import hashlib
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from commands import refused
from hypothesis import given
from hypothesis import strategies as st
from machine_cases import machine_named
from scipy.stats import binom, truncnorm

from lhpost6_pin.core.errors import LhpostError, MotionError, ParameterError, RecordError, UnknownNameError
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.data.signals import rrmse
from lhpost6_pin.identification.calibration import with_parameters
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.machine.parameters import load_parameters
from lhpost6_pin.motions import response_spectrum
from lhpost6_pin.show.ensemble_tables import ensemble_verdict, risk_table, spread_table
from lhpost6_pin.show.report.ensemble_report import _headlines
from lhpost6_pin.simulation.rehearse import rehearse
from lhpost6_pin.studies import ensemble
from lhpost6_pin.studies.draws import draw_machines
from lhpost6_pin.studies.ensemble import run_ensemble
from lhpost6_pin.studies.exceedance import ANY, critical_scales, exceedance, exceedances
from lhpost6_pin.studies.importance import importances
from lhpost6_pin.studies.loops import loops_of
from lhpost6_pin.studies.plan_file import load_plan, plan_from
from lhpost6_pin.studies.quantities import LIMITS
from lhpost6_pin.studies.store import BlockStore, open_results
from lhpost6_pin.studies.summary import Configuration, EnsembleSummary, LoopOf, Spread, _spreads, summarise

NUMBERS = load_parameters(models_folder() / "procedures" / "ensemble.toml")
SINE = {"name": "sine", "options": {"amplitude": 0.05, "cycles": 1.0, "ramp_cycles": 0.5}}


def plan(**entries):
    """Two scales of a sine on some machines."""
    return plan_from(
        {"name": "sines", "machines": 6, "scales": [0.5, 1.0], "motion": [SINE], **entries}, Path(), "test"
    )


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


# ------------------------------------------------------------------------------------------------ draws
def test_a_latin_hypercube_has_one_machine_in_every_stratum_of_each_prior():
    drawn = draw_machines(load_machine(), 40, design="lhs", seed=3, reach=3.0)
    for k, parameter in enumerate(drawn.parameters):
        low = max(-3.0, parameter.lowest / parameter.sd)
        share = truncnorm.cdf(drawn.coordinates[:, k] / parameter.sd, low, min(3.0, parameter.highest / parameter.sd))
        assert sorted(np.floor(40 * share).astype(int)) == list(range(40)), parameter.name


def test_some_numbers_are_drawn_and_all_others_stay_as_stated():
    machine = load_machine()
    drawn = draw_machines(machine, 8, design="sobol", seed=0, reach=3.0, uncertain=["hydraulics.*"])
    assert {p.name.partition(".")[0] for p in drawn.parameters} == {"hydraulics"}
    other = with_parameters(machine, drawn.parameters, drawn.coordinates[3]).parameters
    changed = {path for path, q in machine.parameters.items() if other[path].value != q.value}
    assert changed == {path for p in drawn.parameters for path, _ in p.paths}


@pytest.mark.parametrize("uncertain", [("*",), ("drive.flow*",), ("drive.flow",)])
def test_the_flow_at_full_opening_varies_as_stated_where_the_curve_is_hardly_known(uncertain):
    machine = load_machine("biaxial")  # 150 l/min, 10 % assumed; its curve straight to bent, a factor of two
    drawn = draw_machines(machine, 512, design="lhs", seed=3, reach=2.0, uncertain=uncertain)
    values = dict(zip([one.name for one in drawn.parameters], drawn.values.T, strict=True))
    stated = machine.parameters.number
    curve = values.get("drive.flow_curve", np.full(512, stated("drive.flow_curve")))
    full = values["drive.flow"] * (1.0 - np.exp(-curve))
    usual = stated("drive.flow") * (1.0 - np.exp(-stated("drive.flow_curve")))
    # a normal of 0.1 within two deviations has one of 0.088; strata make that exact within a per cent
    assert np.std(np.log(full / usual)) == pytest.approx(0.088, rel=0.03)
    assert np.mean(np.log(full / usual)) == pytest.approx(0.0, abs=0.002)


def test_one_machine_is_the_machine_as_stated():
    assert not draw_machines(load_machine(), 1, design="lhs", seed=5, reach=3.0).coordinates.any()


def test_draws_that_cannot_be_are_refused_with_what_can():
    def draw(**options):
        return draw_machines(load_machine(), **{"count": 12, "design": "lhs", "seed": 0, "reach": 3.0, **options})

    with pytest.raises(ParameterError, match="8 or 16, not 12"):
        draw(design="sobol")
    with pytest.raises(UnknownNameError, match=r"no design of an ensemble named 'lsh'; did you mean 'lhs'"):
        draw(design="lsh")
    with pytest.raises(ParameterError, match=r"no uncertain number matches 'oil\.\*'; there are platen"):
        draw(uncertain=["hydraulics.*", "oil.*"])


# ------------------------------------------------------------------------------------------- exceedance
@given(
    st.lists(st.floats(0.06, 3.0), min_size=1, max_size=30),
    st.lists(st.floats(0.05, 2.5), min_size=2, max_size=6, unique=True),
)
def test_demand_proportional_to_scale_reaches_capacity_at_its_own_scale(capacity, scales):
    """Linear interpolation is exact for it; capacities below the lowest scale are reached there."""
    scales, capacity = np.sort(scales), np.array(capacity)
    found = critical_scales(scales[:, None] / capacity, scales)
    expected = np.where(capacity > scales[-1], np.inf, np.maximum(capacity, scales[0]))
    near = np.abs(capacity - scales[-1]) < 1e-9  # a division may round to either side of capacity
    np.testing.assert_allclose(found[~near], expected[~near], rtol=1e-9)


def test_demand_that_saturates_between_two_scales_reaches_capacity_in_proportion_to_the_lower_one():
    """Actuator velocity of six machines at 1.2 and 1.6: between them, at 1.35, all were beyond."""
    scales, at = np.array([1.2, 1.6]), np.array([[0.978, 0.920, 0.957, 0.911], [1.046, 1.041, 1.048, 1.039]])
    found = critical_scales(at, scales)
    np.testing.assert_allclose(found, 1.2 / at[0], rtol=1e-12)
    assert (found < 1.35).all()
    steeper = critical_scales(np.array([[0.6], [1.4]]), np.array([1.0, 2.0]))  # an offset that grows: linear
    assert steeper == pytest.approx([1.5])


def test_a_missing_run_before_a_limit_is_reached_leaves_its_machine_out():
    use = np.array([[0.2, np.nan, 0.2, 0.2], [0.8, 1.2, np.nan, 1.5], [1.2, 1.5, 1.5, np.inf]])
    found = critical_scales(use, np.array([1.0, 2.0, 3.0]))
    assert found[0] == pytest.approx(2.5) and np.isnan(found[1:3]).all() and 1.0 < found[3] < 2.0
    assert critical_scales(np.array([[0.5], [np.inf]]), np.array([1.0, 2.0])) == [2.0]


def test_the_scale_of_a_risk_is_a_quantile_and_its_interval_holds_it_as_often_as_stated():
    """Order statistics: the interval of the 5 % quantile of 200 exponential capacities holds it in 95 % of samples."""
    rng, scales = np.random.default_rng(0), np.array([0.02, 1.0, 10.0])
    inside, true = 0, -np.log(0.95)
    for _ in range(200):
        capacity = np.maximum(rng.exponential(size=200), 0.0201)
        critical = critical_scales(scales[:, None] / capacity, scales)
        found = exceedance("spool", critical, scales, level=0.05, confidence=0.95)
        inside += found.risk_low <= true <= found.risk_high
        assert np.all((found.low <= found.share) & (found.share <= found.high))
    # at least 95 % as ranks are whole numbers; five deviations of a binomial count below that
    assert inside >= binom.ppf(3e-7, 200, 0.95)


def test_any_limit_is_the_first_of_the_deciding_ones_and_a_run_in_trouble_counts():
    scales, limits = np.array([1.0, 2.0]), ("displacement", "push", "payload")
    use = np.array([[[0.6, 0.2, 3.0], [0.3, 0.1, 3.0]], [[1.4, 0.4, 3.0], [0.6, 0.2, 3.0]]])  # (s, n, limits)
    trouble = np.array([[False, False], [False, True]])
    found = exceedances(use, trouble, limits, scales, level=0.5, confidence=0.9)
    assert [one.limit for one in found] == [ANY, "displacement", "push"]  # capacities for comparison do not decide
    assert found[0].share.tolist() == [0.0, 1.0] and found[1].share.tolist() == [0.0, 0.5]
    assert found[1].critical[0] == pytest.approx(1.5) and found[1].risk_scale == pytest.approx(1.5)
    assert np.isinf(found[2].risk_scale) and found[2].where == "beyond the largest run"


@given(st.integers(0, 2**32 - 1))
def test_any_limit_is_reached_with_the_first_single_one(seed):
    """Neither between the demands of two limits, nor later because a run stopped."""
    rng = np.random.default_rng(seed)
    scales, limits = np.array([0.5, 1.0, 2.0]), ("displacement", "spool", "pull")
    use = np.sort(rng.uniform(0.0, 2.0, (3, 8, 3)), axis=0)
    use[..., 2] = np.where(use[..., 2] > 1.5, np.inf, 0.0)  # without capacity
    use[2, 5:] = np.where(use[2, 5:] < 1.0, np.nan, use[2, 5:])  # of runs that stopped
    trouble = np.zeros((3, 8), bool)
    trouble[2, 5:] = True
    single = np.array([critical_scales(use[..., k], scales) for k in range(3)])
    expected = np.fmin.reduce([*single, np.where(trouble.any(axis=0), 2.0, np.nan)])
    found = exceedances(use, trouble, limits, scales, level=0.5, confidence=0.9)
    assert found[0].critical.tolist() == np.sort(expected).tolist()
    assert all(np.all(one.share <= found[0].share + 1e-12) for one in found[1:] if len(one.critical) == 8)


# ------------------------------------------------------------------------------------------- importance
def test_indices_of_a_linear_result_are_its_squared_coefficients():
    """Closed form: Var(c_i x_i) / Var(y); RBD-FAST is off by some hundredths with a thousand machines."""
    pytest.importorskip("SALib")
    rng = np.random.default_rng(2)
    x = rng.standard_normal((1000, 6))
    found = importances(list("abcdef"), x, x @ [3.0, -2.0, 1.0, 0.0, 0.0, 0.0], NUMBERS)
    shares = {one.parameter: one for one in found}
    for name, expected in (("a", 9 / 14), ("b", 4 / 14), ("c", 1 / 14), ("d", 0.0), ("e", 0.0), ("f", 0.0)):
        assert shares[name].first_order == pytest.approx(expected, abs=0.06)
    assert [one.parameter for one in found[:2]] == ["a", "b"]
    assert shares["a"].sure and shares["b"].sure and not any(shares[name].sure for name in "def")


@pytest.mark.slow
def test_a_result_that_follows_from_nothing_names_no_number():
    """At the stated confidence one of twenty such results names one; of ten, over three are improbable (1e-3)."""
    pytest.importorskip("SALib")
    rng, names = np.random.default_rng(5), list("abcdef")
    x = rng.standard_normal((80, len(names)))
    named = [importances(names, x, rng.standard_normal(80), NUMBERS)[0].sure for _ in range(10)]
    assert sum(named) <= 3


def test_no_index_is_estimated_from_few_machines_or_of_a_result_that_does_not_vary():
    pytest.importorskip("SALib")
    x = np.random.default_rng(0).standard_normal((100, 2))
    assert importances(["a", "b"], x[:20], x[:20, 0], NUMBERS) == ()
    assert importances(["a", "b"], x, np.full(100, 0.3), NUMBERS) == ()


# ------------------------------------------------------------------------------------------------- plans
@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"motions": []}, r"no key 'motions'; did you mean 'motion'"),
        ({"motion": []}, r"has no \[\[motion\]\]"),
        ({"motion": [{"axes": "x"}]}, r"\[\[motion\]\]: give a name or files"),
        ({"motion": [SINE, SINE]}, r"two of \[\[motion\]\] are 'sine'; give each a `label`"),
        ({"motion": [{"name": "sine", "scales": [1.0]}]}, r"\[\[motion\]\]: no key 'scales'"),
        ({"machines": 0}, "machines is 0; give 1 at least"),
        ({"machines": True}, "machines is True; give int"),
        ({"machines": 2.5}, "machines is 2.5; give int"),
        ({"scales": [1.0, "x"]}, "scales is .* give numbers"),
        ({"scales": [1.0, 0.5]}, "name each once, rising"),
        ({"scales": [0.0]}, "each must be positive"),
        ({"scales": []}, "an ensemble without scales"),
        ({"quantities": ["tracks"]}, "no group of quantities named 'tracks'; did you mean 'tracking'"),
        ({"specimen": [{"name": "block_4_9MN", "at": [0.0]}]}, "at and rpy are three numbers each"),
        ({"specimen": [{"label": "x"}]}, "give a name or a file, or 'none'"),
        ({"controller": [{"label": "x"}]}, r"\[\[controller\]\]: give a name or a file"),
        ({"engine": "warp"}, "no engine named 'warp'"),
        ({"seed": -1}, "seed is -1; give 0 at least"),
        ({"uncertain": [3]}, "uncertain is .* give texts"),
        ({"uncertain": []}, "6 machines, but no number to draw"),
        ({"quantities": [["x"]]}, "quantities is .* give texts"),
        ({"draw": "lsh", "machines": 1}, "did you mean 'lhs'"),
        ({"motion": [{**SINE, "axes": "q"}]}, "no axis 'q'"),
        ({"machine": "uniaxial", "motion": [{**SINE, "axes": "x,y=x"}]}, "cannot move in y"),
        ({"rate": 5000}, "multiple"),
        ({"motion": [3]}, "is 3; write a table"),
        ({"motion": [{**SINE, "dt": 0.02}]}, r"\[\[motion\]\]: dt is for motions from files"),
        (
            {"motion": [{"files": ["x.csv"], "dt": 0.02, "options": {"time_step": 0.01}}]},
            "dt is in options, too, as time_",
        ),
        ({"motion": [{"files": ["x.csv"], "dt": "fast"}]}, "dt is 'fast'; give float"),
    ],
)
def test_a_plan_that_cannot_be_names_its_key(entries, message):
    with pytest.raises(LhpostError, match=message):
        plan(**entries)


def test_a_plan_file_names_itself_and_finds_files_beside_it(tmp_path):
    (tmp_path / "suite.toml").write_text("machines = 3\n[[motion]]\nfiles = ['x.csv']\n")
    with pytest.raises(MotionError, match=r"x\.csv"):
        load_plan(tmp_path / "suite.toml")
    (tmp_path / "x.csv").write_text("time [s],x [m/s2]\n" + "".join(f"{k / 50},{k % 3}\n" for k in range(100)))
    (tmp_path / "wide.toml").write_text('[hydraulics.bulk_modulus]\nsd = 3e8\nevidence = "assumed"\nsource = "wide"\n')
    found = load_plan(tmp_path / "suite.toml", {"machines": 5, "uncertain": ["hydraulics.*"]})
    assert found.name == "suite" and found.shape == (1, 1, 1, 1, 5) and list(found.motions) == ["x"]
    (tmp_path / "suite.toml").write_text("machines = \n")
    with pytest.raises(ParameterError, match=r"suite\.toml: .*line 1"):
        load_plan(tmp_path / "suite.toml")


def test_a_plan_states_what_a_text_of_numbers_does_not(tmp_path, caplog):
    """A column's dt, unit and channels as `run` takes them, and a taper of displacements."""
    wave = np.sin(2.0 * np.pi * 0.02 * np.arange(500))
    (tmp_path / "column.txt").write_text("\n".join(f"{x:.6f}" for x in wave))
    stated = "[[motion]]\nfiles = ['column.txt']\ndt = 0.02\nunit = 'mm'\nchannels = 'y=1'\ntaper = 2\n"
    (tmp_path / "suite.toml").write_text(stated)
    (planned,) = load_plan(tmp_path / "suite.toml").motions.values()
    assert planned.motion.time_step == 0.02 and planned.motion.axes == ("y",)
    np.testing.assert_allclose(
        planned.motion.samples[100:400, 1], 1e-3 * wave[100:400], atol=1e-9
    )  # six decimals of mm
    np.testing.assert_array_equal(planned.motion.samples[[0, -1], 1], 0.0)
    assert not caplog.records
    (tmp_path / "suite.toml").write_text(stated.replace("taper = 2\n", ""))
    (blunt,) = load_plan(tmp_path / "suite.toml").motions.values()
    blunt.target(load_machine(), 1.0)  # of one of many runs
    (warning,) = caplog.records  # of the plan alone
    assert "column: y starts at" in warning.getMessage() and "--taper" in warning.getMessage()
    (tmp_path / "suite.toml").write_text(stated.replace("unit = 'mm'\n", ""))
    with pytest.raises(MotionError, match=r"column\.txt.*unit, as --unit g"):
        load_plan(tmp_path / "suite.toml")


def test_hints_of_the_command_for_a_text_of_numbers_name_options_that_it_has(lhpost6, tmp_path, monkeypatch):
    (tmp_path / "column.txt").write_text("0.0\n0.1\n0.0\n" * 50)
    assert refused(lhpost6("ensemble", "column.txt"), "as --unit g")
    assert refused(lhpost6("ensemble", "column.txt", "--unit", "g"), "as --dt 0.01")
    assert refused(lhpost6("ensemble", "sine", "--dt", "0.02"), "sine: --dt is for motions from files, and none is one")
    (tmp_path / "plan.toml").write_text('[[motion]]\nname = "sine"\n')
    assert refused(lhpost6("ensemble", "plan.toml", "--dt", "0.02"), "a plan states dt of each")
    seen = []
    monkeypatch.setattr(ensemble, "run_ensemble", lambda made, *_, **__: seen.append(made) or sys.exit(0))
    given = ("--dt", 0.02, "--unit", "g", "--channels", "y=1", "--high-pass", 0.5, "--low-pass", 20)
    lhpost6("ensemble", "column.txt", "sine", *given)
    column, sine = seen[0].motions.values()
    assert column.motion.time_step == 0.02 and column.motion.axes == ("y",) and sine.motion.axes == ("x",)
    assert (column.high_pass, column.low_pass) == (0.5, 20.0)


def test_everything_that_results_follow_from_is_in_the_digest_of_a_plan():
    others = [{"seed": 1}, {"scales": [0.5]}, {"machines": 7}, {"quantities": ["limits"]}, {"engine": "pinocchio"}]
    others += [{"motion": [{**SINE, "axes": "y=x"}]}, {"specimen": [{"name": "block_4_9MN"}]}, {"rate": 4096}]
    two = [{**SINE, "label": "slow"}, {**SINE, "label": "fast", "options": {"period": 0.5, "cycles": 1.0}}]
    others += [{"motion": two}, {"motion": two[::-1]}]  # blocks are numbered by place
    digests = {plan(**entries).digest for entries in [{}, *others]}
    assert plan().digest in digests and len(digests) == 1 + len(others)


# ---------------------------------------------------------------------------------------------- results
@pytest.fixture(scope="module")
def sines(tmp_path_factory):
    """Results of six machines at two scales, and their plan."""
    made = plan()
    return made, run_ensemble(made, tmp_path_factory.mktemp("sines"), jobs=1)


@pytest.mark.long
def test_every_run_is_the_rehearsal_of_its_machine(sines):
    """Bit by bit: an ensemble adds nothing to `rehearse`."""
    made, path = sines
    machine = with_parameters(made.machine, made.draws.parameters, made.draws.coordinates[4])
    target = made.motions["sine"].target(machine, 1.0)
    settings = made.controllers["lhpost6"]
    test = rehearse(machine, target, settings, attrs={}, engine="fused", scheme="semi_implicit")
    with open_results(path) as results:
        own = results.sel(motion="sine", scale=1.0, specimen="none", controller="lhpost6", machine=4)
        x = [test.record[f"{who}_acceleration"].values[:, 0] for who in ("reference", "platen")]
        assert float(own["rrmse_acceleration"].sel(axis="x")) == float(rrmse(*x))
        assert np.isnan(own["rrmse_acceleration"].sel(axis="z"))  # uncommanded
        force = np.abs(test.record["actuator_force"].values).max(axis=0)
        assert own["peak_force"].values.tolist() == force.tolist()
        every = 4  # 2048 Hz to the rate of spectra
        expected = response_spectrum(x[1][::every], every / 2048, results["period"].values).pseudo_acceleration
        assert own["psa"].sel(direction="x").values.tolist() == expected.tolist()
        assert results["limit"].values.tolist() == list(LIMITS)
        assert float(own["seconds"]) == len(target.time) / 2048
        assert str(own["failure"].values) == "" and str(own["trouble"].values) == ""


@pytest.mark.slow
@pytest.mark.long
def test_an_interrupted_ensemble_goes_on_to_the_same_file(sines, tmp_path):
    made, path = sines

    def stop(share):
        if share >= 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_ensemble(made, tmp_path, jobs=1, progress=stop)
    blocks = sorted(tmp_path.glob("blocks-*/*.npz"))
    assert 0 < len(blocks) < len(made.blocks) and not (tmp_path / "ensemble.nc").exists()
    with pytest.raises(ParameterError, match="holds an ensemble of another plan"):
        run_ensemble(plan(seed=9), tmp_path, jobs=1)
    store = BlockStore(tmp_path, made)
    with store.locked(), pytest.raises(ParameterError, match="another command writes this ensemble"):
        run_ensemble(made, tmp_path, jobs=1)
    blocks[0].write_bytes(b"PK")  # damaged, as by a loss of power: run again
    shares = []
    run_ensemble(made, tmp_path, jobs=1, progress=shares.append)
    assert len(shares) == len(made.blocks) - len(blocks) + 1 and shares[-1] == 1.0
    assert digest(tmp_path / "ensemble.nc") == digest(path) and not store.blocks.exists()
    assert run_ensemble(made, tmp_path, jobs=1) == tmp_path / "ensemble.nc"  # whole: nothing is run


@pytest.mark.slow  # an interrupted one does in every run
def test_a_killed_ensemble_goes_on_to_the_same_file(sines, tmp_path):
    made, path = sines
    code = "import sys; from test_ensemble import *; run_ensemble(plan(), Path(sys.argv[1]), jobs=1)"
    killed = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], cwd=Path(__file__).parent)
    while killed.poll() is None and not any(tmp_path.glob("blocks-*/0*.npz")):
        time.sleep(0.01)
    killed.kill()
    assert killed.wait() == -signal.SIGKILL
    assert 0 < len(list(tmp_path.glob("blocks-*/0*.npz"))) < len(made.blocks)
    assert digest(run_ensemble(made, tmp_path, jobs=1)) == digest(path)


@pytest.mark.long
@pytest.mark.slow
def test_processes_give_the_same_file(sines, tmp_path):
    made, path = sines
    assert digest(run_ensemble(made, tmp_path, jobs=2)) == digest(path)


@pytest.mark.slow  # a cluster of processes, each of which loads the package
@pytest.mark.filterwarnings("ignore")  # of Dask's own event loop
def test_a_dask_cluster_gives_the_same_file(sines, tmp_path):
    pytest.importorskip("distributed")
    made, path = sines
    assert digest(run_ensemble(made, tmp_path, jobs=2, dask="local")) == digest(path)
    with pytest.raises(ParameterError, match=r"no scheduler responds there"):
        run_ensemble(plan(seed=2), tmp_path / "other", dask="tcp://127.0.0.1:9")


@pytest.mark.long
@pytest.mark.slow
def test_runs_that_stop_or_fail_are_rows_with_their_reason(tmp_path, monkeypatch):
    """A sine beyond the stroke stops on the way: its demand is kept up to there, its tracking is not."""
    far = {"name": "sine", "label": "far", "options": {"amplitude": 0.9, "period": 6.0, "cycles": 1.0}}
    made = plan(motion=[far], scales=[0.1, 1.5], machines=2)
    path = run_ensemble(made, tmp_path / "far", jobs=1)
    with open_results(path) as results:
        own = results.squeeze()
        assert own["trouble"].values[0].tolist() == ["", ""]
        assert all("left its stroke" in word for word in own["trouble"].values[1])
        assert np.isnan(own["rrmse_displacement"].sel(axis="x").values).tolist() == [[False] * 2, [True] * 2]
        use = own["limit_use"].values[1]
        assert np.all(np.isnan(use) | (use >= 1.0)) and np.all(use[:, list(LIMITS).index("displacement")] > 1.0)
        found = summarise(results, NUMBERS)
    assert found.stopped == 2 and sum(found.troubles.values()) == 2 and not found.failures
    assert found.configurations[0].exceedances[0].share.tolist() == [0.0, 1.0]

    def failing(*arguments, **options):
        raise ValueError("no such valve")

    monkeypatch.setattr("lhpost6_pin.studies.runs.rehearse", failing)
    monkeypatch.setattr(ensemble, "results_of", lambda function, tasks: (function(*task) for task in tasks))
    with open_results(run_ensemble(made, tmp_path / "failed", jobs=1)) as results:
        assert set(results["failure"].values.ravel()) == {"ValueError: no such valve"}
        assert summarise(results, NUMBERS).failures == {"ValueError: no such valve": 4}


@pytest.mark.long
def test_specimens_controllers_and_guided_machines_have_their_place(tmp_path):
    made = plan(specimen=[{"name": "none"}, {"name": "block_4_9MN", "label": "block"}], machines=1, scales=[0.2])
    with open_results(run_ensemble(made, tmp_path / "block", jobs=1)) as results:
        shear = results["base_shear"].squeeze()
        acceleration = float(results["peak_acceleration"].sel(axis="x", specimen="block").squeeze())
        assert np.isnan(shear.sel(specimen="none"))
        assert results["loop"].sel(specimen="none").item() == "stable"
        mass = 4.9e6 / made.machine.platen.gravity
        # a rigid block: its shear is mass times acceleration of its mass centre, which also rocks a little
        assert float(shear.sel(specimen="block")) == pytest.approx(mass * acceleration, rel=0.15)
    one_axis = {"name": "uni", "machine": "uniaxial", "machines": 2, "motion": [SINE], "scales": [0.2]}
    with open_results(run_ensemble(plan_from(one_axis, Path(), "test"), tmp_path / "uni", jobs=1)) as results:
        assert results.sizes["actuator"] == len(machine_named("uniaxial").actuator_names)
        assert np.isfinite(results["rrmse_displacement"].sel(axis="x")).all()


def test_ratios_are_in_per_cent_as_everywhere():
    quantiles = np.array([0.2, 0.223, 0.3])
    one = Spread("sine", 1.0, "none", "tuned", "acceleration RRMSE, worst axis", "1", quantiles, 0.2, 0.3, 9)
    (row,) = spread_table([one]).rows
    assert row[1:4] == ("%", "22.3", "20.0 to 30.0")


def _summary(*configurations, scales=(0.8, 1.2, 1.6), spreads=(), loops=()):
    return EnsembleSummary(
        "e", "LHPOST6", 24, {}, {}, ("limits", "strengths"), 0, np.array(scales), spreads, configurations, (), "",
        0.05, loops,
    )  # fmt: skip


def test_a_saturated_limit_is_reached_between_two_scales_and_not_at_the_upper_one():
    """A clipped command is no larger than full spool: between the runs its demand is not known."""
    scales, use = np.array([0.8, 1.2, 1.6]), np.array([[0.5] * 8, [0.8] * 8, [1.0] * 8])
    one = exceedance("spool", critical_scales(use, scales), scales, level=0.05, confidence=0.95)
    found = _summary(Configuration("ridgecrest", "none", "tuned", (one,)))
    assert "The risk of reaching spool is 5 % between the scales 1.2 and 1.6" in ensemble_verdict(found)
    assert risk_table(found).rows[0][1] == "1.2 to 1.6"
    rising = exceedance("push", critical_scales(1.1 * use, scales), scales, level=0.05, confidence=0.95)
    assert rising.risk_after == 0.0 and 1.2 < rising.risk_scale < 1.6


def test_the_scale_of_a_risk_is_rounded_down():
    """5 % "at scale 1.2" stood beside a probability of 17 % at scale 1.2: it was 1.1975."""
    scales = np.array([0.8, 1.2, 1.6])
    use = np.array([[0.6653, *[0.6] * 5], [1.0021, *[0.9] * 5], [1.4, *[1.2] * 5]])
    one = exceedance(ANY, critical_scales(use, scales), scales, level=0.05, confidence=0.95)
    found = _summary(Configuration("ridgecrest", "none", "tuned", (one,)))
    assert "5 % at scale 1.19 (" in ensemble_verdict(found) and risk_table(found).rows[0][1] == "1.19"


def test_results_name_the_one_scale_that_they_are_of():
    rows = [Spread("sine", s, "none", "tuned", "push", "1", np.ones(3), 1.0, 1.0, 8) for s in (0.8, 1.2, 1.6)]
    assert spread_table(rows[1:2]).caption == "Results at scale 1.2"
    assert spread_table(rows).caption == "Results" and "Scale" in spread_table(rows).header


def test_configurations_of_one_risk_are_alike_and_none_is_the_worst():
    scales = np.array([0.8, 1.2, 1.6])
    none, some = (
        exceedance(ANY, critical_scales(np.outer(scales, np.full(8, c)), scales), scales, level=0.05, confidence=0.95)
        for c in (0.1, 0.7)
    )
    configurations = [Configuration("ridgecrest", s, "tuned", (none,)) for s in ("none", "tall_column")]
    assert "All 2 configurations alike:" in ensemble_verdict(_summary(*configurations))
    worse = [*configurations, Configuration("ridgecrest", "block", "tuned", (some,))]
    verdict = ensemble_verdict(_summary(*worse))
    assert "The worst of 3 configurations:" in verdict and "(ridgecrest, specimen block, controller tuned)" in verdict


@pytest.mark.long
def test_the_loop_of_every_specimen_is_in_the_results_and_an_unstable_one_in_the_verdict():
    """The block of the payload of Table 2.2 is not held by gains of the bare table; `run` says the same."""
    loops = loops_of(plan(specimen=[{"name": "none"}, {"name": "block_4_9MN"}]))
    assert loops["loop"][:, 0].tolist() == ["stable", "unstable"]
    loop = LoopOf("block_4_9MN", "tuned", "unstable", str(loops["loop_summary"][1, 0]))
    assert "With specimen block_4_9MN, controller tuned: The control loop is unstable" in ensemble_verdict(
        _summary(loops=(loop,))
    )


@pytest.mark.parametrize(("values", "median"), [([9.0, 60.0], 34.5), ([3.0, 1.0, np.inf], 3.0), ([np.inf] * 4, np.inf)])
def test_the_median_of_an_even_number_of_runs_is_between_the_middle_two(values, median):
    labels = {"motion": ["sine"], "scale": [1.0], "specimen": ["none"], "controller": ["tuned"]}
    (one,) = _spreads(xr.Dataset(coords=labels), "push", "1", np.reshape(values, (1, 1, 1, 1, -1)))
    assert one.quantiles[1] == median and one.most == max(values)


def test_a_file_that_holds_no_ensemble_is_named(tmp_path):
    with pytest.raises(RecordError, match=r"absent\.nc: cannot be read"):
        open_results(tmp_path / "absent.nc")


@pytest.mark.long
def test_the_command_runs_a_plan_and_writes_results_and_a_report(lhpost6, tmp_path, brief):
    (tmp_path / "two.toml").write_text(
        'machines = 4\nscales = [0.2, 0.4]\n[[motion]]\nname = "sine"\noptions = { cycles = 1.0, amplitude = 0.05 }\n'
    )
    ended = lhpost6("ensemble", "two.toml", "--jobs", 1, "--quantities", "tracking,limits,strengths,spectra")
    assert ended.code == 0 and "8 runs on LHPOST6. 0 of 4 machines reach any limit up to scale 0.4" in ended.words
    page = (tmp_path / "out" / "two" / "report.html").read_text()
    assert "Risk against scale" in page and "reaction mass strength" in page
    again = lhpost6("ensemble", "two.toml", "--jobs", 1, "--json", "--quantities", "tracking,limits,strengths,spectra")
    found = json.loads(again.out)
    assert found["runs"] == 8 and found["failures"] == {} and found["scales"] == [0.2, 0.4]
    assert found["spreads"][0]["quantiles"][1] > 0.0
    other = lhpost6("ensemble", "sine", "--machines", 4, "--draw", "sobol", "--scales", "0.1;0.2")
    assert other.code == 2 and "write numbers with commas" in other.err


def test_the_card_of_the_risk_is_of_the_worst_configuration():
    """Three with 10, 40 and 20 % at the second scale; one alone is named without a count."""

    def configuration(name: str, share: float) -> SimpleNamespace:
        at = np.array([0.0, share])
        return SimpleNamespace(
            exceedances=[SimpleNamespace(share=at, low=0.9 * at, high=1.1 * at)],
            motion=name,
            specimen="none",
            controller="own",
        )

    three = [configuration(name, share) for name, share in (("mild", 0.1), ("hard", 0.4), ("fair", 0.2))]
    found = SimpleNamespace(
        runs=9, stopped=0, troubles={}, level=0.05, scales=[0.5, 1.0], configurations=three, shown_spreads=[]
    )
    _, card = _headlines(found, 1, 0)
    assert card.value.startswith("40") and "hard, specimen none" in card.note and card.level == "attention"
    assert card.note.endswith("the worst of 3 configurations")
    found.configurations = three[:1]
    _, card = _headlines(found, 1, 0)
    assert card.value.startswith("10") and card.note.endswith("controller own")
    found.configurations = []
    assert len(_headlines(found, 1, 0)) == 1

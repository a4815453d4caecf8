"""The blind battery's generator: its table obeys mechanics, its cases hide what their labels say and nothing else."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from battery import (
    cases,
    generate,
    hidden,
    machines,
    motions,
    rates,
    reach,
    reporting,
    scoring,
    sensors,
    simulate,
    table,
)
from blind_battery import refuse_other_draw

from lhpost6_pin.data.records import load_record
from lhpost6_pin.identification.calibration.bin_rows import bin_rows, row_by_column
from lhpost6_pin.identification.calibration.sparse_bins import sparse_bins
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.machine.machine_toml import save_machine_toml

pytestmark = pytest.mark.long


def nominal() -> tuple[np.ndarray, np.ndarray]:
    return table.make_table(table.nominal_values(cases.model()), 0.8)


def rates_of(y: np.ndarray, spool: np.ndarray, legs: np.ndarray, platen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    dy, shown, inverse = np.zeros(rates.STATES), np.zeros(rates.SHOWN), np.linalg.inv(table.mass_matrix(platen))
    rates.rates(1.0, y, spool, 2e5 * float(platen[0]["surge"] != 0), legs, platen, inverse, dy, shown)
    return dy, shown


def lively(random: np.random.Generator) -> np.ndarray:
    """A state in the midst of a violent motion, every hidden state away from zero."""
    y = random.normal(0.0, 0.01, rates.STATES)
    y[:12] = random.uniform(0.5, 1.0, 12) * [0.2, 0.15, 0.04, 0.01, 0.01, 0.02, 0.4, 0.3, 0.1, 0.03, 0.02, 0.04]
    y[rates.PA : rates.PB + 4] = random.uniform(2e6, 9e6, 14)
    y[rates.SEAL : rates.SPOOL] = random.uniform(0.2, 0.7, 25)
    y[rates.HEAT : rates.PAST] = 0.5
    return y


@pytest.mark.slow
def test_the_table_at_rest_has_the_pressures_of_the_reports_machine():
    y, spool = simulate.at_rest(*nominal())
    # model.md's static equilibrium, closed form: zero horizontal force, leakage fed by the spool; four digits are given
    assert y[rates.PA : rates.PA + 4] == pytest.approx(5.504e6, rel=2e-4)
    assert y[rates.PB : rates.PB + 4] == pytest.approx(8.601e6, rel=2e-4)
    assert y[rates.PA + 4 : rates.PA + 10] == pytest.approx(2.767e6, rel=2e-4)
    assert spool[0] == pytest.approx(-4.57e-4, rel=1e-3)
    assert spool[4] == pytest.approx(1.91e-4, rel=3e-3)


@pytest.mark.slow
def test_legs_that_leak_hold_as_much_friction_at_rest_as_they_can_push_against():
    legs, platen = nominal()
    held = np.full(25, 0.7)
    rest, _ = simulate.at_rest(legs, platen, held)
    np.testing.assert_array_equal(rest[rates.SEAL : rates.SPOOL], 0.7)
    legs["external_b"][:4] = 8e-11  # leaves 0.9 MPa of the 5.5 in the piston-side chambers
    rest, _ = simulate.at_rest(legs, platen, held)
    np.testing.assert_array_equal(rest[rates.SEAL : rates.SPOOL], 0.35)


@pytest.mark.slow
def test_the_platen_rings_on_its_oil_columns_at_the_known_frequencies():
    legs, platen = nominal()
    legs["seal"] = legs["pad"] = legs["viscous"] = legs["leakage"] = 0.0
    y, closed = simulate.at_rest(*nominal())[0], np.zeros(10)
    matrix = np.empty((26, 26))
    for j in range(26):
        there, here = y.copy(), y.copy()
        step = 1e-6 if j < 12 else 100.0
        there[j] += step
        here[j] -= step
        matrix[:, j] = (rates_of(there, closed, legs, platen)[0] - rates_of(here, closed, legs, platen)[0])[:26]
        matrix[:, j] /= 2 * step
    modes = np.linalg.eigvals(matrix).imag / (2 * np.pi)
    # yaw, X, Y to the digits given, the upright three to the hertz; gravity and struts shift them by some 0.01 Hz
    assert np.sort(modes[modes > 1])[:3] == pytest.approx([9.29, 10.99, 11.74], abs=0.02)
    assert np.sort(modes[modes > 1])[3:] == pytest.approx([35, 37, 46], abs=0.6)


@pytest.mark.slow
def test_the_power_of_all_forces_is_the_rate_of_kinetic_energy():
    legs, platen = nominal()
    legs["seal"] = legs["pad"] = legs["viscous"] = 0.0
    platen["thrust"] = 1.0  # the report's vertical thrust does not conserve energy, nor do masses by direction
    platen["mass_x"] = platen["mass_y"] = platen["mass_z"]
    y = lively(np.random.default_rng(1))
    dy, shown = rates_of(y, np.zeros(10), legs, platen)
    inertia = table.mass_matrix(platen)
    kinetic = y[6:12] @ inertia @ dy[6:12]  # gyroscopic forces do no work
    h = 1e-6
    speeds = (table.lengths(y[:6] + h * dy[:6], legs, platen) - table.lengths(y[:6] - h * dy[:6], legs, platen)) / 2 / h
    cog = np.array([platen[0][f"cog_{axis}"] for axis in "xyz"])
    climb = dy[2] + (table.rotation(y[:6]) @ np.cross(y[9:12], cog))[2]
    power = shown[rates.PULL : rates.PULL + 13] @ speeds - platen[0]["mass_z"] * platen[0]["gravity"] * climb
    assert kinetic == pytest.approx(power, rel=1e-7)  # central differences of 1e-6 s


def every_variant() -> list[tuple[str, str, int]]:
    groups = ("effect", "unknown", "absorbable", "unexcited")
    return [(g, name, i) for g in groups for name, kinds in cases.numbers()[g].items() for i in range(len(kinds))]


@pytest.mark.parametrize(("group", "name", "variant"), every_variant())
def test_every_effect_acts_on_a_lively_table(group, name, variant):
    random = np.random.default_rng(3)
    effect = cases.draw_effect(name, cases.numbers()[group][name], cases.numbers()["strength"], random, 1.0, variant)
    y, spool = lively(random), random.uniform(-0.2, 0.2, 10)
    y[:3] *= 3.5 if group == "unexcited" else 1.0  # into the end stops that no test reaches
    spool[:2] = 1e-3  # two valves near null, for what lives there
    plain, changed = nominal(), nominal()
    hidden.switch_on(effect, *changed, table.LEGS)
    before, after = rates_of(y, spool, *plain), rates_of(y, spool, *changed)
    if name == "transport_delay":
        assert (changed[0]["late"] > 0).any()  # a delay is the loop's, not the right-hand side's
    else:
        assert not all(np.array_equal(b, a) for b, a in zip(before, after, strict=True))


@pytest.mark.parametrize(("exponent", "least"), [(0.7, 1e-6), (1.0, 1e-6), (1.4, 1e-2)])
def test_friction_saturates_at_its_plateau_and_turns_with_the_motion(exponent, least):
    z = 0.0
    for _ in range(2000):
        z += 1e-4 * table.bristle(z, 0.01, 1e-4, exponent)
    assert z == pytest.approx(1.0, abs=least)  # 20 spans of slip
    assert table.bristle(z, -0.01, 1e-4, exponent) < 0


@pytest.mark.parametrize("name", list(cases.numbers()["test"]))
def test_motions_start_and_end_at_rest_and_stay_within_the_stroke(name):
    motion = motions.make_motion(cases.numbers()["test"][name], 5)
    calm = round(motions.CALM * simulate.RATE)
    assert not motion[:calm].any()
    assert np.abs(motion[-calm // 2 :]).max() < 1e-12
    # half strokes of 0.75 m along the legs and of 0.127 m upright, two degrees of tilt
    assert (np.abs(motion).max(axis=0) < [0.5, 0.4, 0.1, 0.03, 0.03, 0.06]).all()


def test_the_same_seed_draws_the_same_cases_in_the_stated_mix():
    first, second = cases.draw_cases(100, 7, campaign="fast"), cases.draw_cases(100, 7, campaign="fast")
    assert [case.label for case in first] == [case.label for case in second]
    assert len({case.id for case in first}) == 100
    sorts = [case.label["sort"] for case in first]
    assert {sort: sorts.count(sort) for sort in set(sorts)} == cases.numbers()["mix"]
    families = {effect.family for case in first if case.label["sort"] == "one" for effect in case.effects}
    assert len(families) == 31  # one of each before any comes again
    assert {case.id for case in first}.isdisjoint(case.id for case in cases.draw_cases(20, 8, campaign="fast"))


@pytest.mark.parametrize("variety", [cases.Variety(anew=True), cases.Variety(fewer=True)])
def test_a_variety_changes_nothing_else_of_a_case(variety):
    """Names, effects and errors are those of the same seed without it."""
    plain, other = (cases.draw_case("one", ("dead_volume",), seed=4, variety=v) for v in (cases.Variety(), variety))
    assert other.effects == plain.effects and other.tests == plain.tests and plain.left_out == ()
    assert {**other.label, "left_out": []} == plain.label
    assert (other.model == plain.model) is (not variety.anew)
    assert bool(other.left_out) is variety.fewer


@pytest.mark.slow
def test_a_table_drawn_anew_is_known_to_its_lab_and_follows_its_motions(tmp_path):
    """With no more error than the nominal table's tenth of the stroke, and its valves short of their limit."""
    nominal = cases.model()
    factors = []
    for seed in range(4):
        case = cases.draw_case("null", seed=seed, campaign="brief", variety=cases.Variety(anew=True))
        changes = machines.changed_values(case.model, nominal)
        path = save_machine_toml(load_machine().with_params(changes), tmp_path / f"{seed}.toml")
        lab = table.nominal_values(table.load_model(path))
        known = table.nominal_values(case.model)
        assert lab.keys() == known.keys()
        for name, entries in known.items():
            for key, value in entries.items():
                if not isinstance(value, str):
                    np.testing.assert_allclose(lab[name][key], value, rtol=1e-12)
        for test in case.tests[seed % 2 :: 2]:  # by turns: four tables, each motion on two of them
            run = generate.run_test(case, test)
            assert np.abs(run.channels.spool).max() < 0.8
            assert np.abs(run.truth()["platen_displacement"] - run.reference).max(axis=0)[:3].max() < 0.02
        factors.append(known["platen"]["mass"][0] / nominal["platen"]["mass"]["value"][0])
    assert np.ptp(factors) > 0.1 and 0.6 <= min(factors) <= max(factors) <= 1.5


@pytest.mark.slow
def test_of_a_third_of_the_sensors_nothing_is_recorded(tmp_path):
    rule, seen = cases.numbers()["left_out"], set()
    for seed in range(30):
        out = cases.draw_case("null", seed=seed, campaign="brief", variety=cases.Variety(fewer=True)).left_out
        assert sum(set(group) <= set(out) for group in rule["groups"]) == rule["count"]
        assert not set(rule["one_of"]) <= set(out)
        seen |= set(out)
    assert seen == {name for group in rule["groups"] for name in group}
    case = cases.draw_case("one", ("added_mass",), seed=1, campaign="brief", variety=cases.Variety(fewer=True))
    home = generate.write_case(replace(case, tests=case.tests[:1]), tmp_path)
    there = load_record(next(home.glob("*.nc")))
    assert set(case.left_out).isdisjoint(there.data_vars)
    gaps = reach.measured_label(replace(case, hold_out=(case.tests[0].name,)))["effects"][0]["gaps"]
    assert set(case.left_out).isdisjoint(gaps) and gaps


def test_bold_parameters_are_three_deviations_off_and_others_within_the_clip():
    nulls = [cases.draw_case("null", seed=seed) for seed in range(40)]
    moves = [np.abs(list(case.label["parameters_sd"].values())) for case in nulls]
    far = [move.max() > 2.9 for move in moves]
    assert 8 <= sum(far) <= 32  # half of forty, four binomial deviations
    assert all(np.all((move <= 2.5) | (move == 3.0)) for move in moves)
    twins = nulls[0].values
    assert twins["component.H1"]["platen_point"][0] == -twins["component.H4"]["platen_point"][0]


def test_no_wrong_parameter_makes_up_for_an_effect_that_acts_as_it_does():
    """Pads that rub twice as much as wrong numbers say, half of the stated ones, rub as stated: nothing is missing."""
    rule = cases.model()["kind.vertical"]["pad_friction"]
    for seed in range(20):
        case = cases.draw_case("one", ("bearing_friction",), seed=seed)
        (effect,) = case.effects
        pads = case.values["kind.vertical"]["pad_friction"]
        whole = pads * (1.0 + effect.fields["pad_extra"]) / rule["value"] - 1.0
        assert pads >= rule["value"] and case.label["parameters_sd"]["kind.vertical.pad_friction"] >= 0.0
        assert len(effect.components) == 1 or whole > 3.4 * rule["rel_sd"]  # beyond what a calibration may change


def test_a_delayed_channel_shows_late_and_a_gain_shows_as_a_gain():
    time = np.arange(8192) / simulate.RATE
    wave = np.sin(2 * np.pi * 2 * time)[:, None]
    true = {name: wave * np.ones(10) for name in ("actuator_displacement", "actuator_force")}
    rule = {**cases.numbers()["sensors"], "noise": {"actuator_displacement": 0.0, "actuator_force": 0.0}}
    faults = (
        sensors.Fault("channel_delay", (("actuator_displacement", 0),), delay=0.004),
        sensors.Fault("length_sensor_error", (("actuator_displacement", 3),), gain=0.05),
    )
    exact = {**rule, "gain": 0.0, "skew": 0.0, "offset": {}}
    drawn = sensors.draw_instruments(exact, np.random.default_rng(0), faults)
    seen = sensors.observe(true, drawn, rule, np.random.default_rng(0))
    middle = slice(200, 1800)
    late = np.sin(2 * np.pi * 2 * (time[::4] - 0.004))
    # 16-bit steps of 3e-5 and the low-pass's ends
    assert seen["actuator_displacement"][middle, 0] == pytest.approx(late[middle], abs=2e-4)
    assert seen["actuator_displacement"][middle, 3] == pytest.approx(1.05 * late[middle], abs=2e-4)
    assert seen["actuator_force"][middle, 0] == pytest.approx(wave[::4, 0][middle], abs=2e-4)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    case = cases.draw_case("one", ("local_viscous",), seed=21, campaign="fast", strength=3.0, variant=0)
    return case, generate.write_case(case, tmp_path_factory.mktemp("battery"))


def test_a_written_case_is_a_campaign_of_valid_records_that_do_not_tell(written):
    case, folder = written
    assert sorted(path.stem for path in folder.iterdir()) == ["EQ", "TX", "TY", "TZ", "WN", "campaign"]
    for test in case.tests:
        record = load_record(folder / f"{test.name}.nc")
        assert record.attrs["kind"] == "measured"
        assert "viscous" not in json.dumps({k: str(v) for k, v in record.attrs.items()})
        platen = record["platen_displacement"].values
        assert np.abs(platen[:50, :3]).max() < 1e-4  # at rest in the control zero-position, noise 6 um
        error = platen - record["reference_displacement"].values
        moved = np.abs(record["reference_displacement"].values).max(axis=0) > 1e-3
        rms = np.sqrt(np.mean(error**2, axis=0) / np.mean(record["reference_displacement"].values ** 2 + 1e-30, axis=0))
        assert rms[moved].max() < 0.2  # tests follow what was asked for
        assert np.abs(record["spool_command"].values).max() < 0.9
        assert record["chamber_pressure_a"].values.min() > 0.5e6


def test_recorded_noise_is_that_of_the_instruments(written):
    _, folder = written
    calm = load_record(folder / "TX.nc")["chamber_pressure_a"].values[10:200]
    floor = sensors.floor_of("chamber_pressure_a", cases.numbers()["sensors"])
    # 190 samples, coloured: the estimate scatters by some 10 %, the colour adds as much
    assert calm.std(axis=0) == pytest.approx(floor, rel=0.5)


def test_velocity_and_acceleration_are_the_derivatives_of_the_displacement(written):
    case, _ = written
    true = generate.run_test(case, case.tests[-1]).truth()
    slope = np.gradient(true["platen_displacement"], 1 / simulate.RATE, axis=0)
    curve = np.gradient(true["platen_velocity"], 1 / simulate.RATE, axis=0)
    inner = slice(100, -100)
    for values, derivative in ((true["platen_velocity"], slope), (true["platen_acceleration"], curve)):
        worst = np.abs(values - derivative)[inner].max(axis=0) / np.abs(derivative).max(axis=0)
        assert worst.max() < 0.02  # central differences of motions up to 50 Hz: (w h)^2 / 6 = 0.4 %, and the held spool


def test_the_label_measures_what_the_effect_does(written):
    case, _ = written
    label = reach.measured_label(case)
    effect = label["effects"][0]
    assert effect["family"] == "local_viscous"
    assert len(effect["components"]) == 1
    # 1.5e5 N s/m at some 0.1 m/s is 1.5e4 N on 168 t, 0.09 m/s2 over a floor of 0.015
    assert 2 < effect["own"] < 20
    assert effect["gap"] > 2
    assert effect["gaps"]["strut_pressure"] < 0.1  # the struts' nitrogen hardly notices
    assert json.loads(json.dumps(label)) == label


def test_half_the_step_gives_the_same_motion(written, monkeypatch):
    case, _ = written
    test = case.tests[-1]
    coarse = generate.run_test(case, test).channels.state
    monkeypatch.setitem(cases.numbers()["integration"], "substeps", 8)
    fine = generate.run_test(case, test).channels.state
    assert np.abs(coarse - fine)[:, :6].max() < 1e-7  # far below the displacement noise of 6e-6
    assert np.abs(coarse - fine)[:, rates.PA : rates.PB + 4].max() < 500.0  # pressure noise is 3 kPa


def test_a_label_touched_after_sealing_is_found_out(tmp_path):
    labels = [case.label for case in cases.draw_cases(6, 9, campaign="fast")]
    generate.seal(labels, tmp_path)
    assert generate.unseal(tmp_path) == {label["id"]: label for label in labels}
    path = tmp_path / "sealed" / "labels.json"
    salted = json.loads(path.read_text())
    salted[labels[2]["id"]]["label"]["verdict"] = "none of it"
    path.write_text(json.dumps(salted))
    with pytest.raises(ValueError, match=labels[2]["id"]):
        generate.unseal(tmp_path)


def told(verdict: str, *names: str) -> dict:
    return {"verdict": verdict, "effects": [{"family": n, "components": []} for n in names], "closure": {}}


def labelled(sort: str, accept: str, *effects: tuple[str, float], decoys: tuple[str, ...] = ()) -> dict:
    hidden = [
        {"family": n, "components": [], "gap": gap, "offset": 0.0, "owns": {"acceleration": gap, "pressure_rate": gap}}
        for n, gap in effects
    ]
    return {"sort": sort, "accept": [accept], "effects": hidden, "decoys": [{"family": n} for n in decoys]}


def test_closure_is_counted_over_all_phases_and_where_the_gap_is_widest():
    def gap(refitted: float, closure: float | None) -> dict:
        return {"EQ": {"refitted": refitted, "after": 1.0, "closure": closure}}

    label = labelled("one", "named", ("backlash", 3.0))
    phases = ({"inverse dynamics": gap(1.3, 0.1), "open loop": gap(9.0, 0.9)}, {"open loop": gap(2.0, -0.2)})
    found = scoring.score([(label, {**told("named", "backlash"), "closure": phase}) for phase in phases])
    assert found["median closure on held-out tests"] == 0.1  # of 0.1, 0.9, -0.2
    assert found["the same where a case's gap is widest"] == pytest.approx(0.35)  # of 0.9 and -0.2
    assert found["held-out tests that got worse"] == (1, 3)


def test_closure_counts_where_the_effect_shows():
    """A null of a valve changes no wrench; a lag of a spool is measured with it."""
    null, lag = (labelled("one", "named", (name, 3.0)) for name in ("spool_null_bias", "spool_lag"))
    null["effects"][0]["owns"]["acceleration"] = 0.0
    phases = ("inverse dynamics", "open loop", "closed loop")
    assert [scoring.shows(null, phase) for phase in phases] == [False, True, True]
    assert [scoring.shows(lag, phase) for phase in phases] == [False, False, True]


@pytest.mark.parametrize("gap", [0.05, 3.0])
def test_closure_of_a_case_without_figures_by_channel_counts_where_its_gap_shows(gap):
    label = labelled("one", "named", ("spool_lag", gap))
    del label["effects"][0]["owns"]
    assert scoring.shows(label, "inverse dynamics") is (gap > scoring.SHOWS)


def test_components_are_scored_where_an_effect_has_a_place():
    label = labelled("two", "named", ("backlash", 3.0), ("gravity_offset", 4.0))
    label["effects"][0]["components"] = ["H1"]
    answer = told("named", "backlash", "gravity_offset")
    for there, right in (("H1", 1), ("H2", 0)):
        answer["effects"][0]["components"], answer["effects"][1]["components"] = [there], ["platen"]
        assert scoring.score([(label, answer)])["components right where named"] == (right, 1)


def test_scores_count_what_was_named_and_what_was_not():
    pairs = [
        (labelled("null", "none"), told("none")),
        (labelled("null", "none"), told("named", "backlash")),
        (labelled("one", "named", ("backlash", 3.0)), told("named", "backlash")),
        (labelled("two", "named", ("backlash", 20.0), ("quadratic_drag", 0.7)), told("named", "backlash")),
        (labelled("one", "named", ("valve_deadband", 0.6)), told("none")),  # below the floor: not asked for
        (labelled("unexcited", "none", decoys=("backlash",)), told("named", "backlash")),
        (labelled("unknown", "unexplained"), told("unexplained")),
    ]
    found = scoring.score(pairs)
    assert found["false name on nulls"] == (1, 2)
    exact = [found[f"exact set, {count}"] for count in ("one effect", "two effects")]
    assert (found["family first"], *exact) == ((2, 2), (1, 1), (0, 1))
    assert found["unexcited, nothing else named"] == (1, 1)
    assert math.isnan(found["median closure on held-out tests"])  # no case says
    assert (found["none of the above, named"], found["none of the above, flagged"]) == ((0, 1), (1, 1))
    curve = {words: share for words, share in scoring.strength_curve(pairs).items() if share.of}
    assert curve == {"0.5 to 1": (0, 2), "2 to 4": (1, 1), "10 to 100": (1, 1)}
    assert scoring.wilson(5, 10) == pytest.approx((0.2366, 0.7634), abs=1e-4)  # a worked value of Wilson's score


def test_stated_probabilities_are_held_against_what_was_right():
    right, wrong = told("named", "backlash"), told("ambiguous", "quadratic_drag")
    right["effects"][0]["probability"], wrong["effects"][0]["probability"] = 0.95, 0.6
    label = labelled("one", "named", ("backlash", 3.0))
    assert scoring.reliability([(label, right), (label, wrong)]) == {"0.5 to 0.7": (0, 1), "0.9 to 0.99": (1, 1)}


def test_the_page_of_a_battery_begins_with_its_figure_and_commits_and_is_the_same_however_often_it_is_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    from battery.curves import draw_curves

    strength = {"1 to 2": scoring.Share(0, 0), "above 100": scoring.Share(8, 9)}
    names = {"0.5 to 0.7": scoring.Share(3, 5)}
    draw_curves(strength, names, tmp_path / "scores.svg")
    drawn = (tmp_path / "scores.svg").read_bytes()
    draw_curves(strength, names, tmp_path / "scores.svg")
    assert (tmp_path / "scores.svg").read_bytes() == drawn
    draw_curves(strength, {"0.5 to 0.7": scoring.Share(4, 5)}, tmp_path / "others.svg")
    assert (tmp_path / "others.svg").read_bytes() != drawn
    for case, commit in (("a", "1fd1686"), ("b", "abd0a4f-dirty"), ("c", "1fd1686")):
        (tmp_path / case).mkdir()
        (tmp_path / case / "commit.txt").write_text(commit)
    reporting.publish("| metric |", tmp_path, tmp_path / "scores.md", "Scores", "command", "What it shows")
    _, _, picture, _, how, *_ = (tmp_path / "scores.md").read_text().splitlines()
    assert picture == "![What it shows](scores.svg)"
    assert "(commit 1fd1686, abd0a4f-dirty)" in how  # those that its cases were searched at


def test_a_miss_is_listed_with_the_reason_of_the_last_round():
    label = labelled("two", "named", ("backlash", 20.0), ("quadratic_drag", 0.7))
    seen = [
        {"family": "quadratic_drag", "refused": why, "gain": gain} for why, gain in (("", 9.0), ("too little", 7.0))
    ]
    answer = {**told("named", "backlash"), "considered": [[one] for one in seen], "withdrawn": []}
    assert scoring.misses(label, answer) == [("quadratic_drag", 0.7, "too little (gain 7)")]
    answer["withdrawn"] = [{"family": "quadratic_drag", "why": "held_out"}]
    assert scoring.misses(label, answer)[0][2] == "withdrawn: held_out"
    blind = {**answer, "withdrawn": [], "considered": [], "not_testable": ["quadratic_drag"]}
    assert scoring.misses(label, blind)[0][2] == "not testable with the sensors that were left"
    assert scoring.misses(labelled("null", "none"), told("none")) == []


def test_baselines_see_the_columns_of_all_residuals():
    rng = np.random.default_rng(0)
    bins = rng.normal(size=(4, 3, 2)) + 1j * rng.normal(size=(4, 3, 2))
    bins[:, 1, 0] = 0.0
    for k in range(2):
        seen = bin_rows([sparse_bins(bins)], 3).times(np.eye(2)[k])
        np.testing.assert_array_equal(seen.ravel(), row_by_column(bins[..., k], np.ones((4, 3))).ravel())


def test_a_folder_of_another_draw_is_refused(tmp_path):
    refuse_other_draw(tmp_path, "--cases 3 --seed 1")
    refuse_other_draw(tmp_path, "--cases 3 --seed 1")  # resumes
    with pytest.raises(SystemExit, match=r"another draw \(--cases 3 --seed 1\): choose another --out"):
        refuse_other_draw(tmp_path, "--cases 5 --seed 1")  # cases of the same names, but other effects
    (tmp_path / "unknown").mkdir()
    (tmp_path / "unknown" / "seals.txt").touch()
    with pytest.raises(SystemExit, match="unknown"):
        refuse_other_draw(tmp_path / "unknown", "--cases 3 --seed 1")

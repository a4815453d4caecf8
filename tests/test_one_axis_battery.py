"""The one-axis battery: its table obeys mechanics and agrees with the package, its cases are what their labels say."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from battery import one_axis, one_axis_cases, one_axis_files, reporting, scoring
from battery.one_axis import PA, PB, SPOOL, Table, V, X, at_rest, march, rates
from battery.simulate import RATE
from scipy.integrate import cumulative_simpson

from lhpost6_pin.data.campaign import load_campaign
from lhpost6_pin.data.measured_sensors import find_sensors
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.discovery import discover
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.simulation.simulate import OpenLoop, simulate

pytestmark = pytest.mark.long

STEP = 1.0 / (RATE * one_axis.SUBSTEPS)
PLAIN = Table(
    mass=1200.0,
    area=2.0e-3,
    chamber_a=0.16,
    chamber_b=0.15,
    bulk=9e8,
    supply=14e6,
    back=0.2e6,
    valve=0.8 * 2.0e-3 / math.sqrt(6.9e6),
    leakage=1e-12,
    lag=2e-3,
    delay=20 * STEP,
    friction=500.0,
    span=4e-5,
    viscous=900.0,
)
SMOOTH = PLAIN._replace(friction=1e-9, chamber_a=2.0, chamber_b=2.0)  # a bristle without force


def waves(samples: int, size: float = 0.2) -> np.ndarray:
    """A smooth spool command (n,) that rises from zero."""
    t = np.arange(samples) / RATE
    rise = np.clip(t / 0.3, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(t / 0.3, 0.0, 1.0))
    return size * rise * (np.sin(2 * np.pi * 2.3 * t) + 0.4 * np.sin(2 * np.pi * 7.1 * t + 1.0))


def driven(
    table: Table, command: np.ndarray, substeps: int = one_axis.SUBSTEPS, pressure: float | None = None
) -> one_axis.Run:
    """One run in open loop, from chambers at half the supply or at a given pressure."""
    y = at_rest(table, 1)
    y[PA] = y[PB] = y[PA] if pressure is None else pressure
    run = march(table, y, len(command), lambda k, _: command[k : k + 1], substeps=substeps)
    return one_axis.Run(run.y[:, :, 0], run.acceleration[:, 0], run.command[:, 0])


def chamber_energy(pressure: np.ndarray, volume: np.ndarray, bulk: float) -> np.ndarray:
    """Elastic energy of the oil in a chamber: its density grows as exp(P / bulk)."""
    return volume * (bulk * np.expm1(pressure / bulk) - pressure)


@pytest.mark.slow
def test_steady_velocity_at_a_constant_opening_is_that_of_the_closed_form():
    table, opening = PLAIN._replace(leakage=0.0, viscous=6000.0, chamber_a=2.0, chamber_b=2.0), 0.3
    run = driven(table, np.full(round(2.5 * RATE), opening))
    # v = k w / A sqrt((P_s - P_r - (F_c + c v) / A) / 2), a quadratic equation of v
    half = 0.5 * (table.valve * opening / table.area) ** 2
    drop, slope = half * (table.supply - table.back - table.friction / table.area), half * table.viscous / table.area
    steady = 0.5 * (-slope + math.sqrt(slope**2 + 4.0 * drop))
    assert run.y[-1, V] == pytest.approx(steady, rel=1e-6)  # oscillations have died to that
    assert run.y[-1, PA] + run.y[-1, PB] == pytest.approx(table.supply + table.back, rel=1e-5)


@pytest.mark.slow
def test_an_overlapped_spool_off_its_null_opens_by_what_is_left():
    table = PLAIN._replace(leakage=0.0, viscous=6000.0, chamber_a=2.0, chamber_b=2.0)
    plain = driven(table, np.full(round(2.5 * RATE), 0.3))
    other = driven(table._replace(null=-0.02, overlap=0.05), np.full(round(2.5 * RATE), 0.37))
    assert other.y[-1, V] == pytest.approx(plain.y[-1, V], rel=1e-6)


def test_a_slow_slide_meets_coulomb_friction_and_stribecks_fall_of_it():
    table = PLAIN._replace(stribeck=400.0, stribeck_speed=0.01, viscous=0.0, exponent=1.0)
    for v in (1e-3, 8e-3, 0.1):
        s = 0.0
        for _ in range(4000):  # steps of a hundredth of a span
            s += 0.01 * table.span / v * one_axis.slip(table, np.array(v), np.array(s))
        expected = table.friction + table.stribeck * math.exp(-((v / 0.01) ** 2))
        assert table.friction * s == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_energy_that_the_valve_brings_is_stored_or_lost():
    table = PLAIN._replace(viscous=1500.0, leakage=5e-12, exponent=1.3, null=0.004, overlap=0.01, lag=0.03)
    held = np.repeat([0.2, -0.3, 0.0], round(0.4 * RATE))  # powers have no kinks but at these steps and where v turns
    run = driven(table, held)
    x, v, a, b, s, spool = run.y.T
    flow_a, flow_b = one_axis.valve_flows(table, spool, a, b)
    high, low = (table.bulk * np.expm1(p / table.bulk) for p in (a, b))
    drag = table.friction * s * v + table.viscous * v**2
    power = high * flow_a + low * flow_b - drag - (high - low) * table.leakage * (a - b)
    volumes = table.area * (table.chamber_a + x), table.area * (table.chamber_b - x)
    stored = 0.5 * table.mass * v**2 + sum(
        chamber_energy(p, w, table.bulk) for p, w in zip((a, b), volumes, strict=True)
    )
    brought = cumulative_simpson(power, dx=1.0 / RATE, initial=0.0)
    through = np.sum(np.abs(drag)) / RATE
    # parabolas through powers at 2048 Hz, of which the oil column turns in tens of milliseconds
    assert np.abs(stored - stored[0] - brought).max() < 2e-4 * through


@pytest.mark.parametrize(("table", "mean", "order"), [(SMOOTH, 0.4, 3.7), (PLAIN, 0.0, 0.9)])
@pytest.mark.slow
def test_halving_the_step_converges(table, mean, order):
    """Order four where all is smooth; friction and a valve turn at instants that no step hits, which costs orders."""
    ends = []
    spool = waves(round(0.7 * RATE)) + mean * np.minimum(np.arange(round(0.7 * RATE)) / RATE / 0.3, 1.0)
    for substeps in (2, 4, 8, 16):
        delay = round(table.delay * RATE) / RATE  # a whole number of the coarsest steps
        ends.append(driven(table._replace(delay=delay), spool, substeps).y[:, X])
    errors = [np.abs(one - ends[-1]).max() for one in ends[:-1]]
    assert math.log2(errors[0] / errors[1]) > order
    assert errors[1] < 1e-8  # of the step in use, far below a displacement's noise of some micrometres


def machine_of(table: Table, folder) -> object:
    """The package's machine with exactly these numbers."""
    case = one_axis_cases.draw_case("null", 5, "brief")
    rated = 0.5 * (table.supply - table.back)
    small = 1e-5  # a flow curve this flat is a straight line
    exact = {
        "mass": table.mass,
        "bulk_modulus": table.bulk,
        "flow": table.valve * math.sqrt(rated) / -math.expm1(-small),
        "leakage": table.leakage,
        "chamber_a": table.chamber_a,
        "chamber_b": table.chamber_b,
        "valve_delay": table.delay,
        "seal_friction": table.friction,
        "seal_yield": table.span,
        "viscous": table.viscous,
        "supply_pressure": table.supply,
        "return_pressure": table.back,
        "rated_pressure": rated,
        "area": table.area,
    }
    path = folder / "machine.toml"
    path.write_text(one_axis_files.machine_text(replace(case, stated=exact, stroke=0.14)))
    return load_machine(path, {"drive.flow_curve": small})


@pytest.mark.parametrize(("friction", "position", "pressure"), [(0.0, 1e-6, 3e3), (500.0, 2e-5, 8e4)])
def test_the_packages_simulation_of_the_same_table_agrees(tmp_path, friction, position, pressure):
    """In open loop with a null bias, along the same spool, whose mean over each sample the package is given.

    Without friction only numbers differ: the package's half-implicit steps of order two at 8192 Hz, and a spool that it
    holds over a sample. With it the shape of presliding differs, over a fraction of the span of 40 um.
    """
    table = PLAIN._replace(friction=friction, null=0.003)
    machine = machine_of(table, tmp_path).with_effect("spool_null_bias", bias=table.null)
    plant = make_plant(machine)
    rest = find_equilibrium(plant)
    assert rest.spool[0] == pytest.approx(-table.null, abs=1e-6)
    command = waves(round(2 * RATE)) - table.null
    columns = {PA: "actuators_4_way.A1.pressure_a", PB: "actuators_4_way.A1.pressure_b"}
    columns = {row: plant.states.index(name) for row, name in columns.items()}
    level = rest.state.z[columns[PA]]  # a closed valve leaves it open
    assert rest.state.z[columns[PB]] == pytest.approx(level, rel=1e-6)
    own = driven(table._replace(friction=max(friction, 1e-9)), command, pressure=level)
    late = round(table.delay * RATE)
    arrived = np.concatenate([np.full(late, command[0]), command])[: len(command) - 1]
    spool = arrived - table.lag * RATE * np.diff(own.y[:, SPOOL])  # mean of T du/dt = command - u over a sample
    other = simulate(plant, OpenLoop(spool[:, None], rest.state), samples=len(spool))
    assert other.trouble is None
    assert np.abs(own.y[:, X]).max() > 0.01
    assert np.abs(other.q[:, 0] - own.y[:-1, X]).max() < position
    for row, column in columns.items():
        assert np.abs(other.z[:, column] - own.y[:-1, row]).max() < pressure


def test_the_same_seed_draws_the_same_cases_in_the_stated_mix():
    cases = one_axis_cases.draw_cases(12, 3, "brief")
    again = one_axis_cases.draw_cases(12, 3, "brief")
    assert [case.label for case in cases] == [case.label for case in again]
    assert sorted(case.label["hides"] for case in cases) == ["null"] * 6 + ["null_bias"] * 3 + ["stribeck"] * 3
    assert {c.label["hides"] for c in one_axis_cases.draw_cases(3, 3, "brief", "null_bias")} == {"null_bias"}


def test_what_a_lab_states_is_wrong_within_its_deviations_and_noise_within_a_factor_of_two():
    rule = one_axis_cases.numbers()["prior"]
    kinds = set()
    for case in one_axis_cases.draw_cases(40, 4, "brief"):
        assert set(case.sensors.channels) >= {"platen_displacement", "valve_command"}
        kinds.add(tuple(sorted(case.sensors.channels)))
        for key, ratio in case.label["true_over_stated"].items():
            sd = rule["rel_sd"][key.removesuffix("_a").removesuffix("_b")]
            assert abs(ratio - 1.0) <= rule["within"] * sd + 1e-3  # rounded in the label
        assert all(0.499 <= ratio <= 2.001 for ratio in case.label["noise_stated_over_true"].values())
        if case.label["hides"] == "null":
            assert case.table == case.plain
    assert len(kinds) == 6  # three measures of force, with and without an accelerometer


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    cases = [one_axis_cases.draw_case(sort, seed, "brief") for sort, seed in (("stribeck", 11), ("null_bias", 12))]
    folder = tmp_path_factory.mktemp("one_axis")
    return cases, one_axis_files.write_cases(cases, folder), folder


def test_a_written_case_is_a_campaign_that_the_package_reads_and_that_does_not_tell(written):
    cases, labels, folder = written
    for case, label in zip(cases, labels, strict=True):
        home = folder / case.id
        machine, sensors = load_machine(home / "machine.toml"), load_sensors(home / "sensors.toml")
        campaign = load_campaign(home, machine)
        assert [r.attrs["test"] for r in campaign.records] == sorted(case.references)
        told = {path.name: path.read_text() for path in home.glob("*.toml")}
        told |= {str(r.attrs["test"]): json.dumps({k: str(v) for k, v in r.attrs.items()}) for r in campaign.records}
        assert not [name for name, text in told.items() if "stribeck" in text or "null" in text]
        assert set(sensors.noise) == set(case.sensors.channels)
        for record in campaign.records:
            assert set(record.data_vars) == {*case.sensors.channels, "reference_displacement"}
            moved, asked = (record[f"{which}_displacement"].values[:, 0] for which in ("platen", "reference"))
            assert np.std(moved - asked) < 0.2 * np.std(asked)  # tests follow what was asked for
            assert np.abs(record["valve_command"].values).max() < 0.95
        assert max(label["effects"][0][size] for size in ("gap", "offset")) > 1.0  # over the noise
        assert json.loads(json.dumps(label)) == label


def test_recorded_noise_is_that_of_the_sensors(written):
    cases, _, folder = written
    share = math.sqrt(one_axis_cases.numbers()["sensors"]["low_pass"] / (RATE / 2))  # that a low-pass leaves
    for case in cases:
        record = load_campaign(folder / case.id, load_machine(folder / case.id / "machine.toml")).records[0]
        calm = record["platen_displacement"].values[: round(0.4 * case.sensors.rate), 0]
        own = case.sensors.channels["platen_displacement"]
        floor = math.hypot(own.noise * share, 2 * own.span / 2**16 / math.sqrt(12))
        # some 80 independent samples, coloured noise, a table that creeps against its friction
        assert calm.std() == pytest.approx(floor, rel=0.5)


def test_sensors_err_as_stated():
    case = one_axis_cases.draw_case("null", 21, "brief")
    t = np.arange(8192) / RATE
    sine = np.sin(2 * np.pi * 2 * t) * np.clip(t - 0.6, 0, 1)
    name = "pressure_difference"
    channel = one_axis_cases.Channel(noise=0.0, span=2.0, gain=0.05, offset=0.1, late=0.004)
    sensors = one_axis_cases.Sensors(512, {name: channel})
    seen = one_axis_files.observe({name: sine}, sensors, np.random.default_rng(0))[name]
    late = 1.05 * np.interp(t[::4] - 0.004, t, sine) + 0.1
    middle = slice(50, -100)
    assert seen[middle] == pytest.approx(late[middle], abs=5e-4)  # converter steps of 6e-5, the low-pass at two kinks
    assert case.sensors.channels["platen_displacement"].gain == 0.0


def test_a_test_that_would_cavitate_is_made_smaller():
    case = one_axis_cases.draw_case("null", 33, "brief")
    wild = {"WN": 5.0 * case.references["WN"], "TRI": case.references["TRI"]}
    (tamed,), runs = one_axis_files.run_cases([replace(case, references=wild)])
    shrunk = np.abs(tamed.references["WN"]).max() / np.abs(wild["WN"]).max()
    steps = math.log(shrunk) / math.log(one_axis_cases.numbers()["limit"]["shrink"])
    assert 0.5 < steps == pytest.approx(round(steps))
    assert tamed.references["TRI"] is wild["TRI"]
    for run in runs.values():
        assert run.y[:, (PA, PB)].min() > one_axis_cases.numbers()["limit"]["least_pressure"]


@pytest.mark.slow
def test_overlap_is_found_though_a_refit_without_it_ends_far_off(tmp_path):
    """About that refit no small addition of overlap helps, and nothing was named; about the stated numbers it does."""
    case = one_axis_cases.draw_case("null", np.random.SeedSequence(1).spawn(1)[0], "brief")
    one_axis_files.write_cases([replace(case, table=case.table._replace(overlap=0.02))], tmp_path)
    home = tmp_path / case.id
    machine = load_machine(home / "machine.toml")
    campaign = load_campaign(home, machine)
    sensors = find_sensors(machine, campaign.records, home / "sensors.toml")
    found = discover(machine, campaign, sensors, phases=(1,), propose=False)
    refitted = found.search.refit
    assert replace(found.search, problem=refitted.normal.problem, solution=refitted).power > 100.0
    (overlap,) = found.verdict.effects
    assert overlap.family == "valve_deadband"
    assert overlap.parameters["overlap"].value == pytest.approx(0.02, rel=0.1)


def test_scores_tell_what_was_found_from_what_was_named_wrongly():
    from one_axis_battery import shares

    def answer(*names: str) -> dict:
        return {"effects": [{"family": name, "components": ["A1"]} for name in names]}

    def label(hides: str, *names: str) -> dict:
        effects = [{"family": name, "components": ["A1"]} for name in names]
        return {"hides": hides, "effects": effects, "channels": ["actuator_force"]}

    found = shares(
        [
            (label("null"), answer("backlash")),
            (label("null"), answer()),
            (label("stribeck", "stribeck_friction"), answer("stribeck_friction", "backlash")),
            (label("null_bias", "spool_null_bias"), answer()),
        ]
    )
    assert found["a false name, null"] == scoring.Share(1, 2)
    assert found["a false name, stribeck"] == (1, 1)
    assert found["found"] == (1, 2)
    assert found["found, stribeck"] == (1, 1)
    assert found["found, null_bias"] == (0, 1)
    assert rates(PLAIN, at_rest(PLAIN, 1), np.zeros(1))[SPOOL] == 0.0


def test_a_check_of_a_battery_says_what_is_wrong():
    def case(sort: str, *hidden: str) -> dict:
        effects = [{"family": name, "components": [], "gap": 9.0, "offset": 0.0} for name in hidden]
        return {"sort": sort, "accept": [], "effects": effects, "decoys": []}

    def answer(*names: str) -> dict:
        return {"verdict": "named", "effects": [{"family": n, "components": []} for n in names], "closure": {}}

    labels = {"a": case("null"), "b": case("one", "stribeck_friction")}
    right = {"a": (labels["a"], answer()), "b": (labels["b"], answer("stribeck_friction"))}
    assert reporting.wrong(labels, right, "family first", 0.5) == ""
    assert "no verdict on b" in reporting.wrong(labels, {"a": right["a"]}, "family first", 0.5)
    false = {**right, "a": (labels["a"], answer("backlash"))}
    assert "lack nothing" in reporting.wrong(labels, false, "family first", 0.5)
    missed = {**right, "b": (labels["b"], answer())}
    assert "too few right names" in reporting.wrong(labels, missed, "family first", 0.5)

"""The standard tests, run on every law: compiled code, rates and steps, energy, attributes, modifiers."""

import sys
from itertools import pairwise
from typing import Any

import generate_dispatch
import numpy as np
import pytest
from law_cases import (
    ACTUATORS,
    BY_PATH,
    CASES,
    DOUBLE,
    EXACT,
    KERNELS,
    MODIFIERS,
    OIL_CASES,
    OWN,
    PASSIVE,
    PORTS,
    SINGLE,
    SUPPLY,
    WITH_STATES,
    WITHOUT_POTENTIAL,
    Case,
    drawn,
    effect_of,
    module_of,
    s_at,
    sd_at,
    takes,
)
from scipy.integrate import solve_ivp

from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.effects import actuator, evaluate
from lhpost6_pin.effects import supply as shared
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.effects.modifiers import added_inertias, command_path, supply_of, thrust_shares
from lhpost6_pin.effects.registry import LAWS, parameters_of, shapes_of, states_of
from lhpost6_pin.effects.table import effect_table, state_names
from lhpost6_pin.laws.contract import parameter_sizes, parameter_units
from lhpost6_pin.laws.hydraulic import leak_flows, valve_flows
from lhpost6_pin.laws.platen_body import MoreInertia
from lhpost6_pin.laws.supply import varies
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.simulation.energy import row_power

pytestmark = pytest.mark.long


def over(cases: tuple[Case, ...]) -> pytest.MarkDecorator:
    """Run a test on cases."""
    return pytest.mark.parametrize("case", cases, ids=str)


def own(case: Case, of: str, t: float, z: np.ndarray, dt: float = 1e-3, work: float = 0.0) -> np.ndarray:
    """What the law's own function says, as plain Python, of its row in the motion at t."""
    row, function = case.rows[-1], getattr(module_of(case.law), of)
    s, sd, numbers = s_at(t), sd_at(t), [int(row[name]) for name in ("port", "port_2", "port_3")]
    of_ports = {"s": s, "v": sd, "d": dt * sd}
    said: dict[str, Any] = {"p": parameters_of(row), "dt": dt, "planar": numbers[1] >= 0, "work": work}
    for end, number in zip(("", "_2", "_3"), numbers, strict=True):
        said |= {f"{name}{end}": x[number] if number >= 0 else 0.0 for name, x in of_ports.items()}
    if case.attributes.states:
        said |= zip(case.attributes.states, z[states_of(row)].tolist(), strict=True)
    if case.on:
        said["load"] = z[0] * case.on.area_a - (z[1] * case.on.area_b if case.on.area_b else 0.0)
    return np.atleast_1d(function.py_func(*(said[name] for name in takes(function))))


# -------------------------------------------------------------------------------------------- the table of laws
def test_every_law_has_a_case():
    assert {c.law for c in CASES} | set(MODIFIERS) == set(LAWS)
    assert set(MODIFIERS) == {name for name, law in LAWS.items() if law.modifies}
    for name, p in [*((c.law, c.p) for c in CASES), *MODIFIERS.items()]:
        assert type(p) is LAWS[name].parameters


def test_the_generated_dispatch_is_that_of_the_laws(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "argv", ["generate_dispatch.py", "--check"])
    assert generate_dispatch.main() == 0


@pytest.mark.parametrize("law", LAWS)
def test_parameters_have_units_and_must_be_finite(law: str):
    units = parameter_units(LAWS[law])
    stated = [n for n in LAWS[law].parameters._fields if n not in LAWS[law].parameters._field_defaults]
    assert all(unit for _, unit in units) and len(units) == sum(parameter_sizes(LAWS[law])[n] for n in stated)
    spools = (0,) if LAWS[law].takes_spool else ()
    for k in range(len(units)):
        numbers = [1.0] * len(units)
        Effect("x", law, ("leg",), (tuple(numbers),), "test", spools)
        for wrong in (np.nan, np.inf):
            numbers[k] = wrong
            with pytest.raises(ParameterError, match=r"x on leg.*not finite"):
                Effect("x", law, ("leg",), (tuple(numbers),), "test", spools)


@over(CASES)
def test_attributes_of_a_law_are_true(case: Case):
    law, module = case.attributes, None if case.attributes.modifies else module_of(case.law)
    assert law.inlined == (case.law in {e.law for e in load_machine().effects if e.name != "bumper"})  # the report's
    assert law.takes_spool == (case.law == "hydraulic")
    if law.modifies or law.takes_spool:
        return
    of_force, of_step = (set(takes(f)) if (f := getattr(module, n, None)) else set() for n in ("force", "advance"))
    assert law.feels_load == ("load" in of_force)
    assert law.acts_on_gas == ("gas_length" in case.p._fields)
    assert not law.friction_memory or not {"v", "dt"} & (of_force | of_step)
    assert not law.follows_motion or "dt" in of_step
    assert bool(law.states) == hasattr(module, "rates") == hasattr(module, "advance")
    force = case.forces(s_at(0.1), sd_at(0.1), case.z)[0]
    if law.acts_on_gas:
        double = case.p._replace(pressure=2.0 * case.p.pressure)
        np.testing.assert_array_equal(Case(case.law, double).forces(s_at(0.1), sd_at(0.1), case.z)[0], 2.0 * force)
    if law.feels_load:
        unloaded = case.z.copy()
        unloaded[: case.pressures] = 0.0
        assert force.any() and not case.forces(s_at(0.1), sd_at(0.1), unloaded)[0].any()


# ------------------------------------------------------------------------------------------------- compiled code
@pytest.mark.parametrize("kernel", KERNELS)
def test_the_compiled_kernel_equals_its_python_original(kernel: str):
    rng = np.random.default_rng(1)
    # exp, tanh, pow of the compiler's library may differ in the last bit; cancellation multiplies it a little, and an
    # integral in steps repeats it in each
    tolerance = 1e-11 if kernel in ("bulk.enthalpy_of", "hydraulic.oil_enthalpy", "hydraulic.stored_energy") else 1e-12
    for _ in range(200):
        arguments = drawn(kernel, rng)
        found, expected = KERNELS[kernel](*arguments), KERNELS[kernel].py_func(*arguments)
        np.testing.assert_allclose(found, expected, rtol=tolerance, atol=1e-13)


@over(OWN)
def test_a_row_calls_its_law_with_what_it_asks_for(case: Case):
    t, z = 0.1, case.z
    force, total = case.forces(s_at(t), sd_at(t), z)
    expected = own(case, "force", t, z)
    np.testing.assert_allclose(force[: expected.size], expected, rtol=1e-13)  # rounding of a power
    on_ports = np.zeros(len(PORTS))
    for k, name in enumerate(("port", "port_2", "port_3")):
        if case.rows[-1][name] >= 0:
            on_ports[case.rows[-1][name]] += force[k]
    if case.on:
        on_ports[0] += z[0] * case.on.area_a - (z[1] * case.on.area_b if case.pressures > 1 else 0.0)
    np.testing.assert_allclose(total, on_ports, rtol=1e-13)
    dissipated, stored = row_power(case.rows[-1], s_at(t), z, 7.0, case.spool, case.supply)[1:]
    own_power = own(case, "power", t, z, work=7.0) if hasattr(module_of(case.law), "power") else (-7.0, 0.0)
    np.testing.assert_allclose((dissipated, stored), own_power, rtol=1e-12)
    if case.attributes.states:
        at, after = states_of(case.rows[-1]), z.copy()
        evaluate.advance_states(case.rows, s_at(t), 1e-3 * sd_at(t), 1e-3, case.spool, case.supply, after)
        np.testing.assert_allclose(after[at], own(case, "advance", t, z), rtol=1e-12)
        np.testing.assert_allclose(case.rates(t, z)[at], own(case, "rates", t, z), rtol=1e-12)


@over((*ACTUATORS, *OIL_CASES))
def test_the_compiled_actuator_equals_its_python_original(case: Case):
    plain, s, sd = case.rows.view(np.recarray), s_at(0.1), sd_at(0.1)  # Python reads a record's fields by attribute
    pressures = shared.supply_pressures(case.supply, case.z)
    np.testing.assert_array_equal(pressures, shared.supply_pressures.py_func(case.supply, case.z))
    one, other = case.z.copy(), case.z.copy()
    actuator.advance_modified(case.rows[0], s, 1e-3 * sd, 1e-3, case.spool, pressures, one)
    actuator.advance_actuator.py_func(plain[0], True, s, 1e-3 * sd, 1e-3, case.spool, pressures, other)
    np.testing.assert_allclose(one, other, rtol=1e-12)  # rounding
    one, other = np.zeros_like(one), np.zeros_like(one)
    actuator.fill_rates(case.rows[0], s, sd, case.spool, *pressures, case.z, one)
    actuator.fill_rates.py_func(plain[0], s, sd, case.spool, *pressures, case.z, other)
    np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-9)  # rounding of small differences of flows
    one, other = case.z.copy(), case.z.copy()
    if varies(case.supply):
        before = shared.open_supply(case.rows, case.spool, case.supply, 1e-3, one)
        python = shared.open_supply.py_func(plain, case.spool, case.supply, 1e-3, other)
        np.testing.assert_allclose(before, python, rtol=1e-12)
        shared.close_supply(case.rows, case.spool, case.supply, 1e-3, before, one)
        shared.close_supply.py_func(plain, case.spool, case.supply, 1e-3, before, other)
        np.testing.assert_allclose(one, other, rtol=1e-12)
    one, other = case.z.copy(), case.z.copy()
    for advance, rows, z in (
        (evaluate.advance_states, case.rows, one),
        (evaluate.advance_states.py_func, plain, other),
    ):
        advance(rows, s, 1e-3 * sd, 1e-3, case.spool, case.supply, z)
    np.testing.assert_allclose(one, other, rtol=1e-12)


# ------------------------------------------------------------------------------------------------ steps and rates
@over(WITH_STATES)
def test_the_one_step_rule_converges_with_second_order_to_the_rates(case: Case):
    """A leak's clock is exact; a joint's gap ends at corners, where steps of any method meet kinks."""
    oil, report = bool(case.attributes.modifies), case.attributes.inlined
    duration, first = (0.08, 160) if oil else (0.1, 200)  # before a turbulent leak turns round: its slope jumps there
    scale = 1e6 if case.pressures else 1.0
    accuracy = np.where(np.arange(case.z.size) < case.pressures, 1e-9, 1e-12)
    options = dict(method="DOP853", rtol=1e-12, atol=accuracy, max_step=1e-4)
    exact = solve_ivp(case.rates, (0, duration), case.z, t_eval=np.linspace(0, duration, first + 1), **options).y.T
    size = np.full(exact.shape[1], scale) if oil or report else np.abs(exact).max(axis=0)
    compared = slice(0, case.pressures) if oil else slice(None)
    size[size == 0.0] = 1.0
    steps = [k * first for k in ((2, 4, 8) if oil else (1, 2, 4))]
    error = [np.abs((case.march(duration, n)[:: n // first] - exact) / size)[:, compared].max() for n in steps]
    assert error[2] < (1e-5 if report else 1e-4)  # of a hysteretic state of one, of a megapascal, or of its size
    # third-order terms at 40 steps a cycle, of lines and filters too; a sign of v changes within a step now and then
    near = 0.05 if report else 0.1 if oil else 0.25
    if case.law not in ("gas_leak", "backlash"):
        for coarse, fine in pairwise(error):
            assert coarse / fine == pytest.approx(4.0, rel=near)


@over(WITH_STATES)
def test_rates_are_what_a_short_step_makes(case: Case):
    z, h = case.march(0.02, 40)[-1], 1e-6

    def rise(dt: float) -> np.ndarray:
        after, s = z.copy(), s_at(0.02)
        evaluate.advance_states(case.rows, s, s_at(0.02 + dt) - s, dt, case.spool, case.supply, after)
        return after - z

    rate = (4.0 * rise(h) - rise(2.0 * h)) / (2.0 * h)
    np.testing.assert_allclose(case.rates(0.02, z), rate, rtol=1e-5, atol=1e-5 * np.abs(z).max())  # h^2, rounding / h


@over(EXACT)
def test_one_straight_step_is_as_good_as_many(case: Case):
    way, dt, ends = np.array([1.5e-3, -0.8e-3, 0.4e-3]), 0.05, []
    for n in (1, 60):
        z = case.z.copy()
        for k in range(n):
            evaluate.advance_states(case.rows, k / n * way, way / n, dt / n, case.spool, case.supply, z)
        ends.append(z[states_of(case.rows[-1])])
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-11, atol=1e-13)  # rounding of sixty steps


@over(BY_PATH)
def test_a_slip_is_advanced_as_an_ode_solver_does_at_any_speed_and_in_any_pieces(case: Case):
    """Slips of some yield displacements of any direction, one after the other, at constant and at growing speed."""
    rng, at, z = np.random.default_rng(2), states_of(case.rows[-1]), case.z.copy()
    reach = 2.0 * getattr(case.p, "yield_slip", getattr(case.p, "yield_turn", 0.0))
    for k in range(16):
        way, before, share = reach * rng.normal(size=3), z.copy(), rng.uniform()

        def right(t: float, z: np.ndarray, k: int = k, way: np.ndarray = way) -> np.ndarray:
            zd = np.zeros(len(z))
            speed = 3 * t**2 if k % 2 else 1.0
            evaluate.state_rates(case.rows, np.zeros(3), speed * way, case.spool, case.supply, z, zd)
            zd[: case.pressures] = 0.0
            return zd

        options = dict(max_step=0.01, rtol=1e-12, atol=1e-12, method="DOP853")
        exact = solve_ivp(right, (0.0, 1.0), before, **options).y[at, -1]
        pieces = before.copy()
        evaluate.advance_states(case.rows, np.zeros(3), way, 0.1, case.spool, case.supply, z)
        evaluate.advance_states(case.rows, np.zeros(3), share * way, 0.1, case.spool, case.supply, pieces)
        evaluate.advance_states(case.rows, np.zeros(3), (1.0 - share) * way, 0.1, case.spool, case.supply, pieces)
        z[: case.pressures] = case.z[: case.pressures]
        np.testing.assert_allclose(z[at], exact, atol=1e-7)  # the solver's own error where the rate has kinks
        np.testing.assert_allclose(z[at][2:4], exact[2:4], atol=1e-9 if case.law == "dahl_instead" else 1e-7)  # none
        np.testing.assert_allclose(pieces[at], z[at], atol=1e-10)  # a zero is found to rounding of the slip
        most = 1.0 + (1e-9 if "bouc_wen" in case.law else 1e-12)  # rounding of long exponentials in the plane
        assert all(np.linalg.norm(part) <= most for part in np.split(z[at], 2 if z[at].size == 4 else 1))  # Z, and d


@over(tuple(c for c in WITH_STATES if c.on is not SINGLE))  # a single chamber knows no sides and no weight
def test_hidden_states_depend_on_all_parameters_but_the_amplitudes_stated(case: Case):
    at = slice(None) if case.attributes.modifies else states_of(case.rows[-1])
    before = case.march(0.4, 200, turn=True)[:, at]
    for name in case.p._fields[: len(parameter_units(case.attributes)) if case.law == "hydraulic" else None]:
        if name in ("root_regularisation", "one_way") or (case.law == "hydraulic" and getattr(case.p, name) == 0.0):
            continue  # which acts within 500 Pa of no drop; a switch; and what a single chamber lacks
        other = case.with_parameter(name)
        same = np.array_equal(other.march(0.4, 200, turn=True)[:, at], before)
        assert same == (name in case.attributes.amplitude), name
        if not case.attributes.modifies:
            assert np.array_equal(shapes_of(other.rows[-1]), shapes_of(case.rows[-1])) == same


# --------------------------------------------------------------------------------------------------------- energy
@over(CASES)
def test_what_flows_in_is_stored_dissipated_or_delivered(case: Case):
    """d(stored)/dt = inflow - dissipated - delivered at any instant, for any state."""
    row, h = case.rows[-1], 1e-6 if case.attributes.inlined or case.attributes.modifies else 1e-7

    def power(t: float, z: np.ndarray, work: float = 0.0) -> tuple[float, float, float]:
        return row_power(row, s_at(t), z, work, case.spool, case.supply)

    stores = False
    for t in (0.013, 0.05, 0.07, 0.21):
        for z in (case.z, case.march(t, 400)[-1]):
            force, sd = case.forces(s_at(t), sd_at(t), z)[0], sd_at(t)
            ports = [row[name] for name in ("port", "port_2", "port_3") if row[name] >= 0]
            delivered = force[: len(ports)] @ sd[ports]
            inflow, dissipated, stored = power(t, z, delivered)
            zd = case.rates(t, z)
            rate = (power(t + h, z + h * zd)[2] - power(t - h, z - h * zd)[2]) / (2 * h)
            size = abs(inflow) + abs(dissipated) + abs(delivered) + 1e-3
            # rounding of the difference, beside energies of a gas near 1 MJ; the enthalpy's integral in steps
            near = 5e-6 if case.attributes.modifies else 1e-6
            gas = 1e-9 * abs(stored) / h if case.attributes.acts_on_gas else 0.0
            assert rate == pytest.approx(inflow - dissipated - delivered, abs=near * size + gas)
            stores |= stored != 0.0
            if row["spool"] >= 0:
                assert inflow != 0.0 and dissipated > 0.0  # the leak
    assert stores == (case.attributes.stores_energy or bool(case.attributes.modifies))


@over(PASSIVE)
def test_dissipation_is_never_negative(case: Case):
    for t, z in zip(np.linspace(0.0, 0.5, 501), case.march(0.5, 500), strict=True):
        sd, ports = sd_at(t), [int(case.rows[-1][name]) for name in ("port", "port_2", "port_3")]
        force = case.forces(s_at(t), sd, z)[0]
        work = sum(f * sd[k] for f, k in zip(force, ports, strict=True) if k >= 0)
        assert row_power(case.rows[-1], s_at(t), z, work, case.spool, case.supply)[1] >= 0.0


@over(WITHOUT_POTENTIAL)
def test_a_law_without_potential_takes_energy_from_any_cycle(case: Case):
    """The motion repeats every second; the last of four is taken."""
    steps = 10000
    z, power = case.march(4.0, steps)[-steps // 4 :], np.zeros(steps // 4)
    ports = [int(case.rows[-1][name]) for name in ("port", "port_2", "port_3")]
    for k, y in enumerate(z):
        t = 3.0 + (k + 1) * 4.0 / steps
        force, sd = case.forces(s_at(t), sd_at(t), y)[0], sd_at(t)
        power[k] = sum(f * sd[port] for f, port in zip(force, ports, strict=True) if port >= 0)
    # a cycle of sliding is mostly dissipation
    assert np.mean(power) < -case.cycle * np.abs(power).max()


# ------------------------------------------------------------------------------------------------------ modifiers
def outcome(*effects: Effect) -> dict[str, float]:
    """All that modifiers can change, by what they modify and by field."""
    every = [Effect("oil", "hydraulic", ("leg",), (DOUBLE[:12],), "test", (0,)), *effects]
    delays, lags = command_path(every, {"leg": 5e-3})
    inertia = np.sum([np.zeros(10), *(more for _, more in added_inertias(every))], axis=0)
    found = {
        "oil": parameters_of(effect_table(every, PORTS)[0])._asdict(),
        "supply": supply_of(every, state_names(every), *SUPPLY)._asdict(),
        "valve": {"delay": delays[0], "lag": lags[0]},
        "leg": {"share": thrust_shares(every, ["leg"])[0]},
        "inertia": dict(zip(MoreInertia._fields, inertia, strict=True)),
    }
    return {f"{kind}.{name}": value for kind, values in found.items() for name, value in values.items()}


@pytest.mark.parametrize("law", MODIFIERS)
def test_a_modifier_fills_the_fields_that_it_names_and_no_others(law: str):
    p, modifies = MODIFIERS[law], LAWS[law].modifies
    fields = ("chamber_a", "chamber_b") if law == "dead_volume" else LAWS[law].fields or p._fields
    named = [f"{modifies}.{name}" for name in fields]
    plain, changed = outcome(), outcome(effect_of(law, p))
    assert {name for name in plain if changed[name] != plain[name]} == set(named)
    if law != "dead_volume":
        for name, value in zip(named, p, strict=False):
            start = plain[name] if name == named[0] else 0.0
            assert changed[name] == pytest.approx(start + value, rel=1e-15)
    twice = outcome(effect_of(law, p, name="a"), effect_of(law, p, name="b"))  # amplitudes add up
    for name in named if law in ("dead_volume", "more_inertia") else named[:1]:
        assert twice[name] - plain[name] == pytest.approx(2.0 * (changed[name] - plain[name]), rel=1e-12)
    if law not in ("dead_volume", "more_inertia"):
        assert {name: twice[name] for name in named[1:]} == {name: changed[name] for name in named[1:]}
    nothing = effect_of(law, type(p)(*(0.0 if k == 0 or law == "more_inertia" else x for k, x in enumerate(p))))
    left = outcome(nothing)
    if modifies == "oil":
        for standard in ACTUATORS:
            assert effect_table([*standard.effects, nothing], PORTS).tobytes() == standard.rows.tobytes()
    unfelt = named[1:] if modifies == "supply" else ()  # its time constants, weight and state, of no flow that counts
    assert {n: x for n, x in left.items() if n not in unfelt} == {n: x for n, x in plain.items() if n not in unfelt}


@over(ACTUATORS)
def test_an_actuator_modified_by_nothing_that_counts_is_the_report_s(case: Case):
    more = Case("external_leakage", MODIFIERS["external_leakage"]._replace(leakage=1e-300), on=case.p)
    assert (more.rows["modified"][0], case.rows["modified"][0]) == (1, 0)
    np.testing.assert_allclose(more.march(0.1, 400), case.march(0.1, 400), rtol=1e-12)  # rounding of 400 steps
    powers = [row_power(c.rows[0], s_at(0.1), c.z, 0.0, c.spool, c.supply) for c in (more, case)]
    np.testing.assert_allclose(*powers, rtol=1e-14)


@pytest.mark.parametrize("opened", [-1.0, -0.3, 0.0, 0.02, 0.9])
@pytest.mark.parametrize("pressure", [-1e6, 1e5, 12e6, 25e6])
def test_a_three_way_valve_is_a_four_way_valve_with_two_ports_closed(opened: float, pressure: float):
    double = SINGLE._replace(area_b=0.4, chamber_b=0.4)  # w2 = w4 = 0
    for p in (SINGLE, double):
        assert p.flow_bt == p.flow_pb == 0.0
    one, two = (valve_flows(p, False, opened, pressure, 0.0, *SUPPLY) for p in (SINGLE, double))
    assert one == two and one[1] == one[3] == 0.0
    one, two = (leak_flows(p, False, pressure, 0.0, SUPPLY[1]) for p in (SINGLE, double))
    assert one == two and one[0] == SINGLE.leakage * pressure  # what leaks past the piston

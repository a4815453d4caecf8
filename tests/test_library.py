"""Families of the library: every one in a machine, against residuals, both engines and inverse dynamics."""

import tomllib
from functools import cache

import numpy as np
import pytest
from run_cases import as_measured, at_rest, driven, measured_of, rms, shaken, stirred

from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.effects.registry import LAWS, parameters_of
from lhpost6_pin.identification.inverse_dynamics import inverse_dynamics
from lhpost6_pin.identification.residuals import evaluate_residuals, follow
from lhpost6_pin.machine.library import families, find_family
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.mechanics.plant import make_plant

pytestmark = pytest.mark.long

MECHANICAL = {
    "stribeck_friction": (("H1", "V2"), {}),
    "stribeck_lag": (("H1", "V2"), {}),
    "asymmetric_friction": (("H1",), {}),
    "load_dependent_friction": ((), {}),
    "friction_warm_up": ((), {"memory": 0.5, "saturation": 0.02}),
    "bearing_warm_up": (("V3",), {"memory": 0.5, "saturation": 0.02}),
    "backlash": (("H1", "S2"), {}),
    "swivel_friction": ((), {}),
    "smooth_swivel_friction": ((), {"slow": 0.02}),
    "strut_friction": (("S1",), {}),
    "strut_dahl_friction": (("S1",), {"yield_slip": 3e-4}),
    "bearing_friction": (("V3",), {}),
    "presliding": (("H1", "V2"), {}),
    "bearing_presliding": (("V3",), {}),
    "local_viscous": (("H1",), {}),
    "quadratic_drag": (("H2",), {}),
    "power_law_viscous": (("H3",), {}),
    "stray_spring": (("H1", "platen.yaw"), {}),
    "mounted_spring": (("platen.y",), {"height": 1.5}),
    "placed_spring": ((), {"x": 6.1, "y": 3.8, "turn": 0.4, "tilt": 0.2}),
    "end_stop_stiffening": (("H1",), {"start": 0.0}),
    "unnamed_by_position": (("H1",), {}),
    "unnamed_by_speed": (("V1",), {"share": 0.5}),
    "unnamed_by_memory": (("V1",), {"share": 0.5, "past": 0.5}),
    "gravity_offset": ((), {}),
    "bearing_thrust_direction": ((), {}),
    "strut_gas_leak": (("S2",), {}),
    "gas_heat_transfer": ((), {"time_constant": 0.3}),
    "added_mass": ((), {}),
    "inertia_coupling": ((), {}),
    "structural_flexibility": (("platen.x", "platen.y"), {}),
    "specimen_resonance": (("platen.x", "platen.y"), {}),
    "swaying_specimen": (("platen.x",), {}),
}
"""Components and numbers of families of what moves; empty: the first group, typical numbers."""

STRONG: dict[str, dict[str, float]] = {
    "piston_leakage": {},
    "turbulent_leakage": {"coefficient": 5e-7},
    "external_leakage": {"leakage": 5e-11, "side": -0.3},
    "entrained_air": {},
    "dead_volume": {},
    "swivel_play": {"half_play": 5e-4},
    "valve_deadband": {},
    "rounded_deadband": {"rounding": 0.4},
    "null_leakage": {"leakage": 2e-6},
    "spool_null_bias": {},
    "supply_droop": {"droop": 6e6, "time": 0.05},
    "return_back_pressure": {"rise": 3e6, "time": 0.0},
    "flow_curve_error": {},
    "cavitation": {"share": 0.9, "vapour_pressure": 1e6},
    "line_dynamics": {},
    "supply_line": {"inertance": 2e6},
}
"""Families that chambers feel, strong enough to show in a third of a second."""

COMMAND = ("spool_lag", "transport_delay")
OIL = {family: ((), values) for family, values in STRONG.items()} | dict.fromkeys(COMMAND, ((), {}))
FAMILIES = MECHANICAL | OIL


GUIDED = {"backlash_before_friction"}
"""Families of a platen on guides, which the table of six axes has not."""


base = cache(load_machine)


@cache
def with_family(family: str) -> Machine:
    components, values = FAMILIES[family]
    return base().with_effect(family, components, name="extra", **values)


# ---------------------------------------------------------------------------------------------- all families
def test_every_family_of_a_machine_is_tried_here():
    for files, tried in ((("mechanical", "unnamed"), MECHANICAL.keys() | GUIDED), (("oil",), OIL.keys())):
        texts = [(models_folder() / "library" / f"{file}.toml").read_text(encoding="utf-8") for file in files]
        assert {name for text in texts for name in tomllib.loads(text)} == tried


@pytest.mark.parametrize("family", FAMILIES)
def test_amplitudes_may_be_zero_and_start_values_lie_within_bounds(family: str):
    known = find_family(family)
    for shape in known.shapes:
        assert shape.low <= shape.typical <= shape.high
        assert all(shape.low <= x <= shape.high for x in shape.start)
        assert not shape.amplitude or (shape.low <= 0.0 < shape.high and shape.typical > 0.0)
    assert set(known.confused_with) <= set(families())
    for group in known.groups(base()):
        make_plant(base().with_effect(family, group))


@pytest.mark.parametrize("family", ["accelerometer_error", "channel_delay", "controller_mismatch"])
def test_errors_of_sensors_and_controllers_are_no_part_of_a_machine(family: str):
    assert set(find_family(family).confused_with) <= set(families())
    with pytest.raises(ParameterError, match=f"{family} is no part of a machine"):
        base().with_effect(family)
    with pytest.raises(ParameterError, match="swivel_friction: cannot act on V1"):
        base().with_effect("swivel_friction", ("V1",))


@pytest.mark.parametrize("family", FAMILIES)
def test_without_amplitude_nothing_changes_by_a_bit(family: str):
    components, values = FAMILIES[family]
    none = {shape.name: 0.0 for shape in find_family(family).shapes if shape.amplitude}
    nothing = base().with_effect(family, components, **{**values, **none})
    run, plain = shaken(nothing, samples=60), shaken(base(), samples=60)
    assert make_plant(nothing).command_path.size == plain.plant.spools
    if family in ("added_mass", "inertia_coupling", "specimen_resonance", "swaying_specimen"):
        # the same Inertia made from its moments; the weight of nothing is -0.0
        np.testing.assert_allclose(run.q, plain.q, rtol=0.0, atol=1e-13)
    else:
        np.testing.assert_array_equal(run.q, plain.q)


def test_amplitudes_of_two_effects_on_one_actuator_add():
    twice = base().with_effect("turbulent_leakage", ("H1",), name="a", coefficient=1e-7)
    twice = twice.with_effect("turbulent_leakage", ("H1", "H2"), name="b", coefficient=2e-7)
    rows = make_plant(twice).rows[:3]
    assert [parameters_of(row).turbulent for row in rows] == pytest.approx([3e-7, 2e-7, 0.0])
    assert rows["modified"].tolist() == [1, 1, 0]


@pytest.mark.parametrize("family", GUIDED)
def test_a_family_of_guided_drives_acts_on_a_table_on_guides_as_the_others_do_on_theirs(family: str):
    table = base("uniaxial")
    machine = table.with_effect(family, gap=1e-4, slip=1e-4, share=0.8, name="extra")
    run, other = (shaken(machine, samples=200, engine=engine) for engine in ("fused", "pinocchio"))
    np.testing.assert_allclose(run.q, other.q, rtol=0.0, atol=1e-12)  # rounding of 200 steps
    measured = measured_of(run)
    told, missed = (evaluate_residuals(make_plant(m), measured).wrench for m in (machine, table))
    assert rms(missed).max() > 20.0 * rms(told).max()  # left: half a step between force and motion
    nothing = shaken(table.with_effect(family, share=0.0), samples=60)
    np.testing.assert_array_equal(nothing.q, shaken(table, samples=60).q)


# ---------------------------------------------------------------------------------------------- what moves
@pytest.mark.parametrize("family", MECHANICAL)
def test_the_residuals_know_the_effect_and_miss_it_where_it_shows(family: str):
    """A simulated record of the machine with it, without noise, at the model's steps.

    What forces saw half a step off is left, some newtons beside the effect's kilonewtons.
    """
    machine = with_family(family)
    run = shaken(machine)
    assert run.trouble is None
    measured = measured_of(run)
    told = evaluate_residuals(make_plant(machine), measured)
    missed = evaluate_residuals(make_plant(base()), measured)
    assert rms(told.wrench).max() < 10.0
    assert told.gas.size
    assert np.abs(told.gas).max() < 1e-12
    shows_in = find_family(family).shows_in
    assert ("wrench" in shows_in) == (rms(missed.wrench).max() > 100 * rms(told.wrench).max())
    assert ("gas" in shows_in) == (np.abs(missed.gas).max() > 1e-4)


@pytest.mark.parametrize("family", MECHANICAL)
def test_both_engines_run_it_alike(family: str):
    machine = with_family(family)
    one, other = (shaken(machine, samples=80, engine=engine) for engine in ("fused", "pinocchio"))
    np.testing.assert_allclose(one.q, other.q, rtol=0.0, atol=1e-12)  # rounding of 80 steps
    np.testing.assert_allclose(one.v, other.v, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("family", MECHANICAL)
def test_inverse_dynamics_and_residuals_leave_the_same(family: str):
    machine = with_family(family)
    plant, measured = make_plant(machine), measured_of(shaken(machine, samples=200))
    found = inverse_dynamics(plant, measured.dt * np.arange(200), measured.motion, measured.channels["actuator_force"])
    whole = found.struts + found.dissipative + found.ledger.wrench[:, found.ledger.effect("gravity")]
    scale = np.abs(found.ledger.wrench).max()
    # every force beside the oil's is the gas's or dissipative; a sum in another order
    np.testing.assert_allclose(whole, found.ledger.wrench.sum(axis=1), atol=1e-12 * scale)
    left = evaluate_residuals(plant, measured, ("wrench",)).wrench
    np.testing.assert_allclose(found.residual, left, rtol=0.0, atol=1e-4)  # rounding of meganewtons
    oil = found.ledger.effect("actuators_4_way")
    assert not found.ledger.wrench[:, oil].any()


@pytest.mark.parametrize("family", [f for f in MECHANICAL if LAWS[with_family(f).added_effects[0].law].states])
def test_amplitudes_leave_the_path_of_hidden_states_alone_and_shapes_are_followed_afresh(family: str):
    components, values = FAMILIES[family]
    shapes = find_family(family).shapes
    machine = with_family(family)
    plant = make_plant(machine)
    more = {s.name: 0.5 * s.typical for s in shapes if s.amplitude and s.name != "lost"}
    changed = make_plant(base().with_effect(family, components, name="extra", **{**values, **more}))
    measured = measured_of(shaken(machine, samples=100))
    path = follow(plant, measured)
    np.testing.assert_array_equal(follow(changed, measured).z, path.z)
    np.testing.assert_array_equal(follow(changed, measured, (plant, path)).z, path.z)
    for shape in shapes:
        if not shape.amplitude:
            value = {**values}.get(shape.name, shape.typical)
            other = base().with_effect(family, components, name="extra", **{**values, shape.name: 0.9 * value + 1e-3})
            afresh = follow(make_plant(other), measured).z
            np.testing.assert_array_equal(follow(make_plant(other), measured, (plant, path)).z, afresh)


# ---------------------------------------------------------------------------------------------- oil
@pytest.mark.parametrize("family", STRONG)
def test_the_machine_with_the_effect_explains_its_run_and_the_one_without_does_not(family: str):
    altered = with_family(family)
    run = stirred(altered)
    assert run.trouble is None
    test = as_measured(run)
    own, other = (evaluate_residuals(make_plant(machine), test, ("flow", "supply")) for machine in (altered, base()))
    # central differences of pressures at 2048 Hz leave 1.6e-4 m3/s without any effect; voids open between two samples
    share = 0.1 if family == "cavitation" else 0.5
    left, without = rms(own.flow, 5).max(), rms(other.flow, 5).max()
    assert left < share * without or left < 2e-4 < 1.5 * without
    if family == "supply_droop":
        assert rms(own.supply, 5).max() < 1e-4 * rms(other.supply, 5).max()  # the filter marched at 2048 Hz
        assert rms(other.supply, 5).max() > 1e6
    else:
        np.testing.assert_array_equal(own.supply, 0.0)


@pytest.mark.parametrize("family", STRONG)
def test_an_altered_machine_stays_at_rest(family: str):
    _, rest = at_rest(with_family(family))
    run = driven(with_family(family), np.zeros((400, 10)))
    pressures = [k for k, name in enumerate(run.plant.states) if "pressure" in name]
    moved = np.abs(run.z[:, pressures] - rest.state.z[pressures]).max()
    assert moved < 1.0  # of 3 to 9 MPa; the spool is known to rounding and the valve's gain about null is large
    assert np.abs(run.q[:, :3] - rest.state.q[:3]).max() < 1e-9


@pytest.mark.parametrize("family", ["supply_droop", "line_dynamics", "entrained_air"])
def test_both_engines_and_all_schemes_agree(family: str):
    altered = with_family(family)
    fused, step = stirred(altered, samples=100), stirred(altered, "pinocchio", samples=100)
    np.testing.assert_allclose(fused.q, step.q, rtol=1e-9, atol=1e-12)  # rounding, grown over 1600 steps
    exact = stirred(altered, samples=100, steps=64, scheme="rk4")
    assert np.abs(fused.q - exact.q).max() < 1e-4 * np.abs(exact.q[:, :3] - exact.q[0, :3]).max()  # second order

"""Effects are data: they add rows to a table, compile nothing, and say what is wrong with them."""

import numpy as np
import pytest
from run_cases import driven

from lhpost6_pin.core.errors import ParameterError, UnknownNameError
from lhpost6_pin.effects import evaluate as stage
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.effects.registry import LAWS
from lhpost6_pin.effects.table import effect_table
from lhpost6_pin.laws.contract import parameter_units
from lhpost6_pin.machine.port_names import PLATEN_PORTS
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.mechanics.pose import platen_motion
from lhpost6_pin.simulation.ledger import force_ledger
from lhpost6_pin.simulation.simulate import Run

DRAG = Effect("drag", "viscous", PLATEN_PORTS, tuple((1e3 * (k + 1),) for k in range(6)), "test")


def stirred(machine) -> Run:
    t, k = np.arange(400)[:, None] / 2048, np.arange(10)
    return driven(machine, 0.2 * np.sin(2 * np.pi * (3 + k) * t + k))


def test_the_machine_has_the_reports_effects_in_ledger_order(machine):
    names = ["actuators_4_way", "actuators_3_way", "hold_down", "seal_friction", "pad_friction", "viscous"]
    names += ["bumper"]
    assert [e.name for e in machine.effects] == names
    assert all(e.source for e in machine.effects)


def test_one_more_effect_is_one_more_row_and_nothing_compiles(machine):
    stirred(machine)
    before = {f: list(f.signatures) for f in (stage.apply_forces, stage.state_rates, stage.advance_states)}
    more = machine.with_effect(DRAG).with_effect(Effect("rub", "bouc_wen_1d", ("S2",), ((5e3, 1e-3, 0.2),), "test"))
    assert len(make_plant(more).rows) == len(make_plant(machine).rows) + 7
    assert make_plant(more).states == (*make_plant(machine).states, "rub.S2.z")
    stirred(more)
    assert before
    for function, signatures in before.items():
        assert list(function.signatures) == signatures


def test_viscous_drag_on_the_platen_ports_is_a_wrench_against_the_motion_of_c(machine):
    """In {c}: force -c v_C, moment -c omega along the fixed axes, which are not the rates of the Euler angles."""
    run = stirred(machine.with_effect(DRAG))
    ledger = force_ledger(run)
    velocity = platen_motion(run.plant, run.q, run.v, run.a).velocity
    x, y, z, w = run.q[:, 3:7].T
    # omega = R omega_b, by the quaternion
    u, omega_b = np.stack([x, y, z], axis=1), run.v[:, 3:]
    turn = 2.0 * np.cross(u, omega_b)
    omega = omega_b + w[:, None] * turn + np.cross(u, turn)
    expected = -1e3 * np.arange(1, 7) * np.hstack([velocity[:, :3], omega])
    assert np.abs(expected).max(axis=0).min() > 1.0  # all axes move
    # rounding
    np.testing.assert_allclose(ledger.wrench[:, ledger.effect("drag")], expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(ledger.force[:, ledger.row("drag.platen.x")], expected[:, 0], rtol=1e-9, atol=1e-9)


def test_drag_changes_the_motion_of_a_copy_and_an_effect_without_force_not_a_bit(machine):
    effects = machine.effects
    heavy, nothing = (Effect("drag", "viscous", ("platen.x",), ((c,),), "test") for c in (1e8, 0.0))
    free, braked, same = map(stirred, (machine, machine.with_effect(heavy), machine.with_effect(nothing)))
    assert np.abs(braked.v[:, 0]).max() < 0.5 * np.abs(free.v[:, 0]).max()
    np.testing.assert_array_equal(same.q, free.q)
    assert machine.effects == effects
    with pytest.raises(ParameterError, match="'viscous' is in this machine already"):
        machine.with_effect(Effect("viscous", "viscous", ("S1",), ((1.0,),), "test"))


def test_an_unknown_law_or_port_lists_those_that_exist(machine):
    with pytest.raises(UnknownNameError, match=r"no law named 'coulomb'.*bouc_wen_1d.*viscous"):
        Effect("rub", "coulomb", ("H1",), ((1.0,),), "test")
    with pytest.raises(UnknownNameError, match=r"no port named 'H9'.*H1.*platen\.yaw"):
        make_plant(machine.with_effect(Effect("rub", "viscous", ("H9",), ((1.0,),), "test")))


def test_a_two_port_law_takes_the_stem_of_a_pad(machine):
    rub = Effect("rub", "bouc_wen_2d", ("V2",), ((1e3, 1e-3, 0.1),), "test")
    plant: Plant = make_plant(machine.with_effect(rub))
    row = plant.rows[-1]
    assert (plant.ports[row["port"]], plant.ports[row["port_2"]]) == ("V2.x", "V2.y")
    with pytest.raises(UnknownNameError, match=r"no port named 'H1\.x'"):
        effect_table([Effect("rub", "bouc_wen_2d", ("H1",), ((1e3, 1e-3, 0.1),), "test")], plant.ports)


@pytest.mark.parametrize("law", LAWS)
def test_a_wrong_number_of_numbers_lists_what_the_law_takes(law: str):
    names = [name for name, _ in parameter_units(LAWS[law])]
    with pytest.raises(ParameterError, match="rub on H1.*" + r" \[.*".join(names) + r" \["):
        Effect("rub", law, ("H1",), ((1.0,) * (len(names) + 1),), "test")


@pytest.mark.parametrize(
    ("law", "ports", "numbers", "spools", "message"),
    [
        ("viscous", ("H1", "H2"), ((1.0,), (float("nan"),)), (), r"rub on H2.*not finite"),
        ("viscous", ("H1", "H2"), ((1.0,),), (), "rub: 1 sets of numbers for 2 ports"),
        ("viscous", ("H1",), ((1.0,),), (0,), "viscous law takes no spool"),
        ("hydraulic", ("H1",), ((1.0,) * 12,), (), "a hydraulic law takes one spool"),
    ],
)
def test_numbers_must_be_finite_one_set_a_port_and_spools_those_of_the_law(law, ports, numbers, spools, message):
    with pytest.raises(ParameterError, match=message):
        Effect("rub", law, ports, numbers, "test", spools)

"""Changes of residuals by what differs alone, against the residuals evaluated in full."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lhpost6_pin.data.records import load_record
from lhpost6_pin.data.sensors import load_sensors
from lhpost6_pin.identification.prepare import AS_RECORDED, prepare_test
from lhpost6_pin.identification.residual_change import Evaluated, change_of
from lhpost6_pin.identification.residuals import RESIDUALS, evaluate_residuals, follow
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.mechanics.plant import make_plant

RECORDS = Path(__file__).parent / "data" / "records"

CASES = {
    "a mass": lambda m: m.with_params({"platen.mass": [1.7e5, 1.6e5, 1.8e5]}),
    "a place": lambda m: m.with_params({"platen.centre_of_gravity": [0.01, 0.0, -0.7]}),
    "friction": lambda m: m.with_params({"horizontal.seal_friction": 7e4}),
    "friction of another yield": lambda m: m.with_params({"vertical.seal_yield": 3e-4}),
    "an effect": lambda m: m.with_effect("stribeck_friction", ("H2",)),
    "an effect under load": lambda m: m.with_effect("load_dependent_friction", ("V1",)),
    "oil": lambda m: m.with_params({"hydraulics.bulk_modulus": 1.2e9}),
    "one valve": lambda m: m.with_effect("spool_null_bias", ("V2",)),
    "a line": lambda m: m.with_effect("line_dynamics", ("H3",)),
    "the supply": lambda m: m.with_effect("supply_droop", ("supply",)),
    "gas": lambda m: m.with_effect("gas_heat_transfer", ("S2",)),
    "a delay": lambda m: m.with_effect("transport_delay", ("H1",)),
    "nothing": lambda m: m,
}


@pytest.fixture(scope="module")
def before() -> Evaluated:
    plant = make_plant(load_machine("lhpost6"))
    record = load_record(RECORDS / "practice_a_TX.nc").isel(time=slice(0, 1500))
    record = record.drop_vars("actuator_displacement")
    test = prepare_test(plant, record, load_sensors("lhpost6"), AS_RECORDED._replace(pressure_cutoff=60.0))
    path = follow(plant, test)
    return Evaluated(plant, test, path, evaluate_residuals(plant, test, path=path))


def full_change(before, plant, test, path):
    after = evaluate_residuals(plant, test, path=path)
    return {kind: getattr(after, kind) - getattr(before.residuals, kind) for kind in RESIDUALS}


def assert_alike(before, plant, test):
    path = follow(plant, test, (before.plant, before.path))
    found, wanted = change_of(before, plant, test, path), full_change(before, plant, test, path)
    for kind in RESIDUALS:
        residual = getattr(before.residuals, kind)
        # rounding of sums of forces of up to meganewtons, whose difference is taken in another order
        size = 1e-12 * (np.abs(residual).max(initial=1e-300) + 5e6 * (kind == "wrench"))
        np.testing.assert_allclose(getattr(found, kind), wanted[kind], rtol=1e-9, atol=size, err_msg=kind)


@pytest.mark.parametrize("case", CASES)
def test_change_by_another_plant(before, case):
    assert_alike(before, make_plant(CASES[case](before.plant.machine)), before.test)


@pytest.mark.parametrize("channel", ["actuator_force", "chamber_pressure_b", "spool_position", "strut_pressure"])
def test_change_by_another_sensor(before, channel):
    values = before.test.channels[channel].copy()
    values[:, -1] *= 1.01
    assert_alike(before, before.plant, before.test.with_channels(**{channel: values}))


def test_change_by_a_rate_of_pressure(before):
    rates = {name: x * 1.02 for name, x in before.test.rates.items()}
    assert_alike(before, before.plant, replace(before.test, rates=rates))


def test_only_the_kinds_asked_for(before):
    plant = make_plant(before.plant.machine.with_params({"hydraulics.bulk_modulus": 1.2e9}))
    path = follow(plant, before.test, (before.plant, before.path))
    found = change_of(before, plant, before.test, path, ("flow",))
    assert found.flow.any()
    assert found.wrench.shape[1] == found.gas.shape[1] == 0


def test_a_place_that_moves_changes_the_wrench(before):
    """The derivative of an effect by its own place: ports of another place are no more ports of the first."""
    machine = before.plant.machine.with_effect("placed_spring", ("platen",), stiffness_x=1e6, x=4.0, y=2.0)
    plant = make_plant(machine)
    path = follow(plant, before.test)
    own = Evaluated(plant, before.test, path, evaluate_residuals(plant, before.test, path=path))
    moved = make_plant(before.plant.machine.with_effect("placed_spring", ("platen",), stiffness_x=1e6, x=4.0, y=2.5))
    assert_alike(own, moved, before.test)
    change = change_of(own, moved, before.test, follow(moved, before.test, (plant, path)))
    assert np.abs(change.wrench).max() > 1e3  # half a metre of lever of a spring of 1 MN/m that moves by centimetres

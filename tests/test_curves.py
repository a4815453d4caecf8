"""Curves of friction and of valves along a measured test: what the measured balance and the model's laws give."""

from dataclasses import replace

import numpy as np
import pytest
from machine_cases import machine_named
from page_cases import numbers
from run_cases import measured_of, shaken

from lhpost6_pin.effects.registry import law_of
from lhpost6_pin.identification.calibration.curves import Curves
from lhpost6_pin.identification.curves import FrictionCurve, ValveCurve, friction_curves, valve_curves
from lhpost6_pin.identification.prepare import MeasuredTest
from lhpost6_pin.identification.residual_kernels import row_wrenches
from lhpost6_pin.identification.residuals import evaluate_residuals, follow
from lhpost6_pin.laws.orifice import opening
from lhpost6_pin.machine.machine import Machine
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.show.report.curve_plots import curve_blocks
from lhpost6_pin.show.report.page import Figure


def friction_of(machine: Machine, test: MeasuredTest) -> dict[str, FrictionCurve]:
    plant = make_plant(machine)
    path = follow(plant, test)
    return friction_curves(plant, test, path, evaluate_residuals(plant, test, path=path))


def valves_of(machine: Machine, test: MeasuredTest) -> dict[str, ValveCurve]:
    plant = make_plant(machine)
    return valve_curves(plant, test, follow(plant, test))


# ------------------------------------------------------------------------------------------------------- friction
def test_measured_friction_is_that_of_the_simulation_whatever_the_model_s_friction_is(table, test):
    """The simulation's own: its friction and viscous rows with the states that it marched."""
    run = shaken(table, samples=600)
    rows = run.plant.rows[[not law_of(row).takes_spool for row in run.plant.rows]]
    true = -row_wrenches(run.plant, follow(run.plant, test).ports, run.z, rows).sum(axis=1)[:, 0]
    kind = table.actuators[0].kind
    wrong = table.with_params({f"{kind}.seal_friction": 3.0 * table.actuators[0].seal_friction, f"{kind}.viscous": 0.0})
    right, other = (friction_of(machine, test)["x"] for machine in (table, wrong))
    scale = np.abs(true).max()
    np.testing.assert_allclose(right.modelled, true, atol=1e-12 * scale)  # rounding
    # the run's forces see the last step's velocity, the record has this step's: a part of the viscous force
    np.testing.assert_allclose(right.measured, true, atol=1e-4 * scale)
    np.testing.assert_allclose(other.measured, right.measured, atol=1e-9 * scale)  # rounding: sums in another order
    assert np.abs(other.modelled - true).max() > 1.5 * table.actuators[0].seal_friction
    fast = np.abs(right.velocity) > 0.5 * np.abs(right.velocity).max()
    assert np.all(right.measured[fast] * right.velocity[fast] > 0.0)  # positive against a positive velocity


def test_mass_counts_as_inertia_and_samples_whose_slip_noise_hides_are_left_out(table, test):
    heavy = table.with_params({"platen.mass": [1.1 * m for m in table.platen.mass]})
    light, more = (friction_of(machine, test)["x"] for machine in (table, heavy))
    inertia = 0.1 * table.platen.mass[0] * test.motion.acceleration[:, 0]
    # a heavier table leaves less of the same force to friction
    np.testing.assert_allclose(more.measured - light.measured, -inertia, atol=1e-6 * np.abs(inertia).max())
    weight = np.where(np.arange(test.samples) < 100, 0.0, 1.0)
    assert friction_of(table, replace(test, weight=weight))["x"].velocity.size == test.samples - 100
    assert friction_of(table, replace(test, channels={})) == {}


# ---------------------------------------------------------------------------------------------------------- valves
def test_the_modelled_valve_curve_is_the_flow_curve_at_half_the_supply(table, test):
    """Of a valve with equal paths: q / A sqrt(half the supply / rated drop) times its flow curve (Eqs. 4-1, 4-2)."""
    (drive,), oil = table.actuators, table.hydraulics
    half = 0.5 * (oil.supply_pressure - oil.return_pressure)
    full = drive.flow / drive.area_a * np.sqrt(half / oil.rated_pressure)
    curve = valves_of(table, test)[drive.name]
    expected = full * np.array([opening(x, drive.flow_curve) for x in curve.spool])
    np.testing.assert_allclose(curve.modelled, expected, atol=1e-12 * np.abs(expected).max())  # rounding
    # the spool held over a step against its sample, and rates of pressure with a low-pass: some thousandths
    error = np.sqrt(np.mean((curve.measured - expected)[20:-20] ** 2))
    assert error < 0.01 * np.sqrt(np.mean(expected**2))


def test_a_null_bias_shifts_the_measured_curve_and_not_the_opening(table):
    bias = 0.03
    (drive,) = table.actuators
    biased = table.with_effect("spool_null_bias", (drive.name,), bias=bias)
    test = measured_of(shaken(biased, samples=600))
    ideal, real = (valves_of(machine, test)[drive.name] for machine in (table, biased))
    # the measured curve differs with the model only in the few samples near null where its residual turns the flow
    assert np.median(np.abs(ideal.measured - real.measured)) < 1e-6 * np.abs(real.measured).max()
    small = np.abs(ideal.spool) < 0.1
    slope, offset = np.polyfit(ideal.spool[small], ideal.measured[small], 1)
    assert -offset / slope == pytest.approx(-bias, rel=0.1)
    slope, offset = np.polyfit(ideal.spool[small], ideal.modelled[small], 1)
    assert abs(offset / slope) < 0.1 * bias


def test_without_pressures_or_spools_there_is_no_valve_curve(table, test):
    """A force on equal areas is a pressure difference, and replaces pressures."""
    silent = test.with_channels(chamber_pressure_a=None, actuator_force=None, pressure_difference=None)
    assert valves_of(table, silent) == {}
    assert valves_of(table, test.with_channels(spool_position=None, valve_command=None)) == {}


# ----------------------------------------------------------------------------------------------------------- report
def test_the_figures_draw_what_was_measured_and_both_models_with_close_ups_about_zero(table, test):
    before, after = (friction_of(m, test) for m in (table.with_params({"drive.viscous": 0.0}), table))
    valves = valves_of(table, test)
    (name,) = valves
    curves = Curves(
        ("shaken",),
        {"x": {"as delivered": before["x"], "calibrated": after["x"]}},
        {name: {"as delivered": valves[name], "calibrated": valves[name]}},
    )
    friction, valve = curve_blocks(curves, table)
    assert isinstance(friction, Figure) and isinstance(valve, Figure)
    assert [t["name"] for t in friction.traces] == 3 * ["measured", "model as delivered", "model calibrated"]
    assert [t["name"] for t in valve.traces] == 2 * ["measured", "model as delivered", "model calibrated"]
    whole, close, path = (friction.traces[k] for k in (0, 3, 6))
    peak = np.abs(after["x"].velocity).max()
    assert np.abs(numbers(whole["x"])).max() == pytest.approx(peak, rel=1e-6)  # float32
    assert np.abs(numbers(close["x"])).max() <= 0.2 * 1e3 * peak * (1 + 1e-6)  # [mm/s]
    np.testing.assert_allclose(numbers(whole["y"]), 1e-3 * after["x"].measured, rtol=1e-6)  # [kN]
    np.testing.assert_allclose(numbers(path["x"]), 1e3 * after["x"].displacement, rtol=1e-6)  # [mm]
    np.testing.assert_allclose(numbers(friction.traces[1]["y"]), 1e-3 * before["x"].modelled, rtol=1e-6)


def test_of_many_actuators_those_of_the_effects_are_drawn_else_one_of_each_kind():
    machine = machine_named("lhpost6")
    line = np.linspace(-1.0, 1.0, 5)
    curves = Curves(("T",), {}, {a: {"m": ValveCurve(line, line, line)} for a in machine.actuator_names})
    drawn = [curve_blocks(curves, machine, named)[0].layout["annotations"] for named in ((), ("H3",))]
    titles = [" ".join(a["text"] for a in annotations) for annotations in drawn]
    assert "H1" in titles[0] and "V1" in titles[0] and "H2" not in titles[0]
    assert "H3" in titles[1] and "H1" not in titles[1]
    assert "neither forces" in str(curve_blocks(Curves(), machine)[0])

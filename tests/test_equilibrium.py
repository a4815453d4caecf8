"""Rest in the control zero-position: forces that hold the platen, pressures that give them, spools that feed leaks."""

import numpy as np
import pytest

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.core.errors import SimulationError
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.effects.registry import parameters_of
from lhpost6_pin.machine.machine import Machine
from lhpost6_pin.mechanics.derivatives import evaluate_derivatives
from lhpost6_pin.mechanics.equilibrium import find_equilibrium, rest_pressures
from lhpost6_pin.mechanics.plant import Plant, make_plant
from lhpost6_pin.mechanics.pose import platen_motion
from lhpost6_pin.mechanics.schemes import A
from lhpost6_pin.mechanics.workspace import make_workspace
from lhpost6_pin.simulation.simulate import ClosedLoop, simulate

MPA = 1e6


def loaded(machine: Machine, **pull: float) -> Machine:
    """Pull on platen ports with constant forces [N] or moments [N m]: a gas spring so long that it does not notice."""
    effect = Effect(
        "load",
        "nitrogen_strut",
        tuple(f"platen.{axis}" for axis in pull),
        tuple((force, 1.0, 1e9, 1.0) for force in pull.values()),
        "test",
    )
    return machine.with_effect(effect)


def at_rest(plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    """Acceleration (6,) and rates of hidden states in the equilibrium."""
    rest = find_equilibrium(plant)
    ws = make_workspace(plant, rest.state)
    assert evaluate_derivatives(plant, ws, rest.spool) == 0
    return ws.motion[A].copy(), ws.zd.copy()


def test_the_machine_rests_at_the_pressures_and_spools_that_follow_from_its_tables(plant: Plant) -> None:
    """Zero horizontal force: P_A and P_B are unique, for the same oil must leak through and flow past both orifices."""
    rest = find_equilibrium(plant)
    k = [plant.state_index("actuators_4_way", f"H{i}", p) for i in range(1, 5) for p in ("pressure_a", "pressure_b")]
    k += [plant.state_index("actuators_3_way", f"V{i}", "pressure_a") for i in range(1, 7)]
    # four digits are known of each
    np.testing.assert_allclose(rest.state.z[k], [5.504 * MPA, 8.601 * MPA] * 4 + [2.767 * MPA] * 6, atol=500.0)
    np.testing.assert_allclose(rest.spool, [-4.57e-4] * 4 + [1.91e-4] * 6, atol=5e-7)
    np.testing.assert_allclose(rest.force[:4], 0.0, atol=1e-6)  # rounding of 1.4 MN
    hidden = np.setdiff1d(np.arange(len(plant.states)), k)
    assert not rest.state.z[hidden].any()


def test_the_vertical_actuators_carry_the_weight_and_the_pull_of_the_struts(machine: Machine, plant: Plant) -> None:
    weight = machine.platen.mass[2] * machine.platen.gravity
    pull = sum(s.pressure * s.area for s in machine.struts)
    assert find_equilibrium(plant).force.sum() == pytest.approx(weight + pull, rel=1e-12)


LOADS = [
    {},
    {"z": 2e6},
    {"z": -3e6, "x": 8e5},
    {"y": -6e5, "yaw": 4e5},
    {"x": 2.2e6},  # two actuators push with 0.7 MN each: equal pressures, nothing leaks
    {"roll": 1e6, "pitch": -2e6, "yaw": -1e6, "x": -3e5, "y": 2e5, "z": 1e6},
]


@pytest.mark.parametrize("load", LOADS)
def test_in_equilibrium_nothing_accelerates_and_no_pressure_drifts(machine: Machine, load: dict[str, float]) -> None:
    plant = make_plant(loaded(machine, **load) if load else machine)
    acceleration, zd = at_rest(plant)
    assert np.abs(acceleration).max() < 1e-9  # rounding of 10 MN on 170 t
    # rounding of flows near 1e-4 m3/s, times beta / V = 1e10 Pa/m3
    assert np.abs(zd).max() < 1e-3
    rest = find_equilibrium(plant)
    shut = make_workspace(plant, rest.state)
    evaluate_derivatives(plant, shut, np.zeros(plant.spools))
    fed = plant.rows["state"][plant.tables.actuators]
    leaking = np.abs(shut.zd[fed]) > 1e3
    np.testing.assert_array_equal(leaking, rest.spool != 0.0)  # with closed valves the leak shows at once


@pytest.mark.parametrize("force", [-2e6, -3e5, 0.0, 4.6e5, 5e5, 1e6, 1.1e6, 3e6])
def test_a_loaded_actuator_gets_pressures_that_give_its_force(plant: Plant, force: float) -> None:
    """Between 0.47 and 1.08 MN both chambers carry the same pressure: nothing leaks, the valve stays shut."""
    p = parameters_of(plant.rows[plant.tables.actuators][0])
    (a, b), spool = rest_pressures(p, force, plant.supply)
    assert a * p.area_a - b * p.area_b == pytest.approx(force, abs=1e-6)  # rounding of 1 MN
    assert plant.supply[1] < a < plant.supply[0]
    assert plant.supply[1] < b < plant.supply[0]
    assert spool * (a - b) > 0.0 or spool == a - b == 0.0  # oil comes in on the side that leaks


def test_without_a_leak_the_spools_rest_in_the_middle(machine: Machine) -> None:
    tight = machine.with_params({"horizontal.leakage": 0.0, "vertical.leakage": 0.0})
    rest = find_equilibrium(make_plant(tight))
    assert not rest.spool.any()
    assert np.abs(at_rest(make_plant(tight))[0]).max() < 1e-9


@pytest.mark.parametrize(("load", "name"), [({"z": 6e7}, "V1"), ({"x": -3e7}, "H1"), ({"z": -9e6}, "V1")])
def test_a_load_beyond_the_supply_is_refused_by_the_actuators_name(
    machine: Machine, load: dict[str, float], name: str
) -> None:
    """60 MN is more than 20 MPa on six pistons; less than nothing they cannot pull."""
    with pytest.raises(SimulationError, match=rf"{name} must give .* beyond its supply"):
        find_equilibrium(make_plant(loaded(machine, **load)))


def test_at_rest_the_machine_stays_at_rest_in_closed_loop(plant: Plant) -> None:
    """Drift over 10 s below 1e-6 m (issue 2); it is rounding, in fact."""
    rest = find_equilibrium(plant)
    loop = make_controller(plant, rest, load_controller("lhpost6"))
    samples = 20480
    run = simulate(plant, ClosedLoop(loop, np.zeros((samples, 6)), rest), samples=samples, engine="fused")
    assert run.trouble is None
    assert len(run.time) == samples
    assert np.abs(platen_motion(plant, run.q, run.v, run.a).displacement).max() < 1e-9

"""What has no name: its formula in few words, and its effect in the machine, switched off."""

import numpy as np
import pytest

from lhpost6_pin.discovery.formula import sparse_formula
from lhpost6_pin.discovery.residual_function import ResidualFunction, _state, with_residual_function
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.effects.evaluate import advance_states, apply_forces
from lhpost6_pin.effects.table import effect_table
from lhpost6_pin.laws.supply import Supply
from lhpost6_pin.laws.tabulated import NODES
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.machine.machine_toml import save_machine_toml

X = np.linspace(-0.2, 0.3, NODES)


def noisy(values: np.ndarray, sd: float = 200.0) -> np.ndarray:
    """Values with noise of that deviation."""
    return values + sd * np.random.default_rng(4).standard_normal(len(values))


@pytest.mark.parametrize(
    ("values", "forms"),
    [
        (5e4 * X, ["(x / 0.3 m)"]),
        (8e3 * np.sign(X), ["sgn x"]),
        (9e3 * np.sin(2 * np.pi * X / 0.125), ["sin(2 pi x / 0.125 m)", "cos(2 pi x / 0.125 m)"]),
    ],
)
def test_a_simple_form_is_recognised_with_its_size(values: np.ndarray, forms: list[str]) -> None:
    found = sparse_formula(X, noisy(values), np.full(NODES, 200.0), "m")
    assert [label for _, label in found.terms][: len(forms)] == forms
    assert found.share > 0.98  # the rest is noise of a fortieth of the size
    largest = max(abs(size) for size, _ in found.terms)
    # of the value at the largest x; noise of 200 N in 24 values
    assert largest == pytest.approx(np.abs(values).max(), rel=0.1)


def test_noise_has_no_formula_to_speak_of() -> None:
    found = sparse_formula(X, noisy(np.zeros(NODES)), np.full(NODES, 200.0), "m")
    assert len(found.terms) <= 2


@pytest.mark.parametrize(
    ("state", "memory"), [("position", 0.0), ("velocity", 0.0), ("recent travel", 2.0), ("past position", 8.0)]
)
def test_a_function_without_a_name_goes_into_the_machine_switched_off(state, memory, tmp_path) -> None:
    sd, held = np.full(NODES, 10.0), np.full(3, 100.0)
    left = ResidualFunction(("H3",), state, memory, X, 1e3 * np.arange(NODES), sd, 500.0, 400.0, held)
    machine = with_residual_function(load_machine(), left)
    (effect,) = machine.added_effects
    assert effect.params[0][0] == 0.0
    (name,) = machine.parameters.effects
    on = load_machine(save_machine_toml(machine, tmp_path / "model.toml")).with_params({f"effect.{name}.share": 1.0})
    (effect,) = on.added_effects
    assert effect.ports == ("H3",)
    # a table's force is against its values: what was found acts as it is
    assert effect.params[0][:5] == pytest.approx((1.0, X[0], X[-1], 0.0, -1e3))
    assert effect.params[0][3 + NODES :] == ((memory, float(state == "past position")) if memory else ())


def test_what_is_remembered_is_the_law_s_hidden_state() -> None:
    """A filter over a whole test against the law's own steps."""
    dt, memory = 1 / 256, 0.5
    x = 0.1 * np.sin(np.linspace(0.0, 9.0, 700))[:, None] * [1.0, -0.3]
    past = _state("past position", memory, x, x, dt)
    table = (1.0, -1.0, 1.0, *np.linspace(-1.0, 1.0, NODES), memory, 1.0)  # the force is the state, reversed
    rows = effect_table([Effect("a", "by_memory", ("leg",), (table,), "test")], ("leg",))
    z = np.zeros(1)
    for k in range(len(x)):
        force, port_force = np.zeros((1, 3)), np.zeros(1)
        apply_forces(rows, x[k, :1], np.zeros(1), z, force, port_force)
        assert force[0, 0] == pytest.approx(-past[k, 0], abs=1e-12)  # rounding
        if k + 1 < len(x):
            advance_states(rows, x[k, :1], x[k + 1, :1] - x[k, :1], dt, np.zeros(1), Supply(2e7, 5e5), z)
    np.testing.assert_array_equal(_state("recent travel", memory, x, x, dt), x - past)

"""Parts of a verdict: probabilities of rivals, their kind, parameters that stand out, tests cut into blocks."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from lhpost6_pin.discovery.discover import discovery_numbers
from lhpost6_pin.discovery.estimates import Estimate
from lhpost6_pin.discovery.finding import EffectFinding, alternatives_of
from lhpost6_pin.discovery.outlying import _of_kinds, outlying_parameters
from lhpost6_pin.discovery.time_blocks import in_blocks
from lhpost6_pin.identification.calibration.free_parameters import machine_parameters, scatter_parameters
from lhpost6_pin.machine.machine import load_machine

NUMBERS, CALIBRATION = discovery_numbers()


def test_probabilities_add_up_and_a_family_at_the_limit_has_odds_of_one_to_twenty():
    found = {a.family: a.probability for a in alternatives_of({"quadratic_drag": 0.0, "local_viscous": 10.0}, 10.0)}
    assert sum(found.values()) == pytest.approx(1.0)
    assert found["quadratic_drag"] / found["local_viscous"] == pytest.approx(20.0)
    equal = alternatives_of({"quadratic_drag": 0.0, "local_viscous": -3.0}, 10.0)  # that gains more, but is less simple
    assert [a.probability for a in equal] == [0.5, 0.5]


def test_rivals_of_one_kind_are_named_by_it():
    def finding(*rivals: str) -> EffectFinding:
        return EffectFinding("quadratic_drag", ("H1",), {}, 1.0, 1.0, rivals=rivals)

    assert finding("local_viscous").kind == "drag that grows with speed"
    assert finding("local_viscous", "stray_spring").kind == ""


def outlying(
    distances: dict[str, float], usual: float, deviation: float = 0.1, gone: tuple[str, ...] = ()
) -> list[EffectFinding]:
    """Findings of a machine's parameters, all `usual` stated deviations off but some; estimates as sharp as given."""
    machine = load_machine("lhpost6")
    parameters = machine_parameters(machine)
    names = [p.name for p in parameters]
    stated = np.array([p.sd for p in parameters])
    x = stated * [distances.get(n, usual * (-1.0) ** i) for i, n in enumerate(names)]
    problem = SimpleNamespace(machine=machine, parameters=parameters, unknowns=(), names=names, stated=stated, free={})
    found = SimpleNamespace(problem=problem, numbers=NUMBERS, solution=SimpleNamespace(x=x), added=())
    estimates = {name: Estimate(1.0, "1", 0.9, 1.1) for name in names}
    return list(outlying_parameters(found, deviation * stated, estimates, gone))


def test_a_parameter_at_three_deviations_stands_out_among_others_near_their_values():
    (one,) = outlying({"vertical.pad_friction": 2.95}, 0.3)
    assert (one.family, len(one.components)) == ("bearing_friction", 6)
    assert outlying({"vertical.pad_friction": 2.95}, 0.9) == []  # as far off as stated deviations allow
    assert outlying({"vertical.pad_friction": 2.5}, 0.3) == []  # calibration
    assert outlying({"vertical.pad_friction": 2.95}, 0.3, gone=("vertical.pad_friction",)) == []  # withdrawn
    assert outlying({"vertical.pad_friction": 2.95}, 0.3, deviation=0.6) == []  # hardly told


def test_a_shared_number_that_the_scatter_of_all_components_cancels_does_not_stand_out():
    machine = load_machine("lhpost6")
    scatter = [p for p in scatter_parameters(machine, 0.03, 3.0) if p.of == "vertical.flow"]
    parameters = (*machine_parameters(machine), *scatter)
    x = np.array([0.1 * (p.name == "vertical.flow") - 0.0909 * (p in scatter) for p in parameters])
    (place,) = (i for i, p in enumerate(parameters) if p.name == "vertical.flow")
    assert len(scatter) == 6 and abs(_of_kinds(parameters, x)[place]) < 0.005  # a log, or a factor: of second order
    x[len(parameters) - 6 :] = 0.0
    assert _of_kinds(parameters, x)[place] == pytest.approx(0.1)


def record(name: str, seconds: float) -> xr.Dataset:
    time = np.arange(0.0, seconds, 1.0 / 256.0)
    return xr.Dataset({"x": ("time", time)}, coords={"time": time}, attrs={"test": name})


def test_few_tests_are_cut_into_blocks_and_held_out_ones_are_not():
    records = [record("A", 20.0), record("B", 30.0), record("C", 40.0)]
    blocks, held = in_blocks(records, (1,), NUMBERS, CALIBRATION)
    names = [b.attrs["test"] for b in blocks]
    assert names == ["A, block 1 of 2", "A, block 2 of 2", "B", "C, block 1 of 2", "C, block 2 of 2"]
    assert held == (2,)
    assert sum(b.sizes["time"] for b in blocks[:2]) == records[0].sizes["time"]


def test_enough_tests_and_short_ones_stay_whole():
    records = [record(name, 20.0) for name in "ABC"]
    assert in_blocks(records, (), NUMBERS, CALIBRATION) == (records, ())
    short = [record("A", 8.0)]
    assert in_blocks(short, (), NUMBERS, CALIBRATION) == (short, ())

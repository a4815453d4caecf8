"""Oil that a test draws from the supply, against pumps and accumulators."""

import numpy as np
import pytest
from page_cases import Reader
from run_cases import driven

from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.show.report.run_report import write_run_report
from lhpost6_pin.simulation.oil_use import Bank, oil_use
from lhpost6_pin.simulation.outputs import record_of_run

STEP = 0.01


def test_pumps_give_nothing_to_full_accumulators():
    pumps = 2.0
    flow = np.concatenate([np.zeros(200), np.full(101, 5.0), np.zeros(400), np.full(51, 5.0)])
    use = oil_use(flow, STEP, pumps)
    # 1 s of 3 above what the pumps give, refilled in the 4 s after it, then half of that; edges are ramps of a step
    assert use.from_accumulators == pytest.approx(3.0, abs=5.0 * STEP)
    assert use.volume == pytest.approx(7.5, abs=10.0 * STEP)
    assert use.peak == 5.0 and use.mean == pytest.approx(use.volume / (STEP * (len(flow) - 1)))
    assert oil_use(np.full(50, pumps), STEP, pumps).from_accumulators == pytest.approx(0.0, abs=1e-12)


def test_without_pumps_known_only_flow_and_volume_are():
    use = oil_use(np.full(101, 5.0), STEP)
    assert use.volume == pytest.approx(5.0) and np.isnan(use.from_accumulators)


def test_a_run_draws_what_its_pistons_sweep(machine):
    """Beyond the leaks at rest: area A times velocity where a rod extends, area B where it retracts."""
    n = 2 * 2048
    spool = np.zeros((n, len(machine.actuators)))
    spool[:, :4] = 0.1 * np.sin(2.0 * np.pi * np.arange(n) / 2048.0)[:, None] * [1.0, 1.0, -1.0, -1.0]  # along x
    record = record_of_run(driven(machine, spool), {"test": "oil"})
    flow = record["supply_flow"].values
    step = float(record["time"][1] - record["time"][0])
    rates = np.gradient(record["actuator_displacement"].values, step, axis=0)
    areas = np.array([(a.area_a, a.area_b or 0.0) for a in machine.actuators])
    swept = np.sum(np.where(rates > 0.0, areas[:, 0], -areas[:, 1]) * rates, axis=1)
    drawn = (flow - flow[0]).sum() * step
    assert swept.sum() * step > 0.02  # tens of litres
    # oil is compressed and let off again, and leaks change with pressure: a few per cent
    assert drawn == pytest.approx(swept.sum() * step, rel=0.05)
    assert record["supply_flow"].attrs["pump_flow_evidence"] == "assumed"
    assert record["supply_flow"].attrs["accumulators"] == machine.parameters.number("power_supply.accumulators")


def test_accumulators_give_what_lies_between_two_pressures_of_their_gas():
    """By hand, for 10 m3 precharged to 10 MPa, charged to 20 MPa, down to 16 MPa: isothermal and adiabatic."""
    bank = Bank(10.0, 10e6, 20e6, 16e6, 1.0)
    assert bank.gas == 5.0 and bank.usable == pytest.approx(1.25)  # 10 (10/16 - 10/20)
    assert bank._replace(gas_index=1.4).usable == pytest.approx(5.0 * (1.25 ** (1 / 1.4) - 1.0))
    for index in (1.0, 1.4):
        one = bank._replace(gas_index=index)
        assert one.pressure_after(one.usable) == pytest.approx(16e6) and one.pressure_after(0.0) == 20e6


def test_a_report_judges_oil_by_the_usable_volume(machine, tmp_path):
    record = record_of_run(driven(machine, np.full((600, len(machine.actuators)), 0.02)), {"test": "oil"})
    known = machine.power_supply
    bank = Bank(known.accumulators, known.precharge, known.charged, known.lowest, known.gas_index)
    assert 0.05 * known.accumulators < bank.usable < 0.15 * known.accumulators
    flow = 0.5 + 0 * record["supply_flow"]  # far above the pumps'
    taken = (0.5 - known.pump_flow) * float(record["time"][-1] - record["time"][0])
    write_run_report(record.assign(supply_flow=flow.assign_attrs(record["supply_flow"].attrs)), tmp_path / "a.html")
    words = Reader(tmp_path / "a.html").words
    assert "usable volume of the accumulators, 20.7 to 17.6 MPa (assumed)" in words
    assert f"share of it that is drawn {100 * taken / bank.usable:.3g}" in words.replace("  ", " ")
    bare = {key: value for key, value in record["supply_flow"].attrs.items() if not key.startswith("lowest")}
    record["supply_flow"].attrs = bare
    write_run_report(record, tmp_path / "b.html")
    assert "usable volume" not in Reader(tmp_path / "b.html").words


def test_gas_pressures_out_of_order_are_refused():
    with pytest.raises(ParameterError, match="precharge <= lowest < charged"):
        load_machine().with_params({"power_supply.lowest": {"value": 1e7, "unit": "Pa"}})

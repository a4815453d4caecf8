"""Commands per actuator and per servovalve: twin valves act as one of their mean opening."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lhpost6_pin.control.valves import flow_curves, per_actuator, per_valve, valve_counts, valve_names
from lhpost6_pin.laws.orifice import opening, port_flow
from lhpost6_pin.machine.machine import load_machine

ONE, TWO = (load_machine().with_valves(valves) for valves in (1, 2))
COUNTS, CURVES = valve_counts(TWO), flow_curves(TWO)
SPOOL = st.floats(-1.0, 1.0)


def test_the_table_has_ten_servovalves_or_fourteen():
    assert valve_names(ONE) == ONE.actuator_names
    assert valve_names(TWO) == tuple("H1A H1B H2A H2B H3A H3B H4A H4B V1 V2 V3 V4 V5 V6".split())


@given(st.lists(st.floats(-2.0, 2.0), min_size=10, max_size=10))
def test_commands_of_actuators_come_back_from_their_valves_to_the_last_bit(command):
    valves = per_valve(np.array(command), COUNTS)
    assert len(valves) == 14 and (valves[0:8:2] == valves[1:8:2]).all()
    assert np.array_equal(per_actuator(valves, COUNTS, CURVES), command)


@given(st.tuples(SPOOL, SPOOL), st.sampled_from([1.0, -1.0]), st.floats(1e6, 2e7))
def test_valves_open_to_the_same_side_give_together_the_flow_of_two_at_their_mean_opening(pair, side, chamber):
    commands = np.zeros(14)
    commands[:2] = side * np.abs(pair)
    spool = per_actuator(commands, COUNTS, CURVES)[0]

    def flow(x):
        return port_flow(opening(x, CURVES[0]), 2e-6, 1e-6, 2.1e7, 1e5, chamber, 500.0)[0]

    # two unit openings to rounding, through exp and log: 1e-12 of full flow, 2e-6 sqrt(2e7) m3/s
    assert 2 * flow(spool) == pytest.approx(flow(commands[0]) + flow(commands[1]), rel=1e-9, abs=1e-14)


def test_valves_open_to_opposite_sides_alike_leave_the_actuator_at_rest():
    commands = np.zeros(14)
    commands[2:4] = 0.4, -0.4
    assert per_actuator(commands, COUNTS, CURVES)[1] == pytest.approx(0.0, abs=1e-15)  # one rounding of 0.4


def test_a_valve_driven_beyond_full_stroke_counts_as_fully_open():
    commands = np.zeros(14)
    commands[:2] = 5.0, 0.5
    beyond = per_actuator(commands, COUNTS, CURVES)
    commands[0] = 1.0
    assert np.array_equal(beyond, per_actuator(commands, COUNTS, CURVES))
    assert 0.5 < beyond[0] < 1.0 and not beyond[1:].any()

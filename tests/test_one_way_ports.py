"""One-way ports P and T (report Section 4.1.2) against the orifice of Eq. 4-2."""

import pytest

from lhpost6_pin.core.errors import ParameterError
from lhpost6_pin.effects.table import effect_table
from lhpost6_pin.laws.hydraulic import Hydraulic, exchanged_flows, valve_flows
from lhpost6_pin.machine.machine import load_machine

HIGH, LOW = 20.7e6, 0.3e6


def _row(name, ports):
    machine = load_machine().with_params({"machine.valve_ports": ports})
    effect = next(e for e in machine.effects if name in e.ports and e.law == "hydraulic")
    numbers = dict(zip(effect.ports, effect.params, strict=True))[name]
    return Hydraulic(*numbers, **{"one_way": 1.0} if ports == "one_way" else {})


@pytest.mark.parametrize("name", ["H1", "V1"])
def test_flows_with_the_direction_of_the_ports_are_those_of_the_report_and_others_are_zero(name):
    both, one = _row(name, "both_ways"), _row(name, "one_way")
    found = set()
    for spool in (-0.6, -0.01, 0.01, 0.6):
        for pressure_a in (0.0, 0.2e6, 5e6, 20e6, 22e6):
            for pressure_b in (0.0, 0.2e6, 5e6, 20e6, 22e6):
                free = valve_flows(both, True, spool, pressure_a, pressure_b, HIGH, LOW)
                held = valve_flows(one, True, spool, pressure_a, pressure_b, HIGH, LOW)
                backwards = pressure_a > HIGH if spool > 0 else pressure_a < LOW
                assert (held[0], held[2]) == ((0.0, 0.0) if backwards else (free[0], free[2]))
                if name == "H1":
                    backwards_b = pressure_b > HIGH if spool < 0 else pressure_b < LOW
                    assert (held[1], held[3]) == ((0.0, 0.0) if backwards_b else (free[1], free[3]))
                found.add(backwards)
                assert min(exchanged_flows(one, spool, pressure_a, pressure_b, HIGH, LOW)) >= 0.0
    assert found == {True, False}


def test_null_leakage_does_not_flow_back_either():
    leaky = _row("H1", "one_way")._replace(null_leakage=1e-6, null_width=0.02)
    for pressure in (0.0, 22e6):
        drawn, returned, *slopes = exchanged_flows(leaky, 0.0, pressure, pressure, HIGH, LOW)
        assert drawn >= 0.0 and returned >= 0.0 and min(slopes) >= 0.0
    free = exchanged_flows(leaky._replace(one_way=0.0), 0.0, 22e6, 22e6, HIGH, LOW)
    assert free[0] < 0.0  # the same valve without the option feeds the supply


def test_the_machine_file_chooses_and_every_actuator_has_it():
    machine = load_machine().with_params({"machine.valve_ports": "one_way"})
    ports = [a.name for a in machine.actuators]
    legs = [*ports, *(s.name for s in machine.struts)]
    oil = [e for e in machine.effects if e.law in ("hydraulic", "one_way_ports")]
    rows = effect_table(oil, legs)
    place = Hydraulic._fields.index("one_way")
    acting = [row for row in rows if row["modified"]]
    assert len(acting) == len(ports) and all(row["numbers"][place] == 1.0 for row in acting)
    assert not any(e.law == "one_way_ports" for e in load_machine().effects)


def test_an_unknown_word_is_refused():
    with pytest.raises(ParameterError, match="valve_ports"):
        load_machine().with_params({"machine.valve_ports": "sideways"})

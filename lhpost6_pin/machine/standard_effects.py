"""The effects of the report's model (Chapter 4) for the components of a machine."""

from ..effects.effect import Effect
from ..laws.end_stop import REACH
from ..laws.orifice import flow_at_full_stroke, width_ratios
from .components import Actuator, Strut
from .structure import Structure

__all__ = ["standard_effects"]


def standard_effects(structure: Structure) -> tuple[Effect, ...]:
    """The report's effects (Chapter 4) for these components, in ledger order; friction of zero has no row."""
    actuators, struts = structure.actuators, structure.struts
    found = []
    for valve in ("4-way", "3-way"):
        fed = [(i, a) for i, a in enumerate(actuators) if a.valve == valve]
        if fed:
            found.append(
                Effect(
                    f"actuators_{valve.replace('-', '_')}",
                    "hydraulic",
                    tuple(a.name for _, a in fed),
                    tuple(_hydraulic_numbers(a, structure) for _, a in fed),
                    "Eqs. 4-1 to 4-6",
                    tuple(i for i, _ in fed),
                )
            )
    if structure.valve_ports == "one_way":
        names = tuple(a.name for a in actuators)
        found.append(Effect("one_way_ports", "one_way_ports", names, ((1.0,),) * len(names), "Section 4.1.2"))
    if struts:
        gas = tuple((s.pressure, s.area, s.gas_length, s.polytropic_index) for s in struts)
        found.append(Effect("hold_down", "nitrogen_strut", tuple(s.name for s in struts), gas, "Eq. 4-8"))
    legs: list[Actuator | Strut] = [*actuators, *struts]
    rubbing = [c for c in legs if c.seal_friction > 0.0]
    if rubbing:
        seals = tuple((c.seal_friction, c.seal_yield, c.seal_shape) for c in rubbing)
        found.append(Effect("seal_friction", "bouc_wen_1d", tuple(c.name for c in rubbing), seals, "Eq. 4-18"))
    pads = [a for a in actuators if a.mount == "bearing" and a.pad_friction]
    if pads:
        slip = tuple((a.pad_friction, a.pad_yield, a.pad_shape) for a in pads)
        found.append(Effect("pad_friction", "bouc_wen_2d", tuple(a.name for a in pads), slip, "Eqs. 4-12 to 4-17"))
    viscous = tuple((a.viscous,) for a in actuators)
    found.append(Effect("viscous", "viscous", tuple(a.name for a in actuators), viscous, "Eq. 4-19"))
    stopped = [(a, a.bumper_stiffness) for a in actuators if a.bumper_stiffness]
    if stopped:
        ends = tuple((stiffness * REACH, a.stroke, 1.0) for a, stiffness in stopped)
        found.append(Effect("bumper", "end_stop", tuple(a.name for a, _ in stopped), ends, "beyond the stroke"))
    return tuple(found)


def _hydraulic_numbers(actuator: Actuator, structure: Structure) -> tuple[float, ...]:
    oil = structure.hydraulics
    flow = actuator.flow * actuator.valves / oil.rated_pressure**0.5
    if structure.flow_reading == "full_stroke":
        flow = flow_at_full_stroke(flow, actuator.flow_curve)
    if actuator.valve == "4-way":
        w1, w2, w3, w4 = width_ratios(actuator.area_a, actuator.area_b)
    else:
        w1, w2, w3, w4 = 1.0, 0.0, 1.0, 0.0
    return (
        actuator.area_a,
        actuator.area_b or 0.0,
        flow * w1,
        flow * w2,
        flow * w3,
        flow * w4,
        actuator.flow_curve,
        actuator.leakage,
        actuator.chamber_a,
        actuator.chamber_b or 0.0,
        oil.bulk_modulus,
        oil.root_regularisation,
    )

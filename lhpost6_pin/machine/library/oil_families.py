"""What oil does beyond the report's equations, in actuators, valves and supply."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..structure import Structure

__all__ = ["BUILD"]


def _altering(law: str, *names: str) -> Callable[..., Any]:
    """A family whose numbers are the law's, in this order, alike on all its components."""

    def build(machine: Structure, components: Sequence[str], values: Mapping[str, float]) -> Any:
        return law, components, [tuple(values[name] for name in names)] * len(components)

    return build


BUILD = {
    "piston_leakage": _altering("extra_leakage", "leakage"),
    "turbulent_leakage": _altering("turbulent_leakage", "coefficient"),
    "external_leakage": _altering("external_leakage", "leakage", "side"),
    "entrained_air": _altering("entrained_air", "air", "polytropic_index"),
    "dead_volume": _altering("dead_volume", "volume", "side"),
    "swivel_play": _altering("play", "half_play", "closing_force"),
    "valve_deadband": _altering("deadband", "overlap"),
    "null_leakage": _altering("null_leakage", "leakage", "width"),
    "spool_null_bias": _altering("null_bias", "bias"),
    "spool_lag": _altering("valve_lag", "time"),
    "transport_delay": _altering("valve_delay", "delay"),
    "supply_droop": _altering("supply_droop", "droop", "time", "weight"),
    "return_back_pressure": _altering("back_pressure", "rise", "time"),
    "flow_curve_error": _altering("flow_curve", "error", "side", "power"),
    "cavitation": _altering("cavitation", "share", "vapour_pressure"),
    "supply_line": _altering("supply_line", "inertance", "frequency", "damping"),
    "line_dynamics": _altering("line", "time", "damping"),
}

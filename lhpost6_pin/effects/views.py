"""Laws by name and code, a row's numbers as the parameters of its law; by `scripts/generate_dispatch.py`.

A row's code says its law, its numbers are the law's parameters in order.
"""

from collections.abc import Mapping

from ..core.compiled import compiled_inline
from ..laws import (
    asymmetric,
    backlash,
    ball,
    bouc_wen_1d,
    bouc_wen_2d,
    bulk,
    by_memory,
    by_position,
    by_speed,
    chamber,
    constant,
    dahl_instead,
    drag,
    end_stop,
    gas_heat,
    gas_leak,
    hydraulic,
    leaks,
    lines,
    load_friction,
    nitrogen_strut,
    oscillator,
    platen_body,
    play,
    smooth_ball,
    spool,
    spring,
    stribeck,
    supply,
    valve_path,
    viscous,
    warm_up,
)
from ..laws.contract import Law

__all__ = [
    "CODES",
    "HYDRAULIC",
    "INLINED",
    "LAWS",
    "MOST_NUMBERS",
    "view_bouc_wen_1d",
    "view_bouc_wen_2d",
    "view_hydraulic",
    "view_nitrogen_strut",
    "view_viscous",
    "view_asymmetric",
    "view_backlash",
    "view_ball",
    "view_by_memory",
    "view_by_position",
    "view_by_speed",
    "view_constant",
    "view_dahl_instead",
    "view_drag",
    "view_end_stop",
    "view_gas_heat",
    "view_gas_leak",
    "view_load_friction",
    "view_oscillator",
    "view_smooth_ball",
    "view_spring",
    "view_stribeck",
    "view_warm_up",
]

CODES: Mapping[str, int] = {
    "bouc_wen_1d": 0,
    "bouc_wen_2d": 1,
    "hydraulic": 2,
    "nitrogen_strut": 3,
    "viscous": 4,
    "asymmetric": 5,
    "backlash": 6,
    "ball": 7,
    "by_memory": 8,
    "by_position": 9,
    "by_speed": 10,
    "constant": 11,
    "dahl_instead": 12,
    "drag": 13,
    "end_stop": 14,
    "gas_heat": 15,
    "gas_leak": 16,
    "load_friction": 17,
    "oscillator": 18,
    "smooth_ball": 19,
    "spring": 20,
    "stribeck": 21,
    "warm_up": 22,
}
"""Codes of the laws that have rows."""

INLINED = 5
"""Codes below it are those of the report's laws."""

HYDRAULIC = 2
"""Code of the actuators' law."""

MOST_NUMBERS = 33
"""Numbers of the law that has most parameters."""

LAWS: Mapping[str, Law] = {
    "bouc_wen_1d": bouc_wen_1d.LAW,
    "bouc_wen_2d": bouc_wen_2d.LAW,
    "hydraulic": hydraulic.LAW,
    "nitrogen_strut": nitrogen_strut.LAW,
    "viscous": viscous.LAW,
    "asymmetric": asymmetric.LAW,
    "backlash": backlash.LAW,
    "ball": ball.LAW,
    "by_memory": by_memory.LAW,
    "by_position": by_position.LAW,
    "by_speed": by_speed.LAW,
    "constant": constant.LAW,
    "dahl_instead": dahl_instead.LAW,
    "drag": drag.LAW,
    "end_stop": end_stop.LAW,
    "gas_heat": gas_heat.LAW,
    "gas_leak": gas_leak.LAW,
    "load_friction": load_friction.LAW,
    "oscillator": oscillator.LAW,
    "smooth_ball": smooth_ball.LAW,
    "spring": spring.LAW,
    "stribeck": stribeck.LAW,
    "warm_up": warm_up.LAW,
    "entrained_air": bulk.LAWS["entrained_air"],
    "cavitation": bulk.LAWS["cavitation"],
    "dead_volume": chamber.LAWS["dead_volume"],
    "extra_leakage": leaks.LAWS["extra_leakage"],
    "turbulent_leakage": leaks.LAWS["turbulent_leakage"],
    "external_leakage": leaks.LAWS["external_leakage"],
    "null_leakage": leaks.LAWS["null_leakage"],
    "line": lines.LAWS["line"],
    "supply_line": lines.LAWS["supply_line"],
    "thrust_direction": platen_body.LAWS["thrust_direction"],
    "more_inertia": platen_body.LAWS["more_inertia"],
    "play": play.LAW,
    "null_bias": spool.LAWS["null_bias"],
    "deadband": spool.LAWS["deadband"],
    "flow_curve": spool.LAWS["flow_curve"],
    "supply_droop": supply.LAWS["supply_droop"],
    "back_pressure": supply.LAWS["back_pressure"],
    "valve_delay": valve_path.LAWS["valve_delay"],
    "valve_lag": valve_path.LAWS["valve_lag"],
}
"""All laws by name."""


@compiled_inline
def view_bouc_wen_1d(numbers):
    """Parameters of `bouc_wen_1d`."""
    return bouc_wen_1d.Friction(numbers[0], numbers[1], numbers[2])


@compiled_inline
def view_bouc_wen_2d(numbers):
    """Parameters of `bouc_wen_2d`."""
    return bouc_wen_2d.Friction(numbers[0], numbers[1], numbers[2])


@compiled_inline
def view_hydraulic(numbers):
    """Parameters of `hydraulic`."""
    return hydraulic.Hydraulic(
        numbers[0],
        numbers[1],
        numbers[2],
        numbers[3],
        numbers[4],
        numbers[5],
        numbers[6],
        numbers[7],
        numbers[8],
        numbers[9],
        numbers[10],
        numbers[11],
        numbers[12],
        numbers[13],
        numbers[14],
        numbers[15],
        numbers[16],
        numbers[17],
        numbers[18],
        numbers[19],
        numbers[20],
        numbers[21],
        numbers[22],
        numbers[23],
        numbers[24],
        numbers[25],
        numbers[26],
        numbers[27],
        numbers[28],
        numbers[29],
        numbers[30],
        numbers[31],
        numbers[32],
    )


@compiled_inline
def view_nitrogen_strut(numbers):
    """Parameters of `nitrogen_strut`."""
    return nitrogen_strut.Gas(numbers[0], numbers[1], numbers[2], numbers[3])


@compiled_inline
def view_viscous(numbers):
    """Parameters of `viscous`."""
    return viscous.Viscous(numbers[0])


@compiled_inline
def view_asymmetric(numbers):
    """Parameters of `asymmetric`."""
    return asymmetric.Friction(numbers[0], numbers[1], numbers[2])


@compiled_inline
def view_backlash(numbers):
    """Parameters of `backlash`."""
    return backlash.Backlash(numbers[0], numbers[1], numbers[2])


@compiled_inline
def view_ball(numbers):
    """Parameters of `ball`."""
    return ball.Ball(numbers[0], numbers[1], numbers[2])


@compiled_inline
def view_by_memory(numbers):
    """Parameters of `by_memory`."""
    return by_memory.MemoryTable(numbers[0], numbers[1], numbers[2], numbers[3:27], numbers[27], numbers[28])


@compiled_inline
def view_by_position(numbers):
    """Parameters of `by_position`."""
    return by_position.Table(numbers[0], numbers[1], numbers[2], numbers[3:27])


@compiled_inline
def view_by_speed(numbers):
    """Parameters of `by_speed`."""
    return by_speed.Table(numbers[0], numbers[1], numbers[2], numbers[3:27])


@compiled_inline
def view_constant(numbers):
    """Parameters of `constant`."""
    return constant.Constant(numbers[0])


@compiled_inline
def view_dahl_instead(numbers):
    """Parameters of `dahl_instead`."""
    return dahl_instead.DahlInstead(numbers[0], numbers[1], numbers[2], numbers[3])


@compiled_inline
def view_drag(numbers):
    """Parameters of `drag`."""
    return drag.Drag(numbers[0], numbers[1])


@compiled_inline
def view_end_stop(numbers):
    """Parameters of `end_stop`."""
    return end_stop.EndStop(numbers[0], numbers[1], numbers[2])


@compiled_inline
def view_gas_heat(numbers):
    """Parameters of `gas_heat`."""
    return gas_heat.GasHeat(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5])


@compiled_inline
def view_gas_leak(numbers):
    """Parameters of `gas_leak`."""
    return gas_leak.GasLeak(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5])


@compiled_inline
def view_load_friction(numbers):
    """Parameters of `load_friction`."""
    return load_friction.LoadFriction(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4])


@compiled_inline
def view_oscillator(numbers):
    """Parameters of `oscillator`."""
    return oscillator.Oscillator(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5])


@compiled_inline
def view_smooth_ball(numbers):
    """Parameters of `smooth_ball`."""
    return smooth_ball.SmoothBall(numbers[0], numbers[1])


@compiled_inline
def view_spring(numbers):
    """Parameters of `spring`."""
    return spring.Spring(numbers[0], numbers[1])


@compiled_inline
def view_stribeck(numbers):
    """Parameters of `stribeck`."""
    return stribeck.Stribeck(numbers[0], numbers[1], numbers[2], numbers[3])


@compiled_inline
def view_warm_up(numbers):
    """Parameters of `warm_up`."""
    return warm_up.WarmUp(numbers[0], numbers[1], numbers[2], numbers[3])

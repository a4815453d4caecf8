"""From a row of the effect table to its law: written by `scripts/generate_dispatch.py`, do not edit.

A row's code says its law, its numbers are the law's parameters in order (`view_*`). The functions call those of the
law's module with what they ask for by name (`laws.contract`): coordinates s of the ports, their rates sd or increments
ds, hidden states z. Those of the report's laws are put into their callers, the others are called.
"""

from collections.abc import Mapping

from ..core.compiled import compiled, compiled_inline
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

__all__ = ["CODES", "HYDRAULIC", "INLINED", "LAWS", "MOST_NUMBERS", "advance_called", "advance_inlined"]
__all__ += ["apply_forces", "power", "rates", "view_hydraulic"]

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


@compiled
def _load(row, p, z):
    """Force of the actuator on the same leg [N]; p has its areas."""
    k = row.actuator_state
    return z[k] * p.area_a - (z[k + 1] * p.area_b if p.area_b > 0.0 else 0.0)


@compiled
def force_called(row, s, sd, z):
    """Forces of a row on its first, second and third port [N or N m]."""
    if row.law == 5:  # asymmetric
        p = view_asymmetric(row.numbers)
        first = asymmetric.force(p, z[row.state])
        return first, 0.0, 0.0
    if row.law == 6:  # backlash
        p = view_backlash(row.numbers)
        first = backlash.force(p, z[row.state])
        return first, 0.0, 0.0
    if row.law == 7:  # ball
        p = view_ball(row.numbers)
        first, second, third = ball.force(p, z[row.state], z[row.state + 1], z[row.state + 2])
        return first, second, third
    if row.law == 8:  # by_memory
        p = view_by_memory(row.numbers)
        first = by_memory.force(p, s[row.port], z[row.state])
        return first, 0.0, 0.0
    if row.law == 9:  # by_position
        p = view_by_position(row.numbers)
        first = by_position.force(p, s[row.port])
        return first, 0.0, 0.0
    if row.law == 10:  # by_speed
        p = view_by_speed(row.numbers)
        first = by_speed.force(p, sd[row.port])
        return first, 0.0, 0.0
    if row.law == 11:  # constant
        p = view_constant(row.numbers)
        first = constant.force(p)
        return first, 0.0, 0.0
    if row.law == 12:  # dahl_instead
        p = view_dahl_instead(row.numbers)
        first, second = dahl_instead.force(p, z[row.state], z[row.state + 1], z[row.state + 2], z[row.state + 3])
        return first, second, 0.0
    if row.law == 13:  # drag
        p = view_drag(row.numbers)
        first = drag.force(p, sd[row.port])
        return first, 0.0, 0.0
    if row.law == 14:  # end_stop
        p = view_end_stop(row.numbers)
        first = end_stop.force(p, s[row.port])
        return first, 0.0, 0.0
    if row.law == 15:  # gas_heat
        p = view_gas_heat(row.numbers)
        first = gas_heat.force(p, s[row.port], z[row.state])
        return first, 0.0, 0.0
    if row.law == 16:  # gas_leak
        p = view_gas_leak(row.numbers)
        first = gas_leak.force(p, s[row.port], z[row.state])
        return first, 0.0, 0.0
    if row.law == 17:  # load_friction
        p = view_load_friction(row.numbers)
        first, second = load_friction.force(p, _load(row, p, z), z[row.state], z[row.state + 1])
        return first, second, 0.0
    if row.law == 18:  # oscillator
        p = view_oscillator(row.numbers)
        first, second, third = oscillator.force(
            p, sd[row.port], sd[row.port_2], sd[row.port_3], z[row.state], z[row.state + 1]
        )
        return first, second, third
    if row.law == 19:  # smooth_ball
        p = view_smooth_ball(row.numbers)
        first, second, third = smooth_ball.force(
            p, sd[row.port], sd[row.port_2], (sd[row.port_3] if row.port_3 >= 0 else 0.0)
        )
        return first, second, third
    if row.law == 20:  # spring
        p = view_spring(row.numbers)
        first, second = spring.force(p, s[row.port], (s[row.port_2] if row.port_2 >= 0 else 0.0))
        return first, second, 0.0
    if row.law == 21:  # stribeck
        p = view_stribeck(row.numbers)
        first = stribeck.force(p, sd[row.port], z[row.state])
        return first, 0.0, 0.0
    if row.law == 22:  # warm_up
        p = view_warm_up(row.numbers)
        first = warm_up.force(p, z[row.state], z[row.state + 1])
        return first, 0.0, 0.0
    return 0.0, 0.0, 0.0


@compiled_inline
def apply_forces(rows, s, sd, z, force, port_force):
    """Fill the ledger force (n_rows, 3) and its sum per port."""
    port_force[:] = 0.0
    for i in range(rows.size):
        row = rows[i]
        second = third = 0.0
        if row.law == 0:  # bouc_wen_1d
            p_0 = view_bouc_wen_1d(row.numbers)
            first = bouc_wen_1d.force(p_0, z[row.state])
        elif row.law == 1:  # bouc_wen_2d
            p_1 = view_bouc_wen_2d(row.numbers)
            first, second = bouc_wen_2d.force(p_1, z[row.state], z[row.state + 1])
        elif row.law == 2:  # hydraulic
            p_2 = view_hydraulic(row.numbers)
            first = hydraulic.force(p_2, z[row.state], (z[row.state + 1] if p_2.area_b > 0.0 else 0.0))
        elif row.law == 3:  # nitrogen_strut
            p_3 = view_nitrogen_strut(row.numbers)
            first = nitrogen_strut.force(p_3, s[row.port])
        elif row.law == 4:  # viscous
            p_4 = view_viscous(row.numbers)
            first = viscous.force(p_4, sd[row.port])
        else:
            first, second, third = force_called(row, s, sd, z)
        force[i, 0] = first
        force[i, 1] = second
        force[i, 2] = third
        port_force[row.port] += first
        if row.port_2 >= 0:
            port_force[row.port_2] += second
        if row.port_3 >= 0:
            port_force[row.port_3] += third


@compiled_inline
def advance_inlined(row, s, ds, dt, z):
    """Advance a row's hidden states over one step in which the ports move by ds from s."""
    if row.law == 0:  # bouc_wen_1d
        p = view_bouc_wen_1d(row.numbers)
        z[row.state] = bouc_wen_1d.advance(p, ds[row.port], z[row.state])
        return
    if row.law == 1:  # bouc_wen_2d
        p = view_bouc_wen_2d(row.numbers)
        z[row.state], z[row.state + 1] = bouc_wen_2d.advance(
            p, ds[row.port], ds[row.port_2], z[row.state], z[row.state + 1]
        )
        return


@compiled
def advance_called(row, s, ds, dt, z):
    """Advance a row's hidden states over one step in which the ports move by ds from s."""
    if row.law == 5:  # asymmetric
        p = view_asymmetric(row.numbers)
        z[row.state] = asymmetric.advance(p, ds[row.port], z[row.state])
        return
    if row.law == 6:  # backlash
        p = view_backlash(row.numbers)
        z[row.state] = backlash.advance(p, ds[row.port], z[row.state])
        return
    if row.law == 7:  # ball
        p = view_ball(row.numbers)
        z[row.state], z[row.state + 1], z[row.state + 2] = ball.advance(
            p,
            ds[row.port],
            ds[row.port_2],
            (ds[row.port_3] if row.port_3 >= 0 else 0.0),
            z[row.state],
            z[row.state + 1],
            z[row.state + 2],
        )
        return
    if row.law == 8:  # by_memory
        p = view_by_memory(row.numbers)
        z[row.state] = by_memory.advance(p, s[row.port], ds[row.port], dt, z[row.state])
        return
    if row.law == 12:  # dahl_instead
        p = view_dahl_instead(row.numbers)
        z[row.state], z[row.state + 1], z[row.state + 2], z[row.state + 3] = dahl_instead.advance(
            p,
            ds[row.port],
            (ds[row.port_2] if row.port_2 >= 0 else 0.0),
            row.port_2 >= 0,
            z[row.state],
            z[row.state + 1],
            z[row.state + 2],
            z[row.state + 3],
        )
        return
    if row.law == 15:  # gas_heat
        p = view_gas_heat(row.numbers)
        z[row.state] = gas_heat.advance(p, s[row.port], ds[row.port], dt, z[row.state])
        return
    if row.law == 16:  # gas_leak
        p = view_gas_leak(row.numbers)
        z[row.state] = gas_leak.advance(p, dt, z[row.state])
        return
    if row.law == 17:  # load_friction
        p = view_load_friction(row.numbers)
        z[row.state], z[row.state + 1] = load_friction.advance(
            p,
            ds[row.port],
            (ds[row.port_2] if row.port_2 >= 0 else 0.0),
            row.port_2 >= 0,
            z[row.state],
            z[row.state + 1],
        )
        return
    if row.law == 18:  # oscillator
        p = view_oscillator(row.numbers)
        z[row.state], z[row.state + 1] = oscillator.advance(
            p, ds[row.port], ds[row.port_2], ds[row.port_3], dt, z[row.state], z[row.state + 1]
        )
        return
    if row.law == 21:  # stribeck
        p = view_stribeck(row.numbers)
        z[row.state] = stribeck.advance(p, ds[row.port], z[row.state])
        return
    if row.law == 22:  # warm_up
        p = view_warm_up(row.numbers)
        z[row.state], z[row.state + 1] = warm_up.advance(p, ds[row.port], dt, z[row.state], z[row.state + 1])
        return


@compiled
def rates(row, s, sd, z, zd):
    """Fill the rates of a row's hidden states."""
    if row.law == 0:  # bouc_wen_1d
        p = view_bouc_wen_1d(row.numbers)
        zd[row.state] = bouc_wen_1d.rates(p, sd[row.port], z[row.state])
        return
    if row.law == 1:  # bouc_wen_2d
        p = view_bouc_wen_2d(row.numbers)
        zd[row.state], zd[row.state + 1] = bouc_wen_2d.rates(
            p, sd[row.port], sd[row.port_2], z[row.state], z[row.state + 1]
        )
        return
    if row.law == 5:  # asymmetric
        p = view_asymmetric(row.numbers)
        zd[row.state] = asymmetric.rates(p, sd[row.port], z[row.state])
        return
    if row.law == 6:  # backlash
        p = view_backlash(row.numbers)
        zd[row.state] = backlash.rates(p, sd[row.port], z[row.state])
        return
    if row.law == 7:  # ball
        p = view_ball(row.numbers)
        zd[row.state], zd[row.state + 1], zd[row.state + 2] = ball.rates(
            p,
            sd[row.port],
            sd[row.port_2],
            (sd[row.port_3] if row.port_3 >= 0 else 0.0),
            z[row.state],
            z[row.state + 1],
            z[row.state + 2],
        )
        return
    if row.law == 8:  # by_memory
        p = view_by_memory(row.numbers)
        zd[row.state] = by_memory.rates(p, s[row.port], z[row.state])
        return
    if row.law == 12:  # dahl_instead
        p = view_dahl_instead(row.numbers)
        zd[row.state], zd[row.state + 1], zd[row.state + 2], zd[row.state + 3] = dahl_instead.rates(
            p,
            sd[row.port],
            (sd[row.port_2] if row.port_2 >= 0 else 0.0),
            z[row.state],
            z[row.state + 1],
            z[row.state + 2],
            z[row.state + 3],
        )
        return
    if row.law == 15:  # gas_heat
        p = view_gas_heat(row.numbers)
        zd[row.state] = gas_heat.rates(p, s[row.port], z[row.state])
        return
    if row.law == 16:  # gas_leak
        p = view_gas_leak(row.numbers)
        zd[row.state] = gas_leak.rates(p, z[row.state])
        return
    if row.law == 17:  # load_friction
        p = view_load_friction(row.numbers)
        zd[row.state], zd[row.state + 1] = load_friction.rates(
            p, sd[row.port], (sd[row.port_2] if row.port_2 >= 0 else 0.0), z[row.state], z[row.state + 1]
        )
        return
    if row.law == 18:  # oscillator
        p = view_oscillator(row.numbers)
        zd[row.state], zd[row.state + 1] = oscillator.rates(
            p, sd[row.port], sd[row.port_2], sd[row.port_3], z[row.state], z[row.state + 1]
        )
        return
    if row.law == 21:  # stribeck
        p = view_stribeck(row.numbers)
        zd[row.state] = stribeck.rates(p, sd[row.port], z[row.state])
        return
    if row.law == 22:  # warm_up
        p = view_warm_up(row.numbers)
        zd[row.state], zd[row.state + 1] = warm_up.rates(p, sd[row.port], z[row.state], z[row.state + 1])
        return


@compiled
def power(row, s, z, work):
    """Dissipated power [W] and stored energy [J] of a row that does `work` [W] on its ports."""
    if row.law == 3:  # nitrogen_strut
        p = view_nitrogen_strut(row.numbers)
        return nitrogen_strut.power(p, s[row.port])
    if row.law == 6:  # backlash
        p = view_backlash(row.numbers)
        return backlash.power(p, z[row.state], work)
    if row.law == 14:  # end_stop
        p = view_end_stop(row.numbers)
        return end_stop.power(p, s[row.port])
    if row.law == 15:  # gas_heat
        p = view_gas_heat(row.numbers)
        return gas_heat.power(p, s[row.port], z[row.state])
    if row.law == 16:  # gas_leak
        p = view_gas_leak(row.numbers)
        return gas_leak.power(p, s[row.port], z[row.state])
    if row.law == 20:  # spring
        p = view_spring(row.numbers)
        return spring.power(p, s[row.port], (s[row.port_2] if row.port_2 >= 0 else 0.0))
    return -work, 0.0

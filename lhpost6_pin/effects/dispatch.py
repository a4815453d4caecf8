"""From a row of the effect table to its law: written by `scripts/generate_dispatch.py`, do not edit.

The functions call those of the law's module with what they ask for by name (`laws.contract`): coordinates s of the
ports, their rates sd or increments ds, hidden states z. The report's laws, whose codes are below INLINED, are put into
the loops; the others are called.
"""

from ..core.compiled import compiled, compiled_inline
from ..laws import (
    asymmetric,
    backlash,
    backlash_instead,
    ball,
    bouc_wen_1d,
    bouc_wen_2d,
    by_memory,
    by_position,
    by_speed,
    constant,
    dahl_instead,
    drag,
    end_stop,
    gas_heat,
    gas_leak,
    hydraulic,
    load_friction,
    nitrogen_strut,
    oscillator,
    smooth_ball,
    spring,
    spring_damper,
    stribeck,
    stribeck_lag,
    viscous,
    warm_up,
)
from . import views

__all__ = ["advance_called", "advance_inlined", "apply_forces", "power", "rates"]


@compiled
def _load(row, z):
    """Force of the actuator on the same leg [N]."""
    k, p = row.actuator_state, views.view_load_friction(row.numbers)
    return z[k] * p.area_a - (z[k + 1] * p.area_b if p.area_b > 0.0 else 0.0)


@compiled
def force_called(row, s, sd, z):
    """Forces of a row on its first, second and third port [N or N m]."""
    if row.law == 5:
        return asymmetric.force(views.view_asymmetric(row.numbers), z[row.state]), 0.0, 0.0
    if row.law == 6:
        return backlash.force(views.view_backlash(row.numbers), z[row.state]), 0.0, 0.0
    if row.law == 7:
        return (
            backlash_instead.force(views.view_backlash_instead(row.numbers), z[row.state], z[row.state + 1]),
            0.0,
            0.0,
        )
    if row.law == 8:
        return ball.force(views.view_ball(row.numbers), z[row.state], z[row.state + 1], z[row.state + 2])
    if row.law == 9:
        return by_memory.force(views.view_by_memory(row.numbers), s[row.port], z[row.state]), 0.0, 0.0
    if row.law == 10:
        return by_position.force(views.view_by_position(row.numbers), s[row.port]), 0.0, 0.0
    if row.law == 11:
        return by_speed.force(views.view_by_speed(row.numbers), sd[row.port]), 0.0, 0.0
    if row.law == 12:
        return constant.force(views.view_constant(row.numbers)), 0.0, 0.0
    if row.law == 13:
        first, second = dahl_instead.force(
            views.view_dahl_instead(row.numbers), z[row.state], z[row.state + 1], z[row.state + 2], z[row.state + 3]
        )
        return first, second, 0.0
    if row.law == 14:
        return drag.force(views.view_drag(row.numbers), sd[row.port]), 0.0, 0.0
    if row.law == 15:
        return end_stop.force(views.view_end_stop(row.numbers), s[row.port]), 0.0, 0.0
    if row.law == 16:
        return gas_heat.force(views.view_gas_heat(row.numbers), s[row.port], z[row.state]), 0.0, 0.0
    if row.law == 17:
        return gas_leak.force(views.view_gas_leak(row.numbers), s[row.port], z[row.state]), 0.0, 0.0
    if row.law == 18:
        first, second = load_friction.force(
            views.view_load_friction(row.numbers), _load(row, z), z[row.state], z[row.state + 1]
        )
        return first, second, 0.0
    if row.law == 19:
        return oscillator.force(
            views.view_oscillator(row.numbers),
            sd[row.port],
            sd[row.port_2],
            sd[row.port_3],
            z[row.state],
            z[row.state + 1],
        )
    if row.law == 20:
        return smooth_ball.force(
            views.view_smooth_ball(row.numbers),
            sd[row.port],
            sd[row.port_2],
            (sd[row.port_3] if row.port_3 >= 0 else 0.0),
        )
    if row.law == 21:
        first, second = spring.force(
            views.view_spring(row.numbers), s[row.port], (s[row.port_2] if row.port_2 >= 0 else 0.0)
        )
        return first, second, 0.0
    if row.law == 22:
        return spring_damper.force(views.view_spring_damper(row.numbers), s[row.port], sd[row.port]), 0.0, 0.0
    if row.law == 23:
        return stribeck.force(views.view_stribeck(row.numbers), sd[row.port], z[row.state]), 0.0, 0.0
    if row.law == 24:
        return stribeck_lag.force(views.view_stribeck_lag(row.numbers), z[row.state]), 0.0, 0.0
    if row.law == 25:
        first, second = warm_up.force(views.view_warm_up(row.numbers), z[row.state], z[row.state + 1], z[row.state + 2])
        return first, second, 0.0
    return 0.0, 0.0, 0.0


@compiled_inline
def apply_forces(rows, s, sd, z, force, port_force):
    """Fill the ledger force (n_rows, 3) and its sum per port."""
    port_force[:] = 0.0
    for i in range(rows.size):
        row = rows[i]
        second = third = 0.0
        if row.law == 0:
            p_0 = views.view_bouc_wen_1d(row.numbers)
            first = bouc_wen_1d.force(p_0, z[row.state])
        elif row.law == 1:
            p_1 = views.view_bouc_wen_2d(row.numbers)
            first, second = bouc_wen_2d.force(p_1, z[row.state], z[row.state + 1])
        elif row.law == 2:
            p_2 = views.view_hydraulic(row.numbers)
            first = hydraulic.force(p_2, z[row.state], (z[row.state + 1] if p_2.area_b > 0.0 else 0.0))
        elif row.law == 3:
            p_3 = views.view_nitrogen_strut(row.numbers)
            first = nitrogen_strut.force(p_3, s[row.port])
        elif row.law == 4:
            p_4 = views.view_viscous(row.numbers)
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
    if row.law == 0:
        z[row.state] = bouc_wen_1d.advance(views.view_bouc_wen_1d(row.numbers), ds[row.port], z[row.state])
    elif row.law == 1:
        z[row.state], z[row.state + 1] = bouc_wen_2d.advance(
            views.view_bouc_wen_2d(row.numbers), ds[row.port], ds[row.port_2], z[row.state], z[row.state + 1]
        )


@compiled
def advance_called(row, s, ds, dt, z):
    """Advance a row's hidden states over one step in which the ports move by ds from s."""
    if row.law == 5:
        z[row.state] = asymmetric.advance(views.view_asymmetric(row.numbers), ds[row.port], z[row.state])
    elif row.law == 6:
        z[row.state] = backlash.advance(views.view_backlash(row.numbers), ds[row.port], z[row.state])
    elif row.law == 7:
        z[row.state], z[row.state + 1] = backlash_instead.advance(
            views.view_backlash_instead(row.numbers), ds[row.port], z[row.state], z[row.state + 1]
        )
    elif row.law == 8:
        z[row.state], z[row.state + 1], z[row.state + 2] = ball.advance(
            views.view_ball(row.numbers),
            ds[row.port],
            ds[row.port_2],
            (ds[row.port_3] if row.port_3 >= 0 else 0.0),
            z[row.state],
            z[row.state + 1],
            z[row.state + 2],
        )
    elif row.law == 9:
        z[row.state] = by_memory.advance(views.view_by_memory(row.numbers), s[row.port], ds[row.port], dt, z[row.state])
    elif row.law == 13:
        z[row.state], z[row.state + 1], z[row.state + 2], z[row.state + 3] = dahl_instead.advance(
            views.view_dahl_instead(row.numbers),
            ds[row.port],
            (ds[row.port_2] if row.port_2 >= 0 else 0.0),
            row.port_2 >= 0,
            z[row.state],
            z[row.state + 1],
            z[row.state + 2],
            z[row.state + 3],
        )
    elif row.law == 16:
        z[row.state] = gas_heat.advance(views.view_gas_heat(row.numbers), s[row.port], ds[row.port], dt, z[row.state])
    elif row.law == 17:
        z[row.state] = gas_leak.advance(views.view_gas_leak(row.numbers), dt, z[row.state])
    elif row.law == 18:
        z[row.state], z[row.state + 1] = load_friction.advance(
            views.view_load_friction(row.numbers),
            ds[row.port],
            (ds[row.port_2] if row.port_2 >= 0 else 0.0),
            row.port_2 >= 0,
            z[row.state],
            z[row.state + 1],
        )
    elif row.law == 19:
        z[row.state], z[row.state + 1] = oscillator.advance(
            views.view_oscillator(row.numbers),
            ds[row.port],
            ds[row.port_2],
            ds[row.port_3],
            dt,
            z[row.state],
            z[row.state + 1],
        )
    elif row.law == 23:
        z[row.state] = stribeck.advance(views.view_stribeck(row.numbers), ds[row.port], z[row.state])
    elif row.law == 24:
        z[row.state] = stribeck_lag.advance(views.view_stribeck_lag(row.numbers), ds[row.port], dt, z[row.state])
    elif row.law == 25:
        z[row.state], z[row.state + 1], z[row.state + 2] = warm_up.advance(
            views.view_warm_up(row.numbers),
            ds[row.port],
            (ds[row.port_2] if row.port_2 >= 0 else 0.0),
            row.port_2 >= 0,
            dt,
            z[row.state],
            z[row.state + 1],
            z[row.state + 2],
        )


@compiled
def rates(row, s, sd, z, zd):
    """Fill the rates of a row's hidden states."""
    if row.law == 0:
        zd[row.state] = bouc_wen_1d.rates(views.view_bouc_wen_1d(row.numbers), sd[row.port], z[row.state])
    elif row.law == 1:
        zd[row.state], zd[row.state + 1] = bouc_wen_2d.rates(
            views.view_bouc_wen_2d(row.numbers), sd[row.port], sd[row.port_2], z[row.state], z[row.state + 1]
        )
    elif row.law == 5:
        zd[row.state] = asymmetric.rates(views.view_asymmetric(row.numbers), sd[row.port], z[row.state])
    elif row.law == 6:
        zd[row.state] = backlash.rates(views.view_backlash(row.numbers), sd[row.port], z[row.state])
    elif row.law == 7:
        zd[row.state], zd[row.state + 1] = backlash_instead.rates(
            views.view_backlash_instead(row.numbers), sd[row.port], z[row.state], z[row.state + 1]
        )
    elif row.law == 8:
        zd[row.state], zd[row.state + 1], zd[row.state + 2] = ball.rates(
            views.view_ball(row.numbers),
            sd[row.port],
            sd[row.port_2],
            (sd[row.port_3] if row.port_3 >= 0 else 0.0),
            z[row.state],
            z[row.state + 1],
            z[row.state + 2],
        )
    elif row.law == 9:
        zd[row.state] = by_memory.rates(views.view_by_memory(row.numbers), s[row.port], z[row.state])
    elif row.law == 13:
        zd[row.state], zd[row.state + 1], zd[row.state + 2], zd[row.state + 3] = dahl_instead.rates(
            views.view_dahl_instead(row.numbers),
            sd[row.port],
            (sd[row.port_2] if row.port_2 >= 0 else 0.0),
            z[row.state],
            z[row.state + 1],
            z[row.state + 2],
            z[row.state + 3],
        )
    elif row.law == 16:
        zd[row.state] = gas_heat.rates(views.view_gas_heat(row.numbers), s[row.port], z[row.state])
    elif row.law == 17:
        zd[row.state] = gas_leak.rates(views.view_gas_leak(row.numbers), z[row.state])
    elif row.law == 18:
        zd[row.state], zd[row.state + 1] = load_friction.rates(
            views.view_load_friction(row.numbers),
            sd[row.port],
            (sd[row.port_2] if row.port_2 >= 0 else 0.0),
            z[row.state],
            z[row.state + 1],
        )
    elif row.law == 19:
        zd[row.state], zd[row.state + 1] = oscillator.rates(
            views.view_oscillator(row.numbers),
            sd[row.port],
            sd[row.port_2],
            sd[row.port_3],
            z[row.state],
            z[row.state + 1],
        )
    elif row.law == 23:
        zd[row.state] = stribeck.rates(views.view_stribeck(row.numbers), sd[row.port], z[row.state])
    elif row.law == 24:
        zd[row.state] = stribeck_lag.rates(views.view_stribeck_lag(row.numbers), sd[row.port], z[row.state])
    elif row.law == 25:
        zd[row.state], zd[row.state + 1], zd[row.state + 2] = warm_up.rates(
            views.view_warm_up(row.numbers),
            sd[row.port],
            (sd[row.port_2] if row.port_2 >= 0 else 0.0),
            z[row.state],
            z[row.state + 1],
            z[row.state + 2],
        )


@compiled
def power(row, s, z, work):
    """Dissipated power [W] and stored energy [J] of a row that does `work` [W] on its ports."""
    if row.law == 3:
        return nitrogen_strut.power(views.view_nitrogen_strut(row.numbers), s[row.port])
    if row.law == 6:
        return backlash.power(views.view_backlash(row.numbers), z[row.state], work)
    if row.law == 15:
        return end_stop.power(views.view_end_stop(row.numbers), s[row.port])
    if row.law == 16:
        return gas_heat.power(views.view_gas_heat(row.numbers), s[row.port], z[row.state])
    if row.law == 17:
        return gas_leak.power(views.view_gas_leak(row.numbers), s[row.port], z[row.state])
    if row.law == 21:
        return spring.power(views.view_spring(row.numbers), s[row.port], (s[row.port_2] if row.port_2 >= 0 else 0.0))
    return -work, 0.0

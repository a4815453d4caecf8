"""Laws beyond the report, as the stage calls them where a table has any: forces, rates and steps of hidden states."""

from ..core.compiled import compiled, compiled_inline
from ..laws.backlash import advance_offset, backlash_energy, backlash_force, offset_rate
from ..laws.ball import advance_ball, ball_rate, smooth_share
from ..laws.bouc_wen import advance as bouc_wen_advance
from ..laws.bouc_wen import advance_1d as bouc_wen_advance_1d
from ..laws.bouc_wen import friction_force
from ..laws.bouc_wen import rate as bouc_wen_rate
from ..laws.dahl import advance_dahl, dahl_rate
from ..laws.friction import (
    advance_mean_speed,
    asymmetric_force,
    load_force,
    mean_speed_rate,
    stribeck_force,
    warm_up_force,
)
from ..laws.gas import advance_heat, heat_rate, pressure_change, slow_heat
from ..laws.lines import filter_shares
from ..laws.oscillator import advance_oscillator, oscillator_force, oscillator_rate
from ..laws.spring import drag_force, end_stop_energy, end_stop_force, spring_energy, spring_force
from ..laws.strut import strut_energy, strut_force
from ..laws.tabulated import remembered, table_force
from .registry import (
    ASYMMETRIC,
    BACKLASH,
    BALL,
    BY_MEMORY,
    BY_POSITION,
    BY_SPEED,
    CONSTANT,
    DAHL_INSTEAD,
    DRAG,
    END_STOP,
    GAS_HEAT,
    GAS_LEAK,
    LOAD_FRICTION,
    NODES,
    OSCILLATOR,
    SMOOTH_BALL,
    SPRING,
    STRIBECK,
    VISCOUS,
    WARM_UP,
)

__all__ = ["added_power", "added_rates", "advance_added", "apply_added", "gas_log_ratio"]


@compiled
def apply_added(rows, s, sd, z, force, port_force):
    """Fill the ledger force (n_rows, 3) of these rows and add it to the sum per port."""
    for i in range(rows.size):
        row = rows[i]
        if row.law <= VISCOUS:
            continue
        first, second, third = _force(row, s, sd, z)
        force[i, 0] = first
        force[i, 1] = second
        force[i, 2] = third
        port_force[row.port] += first
        if row.port_2 >= 0:
            port_force[row.port_2] += second
        if row.port_3 >= 0:
            port_force[row.port_3] += third


@compiled
def _stretch(row, s):
    """Stretch of a spring on a port, and on a second one by its lever [m or rad]."""
    return s[row.port] + (row.p[1] * s[row.port_2] if row.port_2 >= 0 else 0.0)


@compiled
def _foot(row, x):
    """What the foot of a mass does by rates or steps x of its three ports, and their levers."""
    p = row.p
    return x[row.port] + p[4] * x[row.port_2] + p[5] * x[row.port_3]


@compiled_inline
def _force(row, s, sd, z):
    """Force of a row on its port, its second and its third [N or N m]."""
    p = row.p
    a = row.port
    k = row.state
    law = row.law
    if law == CONSTANT:
        return p[0], 0.0, 0.0
    if law == STRIBECK:
        return stribeck_force(p[0], z[k], sd[a], p[3]), 0.0, 0.0
    if law == ASYMMETRIC:
        return asymmetric_force(p[0], z[k]), 0.0, 0.0
    if law == WARM_UP:
        return warm_up_force(p[0], z[k + 1], z[k]), 0.0, 0.0
    if law == LOAD_FRICTION:
        load = z[row.link] * p[3]
        if p[4] > 0.0:
            load -= z[row.link + 1] * p[4]
        return load_force(p[0], load, z[k]), load_force(p[0], load, z[k + 1]), 0.0
    if law == DAHL_INSTEAD:
        return friction_force(p[0], z[k + 2] - z[k]), friction_force(p[0], z[k + 3] - z[k + 1]), 0.0
    if law == BALL:
        return friction_force(p[0], z[k]), friction_force(p[0], z[k + 1]), friction_force(p[0], z[k + 2])
    if law == SMOOTH_BALL:
        u, v = sd[a], sd[row.port_2]
        w = sd[row.port_3] if row.port_3 >= 0 else 0.0
        share = p[0] * smooth_share(u, v, w, p[1])
        return share * u, share * v, share * w
    if law == BY_POSITION:
        return p[0] * table_force(s[a], p[1], p[2], p[3 : 3 + NODES]), 0.0, 0.0
    if law == BY_SPEED:
        return p[0] * table_force(sd[a], p[1], p[2], p[3 : 3 + NODES]), 0.0, 0.0
    if law == BY_MEMORY:
        x = remembered(s[a], z[k], p[4 + NODES])
        return p[0] * table_force(x, p[1], p[2], p[3 : 3 + NODES]), 0.0, 0.0
    if law == BACKLASH:
        return backlash_force(z[k], p[0], p[1], p[2]), 0.0, 0.0
    if law == DRAG:
        return drag_force(sd[a], p[0], p[1]), 0.0, 0.0
    if law == SPRING:
        f = spring_force(_stretch(row, s), p[0])
        return f, p[1] * f, 0.0
    if law == END_STOP:
        return end_stop_force(s[a], p[0], p[1], p[2]), 0.0, 0.0
    if law == OSCILLATOR:
        f = oscillator_force(z[k], z[k + 1] - _foot(row, sd), p[0], p[1], p[2]) - p[0] * p[3]
        return f, p[4] * f, p[5] * f
    if law == GAS_LEAK or law == GAS_HEAT:
        return strut_force(s[a], p[1], p[2], p[3], p[4]) * pressure_change(gas_log_ratio(row, z)), 0.0, 0.0
    return 0.0, 0.0, 0.0


@compiled
def added_rates(rows, s, sd, z, zd):
    """Fill the rates of these rows' hidden states."""
    for i in range(rows.size):
        if rows[i].law > VISCOUS and rows[i].state >= 0:
            _rates(rows[i], s, sd, z, zd)


@compiled
def _rates(row, s, sd, z, zd):
    p = row.p
    a = row.port
    k = row.state
    law = row.law
    if law == STRIBECK or law == ASYMMETRIC or law == WARM_UP:
        zd[k], _ = bouc_wen_rate(sd[a], 0.0, z[k], 0.0, p[1], p[2])
        if law == WARM_UP:
            zd[k + 1] = mean_speed_rate(z[k + 1], sd[a], p[3])
    elif law == LOAD_FRICTION or law == DAHL_INSTEAD:
        across = sd[row.port_2] if row.port_2 >= 0 else 0.0
        zd[k], zd[k + 1] = bouc_wen_rate(sd[a], across, z[k], z[k + 1], p[1], p[2])
        if law == DAHL_INSTEAD:
            zd[k + 2], zd[k + 3] = dahl_rate(sd[a], across, z[k + 2], z[k + 3], p[3])
    elif law == BALL:
        spin = sd[row.port_3] if row.port_3 >= 0 else 0.0
        zd[k], zd[k + 1], zd[k + 2] = ball_rate(sd[a], sd[row.port_2], spin, z[k], z[k + 1], z[k + 2], p[1], p[2])
    elif law == BACKLASH:
        zd[k] = offset_rate(z[k], sd[a], p[1], p[2])
    elif law == BY_MEMORY:
        zd[k] = (s[a] - z[k]) / p[3 + NODES]
    elif law == OSCILLATOR:
        relative = z[k + 1] - _foot(row, sd)
        zd[k] = relative
        zd[k + 1] = oscillator_rate(z[k], relative, p[1], p[2])
    elif law == GAS_LEAK:
        zd[k] = 1.0
    elif law == GAS_HEAT:
        zd[k] = heat_rate(z[k], slow_heat(s[a], p[3], p[4]), p[5])


@compiled
def advance_added(rows, s, ds, dt, z):
    """Advance these rows' hidden states over one step in which the ports move by ds from s."""
    for i in range(rows.size):
        if rows[i].law > VISCOUS and rows[i].state >= 0:
            _advance(rows[i], s, ds, dt, z)


@compiled
def _advance(row, s, ds, dt, z):
    p = row.p
    a = row.port
    k = row.state
    law = row.law
    if law == STRIBECK or law == ASYMMETRIC or law == WARM_UP:
        z[k] = bouc_wen_advance_1d(ds[a], z[k], p[1], p[2])
        if law == WARM_UP:
            z[k + 1] = advance_mean_speed(z[k + 1], ds[a], dt, p[3])
    elif law == LOAD_FRICTION or law == DAHL_INSTEAD:
        across = ds[row.port_2] if row.port_2 >= 0 else 0.0
        if row.port_2 < 0:
            z[k] = bouc_wen_advance_1d(ds[a], z[k], p[1], p[2])
        else:
            z[k], z[k + 1] = bouc_wen_advance(ds[a], across, z[k], z[k + 1], p[1], p[2])
        if law == DAHL_INSTEAD:
            z[k + 2], z[k + 3] = advance_dahl(ds[a], across, z[k + 2], z[k + 3], p[3])
    elif law == BALL:
        spin = ds[row.port_3] if row.port_3 >= 0 else 0.0
        z[k], z[k + 1], z[k + 2] = advance_ball(ds[a], ds[row.port_2], spin, z[k], z[k + 1], z[k + 2], p[1], p[2])
    elif law == BACKLASH:
        z[k] = advance_offset(z[k], ds[a], p[1], p[2])
    elif law == BY_MEMORY:
        stay, first, last = filter_shares(dt, p[3 + NODES])
        z[k] = stay * z[k] + first * s[a] + last * (s[a] + ds[a])
    elif law == OSCILLATOR:
        z[k], z[k + 1] = advance_oscillator(z[k], z[k + 1], _foot(row, ds), dt, p[1], p[2])
    elif law == GAS_LEAK:
        z[k] += dt
    elif law == GAS_HEAT:
        start, end = slow_heat(s[a], p[3], p[4]), slow_heat(s[a] + ds[a], p[3], p[4])
        z[k] = advance_heat(z[k], start, end, dt, p[5])


@compiled
def gas_log_ratio(row, z):
    """Ln P/P_n of a strut's gas by one row, a leak's or a heat exchange's; `laws.gas`."""
    p = row.p
    if row.law == GAS_LEAK:
        return -(p[5] + p[0] * z[row.state])
    return p[0] * z[row.state]


@compiled
def added_power(row, s, z, work):
    """Dissipated power [W] and stored energy [J] of a row that does `work` [W] on its ports."""
    p = row.p
    a = row.port
    k = row.state
    law = row.law
    if law == SPRING:
        return 0.0, spring_energy(_stretch(row, s), p[0])
    if law == END_STOP:
        return 0.0, end_stop_energy(s[a], p[0], p[1], p[2])
    if law == BACKLASH:
        stored = backlash_energy(z[k], p[0], p[1], p[2])
        # sliding at the limit all work is lost, else it is stored
        slides = abs(z[k]) >= p[1] + p[2] and work < 0.0
        return -work if slides else 0.0, stored
    if law == GAS_LEAK or law == GAS_HEAT:
        held = strut_energy(s[a], p[1], p[2], p[3], p[4])
        change = pressure_change(gas_log_ratio(row, z))
        rate = -p[0] if law == GAS_LEAK else p[0] * heat_rate(z[k], slow_heat(s[a], p[3], p[4]), p[5])
        return -held * (1.0 + change) * rate, held * change
    return -work, 0.0

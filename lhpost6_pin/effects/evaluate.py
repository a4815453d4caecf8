"""Every force effect of a machine at one instant, or over one step, in compiled code.

Four loops run around these functions: the per-step Pinocchio engine, the fused engine, inverse dynamics and the
search for missing effects. Each function walks the effect table and calls the law's functions.

Arrays: s (n_ports,) port coordinates, sd rates, z (n_states,) hidden states, spool (n_actuators,) valve spools -1..1,
supply the shared supply (`laws.supply.Supply`), force (n_rows, 3) the ledger: force of each row on its first, second
and third port [N or N m], port_force (n_ports,) their sum per port.
"""

from ..core.compiled import compiled, compiled_inline, compiled_source
from ..laws.supply import varies
from .actuator import advance_actuator, advance_modified, fill_rates
from .dispatch import advance_called, advance_inlined, apply_forces, rates
from .registry import HYDRAULIC, INLINED
from .supply import close_supply, open_supply, supply_pressures, supply_rates

__all__ = ["advance_states", "apply_forces", "state_rates", "wrench_on_platen"]


@compiled
def state_rates(rows, s, sd, spool, supply, z, zd):
    """Fill zd (n_states,) with the rates of all hidden states (schemes `euler` and `rk4`)."""
    high, low = supply_pressures(supply, z)
    if varies(supply):
        supply_rates(rows, spool, supply, z, zd)
    for i in range(rows.size):
        row = rows[i]
        if row.law == HYDRAULIC:
            fill_rates(row, s, sd, spool, high, low, z, zd)
        elif row.state >= 0:
            rates(row, s, sd, z, zd)


@compiled_source
def advance_states(rows, s, ds, dt, spool, supply, z):
    """Advance z in place over one step in which the ports move by ds from s (scheme `semi_implicit`).

    This is the one-step rule that inverse dynamics marches along a measured motion, too.
    """
    before = (0.0, 0.0, 0.0, 0.0)
    if varies(supply):
        before = open_supply(rows, spool, supply, dt, z)
    pressures = supply_pressures(supply, z)
    for i in range(rows.size):
        row = rows[i]
        if row.state < 0:
            continue
        if row.law >= INLINED:
            advance_called(row, s, ds, dt, z)
        elif row.law != HYDRAULIC:
            advance_inlined(row, s, ds, dt, z)
        elif row.modified == 0:
            advance_actuator(row, False, s, ds, dt, spool, pressures, z)
        else:
            advance_modified(row, s, ds, dt, spool, pressures, z)
    if varies(supply):
        close_supply(rows, spool, supply, dt, before, z)


@compiled_inline
def wrench_on_platen(frame, body, B, port_force):
    """Fill rows 6 and 7 of frame: total wrench at B in platen axes [N, N m] (Eq. 4-24 less the Inertia's weight).

    Sum of the ports, the weight beyond the Inertia's, (m_z - m_0) R^T (0, 0, -g), and the bias of the directional
    mass, -dM (omega x v_B) (Eq. 4-26).
    """
    extra = body[0].mass_extra
    weight = body[0].weight_extra
    v0, v1, v2 = frame[4, 0], frame[4, 1], frame[4, 2]
    w0, w1, w2 = frame[5, 0], frame[5, 1], frame[5, 2]
    f0 = -weight * frame[2, 0] - extra[0] * (w1 * v2 - w2 * v1)
    f1 = -weight * frame[2, 1] - extra[1] * (w2 * v0 - w0 * v2)
    f2 = -weight * frame[2, 2] - extra[2] * (w0 * v1 - w1 * v0)
    m0 = m1 = m2 = 0.0
    for i in range(port_force.size):
        f = port_force[i]
        f0 += B[i, 0] * f
        f1 += B[i, 1] * f
        f2 += B[i, 2] * f
        m0 += B[i, 3] * f
        m1 += B[i, 4] * f
        m2 += B[i, 5] * f
    frame[6, 0] = f0
    frame[6, 1] = f1
    frame[6, 2] = f2
    frame[7, 0] = m0
    frame[7, 1] = m1
    frame[7, 2] = m2

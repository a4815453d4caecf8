"""The stage: every force effect of a machine at one instant, or over one step, in compiled code.

Four loops run around these functions: the per-step Pinocchio engine, the fused engine, inverse dynamics and the
search for missing effects. Each function walks the effect table and calls the law's kernel.

Arrays: s (n_ports,) port coordinates, sd rates, z (n_states,) hidden states, spool (n_actuators,) valve spools -1..1,
supply the supply's numbers, pressures first (`supply`), force (n_rows, 3) the ledger: force of each row on its first,
second and third port [N or N m], port_force (n_ports,) their sum per port.
"""

from ..core.compiled import compiled, compiled_inline
from ..laws.bouc_wen import advance as bouc_wen_advance
from ..laws.bouc_wen import advance_1d as bouc_wen_advance_1d
from ..laws.bouc_wen import friction_force
from ..laws.bouc_wen import rate as bouc_wen_rate
from ..laws.chamber import advance_double, advance_single, chamber_rate, flows_double, flows_single, piston_force
from ..laws.orifice import opening
from ..laws.strut import strut_force
from ..laws.viscous import viscous_force
from .actuator import advance_oil, oil_rates
from .evaluate_added import added_rates, advance_added, apply_added
from .registry import BOUC_WEN_1D, BOUC_WEN_2D, HYDRAULIC_DOUBLE, HYDRAULIC_SINGLE, NITROGEN_STRUT, VISCOUS
from .supply import close_supply, open_supply, supply_pressures, supply_rates

__all__ = ["advance_states", "apply_forces", "state_rates", "wrench_on_platen"]


@compiled
def state_rates(rows, s, sd, spool, supply, z, zd):
    """Fill zd (n_states,) with the rates of all hidden states (schemes `euler` and `rk4`)."""
    more = altered = False
    high, low = supply[0], supply[1]
    if supply.size > 2:
        high, low = supply_pressures(supply, z)
        supply_rates(rows, spool, supply, z, zd)
    for i in range(rows.size):
        row = rows[i]
        k = row.state
        if k < 0:
            continue
        law = row.law
        p = row.p
        a = row.port
        if law == BOUC_WEN_1D:
            zd[k], _ = bouc_wen_rate(sd[a], 0.0, z[k], 0.0, p[1], p[2])
        elif law == BOUC_WEN_2D:
            zd[k], zd[k + 1] = bouc_wen_rate(sd[a], sd[row.port_2], z[k], z[k + 1], p[1], p[2])
        elif row.altered != 0:
            altered = True
        elif law == HYDRAULIC_DOUBLE:
            opened = opening(spool[row.input], p[6])
            q_a, q_b, _, _ = flows_double(opened, z[k], z[k + 1], p[2], p[3], p[4], p[5], p[7], high, low, p[11])
            zd[k] = chamber_rate(q_a, p[0], sd[a], p[8] + s[a], p[10])
            zd[k + 1] = chamber_rate(q_b, p[1], -sd[a], p[9] - s[a], p[10])
        elif law == HYDRAULIC_SINGLE:
            opened = opening(spool[row.input], p[6])
            q_a, _ = flows_single(opened, z[k], p[2], p[4], p[7], high, low, p[11])
            zd[k] = chamber_rate(q_a, p[0], sd[a], p[8] + s[a], p[10])
        else:
            more = True
    if altered:
        oil_rates(rows, s, sd, spool, high, low, z, zd)
    if more:
        added_rates(rows, s, sd, z, zd)


@compiled_inline
def advance_states(rows, s, ds, dt, spool, supply, z):
    """Advance z in place over one step in which the ports move by ds from s (scheme `semi_implicit`).

    This is the one-step rule that inverse dynamics marches along a measured motion, too.
    """
    more = altered = False
    high, low = supply[0], supply[1]
    before = (0.0, 0.0, 0.0, 0.0)
    if supply.size > 2:
        before = open_supply(rows, spool, supply, dt, z)
        high, low = supply_pressures(supply, z)
    for i in range(rows.size):
        row = rows[i]
        k = row.state
        if k < 0:
            continue
        law = row.law
        p = row.p
        a = row.port
        if law == BOUC_WEN_1D:
            z[k] = bouc_wen_advance_1d(ds[a], z[k], p[1], p[2])
        elif law == BOUC_WEN_2D:
            z[k], z[k + 1] = bouc_wen_advance(ds[a], ds[row.port_2], z[k], z[k + 1], p[1], p[2])
        elif row.altered != 0:
            altered = True
        elif law == HYDRAULIC_DOUBLE:
            opened = opening(spool[row.input], p[6])
            z[k], z[k + 1] = advance_double(
                opened,
                z[k],
                z[k + 1],
                p[8] + s[a],
                p[9] - s[a],
                ds[a],
                dt,
                p[0],
                p[1],
                p[2],
                p[3],
                p[4],
                p[5],
                p[7],
                p[10],
                high,
                low,
                p[11],
            )
        elif law == HYDRAULIC_SINGLE:
            opened = opening(spool[row.input], p[6])
            z[k] = advance_single(
                opened,
                z[k],
                p[8] + s[a],
                ds[a],
                dt,
                p[0],
                p[2],
                p[4],
                p[7],
                p[10],
                high,
                low,
                p[11],
            )
        else:
            more = True
    if altered:
        advance_oil(rows, s, ds, dt, spool, high, low, z)
    if supply.size > 2:
        close_supply(rows, spool, supply, dt, before, z)
    if more:
        advance_added(rows, s, ds, dt, z)


@compiled_inline
def apply_forces(rows, s, sd, z, force, port_force):
    """Fill the ledger force (n_rows, 3) and its sum per port."""
    more = False
    port_force[:] = 0.0
    for i in range(rows.size):
        row = rows[i]
        law = row.law
        p = row.p
        a = row.port
        k = row.state
        second = 0.0
        if law == BOUC_WEN_1D:
            first = friction_force(p[0], z[k])
        elif law == BOUC_WEN_2D:
            first = friction_force(p[0], z[k])
            second = friction_force(p[0], z[k + 1])
            port_force[row.port_2] += second
        elif law == HYDRAULIC_DOUBLE:
            first = piston_force(z[k], z[k + 1], p[0], p[1])
        elif law == HYDRAULIC_SINGLE:
            first = piston_force(z[k], 0.0, p[0], 0.0)
        elif law == NITROGEN_STRUT:
            first = strut_force(s[a], p[0], p[1], p[2], p[3])
        elif law == VISCOUS:
            first = viscous_force(sd[a], p[0])
        else:
            more = True
            continue
        force[i, 0] = first
        force[i, 1] = second
        port_force[a] += first
    if more:
        apply_added(rows, s, sd, z, force, port_force)


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

"""What the gas of a strut does beyond the polytropic law: pressure P = P_n exp(y), P_n that of `strut`.

    leak    y = -(y_0 + r t)                                   gas is lost at a rate r [1/s], a share before the test
    heat    y = a h,  T dh/dt = (n - 1) ln(1 + dL/L_c0) - h    the gas takes heat from the wall with time constant T [s]

With a = 1 slow strokes are isothermal and fast ones polytropic with n; a share a [1] goes that far between them.
Force beyond the nominal one: f_n (exp(y) - 1). Stored energy: the nominal potential times exp(y) - 1; what y changes
in it is taken or given by the gas that leaves and by the wall. Source: ideal gas with the nominal index as that of a
stroke without heat, T dh/dt from Newton's law of cooling; derived here.
"""

import math

from ..core.compiled import compiled

__all__ = ["advance_heat", "heat_rate", "pressure_change", "slow_heat"]


@compiled
def pressure_change(log_ratio: float) -> float:
    """Change of pressure over the nominal pressure [1]: exp(y) - 1."""
    return math.expm1(log_ratio)


@compiled
def slow_heat(elongation: float, gas_length: float, index: float) -> float:
    """Where h goes if there is time [1]: (n - 1) ln(1 + dL/L_c0)."""
    return (index - 1.0) * math.log1p(elongation / gas_length)


@compiled
def heat_rate(heat: float, slow: float, time_constant: float) -> float:
    """Rate of h [1/s]."""
    return (slow - heat) / time_constant


@compiled
def advance_heat(heat: float, slow_start: float, slow_end: float, dt: float, time_constant: float) -> float:
    """Heat h [1] after dt [s], while where it goes changes linearly: exact."""
    ratio = dt / time_constant
    gain = -math.expm1(-ratio)
    slope = slow_end - slow_start
    return heat + gain * (slow_start - heat) + slope * (1.0 - gain / ratio)

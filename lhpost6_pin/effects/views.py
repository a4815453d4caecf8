"""A row's numbers as the parameters of its law: written by `scripts/generate_dispatch.py`, do not edit."""

from ..core.compiled import compiled_inline
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

__all__ = ["view_hydraulic"]  # by name; all others as `views.view_...`


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
        numbers[33],
        numbers[34],
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
    return asymmetric.AsymmetricFriction(numbers[0], numbers[1], numbers[2], numbers[3])


@compiled_inline
def view_backlash(numbers):
    """Parameters of `backlash`."""
    return backlash.Backlash(numbers[0], numbers[1], numbers[2])


@compiled_inline
def view_backlash_instead(numbers):
    """Parameters of `backlash_instead`."""
    return backlash_instead.BacklashInstead(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4])


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
def view_spring_damper(numbers):
    """Parameters of `spring_damper`."""
    return spring_damper.SpringDamper(numbers[0], numbers[1])


@compiled_inline
def view_stribeck(numbers):
    """Parameters of `stribeck`."""
    return stribeck.Stribeck(numbers[0], numbers[1], numbers[2], numbers[3])


@compiled_inline
def view_stribeck_lag(numbers):
    """Parameters of `stribeck_lag`."""
    return stribeck_lag.StribeckLag(numbers[0], numbers[1], numbers[2])


@compiled_inline
def view_warm_up(numbers):
    """Parameters of `warm_up`."""
    return warm_up.WarmUp(numbers[0], numbers[1], numbers[2], numbers[3], numbers[4])

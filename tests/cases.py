"""Every force law with plausible numbers, and every kernel with plausible arguments, for the standard tests.

The ports of a case are `PORTS`: a leg, and two slip directions of a pad. The numbers are of the size of the machine's
but not the machine's, so that a test of a law cannot lean on them.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.effects.table import effect_table
from lhpost6_pin.laws import bouc_wen, chamber, orifice, strut, viscous

PORTS = ("leg", "pad.x", "pad.y")
SUPPLY = np.array([20e6, 0.5e6])

FLOW = 1.1e-4  # m3/s/sqrt(Pa)
OIL = (900e6, 500.0)


class Case(NamedTuple):
    """One law on ports: its effect, hidden states at the start, spools."""

    effect: Effect
    z: tuple[float, ...]
    spool: tuple[float, ...]

    @property
    def rows(self) -> np.ndarray:
        """Its table."""
        return effect_table([self.effect], PORTS)


def _case(
    law: str, port: str, numbers: tuple[float, ...], z: tuple[float, ...] = (), spool: float | None = None
) -> Case:
    effect = Effect(f"a_{law}", law, (port,), (numbers,), "test", () if spool is None else (0,))
    return Case(effect, z, (0.0 if spool is None else spool,))


CASES = {
    case.effect.law: case
    for case in (
        _case(
            "hydraulic_double",
            "leg",
            (0.2, 0.13, 0.8 * FLOW, 0.5 * FLOW, FLOW, 0.65 * FLOW, 1.3, 4.6e-11, 0.8, 0.7, *OIL),
            (6e6, 9e6),
            0.02,
        ),
        _case(
            "hydraulic_single", "leg", (0.5, 0.0, FLOW, 0.0, FLOW, 0.0, 1.05, 4.6e-11, 0.3, 0.0, *OIL), (12e6,), -0.03
        ),
        _case("nitrogen_strut", "leg", (15e6, 0.15, 2.0, 1.7)),
        _case("bouc_wen_1d", "leg", (9e3, 2e-4, 0.1), (0.3,)),
        _case("bouc_wen_2d", "pad", (17e3, 1e-3, 0.1), (0.3, -0.4)),
        _case("viscous", "leg", (15e3,)),
    )
}
"""A case of every law, by the law's name."""


class Kernel(NamedTuple):
    """A compiled kernel and the ranges that its arguments are drawn from."""

    function: Callable[..., Any]
    ranges: tuple[tuple[float, float], ...]


_PRESSURE, _OPEN, _K, _LEAK = (-1e5, 22e6), (-1.0, 1.0), (0.0, 2e-4), (0.0, 1e-10)
_AREA, _LENGTH, _BULK, _ROOT = (0.05, 0.6), (0.05, 1.6), (5e8, 1.5e9), (1.0, 2e3)
_HIGH, _LOW, _STROKE, _DT = (15e6, 25e6), (1e5, 1e6), (-1e-3, 1e-3), (1e-5, 1e-3)
_SLIP, _Z, _YIELD, _SHAPE = (-3e-3, 3e-3), (-0.7, 0.7), (1e-4, 2e-3), (0.0, 0.5)
_REST = (_LEAK, _BULK, _HIGH, _LOW, _ROOT)
_GAS = ((-0.5, 0.5), (1e6, 2e7), (0.05, 0.3), (1.0, 3.0), (0.9, 2.0))

KERNELS = {
    kernel.function.__name__: kernel
    for kernel in (
        Kernel(bouc_wen.rate, ((-2, 2), (-2, 2), _Z, _Z, _YIELD, _SHAPE)),
        Kernel(bouc_wen.advance, (_SLIP, _SLIP, _Z, _Z, _YIELD, _SHAPE)),
        Kernel(bouc_wen.advance_1d, (_SLIP, _Z, _YIELD, _SHAPE)),
        Kernel(bouc_wen.friction_force, ((0, 2e4), _Z)),
        Kernel(orifice.signed_root, ((-1e3, 1e3), (500, 501))),
        Kernel(orifice.opening, (_OPEN, (0.5, 2.0))),
        Kernel(orifice.port_flow, (_OPEN, _K, _K, _HIGH, _LOW, _PRESSURE, _ROOT)),
        Kernel(orifice.spool_for_opening, (_OPEN, (0.5, 2.0))),
        Kernel(chamber.chamber_rate, ((-0.5, 0.5), _AREA, (-2, 2), _LENGTH, _BULK)),
        Kernel(chamber.side_shares, ((-1.0, 1.0),)),
        Kernel(chamber.piston_force, (_PRESSURE, _PRESSURE, _AREA, _AREA)),
        Kernel(chamber.flow_enthalpy, (_PRESSURE, _BULK)),
        Kernel(chamber.chamber_energy, ((1e5, 22e6), _AREA, _LENGTH, _BULK)),
        Kernel(chamber.flows_double, (_OPEN, _PRESSURE, _PRESSURE, _K, _K, _K, _K, _LEAK, _HIGH, _LOW, _ROOT)),
        Kernel(chamber.flows_single, (_OPEN, _PRESSURE, _K, _K, _LEAK, _HIGH, _LOW, _ROOT)),
        Kernel(
            chamber.pressure_rises,
            (*((-0.5, 0.5),) * 2, *((-1e-8, 0.0),) * 2, _LEAK, _STROKE, _DT, _AREA, _AREA, *((1e9, 1e11),) * 2),
        ),
        Kernel(
            chamber.advance_double,
            (_OPEN, _PRESSURE, _PRESSURE, _LENGTH, _LENGTH, _STROKE, _DT, _AREA, _AREA, *(_K,) * 4, *_REST),
        ),
        Kernel(chamber.advance_single, (_OPEN, _PRESSURE, _LENGTH, _STROKE, _DT, _AREA, _K, _K, *_REST)),
        Kernel(strut.gas_pressure, (_GAS[0], _GAS[1], _GAS[3], _GAS[4])),
        Kernel(strut.strut_force, _GAS),
        Kernel(strut.strut_energy, _GAS),
        Kernel(viscous.viscous_force, ((-2, 2), (0, 2e4))),
    )
}
"""Every kernel of `laws/`, by its name."""


class Motion:
    """A smooth motion of the ports; s and its rate at a time [s]."""

    frequency = 2 * math.pi * np.array([3.0, 2.0, 5.0])
    phase = np.array([0.0, 0.4, 1.1])
    size = 0.002

    def s(self, t: float) -> np.ndarray:
        """Coordinates (3,) [m]."""
        return self.size * (np.sin(self.frequency * t + self.phase) - np.sin(self.phase))

    def sd(self, t: float) -> np.ndarray:
        """Rates (3,) [m/s]."""
        return self.size * self.frequency * np.cos(self.frequency * t + self.phase)

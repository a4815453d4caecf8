"""Every law with plausible parameters, ports and starting states, and the ranges of arguments, for `test_law_battery`.

A new law needs one entry in `_ROWS`. Parameters are of the size of the machine's but not the machine's, so that a test
of a law cannot lean on them.
"""

import inspect
import math
import pkgutil
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np

from lhpost6_pin import laws
from lhpost6_pin.effects.actuator import start_line
from lhpost6_pin.effects.effect import Effect
from lhpost6_pin.effects.evaluate import advance_states, apply_forces, state_rates
from lhpost6_pin.effects.modifiers import supply_of
from lhpost6_pin.effects.registry import LAWS, parameters_of
from lhpost6_pin.effects.table import effect_table, state_names
from lhpost6_pin.laws.contract import Law, parameter_units
from lhpost6_pin.laws.hydraulic import Hydraulic
from lhpost6_pin.laws.supply import Supply
from lhpost6_pin.laws.tabulated import NODES

PORTS = ("leg", "leg.x", "leg.y")
"""A leg, and two slip directions of its pad."""
SUPPLY = (20e6, 0.5e6)
FLOW = 1.1e-4  # m3/s/sqrt(Pa)
OIL = (900e6, 500.0)
DOUBLE = Hydraulic(0.2, 0.13, 0.8 * FLOW, 0.5 * FLOW, FLOW, 0.65 * FLOW, 1.3, 4.6e-11, 0.8, 0.7, *OIL)
SINGLE = Hydraulic(0.5, 0.0, FLOW, 0.0, FLOW, 0.0, 1.05, 4.6e-11, 0.3, 0.0, *OIL)
GAS = (15e6, 0.15, 2.0, 1.7)
WAVE = 4e3 * np.sin(np.arange(NODES))


def s_at(t: float) -> np.ndarray:
    """Coordinates (3,) [m] of a smooth motion of the ports, 2 mm at 3, 2 and 5 Hz."""
    return np.array([0.002 * (math.sin(w * t + phase) - math.sin(phase)) for w, phase in _TURNS])


def sd_at(t: float) -> np.ndarray:
    """Rates (3,) [m/s] of the same."""
    return np.array([0.002 * w * math.cos(w * t + phase) for w, phase in _TURNS])


_TURNS = tuple((2 * math.pi * f, phase) for f, phase in ((3.0, 0.0), (2.0, 0.4), (5.0, 1.1)))


@dataclass(frozen=True, eq=False)
class Case:
    """One law on its ports, beside an actuator where it needs one."""

    law: str
    p: Any  # its parameters
    z_start: tuple[float, ...] = ()
    port: str = "leg"
    on: Hydraulic | None = None  # the actuator beside it, or that it modifies
    exact: bool = True  # one step along a straight path is as good as many
    passive: bool = False  # at no instant does it give energy that it has not stored
    cycle: float = 0.0  # mean power that a cycle loses at least, over the largest
    name: str = ""

    def __str__(self) -> str:
        return self.name or f"{self.law}-{self.port}"

    @property
    def attributes(self) -> Law:
        return LAWS[self.law]

    @cached_property
    def effects(self) -> list[Effect]:
        """The actuator, if any, and the law."""
        actuator = self.p if self.law == "hydraulic" else self.on
        oil = [] if actuator is None else [Effect("oil", "hydraulic", ("leg",), (actuator[:12],), "test", (0,))]
        return oil if self.law == "hydraulic" else [*oil, effect_of(self.law, self.p, self.port)]

    @cached_property
    def rows(self) -> np.ndarray:
        """Its table; the last row is the law's, or that of the actuator which it modifies."""
        return effect_table(self.effects, PORTS)

    @property
    def supply(self) -> Supply:
        return supply_of(self.effects, state_names(self.effects), *SUPPLY)

    @cached_property
    def pressures(self) -> int:
        """Number of chamber pressures, which are its first states."""
        return 0 if self.rows["spool"][0] < 0 else 2 if self.rows["numbers"][0, 1] > 0.0 else 1

    @cached_property
    def spool(self) -> np.ndarray:
        return np.array([(0.0, -0.03, 0.02)[self.pressures]])

    @cached_property
    def z(self) -> np.ndarray:
        z, pressures = np.zeros(len(state_names(self.effects))), ((), (12e6,), (6e6, 9e6))[self.pressures]
        start = (*pressures, *self.z_start)
        z[: len(start)] = start
        if self.rows["modified"][0]:
            start_line(self.rows[0], self.spool[0], *(*pressures, 0.0)[:2], *SUPPLY, z)
        return z

    def forces(self, s: np.ndarray, sd: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces of the last row on its ports (3,), and of all rows on all ports."""
        force, total = np.zeros((len(self.rows), 3)), np.zeros(len(PORTS))
        apply_forces(self.rows, s, sd, z, force, total)
        return force[-1], total

    def rates(self, t: float, z: np.ndarray) -> np.ndarray:
        """Rates of the hidden states along the motion."""
        zd = np.zeros(len(z))
        state_rates(self.rows, s_at(t), sd_at(t), self.spool, self.supply, z, zd)
        return zd

    def march(self, duration: float, steps: int, turn: bool = False) -> np.ndarray:
        """Hidden states at every step along the motion (steps + 1, n_states); half-way the spool may turn round."""
        z, dt, shared, out = self.z.copy(), duration / steps, self.supply, [self.z.copy()]
        for k in range(steps):
            s, after = s_at(k * dt), s_at((k + 1) * dt)
            x = -self.spool if turn and 2 * k >= steps else self.spool
            advance_states(self.rows, s, after - s, dt, x, shared, z)
            out.append(z.copy())
        return np.array(out)

    def with_parameter(self, name: str) -> "Case":
        """The same with half of one parameter, or with one where it is zero."""
        value = getattr(self.p, name)
        return replace(self, p=self.p._replace(**{name: 0.5 * value if np.any(value) else 1.0}))


def effect_of(law: str, p: Any, port: str = "leg", name: str = "more") -> Effect:
    numbers = np.hstack(p)[: len(parameter_units(LAWS[law]))]
    return Effect(name, law, (port,), (tuple(numbers.tolist()),), "test")


def _case(law: str, *numbers: Any, z: tuple[float, ...] = (), **more: Any) -> Case:
    return Case(law, LAWS[law].parameters(*numbers), z, **more)


_RUB = (9e3, 2e-4, 0.1)
_THREE = "leg.x leg.y leg"
_ROWS = (
    _case("hydraulic", *DOUBLE, passive=True, exact=False, name="hydraulic-double"),
    _case("hydraulic", *SINGLE, passive=True, exact=False, name="hydraulic-single"),
    _case("nitrogen_strut", *GAS, passive=True),
    _case("bouc_wen_1d", *_RUB, z=(0.3,), cycle=0.05),
    _case("bouc_wen_2d", 17e3, 1e-3, 0.1, z=(0.3, -0.4), cycle=0.05),
    _case("viscous", 15e3, passive=True, cycle=0.05),
    _case("constant", 3e3),
    _case("stribeck", *_RUB, 0.02, z=(0.3,), cycle=0.005),
    _case("stribeck_lag", *_RUB[:2], 0.02, z=(0.3,), cycle=0.005),
    _case("asymmetric", *_RUB, 1.7, z=(0.3,)),
    _case("dahl_instead", *_RUB, 3e-4, z=(0.3, -0.4, 0.1, 0.5)),
    _case("dahl_instead", *_RUB, 3e-4, z=(0.3, 0.0, 0.1, 0.0), port="leg -"),
    _case("load_friction", 0.02, *_RUB[1:], 0.2, 0.13, z=(0.3, -0.4), on=DOUBLE, cycle=0.005),
    _case("load_friction", 0.02, *_RUB[1:], 0.5, 0.0, z=(0.3, 0.0), port="leg -", on=SINGLE),
    _case("ball", *_RUB, z=(-0.3, -0.4, 0.2), port=_THREE, cycle=0.005),
    _case("ball", *_RUB, z=(-0.3, -0.4, 0.2), port="leg.x leg.y", cycle=0.005),
    _case("smooth_ball", 9e3, 0.01, port=_THREE, passive=True, cycle=0.005),
    _case("smooth_ball", 9e3, 0.01, port="leg.x leg.y", passive=True, cycle=0.005),
    _case("warm_up", *_RUB, 0.3, 0.02, z=(0.3, -0.4, 0.01), cycle=0.005),
    _case("warm_up", *_RUB, 0.3, 0.02, z=(0.3, 0.0, 0.01), port="leg -", cycle=0.005),
    _case("backlash", 9e3, 2e-4, 5e-4, z=(1e-4,), passive=True, cycle=0.005),
    _case("backlash_instead", *_RUB, 4e-4, 5e-4, z=(0.3, 1e-4)),
    _case("drag", 9e3, 1.7, passive=True, cycle=0.005),
    _case("spring", 9e5, 1.5, passive=True),
    _case("spring", 9e5, 1.5, port="leg -", passive=True),
    _case("spring_damper", 9e4, 3e4, cycle=0.005),
    _case("by_position", 0.8, -1e-3, 1e-3, WAVE),
    _case("by_speed", 0.8, -0.02, 0.03, np.roll(WAVE, 5)),
    _case("by_memory", 0.8, -1e-3, 1e-3, WAVE, 0.3, 0.4, z=(1e-4,)),
    _case("end_stop", 9e5, 1e-3, 2.0, passive=True),
    _case("oscillator", 5e3, 60.0, 0.05, 0.0, 1.5, -0.7, z=(1e-3, 0.02), port=_THREE, cycle=0.005),
    _case("gas_leak", 1e-2, *GAS, 0.03, z=(0.4,)),
    _case("gas_heat", 0.7, *GAS, 0.1, z=(0.001,), exact=False),  # where it goes is not linear in s
)

_NUMBERS: dict[str, tuple[float, ...]] = {
    "extra_leakage": (3e-11,),
    "turbulent_leakage": (3e-7,),
    "external_leakage": (5e-11, 0.4),
    "null_leakage": (1e-6, 0.05),
    "null_bias": (0.01,),
    "deadband": (0.005, 0.3),
    "flow_curve": (0.2, 0.5, 1.0),
    "entrained_air": (0.02, 1.2),
    "cavitation": (0.5, 15e6),  # far above what it is, so that the cases are in it
    "dead_volume": (0.02, -0.3),
    "play": (5e-4, 2e4),
    "line": (2e-3, 0.3),
    "supply_line": (2e6, 25.0, 0.1),
    "supply_droop": (6e6, 0.02, 1.3),
    "back_pressure": (3e7, 0.03),
    "valve_delay": (1e-3,),
    "valve_lag": (2e-3,),
    "one_way_ports": (1.0,),
    "thrust_direction": (0.3,),
    "more_inertia": tuple(1e3 * k for k in range(1, 11)),
}
MODIFIERS: dict[str, Any] = {law: LAWS[law].parameters(*numbers) for law, numbers in _NUMBERS.items()}
"""Parameters of the laws that modify others."""

_PORT_OF = {"oil": "leg", "supply": "supply"}
OIL_CASES = tuple(
    Case(law, p, (), _PORT_OF[LAWS[law].modifies], on, False, law != "external_leakage", name=f"{law}-{kind}")
    for law, p in MODIFIERS.items()
    if LAWS[law].modifies in _PORT_OF
    for kind, on in (("double", DOUBLE), ("single", SINGLE))
)
"""Modifiers of oil and supply on both kinds of actuators. Oil below the return pressure draws some from outside."""
ACTUATORS = tuple(c for c in _ROWS if c.law == "hydraulic")
CASES = (*_ROWS, *OIL_CASES)
OWN = tuple(c for c in _ROWS if c.law != "hydraulic")  # laws of which a row needs the law's functions alone
WITH_STATES = tuple(c for c in CASES if c.attributes.states or c.attributes.modifies)
EXACT = tuple(c for c in OWN if c.attributes.states and c.exact)
WITHOUT_POTENTIAL = tuple(c for c in CASES if c.cycle)
PASSIVE = tuple(c for c in CASES if c.passive)


def takes(function: Any) -> list[str]:
    """Names of a compiled function's arguments."""
    return list(inspect.signature(function.py_func).parameters)


def module_of(law: str) -> Any:
    return import_module(f"lhpost6_pin.laws.{law}")


BY_PATH = tuple(c for c in EXACT if "dt" not in takes(module_of(c.law).advance))
"""Cases whose states know the path and not the time."""

# ------------------------------------------------------------------------------------------------ arguments by name
_MODULES = {m.name: import_module(f"lhpost6_pin.laws.{m.name}") for m in pkgutil.iter_modules(laws.__path__)}
_EXPORTS = {f"{m}.{name}": getattr(module, name) for m, module in _MODULES.items() for name in module.__all__}
KERNELS = {name: function for name, function in _EXPORTS.items() if hasattr(function, "py_func")}
"""Every compiled function of `laws/`."""

_ALL = [effect_of(law, p, name=law) for law, p in MODIFIERS.items() if LAWS[law].modifies == "oil"]
FULL = parameters_of(effect_table([*ACTUATORS[0].effects, *_ALL], PORTS)[0])
"""An actuator with all modifiers."""

_RANGES = {
    (-1.0, 1.0): "v v_2 v_3 v_x v_y spool opened x side flow rate fed velocity error",
    (-0.57, 0.57): "z z_x z_y z_1 z_2 z_3 d_x d_y",
    (-2e-3, 2e-3): "s s_2 s_3 offset stretch past_position",
    (-3e-3, 3e-3): "d d_2 d_3 dx dy stroke",
    (1e-5, 1e-3): "dt",
    (-1e-2, 1e-2): "exchanged",
    (0.0, 0.5): "shape mean_speed flow_a flow_b elongation at length_rate drawn returned",
    (1e-4, 2e-3): "yield_slip time",
    (0.5, 2.0): "flow_curve power length index gas_length area area_a area_b",
    (-1e5, 22e6): "pressure pressure_a pressure_b chamber half_a half_b",
    (15e6, 25e6): "high supply",
    (1e5, 1e6): "low back vapour",
    (5e8, 1.5e9): "bulk",
    (1.0, 2e3): "linear_below lowest",
    (0.0, 2e-4): "k_supply k_return",
    (0.0, 1e-6): "coefficient leakage",
    (3e-3, 0.1): "overlap width air share damping",
    (-1e6, 1e6): "load force drop work change_a change_b",
    (0.0, 1e-3): "play",
    (0.0, 2.0): "rounding",
    (2e2, 5e5): "closing",
    (0.0, 2e4): "friction",
    (0.0, 1e-10): "across",
    (-1e3, 1e3): "orifice.signed_root.x",
    (-1.5, 1.5): "first last",
}
RANGES = {name: ends for ends, names in _RANGES.items() for name in names.split()}
"""Ranges that arguments are drawn from, by name, or by module, function and name."""
PAIRS = {
    "chamber.pressure_rises.flow": (-0.5, 0.5),
    "chamber.pressure_rises.area": (0.05, 0.6),
    "slope": (-1e-8, 0.0),
    "rise_per_oil": (1e9, 1e11),
    "chambers": (-1e5, 22e6),
}
"""The same of what holds a value for each chamber."""


def drawn(kernel: str, rng: np.random.Generator) -> list[Any]:
    module = kernel.split(".")[0]
    parameters = {c.law: c.p for c in OWN} | {"hydraulic": FULL, "supply": Supply(*SUPPLY, 6e6, 0.02, 3e7, 0.03)}
    special = {
        "p": lambda: type(p := parameters[module])(*(x * rng.uniform(0.9, 1.1) for x in p)),
        "planar": lambda: rng.random() < 0.5,
        "modified": lambda: rng.random() < 0.5,
        "valve": lambda: (*rng.uniform(-0.5, 0.5, 2), *rng.uniform(-1e-8, 0.0, 2)),
        "values": lambda: WAVE * rng.uniform(0.9, 1.1),
    }
    found = []
    for name in takes(KERNELS[kernel]):
        whole = f"{kernel}.{name}"
        if name in special:
            found.append(special[name]())
        elif ends := PAIRS.get(whole) or PAIRS.get(name):
            found.append(tuple(rng.uniform(*ends, 2).tolist()))
        else:
            found.append(rng.uniform(*(RANGES.get(whole) or RANGES[name])))
    return found

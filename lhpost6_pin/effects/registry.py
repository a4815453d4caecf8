"""The laws by name: what each needs to act. The laws themselves are kernels in ``laws/``.

A law either makes forces on ports, with rows of its own in the effect table; or it alters what is there already
(`alters`): the oil of an actuator, the supply, a valve's delay, a bearing's thrust, the platen's inertia.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

__all__ = [
    "AIR",
    "AIR_INDEX",
    "AREA_A",
    "AREA_B",
    "ASYMMETRIC",
    "BACK",
    "BACKLASH",
    "BACK_TIME",
    "BALL",
    "BOUC_WEN_1D",
    "BOUC_WEN_2D",
    "BY_MEMORY",
    "BY_POSITION",
    "BY_SPEED",
    "CHAMBER_A",
    "CHAMBER_B",
    "CONSTANT",
    "CURVE_ERROR",
    "CURVE_POWER",
    "CURVE_SIDE",
    "DAHL_INSTEAD",
    "DEADBAND",
    "DRAG",
    "DRAWN",
    "DROOP",
    "DROOP_TIME",
    "END_STOP",
    "EXTERNAL",
    "EXTERNAL_SIDE",
    "FEED_DAMPING",
    "FEED_FREQUENCY",
    "FEED_INERTANCE",
    "GAS_HEAT",
    "GAS_LEAK",
    "HYDRAULIC_DOUBLE",
    "HYDRAULIC_SINGLE",
    "LAWS",
    "LEAKAGE",
    "LINE_DAMPING",
    "LINE_TIME",
    "LOAD_FRICTION",
    "MAX_PARAMS",
    "NITROGEN_STRUT",
    "NODES",
    "NULL_BIAS",
    "NULL_LEAKAGE",
    "NULL_WIDTH",
    "OSCILLATOR",
    "PLAY",
    "PLAY_FORCE",
    "PORTS",
    "RETURN",
    "RETURNED",
    "ROW",
    "SMOOTH_BALL",
    "SPRING",
    "STRIBECK",
    "SUPPLY",
    "TURBULENT",
    "VAPOUR",
    "VISCOUS",
    "VOIDS",
    "WARM_UP",
    "Law",
]

MAX_PARAMS = 36

ROW = np.dtype(
    [
        ("law", np.int64),  # code of the law
        ("effect", np.int64),  # number of the effect in the ledger
        ("port", np.int64),  # port it acts on
        ("port_2", np.int64),  # second port, -1 without
        ("port_3", np.int64),  # third port, -1 without
        ("state", np.int64),  # number of its first hidden state, -1 without
        ("input", np.int64),  # number of the spool that feeds it, -1 without
        ("link", np.int64),  # number of the first hidden state of the actuator on the same leg or pad, -1 without
        ("altered", np.int64),  # 1 where alterations have changed more than the report's numbers
        ("more", np.int64),  # number of the first hidden state of its lines behind the valve, -1 without
        ("feed", np.int64),  # the same of its line before the valve
        ("p", np.float64, MAX_PARAMS),  # the law's numbers, in the law's order; behind them those of alterations
    ]
)
"""Table row: one law on one port, or on two or three."""

PORTS = ("port", "port_2", "port_3")
"""Columns of a row's ports."""

# Codes of the laws that have rows, as the compiled stage reads them.
HYDRAULIC_DOUBLE, HYDRAULIC_SINGLE, NITROGEN_STRUT, BOUC_WEN_1D, BOUC_WEN_2D, VISCOUS, CONSTANT = range(7)
STRIBECK, ASYMMETRIC, WARM_UP, LOAD_FRICTION, BACKLASH, DRAG, SPRING, END_STOP = range(7, 15)
OSCILLATOR, GAS_LEAK, GAS_HEAT, BALL, BY_POSITION, BY_SPEED, SMOOTH_BALL, BY_MEMORY, DAHL_INSTEAD = range(15, 24)

# Places of numbers in the rows of actuators: some of the report's, then those of alterations.
AREA_A, AREA_B, LEAKAGE, CHAMBER_A, CHAMBER_B = 0, 1, 7, 8, 9
TURBULENT, EXTERNAL, EXTERNAL_SIDE, NULL_LEAKAGE, NULL_WIDTH, NULL_BIAS, DEADBAND = range(12, 19)
AIR, AIR_INDEX, VOIDS, VAPOUR, CURVE_ERROR, CURVE_SIDE, CURVE_POWER, LINE_TIME, LINE_DAMPING = range(19, 28)
PLAY, PLAY_FORCE, FEED_INERTANCE, FEED_FREQUENCY, FEED_DAMPING = range(28, 33)

# Places in the supply's numbers; a machine without alterations of it has the first two.
SUPPLY, RETURN, DROOP, DROOP_TIME, BACK, BACK_TIME, DRAWN, RETURNED, WEIGHT = range(9)


class Law(NamedTuple):
    """What a law needs."""

    code: int  # -1: no rows
    ports: int  # that one set of numbers acts on, at most
    params: tuple[tuple[str, str], ...]  # (name, unit)
    states: tuple[str, ...] = ()
    stores_energy: bool = False
    takes_spool: bool = False
    alters: str = ""  # "oil": an actuator's row; "supply", "valve", "leg", "inertia"; empty: nothing, it has own rows


_FLOW = tuple((name, "m3/s/Pa^0.5") for name in ("flow_pa", "flow_bt", "flow_at", "flow_pb"))
_HYDRAULIC = (
    ("area_a", "m2"),
    ("area_b", "m2"),
    *_FLOW,
    ("flow_curve", "1"),
    ("leakage", "m3/s/Pa"),
    ("chamber_a", "m"),
    ("chamber_b", "m"),
    ("bulk_modulus", "Pa"),
    ("root_regularisation", "Pa"),
)
_FRICTION = (("friction", "N"), ("yield_slip", "m"), ("shape", "1"))
_GAS = (("pressure", "Pa"), ("area", "m2"), ("gas_length", "m"), ("polytropic_index", "1"))

NODES = 24  # of a force by a table
_TABLE = tuple((f"force_{k + 1}", "N") for k in range(NODES))

LAWS: Mapping[str, Law] = {
    "hydraulic_double": Law(HYDRAULIC_DOUBLE, 1, _HYDRAULIC, ("pressure_a", "pressure_b"), True, True),
    "hydraulic_single": Law(HYDRAULIC_SINGLE, 1, _HYDRAULIC, ("pressure_a",), True, True),
    "nitrogen_strut": Law(
        NITROGEN_STRUT,
        1,
        (("pressure", "Pa"), ("area", "m2"), ("gas_length", "m"), ("polytropic_index", "1")),
        stores_energy=True,
    ),
    "bouc_wen_1d": Law(BOUC_WEN_1D, 1, _FRICTION, ("z",)),
    "bouc_wen_2d": Law(BOUC_WEN_2D, 2, _FRICTION, ("z_x", "z_y")),
    "viscous": Law(VISCOUS, 1, (("coefficient", "N s/m"),)),
    # beyond the report
    "constant": Law(CONSTANT, 1, (("force", "N | N m"),)),
    "stribeck": Law(STRIBECK, 1, (*_FRICTION, ("speed", "m/s")), ("z",)),
    "asymmetric": Law(ASYMMETRIC, 1, _FRICTION, ("z",)),
    "dahl_instead": Law(DAHL_INSTEAD, 2, (*_FRICTION, ("dahl_yield", "m")), ("z_x", "z_y", "d_x", "d_y")),
    "ball": Law(BALL, 3, (("moment", "N m"), ("yield_turn", "rad"), ("shape", "1")), ("z_1", "z_2", "z_3")),
    "smooth_ball": Law(SMOOTH_BALL, 3, (("moment", "N m"), ("slow", "rad/s"))),
    "warm_up": Law(
        WARM_UP, 1, (("growth", "N s/m"), ("yield_slip", "m"), ("shape", "1"), ("memory", "s")), ("z", "mean_speed")
    ),
    "load_friction": Law(
        LOAD_FRICTION,
        2,
        (("coefficient", "1"), ("yield_slip", "m"), ("shape", "1"), ("area_a", "m2"), ("area_b", "m2")),
        ("z_x", "z_y"),
    ),
    "backlash": Law(BACKLASH, 1, (("friction", "N"), ("yield_slip", "m"), ("gap", "m")), ("offset",), True),
    "drag": Law(DRAG, 1, (("force", "N"), ("exponent", "1"))),
    "spring": Law(SPRING, 2, (("stiffness", "N/m | N m/rad"), ("lever", "m")), stores_energy=True),
    "end_stop": Law(END_STOP, 1, (("force", "N"), ("start", "m"), ("exponent", "1")), stores_energy=True),
    "by_position": Law(BY_POSITION, 1, (("share", "1"), ("first", "m"), ("last", "m"), *_TABLE)),
    "by_speed": Law(BY_SPEED, 1, (("share", "1"), ("first", "m/s"), ("last", "m/s"), *_TABLE)),
    "by_memory": Law(
        BY_MEMORY,
        1,
        (("share", "1"), ("first", "m"), ("last", "m"), *_TABLE, ("memory", "s"), ("past", "1")),
        ("past_position",),
    ),
    "oscillator": Law(
        OSCILLATOR,
        3,
        (
            ("mass", "kg"),
            *(("circular_frequency", "rad/s"), ("damping", "1"), ("gravity", "m/s2")),
            *(("lever_2", "m"), ("lever_3", "m")),
        ),
        ("stretch", "velocity"),
    ),
    "gas_leak": Law(GAS_LEAK, 1, (("rate", "1/s"), *_GAS, ("lost", "1")), ("time",), True),
    "gas_heat": Law(GAS_HEAT, 1, (("share", "1"), *_GAS, ("time_constant", "s")), ("exchanged",), True),
    "thrust_direction": Law(-1, 1, (("share", "1"),), alters="leg"),
    "more_inertia": Law(
        -1,
        1,
        (
            ("mass", "kg"),
            *((f"first_{axis}", "kg m") for axis in "xyz"),
            *((f"second_{pair}", "kg m2") for pair in ("xx", "yy", "zz", "xy", "xz", "yz")),
        ),
        alters="inertia",
    ),
    "extra_leakage": Law(-1, 1, (("leakage", "m3/s/Pa"),), alters="oil"),
    "turbulent_leakage": Law(-1, 1, (("coefficient", "m3/s/Pa^0.5"),), alters="oil"),
    "external_leakage": Law(-1, 1, (("leakage", "m3/s/Pa"), ("side", "1")), alters="oil"),
    "null_leakage": Law(-1, 1, (("leakage", "m3/s/Pa^0.5"), ("width", "1")), alters="oil"),
    "null_bias": Law(-1, 1, (("bias", "1"),), alters="oil"),
    "deadband": Law(-1, 1, (("overlap", "1"),), alters="oil"),
    "entrained_air": Law(-1, 1, (("air", "1"), ("polytropic_index", "1")), alters="oil"),
    "cavitation": Law(-1, 1, (("share", "1"), ("vapour_pressure", "Pa")), alters="oil"),
    "flow_curve": Law(-1, 1, (("error", "1"), ("side", "1"), ("power", "1")), alters="oil"),
    "dead_volume": Law(-1, 1, (("volume", "m3"), ("side", "1")), alters="oil"),
    "play": Law(-1, 1, (("half_play", "m"), ("closing_force", "N")), alters="oil"),
    "line": Law(
        -1, 1, (("time", "s"), ("damping", "1")), ("flow_a", "flow_rate_a", "flow_b", "flow_rate_b"), alters="oil"
    ),
    "supply_line": Law(
        -1,
        1,
        (("inertance", "Pa s2/m3"), ("frequency", "Hz"), ("damping", "1")),
        ("line_pressure", "line_flow"),
        alters="oil",
    ),
    "supply_droop": Law(
        -1, 1, (("droop", "Pa s/m3"), ("time", "s"), ("weight", "1")), ("drawn_flow",), alters="supply"
    ),
    "back_pressure": Law(-1, 1, (("rise", "Pa s2/m6"), ("time", "s")), ("returned_flow",), alters="supply"),
    "valve_delay": Law(-1, 1, (("delay", "s"),), alters="valve"),
    "valve_lag": Law(-1, 1, (("time", "s"),), alters="valve"),
}
"""All laws by name."""

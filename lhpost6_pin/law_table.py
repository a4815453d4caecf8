"""The laws by name: what each needs to act. The laws themselves are kernels in ``laws/``.

A law either makes forces on ports, with rows of its own in the effect table; or it alters what is there already
(`alters`): the oil of an actuator, the supply, a valve's delay, a bearing's thrust, the platen's inertia.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

__all__ = [
    "BOUC_WEN_1D",
    "BOUC_WEN_2D",
    "CONSTANT",
    "HYDRAULIC_DOUBLE",
    "HYDRAULIC_SINGLE",
    "LAWS",
    "LEAKAGE",
    "MAX_PARAMS",
    "NITROGEN_STRUT",
    "ROW",
    "VISCOUS",
    "Law",
]

MAX_PARAMS = 32

ROW = np.dtype(
    [
        ("law", np.int64),  # code of the law
        ("effect", np.int64),  # number of the effect in the ledger
        ("port", np.int64),  # port it acts on
        ("port_2", np.int64),  # second port, -1 without
        ("state", np.int64),  # number of its first hidden state, -1 without
        ("input", np.int64),  # number of the spool that feeds it, -1 without
        ("link", np.int64),  # row of the actuator or strut on the same port, -1 without
        ("altered", np.int64),  # 1 where alterations have changed more than the report's numbers
        ("more", np.int64),  # number of the first hidden state that alterations have given it, -1 without
        ("shared", np.int64),  # number of the first hidden state of the supply, -1 without
        ("p", np.float64, MAX_PARAMS),  # the law's numbers, in the law's order; behind them those of alterations
    ]
)
"""Table row: one law on one port (or pair of ports)."""

# Codes of the laws that have rows, as the compiled stage reads them.
HYDRAULIC_DOUBLE, HYDRAULIC_SINGLE, NITROGEN_STRUT, BOUC_WEN_1D, BOUC_WEN_2D, VISCOUS, CONSTANT = range(7)

# Places of numbers in the rows of actuators.
LEAKAGE = 7


class Law(NamedTuple):
    """What a law needs."""

    code: int  # -1: no rows
    ports: int  # that one set of numbers acts on
    params: tuple[tuple[str, str], ...]  # (name, unit)
    states: tuple[str, ...] = ()
    stores_energy: bool = False
    takes_spool: bool = False
    alters: str = ""  # "oil": numbers of an actuator's row; empty: nothing, it has rows of its own


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
    "extra_leakage": Law(-1, 1, (("leakage", "m3/s/Pa"),), alters="oil"),
}
"""All laws by name."""

"""All laws by name and code; the effect table, one row a law on its ports; and a row's parameters by name."""

import pkgutil
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import laws
from ..laws.contract import Law, parameter_sizes

__all__ = ["CODES", "HYDRAULIC", "INLINED", "LAWS", "PORTS", "ROW", "actuator_rows", "columns_of", "law_of"]
__all__ += ["parameters_of", "shapes_of", "states_of"]


def _all_laws() -> dict[str, Law]:
    """Laws of every module of `laws/`: those that make forces first, the report's (`inlined`) before the others."""
    found: dict[str, Law] = {}
    for name in (m.name for m in pkgutil.iter_modules(laws.__path__)):
        module = import_module(f"{laws.__name__}.{name}")
        found |= getattr(module, "LAWS", {}) | ({name: module.LAW} if hasattr(module, "LAW") else {})
    return dict(sorted(found.items(), key=lambda item: (bool(item[1].modifies), not item[1].inlined)))


LAWS: Mapping[str, Law] = _all_laws()
"""All laws by name."""

CODES: Mapping[str, int] = {name: i for i, name in enumerate(n for n, law in LAWS.items() if not law.modifies)}
"""Codes of the laws that have rows."""

INLINED = sum(law.inlined for law in LAWS.values())
"""Codes below it are those of the report's laws."""

HYDRAULIC = CODES["hydraulic"]
"""Code of the actuators' law."""

MOST_NUMBERS = max(sum(parameter_sizes(LAWS[name]).values()) for name in CODES)
"""Numbers of the law that has most parameters."""

ROW = np.dtype(
    [
        ("law", np.int64),  # code of the law
        ("effect", np.int64),  # number of the effect in the ledger
        ("port", np.int64),  # port it acts on
        ("port_2", np.int64),  # second port, -1 without
        ("port_3", np.int64),  # third port, -1 without
        ("state", np.int64),  # number of its first hidden state, -1 without
        ("spool", np.int64),  # number of its valve's spool, -1 without
        ("actuator_state", np.int64),  # number of the first hidden state of the actuator on its leg or pad, -1 without
        ("modified", np.int64),  # 1 where modifiers act beyond the report's parameters
        ("line_state", np.int64),  # number of the first hidden state of the lines behind its valve, -1 without
        ("supply_line_state", np.int64),  # the same of the line before its valve
        ("numbers", np.float64, MOST_NUMBERS),  # the law's parameters, in the law's order
    ]
)
"""Table row: one law on one port, or on two or three."""

PORTS = ("port", "port_2", "port_3")
"""Columns of a row's ports."""

_BY_CODE = {code: LAWS[name] for name, code in CODES.items()}


def _shape_mask(law: Law) -> NDArray[np.bool_]:
    """Which of a row's numbers its hidden states depend on: all but the amplitudes of its force."""
    sizes = parameter_sizes(law)
    mask = np.repeat([name not in law.amplitude for name in sizes], list(sizes.values()))
    return np.pad(mask, (0, MOST_NUMBERS - len(mask)))


_SHAPES = np.array([_shape_mask(_BY_CODE[code]) for code in range(len(_BY_CODE))])


def law_of(row: np.void) -> Law:
    """The law of a row."""
    return _BY_CODE[int(row["law"])]


def states_of(row: np.void) -> slice:
    """Hidden states of a row that has some."""
    law, first = law_of(row), int(row["state"])
    absent = 0
    if law.state_needs:
        p = parameters_of(row)
        absent = sum(getattr(p, parameter) <= 0.0 for _, parameter in law.state_needs)
    return slice(first, first + len(law.states) - absent)


def parameters_of(row: np.void) -> Any:
    """Parameters of a row by name, as plain floats; a table of values as an array."""
    return _named(law_of(row), row["numbers"].tolist(), np.array)


def columns_of(rows: NDArray[np.void]) -> Any:
    """Parameters of rows of one law by name, each (n_rows,)."""
    return _named(law_of(rows[0]), list(rows["numbers"].T), np.stack)


def _named(law: Law, numbers: list[Any], table: Callable[[list[Any]], Any]) -> Any:
    """The law's NamedTuple of parameters from a row's numbers, in order."""
    found, at = [], 0
    for size in parameter_sizes(law).values():
        found.append(numbers[at] if size == 1 else table(numbers[at : at + size]))
        at += size
    return law.parameters(*found)


def actuator_rows(rows: NDArray[np.void]) -> NDArray[np.int64]:
    """Numbers of the rows that are actuators, in the order of their spools."""
    found = np.flatnonzero(rows["law"] == HYDRAULIC)
    return found[np.argsort(rows["spool"][found], kind="stable")]


def shapes_of(rows: "NDArray[np.void] | np.void") -> NDArray[np.float64]:
    """Numbers of rows (..., n) that their hidden states depend on; zero in place of the others."""
    return np.where(_SHAPES[rows["law"]], rows["numbers"], 0.0)

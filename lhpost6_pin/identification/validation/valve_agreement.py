"""Servovalves: spools against their commands, actuator by actuator (report, Figure 6.21).

The model has a pure delay between a command and the spool. The measured one is the slope of the transfer function's
phase; a command that is held over the controller's samples adds half of one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ...core.arrays import Array, Complex
from ...data.alignment import combine_delays, phase_delay
from ...data.records import sample_interval
from ...machine.machine import Machine
from .metrics import Numbers

__all__ = ["Valves", "find_valves"]


@dataclass(frozen=True)
class Valves:
    """Delays of spools (k,) behind their commands; transfer functions of the test with the most accurate delays."""

    columns: tuple[str, ...]
    delay: Array  # (k,) over all tests [s]
    standard_error: Array  # (k,) [s]
    model: Array  # (k,) of the machine [s]
    test: str
    frequency: Array  # (f,) [Hz]
    response: Complex  # (f, k) [1]; nan where spool and command are not coherent


def find_valves(machine: Machine, records: Sequence[xr.Dataset], numbers: Numbers) -> Valves | None:
    """Delays and transfer functions of all records that have spools and commands; None if none has."""
    names = list(machine.actuator_names)
    found = []
    for record in records:
        if {"spool_command", "spool_position"} <= set(record.data_vars):
            sides = (record[n].sel(actuator=names).values for n in ("spool_command", "spool_position"))
            command, spool = (np.asarray(x, float) for x in sides)
            dt = sample_interval(record)
            found.append((record, command, spool, dt, *phase_delay(command, spool, dt)))
    if not found:
        return None
    delays, errors = (np.array([test[k] for test in found]) for k in (4, 5))  # (tests, k)
    each = np.array([combine_delays(d, e) for d, e in zip(delays.T, errors.T, strict=True)])
    each[~np.isfinite(each[:, 1])] = np.nan
    record, command, spool, dt = found[int(np.argmin(np.median(errors, axis=1)))][:4]
    f, response = _response(command, spool, dt, numbers)
    model = np.array([a.valve_delay for a in machine.actuators])
    return Valves(tuple(names), each[:, 0], each[:, 1], model, str(record.attrs.get("test", "test")), f, response)


def _response(command: Array, spool: Array, dt: float, numbers: Numbers) -> tuple[Array, Complex]:
    """Frequencies (f,) and transfer functions (f, k), by Welch's averages."""
    from scipy.signal import csd, welch

    each = {"fs": 1 / dt, "nperseg": min(round(numbers.number("valves.segment") / dt), len(command)), "axis": 0}
    f, commanded = welch(command, **each)
    done, cross = welch(spool, **each)[1], csd(command, spool, **each)[1]
    coherence = np.divide(
        np.abs(cross) ** 2, commanded * done, out=np.zeros_like(commanded), where=commanded * done > 0.0
    )
    nothing = np.full_like(cross, np.nan)
    return f, np.divide(cross, commanded, out=nothing, where=coherence > numbers.number("valves.coherence"))

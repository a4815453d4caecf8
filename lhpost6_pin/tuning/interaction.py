"""Interaction of table and specimen: what a specimen cuts into the table's response, and what recovers it.

Responses from reference to feedback are those of the linear model at rest without dry friction (`margins`), with the
same settings on the bare table and under the specimen, with settings before tuning, and behind an inverse filter as
`iterate` identifies it. Modes of the specimen are those on a platen held fast.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..control import ControllerSettings, controlled
from ..control.inverse import InverseFilter
from ..core.arrays import Array, Complex
from ..core.names import AXES
from ..machine.machine import Machine
from ..mechanics.specimen_modes import SpecimenMode, specimen_modes
from .identify import tuning_numbers
from .margins import expected_response, linear_table, make_loop_model

__all__ = ["Cut", "Interaction", "find_interaction"]


class Cut(NamedTuple):
    """Notch and peak that a specimen cuts into the response of an axis, against the bare table's."""

    axis: str
    notch: float  # factor [1]
    notch_frequency: float  # [Hz]
    peak: float
    peak_frequency: float


@dataclass(frozen=True)
class Interaction:
    """Responses of every axis to its own reference, the linear model's."""

    frequency: Array  # (m,) [Hz]
    axes: tuple[str, ...]
    responses: Mapping[str, Complex]  # (m, n) by what they are of; the bare table's first, then the run's own
    cuts: Mapping[str, tuple[Cut, ...]]  # of every response but the bare table's
    modes: tuple[SpecimenMode, ...]
    rigid: bool  # whether nothing of the specimen moves relative to the platen


def find_interaction(
    machine: Machine,
    used: ControllerSettings,
    before: ControllerSettings | None = None,
    inverse: InverseFilter | None = None,
) -> Interaction:
    """Interaction of a machine with its specimen under the settings used; `before` are others, if they differ.

    Raises what `linearize` does.
    """
    high = tuning_numbers().number("feedforward_targets.high")
    plant, _, own = controlled(machine, used)
    table = linear_table(own)
    f = _frequencies(table.a, high)
    cases = {BARE: (replace(machine, specimen=None), used), MOUNTED: (machine, used)}
    if before is not None and before != used:
        cases["with specimen, settings before"] = machine, before
    responses: dict[str, Complex] = {}
    for name, (case, settings) in cases.items():
        _, _, controller = controlled(case, settings)
        full = expected_response(make_loop_model(controller, f), controller)
        responses[name] = np.einsum("mkk->mk", full)
        if name == MOUNTED and inverse is not None:
            filtered = full @ _response_of(inverse, f, [AXES[k] for k in plant.axes])
            responses["with specimen, drive conditioned by the inverse"] = np.einsum("mkk->mk", filtered)
    axes = tuple(AXES[k] for k in plant.axes)
    inside = f <= high
    cuts = {n: _cuts(f[inside], axes, r[inside], responses[BARE][inside]) for n, r in responses.items() if n != BARE}
    return Interaction(f, axes, responses, cuts, specimen_modes(plant), not plant.flexible)


BARE, MOUNTED = "bare table", "with specimen"
"""Names of the responses of the bare table and of the run's own."""


def _cuts(f: Array, axes: tuple[str, ...], response: Complex, bare: Complex) -> tuple[Cut, ...]:
    ratio = np.abs(response) / np.abs(bare)
    found = []
    for axis, one in zip(axes, ratio.T, strict=True):
        low, high = int(np.argmin(one)), int(np.argmax(one))
        found.append(Cut(axis, float(one[low]), float(f[low]), float(one[high]), float(f[high])))
    return tuple(found)


def _response_of(inverse: InverseFilter, f: Array, axes: list[str]) -> Complex:
    """Response (m, n, n) of an inverse filter on the free axes; unity on those that it has not."""
    half = len(inverse.taps) // 2
    lag = (np.arange(len(inverse.taps)) - half) / inverse.rate
    out = np.tile(np.eye(len(axes), dtype=complex), (len(f), 1, 1))
    own = [axes.index(name) for name in inverse.axes if name in axes]
    kept = [k for k, name in enumerate(inverse.axes) if name in axes]
    taps = inverse.taps[:, kept][:, :, kept].reshape(len(lag), -1)
    spectrum = np.vstack([np.exp(-2j * np.pi * np.outer(part, lag)) @ taps for part in np.array_split(f, 40)])
    out[np.ix_(np.arange(len(f)), np.array(own), np.array(own))] = spectrum.reshape(len(f), len(own), len(own))
    return out


def _frequencies(a: Array, high: float) -> Array:
    """Frequencies [Hz] from 0.1 to half above `high`, denser about the resonances of the linear table."""
    rates = np.linalg.eigvals(a)
    modes = np.abs(rates.imag[rates.imag > 0.0]) / (2.0 * np.pi)
    spread = np.sinh(np.linspace(-4.0, 4.0, 31)) / np.sinh(4.0) * 0.15
    grid = np.unique(np.concatenate([np.geomspace(0.1, 1.5 * high, 400), np.outer(modes, 1.0 + spread).ravel()]))
    return np.asarray(grid[(grid >= 0.1) & (grid <= 1.5 * high)])

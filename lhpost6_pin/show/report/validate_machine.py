"""Sections of a validation report over all tests: drift, closed loop, oil columns, servovalves."""

from collections.abc import Sequence

import numpy as np

from ...identification.validation import PHASES, Phase, Validation, Valves
from .page import Block, Table, details, number
from .scales import ROTATIONS, percent, shown_as
from .validate_plots import scale_of, valve_figures
from .validate_sections import why_not

__all__ = ["drift_blocks", "lag_blocks", "resonance_blocks", "valve_blocks"]


def drift_blocks(found: Validation) -> list[Block]:
    """Return the drift rate of every test's open loop."""
    phases = [p for p in found.phases if p.number == 2 and not p.reason]
    if not phases:
        return [f"Not available: {why_not(found, 2)}."]
    axes = [a.column for a in phases[0].of("displacement")]
    rows = [
        (p.test, *(number(1e6 * a.drift) for a in p.of("displacement")), f"{number(float(p.time[-1]))} s")
        for p in phases
    ]
    how = (
        "Least-squares slope of the displacement error, model less measured. An open loop integrates errors of "
        "pressures, spools, flow and leakage; a closed loop has no such drift. Rate times duration approximates the "
        "final displacement error."
    )
    header = ("Test", *(f"{axis} [{'µrad/s' if axis in ROTATIONS else 'µm/s'}]" for axis in axes), "Over")
    worst = [
        _furthest(phases, [k for k, axis in enumerate(axes) if (axis in ROTATIONS) == turns]) for turns in (False, True)
    ]
    largest = f"Largest drift: {'; '.join(words for words in worst if words)}."
    return [how, Table("Drift rate", header, rows), largest]


def _furthest(phases: Sequence[Phase], columns: Sequence[int]) -> str:
    """The largest accumulated drift of some columns, as text."""
    ends = [(p, p.of("displacement")[k], float(p.time[-1])) for p in phases for k in columns]
    if not ends:
        return ""
    phase, one, seconds = max(ends, key=lambda end: abs(end[1].drift * end[2]))
    scale = scale_of("displacement", one.column)
    pair = phase.pair("displacement")
    assert pair is not None
    peak = float(np.abs(pair.measured[:, pair.columns.index(one.column)]).max())
    moved = f"peak {shown_as(peak, scale)}" if one.moves else "almost at rest"
    off = shown_as(abs(one.drift) * seconds, scale)
    return f"{one.column} in {phase.test}, {off} after {number(seconds)} s ({moved})"


def lag_blocks(found: Validation) -> list[Block]:
    """Return the delays of test and simulated closed loop behind the reference."""
    rows = [
        (p.test, lag.column, *(number(1e3 * value) for value in (lag.measured, lag.model, lag.model - lag.measured)))
        for p in found.phases
        for lag in p.lags
    ]
    if not rows:
        return [f"Not available: {why_not(found, 3)}."]
    how = (
        "Delay of the platen velocity behind the reference velocity, for axes that moved. “Delay removed” refers to "
        "the difference of the two."
    )
    header = ("Test", "Axis", "Measured [ms]", "Model [ms]", "Model less measured [ms]")
    return [how, Table("Delay behind the reference", header, rows)]


def valve_blocks(found: Validation) -> list[Block]:
    """Return spools against their commands: delays and transfer functions."""
    valves = found.valves
    if valves is None:
        return ["Not available: no test has both spool_command and spool_position."]
    how = (
        "Delay of each spool behind its command, from the slope of the transfer function's phase over all tests. The "
        "model has a pure delay; a command held over the controller's samples adds half of one (0.244 ms at 2048 Hz), "
        "and the spools' channels may have a skew of their own."
    )
    columns = zip(valves.columns, valves.delay, valves.standard_error, valves.model, strict=True)
    rows = [
        (c, number(1e3 * d, 4), number(1e3 * e, 2), number(1e3 * m, 4), number(1e3 * (m - d), 2))
        for c, d, e, m in columns
    ]
    header = ("Actuator", "Measured [ms]", "Standard error [ms]", "Model [ms]", "Model less measured [ms]")
    blocks = [valve_figures(valves), details("Every delay", Table("Servovalve delays", header, rows))]
    return [f"{how} Measured: {_delays_of(valves)}.", *blocks]


def resonance_blocks(found: Validation) -> list[Block]:
    """Return the oil-column resonances of tests and model."""
    rows = [
        (
            f"{p.test}, {PHASES[p.number]}",
            r.column,
            number(r.expected),
            *(number(x.frequency, 4) for x in (r.measured, r.model)),
            *(percent(x.sharpness) for x in (r.measured, r.model)),
        )
        for p in found.phases
        for r in p.resonances
        if np.isfinite(r.measured.frequency) and np.isfinite(r.model.frequency)
    ]
    how = (
        "Peak of the response of an axis's acceleration to its spools near the oil column of the linear model "
        "(undamped, sliding friction), if coherent and above noise. Sharpness: half the relative half-power width, a "
        "damping ratio unless limited by the length of the test. Axes almost at rest, and peaks found in only one of "
        "test and model, are omitted."
    )
    if not rows:
        return [how, "No oil-column resonance was found."]
    header = ("Test", "Axis", "Linear model [Hz]", "Measured [Hz]", "Model [Hz]", "Sharpness, measured", "and model")
    return [how, Table("Oil columns", header, rows)]


def _delays_of(valves: Valves) -> str:
    """Least and greatest delay in words, of the spools whose delay is known nearly as well as the best known."""
    known = np.isfinite(valves.standard_error)
    if not known.any():
        return "not determined, too little spool motion"
    sure = valves.delay[known & (valves.standard_error <= 10 * valves.standard_error[known].min())]
    low, high = number(1e3 * float(sure.min())), number(1e3 * float(sure.max()))
    return f"{low} ms" if low == high else f"{low} to {high} ms"

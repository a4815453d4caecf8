"""The numbers of a validation as a file, for other programs."""

from itertools import pairwise
from pathlib import Path
from typing import Any

from ...core.files import write_whole
from ...core.jsonable import as_json
from .phases import PHASES, Phase
from .spectra import Peak, Resonance, Spectrum, Valves
from .validate import Validation

__all__ = ["metrics", "save_metrics"]

_UNITS = {
    "seconds, delay, standard_error, behind_reference": "s",
    "frequency, linear_model, low_pass": "Hz",
    "variation, error, error_aligned, noise, offset, offset_expected": "the row's unit",
    "drift": "the row's unit per second",
    "all others": "1",
}


def metrics(found: Validation) -> dict[str, Any]:
    """All numbers of a validation, SI, by test and phase; None where not known."""
    machine = found.machine
    return {
        "campaign": found.campaign,
        "machine": machine.name,
        "specimen": machine.specimen.name if machine.specimen else "none",
        "units": _UNITS,
        "low_pass": found.numbers.band.high,
        "skews": {group: {"delay": d.delay, "standard_error": d.standard_error} for group, d in found.skews.items()},
        "valves": _valves(found.valves),
        "tests": {
            test: {PHASES[p.number]: _phase(p, found) for p in found.phases if p.test == test} for test in found.tests
        },
    }


def save_metrics(found: Validation, path: Path) -> None:
    """Write `metrics` as JSON, whole or not at all."""
    with write_whole(path) as beside:
        beside.write_text(as_json(metrics(found)) + "\n", encoding="utf-8")


def _phase(phase: Phase, found: Validation) -> dict[str, Any]:
    if phase.reason:
        return {"reason": phase.reason}
    out: dict[str, Any] = {"seconds": float(phase.time[-1]), "notes": list(phase.notes), "agreement": {}}
    for one in phase.agreement:
        row = {**one._asdict(), "error_to_noise": one.error_to_noise}
        out["agreement"].setdefault(row.pop("quantity"), {})[row.pop("column")] = row
    if phase.spectrum is not None:
        out["amplitude_ratio"] = _ratios(phase.spectrum, found.numbers.bands)
    out["resonance"] = {r.column: _resonance(r) for r in phase.resonances}
    if phase.lags:
        out["behind_reference"] = {lag.column: {"measured": lag.measured, "model": lag.model} for lag in phase.lags}
    return out


def _valves(valves: Valves | None) -> dict[str, Any] | None:
    if valves is None:
        return None
    columns = zip(valves.columns, valves.delay, valves.standard_error, valves.model, strict=True)
    return {c: {"delay": float(d), "standard_error": float(e), "model": float(m)} for c, d, e, m in columns}


def _ratios(spectrum: Spectrum, edges: tuple[float, ...]) -> dict[str, Any]:
    bands = [f"{low:g}-{high:g} Hz" for low, high in pairwise(edges)]
    columns = zip(spectrum.columns, spectrum.ratio.T.tolist(), strict=True)
    return {"quantity": spectrum.quantity} | {c: dict(zip(bands, values, strict=True)) for c, values in columns}


def _resonance(one: Resonance) -> dict[str, Any]:
    def entries(peak: Peak) -> dict[str, float]:
        return {"frequency": peak.frequency, "sharpness": peak.sharpness}

    return {"linear_model": one.expected, "measured": entries(one.measured), "model": entries(one.model)}

"""Results of commands as entries for `--json`: SI units, angles in radians, fractions."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.names import AXES
from ..data.layout_faults import RecordFinding
from ..identification.calibration import Calibration
from ..identification.calibration.verdicts import verdict_on
from ..identification.decompose import Decomposed, WrenchAgreement
from ..identification.residuals import RESIDUALS
from ..machine.machine import Machine
from ..simulation.simulate import Run
from ..tuning.iterate import Iterated
from ..tuning.sine import SineResult, SineTest
from ..tuning.tune import Tuning

if TYPE_CHECKING:
    from .report.run_report import RunSummary

__all__ = [
    "agreement_entries",
    "calibration_entries",
    "capacity_entries",
    "finding_entries",
    "iteration_entries",
    "machine_entries",
    "motion_entries",
    "run_entries",
    "sine_entries",
    "tuning_entries",
]

Entries = dict[str, Any]


def machine_entries(machine: Machine) -> Entries:
    """Every quantity of a machine with unit, deviation, evidence and source, and its effects."""
    every = (*machine.effects, *machine.modifiers)
    return {
        "name": machine.name,
        "title": machine.title,
        "motion": machine.motion,
        "actuators": machine.actuator_names,
        "struts": machine.strut_names,
        "quantities": {
            path: {n: getattr(q, n) for n in ("value", "unit", "sd", "evidence", "assumed", "source")}
            for path, q in machine.parameters.quantities.items()
        },
        "effects": [{n: getattr(e, n) for n in ("name", "law", "ports", "source")} for e in every],
    }


def capacity_entries(machine: Machine) -> Entries:
    """Capacity against Table 2.2 (if the machine has that table), and the oil-column modes."""
    from ..mechanics.capacity import capacity_table, has_printed_capacity
    from ..mechanics.linearize import oil_column_modes

    lines = capacity_table(machine) if has_printed_capacity(machine) else None
    return {
        "capacity": lines and [{**line._asdict(), "deviation": line.deviation} for line in lines],
        "modes": oil_column_modes(machine),
        "modes_with_friction_and_leaks": oil_column_modes(machine, undamped=False),
    }


def motion_entries(name: str | None) -> Entries:
    """All motions by name, or the options of one. Raises UnknownNameError."""
    from ..motions import list_motions, motion_entry, motion_options

    if name is None:
        return {"motions": list_motions()}
    found = motion_entry(name)
    words = ("option", "default", "unit", "source")
    return {**found._asdict(), "options": [dict(zip(words, o, strict=True)) for o in motion_options(found.name)]}


def finding_entries(found: Mapping[str, Sequence[RecordFinding]]) -> Entries:
    """Findings on records, by file."""
    every = [f for findings in found.values() for f in findings]
    return {
        "records": found,
        "errors": sum(f.severity == "error" for f in every),
        "warnings": sum(f.severity == "warning" for f in every),
    }


def run_entries(run: Run, summary: "RunSummary | None") -> Entries:
    """Outcome of a run and, with a summary, its tracking and demand over capacity."""
    entries: Entries = {
        "seconds": run.time[-1] + 1 / run.rate,
        "scheme": run.scheme,
        "steps_per_second": run.steps_per_second,
        "engine": run.engine,
        "spool_values_clipped": run.clipped,
        "trouble": run.trouble,
    }
    if summary is not None:
        names = ("axis", "quantity", "peak_target", "peak_achieved", "rrmse", "delay", "rrmse_aligned")
        entries |= {
            "verdict": summary.verdict,
            "level": summary.level,
            "tracking": [{n: getattr(row, n) for n in names} for row in summary.tracking if row.peak_target],
            "spools": [{n: getattr(s, n) for n in ("actuator", "peak", "rms")} for s in summary.spools],
            "limits": [use._asdict() for use in summary.limits],
            "channels_missing": summary.missing,
        }
    return entries


def tuning_entries(found: Tuning) -> Entries:
    """Bands, delays, margins and gains of every axis before and after."""
    gains = ("displacement_gain", "force_damping", *(f"{n}_feedforward" for n in ("velocity", "acceleration", "jerk")))

    def axis(one: Any) -> Entries:
        names = [f"{what}_{when}" for what in ("band", "delay", "margin") for when in ("before", "after")]
        place = AXES.index(one.axis)
        return {
            **{name: getattr(one, name) for name in names},
            "limited_by": one.limited_by,
            "gains": {name: getattr(found.after, name)[place] for name in gains},
        }

    return {
        "tolerance_db": found.tolerance,
        "coherence": found.coherence,
        "stable_with_gains_doubled": found.doubled,
        "axes": {one.axis: axis(one) for one in found.axes},
    }


def iteration_entries(found: Iterated) -> Entries:
    """Errors of every iteration by axis, the best iteration, and the stopping criterion."""

    def by_axis(values: Any) -> Entries:
        return {a: v for a, v in zip(AXES, values, strict=True) if not math.isnan(v)}

    history = [
        {
            "number": one.number,
            **{name: by_axis(getattr(one, name)) for name in ("acceleration", "displacement", "delay")},
            "peak_spool": one.peak_spool,
            "clipped": one.clipped,
        }
        for one in found.history
    ]
    return {"iterations": history, "best": found.best, "stopped": found.reason}


def sine_entries(found: SineTest) -> Entries:
    """Amplitude, phase and distortion without and with the cancellers."""
    names = ("amplitude_error", "phase_error", "distortion", "distortion_displacement", "peak_spool")

    def result(one: SineResult) -> Entries:
        return {**{name: getattr(one, name) for name in names}, "clipped": one.run.clipped}

    asked = {name: getattr(found, name) for name in ("axis", "amplitude", "frequency")}
    return {**asked, "alone": result(found.before), "with_cancellers": result(found.after)}


def agreement_entries(found: Decomposed, agreement: WrenchAgreement) -> Entries:
    """Modelled against measured forces, and the residual with its expected levels, by axis."""
    matches = {name: getattr(agreement, name) for name in ("actuators", "struts", "dissipative")}

    def axis(k: int) -> Entries:
        forces = {
            name: None if one is None else {"rrmse": one.rrmse[k], "rrmse_mean_off": one.rrmse_varying[k]}
            for name, one in matches.items()
        }
        residual = {
            "mean": agreement.residual.offset[k],
            "sd": agreement.residual.varying[k],
            "noise_sd": agreement.noise[k],
            "sensors_sd": agreement.sensors.varying[k],
            "parameters_sd": agreement.parameters.varying[k],
            "sd_explained_by": agreement.varying_explained[k],
            "mean_explained_by": agreement.offset_explained[k],
        }
        return {**forces, "delay": agreement.actuators.delay[k], "residual": residual}

    return {
        "compared_up_to_hz": found.comparison.band.high,
        "axes": {AXES[k]: axis(int(k)) for k in found.plant.axes},
    }


def calibration_entries(found: Calibration) -> Entries:
    """Parameters with intervals and verdicts, sensor errors, misfits of every test."""
    parameters, first = {}, len(found.parameters)
    for i, parameter in enumerate(found.parameters):
        parameters[parameter.name] = {
            "nominal": parameter.value,
            "value": parameter.at(float(found.estimate[i])),
            "unit": parameter.unit,
            "ci90": found.interval(i),
            "sd_over_prior": found.sd[i] / found.prior[i],
            "verdict": verdict_on(found, i),
        }
    sensors = {
        one.name: {
            "value": found.estimate[first + i],
            "unit": one.unit,
            "sd": found.sd[first + i] if found.converged else None,
            "verdict": verdict_on(found, first + i),
        }
        for i, one in enumerate(found.unknowns)
    }
    misfits = {
        test: {
            kind: {"before": b, "after": a}
            for kind, b, a in zip(RESIDUALS, before, after, strict=True)
            if np.isfinite(a)
        }
        for test, before, after in zip(found.tests, found.misfit_before, found.misfit_after, strict=True)
    }
    return {
        "campaign": found.campaign,
        "converged": found.converged,
        "rounds": found.rounds,
        "parameters": parameters,
        "sensors": sensors,
        "misfit": misfits,
        "alike": [{"pair": [a, b], "correlation": c} for a, b, c in found.alike()],
    }

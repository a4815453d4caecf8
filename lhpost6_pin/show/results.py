"""Results of commands as entries for `--json`: SI units, angles in radians, fractions."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.arrays import Array
from ..core.names import AXES
from ..data.layout_faults import RecordFinding
from ..machine.machine import Machine

if TYPE_CHECKING:
    from ..data.motion_measures import MotionMeasures
    from ..identification.calibration import Calibration
    from ..identification.decompose import Decomposed, WrenchAgreement
    from ..identification.decompose.interface import InterfaceWrench
    from ..simulation.simulate import Run
    from ..tuning.iterate import Iterated
    from ..tuning.sine import SineTest
    from ..tuning.tune import Tuning
    from .capacity_tables import MachineCapacity
    from .report.run_report import RunSummary

__all__ = [
    "agreement_entries",
    "calibration_entries",
    "capacity_entries",
    "finding_entries",
    "iteration_entries",
    "machine_entries",
    "motion_entries",
    "report_entries",
    "run_entries",
    "sine_entries",
    "tuning_entries",
]

Entries = dict[str, Any]


def _picked(source: Any, *names: str) -> Entries:
    """Attributes of an object by name."""
    return {name: getattr(source, name) for name in names}


def machine_entries(machine: Machine) -> Entries:
    """Every quantity of a machine with unit, deviation, evidence and source, and its effects."""
    quantities = machine.parameters.quantities.items()
    return {
        **_picked(machine, "name", "title", "motion"),
        "actuators": machine.actuator_names,
        "struts": machine.strut_names,
        "quantities": {p: _picked(q, "value", "unit", "sd", "evidence", "assumed", "source") for p, q in quantities},
        "effects": [_picked(e, "name", "law", "ports", "source") for e in (*machine.effects, *machine.modifiers)],
    }


def capacity_entries(found: "MachineCapacity") -> Entries:
    """Capacity with what is mounted, limits by axis, and oil-column modes: of the bare table, and with a specimen."""
    from ..mechanics.linearize import oil_column_modes
    from . import capacity_tables

    machine = found.machine
    loaded = [oil_column_modes(machine, undamped=u, loaded=True) if machine.specimen else () for u in (True, False)]
    return {
        **capacity_tables.capacity_entries(found),
        "modes": oil_column_modes(machine),
        "modes_with_friction_and_leaks": oil_column_modes(machine, undamped=False),
        "loaded_modes": loaded[0],
        "loaded_modes_with_friction_and_leaks": loaded[1],
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


def run_entries(run: "Run", summary: "RunSummary | None") -> Entries:
    """Outcome of a run and, with a summary, its tracking and demand over capacity."""
    entries = {
        "seconds": run.time[-1] + 1 / run.rate,
        **_picked(run, "scheme", "steps_per_second", "engine"),
        "spool_values_clipped": run.clipped,
        "trouble": run.trouble,
    }
    if run.coupling is not None:
        stability = _picked(run.coupling.stability, "spectral_radius", "growth")
        entries["interface"] = _picked(run.coupling, "energy", "energy_error") | stability
    return entries if summary is None else entries | report_entries(summary)


def report_entries(summary: "RunSummary") -> Entries:
    """Verdict, tracking and demand over capacity of a run's report."""
    names = ("axis", "quantity", "peak_target", "peak_achieved", "rrmse", "delay", "rrmse_aligned")
    return {
        **_picked(summary, "verdict", "level"),
        "tracking": [_picked(row, *names) for row in summary.tracking if row.peak_target],
        "intensity": {one.axis: _intensity(one) for one in summary.measures if one.intensity},
        "spools": [_picked(spool, "actuator", "peak", "rms") for spool in summary.spools],
        "limits": [use._asdict() for use in summary.limits],
        "channels_missing": summary.missing,
    }


def _intensity(one: "MotionMeasures") -> Entries:
    """Intensity measures of target and achieved motion of an axis, and the error of its response spectrum."""
    return {name: values._asdict() for name, values in one.intensity.items()} | {"spectrum_error": one.spectrum_error}


def tuning_entries(found: "Tuning") -> Entries:
    """Bands, delays, margins and gains of every axis before and after."""
    gains = ("displacement_gain", "force_damping", *(f"{n}_feedforward" for n in ("velocity", "acceleration", "jerk")))

    names = [f"{what}_{when}" for what in ("band", "delay", "margin") for when in ("before", "after")]
    axes = {}
    for one in found.axes:
        chosen = {name: values[AXES.index(one.axis)] for name, values in _picked(found.after, *gains).items()}
        axes[one.axis] = {
            **_picked(one, *names, "limited_by", "limited_by_specimen", "worse", "traded", "doubt"),
            "gains": chosen,
        }
    return {
        "tolerance_db": found.tolerance,
        "coherence": found.coherence,
        "stable_before": found.was_stable,
        "stable_with_gains_doubled": found.doubled,
        "axes": axes,
    }


def iteration_entries(found: "Iterated") -> Entries:
    """Errors of every iteration by axis, the best iteration, and the stopping criterion."""
    history = []
    for one in found.history:
        errors = _picked(one, "acceleration", "displacement", "delay")
        by_axis = {
            name: {axis: v for axis, v in zip(AXES, values, strict=True) if not math.isnan(v)}
            for name, values in errors.items()
        }
        history.append(_picked(one, "number") | by_axis | _picked(one, "peak_spool", "clipped"))
    return {"iterations": history, "best": found.best, "stopped": found.reason}


def sine_entries(found: "SineTest") -> Entries:
    """Amplitude, phase and distortion without and with the cancellers."""
    names = ("amplitude_error", "phase_error", "distortion", "distortion_all", "distortion_displacement", "peak_spool")

    results = {"alone": found.before, "with_cancellers": found.after}
    both = {when: {**_picked(one, *names), "clipped": one.run.clipped} for when, one in results.items()}
    highest = {"cancelled_up_to_hz": found.cancelled * found.frequency}
    return _picked(found, "axis", "amplitude", "frequency") | highest | both


def agreement_entries(found: "Decomposed", agreement: "WrenchAgreement") -> Entries:
    """Modelled against measured forces, and the residual with its expected levels, by axis."""
    matches = _picked(agreement, "actuators", "struts", "dissipative")
    residual: dict[str, Sequence[Any] | Array] = {
        "mean": agreement.residual.offset,
        "sd": agreement.residual.varying,
        "noise_sd": agreement.noise,
        "sensors_sd": agreement.sensors.varying,
        "parameters_sd": agreement.parameters.varying,
        "sd_explained_by": agreement.varying_explained,
        "mean_explained_by": agreement.offset_explained,
    }
    axes = {}
    for k in found.plant.axes:
        forces = {
            name: None
            if one is None
            else {
                "rrmse": one.rrmse[k],
                "rrmse_mean_off": one.rrmse_varying[k],
                "rms_difference": one.difference[k],
                "at_rest": bool(one.at_rest[k]),
            }
            for name, one in matches.items()
        }
        own = {name: values[k] for name, values in residual.items()}
        delay = {"delay": agreement.actuators.delay[k], "delay_standard_error": agreement.actuators.delay_error[k]}
        axes[AXES[k]] = forces | delay | {"residual": own}
    skews = {group: _picked(delay, "delay", "standard_error") for group, delay in found.delays.items()}
    interface = None if agreement.interface is None else _interface_entries(agreement.interface)
    return {"compared_up_to_hz": found.comparison.band.high, "skews": skews, "axes": axes, "interface": interface}


def _interface_entries(found: "InterfaceWrench") -> Entries:
    """Peaks of a specimen's wrench on the platen at the interface, with half of their intervals."""
    sources = _picked(found, "noise", "sensors", "parameters")
    rms = {
        name: np.sqrt(np.mean(np.square(np.broadcast_to(x, found.wrench.shape)), axis=0)) for name, x in sources.items()
    }
    return {
        "place_from_c": found.place,
        "confidence": found.confidence,
        "parameters_calibrated": found.calibrated,
        "parameters_stated": found.stated,
        "components": {
            peak.component: {
                "peak": peak.value,
                "time": peak.time,
                "half_width": peak.half_width,
                "mounted_model": None if found.predicted is None else peak.predicted,
                **{f"{name}_sd": values[j] for name, values in rms.items()},
            }
            for j, peak in enumerate(found.peaks)
        },
    }


def _friction_entries(found: "Calibration") -> Entries | None:
    """Forms of friction with their errors on held-out tests."""
    if found.friction is None:
        return None
    forms = {
        form.name: {
            "title": form.title,
            "held_out": {
                test: {"r2": r2, "error": error}
                for test, r2, error in zip(found.friction.tests, form.explained, form.error, strict=True)
            },
        }
        for form in found.friction.forms
    }
    return {"preferred": found.friction.best.name, "suffices": found.friction.suffices, "forms": forms}


def calibration_entries(found: "Calibration") -> Entries:
    """Parameters with intervals and verdicts, sensor errors, misfits of every test."""
    from ..identification.calibration.result import verdict_on
    from ..identification.calibration.scale import scale_summary
    from ..identification.residuals import RESIDUALS

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
        **_picked(found, "campaign", "converged", "rounds"),
        "skipped": dict(found.skipped),
        "delays_removed": {late.group: late._asdict() for late in found.delays},
        "scale": None
        if found.scale is None
        else {"fixed_by": found.scale.name, "why": scale_summary(found.scale), "ratios": found.ratios()},
        "parameters": parameters,
        "sensors": sensors,
        "misfit": misfits,
        "alike": [{"pair": [a, b], "correlation": c} for a, b, c in found.correlated_pairs()],
        "subsets": _subset_entries(found),
        "friction": _friction_entries(found),
    }


def _subset_entries(found: "Calibration") -> Entries:
    """Numbers of subset estimates compared, and those that differ from the joint estimate."""
    from ..identification.calibration.calibration_summary import chance, compared
    from ..identification.calibration.result import contradictions

    each = []
    for one in contradictions(found):
        alone, joint, unit = one.values(found)
        entry = {"unknown": found.names[one.unknown], "subset": one.subset, "alone": alone, "joint": joint}
        each.append({**entry, "unit": unit, "deviations": one.deviations})
    return {
        "compared": compared(found) | compared(found, part=False),
        "limit": found.limit,
        "simulation_limit": found.numbers.number("simulation.deviations"),
        "expected_by_chance": chance(found),
        "contradictions": each,
    }

"""Tables for a terminal: machine, capacity, motions, findings, runs; and their rows for reports."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from rich.markup import escape
from rich.table import Column, Table

from ..core.console import make_console
from ..machine.machine import Machine

if TYPE_CHECKING:
    import xarray as xr

    from ..data.consistency import ConsistencyFinding
    from ..data.layout_faults import RecordFinding
    from ..effects.effect import Effect
    from ..mechanics.plant import Plant
    from ..simulation.simulate import Run
    from .report.run_report import RunSummary

__all__ = [
    "Compared",
    "compare",
    "machine_rows",
    "print_capacity",
    "print_comparison",
    "print_findings",
    "print_machine",
    "print_modes",
    "print_motions",
    "print_run",
    "print_sensor_findings",
    "report_limits",
]


def _text(value: float | tuple[float, ...]) -> str:
    return ", ".join(f"{v:.6g}" for v in value) if isinstance(value, tuple) else f"{value:.6g}"


def machine_rows(machine: Machine) -> list[tuple[str, str, str, str, bool]]:
    """Rows (path, value, unit, source, assumed) of every quantity of a machine."""
    return [
        (path, _text(q.value), q.unit, f"{q.evidence}: {q.source}", q.assumed)
        for path, q in machine.parameters.quantities.items()
    ]


def report_limits(plant: "Plant") -> dict[str, Any]:
    """Limits for a run report: Table 2.2, strokes, velocities and forces of actuators, supply, strut areas."""
    from ..mechanics.capacity import actuator_speeds

    machine = plant.machine
    area_a, area_b = plant.actuators.area_a, plant.actuators.area_b
    speeds = actuator_speeds(plant)
    return {
        "displacement": machine.limits.displacement,
        "velocity": machine.limits.velocity,
        "acceleration": machine.limits.acceleration,
        "actuator_stroke": [a.stroke for a in machine.actuators],
        "actuator_force": plant.supply.pressure * area_a - plant.supply.return_pressure * area_b,
        "actuator_pull": np.maximum(0.0, plant.supply.pressure * area_b - plant.supply.return_pressure * area_a),
        "actuator_extending": speeds[:, 0],
        "actuator_retracting": speeds[:, 1],
        "supply_pressure": plant.supply.pressure,
        "strut_area": [s.area for s in machine.struts],
    }


def print_machine(machine: Machine) -> None:
    """Print every quantity with unit, evidence and source; assumed ones are marked."""
    console = make_console()
    console.print(f"[bold]{escape(machine.name)}[/]: {escape(machine.title)}")
    console.print(
        f"{len(machine.actuators)} actuators ({', '.join(machine.actuator_names)}), {len(machine.struts)} struts, "
        f"platen motion {machine.motion}, bearing thrust {machine.thrust}"
    )
    table = Table(
        Column("quantity", no_wrap=True), "value", "unit", "sd (ours)", Column("evidence", no_wrap=True), "source"
    )
    for path, q in machine.parameters.quantities.items():
        evidence = f"[bold yellow]{escape(q.evidence)} *[/]" if q.assumed else escape(q.evidence)
        sd = "" if q.sd is None else _text(tuple(dict.fromkeys(q.sd)) if isinstance(q.sd, tuple) else q.sd)
        table.add_row(escape(path), _text(q.value), escape(q.unit), sd, evidence, escape(q.source))
    console.print(table)
    console.print("* assumed: not published; replace it with --override")
    console.print(_effects_table("Force effects, in ledger order", machine.effects))
    if machine.modifiers:
        console.print(_effects_table("Modifiers of oil, valves, supply or inertia", machine.modifiers))
    if "estimates.platen_alone.mass" in machine.parameters:
        console.print(_inertia_table(machine))


def _effects_table(title: str, effects: "Sequence[Effect]") -> Table:
    table = Table("effect", "law", "acts on", "source", title=title)
    for effect in effects:
        table.add_row(*map(escape, (effect.name, effect.law, " ".join(effect.ports), effect.source)))
    return table


def _inertia_table(machine: Machine) -> Table:
    """Table 4.1: lumped masses composed at the connection points, beside the printed contributions."""
    from ..mechanics.rigid_body import lumped_inertia

    par = machine.parameters
    parts = lumped_inertia(
        par.vector("estimates.platen_alone.mass"), par.vector("estimates.platen_alone.inertia"), machine
    )
    table = Table("part", *(escape(f"{q} {a} [{u}]") for q, u in (("mass", "t"), ("inertia", "t m2")) for a in "XYZ"))
    table.title = "Effective inertia about B, composed from the parts (printed in Table 4.1)"
    printed = {"platen": "platen_alone", **{k: k for k in parts if k != "platen"}}
    for kind, matrix in (*parts.items(), ("sum, M_eff,1", sum(parts.values()))):
        name = f"estimates.{printed.get(kind, 'first')}"
        values = (*par.vector(f"{name}.mass"), *par.vector(f"{name}.inertia"))
        computed = np.diag(matrix)
        table.add_row(kind, *(f"{c / 1e3:.2f} ({v / 1e3:.2f})" for c, v in zip(computed, values, strict=True)))
    return table


def print_capacity(machine: Machine) -> None:
    """Print the capacity of the model and Table 2.2, with deviations."""
    from ..mechanics.capacity import capacity_table

    table = Table("capacity", "model", "Table 2.2", "unit", "deviation", "how", title="Capacity, all servovalves open")
    for line in capacity_table(machine):
        deviation = f"{100 * line.deviation:+.1f} %"
        table.add_row(line.name, f"{line.model:.4g}", f"{line.printed:.4g}", line.unit, deviation, line.how)
    make_console().print(table)


def print_modes(machine: Machine) -> None:
    """Print the oil-column modes of the linearised plant, without and with friction and leakage."""
    from ..mechanics.linearize import oil_column_modes

    table = Table(
        "axis", "undamped [Hz]", "with sticking friction and leakage [Hz]", "damping [%]", title="Oil-column modes"
    )
    full = {m.axis: m for m in oil_column_modes(machine, undamped=False)}
    for mode in oil_column_modes(machine):
        other = full.get(mode.axis)
        cells = (f"{other.frequency:.2f}", f"{100 * other.damping:.2f}") if other else ("", "")
        table.add_row(mode.axis, f"{mode.frequency:.2f}", *cells)
    make_console().print(table)


def print_motions(name: str | None = None) -> None:
    """Print all motions by name with what they require; with a name, the options of that one."""
    from ..motions import list_motions, motion_entry, motion_options

    console = make_console()
    if name is None:
        table = Table(Column("name", no_wrap=True), "kind", "description", Column("requires", no_wrap=True))
        for m in list_motions():
            needs = [escape(m.remedy) or "[green]ready[/]"]
            needs += [f"or your file: {m.wanted.record}"] if m.wanted and m.kind != "file" else []
            table.add_row(" ".join((m.name, *m.aliases)), m.kind, m.title, "\n".join(needs))
        console.print(table)
        console.print("lhpost6 motions NAME prints the options of one")
        return
    found = motion_entry(name)
    console.print(f"[bold]{found.name}[/]: {found.title}")
    chosen = motion_options(found.name)
    table = Table("option", "default", "unit", "source", title="Options, each as --set key=value")
    for option in chosen:
        table.add_row(*map(escape, option))
    console.print(table if chosen else "options: none")
    if found.request or found.remedy:
        console.print(found.request or f"not installed: {found.remedy}", markup=False, soft_wrap=True)


def print_findings(file: str, findings: "Sequence[RecordFinding]") -> None:
    """Print the findings on a record."""
    table = Table("", "channel", "sample", "finding", "remedy", title=escape(file))
    colour = {"error": "[bold red]error[/]", "warning": "[yellow]warning[/]", "info": "info"}
    for f in findings:
        sample = "" if f.sample is None else str(f.sample)
        table.add_row(colour[f.severity], escape(f.channel), sample, escape(f.message), escape(f.remedy))
    console = make_console()
    console.print(table)
    counts = {s: sum(f.severity == s for f in findings) for s in ("error", "warning")}
    console.print(f"{counts['error']} errors, {counts['warning']} warnings")


def print_sensor_findings(findings: "Sequence[ConsistencyFinding]") -> None:
    """Print the suspicious comparisons of redundant sensors, and the counts."""
    suspicious = [f for f in findings if f.verdict == "suspicious"]
    untested = sum(f.verdict == "untested" for f in findings)
    console = make_console()
    if suspicious:
        names = ("comparison", "channel", "quantity", "unit", "estimate", "expected", "within", "deviations")
        table = Table(*names, title="Sensors that disagree")
        for f in sorted(suspicious, key=lambda one: -abs(one.significance)):
            numbers = f"{f.estimate:.5g}", f"{f.expected:.5g}", f"{f.tolerance:.2g}", f"{f.significance:+.1f}"
            table.add_row(f.check, escape(f.channel), f.named, f.unit, *numbers)
        console.print(table)
        console.print("A sensor is wrong, or the law or geometry of the comparison is incomplete.")
    console.print(f"redundant sensors: {len(findings)} comparisons, {len(suspicious)} suspicious, {untested} untested")


_COMPARED = ("platen_displacement", "chamber_pressure_a", "chamber_pressure_b", "actuator_force")
_SILENT = 1e-6
"""Fraction of the largest peak of its kind below which a channel is at rest and has no relative error."""


class Compared(NamedTuple):
    """Difference of a replayed channel from the recorded one, in `unit`."""

    channel: str
    unit: str
    peak_recorded: float
    largest_difference: float
    rrmse: float  # not-a-number for a channel at rest
    drift: float  # of the difference [unit/s]


def compare(measured: "xr.Dataset", simulated: "xr.Dataset") -> list[Compared]:
    """Differences of a replayed test from the recorded one by channel, on common samples; empty below two."""
    from ..data.channels import LAYOUT, channel_unit
    from ..data.signals import drift_rate, rrmse

    t = measured["time"].values - float(measured["time"][0])
    t = t[t <= simulated["time"].values[-1]]
    found: list[Compared] = []
    if len(t) < 2:
        return found
    for name in _COMPARED:
        if name not in measured or name not in simulated:
            continue
        dim = LAYOUT[name].dims[1]
        recorded = measured[name].transpose("time", dim).values[: len(t)]
        model = simulated[name].interp(time=t).transpose("time", dim).values
        ratio, drift = rrmse(recorded, model), drift_rate(model - recorded, float(t[1] - t[0]))
        apart, peak = np.abs(model - recorded).max(axis=0), np.abs(recorded).max(axis=0)
        for k, label in enumerate(measured[dim].values):
            moved = peak[k] > _SILENT * peak.max()
            numbers = peak[k], apart[k], ratio[k] if moved else math.nan, drift[k]
            found.append(Compared(f"{name} {label}", channel_unit(f"{name}[{label}]"), *map(float, numbers)))
    return found


def print_comparison(compared: Sequence[Compared]) -> None:
    """Print the differences of a replayed test from the recorded one."""
    table = Table("channel", "peak recorded", "largest difference", "RRMSE", "drift", title="Model against record")
    for c in compared:
        rrmse = "" if math.isnan(c.rrmse) else f"{c.rrmse:.3g}"
        sizes = f"{c.peak_recorded:.4g} {c.unit}", f"{c.largest_difference:.3g} {c.unit}"
        table.add_row(c.channel, *sizes, rrmse, f"{c.drift:.3g} {c.unit}/s")
    make_console().print(table)


def print_run(run: "Run", summary: "RunSummary | None") -> None:
    """Print the summary of a run, its duration, scheme and rate."""
    console = make_console()
    if summary is not None:
        console.print(f"[bold]{escape(summary.verdict)}[/]")
        delay = escape("delay [ms]")
        table = Table("axis", "quantity", "peak target", "peak achieved", "RRMSE", delay, "RRMSE, delay removed")
        for row in summary.tracking:
            if row.peak_target:
                table.add_row(*map(escape, tracking_cells(row)))
        console.print(table)
        uses = [f"{use.quantity} {100 * use.share:.0f} % ({use.name})" for use in summary.governing]
        if uses:
            console.print(f"demand over capacity, governing limit first: {', '.join(uses)}")
    console.print(
        f"{run.time[-1] + 1 / run.rate:.2f} s of motion, {run.scheme} at {run.steps_per_second} steps a second"
    )


def tracking_cells(row: Any) -> Sequence[str]:
    """Cells of one tracked axis and quantity."""
    return (
        row.axis,
        f"{row.quantity} [{_unit(row)}]",
        f"{row.peak_target:.4g}",
        f"{row.peak_achieved:.4g}",
        f"{row.rrmse:.3f}",
        f"{1e3 * row.delay:.1f}",
        f"{row.rrmse_aligned:.3f}",
    )


def _unit(row: Any) -> str:
    """SI unit of a tracked quantity of an axis."""
    per = {"displacement": "", "velocity": "/s", "acceleration": "/s2"}[row.quantity]
    return ("m" if row.axis in "xyz" else "rad") + per

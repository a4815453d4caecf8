"""Tables for a terminal: machine, capacity, motions, findings, runs; and their rows for reports."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.text import Text

from ..machine.machine import Machine
from .report.page import Table
from .terminal import print_blocks

if TYPE_CHECKING:
    from ..data.consistency import ConsistencyFinding
    from ..data.layout_faults import RecordFinding
    from ..data.replay_comparison import Compared
    from ..effects.effect import Effect
    from ..simulation.simulate import Run
    from .report.run_report import RunSummary

__all__ = [
    "machine_rows",
    "print_comparison",
    "print_findings",
    "print_machine",
    "print_modes",
    "print_motions",
    "print_run",
    "print_sensor_findings",
    "print_summary",
]


def _text(value: float | tuple[float, ...]) -> str:
    return ", ".join(f"{v:.6g}" for v in value) if isinstance(value, tuple) else f"{value:.6g}"


def machine_rows(machine: Machine) -> list[tuple[str, str, str, str, bool]]:
    """Rows (path, value, unit, source, assumed) of every quantity of a machine."""
    return [
        (path, _text(q.value), q.unit, f"{q.evidence}: {q.source}", q.assumed)
        for path, q in machine.parameters.quantities.items()
    ]


def print_machine(machine: Machine) -> None:
    """Print every quantity with unit, evidence and source; assumed ones are marked."""
    rows = []
    for path, q in machine.parameters.quantities.items():
        evidence = Text(f"{q.evidence} *", style="bold yellow") if q.assumed else q.evidence
        sd = "" if q.sd is None else _text(tuple(dict.fromkeys(q.sd)) if isinstance(q.sd, tuple) else q.sd)
        rows.append((path, _text(q.value), q.unit, sd, evidence, q.source))
    modifiers = _effects_table("Modifiers of oil, valves, supply or inertia", machine.modifiers)
    print_blocks(
        f"{machine.name}: {machine.title}",
        f"{len(machine.actuators)} actuators ({', '.join(machine.actuator_names)}), {len(machine.struts)} struts, "
        f"platen motion {machine.motion}, bearing thrust {machine.thrust}, moving parts {machine.bodies}",
        Table("", ("quantity", "value", "unit", "sd (ours)", "evidence", "source"), rows),
        "* assumed: not published; replace it with --override",
        _effects_table("Force effects, in ledger order", machine.effects),
        *([modifiers] if machine.modifiers else []),
        *([_inertia_table(machine)] if "estimates.platen_alone.mass" in machine.parameters else []),
    )


def _effects_table(title: str, effects: "Sequence[Effect]") -> Table:
    rows = [(effect.name, effect.law, " ".join(effect.ports), effect.source) for effect in effects]
    return Table(title, ("effect", "law", "acts on", "source"), rows)


def _inertia_table(machine: Machine) -> Table:
    """Table 4.1: lumped masses composed at the connection points, beside the printed contributions."""
    from ..mechanics.rigid_body import lumped_inertia

    par = machine.parameters
    mass, inertia = (par.vector(f"estimates.platen_alone.{what}") for what in ("mass", "inertia"))
    parts = lumped_inertia(mass, inertia, machine)
    printed = {"platen": "platen_alone", **{k: k for k in parts if k != "platen"}}
    rows = []
    for kind, matrix in (*parts.items(), ("sum, M_eff,1", sum(parts.values()))):
        name = f"estimates.{printed.get(kind, 'first')}"
        values = (*par.vector(f"{name}.mass"), *par.vector(f"{name}.inertia"))
        pairs = zip(np.diag(matrix), values, strict=True)
        rows.append((kind, *(f"{computed / 1e3:.2f} ({value / 1e3:.2f})" for computed, value in pairs)))
    header = (
        "part",
        *(f"{what} {axis} [{unit}]" for what, unit in (("mass", "t"), ("inertia", "t m2")) for axis in "XYZ"),
    )
    return Table("Effective inertia about B, composed from the parts (printed in Table 4.1)", header, rows)


def print_modes(machine: Machine) -> None:
    """Print the oil-column modes of the linearised plant, without and with friction and leakage.

    Of a table with a specimen those of the bare one, and those with the specimen as one rigid body.
    """
    if machine.specimen is None:
        print_blocks(_modes(machine, "Oil-column modes", loaded=False))
        return
    rigid = f"Oil-column modes with {machine.specimen.name} as one rigid body"
    bare = "Oil-column modes of the bare table"
    print_blocks(_modes(machine, rigid, loaded=True), _modes(machine, bare, loaded=False))


def _modes(machine: Machine, title: str, *, loaded: bool) -> Table:
    from ..mechanics.linearize import oil_column_modes

    damped, free = (oil_column_modes(machine, undamped=u, loaded=loaded) for u in (False, True))
    full = {m.axis: (f"{m.frequency:.2f}", f"{100 * m.damping:.2f}") for m in damped}
    rows = [(m.axis, f"{m.frequency:.2f}", *full.get(m.axis, ("", ""))) for m in free]
    return Table(title, ("axis", "undamped [Hz]", "with sticking friction and leakage [Hz]", "damping [%]"), rows)


def print_motions(name: str | None = None) -> None:
    """Print all motions by name with what they require; with a name, the options of that one."""
    from ..motions import list_motions, motion_entry, motion_options

    if name is None:
        rows = []
        for m in list_motions():
            needs: list[str | Text] = [m.remedy or Text("ready", style="green")]
            needs += [f"or your file: {m.wanted.record}"] if m.wanted and m.kind != "file" else []
            rows.append((" ".join((m.name, *m.aliases)), m.kind, m.title, Text("\n").join(map(Text.assemble, needs))))
        motions = Table("", ("name", "kind", "description", "requires"), rows)
        print_blocks(motions, "lhpost6 motions NAME prints the options of one")
        return
    found = motion_entry(name)
    options = Table(
        "Options, each as --set key=value, in the unit shown or followed by its own (50mm)",
        ("option", "default", "unit", "source"),
        motion_options(found.name),
    )
    remedy = found.request or (f"not installed: {found.remedy}" if found.remedy else "")
    print_blocks(f"{found.name}: {found.title}", options if options.rows else "options: none", remedy)


def print_findings(file: str, findings: "Sequence[RecordFinding]") -> None:
    """Print the findings on a record."""
    styles = {"error": "bold red", "warning": "yellow", "info": ""}
    rows = [
        (
            Text(f.severity, style=styles[f.severity]),
            f.channel,
            "" if f.sample is None else f.sample,
            f.message,
            f.remedy,
        )
        for f in findings
    ]
    counts = {s: sum(f.severity == s for f in findings) for s in ("error", "warning")}
    print_blocks(
        Table(file, ("", "channel", "sample", "finding", "remedy"), rows),
        ", ".join(f"{counts[kind]} {kind}{'s' * (counts[kind] != 1)}" for kind in ("error", "warning")),
    )


def print_sensor_findings(findings: "Sequence[ConsistencyFinding]") -> None:
    """Print the suspicious comparisons of redundant sensors, and the counts."""
    suspicious = sorted((f for f in findings if f.verdict == "suspicious"), key=lambda one: -abs(one.significance))
    untested = sum(f.verdict == "untested" for f in findings)
    if suspicious:
        rows = [
            (
                *(f.check, f.channel, f.named, f.unit),
                *(f"{f.estimate:.5g}", f"{f.expected:.5g}", f"{f.tolerance:.2g}", f"{f.significance:+.1f}"),
            )
            for f in suspicious
        ]
        header = ("comparison", "channel", "quantity", "unit", "estimate", "expected", "within", "deviations")
        reason = "A sensor is wrong, or the law or geometry of the comparison is incomplete."
        print_blocks(Table("Sensors that disagree", header, rows), reason)
    counts = f"{len(findings)} comparisons, {len(suspicious)} suspicious, {untested} untested"
    print_blocks(f"redundant sensors: {counts}")


def print_comparison(compared: "Sequence[Compared]") -> None:
    """Print the differences of a replayed test from the recorded one."""
    from .report.open_loop_report import comparison_table

    print_blocks(comparison_table(compared))


def print_summary(summary: "RunSummary") -> None:
    """Print verdict, metrics and limits of a run's report."""
    from .report.run_limits import limit_table
    from .report.run_report import lead_summary, metrics_table

    moved = [row for row in summary.tracking if row.peak_target]
    tables = metrics_table(moved, summary.limits), limit_table(summary.limits)
    print_blocks(Text(summary.verdict, style="bold"), *(table for table in tables if table.rows))
    print_blocks(lead_summary(moved))


def print_run(run: "Run", summary: "RunSummary | None") -> None:
    """Print the summary of a run, its duration, scheme and rate; of one that diverged no numbers."""
    if summary is not None and run.diverged:
        print_blocks(Text(summary.verdict, style="bold"))
    elif summary is not None:
        print_summary(summary)
    seconds = run.time[-1] + 1 / run.rate
    print_blocks(f"{seconds:.2f} s of motion, {run.scheme} at {run.steps_per_second} steps a second")
    if run.coupling is not None:
        print_blocks(run.coupling.summary)

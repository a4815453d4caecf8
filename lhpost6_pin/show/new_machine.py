"""A drafted machine as its file, in the terminal and as JSON: what is known, what is assumed, what it can do."""

from collections import Counter
from pathlib import Path
from typing import Any

from ..core.names import AXES
from ..machine.machine import Machine
from ..machine.machine_toml import machine_toml
from ..mechanics.linearize import oil_column_modes
from .tables import print_modes
from .terminal import Table, print_blocks

__all__ = ["draft_entries", "draft_text", "print_draft"]

_HEAD = """# {title}
# Written by `lhpost6 new-machine`. SI throughout. Of each number: value, unit, evidence, source and, where tests can
# narrow it, sd, one standard deviation.
#
# evidence  measured (stated to the command), derived (follows from stated and typical numbers), assumed (of a typical
#           size for such a machine: replace it by what you know), standard, numerical (a device of the solution)
#
# Frame: origin C at the centre of the platen's top face in the control zero-position, X along, Y across, Z up.

"""


def draft_text(machine: Machine) -> str:
    """The machine's file with a head that explains it."""
    return _HEAD.format(title=machine.title) + machine_toml(machine)


def draft_entries(machine: Machine) -> dict[str, Any]:
    """Numbers by evidence, the limits and the oil columns."""
    axes = [AXES[k] for k in machine.axes]
    limits = {
        quantity: dict(zip(axes, (getattr(machine.limits, quantity)[k] for k in machine.axes), strict=True))
        for quantity in ("displacement", "velocity", "acceleration")
    }
    evidence: dict[str, list[str]] = {}
    for path, quantity in machine.parameters.items():
        evidence.setdefault(quantity.evidence, []).append(path)
    modes = [{"axis": m.axis, "frequency": m.frequency} for m in oil_column_modes(machine)]
    return {"machine": machine.name, "motion": machine.motion, "limits": limits, "modes": modes, "evidence": evidence}


def print_draft(machine: Machine, path: Path) -> None:
    """Print how much is known, the limits that follow, the oil columns, and what to do next."""
    counted = Counter(q.evidence for q in machine.parameters.values())
    known = ", ".join(f"{count} {evidence}" for evidence, count in counted.items())
    limits = machine.limits
    rows = []
    for k in machine.axes:
        unit = "m" if k < 3 else "rad"
        units = zip(
            (limits.displacement, limits.velocity, limits.acceleration), (unit, f"{unit}/s", f"{unit}/s2"), strict=True
        )
        rows.append((AXES[k], *(f"{values[k]:.3g} {per}" for values, per in units)))
    print_blocks(
        f"{machine.name}: {machine.title}",
        f"numbers: {known}; the assumed ones are marked in `lhpost6 info --machine {path}`",
        Table("Limits that follow", ("axis", "displacement", "velocity", "acceleration"), rows),
        f"velocity: {machine.parameters['limits.velocity'].source}",
    )
    print_modes(machine)
    print_blocks(f"tune its controller: lhpost6 tune --machine {path}")

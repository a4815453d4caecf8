"""Tables of a machine's capacity, for a terminal, a report and JSON."""

from typing import Any, NamedTuple

import xarray as xr

from ..core.errors import LhpostError
from ..core.names import AXES
from ..machine.machine import Machine
from ..mechanics.capacity import (
    Capacity,
    FlowReading,
    capacity_table,
    flow_readings,
    has_printed_capacity,
    payload_table,
)
from ..mechanics.payload import with_payload
from ..mechanics.performance import table_performance
from ..mechanics.plant import Plant, make_plant
from ..motions import Peak
from ..simulation.motion_limits import judge_record
from .report.page import Table
from .report.performance_plots import Load, performance_table
from .report.scales import SCALES, Scale

__all__ = ["MachineCapacity", "capacity_entries", "capacity_tables", "judged", "judged_by", "machine_capacity"]
__all__ += ["performance_loads"]


SHOWN = {"m/s2": SCALES["acceleration"], "rad": SCALES["rotation"], "N": SCALES["force"]}
SHOWN |= {"rad/s": SCALES["rotation velocity"], "rad/s2": SCALES["rotation acceleration"]}


_TURNS = (
    " The two differ in roll, pitch and yaw: “peak acceleration” turns the platen about B, its centre of gravity, the "
    "limits of sinusoidal motion about C, the point that motions command, so that B accelerates sideways, too."
)


class MachineCapacity(NamedTuple):
    """Capacity of a machine with what is mounted."""

    machine: Machine
    rows: tuple[Capacity, ...]
    payload: tuple[Capacity, ...]  # with the payload of Table 2.2
    readings: tuple[FlowReading, ...]
    loads: tuple[Load, ...]  # bare, and with the specimen or the payload of Table 2.2
    valves: int = 0  # servovalves of an actuator asked for; 0: as in the file, and all beside Table 2.2


def machine_capacity(machine: Machine, valves: int = 0) -> MachineCapacity:
    """Capacity of a machine, with a number of `valves` open or as in its file.

    Raises SimulationError if it cannot hold its specimen at rest.
    """
    machine = machine.with_valves(valves)
    bare = machine.specimen is None
    payload = payload_table(machine) if bare else ()
    readings = flow_readings(machine) if bare else ()
    rows, loads = capacity_table(machine, valves), performance_loads(machine)
    return MachineCapacity(machine, rows, payload, readings, loads, valves)


def judged(plant: Plant, record: xr.Dataset) -> tuple[tuple[Peak, ...], str]:
    """Demands of a record's motion on all limits, and a sentence on the scale at which its target would fit."""
    try:
        found = judge_record(plant, record)
    except LhpostError as error:
        return (), f"{error}."
    if found is None:
        return (), ""
    if found.fits is None:
        return found.peaks, ""
    if found.fits == 0.0:
        return found.peaks, "No scale of this target is within all limits: what is mounted exceeds one at rest."
    return found.peaks, (
        f"The largest scale of this target within all limits, less their reserves, is {found.fits:g}; it was run at "
        f"{float(record.attrs['scale']):g}. What the achieved motion demands of each is in “Demand over capacity”."
    )


def performance_loads(machine: Machine, *, payload: bool = True) -> tuple[Load, ...]:
    """Performance of the bare table, and with its specimen or, bare, with the payload that Table 2.2 states."""
    plant, band, valves = make_plant(machine), machine.limits.bandwidth, _open_valves(machine)
    if machine.specimen is not None:
        bare = table_performance(make_plant(machine.without_specimen()))
        loaded = Load(machine.specimen.name, table_performance(plant), band, valves)
        return Load("bare table", bare, band, valves), loaded
    loads = [Load("bare table", table_performance(plant), band, valves)]
    if payload and "table_2_2_payload.weight" in machine.parameters:
        weight = machine.parameters.number("table_2_2_payload.weight")
        performance = table_performance(with_payload(plant, weight))
        loads.append(Load(f"payload of {weight / 1e6:g} MN", performance, band, valves))
    return tuple(loads)


def capacity_tables(found: MachineCapacity) -> list[Table]:
    """All tables of a capacity."""
    machine = found.machine
    load = "bare table" if machine.specimen is None else f"with {machine.specimen.name}"
    stated = "Table 2.2" if has_printed_capacity(machine) else "stated"
    everything = has_printed_capacity(machine) and not found.valves
    valves = "all servovalves open" if everything else _open_valves(machine)
    header = ("capacity", "model", stated, "unit", "deviation", "how")
    tables = [Table(f"Capacity, {load}, {valves}", header, [_row(line) for line in found.rows])]
    if found.payload:
        weight = machine.parameters.number("table_2_2_payload.weight")
        title = f"Capacity with a centred rigid payload of {weight / 1e6:g} MN, all servovalves open"
        tables.append(Table(title, header, [_row(line) for line in found.payload]))
    if found.readings:
        rows = [
            (
                r.name,
                *(_shown(v, _scale(r.name)) for v in (r.printed_equation, r.full_stroke, r.stated)),
                _scale(r.name).unit,
                r.source,
            )
            for r in found.readings
        ]
        title = f"Readings of Eq. 4-2 (machine.flow_reading, here {machine.flow_reading}), all servovalves open"
        header = ("velocity", "printed", "full_stroke", "stated", "unit", "source")
        tables.append(Table(title, header, rows))
    return [*tables, performance_table(found.loads)]


def _open_valves(machine: Machine) -> str:
    """How many servovalves are open, in words; those of the double-acting actuators, of which it can be chosen."""
    counts = {a.kind: a.valves for a in machine.actuators if a.area_b is not None}
    words = (f"{n} servovalve{'s' * (n > 1)} open on each {kind} actuator" for kind, n in counts.items())
    return ", ".join(words) or "servovalves as in its file"


def judged_by(found: MachineCapacity) -> str:
    """What accelerations a motion is judged by, and how those that the actuators alone give belong to them."""
    load = found.loads[0 if found.machine.specimen is None else -1]
    bounds = [(one.axis, one.bound("acceleration")) for one in load.axes if one.axis in AXES[:3]]
    rows = ", ".join(f"“peak acceleration {axis.upper()}”" for axis, _ in bounds)
    stated = found.machine.parameters["limits.acceleration"].source
    source = f" The stated limit is limits.acceleration of the machine file ({stated})."
    words = [f"{axis} {b.value:.3g} m/s² ({_shown(b.value, SHOWN['m/s2'])} g, {b.by})" for axis, b in bounds]
    return (
        f"{rows}: what the forces of the actuators alone give. A motion is judged by the least of the limits of "
        f"sinusoidal motion; {load.name}: {', '.join(words)}."
        + source * any("stated" in b.by for _, b in bounds)
        + _TURNS * (found.machine.motion == "free")
    )


def _row(line: Capacity) -> tuple[str, ...]:
    """A row with accelerations in g and angles in degrees, as Table 2.2."""
    shown = SHOWN.get(line.unit, Scale(1.0, line.unit))
    deviation = "–" if line.deviation is None else f"{100 * line.deviation:+.1f} %"
    model, printed = (_shown(value, shown) for value in (line.model, line.printed))
    return line.name, model, printed, shown.unit, deviation, line.how


def _shown(value: float | None, scale: Scale) -> str:
    return "–" if value is None else f"{value * scale.factor:.3g}"


def _scale(name: str) -> Scale:
    return SHOWN["rad/s"] if name.endswith(("roll", "pitch", "yaw")) else SCALES["velocity"]


def capacity_entries(found: MachineCapacity) -> dict[str, Any]:
    """Capacity, payload, readings of the valve equation and governing limits as plain data."""

    def lines(rows: tuple[Capacity, ...]) -> list[dict[str, Any]]:
        return [{**line._asdict(), "deviation": line.deviation} for line in rows]

    performance = {
        load.name: {
            one.axis: {q: [b._asdict() for b in getattr(one, q)] for q in ("displacement", "velocity", "acceleration")}
            for one in load.axes
        }
        for load in found.loads
    }
    return {
        "judged_by": judged_by(found),
        "capacity": lines(found.rows),
        "payload": lines(found.payload),
        "flow_readings": [reading._asdict() for reading in found.readings],
        "limits": performance,
    }

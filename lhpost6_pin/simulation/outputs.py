"""The record of a run, in the layout of measured tests."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.arrays import Array
from ..core.names import AXES
from ..data.accelerometers import accelerometer_channel, accelerometer_signals
from ..data.alignment import oil_force
from ..data.channels import LAYOUT
from ..data.records import make_record
from ..effects.actuator import rod_travels
from ..effects.supply import drawn_flows
from ..machine.power_supply import power_supply_facts
from ..machine.recorded_changes import change_facts
from ..machine.recorded_specimen import specimen_facts
from ..machine.structure import BODIES
from ..mechanics.accelerometers import accelerometer_rows
from ..mechanics.gas_pressure import gas_ratio, strut_pressures
from ..mechanics.interface_wrench import INTERFACE_AXES, interface_lever
from ..mechanics.pose import PlatenMotion, leg_displacements, platen_motion
from ..mechanics.specimen_joints import specimen_joints, specimen_positions
from ..motions import TargetSpectrum
from .simulate import Run
from .specimen_response import interface_wrench, point_response

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["record_of_run", "reference_channels", "required_channel"]

_OF_POINTS = {
    "displacement": ("m", "displacement of the specimen's points relative to its base"),
    "velocity": ("m/s", "velocity of the specimen's points relative to its base"),
    "acceleration": ("m/s2", "absolute acceleration of the specimen's points"),
}
"""Channels of a specimen's points: unit of translations, and name."""


def record_of_run(run: Run, attrs: Mapping[str, Any], reference: PlatenMotion | None = None) -> "xr.Dataset":
    """Record of a simulated test.

    attrs: further global attributes (`test`, `title`, ...). reference: target at the run's samples, if any; its
    velocity and acceleration are extra variables, as are hidden states, the joints of an articulated specimen and the
    points of a modal one; and the wrench of a specimen on the platen.
    """
    plant, machine = run.plant, run.plant.machine
    motion = platen_motion(plant, run.q, run.v, run.a)
    legs, _ = leg_displacements(plant, motion.displacement)
    rows = plant.rows[plant.tables.actuators]
    states = rows["state"]
    ahead = np.zeros((len(run.z), plant.spools))
    rod_travels(rows, run.z, ahead)  # displacement is measured between barrel and rod
    double = np.array([name in machine.double_acting for name in machine.actuator_names])
    pressure_a, pressure_b = run.z[:, states], run.z[:, states[double] + 1]
    channels: dict[str, Any] = {
        "platen_displacement": motion.displacement,
        "platen_velocity": motion.velocity,
        "platen_acceleration": motion.acceleration,
        "actuator_displacement": legs[:, : plant.spools] + ahead,
        "actuator_force": oil_force(machine, pressure_a, pressure_b),
        "chamber_pressure_a": pressure_a,
        "spool_position": run.spool,
        "supply_pressure": plant.supply.pressure - _supply_droop(run),
    }
    labels = machine.labels
    if double.any():
        channels["chamber_pressure_b"] = pressure_b
    if machine.struts:
        channels["strut_pressure"] = strut_pressures(machine, legs[:, plant.spools :]) * gas_ratio(plant, run.z)
    if run.command is not None:
        channels["spool_command"] = run.command
    if reference is not None:
        channels |= reference_channels(reference)
    channels |= {name: channels[c.same_as] for name, c in LAYOUT.items() if c.same_as in channels}
    channels |= {"supply_flow": _supply_flow(run)} | _hidden_states(run)
    if machine.accelerometers:
        at = accelerometer_rows(machine.accelerometers)
        channels["point_acceleration"] = accelerometer_channel(at, accelerometer_signals(plant, motion, at))
    if response := point_response(run):
        points = machine.specimen.contents.points if machine.specimen and machine.specimen.contents else ()
        labels["specimen_point"] = tuple(point.name for point in points)
        turning = [point.direction.startswith("r") for point in points]
        for name, (unit, long_name) in _OF_POINTS.items():
            units = ", ".join(unit.replace("m", "rad") if turns else unit for turns in turning)
            about = {"units": unit if not any(turning) else units, "long_name": long_name, "column_units": units}
            channels[f"specimen_{name}"] = (("time", "specimen_point"), response[name], about)
    if plant.articulated:
        joints = specimen_joints(plant)
        about = {"units": "m or rad", "long_name": "position of the specimen's joints"}
        about["column_units"] = ", ".join(joint.unit for joint in joints)
        labels["specimen_joint"] = tuple(joint.name for joint in joints)
        channels["specimen_joint_position"] = (("time", "specimen_joint"), specimen_positions(plant, run.q), about)
    if machine.specimen is not None:
        about = {"units": "N, N m", "long_name": "wrench of the specimen on the platen at the interface, platen axes"}
        at = np.round(interface_lever(plant) - plant.body[0]["rho_c"], 12)
        about["column_units"] = ", ".join(3 * ["N"] + 3 * ["N m"])
        about["interface"] = f"at {at[0]:g}, {at[1]:g}, {at[2]:g} m from C"
        labels["interface_axis"] = INTERFACE_AXES
        channels["specimen_wrench"] = (("time", "interface_axis"), interface_wrench(run), about)
    valves = [a.valves for a in machine.actuators if a.name in machine.double_acting]
    facts: dict[str, Any] = {
        "kind": "simulated",
        "machine": machine.name,
        **change_facts(machine),
        **specimen_facts(machine.specimen),
        "scheme": run.scheme,
        "steps_per_second": run.steps_per_second,
        "engine": run.engine,
        "spool_values_clipped": run.clipped,
        "trouble": run.trouble or "none",
    }
    if run.coupling is not None:
        facts["interface_energy"] = run.coupling.energy
        facts["interface_energy_error"] = run.coupling.energy_error
        facts["interface_growth"] = run.coupling.stability.growth
    if machine.bodies != BODIES[0]:
        facts["moving_parts"] = f"bodies = {machine.bodies}"
    if valves:
        facts["valves_per_horizontal_actuator"] = int(valves[0])
    return make_record(run.time, channels, labels, {**facts, **attrs})


def reference_channels(reference: PlatenMotion) -> dict[str, Any]:
    """Channels of a target: its displacement, velocity and acceleration."""
    channels: dict[str, Any] = {"reference_displacement": reference.displacement}
    for name, values in (("velocity", reference.velocity), ("acceleration", reference.acceleration)):
        like = LAYOUT[f"platen_{name}"]
        about = {"units": like.units, "long_name": f"reference {name} of C in {{s}}; Euler angles"}
        channels[f"reference_{name}"] = (like.dims, values, about)
    return channels


def required_channel(spectrum: TargetSpectrum) -> "xr.DataArray":
    """Response spectrum that a target was to have: not-a-number for axes without one."""
    import xarray as xr

    columns = [spectrum.acceleration.get(axis, np.full(len(spectrum.frequency), np.nan)) for axis in AXES]
    return xr.DataArray(
        np.column_stack(columns),
        {"required_frequency": ("required_frequency", spectrum.frequency, {"units": "Hz"}), "axis": list(AXES)},
        ("required_frequency", "axis"),
        attrs={
            "units": "m/s2",
            "long_name": "response spectrum (pseudo-acceleration) that the target was to have",
            "damping": spectrum.damping,
            "source": spectrum.source,
        },
    )


def _supply_droop(run: Run) -> Array:
    """Fall of the supply pressure with the flow drawn (n,) [Pa]."""
    supply = run.plant.supply
    return supply.droop * run.z[:, int(supply.drawn)] if supply.drawn >= 0.0 else np.zeros(len(run.time))


def _supply_flow(run: Run) -> Any:
    """Flow drawn from the supply (n,) [m3/s], with what is known of pumps and accumulators."""
    plant, flow = run.plant, np.empty(len(run.time))
    drawn_flows(plant.rows, run.spool, plant.supply._replace(weight=1.0), run.z, flow)
    about = {"units": "m3/s", "long_name": "oil that all valves draw from the supply"}
    return ("time",), flow, about | power_supply_facts(plant.machine)


def _hidden_states(run: Run) -> dict[str, Any]:
    """Hidden states without pressures as extra variables, by effect; attribute `states` names their columns."""
    columns: dict[str, list[int]] = {}
    names = run.plant.states
    for i, name in enumerate(names):
        if "pressure" not in name and not name.startswith("specimen."):
            columns.setdefault(name.split(".")[0], []).append(i)
    found: dict[str, Any] = {}
    for effect, own in columns.items():
        states = " ".join(names[i].split(".", 1)[1] for i in own)
        about = {"units": "1", "long_name": f"hidden states of {effect}", "states": states}
        found[f"hidden_{effect}"] = (("time", f"{effect}_state"), run.z[:, own], about)
    return found

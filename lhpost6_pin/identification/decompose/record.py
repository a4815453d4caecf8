"""Decomposition of a record into forces by inverse dynamics, and the band in which they are compared.

A simulated record without noise is used as it is. In a measured one, groups of channels are aligned by redundant
channels, and the platen's motion is fused from all its sensors: noise of the raw displacement would reduce the modelled
friction. Friction follows the motion in the sensors' whole band; forces are then filtered, and their edges cut.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from ...core.arrays import Array
from ...core.errors import RecordError
from ...core.files import models_folder
from ...core.shown import Shown
from ...data.alignment import Delay, align_record
from ...data.channels import MOTION
from ...data.measured_sensors import find_sensors
from ...data.records import is_measured, require, sample_interval
from ...data.sensors import SensorSet
from ...data.served_samples import cut_notes, part_compared
from ...data.signals import Band
from ...machine.machine import Machine
from ...machine.parameters import Parameters, load_parameters
from ...mechanics.interface_wrench import bare
from ...mechanics.plant import Plant, make_plant
from ...mechanics.pose import PlatenMotion
from ..friction_start import estimate_start, start_note
from ..inverse_dynamics import Decomposition, inverse_dynamics
from ..known_slip import UNKNOWN_SLIP, slip_summary
from ..prepare import (
    AS_RECORDED,
    SIGNIFICANT,
    MeasuredTest,
    actuator_forces,
    check_usable,
    find_delays,
    prepare_test,
    source_of,
    warn_of_skews,
)

__all__ = ["ComparisonBand", "Decomposed", "decompose_numbers", "decompose_record", "decompose_test"]


class ComparisonBand(NamedTuple):
    """How forces are compared."""

    band: Band
    edge: float  # cut off at both ends [s]


@dataclass(frozen=True, repr=False)
class Decomposed(Shown):
    """A decomposed record: `whole` has all samples in the sensors' band, `forces` and `motion` the compared ones."""

    test: MeasuredTest  # aligned, if it was; its motion is in the sensors' band
    sensors: SensorSet | None  # None: the record is free of noise
    comparison: ComparisonBand
    whole: Decomposition
    forces: Decomposition  # filtered, edges cut; its states are those of `whole`, cut
    motion: PlatenMotion  # filtered and cut as the forces are
    inside: slice  # samples of `whole` that are compared
    delays: Mapping[str, Delay]  # removed, by group
    notes: tuple[str, ...]  # sources of motion and forces
    mounted: Plant  # with the specimen, if there is one

    @property
    def record(self) -> xr.Dataset:
        """The record, aligned, if it was."""
        return self.test.record

    @property
    def plant(self) -> Plant:
        """Plant whose equations were used, without a specimen: its wrench is an effect of the ledger."""
        return self.whole.states.plant

    @property
    def time(self) -> Array:
        """Time (n,) [s] of the compared samples."""
        return self.forces.ledger.time

    @property
    def dt(self) -> float:
        """Sample interval [s]."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    @property
    def slip(self) -> str:
        """In which share of the test friction's slip is unknown, and the error in the rest; empty where it is known."""
        words = slip_summary(self.plant, self.test, self.forces.measured, self.forces.residual, self.inside)
        return f"{words[0].upper()}{words[1:]}. {UNKNOWN_SLIP}" if words else ""

    def compared(self, values: Array) -> Array:
        """Values (n, ...) at all samples, filtered and cut as `forces` are."""
        return np.asarray(self.comparison.band.apply(values, self.dt)[self.inside])


def decompose_numbers() -> Parameters:
    """Numbers of `models/procedures/decompose.toml`."""
    return load_parameters(models_folder() / "procedures" / "decompose.toml")


def decompose_record(
    machine: Machine,
    record: xr.Dataset,
    sensors: SensorSet | None = None,
    *,
    cutoff: float | None = None,
    align: bool = True,
) -> Decomposed:
    """Decompose a record with a machine's equations; sensors by default those of `find_sensors`.

    cutoff [Hz] is by default that of `decompose.toml`. A recording that tripped is decomposed up to its trip.
    Actuator forces come from chamber pressures where they were not measured. The number of open servovalves has no
    effect. The specimen is the machine's, else the one that the record names; its wrench on the platen is the effect
    `specimen` of the ledger. Raises RecordError for a record that lacks channels, is not finite, of another machine or
    specimen, out of stroke or too short.
    """
    record = part_compared(record)
    machine = machine.as_mounted(record.attrs, source_of(record))
    check_usable(machine, record)
    numbers, dt, mounted = decompose_numbers(), sample_interval(record), make_plant(machine)
    plant = bare(mounted)
    high = numbers.number("comparison.cutoff") if cutoff is None else cutoff
    if not high > 0.0:
        raise RecordError(f"the cutoff must be above zero (got {high:g} Hz)")
    if 0.5 / dt <= high:
        raise RecordError(
            f"{source_of(record)}: {1.0 / dt:g} samples per second show nothing above {0.5 / dt:g} Hz, too few to "
            f"compare forces up to {high:g} Hz; give a cutoff below {0.5 / dt:g} Hz (--cutoff)"
        )
    band = Band(high=high, order=int(numbers.number("comparison.order")))
    comparison = ComparisonBand(band, numbers.number("comparison.edge"))
    policy = AS_RECORDED
    if is_measured(record):
        sensors, policy = sensors or find_sensors(machine, [record]), SIGNIFICANT if align else AS_RECORDED
    else:
        require(record, *MOTION)
        sensors = None
    delays = find_delays(plant, [record], policy)
    warn_of_skews(delays, sensors)
    test = prepare_test(plant, align_record(record, delays), sensors, policy._replace(band=band, edge=comparison.edge))
    whole, notes = decompose_test(mounted, test)
    if delays:
        removed = ", ".join(f"{group} {1e3 * d.delay:+.3f} ms behind {d.reference}" for group, d in delays.items())
        notes = (*notes, f"Skews removed: {removed}.")
    n, cut = test.samples, round(comparison.edge / test.dt)
    if n - 2 * cut < 4 * cut:
        raise RecordError(
            f"{source_of(record)}: {n * test.dt:.3g} s are too short; {comparison.edge:g} s at each end are cut off"
        )
    notes, inside = (*cut_notes(record), *notes), slice(cut, n - cut)
    forces, motion = _filtered(whole, test.motion, band, test.dt, inside)
    return Decomposed(test, sensors, comparison, whole, forces, motion, inside, delays, notes, mounted)


def decompose_test(
    plant: Plant, test: MeasuredTest, start: Array | None = None
) -> tuple[Decomposition, tuple[str, ...]]:
    """Inverse dynamics of a test, and notes on the sources of its forces and motion.

    The equations are those of the table without specimen; the wrench of a specimen on the plant is an effect, as its
    model predicts it, or as its floors' accelerations show it where they were measured. start (n_states,) are the
    states of friction at the start; by default those of `estimate_start`.
    """
    mounted, plant = plant, bare(plant)
    record, force = test.record, actuator_forces(plant.machine, test.channels)
    if force is None:
        if "chamber_pressure_a" in test.channels:
            require(record, "chamber_pressure_b")
        what = "neither actuator_force nor chamber_pressure_a nor pressure_difference"
        raise RecordError(f"{source_of(record)}: has {what}; forces come from one of them")
    notes = ["Actuator forces as measured."]
    if "actuator_force" not in test.channels:
        notes = ["Actuator forces from their chamber pressures, P_A A_1 − P_B A_2."]
        if "chamber_pressure_a" not in test.channels:
            notes = ["Actuator forces from their pressure differences, (P_A − P_B) A."]
    struts = test.channels.get("strut_pressure") if plant.machine.struts else None
    if plant.machine.struts and struts is None:
        notes.append("Strut pressures were not measured: struts as modelled.")
    at_steps = not test.used and _at_model_steps(record)
    if test.used:
        notes.append(f"Platen motion fused from {', '.join(test.used)}.")
    else:
        step = ", at the model's steps; forces use the velocity of the step." if at_steps else "."
        notes.append(f"Simulated without noise: the platen's motion is the record's own{step}")
    if start is None:
        start = estimate_start(plant, test, decompose_numbers().number("comparison.cutoff"))
        notes += filter(None, [start_note(plant, start)])
    time = record["time"].values
    floors = test.channels.get("floor_acceleration") if plant.machine.floors else None
    modelled = mounted if mounted is not plant and floors is None and mounted.coupled is None else None
    found = inverse_dynamics(
        *(plant, time, test.motion, force, struts),
        floor_acceleration=floors, mounted=modelled, path=test.path, start=start, model_step=at_steps,
    )  # fmt: skip
    return found, tuple(notes)


def _filtered(
    found: Decomposition, motion: PlatenMotion, band: Band, dt: float, inside: slice
) -> tuple[Decomposition, PlatenMotion]:
    """Forces and motion in a band, samples `inside` of them; hidden states and coordinates are cut only."""

    def part(x: Array) -> Array:
        return np.asarray(band.apply(x, dt)[inside])

    states, ledger = found.states, found.ledger
    cut = {name: getattr(states, name)[inside] for name in ("time", "q", "v", "a", "z")}
    forces = replace(
        found,
        states=states._replace(**cut),
        ledger=replace(
            ledger,
            time=ledger.time[inside],
            force=part(ledger.force),
            wrench=part(ledger.wrench),
            inertia=part(ledger.inertia),
        ),
        component_force=part(found.component_force),
        component_wrench=part(found.component_wrench),
    )
    return forces, PlatenMotion(*map(part, motion))


def _at_model_steps(record: xr.Dataset) -> bool:
    """Whether the samples of a simulated record are the steps of a semi-implicit run."""
    rate = 1.0 / sample_interval(record)
    steps = float(record.attrs.get("steps_per_second", np.nan))
    return record.attrs.get("scheme") == "semi_implicit" and abs(rate - steps) < 1e-6 * steps

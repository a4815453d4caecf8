"""From a record to its forces: the motion that inverse dynamics starts from, and the band in which all is compared.

A simulated record without noise is taken as it is. In a measured one groups of channels are aligned by their twins and
the platen's motion is fused from all its sensors: hidden friction marched along raw displacement is shaken to nothing.
Friction sees the motion in the sensors' whole band; what is compared is then filtered alike, and its edges are cut.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...core.errors import RecordError
from ...core.files import models_folder
from ...data.alignment import Delay, align_record, group_delays, hydraulic_force
from ...data.channels import channel_name
from ...data.fusion import fuse_motion
from ...data.records import is_measured, require, sample_interval
from ...data.sensors import SensorSet, load_sensors
from ...data.signals import Band
from ...machine.machine import Machine
from ...machine.parameters import Parameters, load_parameters
from ...mechanics.plant import Plant, make_plant
from ...mechanics.pose import PlatenMotion
from ..inverse_dynamics import Decomposition, inverse_dynamics

__all__ = ["ComparisonBand", "Decomposed", "decompose_numbers", "decompose_record", "filtered", "take_apart"]

Array = NDArray[np.float64]

MOTION = ("platen_displacement", "platen_velocity", "platen_acceleration")


class ComparisonBand(NamedTuple):
    """How forces are compared."""

    band: Band
    edge: float  # left out at both ends [s]


@dataclass(frozen=True)
class Decomposed:
    """A record taken apart: `whole` has all samples in the sensors' band, `forces` and `motion` what is compared."""

    record: xr.Dataset  # aligned, if it was
    sensors: SensorSet | None  # None: the record is free of noise
    comparison: ComparisonBand
    whole: Decomposition
    whole_motion: PlatenMotion
    whole_path: Array | None  # (n, 6) displacement that friction followed, where it is not the motion's
    forces: Decomposition  # filtered, edges cut; its states are those of `whole`, cut
    motion: PlatenMotion  # the same
    delays: Mapping[str, Delay]  # taken out, by group
    notes: tuple[str, ...]  # where motion and forces come from, in words

    @property
    def plant(self) -> Plant:
        """Plant whose equations were used."""
        return self.whole.states.plant

    @property
    def time(self) -> Array:
        """Time (n,) [s] of what is compared."""
        return self.forces.ledger.time

    @property
    def dt(self) -> float:
        """Sample interval [s]."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    @property
    def inside(self) -> slice:
        """Samples of `whole` that are compared."""
        cut = (len(self.whole.states.time) - len(self.time)) // 2
        return slice(cut, cut + len(self.time))


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
    """Take a record apart with a machine's equations; sensors are the LHPOST6's, cutoff [Hz] that of `decompose.toml`.

    Actuator forces come from chamber pressures where they were not measured. How many servovalves were open does not
    matter here. Raises RecordError for what is missing, not finite, of another machine, out of stroke or too short;
    SimulationError for a specimen with joints.
    """
    _check_machine(machine, record)
    comparison = _comparison(cutoff)
    if (rate := 1.0 / sample_interval(record)) <= comparison.band.high:
        raise RecordError(
            f"{_source(record)}: {rate:g} samples a second are too few to compare forces up "
            f"to {comparison.band.high:g} Hz; lower the cutoff"
        )
    plant = make_plant(machine)
    delays: Mapping[str, Delay] = {}
    if is_measured(record):
        sensors = load_sensors() if sensors is None else sensors
        _check_finite(record)
        if align:
            delays = group_delays(plant, [record])
            record = align_record(record, delays)
    else:
        require(record, *MOTION)
        _check_finite(record)
        sensors = None
    whole, motion, path, notes = take_apart(plant, record, sensors, comparison.band)
    if delays:
        said = ", ".join(f"{group} {1e3 * d.delay:+.3f} ms behind {d.reference}" for group, d in delays.items())
        notes = (*notes, f"Skews taken out: {said}.")
    n = len(whole.states.time)
    dt = sample_interval(record)
    cut = round(comparison.edge / dt)
    if n - 2 * cut < 4 * cut:
        raise RecordError(
            f"{_source(record)}: {n * dt:.3g} s are too short; {comparison.edge:g} s at each end are left out"
        )
    inside = slice(cut, n - cut)
    forces, seen = filtered(whole, motion, comparison.band, dt, inside)
    return Decomposed(record, sensors, comparison, whole, motion, path, forces, seen, delays, notes)


def take_apart(
    plant: Plant, record: xr.Dataset, sensors: SensorSet | None, band: Band
) -> tuple[Decomposition, PlatenMotion, Array | None, tuple[str, ...]]:
    """Inverse dynamics of a record as it stands: forces, motion, path of friction, and where they came from in words.

    The path is the displacement (n, 6) that friction followed; None: the motion's. With sensors the motion is fused,
    in their band; without accelerometers in `band`, as noise grows with frequency.
    """
    force, source = _actuator_force(plant.machine, record)
    struts = None
    words = [source]
    if "strut_pressure" in record and plant.machine.struts:
        struts = record["strut_pressure"].values
    elif plant.machine.struts:
        words.append("Strut pressures were not measured: the model's struts stand in for them.")
    model_step, path = False, None
    if sensors is None:
        motion = PlatenMotion(*(record[name].values.astype(float) for name in MOTION))
        model_step = _at_model_step(record)
        words.append(
            "Simulated without noise: the platen's motion is the record's own"
            + (", at the model's steps; forces see the velocity that they saw there." if model_step else ".")
        )
    else:
        fused = fuse_motion(plant, record, sensors, band=None if "platen_acceleration" in record else band)
        motion, path = fused.motion, fused.path
        words.append(f"Platen motion fused from {', '.join(fused.used)}.")
    found = inverse_dynamics(plant, record["time"].values, motion, force, struts, path=path, model_step=model_step)
    return found, motion, path, tuple(words)


def filtered(
    found: Decomposition, motion: PlatenMotion, band: Band, dt: float, inside: slice
) -> tuple[Decomposition, PlatenMotion]:
    """Forces and motion in a band, samples `inside` of them; hidden states and coordinates are cut only."""

    def seen(x: Array) -> Array:
        return np.asarray(band.apply(x, dt)[inside])

    states = found.states._replace(
        **{name: getattr(found.states, name)[inside] for name in ("time", "q", "v", "a", "z")}
    )
    ledger = replace(
        found.ledger,
        time=found.ledger.time[inside],
        force=seen(found.ledger.force),
        wrench=seen(found.ledger.wrench),
        inertia=seen(found.ledger.inertia),
    )
    cut = replace(
        found,
        states=states,
        ledger=ledger,
        component_force=seen(found.component_force),
        component_wrench=seen(found.component_wrench),
    )
    return cut, PlatenMotion(*map(seen, motion))


# ---------------------------------------------------------------------------------------------- helpers
def _comparison(cutoff: float | None) -> ComparisonBand:
    numbers = decompose_numbers()
    high = numbers.number("comparison.cutoff") if cutoff is None else cutoff
    if not high > 0.0:
        raise RecordError(f"a cutoff of {high:g} Hz leaves nothing to compare; give one above zero")
    return ComparisonBand(
        Band(high=high, order=int(numbers.number("comparison.order"))), numbers.number("comparison.edge")
    )


def _check_machine(machine: Machine, record: xr.Dataset) -> None:
    """Refuse a record of another machine, or with a specimen that this one does not carry."""
    require(record, "time")
    machine.refuse_unmounted(record.attrs, "the record")
    for dim, names in (("actuator", machine.actuator_names), ("strut", machine.strut_names)):
        if dim in record.coords and [str(x) for x in record[dim].values] != list(names):
            raise RecordError(
                f"{_source(record)}: has {dim}s {' '.join(map(str, record[dim].values))}, {machine.name} has "
                f"{' '.join(names)}; name its machine with --machine"
            )


def _check_finite(record: xr.Dataset) -> None:
    used: Sequence[str] = (*MOTION, "actuator_displacement", "actuator_force", "strut_pressure")
    used = (*used, "chamber_pressure_a", "chamber_pressure_b")
    for name in (name for name in used if name in record):
        bad = np.argwhere(~np.isfinite(record[name].values))
        if bad.size:
            where = f"{channel_name(record[name], int(bad[0, 1]))} at sample {bad[0, 0]}"
            raise RecordError(f"{_source(record)}: {where} is not finite; mend or cut it")


def _actuator_force(machine: Machine, record: xr.Dataset) -> tuple[Array, str]:
    """Forces (n, n_actuators) [N], and where they come from in words."""
    if "actuator_force" in record:
        return record["actuator_force"].values.astype(float), "Actuator forces as measured."
    if "chamber_pressure_a" not in record:
        raise RecordError(
            f"{_source(record)}: has neither actuator_force nor chamber_pressure_a; forces come from one of them"
        )
    if machine.double_acting:
        require(record, "chamber_pressure_b")
    return hydraulic_force(machine, record), "Actuator forces from their chamber pressures, P_A A_1 − P_B A_2."


def _at_model_step(record: xr.Dataset) -> bool:
    """Whether the samples of a simulated record are the steps of a semi-implicit run."""
    rate = 1.0 / sample_interval(record)
    steps = float(record.attrs.get("steps_per_second", np.nan))
    return record.attrs.get("scheme") == "semi_implicit" and abs(rate - steps) < 1e-6 * steps


def _source(record: xr.Dataset) -> str:
    return str(record.encoding.get("source", "the record"))

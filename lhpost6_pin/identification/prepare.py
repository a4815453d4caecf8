"""Preparation of measured records: aligned channels, one fused motion with its shares, actuator forces.

Decomposition, validation, calibration and discovery share this road. They differ by a policy: which delays between
groups of channels are removed beforehand, and from which tests they are estimated.

    AS_RECORDED   none
    SIGNIFICANT   those of the records given that exceed their standard errors                  (decompose and validate)
    CALIBRATION   those of the whole campaign, except of the struts' gas, where loss of heat would be mistaken for a
                  delay; actuator lengths are excluded from the motion, since the geometry behind them is
                  calibrated                                                                  (calibrate and discover)
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.errors import RecordError
from ..data.alignment import Delay, align_record, group_delays, oil_force
from ..data.channels import LAYOUT, MOTION, channel_name
from ..data.fusion import fuse_motion
from ..data.records import is_measured, refuse_other_machine, require, sample_interval
from ..data.sensors import SensorSet, add_noise
from ..data.signals import Band, differentiate
from ..data.valve_pairs import with_joint_spools
from ..machine.machine import Machine
from ..mechanics.plant import Plant
from ..mechanics.pose import PlatenMotion, leg_displacements
from ..mechanics.strokes import stroke_ends

__all__ = ["AS_RECORDED", "CALIBRATION", "HALF_PLAY", "ROD_LENGTH", "SIGNIFICANT", "MeasuredTest"]
__all__ += ["Policy", "actuator_forces", "align_records", "chamber_pressures", "find_delays", "oil_forces"]
__all__ += ["check_usable", "prepare_noisier", "prepare_test", "source_of", "warn_of_skews"]


log = logging.getLogger(__name__)


class Policy(NamedTuple):
    """How records are prepared before they are compared with a model."""

    align: bool  # whether delays are removed that redundant channels show
    significance: float = 0.0  # delays below so many standard errors are kept
    as_recorded: tuple[str, ...] = ()  # groups of channels whose delay is kept
    lengths: bool = True  # whether the platen's motion is fused from actuator lengths, too
    shares: bool = False  # whether each channel's share in the motion is determined
    rate: float = np.inf  # faster records are decimated to the next rate above [Hz]
    band: Band | None = None  # of a motion without accelerometers; by default the sensors' own
    pressure_cutoff: float | None = None  # up to which pressures are differentiated [Hz]; None: they are not
    edge: float = 0.0  # at the start of a test [s], in which filters settle


PRESSURE_ORDER = 16
"""Order of the low-pass of differentiated channels: at half its cutoff it takes less than 2e-5."""

RESTS = 20.0
"""Travel over the noise of a sample up to which an axis rests while filters settle: noise of the first sample and the
offset of an accelerometer moved one at rest by up to 8 in a sealed case."""

ROD_LENGTH, HALF_PLAY = "rod_displacement", "half_play"
"""Variable (time, actuator) that discovery adds to a record: lengths [m] of rods whose pin is loose, less the errors of
their sensors, NaN for others; and its attribute: by how much each is loose, to either side [m]."""

AS_RECORDED = Policy(align=False)
SIGNIFICANT = Policy(align=True, significance=3.0)
CALIBRATION = Policy(align=True, as_recorded=("strut_pressure",), lengths=False, shares=True)


@dataclass(frozen=True)
class MeasuredTest:
    """A measured test prepared for residuals; n samples, `channels` as far as measured."""

    name: str
    dt: float  # [s]
    motion: PlatenMotion  # of C and Euler angles
    channels: Mapping[str, Array]  # (n, k) each, by name of the layout
    rates: Mapping[str, Array] = field(default_factory=dict)  # (n, k) of differentiated channels [unit/s]
    path: Array | None = None  # (n, 6) displacement that friction follows, where it is not the motion's
    settled: int = 0  # samples at the start of that path in which filters settle, where an axis at rest stays
    share: Mapping[str, PlatenMotion] = field(default_factory=dict)  # of each platen channel in the motion
    used: tuple[str, ...] = ()  # channels that the motion was fused from; none: a simulated record's own
    side: Array | None = None  # (2, n, n_actuators) of its play on which a pin stands, -1 to 1, and rate; NaN: unknown
    record: xr.Dataset = field(default_factory=xr.Dataset)  # aligned
    weight: Array | None = None  # (n,) of the wrench residual, less where friction's state is unknown; None: one
    substeps: int = 1  # in which friction is marched between samples
    carried: Array | None = None  # (n, 6) at B in platen axes: wrench of a moving specimen beyond that of a rigid one

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.motion.displacement)

    def with_channels(self, **channels: Array | None) -> "MeasuredTest":
        """The same test with other values of some channels; without those that are None."""
        merged = {**self.channels, **channels}
        return replace(self, channels={name: x for name, x in merged.items() if x is not None})


def chamber_pressures(machine: Machine, channels: Mapping[str, Array], *, rates: bool = False) -> Array | None:
    """Chamber pressures (n, n_chambers) [Pa], A of every actuator, then B of the double-acting; None if not measured.

    Where only the pressure difference is measured, or the force of a piston of equal areas, both add up to supply and
    return pressure, as a valve whose ports match the piston's areas makes them (Merritt 1967, Section 5.2). The force
    of a load cell lacks the share that moves piston and rod. With `rates` the channels are rates [Pa/s].
    """
    sides = [channels[name] for name in ("chamber_pressure_a", "chamber_pressure_b") if name in channels]
    if "chamber_pressure_a" in channels:
        return np.hstack(sides)
    difference, force = channels.get("pressure_difference"), channels.get("actuator_force")
    if difference is None and force is not None and machine.equal_areas:
        difference = force / [a.area_a * (1.0 - (a.load_cell_share or 0.0)) for a in machine.actuators]
    if difference is None:
        return None
    level = 0.5 * (machine.hydraulics.supply_pressure + machine.hydraulics.return_pressure) * (not rates)
    return np.hstack([level + 0.5 * difference, level - 0.5 * difference])


def actuator_forces(machine: Machine, channels: Mapping[str, Array]) -> Array | None:
    """Forces (n, n_actuators) [N]: measured, else of the chamber pressures; None without either."""
    force = channels.get("actuator_force")
    return oil_forces(machine, channels) if force is None else force


def oil_forces(machine: Machine, channels: Mapping[str, Array]) -> Array | None:
    """P_A A_1 - P_B A_2 (n, n_actuators) [N] of the measured pressures (Eq. 4-6); None where some are missing."""
    measured = {name: x for name, x in channels.items() if name != "actuator_force"}
    pressure, count = chamber_pressures(machine, measured), len(machine.actuators)
    if pressure is None or pressure.shape[1] < count + len(machine.double_acting):
        return None
    return oil_force(machine, pressure[:, :count], pressure[:, count:])


def check_usable(machine: Machine, record: xr.Dataset) -> None:
    """Refuse a record of another machine, with a specimen that this one does not carry, or with holes."""
    require(record, "time")
    machine.refuse_unmounted(record.attrs, "the record")
    refuse_other_machine(machine, record)
    for name in (name for name in LAYOUT if name in record):
        bad = np.argwhere(~np.isfinite(record[name].values))
        if bad.size:
            where = f"{channel_name(record[name], int(bad[0][-1]))} at sample {bad[0][0]}"
            raise RecordError(f"{source_of(record)}: {where} is not finite; mend or cut it")


def source_of(record: xr.Dataset) -> str:
    """File that a record comes from."""
    return str(record.encoding.get("source", "the record"))


def align_records(
    plant: Plant, records: Sequence[xr.Dataset], policy: Policy
) -> tuple[list[xr.Dataset], dict[str, Delay]]:
    """Records of a campaign with the channels that a policy uses, and the delays removed, by group of channels.

    Accelerations of floors are left out with a warning where the machine states none: without masses they are no force.
    """
    if not policy.lengths:
        records = [r.drop_vars("actuator_displacement", errors="ignore") for r in records]
    if not plant.machine.floors and any("floor_acceleration" in r for r in records):
        names = [f"[floor.{name}]" for name in next(r for r in records if "floor" in r.coords)["floor"].values]
        log.warning(
            "floor_acceleration is not used, since %s states no floors, and their base shear is missing in the balance "
            "of forces; add %s with along, mass and point (documentation: your own machine)",
            plant.machine.name, ", ".join(names),
        )  # fmt: skip
        records = [r.drop_vars(("floor_acceleration", "floor"), errors="ignore") for r in records]
    delays = find_delays(plant, records, policy)
    return [align_record(r, delays) for r in records], delays


def find_delays(plant: Plant, records: Sequence[xr.Dataset], policy: Policy) -> dict[str, Delay]:
    """Delays that a policy removes from these records, by group of channels."""
    if not policy.align:
        return {}
    return {
        group: delay
        for group, delay in group_delays(plant, records).items()
        if group not in policy.as_recorded
        and (policy.significance == 0.0 or abs(delay.delay) > policy.significance * delay.standard_error)
    }


def warn_of_skews(delays: Mapping[str, Delay], sensors: SensorSet | None) -> None:
    """Log a warning of every delay that is beyond what the stated ranges of both groups allow."""
    if sensors is None:
        return
    for group, one in delays.items():
        most = sensors.relative_delay_range(group, one.reference)
        if abs(one.delay) - SIGNIFICANT.significance * one.standard_error > most:
            where = "behind" if one.delay > 0.0 else "ahead of"
            log.warning(
                "%s is %.3g ms %s %s, where the sensors' ranges allow %.2g: it is shifted back; look for the cause",
                *(group, 1e3 * abs(one.delay), where, one.reference, 1e3 * most),
            )


def prepare_test(plant: Plant, record: xr.Dataset, sensors: SensorSet | None, policy: Policy) -> MeasuredTest:
    """A test from its aligned record: decimated, its motion fused. Without sensors the motion is the record's own.

    A test that reached the end of a stroke is logged as a warning.
    Raises RecordError for a record without platen motion, or with a channel of it that is not finite.
    """
    record = _decimated(with_joint_spools(plant.machine, record), policy.rate)
    dt = sample_interval(record)
    columns = {n: record[n].values for n, c in LAYOUT.items() if n in record and c.residuals and c.role != "motion"}
    channels = {name: np.ascontiguousarray(x.reshape(len(x), -1), float) for name, x in columns.items()}
    cutoff, rates = policy.pressure_cutoff, {}
    if cutoff is not None:
        derived = {n: x for n, x in channels.items() if LAYOUT[n].differentiated}
        rates = {n: differentiate(x, dt, cutoff, PRESSURE_ORDER) for n, x in derived.items()}
    name = str(record.attrs.get("test", "test"))
    if sensors is None or (not is_measured(record) and set(MOTION) <= set(record.data_vars)):
        motion = PlatenMotion(*(record[channel].values.astype(float) for channel in MOTION))
        _warn_of_strokes(plant, name, record, motion)
        return MeasuredTest(name, dt, motion, channels, rates, record=record)
    band = None if "platen_acceleration" in record else policy.band
    fused = fuse_motion(plant, record, sensors, band=band, shares=policy.shares)
    _warn_of_strokes(plant, name, record, fused.motion)
    side = _contact_side(plant, record, fused.motion, dt, cutoff)
    settled = min(round(policy.edge / dt), len(fused.path) - 1)
    path = _at_rest(fused.path, settled, fused.sample)
    return MeasuredTest(
        *(name, dt, fused.motion, channels, rates, path, settled, fused.share, fused.used, side, record)
    )


def _at_rest(path: Array, settled: int, noise: Array) -> Array:
    """A path (n, 6) that stays where it is when filters have settled, until then, on axes that do not move before.

    Filters begin at the noise of a single sample, of deviations `noise` (6,), and with offsets of accelerometers. What
    friction holds at the start would be lost on the way from there, by as much as its yield slip.
    """
    still = np.abs(path[:settled] - path[settled]).max(axis=0, initial=0.0) < RESTS * noise
    out = path.copy()
    out[:settled, still] = path[settled, still]
    return out


def prepare_noisier(
    plant: Plant, record: xr.Dataset, sensors: SensorSet, policy: Policy, rng: np.random.Generator
) -> MeasuredTest:
    """The test of a record, as `prepare_test`, with a second draw of the noise that it has."""
    return prepare_test(plant, add_noise(record, sensors, rng), sensors.drawn_twice(), policy)


def _contact_side(
    plant: Plant, record: xr.Dataset, motion: PlatenMotion, dt: float, cutoff: float | None
) -> Array | None:
    """Side of its play on which each loose pin stands, and its rate: the rod ahead of the platen over half the play."""
    if ROD_LENGTH not in record:
        return None
    rods = record[ROD_LENGTH]
    legs, _ = leg_displacements(plant, motion.displacement)
    side = (rods.values - legs[:, : plant.spools]) / np.asarray(rods.attrs[HALF_PLAY])
    return np.stack([side, differentiate(side, dt, cutoff, PRESSURE_ORDER)])


def _warn_of_strokes(plant: Plant, test: str, record: xr.Dataset, motion: PlatenMotion) -> None:
    legs, _ = leg_displacements(plant, motion.displacement)
    for end in stroke_ends(plant, record["time"].values, legs[:, : plant.spools]):
        log.warning("%s: %s; forces of an end stop are in its record from then on", test, end)


def _decimated(record: xr.Dataset, rate: float) -> xr.Dataset:
    """The record at the smallest whole fraction of its rate that is above `rate` [Hz], filtered against aliasing."""
    dt = sample_interval(record)
    every = int(1.0 / (rate * dt) + 1e-6)
    if every < 2:
        return record
    band = Band(high=0.4 / (every * dt), order=16)
    timed = {name: x.copy(data=band.apply(x.values, dt)) for name, x in record.items() if "time" in x.dims}
    return record.assign(timed).isel(time=slice(None, None, every))

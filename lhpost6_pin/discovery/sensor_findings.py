"""Sensor faults found by cross-checking redundant sensors, independent of any force law, and corrected.

Only redundant channels are compared (`consistency`): velocity and acceleration against displacement, lengths against
the pose, the skew of forces against pressures. Gains and offsets of forces and pressures are left to the search.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import xarray as xr

from ..core.names import AXES
from ..data.alignment import align_record
from ..data.channels import LAYOUT
from ..data.consistency import LEVELS, ConsistencyFinding, check_sensors
from ..data.layout_faults import RecordFinding
from ..data.sensors import SensorSet
from ..data.turned_displacement import turned_displacement
from ..data.turned_signs import turned_signs
from ..mechanics.plant import Plant

__all__ = ["SensorFault", "correct_records", "find_sensor_faults"]

_SKEWED = {
    "velocity against displacement": "platen_displacement",
    "acceleration against displacement": "platen_displacement",
    "length against platen pose": "platen_displacement",
    "force against pressures": "chamber_pressure",
}
"""Group of channels that each check compares delays with."""

_CHECKS = tuple(check for check in _SKEWED if check != "force against pressures")


@dataclass(frozen=True)
class SensorFault:
    """A sensor beyond its stated range: measured = (1 + gain) true + cross-talk + offset, delayed."""

    kind: str  # "gain", "offset", "drift", "delay", "sign", or "cross x": of the acceleration along x
    channel: str
    column: str  # label within the channel; empty: all of it
    value: float
    unit: str
    deviation: float  # standard, of noise and calibration uncertainty
    stated: float  # largest error that the sensors' file allows; of a delay, of both groups together
    reference: str = ""  # group of channels that a delay is relative to

    @property
    def name(self) -> str:
        """As of the unknowns of a search."""
        return f"{self.kind} {self.channel}[{self.column}]" if self.column else f"{self.kind} {self.channel}"

    @property
    def family(self) -> str:
        """Family of the library."""
        return "channel_delay" if self.kind == "delay" else LAYOUT[self.channel].fault


def find_sensor_faults(
    plant: Plant, records: Sequence[xr.Dataset], sensors: SensorSet, loose: Sequence[str] = ()
) -> tuple[SensorFault, ...]:
    """Faults of redundant sensors, pooled over records, and turned signs; raises what `check_sensors` does.

    Axes of the displacement that are turned are turned back before anything else is judged. Play of actuators that are
    `loose` shifts the means of their lengths, within a record as well: neither is reported.
    """
    turned = _in_most([turned_displacement(record, plant.machine)[0] for record in records])
    records = correct_records(records, turned)
    findings = check_sensors(plant, records, sensors)
    late = _late(findings, sensors)
    if late:  # a large delay biases the gain
        behind = {f.channel: f.value for f in late}
        findings = check_sensors(plant, [align_record(r, behind) for r in records], sensors)
    shifted = {f"actuator_displacement[{name}]" for name in loose}
    wrong = [f for f in findings if f.check in _CHECKS and f.verdict == "suspicious"]
    faults = [_fault(f, sensors) for f in wrong if f.quantity not in LEVELS or f.channel not in shifted]
    opposed = _in_most([turned_signs(record, plant.machine) for record in records])
    return (*turned, *(f for f in faults if f is not None), *late, *opposed)


def _in_most(turned: Sequence[Sequence[RecordFinding]]) -> list[SensorFault]:
    """Channels that are turned in most of the records, from the findings on each."""
    count = Counter(f.channel for each in turned for f in each)
    names = [channel.rstrip("]").partition("[") for channel, n in count.items() if 2 * n > len(turned)]
    return [SensorFault("sign", name, label, -1.0, "1", 0.0, 0.0) for name, _, label in names]


def _fault(finding: ConsistencyFinding, sensors: SensorSet) -> SensorFault | None:
    """The gain, drift, offset or cross-talk of a finding; None for others."""
    channel, _, column = finding.channel.rstrip("]").partition("[")
    kind, error = finding.quantity, finding.estimate - finding.expected
    ranges = {"gain": sensors.gain_range, "cross": sensors.gain_range, "drift": {}, "offset": sensors.offset_range}
    known = ranges.get(kind.split()[0])
    if known is None or (kind == "offset" and channel.startswith("platen")):
        return None
    return SensorFault(kind, channel, column, error, finding.unit, finding.deviation, known.get(channel, 0.0))


def _late(findings: Sequence[ConsistencyFinding], sensors: SensorSet) -> list[SensorFault]:
    """Groups of channels of which most testable columns are delayed."""
    faults = []
    for check, reference in _SKEWED.items():
        tested = [f for f in findings if f.check == check and f.quantity == "delay" and f.verdict != "untested"]
        off = [f for f in tested if f.verdict == "suspicious"]
        if 2 * len(off) > len(tested):
            group = tested[0].channel.partition("[")[0]  # the same for all
            middle = sorted(off, key=lambda f: f.estimate)[len(off) // 2]
            error, stated = middle.estimate - middle.expected, sensors.relative_delay_range(group, reference)
            faults.append(SensorFault("delay", group, "", error, "s", middle.deviation, stated, reference))
    return faults


def correct_records(records: Sequence[xr.Dataset], faults: Sequence[SensorFault]) -> list[xr.Dataset]:
    """Records without the gains and cross-talk of these faults of the platen's sensors, and with signs turned back.

    Delays are aligned later.
    """
    corrected = []
    for record in records:
        out = record.copy(deep=True) if faults else record
        for fault in faults:
            if fault.kind == "sign" and fault.channel in out:
                variable = out[fault.channel]
                variable.loc[{variable.dims[1]: fault.column}] *= -1.0
                continue
            if fault.kind == "delay" or fault.channel not in out or not fault.channel.startswith("platen"):
                continue
            values, k = out[fault.channel].values, AXES.index(fault.column)
            if fault.kind == "gain":
                values[:, k] /= 1.0 + fault.value
            elif fault.kind.startswith("cross"):
                values[:, k] -= fault.value * values[:, AXES.index(fault.kind.split()[1])]
        corrected.append(out)
    return corrected

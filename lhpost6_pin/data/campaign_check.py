"""What the sensors of a campaign show together: noise at rest, agreement of redundant ones, and what they can tell."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
import xarray as xr

from ..core.errors import RecordError
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..mechanics.plant import make_plant
from .channels import LAYOUT
from .consistency import ConsistencyFinding, check_sensors
from .filled_samples import stated_constants
from .measured_sensors import NoiseComparison, compare_noise, measured_sensors, with_measured_noise
from .noise_levels import noise_levels
from .observable import Observable, observable
from .records import is_measured
from .rests import restless
from .sensor_pairs import counterpart
from .sensors import SensorSet, load_sensors, make_sensors
from .served_samples import part_compared
from .turned_displacement import turned_displacement

__all__ = ["CampaignCheck", "check_campaign", "contradicting_sensors"]

WRONG = 1.5
"""Factor of a gain, either way, beyond which a unit or a factor of a channel map is wrong rather than a calibration."""

DEAD = 1e-9
"""Gain over what it should be below which a sensor shows nothing of what the others do: no unit is that wrong."""

_AGAIN = "in the channel map, and import again"

UNEVEN = 2.0  # a column is that much noisier than those like it: a loose cable rather than a worse sensor


@dataclass(frozen=True)
class CampaignCheck:
    """Sensors of the measured records of a campaign."""

    rate: float  # of the records [Hz]
    rest: float  # seconds of it
    source: str  # of the noise levels
    stated: str  # name of the sensors that they are compared with; empty: none
    noise: tuple[NoiseComparison, ...]
    findings: tuple[ConsistencyFinding, ...] | None  # of redundant sensors; None where they show no noise to judge by
    observable: tuple[Observable, ...]
    content: Parameters | None  # of a sensors file
    reason: str  # why there is none

    @property
    def contradictions(self) -> tuple[str, ...]:
        """Redundant sensors of which one is turned, or wrong by a factor: by their gain, with what to correct."""
        gains = [f for f in self.findings or () if f.quantity.startswith("gain") and f.verdict != "untested"]
        alone, alike = list[str](), dict[str, list[tuple[ConsistencyFinding, ...]]]()
        for (check, _), group in groupby(gains, lambda one: (one.check, _channel_of(one))):
            ones, other = tuple(group), counterpart(check)
            if other and _off_alike(ones):
                alike.setdefault(other, []).append(ones)
            else:
                alone += [words for one in ones if one.verdict == "suspicious" and (words := _gain_off(one))]
        units = [words for other, groups in alike.items() for words in _units_off(other, groups)]
        return *units, *alone

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is wrong with the stated noise, or with one sensor among its like."""
        found = [f"{one.channel}: {one.warning}" for one in self.noise if one.warning]
        if not self.rest and self.noise:
            found.append("no test rests long enough: noise is an upper bound, jumps of friction are in it")
        found += [
            f"{one.channel}: its noisiest column has {one.uneven:.2g} times the noise of the others: check that sensor"
            for one in self.noise
            if one.uneven > UNEVEN
        ]
        return tuple([*found, self.reason] if self.reason else found)


def _channel_of(finding: ConsistencyFinding) -> str:
    """Channel of a finding without its column."""
    return finding.channel.partition("[")[0]


def _factor(finding: ConsistencyFinding) -> float:
    """What a gain is over what it should be."""
    return finding.estimate / finding.expected


def _off_alike(gains: Sequence[ConsistencyFinding]) -> bool:
    """Whether all gains are off by about the same factor: a unit, of this channel or of what it is compared with."""
    factors = [_factor(one) for one in gains]
    least, most = min(factors), max(factors)
    return least > DEAD and most < WRONG * least and (most < 1.0 / WRONG or least > WRONG)


def _units_off(other: str, groups: Sequence[Sequence[ConsistencyFinding]]) -> list[str]:
    """What to correct where each of these groups of gains is off by a factor against another channel.

    If it is about the same for several groups, it is that channel's, whatever the others show (strut pressures are not
    proportional to it); else it may be either's.
    """
    middle = np.array([np.median([_factor(one) for one in ones]) for ones in groups])
    gains = [f"gain {np.median([one.estimate for one in ones]):.4g}" for ones in groups]
    usual = np.abs(np.log(middle / np.median(middle))) < np.log(WRONG)
    if usual.sum() > 1:
        said = [f"{_channel_of(groups[k][0])} ({gains[k]})" for k in np.flatnonzero(usual).tolist()]
        return [f"{other}: {' and '.join(said)} disagree with it alike: correct its unit or factor {_AGAIN}"]
    wrong = f"its unit or factor, or that of {other}, is wrong: correct that one {_AGAIN}"
    names = [_channel_of(ones[0]) if len(ones) > 1 else ones[0].channel for ones in groups]
    return [f"{name}: {ones[0].check}: {g}: {wrong}" for name, ones, g in zip(names, groups, gains, strict=True)]


def _gain_off(one: ConsistencyFinding) -> str:
    """What to correct where a single gain is turned or off by a factor; empty where it is neither."""
    ratio, remedy = _factor(one), ""
    if abs(ratio) < DEAD:
        remedy = "it does not respond; mend the sensor"
    elif ratio < 0.0:
        remedy = f"turned; correct its sign {_AGAIN}"
    elif max(ratio, 1.0 / ratio) > WRONG:
        remedy = f"correct its unit or factor {_AGAIN}"
    return remedy and f"{one.channel}: {one.check}: gain {one.estimate:.4g}: {remedy}"


def check_campaign(machine: Machine, records: Sequence[xr.Dataset], sensors: str | None = None) -> CampaignCheck | None:
    """Check the measured records of this machine together; None if there is none.

    Axes of a displacement that is turned against the others are turned back first: they are errors of the record.
    Sensors, by name or file, are by default those that the machine file names, else as the records show them. Raises
    what `load_sensors` does.
    """
    own = (part_compared(r) for r in records if is_measured(r) and _of(machine, r))
    measured = [turned_displacement(r, machine)[1] for r in own]
    if not measured:
        return None
    plant, levels = make_plant(machine), noise_levels(measured)
    named = sensors or machine.sensors
    known: SensorSet | None = load_sensors(named) if named else None
    content, reason = None, ""
    try:
        content = measured_sensors(plant, measured, levels)
    except RecordError as error:
        reason = str(error)
        if levels.hidden:
            reason += "; record two seconds of rest before and after each test, when an earlier motion has settled"
            moving = restless(measured)
            reason += f" ({moving} moves on where all else rests)" if moving else ""
    used = make_sensors(content) if content else None
    if known and (levels.channels or levels.hidden):  # else the records are free of noise
        used = with_measured_noise(known, measured)
    findings = None if used is None else check_sensors(plant, measured, used)
    constant = frozenset[str]().union(*map(stated_constants, measured))
    present = [name for name in LAYOUT if all(name in r for r in measured)]
    return CampaignCheck(
        rate=levels.rate,
        rest=levels.seconds,
        source=levels.source,
        stated=known.name if known else "",
        noise=compare_noise(levels, known),
        findings=findings and tuple(one for one in findings if one.channel not in constant),
        observable=observable(machine, present),
        content=content,
        reason=reason,
    )


def contradicting_sensors(machine: Machine, records: Sequence[xr.Dataset]) -> tuple[str, ...]:
    """`CampaignCheck.contradictions` of records; none where these show no noise to compare by."""
    try:
        found = check_campaign(machine, records)
    except RecordError:
        return ()
    return found.contradictions if found else ()


def _of(machine: Machine, record: xr.Dataset) -> bool:
    labels = {"actuator": machine.actuator_names, "strut": machine.strut_names}
    known = ((record[dim], names) for dim, names in labels.items() if dim in record.coords)
    return all([str(x) for x in found.values] == list(names) for found, names in known)

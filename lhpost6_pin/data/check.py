"""Contents and faults of a record, as a list of findings.

Violations of the layout (`layout_faults`) are errors; values that a valid record may hold but a sound test does not
are warnings. Limits are relative to the record's own motion and resolution (its smallest step), not to a machine; the
few absolute ones only distinguish a forgotten unit from a real value.
"""

from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..core.arrays import Array, Mask
from ..core.errors import RecordError
from ..core.names import AXES
from ..machine.machine import Machine
from ..machine.recorded_changes import changes_summary
from .alignment import hydraulic_force
from .channels import LAYOUT, channel_name, channel_unit, column_units, columns_of, unit_doubt
from .conditioning import resolution
from .filled_samples import filled_samples, longest_measured, stated_constants
from .force_units import wrong_forces
from .layout_faults import RecordFinding, layout_faults
from .motion_pairs import GAIN_TOLERANCE, inconsistent_motion
from .records import open_record, sample_interval
from .repeated_columns import repeated_columns
from .served_samples import judged_samples, served_findings
from .signals import lowpass_zero_phase
from .turned_displacement import turned_displacement
from .turned_signs import turned_signs

__all__ = ["check_dataset", "check_record"]

_Warning = tuple[str, int | None, str, str]  # channel, sample, message, remedy

BESIDE = 1e-2  # of a channel's largest span, m and rad alike: what moves less in one unit is judged beside that
START = 2e-3  # of the largest span in the same unit: how far the first sample may be from rest
START_NOISE = 8.0  # and how many standard deviations of the noise
STILL = 2e-5  # of that span: a channel that moved by more each sample does not stop at once by itself
SPIKE_NOISE = 20.0  # standard deviations of the roughness: below this a spike and a kink look alike
SPIKE_EXACT = 1e-3  # of that span, in a record without noise: kinks of friction look like spikes of 1e-4
RESOLUTION_STEPS = 8  # as many of a channel's smallest steps count as movement
BEYOND = 1.2  # of a table's stated displacement: less may be an offset
UNRELATED, FOLLOWS = 0.5, 0.95  # correlations of force and pressures: below, noise or another actuator's; the same
MOVES = 0.5  # share of the largest variation of its kind from which a force must follow its pressures


def check_record(path: Path | str, machine: Machine | None = None) -> list[RecordFinding]:
    """Contents and faults of the record at `path`; an unreadable file is one error.

    With a `machine` the record must be of it; its forces are compared with piston areas times the chamber pressures,
    their signs with the acceleration of its mass, and their size with its weight and inertia.
    """
    try:
        return check_dataset(open_record(path), machine)
    except RecordError as error:
        return [RecordFinding("error", "", None, str(error))]


def check_dataset(dataset: xr.Dataset, machine: Machine | None = None) -> list[RecordFinding]:
    """List errors, then warnings, then the contents of a record in memory; see `check_record`."""
    errors = layout_faults(dataset, None if machine is None else machine.labels)
    broken = {finding.channel.split("[")[0] for finding in errors}
    contents = [RecordFinding("info", *fact) for fact in _contents(dataset)]
    known = [name for name in LAYOUT if name in dataset and not {name, *LAYOUT[name].dims} & broken]
    if "time" in broken or not known:
        return errors + contents  # signals cannot be judged on a broken time axis
    sound = dataset[[*known]].astype(float).assign_attrs(dataset.attrs)
    judged, stretch = judged_samples(dataset) & ~filled_samples(dataset), longest_measured(dataset)
    constant = stated_constants(dataset)
    columns = tuple(c for c in _columns(sound, known, judged) if not (_held(c, machine) or c.channel in constant))
    by_column = (_implausible_unit, _starts_in_motion, _saturated_spool, _frozen, _spike)
    as_recorded = sound = sound.isel(time=stretch)
    turned: list[RecordFinding] = []
    signs: list[RecordFinding] = []
    forces: list[RecordFinding] = []
    if not errors:
        turned, sound = turned_displacement(as_recorded, machine)
    if machine is not None and not errors:
        signs, forces = turned_signs(sound, machine), wrong_forces(sound, machine)
    warnings = chain(
        served_findings(dataset),
        repeated_columns(as_recorded),
        (warning for judge in by_column for c in columns if (warning := judge(c))),
        _odd_rates(sound),
        inconsistent_motion(sound),
        _beyond_table(as_recorded, machine),
        _inconsistent_forces(sound, machine),
        _floors_without_mass(sound, machine),
    )
    known_signs = {finding.channel for finding in signs}
    errors += turned + signs + [f for f in forces if f.severity == "error" and f.channel not in known_signs]
    units = [finding for finding in forces if finding.severity == "warning"]
    return errors + [RecordFinding("warning", *warning) for warning in warnings] + units + contents


def _beyond_table(dataset: xr.Dataset, machine: Machine | None) -> Iterator[_Warning]:
    """Displacements of the platen that the table cannot have."""
    if machine is None or "platen_displacement" not in dataset:
        return
    for k, x in enumerate(columns_of(dataset["platen_displacement"]).T):
        place, most = int(np.abs(x).argmax()), machine.limits.displacement[k]
        if 0.0 < BEYOND * most < abs(x[place]):
            channel = channel_name(dataset["platen_displacement"], k)
            what = f"is {x[place]:.4g}, {abs(x[place]) / most:.3g} times what {machine.name} can do, {most:.4g}"
            yield channel, place, what, "check its unit"


def _floors_without_mass(dataset: xr.Dataset, machine: Machine | None) -> Iterator[_Warning]:
    if machine is not None and not machine.floors and "floor_acceleration" in dataset:
        where = f"[floor.NAME] of {machine.name}'s file"
        yield "floor_acceleration", None, "is not used: the masses of these floors are not stated", f"add {where}"


# -------------------------------------------------------------------------------------------- contents
def _contents(dataset: xr.Dataset) -> Iterator[_Warning]:
    title = " ".join(str(dataset.attrs[key]) for key in ("kind", "test", "title") if key in dataset.attrs)
    count = dataset.sizes.get("time", 0)
    time = dataset["time"] if "time" in dataset.variables else xr.DataArray(np.nan)
    if time.dims == ("time",) and count > 1 and time.dtype.kind in "fiu":
        length = float(time[-1] - time[0])
        span = f"{count} samples, {length:g} s, {(count - 1) / length if length else np.nan:.6g} Hz"
        yield "", None, f"{title}: {span}".lstrip(": "), ""
    yield from (("", None, sentence, "") for sentence in changes_summary(dataset.attrs))
    for name, variable in dataset.data_vars.items():
        if variable.dtype.kind in "fiu" and variable.size and np.isfinite(variable).any():
            yield from _extents(variable, "" if name in LAYOUT else ", a further channel")
    for job in sorted({job for channel in LAYOUT.values() for job in channel.needed_by}):
        missing = [name for name, it in LAYOUT.items() if job in it.needed_by and not _given(dataset, name)]
        if missing:
            yield "", None, f"{job} is not possible without {', '.join(missing)}", ""


def _extents(variable: xr.DataArray, further: str) -> Iterator[_Warning]:
    """Shape and range of a variable, of its columns of each unit apart."""
    units = str(variable.attrs.get("units", "no units"))
    several = "," in units or "column_units" in variable.attrs
    if variable.ndim != 2 or not several or variable.dims[1] not in variable.coords:
        parts = [(str(variable.name), units, variable.values)]
    else:
        names = [str(label) for label in variable[variable.dims[1]].values]
        each, parts = column_units(variable), []
        for unit in dict.fromkeys(each):
            own = [k for k, other in enumerate(each) if other == unit]
            label = f"{variable.name}[{', '.join(names[k] for k in own)}]"
            parts.append((label, unit, variable.values[:, own]))
    for label, unit, values in parts:
        extent = f"{np.nanmin(values):.6g} to {np.nanmax(values):.6g}"
        yield label, None, f"{unit}, {' x '.join(map(str, values.shape))}, {extent}{further}", ""


def _given(dataset: xr.Dataset, name: str) -> bool:
    """Whether a record has a channel, or one that takes its place in the wrench."""
    return name in dataset or any(it.replaces == name and other in dataset for other, it in LAYOUT.items())


# -------------------------------------------------------------------------------------------- values
class _Column(NamedTuple):
    """One column of a channel, with the largest span of the columns in the same unit, or `BESIDE` that of all."""

    channel: str
    x: Array  # (n,)
    span: float
    measured: bool
    judged: Mask  # (n,) samples that show a sensor

    @property
    def is_command(self) -> bool:
        """Whether it is no sensor's: it may hold still or jump."""
        return LAYOUT[self.channel.split("[")[0]].role == "command"

    @property
    def is_rate(self) -> bool:
        """Whether it is a velocity or an acceleration: zero at rest wherever that is."""
        return "/" in channel_unit(self.channel)


def _columns(dataset: xr.Dataset, names: Iterable[str], judged: Mask) -> Iterator[_Column]:
    measured = dataset.attrs.get("kind") == "measured"
    for variable in (dataset[name] for name in names if name in dataset):
        values = columns_of(variable)
        spans = np.ptp(values, axis=0)
        for k, x in enumerate(values.T):
            alike = spans[3 * (k // 3) :][:3] if "axis" in variable.dims else spans
            yield _Column(channel_name(variable, k), x, float(max(alike.max(), BESIDE * spans.max())), measured, judged)


def _held(c: _Column, machine: Machine | None) -> bool:
    """Whether it is zero along an axis in which the guides hold the platen: not measured, and nothing to judge."""
    label = c.channel.rstrip("]").partition("[")[2]
    return machine is not None and label in AXES and label not in machine.axis_names and not c.x.any()


def _implausible_unit(c: _Column) -> _Warning | None:
    size = np.abs(c.x)
    doubt = unit_doubt(c.channel, float(size.max()))
    return (c.channel, int(size.argmax()), doubt, "convert to SI") if doubt else None


def _starts_in_motion(c: _Column) -> _Warning | None:
    noise = 1.4826 * float(np.median(np.abs(np.diff(c.x, n=3)))) if len(c.x) > 3 else 0.0  # motion cancels
    start, soon = (float(np.median(part)) for part in (c.x[:8], c.x[:64]))  # the very first bears a filter's edge
    moves = channel_unit(c.channel)[0] in "mr" and np.ptp(c.x) > 0
    least = START * c.span + START_NOISE * noise + 2 * resolution(c.x[c.judged])
    if not (moves and abs(start) > least):
        return None
    if abs(soon - start) > least or c.is_rate:
        remedy = "begin the record before the motion" + "; if it was at rest there, subtract the offset" * c.is_rate
        return c.channel, 0, f"starts at {start:.4g} (median of eight samples), not at rest", remedy
    remedy = "right if the table rested there, parked or held; else an offset: subtract it"
    return None if c.is_command else (c.channel, 0, f"rests at {start:.4g} at the start, not at zero", remedy)


def _saturated_spool(c: _Column) -> _Warning | None:
    full = np.abs(c.x) >= 0.999
    if channel_unit(c.channel) != "1" or not full.any() or _implausible_unit(c):
        return None
    what = f"is {'beyond' if np.abs(c.x).max() > 1.001 else 'at'} the end of its stroke in {full.sum()} samples"
    return c.channel, int(full.argmax()), what, "reduce the scale of the test"


def _frozen(c: _Column) -> _Warning | None:
    """First run of one value into which a moving channel falls."""
    x = c.x
    if c.is_command:
        return None
    if np.ptp(x) == 0:
        what = f"is constant at {x[0]:.4g}"
        return (c.channel, 0, what, "check the sensor, or omit the channel") if c.measured else None
    starts = np.concatenate([[0], np.flatnonzero(np.diff(x)) + 1])
    lengths = np.diff(starts, append=len(x))
    moved = max(RESOLUTION_STEPS * resolution(x[c.judged]), STILL * c.span)
    extreme = (x[starts] == x.max()) | (x[starts] == x.min())
    shown = np.add.reduceat(c.judged.astype(int), starts)  # samples of each run in which a sensor shows
    for k in np.flatnonzero(shown >= np.maximum(np.where(extreme, 4, 8), 5 * np.median(lengths))):
        start, count = int(starts[k]), int(lengths[k])
        before = np.abs(np.diff(x[max(start - 4, 0) : start]))
        if start > 0 and len(before) and np.mean(before) > moved:
            what = f"is {'clipped' if extreme[k] else 'stuck'} at {x[start]:.4g} for {count} samples"
            return c.channel, start, what, "check the sensor's range"
    return None


def _spike(c: _Column) -> _Warning | None:
    """First single sample off the smooth curve through its neighbours, but for three at either end."""
    from scipy.ndimage import maximum_filter1d

    if c.is_command or len(c.x) < 64:
        return None
    taps = np.array([-1.0, 6.0, -15.0, 20.0, -15.0, 6.0, -1.0]) / 20  # x less its sixth-order interpolation
    rough = np.convolve(np.pad(c.x, 3, "reflect", reflect_type="odd"), taps, mode="valid")
    size = np.abs(rough)
    beside = maximum_filter1d(np.stack([np.roll(size, s) for s in (-10, 10)]), 13, axis=1).max(axis=0)
    floor = STILL if c.measured else SPIKE_EXACT
    least = max(SPIKE_NOISE * 1.4826 * np.median(size), RESOLUTION_STEPS * resolution(c.x[c.judged]), floor * c.span)
    for k in np.flatnonzero(((size > 4 * beside) & (size > least))[3:-3]) + 3:
        if not c.judged[k - 3 : k + 4].all():
            continue
        alone = rough[k] * taps  # the response to a lone sample; that to a step or a kink differs
        if np.sum((rough[k - 3 : k + 4] - alone) ** 2) < 0.01 * np.sum(alone**2):
            return c.channel, int(k), f"is {rough[k]:+.4g} off its neighbours for one sample", "interpolate it"
    return None


# -------------------------------------------------------------------------------------------- sampling
def _odd_rates(dataset: xr.Dataset) -> Iterator[_Warning]:
    from scipy.signal import welch

    count, rate = dataset.sizes["time"], 1 / sample_interval(dataset)
    if not 200 <= rate <= 1e5:
        what = f"runs at {rate:g} Hz; 256 to 8192 Hz are usual"
        yield "time", None, what, "record faster, or check the unit of time" if rate < 200 else "check the unit of time"
    if count < 256:
        return
    every = np.ones(count, bool)
    for channel, x, span, *_ in _columns(dataset, ("platen_acceleration", "actuator_force"), every):
        f, power = welch(x - x.mean(), rate, nperseg=256)
        top = float(power[f > 0.4 * rate].sum() / power.sum()) if power.sum() > 0 else 0.0
        if top > 0.05 and np.ptp(x) > max(0.05 * span, 100 * resolution(x)):
            what = f"has {100 * top:.0f} % of its power near half the sampling rate"
            yield channel, None, what, "check the anti-aliasing filter"


# -------------------------------------------------------------------------------------------- consistency
def _inconsistent_forces(dataset: xr.Dataset, machine: Machine | None) -> Iterator[_Warning]:
    """Compare forces with the chamber pressures where these vary beyond noise.

    Noise in pressures lowers the gain by regression on them, noise in the force raises that by regression on it: the
    gain lies between both (Frisch's bounds).
    """
    if machine is None or not {"actuator_force", "chamber_pressure_a"} <= set(dataset.data_vars):
        return
    dt = sample_interval(dataset)
    cutoff, kinds = min(20.0, 0.2 / dt), [(a.area_a, a.area_b) for a in machine.actuators]
    forces = dataset["actuator_force"].values, hydraulic_force(machine, dataset)  # NaN where a pressure is missing
    found, expected = (lowpass_zero_phase(x - x.mean(axis=0), dt, cutoff) for x in forces)
    sd_found, sd = np.std(found, axis=0), np.std(expected, axis=0)
    product = sd_found * sd
    match = np.divide(np.mean(found * expected, axis=0), product, out=np.zeros_like(sd), where=product > 0)
    for k, actuator in enumerate(machine.actuators):
        r, ratio = float(match[k]), float(sd_found[k] / (sd[k] or np.inf))
        if abs(r) < UNRELATED:
            sure = [sd[j] for j, kind in enumerate(kinds) if kind == kinds[k] and abs(match[j]) >= FOLLOWS]
            if not (sure and sd[k] >= MOVES * max(sure)):
                continue  # unknown, or noise for the most part
            what = f"does not follow P_A A_1 - P_B A_2: their correlation is {r:.2f}"
        elif r * ratio > 1 + GAIN_TOLERANCE or ratio / r < 1 - GAIN_TOLERANCE:
            what = f"is {r * ratio:.3g} times P_A A_1 - P_B A_2"
        else:
            continue
        yield f"actuator_force[{actuator.name}]", None, what, "check unit and sign of force and pressures"

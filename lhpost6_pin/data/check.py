"""What is in a record and what is wrong with it, as a list of findings.

What breaks the layout (`layout_faults`) is an error; values that a valid record may hold but a sound test
does not are warnings. Limits are relative to the record's own motion and resolution (its smallest step), not
to a machine; the few absolute ones only tell a forgotten unit from a real value.
"""

from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..core.errors import RecordError
from .channels import LAYOUT, MOTION, channel_name, channel_unit
from .layout_faults import RecordFinding, layout_faults
from .records import open_record, sample_interval
from .signals import differentiate, lowpass_zero_phase

__all__ = ["check_dataset", "check_record"]

Array = NDArray[np.float64]
_Warning = tuple[str, int | None, str, str]  # channel, sample, message, remedy

START = 2e-3  # of the largest span in the same unit: how far the first sample may be from rest
START_NOISE = 8.0  # and how many standard deviations of the noise
STILL = 2e-5  # of that span: a channel that moved by more each sample does not stop dead by itself
SPIKE_NOISE = 20.0  # standard deviations of the roughness: below this a spike cannot be told from a kink
RESOLUTION_STEPS = 8  # as many of a channel's smallest steps count as movement
NEARLY_STILL = 0.1  # share of the variation of others of its kind below which a channel says nothing of its gain
GAIN_TOLERANCE = 0.1  # between a channel and the derivative of another; calibration errors are far smaller
LIKE_AXES = tuple((j, k) for k in range(6) for j in range(6) if j // 3 == k // 3)  # of one unit
USUAL_FACTORS = {  # gain of a channel over what it should be -> likely reason
    -1.0: "opposite signs",
    1 / 9.80665: "in g",
    1e3: "in mm",
    1 / 0.0254: "in inches",
    180 / np.pi: "in degrees",
    1e-3: "the other in mm",
    0.0254: "the other in inches",
    np.pi / 180: "the other in degrees",
}
LIKELY_UNITS = {  # unit: least and greatest believable peak, and what lies outside
    "m": (0.0, 3.0, "mm or in for m"),
    "rad": (0.0, 1.0, "deg for rad"),
    "Pa": (1e5, 2e8, "MPa, bar or psi for Pa"),
    "1": (0.0, 1.2, "V or % for the share of full stroke"),
}


def check_record(path: Path | str, areas: Mapping[str, tuple[float, float]] | None = None) -> list[RecordFinding]:
    """List what is in the record at `path` and what is wrong with it; an unreadable file is one error.

    `areas` are the piston areas (A_1, A_2) [m²] by actuator; with them forces are compared with pressures.
    """
    try:
        return check_dataset(open_record(path), areas)
    except RecordError as error:
        return [RecordFinding("error", "", None, str(error))]


def check_dataset(dataset: xr.Dataset, areas: Mapping[str, tuple[float, float]] | None = None) -> list[RecordFinding]:
    """List errors, then warnings, then the contents of a record in memory; see `check_record`."""
    errors = layout_faults(dataset)
    broken = {finding.channel.split("[")[0] for finding in errors}
    contents = [RecordFinding("info", *fact) for fact in _contents(dataset)]
    known = [name for name in LAYOUT if name in dataset and not {name, *LAYOUT[name].dims} & broken]
    if "time" in broken or not known:
        return errors + contents  # nothing can be said about signals on a broken time axis
    sound = dataset[[*known]].astype(float).assign_attrs(dataset.attrs)
    faults = chain(
        _unlikely_units(sound),
        _unquiet_start(sound),
        _saturated_spools(sound),
        _frozen(sound),
        _spikes(sound),
        _odd_rates(sound),
        _inconsistent_motion(sound),
        _inconsistent_forces(sound, areas or {}),
    )
    return errors + [RecordFinding("warning", *fault) for fault in faults] + contents


# -------------------------------------------------------------------------------------------- contents
def _contents(dataset: xr.Dataset) -> Iterator[_Warning]:
    title = " ".join(str(dataset.attrs[key]) for key in ("kind", "test", "title") if key in dataset.attrs)
    count = dataset.sizes.get("time", 0)
    time = dataset["time"] if "time" in dataset.variables else xr.DataArray(np.nan)
    if time.dims == ("time",) and count > 1 and time.dtype.kind in "fiu":
        length = float(time[-1] - time[0])
        span = f"{count} samples, {length:g} s, {(count - 1) / length if length else np.nan:.6g} Hz"
        yield "", None, f"{title}: {span}".lstrip(": "), ""
    for name, variable in dataset.data_vars.items():
        if variable.dtype.kind in "fiu" and variable.size and np.isfinite(variable).any():
            extent = f"{float(variable.min()):.6g} to {float(variable.max()):.6g}"
            units = variable.attrs.get("units", "no units")
            further = "" if name in LAYOUT else ", not of the layout"
            yield str(name), None, f"{units}, {' x '.join(map(str, variable.shape))}, {extent}{further}", ""
    for job in sorted({job for channel in LAYOUT.values() for job in channel.needed_by}):
        missing = [name for name, it in LAYOUT.items() if job in it.needed_by and name not in dataset]
        if missing:
            yield "", None, f"{job} is not possible without {', '.join(missing)}", ""


# -------------------------------------------------------------------------------------------- values
def _columns(dataset: xr.Dataset, *names: str) -> Iterator[tuple[str, Array, float]]:
    """Yield every column of the named variables with its name and the largest span in the same unit."""
    for name in names or tuple(map(str, dataset.data_vars)):
        if name in dataset:
            values = dataset[name].values.reshape(dataset.sizes["time"], -1)
            spans = np.ptp(values, axis=0)
            for k, x in enumerate(values.T):
                first = 3 * (k // 3) if "axis" in dataset[name].dims else 0
                alike = spans[first : first + 3] if "axis" in dataset[name].dims else spans
                yield channel_name(dataset[name], k), x, float(max(alike.max(), 1e-6 * spans.max()))


def _is_command(channel: str) -> bool:
    """Whether a column is no sensor's: it may hold still or jump."""
    return LAYOUT[channel.split("[")[0]].role == "command"


def _resolution(x: Array) -> float:
    """Smallest step of a channel: its digital resolution, or nearly nothing for a computed one."""
    steps = np.abs(np.diff(x))
    return float(steps[steps > 0].min(initial=np.inf))


def _unlikely_units(dataset: xr.Dataset) -> Iterator[_Warning]:
    for channel, x, _ in _columns(dataset):
        least, most, guess = LIKELY_UNITS.get(channel_unit(channel), (0.0, np.inf, ""))
        peak = float(np.abs(x).max())
        if not least <= peak <= most:
            yield channel, int(np.abs(x).argmax()), f"reaches {peak:.4g}: {guess}?", "convert to SI"


def _unquiet_start(dataset: xr.Dataset) -> Iterator[_Warning]:
    for channel, x, span in _columns(dataset, *(n for n, c in LAYOUT.items() if c.units.startswith("m"))):
        noise = 1.4826 * float(np.median(np.abs(np.diff(x, n=3)))) if len(x) > 3 else 0.0  # motion cancels
        start = float(np.median(x[:8]))  # the very first sample bears the filter's edge
        if np.ptp(x) > 0 and abs(start) > START * span + START_NOISE * noise + 2 * _resolution(x):
            what = f"starts at {start:.4g}, not at rest in the zero pose"
            yield channel, 0, what, "begin the record before the motion; take out the offset"


def _saturated_spools(dataset: xr.Dataset) -> Iterator[_Warning]:
    for channel, x, _ in _columns(dataset, *(n for n, c in LAYOUT.items() if c.units == "1")):
        full = np.abs(x) >= 0.999
        if full.any():
            beyond = "beyond" if np.abs(x).max() > 1.001 else "at"
            yield (
                channel,
                int(full.argmax()),
                f"is {beyond} the stroke's end in {full.sum()} samples",
                "scale the test down",
            )


def _frozen(dataset: xr.Dataset) -> Iterator[_Warning]:
    """Find runs of one and the same value into which a moving channel falls."""
    for channel, x, span in _columns(dataset):
        if _is_command(channel):
            continue
        if np.ptp(x) == 0:
            if dataset.attrs.get("kind") == "measured":
                yield channel, 0, f"is {x[0]:.4g} throughout", "check the sensor; leave the channel out"
            continue
        starts = np.concatenate([[0], np.flatnonzero(np.diff(x)) + 1])
        lengths = np.diff(starts, append=len(x))
        moved = max(RESOLUTION_STEPS * _resolution(x), STILL * span)
        extreme = (x[starts] == x.max()) | (x[starts] == x.min())
        for k in np.flatnonzero(lengths >= np.maximum(np.where(extreme, 4, 8), 5 * np.median(lengths))):
            start, end = int(starts[k]), int(starts[k] + lengths[k])
            before = np.abs(np.diff(x[max(start - 4, 0) : start]))
            if start > 0 and (np.mean(before) if len(before) else 0.0) > moved:
                what = "clipped" if extreme[k] else "stuck"
                yield (
                    channel,
                    start,
                    f"is {what} at {x[start]:.4g} for {end - start} samples",
                    "check the sensor's range",
                )
                break


def _spikes(dataset: xr.Dataset) -> Iterator[_Warning]:
    """Find single samples off the smooth curve through their neighbours, but for three at either end."""
    from scipy.ndimage import maximum_filter1d

    taps = np.array([-1.0, 6.0, -15.0, 20.0, -15.0, 6.0, -1.0]) / 20  # x less its sixth-order interpolation
    for channel, x, span in _columns(dataset):
        if _is_command(channel) or len(x) < 64:
            continue
        rough = np.convolve(np.pad(x, 3, "reflect", reflect_type="odd"), taps, mode="valid")
        size = np.abs(rough)
        beside = maximum_filter1d(np.stack([np.roll(size, s) for s in (-10, 10)]), 13, axis=1).max(axis=0)
        least = max(SPIKE_NOISE * 1.4826 * np.median(size), RESOLUTION_STEPS * _resolution(x), STILL * span)
        for k in np.flatnonzero(((size > 4 * beside) & (size > least))[3:-3]) + 3:
            alone = rough[k] * taps  # what a lone sample leaves; a step or a kink leaves something else
            if np.sum((rough[k - 3 : k + 4] - alone) ** 2) < 0.01 * np.sum(alone**2):
                yield (
                    channel,
                    int(k),
                    f"is {rough[k]:+.4g} off its neighbours for one sample",
                    "interpolate it",
                )
                break


# -------------------------------------------------------------------------------------------- sampling
def _odd_rates(dataset: xr.Dataset) -> Iterator[_Warning]:
    from scipy.signal import welch

    count, rate = dataset.sizes["time"], 1 / sample_interval(dataset)
    if not 200 <= rate <= 1e5:
        yield (
            "time",
            None,
            f"runs at {rate:g} Hz; 256 to 8192 Hz are usual",
            "record faster or check the time's unit",
        )
    if count < 256:
        return
    for channel, x, span in _columns(dataset, "platen_acceleration", "actuator_force"):
        f, power = welch(x - x.mean(), rate, nperseg=256)
        top = float(power[f > 0.4 * rate].sum() / power.sum()) if power.sum() > 0 else 0.0
        if top > 0.05 and np.ptp(x) > max(0.05 * span, 100 * _resolution(x)):
            yield (
                channel,
                None,
                f"has {100 * top:.0f} % of its power near half the sampling rate",
                "it may be aliased",
            )


# -------------------------------------------------------------------------------------------- consistency
def _inconsistent_motion(dataset: xr.Dataset) -> Iterator[_Warning]:
    """Compare each of displacement, velocity and acceleration with the derivative of those before it."""
    dt = sample_interval(dataset)
    if dataset.sizes["time"] < 256 or dataset.sizes["time"] * dt < 2:
        return
    cutoff = min(40.0, 0.2 / dt)
    for low, high in ((0, 1), (1, 2), (0, 2)):
        if not {MOTION[low], MOTION[high]} <= set(dataset.data_vars):
            continue
        expected = dataset[MOTION[low]].values
        for _ in range(high - low):
            expected = differentiate(expected, dt, cutoff)
        found = lowpass_zero_phase(dataset[MOTION[high]].values, dt, cutoff)
        gains = {(j, k): _coherent_gain(expected[:, j], found[:, k], dt) for j, k in LIKE_AXES}
        for (j, k), gain in gains.items():
            right = gain is not None and abs(gain - 1) <= GAIN_TOLERANCE
            place, source = channel_name(dataset[MOTION[high]], k), channel_name(dataset[MOTION[low]], j)
            if j == k and gain is not None and not right:
                reason = next((f" ({why}?)" for g, why in USUAL_FACTORS.items() if abs(gain / g - 1) < 0.1), "")
                yield (
                    place,
                    None,
                    f"is {gain:.3g} times that derived from {source}{reason}",
                    "check unit and sign",
                )
            elif j != k and right and gains[k, k] is None:
                yield place, None, f"is the derivative of {source}", "the two channels may be swapped"


def _coherent_gain(expected: Array, found: Array, dt: float) -> float | None:
    """Median real gain found / expected where the two are coherent; None if that is almost nowhere."""
    from scipy.signal import csd, welch

    each = {"fs": 1 / dt, "nperseg": int(min(len(found) // 4, round(2 / dt)))}
    f, cross = csd(expected, found, **each)
    ours, theirs = welch(expected, **each)[1], welch(found, **each)[1]
    band = (f > 0) & (f < 20) & (ours > 1e-4 * ours.max()) & (np.abs(cross) ** 2 > 0.95 * ours * theirs)
    return float(np.median((cross[band] / ours[band]).real)) if band.sum() >= 5 else None


def _inconsistent_forces(dataset: xr.Dataset, areas: Mapping[str, tuple[float, float]]) -> Iterator[_Warning]:
    if not {"actuator_force", "chamber_pressure_a"} <= set(dataset.data_vars):
        return
    expected = {}
    for name in (str(n) for n in dataset["actuator"].values if str(n) in areas):
        force = areas[name][0] * dataset["chamber_pressure_a"].sel(actuator=name).values
        if "chamber_pressure_b" in dataset and name in dataset["horizontal"].values:
            force = force - areas[name][1] * dataset["chamber_pressure_b"].sel(horizontal=name).values
        expected[name] = force - force.mean()
    for name, varying in expected.items():
        alike = [np.std(force) for other, force in expected.items() if areas[other] == areas[name]]
        if np.std(varying) < NEARLY_STILL * max(alike):
            continue  # noise, for the most part
        found = dataset["actuator_force"].sel(actuator=name).values
        moving = found - found.mean()
        error = float(np.std(moving - varying) / (np.std(varying) or np.inf))
        gain = float(moving @ varying / (varying @ varying or np.inf))
        if error > GAIN_TOLERANCE and abs(gain - 1.0) > GAIN_TOLERANCE:  # with a right gain the rest is noise
            what = f"is {gain:.3g} times P_A A_1 - P_B A_2, {100 * error:.0f} % off"
            yield f"actuator_force[{name}]", None, what, "check unit and sign of force and pressures"

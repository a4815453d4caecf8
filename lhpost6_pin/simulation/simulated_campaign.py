"""Simulated campaigns: tests rehearsed in closed loop and recorded through sensors.

The tests of `models/procedures/campaign.toml` are rehearsed in closed loop, and every channel passes through a sensor
with skew, gain and offset, low-pass, noise and resolution. The true errors are attributes of each record, which
calibration does not read.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from ..control import ControllerSettings, controlled
from ..core.arrays import Array
from ..core.errors import OutOfRangeError, SimulationError, UnknownNameError
from ..core.files import models_folder
from ..core.names import SAMPLE_RATE
from ..core.progress import Progress
from ..core.rounding import rounded_down
from ..data.accelerometers import with_platen_acceleration
from ..data.campaign import Campaign
from ..data.channels import LAYOUT, sensor_groups
from ..data.sensors import SensorSet, add_noise
from ..data.signals import align
from ..machine.machine import Machine
from ..machine.parameters import Parameters, load_parameters
from ..mechanics.plant import make_plant
from ..mechanics.pose import PlatenMotion
from ..motions import Target, find_motion, make_target
from .motion_limits import FLOW, check_motion_limits, fitting_scale, flow_remedies
from .outputs import record_of_run
from .simulate import ClosedLoop, fastest_engine, simulate
from .trouble import with_pressure_trouble

__all__ = ["SensorErrors", "as_sensed", "check_campaign", "draw_errors", "load_procedure", "simulate_campaign"]
__all__ += ["tests_of"]

AT_REST = 1e-3
"""Share of a target's largest velocity up to which it counts as at rest."""


class SensorErrors(NamedTuple):
    """measured(t) = (1 + gain) true(t - delay) + offset: gain and offset by channel (columns,), delay [s] by group."""

    gain: Mapping[str, Array]
    offset: Mapping[str, Array]
    delay: Mapping[str, float]


def check_campaign(
    machine: Machine, *, tests: Sequence[str] | None = None, scale: float = 1.0, procedure: str = "campaign"
) -> None:
    """Compare the tests of a procedure (or some of them) with the limits of the machine, each as far as it is run.

    Raises OutOfRangeError that names every test beyond them with the limits exceeded, and the largest scale of the
    campaign, three digits, with which all of its tests fit; where the flow of valves is exceeded, also the scales of
    the campaign with `flow_remedies`. UnknownNameError as `simulate_campaign`.
    """
    numbers, plant = load_procedure(procedure), make_plant(machine)
    clauses: list[str] = []
    exceeded: list[str] = []
    fits = float("inf")
    for test in _chosen(numbers, tests):
        try:
            target = _as_run(numbers, test, _target(numbers, test, machine, scale))
            check_motion_limits(plant, target, remedies=False)  # their scales would be those of a motion
        except OutOfRangeError as error:
            if not error.largest_scale:  # no scale mends it: held axes, a specimen that is not borne at rest
                raise
            clauses.append(f"{test}: {error}")
            exceeded += [quantity for quantity in error.exceeded if quantity not in exceeded]
            fits = min(fits, error.largest_scale / _own_scale(numbers, test))
    if clauses:
        fits = _three_digits(fits)
        clauses.append(f"The largest scale of the campaign with which all of these tests fit is {fits:g}")
        for remedy in flow_remedies(machine) if FLOW in exceeded else ():
            more = _campaign_scale(numbers, _chosen(numbers, tests), remedy.machine)
            if more > fits:  # else other limits govern
                clauses.append(f"{remedy.words} the largest scale of the campaign is {more:g}")
        raise OutOfRangeError(". ".join(clauses), fits, tuple(exceeded))


def _campaign_scale(numbers: Parameters, tests: Sequence[str], machine: Machine) -> float:
    """Largest scale of the campaign, three digits, with which all of its tests fit."""
    plant = make_plant(machine)
    targets = {test: _as_run(numbers, test, _target(numbers, test, machine, 1.0)) for test in tests}
    return _three_digits(min(fitting_scale(plant, one) / _own_scale(numbers, test) for test, one in targets.items()))


def _three_digits(scale: float) -> float:
    """Rounded down; a quotient of three digits each is exact but for rounding."""
    return rounded_down((1.0 + 1e-9) * scale, 3)


def simulate_campaign(
    machine: Machine,
    settings: ControllerSettings,
    sensors: SensorSet,
    *,
    seed: int,
    errors: bool = True,
    scale: float = 1.0,
    tests: tuple[str, ...] | None = None,
    name: str = "simulated",
    procedure: str = "campaign",
    attrs: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Campaign:
    """Rehearse the tests of a procedure of `models/procedures` (or some of them), recorded through the sensors.

    scale is a factor on all motions; errors draws calibration errors within the ranges of the sensors, the same for all
    tests; attrs are added to those of every record. Deterministic for a seed. Tests beyond the limits of the machine
    are run, too (`check_campaign`).

    A test that becomes unphysical is a warning, and `trouble` of its record. Raises SimulationError if one stops early,
    UnknownNameError for a test that the file does not have.
    """
    numbers = load_procedure(procedure)
    rng = np.random.default_rng(seed)
    chosen = _chosen(numbers, tests)
    plant, rest, controller = controlled(machine, settings)
    drawn: SensorErrors | None = None
    records = []
    for i, test in enumerate(chosen):
        target = _target(numbers, test, machine, scale)
        kept = _as_run(numbers, test, target)
        samples, motion = len(kept.time), PlatenMotion(kept.displacement, kept.velocity, kept.acceleration)
        loop = ClosedLoop(controller, controller.drive_for(*motion), rest)
        run = simulate(plant, loop, samples=samples, engine=fastest_engine(plant), label=test)
        if run.trouble:
            raise SimulationError(f"{test}: {run.trouble}")
        facts = {
            "test": test,
            "title": f"{name}, {test}",
            "controller": settings.name,
            "motion": str(numbers.words[f"{test}.motion"]),
            **(attrs or {}),
        }
        if samples < len(target.time) and _moves(target, samples - 1):
            facts["cut"] = f"ends in motion: the first {samples / SAMPLE_RATE:g} s of {target.time[-1]:.3g} s"
        record = record_of_run(with_pressure_trouble(run, test), facts, motion)
        if machine.accelerometers:  # they are what is measured
            record = record.drop_vars("platen_acceleration")
        if drawn is None:
            drawn = draw_errors(record, sensors, rng) if errors else SensorErrors({}, {}, {})
        record = as_sensed(record, sensors, drawn, numbers.number("recording.rate"), rng)
        records.append(with_platen_acceleration(plant, record) if machine.accelerometers else record)
        if progress is not None:
            progress((i + 1) / len(chosen))
    return Campaign(name, tuple(records))


def _chosen(numbers: Parameters, tests: Sequence[str] | None) -> Sequence[str]:
    """The tests, all of the procedure by default; raises UnknownNameError for one that it does not have."""
    known = tests_of(numbers)
    for test in tests or ():
        if test not in known:
            raise UnknownNameError("test of a campaign", test, known)
    return tests or known


def _as_run(numbers: Parameters, test: str, target: Target) -> Target:
    """The part of a test's target that is run."""
    n = min(len(target.time), round(numbers.number(f"{test}.seconds") * SAMPLE_RATE))
    rows = {name: getattr(target, name)[:n] for name in ("time", "displacement", "velocity", "acceleration")}
    return replace(target, **rows)


def _own_scale(numbers: Parameters, test: str) -> float:
    """Scale of a test's motion in a campaign of scale 1."""
    return numbers.number(f"{test}.scale") if f"{test}.scale" in numbers else 1.0


def _moves(target: Target, sample: int) -> bool:
    """Whether a target moves at a sample: a simulated test that ends there has no rest after it."""
    speed = np.abs(target.velocity)
    return bool(np.any(speed[sample] > AT_REST * speed.max(axis=0)))


def load_procedure(name: str) -> Parameters:
    """Tests of a procedure of `models/procedures`."""
    return load_parameters(models_folder() / "procedures" / f"{name}.toml")


def tests_of(procedure: Parameters) -> tuple[str, ...]:
    """Names of a procedure's tests."""
    return tuple(path.split(".")[0] for path in procedure.words if path.endswith(".motion"))


def _target(numbers: Parameters, test: str, machine: Machine, factor: float) -> Target:
    """Target of a test; keys of its section other than motion, scale and seconds are options of the motion."""
    options: dict[str, Any] = {}
    for path in (*numbers, *numbers.words):
        section, _, key = path.partition(".")
        if section == test and key not in ("motion", "scale", "seconds"):
            word = numbers.words.get(path)
            options[key] = numbers.number(path) if word is None else bool(word) if isinstance(word, int) else word
    motion = find_motion(str(numbers.words[f"{test}.motion"]), **options)
    scale = factor * _own_scale(numbers, test)
    own = None if machine.motion == "free" else machine.motion
    if own and motion.axes and not set(own) & set(motion.axes):  # held by the guides: move a free one
        own = f"{own[0]}={motion.axes[0]}"
    return make_target(motion, scale=scale, axes=own, rate=float(SAMPLE_RATE), warn=False)


def draw_errors(record: xr.Dataset, sensors: SensorSet, rng: np.random.Generator) -> SensorErrors:
    """Calibration errors of a record's channels and delays of all groups, uniform within the sensors' ranges."""
    gain, offset = (
        {
            channel: rng.uniform(-most, most, record[channel].shape[1:] or (1,))
            for channel, most in ranges.items()
            if channel in record
        }
        for ranges in (sensors.gain_range, sensors.offset_range)
    )
    delay = {group: float(rng.uniform(-most, most)) for group, most in sensors.delay_range.items()}
    return SensorErrors(gain, offset, delay)


def _at_instants(means: Array) -> Array:
    """Values (n, k) at the start of every sample from the means over samples (n, k), exact for cubics.

    The mean of two neighbours, used at either end, loses 0.14 % of a motion of 30 Hz: as much as a lag of 0.3 ms does.
    """
    values = 0.5 * (means + np.vstack([means[:1], means[:-1]]))
    values[2:-1] = (7.0 * (means[1:-2] + means[2:-1]) - means[:-3] - means[3:]) / 12.0
    return values


def as_sensed(
    record: xr.Dataset, sensors: SensorSet, errors: SensorErrors, rate: float, rng: np.random.Generator
) -> xr.Dataset:
    """A run's record through sensors: skewed, low-passed, sampled at `rate` [Hz], scaled, offset, noisy.

    Spools and their commands, in a run the mean over the following sample, are first interpolated to the instant of
    the sample. Hidden states and specimen joints are omitted; the errors become attributes (`true_gain_...`).
    """
    dt = float(record["time"][1] - record["time"][0])
    every = round(1.0 / (rate * dt))
    channels: dict[str, Any] = {}
    group_of = {channel: group for group, members in sensor_groups().items() for channel in members}
    for name in map(str, record.data_vars):
        if name.startswith(("hidden_", "specimen_")):
            continue
        values = record[name].values.astype(float)
        if name in LAYOUT and LAYOUT[name].held:
            values = _at_instants(values)
        delay = errors.delay.get(group_of.get(name, ""), 0.0)
        if delay:
            values = align(values, -delay, dt)
        if name in sensors.noise:
            values = sensors.band.apply(values, dt)
        values = values[::every] * (1.0 + errors.gain.get(name, 0.0)) + errors.offset.get(name, 0.0)
        channels[name] = (record[name].dims, values, record[name].attrs)
    dims = {dim for own, _, _ in channels.values() for dim in own}
    coords = {n: c.values for n, c in record.coords.items() if n != "time" and set(c.dims) <= dims}
    coords["time"] = ("time", record["time"].values[::every], record["time"].attrs)
    true: dict[str, Any] = {f"true_delay_{g}": d for g, d in errors.delay.items()}
    for what, table in (("gain", errors.gain), ("offset", errors.offset)):
        true |= {f"true_{what}_{c}": np.asarray(v) for c, v in table.items()}
    attrs = {**record.attrs, "sample_rate_hz": float(rate), **true}
    return add_noise(xr.Dataset(channels, coords, attrs), sensors, rng)

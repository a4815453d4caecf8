"""Simulated campaigns: tests rehearsed in closed loop and recorded as sensors would show them.

A simulated campaign rehearses the tests of `models/procedures/campaign.toml` in closed loop and passes every channel
through a sensor: its skew, gain and offset, its low-pass, its noise and bits. The true errors go into the attributes of
each record, where nobody who calibrates looks.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..control import ControllerSettings, make_controller
from ..core.errors import SimulationError, UnknownNameError
from ..core.files import models_folder
from ..core.names import SAMPLE_RATE
from ..data.campaign import Campaign
from ..data.channels import LAYOUT, sensor_groups
from ..data.sensors import SensorSet, add_noise
from ..data.signals import align
from ..machine.machine import Machine
from ..machine.parameters import Parameters, load_parameters
from ..mechanics.equilibrium import find_equilibrium
from ..mechanics.plant import make_plant
from ..mechanics.pose import PlatenMotion
from ..motions import Target, find_motion, make_target
from .outputs import record_of_run
from .simulate import ClosedLoop, simulate

__all__ = [
    "SensorErrors",
    "as_sensed",
    "draw_errors",
    "load_procedure",
    "simulate_campaign",
    "tests_of",
]

Array = NDArray[np.float64]
Progress = Callable[[float], None]


class SensorErrors(NamedTuple):
    """measured(t) = (1 + gain) true(t - delay) + offset: gain and offset by channel (columns,), delay [s] by group."""

    gain: Mapping[str, Array]
    offset: Mapping[str, Array]
    delay: Mapping[str, float]


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
    progress: Progress | None = None,
) -> Campaign:
    """Rehearse the tests of a procedure of `models/procedures` (or some of them), recorded as the sensors would.

    scale is a factor on all motions; errors draws calibration errors within the sensors' ranges, the same for all
    tests. Deterministic for a seed. progress is called with the share done.

    Raises SimulationError if a test does not last, UnknownNameError for a test that the file does not have.
    """
    numbers = load_procedure(procedure)
    rng = np.random.default_rng(seed)
    known = tests_of(numbers)
    wanted = tests or known
    for test in wanted:
        if test not in known:
            raise UnknownNameError("test of a campaign", test, known)
    plant = make_plant(machine)
    rest = find_equilibrium(plant)
    controller = make_controller(plant, rest, settings)
    drawn: SensorErrors | None = None
    records = []
    for i, test in enumerate(wanted):
        target = _target(numbers, test, machine, scale)
        samples = min(len(target.time), round(numbers.number(f"{test}.seconds") * SAMPLE_RATE))
        motion = PlatenMotion(*(x[:samples] for x in (target.displacement, target.velocity, target.acceleration)))
        loop = ClosedLoop(controller, controller.drive_for(*motion), rest)
        run = simulate(plant, loop, samples=samples, engine="pinocchio" if plant.articulated else "fused")
        if run.trouble:
            raise SimulationError(f"{test}: {run.trouble}")
        facts = {
            "test": test,
            "title": f"{name}, {test}",
            "controller": settings.name,
            "motion": str(numbers.words[f"{test}.motion"]),
        }
        record = record_of_run(run, facts, motion)
        if drawn is None:
            drawn = draw_errors(record, sensors, rng) if errors else SensorErrors({}, {}, {})
        records.append(as_sensed(record, sensors, drawn, numbers.number("recording.rate"), rng))
        if progress is not None:
            progress((i + 1) / len(wanted))
    return Campaign(name, tuple(records))


def load_procedure(name: str) -> Parameters:
    """Tests of a procedure of `models/procedures`."""
    return load_parameters(models_folder() / "procedures" / f"{name}.toml")


def tests_of(procedure: Parameters) -> tuple[str, ...]:
    """Names of a procedure's tests."""
    return tuple(path.split(".")[0] for path in procedure.words if path.endswith(".motion"))


def _target(numbers: Parameters, test: str, machine: Machine, factor: float) -> Target:
    """Target of a test; what the file says beside motion, scale and seconds are options of the motion."""
    options: dict[str, Any] = {}
    for path in (*numbers, *numbers.words):
        section, _, key = path.partition(".")
        if section == test and key not in ("motion", "scale", "seconds"):
            word = numbers.words.get(path)
            options[key] = numbers.number(path) if word is None else bool(word) if isinstance(word, int) else word
    motion = find_motion(str(numbers.words[f"{test}.motion"]), **options)
    scale = factor * (numbers.number(f"{test}.scale") if f"{test}.scale" in numbers else 1.0)
    own = None if machine.motion == "free" else machine.motion
    return make_target(motion, scale=scale, axes=own, rate=float(SAMPLE_RATE))


def draw_errors(record: xr.Dataset, sensors: SensorSet, rng: np.random.Generator) -> SensorErrors:
    """Calibration errors of a record's channels and delays of all groups, uniform within the sensors' ranges."""
    gain: dict[str, Array] = {}
    offset: dict[str, Array] = {}
    for ranges, out in ((sensors.gain_range, gain), (sensors.offset_range, offset)):
        for channel, most in ranges.items():
            if channel in record:
                columns = record[channel].shape[1:] or (1,)
                out[channel] = rng.uniform(-most, most, columns)
    delay = {group: float(rng.uniform(-most, most)) for group, most in sensors.delay_range.items()}
    return SensorErrors(gain, offset, delay)


def as_sensed(
    record: xr.Dataset, sensors: SensorSet, errors: SensorErrors, rate: float, rng: np.random.Generator
) -> xr.Dataset:
    """A run's record as sensors show it: skewed, low-passed, sampled at `rate` [Hz], scaled, shifted, noisy.

    The spool, in a run the mean over the sample that follows, is first taken to the sample's instant. Hidden states and
    specimen joints are left out; the errors are added to the attributes (`true_gain_...`).
    """
    dt = float(record["time"][1] - record["time"][0])
    every = round(1.0 / (rate * dt))
    channels: dict[str, Any] = {}
    group_of = {channel: group for group, members in sensor_groups().items() for channel in members}
    for name in record.data_vars:
        values = record[name].values.astype(float)
        if name in LAYOUT and LAYOUT[str(name)].held:
            values = 0.5 * (values + np.vstack([values[:1], values[:-1]]))
        delay = errors.delay.get(group_of.get(str(name), ""), 0.0)
        if delay:
            values = align(values, -delay, dt)
        if name in sensors.noise:
            values = sensors.band.apply(values, dt)
        values = values[::every]
        values = values * (1.0 + errors.gain.get(str(name), 0.0)) + errors.offset.get(str(name), 0.0)
        channels[str(name)] = (record[name].dims, values, record[name].attrs)
    hidden = [n for n in channels if n.startswith(("hidden_", "specimen_joint"))]
    kept = {n: v for n, v in channels.items() if n not in hidden}
    coords = {
        n: c.values
        for n, c in record.coords.items()
        if n != "time" and set(c.dims) <= {d for v in kept.values() for d in v[0]}
    }
    coords["time"] = ("time", record["time"].values[::every], record["time"].attrs)
    said: dict[str, Any] = {f"true_delay_{g}": d for g, d in errors.delay.items()}
    for what, table in (("gain", errors.gain), ("offset", errors.offset)):
        said |= {f"true_{what}_{c}": np.asarray(v) for c, v in table.items()}
    attrs = {**record.attrs, "sample_rate_hz": float(rate), **said}
    return add_noise(xr.Dataset(kept, coords, attrs), sensors, rng)

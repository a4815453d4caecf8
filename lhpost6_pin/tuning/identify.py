"""Response of the table under white noise: transfer function from reference to feedback, with coherence.

    transfer = identify(controller, rest, noise_target(("x",), machine.limits), ("x",), segment=8.0)

Signals are accelerations of C and Euler angles: the reference of the drive, and the achieved motion of the platen.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from ..control import Controller
from ..core.arrays import Array
from ..core.errors import SimulationError
from ..core.files import models_folder
from ..core.names import AXES, SAMPLE_RATE
from ..data.transfer import Transfer, estimate_transfer
from ..machine.components import Limits
from ..machine.parameters import Parameters, load_parameters
from ..mechanics.equilibrium import Equilibrium
from ..mechanics.pose import platen_motion
from ..motions import GroundMotion, Target, find_motion, make_target
from ..simulation.simulate import ClosedLoop, fastest_engine, simulate
from ..simulation.trouble import pressure_trouble

__all__ = ["identify", "identify_axes", "noise_target", "run_noise", "section", "tuning_numbers"]


def tuning_numbers() -> Parameters:
    """Numbers of `models/procedures/tuning.toml`."""
    return load_parameters(models_folder() / "procedures" / "tuning.toml")


def section(numbers: Parameters, name: str) -> SimpleNamespace:
    """Numbers of a section as attributes."""
    keys = (path.partition(".") for path in numbers)
    return SimpleNamespace(**{key: numbers.number(f"{name}.{key}") for first, _, key in keys if first == name})


def noise_target(
    axes: Sequence[str], limits: Limits, seed: int = 1, *, slow: bool = False, duration: float | None = None
) -> Target:
    """White noise on the axes named, independent on each; `slow` adds a part below its band, and lasts longer.

    Level, band and duration [s] are those of `tuning.toml`; the level is less along an axis whose limits it would
    reach. Different seeds draw different noise.
    """
    numbers = section(tuning_numbers(), "noise")
    low, high = numbers.low, numbers.high
    if duration is None:
        duration = numbers.slow_duration if slow else numbers.duration

    def drawn(rms: float, low: float, high: float, seed: int) -> GroundMotion:
        turning = rms / numbers.rotation_radius
        options = {"rms": rms, "rotation_rms": turning, "low": low, "high": high, "duration": duration, "seed": seed}
        return find_motion("white-noise", six_axis=True, **options)

    noise, lowest = drawn(numbers.rms, low, high, seed), low
    if slow:
        lowest = numbers.slow_low
        below = drawn(numbers.slow_rms, lowest, low, seed + 1000)
        noise = replace(noise, samples=noise.samples + below.samples)
    target = make_target(noise, axes=",".join(axes), high_pass=lowest / 4, low_pass=2 * high)
    factor = np.ones(6)
    for name in ("displacement", "velocity", "acceleration"):
        peak, most = np.abs(getattr(target, name)).max(axis=0), numbers.of_limits * np.array(getattr(limits, name))
        factor = np.minimum(factor, np.divide(most, peak, out=np.ones(6), where=peak > 0.0))
    if (factor == 1.0).all():
        return target
    return replace(target, **{n: factor * getattr(target, n) for n in ("displacement", "velocity", "acceleration")})


def run_noise(controller: Controller, rest: Equilibrium, target: Target) -> tuple[Array, str]:
    """Acceleration (n, 6) of C and Euler angles under a target, and what in the run was not linear, such as clipping.

    Raises SimulationError if the run stops early: noise is small, so the loop is unstable.
    """
    plant = controller.plant
    drive = controller.drive_for(target.displacement, target.velocity, target.acceleration)
    run = simulate(plant, ClosedLoop(controller, drive, rest), samples=len(drive), engine=fastest_engine(plant))
    if run.trouble:
        raise SimulationError(f"white noise: {run.trouble}; the loop is unstable, lower its gains")
    clipped = f"{run.clipped} spool commands were clipped" if run.clipped else ""
    empty = pressure_trouble(run).partition(";")[0]
    doubt = ", and ".join(filter(None, [clipped, empty and f"the run {empty}"]))
    return platen_motion(plant, run.q, run.v, run.a).acceleration, doubt


def identify(
    controller: Controller, rest: Equilibrium, target: Target, axes: Sequence[str], segment: float
) -> Transfer:
    """Transfer function (m, k, k) of the k axes named from one run in which all of them move; segment [s]."""
    return _identified(controller, rest, target, axes, segment)[0]


def _identified(
    controller: Controller, rest: Equilibrium, target: Target, axes: Sequence[str], segment: float
) -> tuple[Transfer, str]:
    achieved, doubt = run_noise(controller, rest, target)
    columns = [AXES.index(name) for name in axes]
    found = estimate_transfer(
        target.acceleration[:, columns], achieved[:, columns], float(SAMPLE_RATE), segment=segment, axes=tuple(axes)
    )
    return found, doubt


def identify_axes(
    controllers: Sequence[Controller], rest: Equilibrium, noise: Callable[[str], Target], segment: float
) -> list[list[tuple[Transfer, str]]]:
    """Response of each free axis, alone, to its own `noise`, with each of the controllers of one plant.

    Beside it what in that run was not linear, as of `run_noise`.

    In parallel over threads; targets and runs of an axis are discarded before the next, since long ones fill memory.
    """
    from joblib import Parallel, delayed

    plant = controllers[0].plant

    def one(axis: str) -> list[tuple[Transfer, str]]:
        target = noise(axis)
        return [_identified(controller, rest, target, (axis,), segment) for controller in controllers]

    threads = 1 if fastest_engine(plant) == "pinocchio" else -1  # that engine holds the interpreter
    return list(Parallel(n_jobs=threads, prefer="threads")(delayed(one)(AXES[k]) for k in plant.axes))

"""The table under white noise: its transfer function from reference to feedback, with the coherence.

    transfer = identify(plant, rest, controller, noise_target(plant, ("x",)), ("x",))

Signals are accelerations of C and Euler angles: what went into the reference generators (the reference that the drive
is made for), and what the platen did.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..control import Controller
from ..core.errors import SimulationError
from ..core.files import models_folder
from ..core.names import AXES, SAMPLE_RATE
from ..data.transfer import Transfer, estimate_transfer
from ..machine.parameters import Parameters, load_parameters
from ..mechanics.equilibrium import Equilibrium
from ..mechanics.plant import Plant
from ..mechanics.pose import platen_motion
from ..motions import GroundMotion, Target, find_motion, make_target
from ..simulation.batch import simulate_many
from ..simulation.simulate import ClosedLoop, simulate

__all__ = ["identify", "noise_target", "run_noise", "tuning_numbers"]

Array = NDArray[np.float64]


def tuning_numbers() -> Parameters:
    """Numbers of `models/procedures/tuning.toml`."""
    return load_parameters(models_folder() / "procedures" / "tuning.toml")


def noise_target(axes: Sequence[str], seed: int = 1, *, slow: bool = False, duration: float | None = None) -> Target:
    """White noise on the axes named, independent on each; `slow` adds a part below its band, and lasts longer.

    Level, band and duration [s] are those of `tuning.toml`. Different seeds draw different noise.
    """
    numbers = tuning_numbers()
    low, high = numbers.number("noise.low"), numbers.number("noise.high")
    if duration is None:
        duration = numbers.number("noise.slow_duration" if slow else "noise.duration")

    def drawn(level: str, low: float, high: float, seed: int) -> GroundMotion:
        rms = numbers.number(f"noise.{level}")
        turning = rms / numbers.number("noise.rotation_radius")
        options = {"rms": rms, "rotation_rms": turning, "low": low, "high": high, "duration": duration, "seed": seed}
        return find_motion("white-noise", six_axis=True, **options)

    noise = drawn("rms", low, high, seed)
    lowest = low
    if slow:
        lowest = numbers.number("noise.slow_low")
        below = drawn("slow_rms", lowest, low, seed + 1000)
        noise = GroundMotion(
            "white-noise", noise.time_step, noise.samples + below.samples, noise.quantity, noise.source
        )
    return make_target(noise, axes=",".join(axes), high_pass=lowest / 4, low_pass=2 * high)


def run_noise(
    plant: Plant, rest: Equilibrium, controllers: Sequence[Controller], targets: Sequence[Target]
) -> list[Array]:
    """Acceleration (n, 6) of C and Euler angles under each target with its controller; all at once over threads.

    Raises SimulationError if a run does not last: noise is small, so a run that stops is an unstable loop.
    """
    drives = [
        ClosedLoop(c, c.drive_for(t.displacement, t.velocity, t.acceleration), rest)
        for c, t in zip(controllers, targets, strict=True)
    ]
    samples = len(targets[0].time)
    if plant.articulated:
        runs = [simulate(plant, drive, samples=samples) for drive in drives]
    else:
        runs = simulate_many([(plant, drive) for drive in drives], samples=samples)
    for run in runs:
        if run.trouble:
            raise SimulationError(f"white noise: {run.trouble}; the loop is unstable, lower its gains")
    return [platen_motion(plant, run.q, run.v, run.a).acceleration for run in runs]


def identify(
    plant: Plant, rest: Equilibrium, controller: Controller, target: Target, axes: Sequence[str], segment: float
) -> Transfer:
    """Transfer function (m, k, k) of the k axes named from one run in which all of them move; segment [s]."""
    (achieved,) = run_noise(plant, rest, [controller], [target])
    columns = [AXES.index(name) for name in axes]
    return estimate_transfer(
        target.acceleration[:, columns], achieved[:, columns], float(SAMPLE_RATE), segment=segment, axes=tuple(axes)
    )

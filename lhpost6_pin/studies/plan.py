"""The plan of an ensemble: motions, scales, specimens, controllers and machines, every one with every other."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import joblib

from ..control import ControllerSettings
from ..core.errors import ParameterError
from ..core.files import sources_digest
from ..machine.machine import Machine
from ..machine.parameters import Parameters
from ..machine.user_specimen import UserSpecimen
from ..mechanics.plant import make_plant
from ..motions import GroundMotion, Target, make_target
from ..simulation.motion_limits import refuse_blocked_axes
from ..simulation.simulate import check_options, fastest_engine
from .draws import Draws
from .quantities import check_groups

__all__ = ["DIMENSIONS", "Block", "EnsemblePlan", "PlannedMotion"]

DIMENSIONS = ("motion", "scale", "specimen", "controller", "machine")
"""Dimensions of an ensemble, in the order of its runs: machines first."""

TOGETHER = 4
"""Runs of a block: of one motion, scale, specimen and controller; the unit of distribution and of resumption."""


class PlannedMotion(NamedTuple):
    """A motion with its processing."""

    motion: GroundMotion
    axes: str | None = None
    high_pass: float | None = None  # [Hz]
    low_pass: float | None = None  # [Hz]

    def target(self, machine: Machine, scale: float, *, warn: bool = False) -> Target:
        """Target at the controller's rate; on a guided machine along its free axes. `warn` as of `make_target`."""
        axes = self.axes or (None if machine.motion == "free" else machine.motion)
        high, low = self.high_pass, self.low_pass
        return make_target(self.motion, scale=scale, axes=axes, high_pass=high, low_pass=low, warn=warn)


class Block(NamedTuple):
    """Some runs of an ensemble on the machines `first` to `last`, that one excluded."""

    number: int
    place: tuple[int, int, int, int]  # of motion, scale, specimen and controller
    first: int
    last: int


@dataclass(frozen=True)
class EnsemblePlan:
    """What an ensemble runs; raises LhpostError for what no run could have, such as a motion along axes that are held.

    Runs beyond the limits of the table are run all the same: at which scale they are exceeded is what is sought.
    """

    name: str
    machine: Machine  # as stated, without a specimen
    draws: Draws
    motions: Mapping[str, PlannedMotion]
    scales: tuple[float, ...]
    specimens: Mapping[str, Machine]  # the machine as stated with each specimen; "none" without one
    controllers: Mapping[str, ControllerSettings]
    groups: tuple[str, ...]  # of quantities
    numbers: Parameters  # of `models/procedures/ensemble.toml`
    scheme: str
    steps_per_second: int
    engine: str | None = None  # None: the fastest for each specimen

    def __post_init__(self) -> None:
        """Check that there is something to run, scales and groups, and options of every run."""
        check_groups(self.groups)
        for what in ("motions", "scales", "specimens", "controllers", "groups"):
            if not getattr(self, what):
                raise ParameterError(f"{self.name}: an ensemble without {what}; name one at least")
        if any(not 0.0 < scale < float("inf") for scale in self.scales):
            raise ParameterError(f"{self.name}: scales {list(self.scales)}: each must be positive")
        if list(self.scales) != sorted(set(self.scales)):
            raise ParameterError(f"{self.name}: scales {list(self.scales)}: name each once, rising")
        for label, machine in self.specimens.items():
            if isinstance(machine.specimen, UserSpecimen):
                raise ParameterError(
                    f"{self.name}: specimen {label} is a program, which runs with one table at a time: `lhpost6 run`"
                )
            check_options(make_plant(machine), plugged=False, **self.options[label])
        bare = make_plant(self.machine)
        for motion in self.motions.values():
            refuse_blocked_axes(bare, motion.target(self.machine, self.scales[0], warn=True))

    @cached_property
    def options(self) -> dict[str, dict[str, Any]]:
        """Options of `simulate` by specimen."""
        usual = {"scheme": self.scheme, "steps_per_second": self.steps_per_second}
        engines = {
            label: self.engine or fastest_engine(make_plant(machine)) for label, machine in self.specimens.items()
        }
        return {label: {**usual, "engine": engine} for label, engine in engines.items()}

    @property
    def shape(self) -> tuple[int, ...]:
        """Size of each of `DIMENSIONS`."""
        others = (self.motions, self.scales, self.specimens, self.controllers)
        return (*map(len, others), len(self.draws.coordinates))

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Blocks of runs, in order."""
        *others, machines = self.shape
        starts = range(0, machines, TOGETHER)
        cells = product(product(*map(range, others)), starts)
        return tuple(
            Block(number, (m, s, p, c), first, min(first + TOGETHER, machines))
            for number, ((m, s, p, c), first) in enumerate(cells)
        )

    @property
    def digest(self) -> str:
        """Hash of everything that results follow from, the package's own code among it."""
        stated = [getattr(self, name) for name in self.__dataclass_fields__]
        # hashes of dicts have no order, and blocks are numbered by place
        ordered = [list(one.items()) if isinstance(one, dict) else one for one in stated]
        mounted = (machine.specimen for machine in self.specimens.values() if machine.specimen is not None)
        files = [path.read_bytes() for one in mounted for path in one.files]
        return str(joblib.hash((sources_digest(), ordered, files)))

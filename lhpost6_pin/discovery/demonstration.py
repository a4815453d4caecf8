"""The demonstration of `lhpost6 demo`: an effect hidden in simulated tests of a real earthquake, and its search.

The hidden effect and the tests are those of `models/procedures/demo.toml`; the search is that of `discover`.
"""

from functools import partial
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..control import load_controller
from ..core.progress import Progress
from ..data.campaign import Campaign
from ..data.sensors import SensorSet
from ..machine.machine import Machine
from ..simulation.rehearse import replay
from ..simulation.simulated_campaign import load_procedure, simulate_campaign
from .discover import discover

__all__ = ["EARTHQUAKE", "OpenLoops", "earthquake", "hidden_effect", "measured_tests", "open_loops", "searched"]

PROCEDURE = "demo"
EARTHQUAKE = "EQ"
"""The test that is not searched."""


class OpenLoops(NamedTuple):
    """The earthquake as measured, and as two models respond to its recorded spools."""

    measured: xr.Dataset
    delivered: xr.Dataset
    found: xr.Dataset

    def apart(self) -> tuple[float, float]:
        """Error of C's final position [m], of the model as delivered and with the effect found."""
        ends = [r["platen_displacement"].values[-1, :3] for r in self]
        return float(np.linalg.norm(ends[1] - ends[0])), float(np.linalg.norm(ends[2] - ends[0]))


def hidden_effect() -> tuple[str, str, dict[str, float]]:
    """Family, component and numbers of what the demonstration hides."""
    known = load_procedure(PROCEDURE)
    numbers = {k.removeprefix("hidden."): known.number(k) for k in known if k.startswith("hidden.")}
    return str(known.words["hidden.family"]), str(known.words["hidden.component"]), numbers


def earthquake() -> tuple[float, float]:
    """Length of the earthquake [s], from its beginning, and its scale."""
    known = load_procedure(PROCEDURE)
    return known.number(f"{EARTHQUAKE}.seconds"), known.number(f"{EARTHQUAKE}.scale")


def measured_tests(machine: Machine, sensors: SensorSet, *, seed: int, progress: Progress | None = None) -> Campaign:
    """Tests of a table with the hidden effect, under the virtual 469D, as its sensors record them."""
    family, component, numbers = hidden_effect()
    table = machine.with_effect(family, (component,), name="", **numbers)
    settings = load_controller(machine.controller)
    return simulate_campaign(table, settings, sensors, seed=seed, name="demo", procedure=PROCEDURE, progress=progress)


searched = partial(discover, hold_out=[EARTHQUAKE], phases=(1, 2))
"""Result of the search, given the machine without the effect; see `discover`."""


def open_loops(machine: Machine, found: Machine, tests: Campaign) -> OpenLoops:
    """The earthquake's measured spools in open loop, on the model as delivered and on the one with the effect found."""
    measured = next(r for r in tests.records if r.attrs["test"] == EARTHQUAKE)
    delivered, after = (
        replay(model, measured, attrs={"test": EARTHQUAKE, "title": title}, engine="fused").record
        for model, title in ((machine, "model as delivered"), (found, "model with the effect found"))
    )
    return OpenLoops(measured, delivered, after)

"""A problem's tests, their paths and residuals at one set of unknowns, from which differences are taken."""

from dataclasses import replace
from typing import Protocol

from ...core.arrays import Array
from ...core.threads import by_threads
from ...mechanics.plant import Plant
from ..prepare import MeasuredTest
from ..residuals import Path, Residuals, evaluate_residuals, follow, with_ports
from .free_parameters import FreeParameter
from .sensor_errors import SensorUnknown, corrected

__all__ = ["OperatingPoint"]

KEPT = 4
"""Sets of ports along which a test's path is kept."""


class Unknowns(Protocol):
    """Tests, and the unknowns on which their residuals depend: a `Problem`."""

    parameters: tuple[FreeParameter, ...]
    unknowns: tuple[SensorUnknown, ...]
    tests: tuple[MeasuredTest, ...]
    kinds: tuple[str, ...]
    jobs: int  # cores

    def plant_at(self, x: Array) -> Plant:
        """Plant with its parameters set to x (p,)."""
        ...


class OperatingPoint:
    """Tests, paths and residuals evaluated at x, from which differences are taken."""

    def __init__(self, problem: Unknowns, x: Array) -> None:
        """Evaluate a problem's tests at x (p,)."""
        self.x, self.plant = x, problem.plant_at(x)

        def evaluated(raw: MeasuredTest) -> tuple[MeasuredTest, Path, Residuals]:
            test = corrected(raw, problem.unknowns, x[len(problem.parameters) :])
            path = follow(self.plant, test)
            return test, path, evaluate_residuals(self.plant, test, problem.kinds, path=path)

        each = by_threads(evaluated, problem.tests, problem.jobs)
        self.tests, self.paths, self.residuals = map(list, zip(*each, strict=True))
        self._extended: dict[tuple[str, ...], tuple[Plant, list[Path]]] = {self.plant.ports: (self.plant, self.paths)}

    def with_ports_of(self, other: Plant) -> tuple[Plant, list[Path]]:
        """Plant and paths with the ports of another plant, on which an effect may act that is not there yet."""
        if (known := self._extended.get(other.ports)) is not None:
            return known
        own, plant = self.plant.ports, replace(self.plant, ports=other.ports)
        if plant.geometry != other.geometry or other.ports[: len(own)] != own:
            return self.plant, self.paths
        pairs = zip(self.tests, self.paths, strict=True)
        found = plant, [with_ports(plant, test, path) for test, path in pairs]
        if len(self._extended) >= KEPT:  # candidates at many places would fill the memory
            self._extended.popitem()
        self._extended[other.ports] = found
        return found

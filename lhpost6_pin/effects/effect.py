"""Effects: what law acts on which ports with which numbers.

An effect whose law makes forces is one entry of the force ledger; a modifier changes rows of others.
"""

import math
from dataclasses import dataclass

from ..core.errors import ParameterError, UnknownNameError
from ..laws.contract import parameter_units
from .registry import LAWS

__all__ = ["Effect"]


@dataclass(frozen=True)
class Effect:
    """A named effect: where it acts, what law it obeys, its numbers, and where they come from.

    ports: one name per row (``H1``, ``S2``, ``platen.z``); a two-port law takes the stem of a pad (``V1``), or
    two names with a space between, the second a dash where one port is enough; a three-port law two or three. A
    modifier takes the names of what it modifies.
    params: one tuple per row, in the law's order. spools: for a hydraulic law, the number of its spool per row.
    """

    name: str
    law: str
    ports: tuple[str, ...]
    params: tuple[tuple[float, ...], ...]
    source: str
    spools: tuple[int, ...] = ()
    family: str = ""  # of the library; empty for the report's and what is made by hand

    def __post_init__(self) -> None:
        """Check the shape; raises UnknownNameError or ParameterError."""
        if self.law not in LAWS:
            raise UnknownNameError("law", self.law, list(LAWS))
        law = LAWS[self.law]
        if len(self.params) != len(self.ports):
            raise ParameterError(f"{self.name}: {len(self.params)} sets of numbers for {len(self.ports)} ports")
        units = parameter_units(law)
        for port, numbers in zip(self.ports, self.params, strict=True):
            if len(numbers) != len(units):
                wanted = ", ".join(f"{name} [{unit}]" for name, unit in units)
                raise ParameterError(f"{self.name} on {port}: {len(numbers)} numbers given; {self.law} takes {wanted}")
            if not all(map(math.isfinite, numbers)):
                raise ParameterError(f"{self.name} on {port}: {numbers!r} is not finite")
        if law.takes_spool != bool(self.spools) or (self.spools and len(self.spools) != len(self.ports)):
            raise ParameterError(
                f"{self.name}: a {self.law} law takes {'one spool' if law.takes_spool else 'no spool'}"
            )

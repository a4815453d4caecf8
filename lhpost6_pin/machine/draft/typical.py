"""What is known of a machine, and typical sizes for the rest: numbers with evidence, source and standard deviation."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ..parameters import Parameters
from ..quantity import Quantity, Value
from .asked import ASKED

__all__ = ["Basis", "first", "scaled", "vector"]


def first(value: Value | None) -> float:
    """The number, or the first of several; 0 for None."""
    return 0.0 if value is None else value[0] if isinstance(value, tuple) else value


def vector(quantity: Quantity) -> tuple[float, ...]:
    """The numbers."""
    return quantity.value if isinstance(quantity.value, tuple) else (quantity.value,)


def scaled(value: Value, factor: float) -> Value:
    """A number, or each of several, times a factor, without its sign."""
    return tuple(abs(v) * factor for v in value) if isinstance(value, tuple) else abs(value) * factor


@dataclass(frozen=True)
class Basis:
    """What is known by name (`asked.ASKED`, and `slope`), and the rules of `models/templates/new_machine.toml`."""

    known: Mapping[str, Quantity]
    typical: Parameters

    def number(self, name: str) -> float:
        """A known number."""
        return first(self.known[name].value)

    def rule(self, path: str) -> float:
        """A typical number."""
        return self.typical.number(path)

    def spread(self, path: str) -> float:
        """Its standard deviation over it."""
        return first(self.typical[path].sd) / self.rule(path)

    def assumed(self, path: str, unit: str, factor: float, of: str) -> Quantity:
        """A typical number times `factor`, which `of` names."""
        rule = self.typical[path]
        sd = None if rule.sd is None else first(rule.sd) * factor
        return Quantity(self.rule(path) * factor, unit, "assumed", f"{self.rule(path):g} times {of}; {rule.source}", sd)

    def known_or(self, name: str, path: str, factor: float = 1.0, of: str = "") -> Quantity:
        """What is known by a name, else the typical number, times `factor` if `of` names one."""
        if name in self.known:
            return self.known[name]
        return self.assumed(path, ASKED[name].unit, factor, of) if of else self.typical[path]

    def with_sd(self, quantity: Quantity, share: float) -> Quantity:
        """A number with the standard deviation stated, else a share of it."""
        if quantity.sd is not None:
            return quantity
        source = f"{quantity.source}; sd of {share:.0%} assumed"
        return replace(quantity, sd=scaled(quantity.value, share), source=source)

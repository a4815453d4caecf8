"""Options that are one number, in SI or followed by a unit of the same kind, such as 10ms or 50%."""

from typing import Any

import typer

from ..core.errors import ParameterError
from ..core.units import numbers_in

__all__ = ["quantity_option"]


def quantity_option(flag: str, unit: str, example: str, help: str) -> Any:
    """The option `flag`, read as a number in the SI `unit`; `example` is one with a unit, for those that are none."""

    def read(text: Any) -> float:
        numbers = numbers_in(str(text), unit)
        if numbers is None or len(numbers) != 1:
            plain = "plain" if unit == "1" else f"in {unit}"
            raise ParameterError(f"{flag} {text}: write one number, {plain} or as {example}")
        return numbers[0]

    return typer.Option(flag, parser=read, metavar="<number>", help=help)

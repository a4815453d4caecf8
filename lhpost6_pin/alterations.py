"""Effects that make no force of their own, but change numbers in the rows of actuators."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .errors import UnknownNameError
from .law_table import LAWS, LEAKAGE

if TYPE_CHECKING:
    from .effects import Effect

__all__ = ["alter_rows"]


def alter_rows(rows: NDArray[np.void], effects: Sequence["Effect"], at: Mapping[str, int], states: int) -> None:
    """Change rows in place as the effects among `effects` say that alter oil.

    at are the rows of actuators and struts by name; `states` hidden states are taken, alterations have the next ones.
    Raises UnknownNameError for a component that does not exist.
    """
    for effect in effects:
        if LAWS[effect.law].alters != "oil":
            continue
        for port, numbers in zip(effect.ports, effect.params, strict=True):
            if port not in at:
                raise UnknownNameError("component", port, list(at))
            row = rows[at[port]]
            if effect.law == "extra_leakage":
                row["p"][LEAKAGE] += numbers[0]

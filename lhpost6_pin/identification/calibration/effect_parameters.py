"""Free parameters of an effect of the library: its amplitudes and shapes, with their bounds."""

from collections.abc import Mapping

from ...machine.library import Family
from ..residuals import RESIDUALS
from .free_parameters import FreeParameter

__all__ = ["effect_parameters"]


def effect_parameters(
    family: Family, name: str, values: Mapping[str, float], spread: float, factor: float = 0.0
) -> tuple[FreeParameter, ...]:
    """Unknowns of a fit that starts at `values`, of a machine's effect called `name`.

    Amplitudes have a prior of `spread` typical ones, logarithms of shapes a prior deviation `factor`; where that is
    zero, shapes are fixed.
    """
    found = []
    for s in family.shapes:
        value = values[s.name]
        relative = not s.amplitude and s.low > 0.0
        if not s.amplitude and factor == 0.0:
            continue
        parameter = FreeParameter(
            name=f"{name}.{s.name}",
            paths=((f"effect.{name}.{s.name}", -1),),
            unit=s.unit,
            value=value,
            sd=spread * s.typical if s.amplitude else factor if relative else s.scale,
            form="log" if relative else "shift",
            shows_in=tuple(k for k in family.shows_in if k in RESIDUALS),
            step=s.typical if s.amplitude else None,
        )
        found.append(parameter.within(s.low, s.high))
    return tuple(found)

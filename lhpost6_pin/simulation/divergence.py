"""Divergence by the integration scheme: a mode that the table damps and the scheme amplifies at its rate.

One step of dt multiplies a mode with rate s by R(z), z = s dt: 1 + z with Euler, 1 + z + z^2/2 + z^3/6 + z^4/24 with
Runge-Kutta 4; it grows at ln|R| / dt. The modes are those of the plant linearised at rest, valves at rest.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..core.arrays import Complex
from ..core.names import SCHEMES
from ..mechanics.equilibrium import find_equilibrium
from ..mechanics.linearize import linearize
from ..mechanics.plant import Plant

__all__ = ["amplified_mode", "recorded_divergence", "scheme_divergence"]


def amplified_mode(plant: Plant, scheme: str, rate: int) -> tuple[float, float]:
    """Frequency [Hz] and growth rate [1/s] of the damped mode that an explicit scheme amplifies most; zeros if none.

    The semi-implicit scheme is not looked at: (0, 0).
    """
    if scheme == SCHEMES[0]:
        return 0.0, 0.0
    rest = find_equilibrium(plant)
    own = np.linalg.eigvals(linearize(plant, rest.state, rest.spool).A).astype(complex)
    own = own[(own.real < 0.0) & (own.imag >= 0.0)]
    growth = rate * np.log(np.abs(_factor(np.asarray(own / rate, np.complex128), scheme)))
    worst = int(np.argmax(growth))
    return (float(own[worst].imag / (2.0 * np.pi)), float(growth[worst])) if growth[worst] > 0.0 else (0.0, 0.0)


def scheme_divergence(plant: Plant, scheme: str, rate: int, time: float) -> str:
    """Why a run that failed at a time [s] failed by its scheme: a mode had grown e-fold by then; empty if none had."""
    frequency, growth = amplified_mode(plant, scheme, rate)
    if growth * time < 1.0:
        return ""
    return (
        f"diverged before {time:.4f} s: scheme {scheme} at {rate} steps a second amplifies a mode of the table at "
        f"{frequency:.3g} Hz, which is damped, by {growth:.3g} 1/s; take semi_implicit, or more steps (--rate)"
    )


def recorded_divergence(attrs: Mapping[str, Any]) -> str:
    """Why the run of a record diverged by its scheme, from the record's attributes; empty if it did not."""
    trouble = str(attrs.get("trouble", "none"))
    return trouble if trouble.startswith("diverged ") else ""


def _factor(z: Any, scheme: str) -> Complex:
    """Factor of one step on a mode whose rate times the step is z."""
    return np.asarray(1.0 + z if scheme == "euler" else 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0))))

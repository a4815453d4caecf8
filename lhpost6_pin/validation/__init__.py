"""Three-phase validation of a campaign (report, Chapter 6): inverse dynamics, open loop, closed loop.

`prepare` makes a test ready, `phases` compares it with the model, `agreement` and `spectra` say how well they agree,
`validate` does so for a whole campaign.
"""

from .agreement import Agreement, Pair
from .phases import PHASES, Phase
from .resonance import Peak, Resonance
from .spectra import Spectrum
from .summary import metrics, save_metrics
from .validate import Validation, validate

__all__ = [
    "PHASES",
    "Agreement",
    "Pair",
    "Peak",
    "Phase",
    "Resonance",
    "Spectrum",
    "Validation",
    "metrics",
    "save_metrics",
    "validate",
]

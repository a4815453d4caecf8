"""Three-phase validation of a campaign (report, Chapter 6): inverse dynamics, open loop, closed loop.

`prepare` makes a test ready, `phases` compares it with the model, `agreement` and `spectra` say how well they agree,
`valves` looks at spools and their commands, `validate` at a whole campaign.
"""

from .agreement import Agreement, Pair
from .closed_loop import Lag
from .phases import PHASES, Phase
from .resonance import Peak, Resonance
from .spectra import Spectrum
from .summary import metrics, save_metrics
from .validate import Validation, validate
from .valves import Valves

__all__ = [
    "PHASES",
    "Agreement",
    "Lag",
    "Pair",
    "Peak",
    "Phase",
    "Resonance",
    "Spectrum",
    "Validation",
    "Valves",
    "metrics",
    "save_metrics",
    "validate",
]

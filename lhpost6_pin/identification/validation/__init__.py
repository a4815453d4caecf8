"""Three-phase validation of a campaign (report, Chapter 6): inverse dynamics, open loop, closed loop.

`prepare` makes a test ready, `phases` compares it with the model, `agreement` and `spectra` say how well they agree,
`valves` looks at spools and their commands, `validate` at a whole campaign.
"""

from .band_spectra import Spectrum
from .closed_loop import Lag
from .metrics_file import metrics, save_metrics
from .phase_agreement import ColumnAgreement, ComparedQuantity
from .phases import PHASES, Phase
from .resonance import Peak, Resonance
from .validate import Validation, validate
from .valve_agreement import Valves

__all__ = [
    "PHASES",
    "ColumnAgreement",
    "Lag",
    "ComparedQuantity",
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

"""Three-phase validation of a campaign (report, Chapter 6): inverse dynamics, open loop, closed loop.

`prepare_tests` prepares a test, `phases` compares it with the model by `phase_agreement` and `band_spectra`,
`valve_agreement` compares spools with their commands, and `validate` runs a whole campaign.
"""

from .band_spectra import Spectrum
from .closed_loop import Lag
from .metrics_file import metrics, save_metrics
from .phase_agreement import ColumnAgreement, ComparedQuantity
from .phases import PHASES, Phase
from .resonance import Peak, Resonance
from .validate import Validation, validate
from .valve_agreement import Valves

__all__ = ["PHASES", "ColumnAgreement", "Lag", "ComparedQuantity", "Peak", "Phase", "Resonance", "Spectrum"]
__all__ += ["Validation", "Valves", "metrics", "save_metrics", "validate"]

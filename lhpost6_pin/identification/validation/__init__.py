"""Three-phase validation of a campaign (report, Chapter 6): inverse dynamics, open loop, closed loop.

`prepare_tests` prepares a test, `phases` compares it with the model by `phase_agreement` and `spectra`, and `validate`
runs a whole campaign.
"""

from .phase_agreement import ColumnAgreement, ComparedQuantity
from .phases import PHASES, Phase
from .simulated_phases import Lag
from .spectra import Peak, Resonance, Spectrum, Valves
from .validate import Validation, metrics, save_metrics, validate

__all__ = ["PHASES", "ColumnAgreement", "Lag", "ComparedQuantity", "Peak", "Phase", "Resonance", "Spectrum"]
__all__ += ["Validation", "Valves", "metrics", "save_metrics", "validate"]

"""Decomposition of a test into forces, compared with the measured ones (report, Section 6.1).

    found = decompose_record(machine, record, sensors)      # forces and motion in the band that is compared
    agreement = find_agreement(found)                       # RRMSE per axis; the residual against noise and calibration
    save_ledger(found, "ledger.nc")

`record` prepares a record and calls `inverse_dynamics`; `agreement` compares; `dataset` adds power and energy.
"""

from .agreement import Level, Match, WrenchAgreement, find_agreement
from .dataset import Work, find_work, ledger_dataset, save_ledger
from .interface import InterfaceWrench, find_interface
from .record import ComparisonBand, Decomposed, decompose_numbers, decompose_record

__all__ = [
    "InterfaceWrench",
    "WrenchAgreement",
    "ComparisonBand",
    "Decomposed",
    "Level",
    "Match",
    "Work",
    "decompose_numbers",
]
__all__ += ["decompose_record", "find_agreement", "find_interface", "find_work", "ledger_dataset", "save_ledger"]

"""First-principles model of the UC San Diego LHPOST6 six-degree-of-freedom shake table on Pinocchio.

All quantities are SI: m, rad, s, kg, N, Pa, m³/s. Twists and wrenches are in Pinocchio's order, linear
first, unless a name says otherwise.

What most scripts need is importable from here; each name is loaded where it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .control import load_controller
    from .data.campaign import load_campaign
    from .data.records import load_record, save_record
    from .data.sensors import load_sensors
    from .discovery.discover import discover
    from .identification.calibration import calibrate
    from .identification.decompose import decompose_record
    from .identification.validation.validate import validate
    from .machine.machine import load_machine
    from .motions import find_motion, make_target
    from .show.notebook import show_report
    from .show.report.run_report import write_run_report
    from .show.viewer import show_record
    from .simulation.rehearse import rehearse

__version__ = "0.1.0"

__all__ = [
    "calibrate",
    "decompose_record",
    "discover",
    "find_motion",
    "load_campaign",
    "load_controller",
    "load_machine",
    "load_record",
    "load_sensors",
    "make_target",
    "rehearse",
    "save_record",
    "show_record",
    "show_report",
    "validate",
    "write_run_report",
]

_MODULES = {
    "calibrate": "identification.calibration",
    "decompose_record": "identification.decompose",
    "discover": "discovery.discover",
    "find_motion": "motions",
    "load_campaign": "data.campaign",
    "load_controller": "control",
    "load_machine": "machine.machine",
    "load_record": "data.records",
    "load_sensors": "data.sensors",
    "make_target": "motions",
    "rehearse": "simulation.rehearse",
    "save_record": "data.records",
    "show_record": "show.viewer",
    "show_report": "show.notebook",
    "validate": "identification.validation.validate",
    "write_run_report": "show.report.run_report",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

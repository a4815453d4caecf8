"""Accelerometers on the platen as a machine's file or a file of sensors states them, ``[accelerometer.NAME]``."""

from ..core.errors import ParameterError
from .components import Accelerometer
from .parameters import Parameters
from .schema import build_section

__all__ = ["ACCELEROMETER", "accelerometers_of"]

ACCELEROMETER = "accelerometer."
"""What the paths of their numbers begin with."""


def accelerometers_of(parameters: Parameters) -> tuple[Accelerometer, ...]:
    """Accelerometers in the order of the file; raises ParameterError naming file and key."""
    sections = dict.fromkeys(path.rpartition(".")[0] for path in parameters if path.startswith(ACCELEROMETER))
    found = tuple(
        build_section(Accelerometer, parameters, (section,), name=section.removeprefix(ACCELEROMETER))
        for section in sections
    )
    for one in found:
        if not any(one.direction):
            raise ParameterError(
                f"{parameters.origin}: {ACCELEROMETER}{one.name}.direction is zero; write one such as [1, 0, 0]"
            )
    return found

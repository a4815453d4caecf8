"""The plant as an FMU (FMI 2.0 for co-simulation), for Simulink, Modelica and other tools that import one.

    export_fmu(load_machine(), "lhpost6.fmu")

The FMU carries every number of its machine, but not the program: it runs in a Python that has lhpost6_pin.
"""

from .export import export_fmu

__all__ = ["export_fmu"]

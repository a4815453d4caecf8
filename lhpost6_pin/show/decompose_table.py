"""Terminal tables of a decomposed record."""

import numpy as np
from rich.table import Table

from ..core.console import make_console
from ..core.names import AXES
from ..identification.decompose import Decomposed, WrenchAgreement
from .calibration_table import make_table

__all__ = ["print_agreement"]


def print_agreement(found: Decomposed, agreement: WrenchAgreement) -> None:
    """Print errors of the forces, and the residual with its expected size, axis by axis."""
    console = make_console()
    console.print(_errors(found, agreement))
    console.print(_residual(found, agreement))


def _errors(found: Decomposed, agreement: WrenchAgreement) -> Table:
    heads = [head for what in ("actuators", "struts", "dissipative") for head in (f"{what} [%]", "mean removed")]
    title = f"Modelled against measured forces up to {found.comparison.band.high:g} Hz: RRMSE"
    table = make_table(title, "axis", *heads, "delay [ms]")
    for k in found.plant.axes:
        cells = [AXES[k]]
        for match in (agreement.actuators, agreement.struts, agreement.dissipative):
            cells += ["-", "-"] if match is None else [f"{100 * x[k]:.3g}" for x in (match.rrmse, match.rrmse_varying)]
        late = 1e3 * agreement.actuators.delay[k]
        table.add_row(*cells, f"{late:+.3f}" if np.isfinite(late) else "-")
    return table


def _residual(found: Decomposed, agreement: WrenchAgreement) -> Table:
    title = "Residual: required less measured actuator wrench [kN, kN m], and its expected size"
    expected = ["noise", "sd/noise", "sensors", "parameters", "sd is explained by", "mean by"]
    noisy = found.sensors is not None
    table = make_table(title, "axis", "mean", "sd", *(expected if noisy else ()))
    for k in found.plant.axes:
        cells = [AXES[k], *(f"{x[k] / 1e3:.3g}" for x in agreement.residual)]
        if noisy:
            cells += [f"{agreement.noise[k] / 1e3:.3g}", f"{agreement.noise_ratio[k]:.2f}"]
            cells += [f"{x.varying[k] / 1e3:.3g}" for x in (agreement.sensors, agreement.parameters)]
            cells += [agreement.varying_explained[k], agreement.offset_explained[k]]
        table.add_row(*cells)
    return table

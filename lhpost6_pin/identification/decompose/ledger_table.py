"""What a terminal shows of a decomposed record."""

import numpy as np
from rich.markup import escape
from rich.table import Table

from ...core.console import make_console
from ...core.names import AXES
from .agreement import WrenchAgreement
from .record import Decomposed

__all__ = ["print_agreement"]


def print_agreement(found: Decomposed, agreement: WrenchAgreement) -> None:
    """Print errors of the forces, the residual and what it is to be expected of, axis by axis."""
    console = make_console()
    console.print(_errors(found, agreement))
    console.print(_residual(found, agreement))


def _errors(found: Decomposed, agreement: WrenchAgreement) -> Table:
    high = found.comparison.band.high
    heads = ["axis"]
    for what in ("actuators", "struts", "dissipative"):
        heads += [f"{what} [%]", "mean off"]
    table = _table(f"Modelled against measured forces up to {high:g} Hz: RRMSE", *heads, "delay [ms]")
    for k in found.plant.axes:
        cells = [AXES[k]]
        for match in (agreement.actuators, agreement.struts, agreement.dissipative):
            shares = ("-", "-") if match is None else (f"{100 * x[k]:.3g}" for x in (match.rrmse, match.rrmse_varying))
            cells += shares
        late = 1e3 * agreement.actuators.delay[k]
        table.add_row(*cells, f"{late:+.3f}" if np.isfinite(late) else "-")
    return table


def _residual(found: Decomposed, agreement: WrenchAgreement) -> Table:
    title = "Residual: required less measured actuator wrench [kN, kN m], with what is to be expected of it"
    expected = ["noise", "sd/noise", "sensors", "parameters", "sd is explained by", "mean by"]
    noisy = found.sensors is not None
    table = _table(title, "axis", "mean", "sd", *(expected if noisy else ()))
    for k in found.plant.axes:
        cells = [AXES[k], *(f"{x[k] / 1e3:.3g}" for x in agreement.residual)]
        if noisy:
            cells += [f"{agreement.noise[k] / 1e3:.3g}", f"{agreement.noise_ratio[k]:.2f}"]
            cells += [f"{x.varying[k] / 1e3:.3g}" for x in (agreement.sensors, agreement.parameters)]
            cells += [agreement.varying_explained[k], agreement.offset_explained[k]]
        table.add_row(*cells)
    return table


def _table(title: str, *heads: str) -> Table:
    table = Table(title=escape(title), title_justify="left")
    for n, head in enumerate(heads):
        table.add_column(escape(head), justify="right" if n else "left")
    return table

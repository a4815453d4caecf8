"""Section of a run report on the specimen: the wrench at its interface with the platen, its joints and points."""

import numpy as np
import xarray as xr

from ...data.metrics import channel, sampling
from ...mechanics.interface_wrench import INTERFACE_AXES
from .page import Block, Table, number
from .plots import Row, Trace, palette
from .run_components import draw_over_time, specimen_blocks
from .scales import Scale, scaled_number
from .specimen_points import point_blocks

__all__ = ["FORCE", "INTERFACE_NAMES", "MOMENT", "response_blocks"]

INTERFACE_NAMES = dict(
    zip(
        INTERFACE_AXES,
        ("base shear x", "base shear y", "axial force", "overturning about x", "overturning about y", "torsion"),
        strict=True,
    )
)
"""Components of the interface wrench in words."""
ROUND_OFF = 1e-12
"""Share of the largest component of a wrench [N, N m] up to which another is shown as 0: with the shipped specimens
round-off of components that are zero by symmetry stays below a tenth of it."""
FORCE, MOMENT = Scale(1e-3, "kN"), Scale(1e-3, "kN m")


def response_blocks(record: xr.Dataset) -> list[Block]:
    """Return the interface wrench of a specimen, its joints, its points and the exchange, as far as they are known."""
    blocks: list[Block] = []
    if "specimen_wrench" in record:
        values = channel(record, "specimen_wrench")
        start, step = sampling(record)
        rows, least = [], ROUND_OFF * np.nanmax(np.abs(values))
        for j, name in enumerate(INTERFACE_NAMES.values()):
            scale, k = (FORCE if j < 3 else MOMENT), int(np.nanargmax(np.abs(values[:, j])))
            peak, at_rest = (x if abs(x) > least else 0.0 for x in (values[k, j], values[0, j]))
            when = f"{start + k * step:.3f} s" if peak else "–"
            rows.append((name, scale.unit, scaled_number(peak, scale), scaled_number(at_rest, scale), when))
        where = record["specimen_wrench"].attrs.get("interface", "")
        title = f"Wrench of the specimen on the platen at the interface, {where}, platen axes; weight included"
        blocks.append(Table(title, ("Component", "Unit", "Peak", "at rest", "Time of the peak"), rows))
        named = list(INTERFACE_NAMES.values())
        lines = palette(len(named))
        drawn = [
            Row(what, [Trace(named[j], values[:, j], lines[j]) for j in own], FORCE if own[0] < 3 else MOMENT)
            for what, own in (("Base shear", (0, 1)), ("Axial force", (2,)), ("Overturning and torsion", (3, 4, 5)))
        ]
        words = "Of the simulated specimen on the platen, weight included."
        blocks.append(draw_over_time(record, "interface", "Interface wrench over time", words, drawn))
    if "interface_energy" in record.attrs:
        blocks.append(_exchange(record))
    if "specimen_joint_position" in record:
        blocks += specimen_blocks(record)
    if "specimen_displacement" in record:
        blocks += point_blocks(record)
    return blocks


def _exchange(record: xr.Dataset) -> Table:
    """Energy and stability of the exchange with a specimen that is a program."""
    facts = [
        ("largest energy that passed the interface [kJ]", number(record.attrs["interface_energy"] / 1e3)),
        ("created by the exchange, share of it", f"{record.attrs['interface_energy_error']:.2g}"),
        ("growth of errors per exchange (below 1: stable)", f"{record.attrs['interface_growth']:.2g}"),
    ]
    return Table("Exchange", ("Quantity", "Value"), facts)

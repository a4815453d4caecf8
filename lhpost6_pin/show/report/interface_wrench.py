"""Section of a run report on the interface of a coupled specimen: wrench at its base, and the exchange."""

import xarray as xr

from .page import Block, Table, number
from .plots import Row, palette_traces
from .run_components import draw_over_time
from .run_metrics import channel, labels
from .scales import Scale

__all__ = ["interface_blocks"]

_ROWS = (("Force", slice(0, 3), Scale(1e-6, "MN")), ("Moment", slice(3, 6), Scale(1e-6, "MN m")))


def interface_blocks(record: xr.Dataset) -> list[Block]:
    """Return the wrench at the base, and energy and stability of the exchange; the record must have a wrench."""
    values, names = channel(record, "interface_wrench"), labels(record, "wrench")
    rows = [Row(title, palette_traces(names[part], values[:, part]), scale) for title, part, scale in _ROWS]
    words = "Wrench of the specimen on the platen at its base, axes of the base; weight included."
    facts = [
        ("largest energy that passed the interface [kJ]", number(record.attrs["interface_energy"] / 1e3)),
        ("created by the exchange, share of it", f"{record.attrs['interface_energy_error']:.2g}"),
        ("growth of errors per exchange (below 1: stable)", f"{record.attrs['interface_growth']:.2g}"),
    ]
    figure = draw_over_time(record, "interface", "Base shear, axial force and moments over time", words, rows)
    return [figure, Table("Exchange", ("Quantity", "Value"), facts)]

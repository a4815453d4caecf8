"""Section of a run report on the points of a specimen: displacement relative to its base, absolute acceleration."""

import xarray as xr

from ...data.channels import column_units
from ...data.metrics import channel, labels
from .page import Block
from .plots import Row, palette_traces
from .run_components import draw_over_time
from .scales import SCALES

__all__ = ["point_blocks"]

_SHOWN = (("displacement", "m", "Displacement"), ("acceleration", "m/s2", "Acceleration"))
_TURNING = {"m": "rad", "m/s2": "rad/s2"}


def point_blocks(record: xr.Dataset) -> list[Block]:
    """Return displacements and accelerations of the specimen's points; the record must have some."""
    names, rows = labels(record, "specimen_point"), []
    for quantity, unit, title in _SHOWN:
        values = channel(record, f"specimen_{quantity}")
        units = column_units(record[f"specimen_{quantity}"])
        for its, scale in ((unit, quantity), (_TURNING[unit], f"rotation {quantity}".removesuffix(" displacement"))):
            own = [k for k, u in enumerate(units) if u == its]
            if own:
                traces = palette_traces([names[k] for k in own], values[:, own])
                rows.append(Row(title if its == unit else f"{title}, turning", traces, SCALES[scale]))
    words = "Displacement of the specimen's points relative to its base, and their absolute acceleration."
    return [draw_over_time(record, "specimen-points", "Specimen points over time", words, rows)]

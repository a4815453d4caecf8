"""NI TDMS files: channels in groups, each with its sample interval and unit among its properties."""

from io import BytesIO

import numpy as np

from .arrays import Leaf, raws_of_leaves
from .raw import RawTest

__all__ = ["read_tdms"]


def read_tdms(content: bytes, source: str, form: str) -> tuple[RawTest, ...]:
    """Read a TDMS file."""
    from nptdms import TdmsFile

    leaves: list[Leaf] = []
    file = TdmsFile.read(BytesIO(content))
    for group in file.groups():
        path = (group.name,) if len(file.groups()) > 1 else ()
        for channel in group.channels():
            values = np.asarray(channel[:])
            if values.dtype.kind not in "fiu" or values.size < 2:
                continue
            step, unit = (channel.properties.get(key) for key in ("wf_increment", "unit_string"))
            known = float(step) if step and float(step) > 0 else None
            leaves.append(Leaf(path, channel.name, values, str(unit) if unit else None, known))
    facts = {str(name): str(value) for name, value in file.properties.items()}
    return raws_of_leaves(leaves, facts, source, form)

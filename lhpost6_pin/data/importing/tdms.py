"""NI TDMS files: channels in groups, each with its sample interval and unit among its properties."""

from io import BytesIO

import numpy as np

from ...core.errors import RecordError
from .arrays import Leaf, raws_of_leaves
from .raw import RawTest

__all__ = ["read_tdms"]


def read_tdms(content: bytes, source: str) -> tuple[RawTest, ...]:
    """Read a TDMS file; raises RecordError naming the file, or the package that is missing."""
    try:
        from nptdms import TdmsFile
    except ModuleNotFoundError as error:
        raise RecordError(f"{source}: reading TDMS needs nptdms: pip install 'lhpost6-pin[formats]'") from error
    leaves: list[Leaf] = []
    try:
        file = TdmsFile.read(BytesIO(content))
        facts = {str(name): str(value) for name, value in file.properties.items()}
        several = len(file.groups()) > 1
        for group in file.groups():
            for channel in group.channels():
                values = np.asarray(channel[:])
                if values.dtype.kind not in "fiu" or values.size < 2:
                    continue
                step = channel.properties.get("wf_increment")
                unit = channel.properties.get("unit_string")
                path = (group.name,) if several else ()
                known = float(step) if step and float(step) > 0 else None
                leaves.append(Leaf(path, channel.name, values, str(unit) if unit else None, known))
    except Exception as error:  # a damaged file makes nptdms raise nearly anything
        raise RecordError(f"{source}: not a TDMS file, or damaged: {error}; export it again") from error
    return raws_of_leaves(leaves, source, "TDMS file", facts)

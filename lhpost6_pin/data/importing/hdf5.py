"""HDF5 and netCDF files: datasets along time, with their `units`, and time beside them or as a step in an attribute."""

from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..records import DEFLATE_LIMIT
from .arrays import Leaf, leaves_of, raws_of_leaves
from .raw import RawTest

__all__ = ["read_hdf5", "read_netcdf3", "text_of", "values_of"]


def read_hdf5(content: bytes, source: str, form: str) -> tuple[RawTest, ...]:
    """Read an HDF5 or netCDF-4 file."""
    import h5py

    leaves: list[Leaf] = []
    with h5py.File(BytesIO(content), "r") as file:
        _walk(file, (), None, leaves)
        facts = {text_of(name): text_of(value) for name, value in file.attrs.items() if np.size(value) == 1}
    return raws_of_leaves(leaves, facts, source, form)


def read_netcdf3(content: bytes, source: str, form: str) -> tuple[RawTest, ...]:
    """Read a classic netCDF file."""
    import xarray as xr

    with xr.open_dataset(BytesIO(content), engine="scipy", decode_times=False) as dataset:
        leaves = [
            Leaf((), str(name), item.values, item.attrs.get("units"), None, _coords(item))
            for name, item in ((name, dataset[name]) for name in dataset.variables)
            if item.dtype.kind in "fiu" and item.size > 1
        ]
        facts = {str(name): text_of(value) for name, value in dataset.attrs.items() if np.size(value) == 1}
    return raws_of_leaves(leaves, facts, source, form)


def _walk(group: Any, path: tuple[str, ...], step: float | None, leaves: list[Leaf]) -> None:
    import h5py

    step = _step(group) or step
    for name, item in ((text_of(name), item) for name, item in group.items()):
        if isinstance(item, h5py.Group):
            _walk(item, (*path, name), step, leaves)
        elif item.dtype.kind in "fiu" and (item.size or 0) > 1 and not _is_bare_dimension(item):
            unit = item.attrs.get("units", item.attrs.get("unit"))
            text = text_of(unit) if unit is not None else None
            leaves.append(Leaf(path, name, values_of(item), text, _step(item) or step, _labels(item, name)))


def values_of(item: Any) -> NDArray[Any]:
    """Values of a dataset; raises ValueError if it claims more than so small a file can hold."""
    if item.size and item.nbytes > DEFLATE_LIMIT * item.file.id.get_filesize():
        raise ValueError(f"{item.name} claims {item.nbytes / 1e9:.3g} GB, more than so small a file can hold")
    return np.asarray(item[()])


def _is_bare_dimension(item: Any) -> bool:
    """Whether a dataset only gives the size of a netCDF dimension."""
    return text_of(item.attrs.get("NAME", "")).startswith("This is a netCDF dimension but not a netCDF variable")


def _step(item: Any) -> float | None:
    found, _ = leaves_of({**item.attrs, "values": np.zeros(2)})
    return next(leaf.step for leaf in found if leaf.name == "values")


def _labels(dataset: Any, name: str) -> tuple[str, ...]:
    """Column names from the labelled dimension of a table, as in `platen_displacement_x`."""
    scales = [dim[0] for dim in dataset.dims if len(dim)]
    texts = [[text_of(v) for v in scale[()]] for scale in scales if scale.dtype.kind in "OSU" and scale.ndim == 1]
    fitting = [labels for labels in texts if dataset.ndim == 2 and len(labels) == dataset.shape[1]]
    return tuple(f"{name}_{label}" for label in fitting[0]) if fitting else ()


def _coords(variable: Any) -> tuple[str, ...]:
    """Column names, likewise, of a table that xarray has read."""
    dim = variable.dims[-1]
    known = variable.ndim == 2 and dim in variable.coords and variable[dim].dtype.kind in "OSU"
    return tuple(f"{variable.name}_{text_of(label)}" for label in variable[dim].values) if known else ()


def text_of(value: Any) -> str:
    """A text, also of bytes that are no UTF-8; anything else in words."""
    item = value.item() if isinstance(value, np.ndarray | np.generic) and np.size(value) == 1 else value
    return item.decode("utf-8", "replace") if isinstance(item, bytes) else str(item)

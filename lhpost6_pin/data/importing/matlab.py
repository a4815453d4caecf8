"""MATLAB `.mat` files: v4 to v7 through scipy, v7.3 (which is HDF5) through h5py; structs, cells and time vectors."""

import warnings
from io import BytesIO
from typing import Any

import numpy as np

from .arrays import leaves_of, raws_of_leaves
from .hdf5 import text_of, values_of
from .mat5 import is_mat5, unpacked_mat5
from .raw import RawTest

__all__ = ["read_mat", "read_mat73"]


def read_mat(content: bytes, source: str, form: str) -> tuple[RawTest, ...]:
    """Read a `.mat` file up to v7."""
    from scipy.io import loadmat

    if is_mat5(content):
        content = unpacked_mat5(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # scipy warns where it guesses: two variables of one name
        tree = loadmat(BytesIO(content), simplify_cells=True)
    return raws_of_leaves(*leaves_of({k: v for k, v in tree.items() if not k.startswith("__")}), source, form)


def read_mat73(content: bytes, source: str, form: str) -> tuple[RawTest, ...]:
    """Read a `.mat` file of v7.3."""
    import h5py

    with h5py.File(BytesIO(content), "r") as file:
        named = {text_of(name): item for name, item in file.items()}
        tree = {name: _value(item) for name, item in named.items() if not name.startswith("#")}
    return raws_of_leaves(*leaves_of(tree), source, form)


def _value(item: Any) -> Any:
    """Plain value of an object in a v7.3 file: a dict, a text, a list, or an array with MATLAB's order of axes."""
    import h5py

    if isinstance(item, h5py.Group):
        return {text_of(name): _value(child) for name, child in item.items()}
    if item.attrs.get("MATLAB_empty"):
        return []
    if h5py.check_ref_dtype(item.dtype) is not None:
        return [_value(item.file[reference]) for reference in np.ravel(values_of(item).T)]
    if item.attrs.get("MATLAB_class") == b"char":
        return "".join(map(chr, np.ravel(values_of(item))))
    return np.squeeze(values_of(item).T)

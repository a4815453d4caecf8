"""A record as the bytes of a netCDF-4 file, in memory: HDF5 that meets a full disk crashes the process when it closes.

Numbers and labels are written by h5netcdf itself: `Dataset.to_netcdf` first imports all of Dask, where it is installed,
to see whether it has any part in the dataset. That takes longer than all else of writing a record; without Dask both
are as fast.
"""

import io
from typing import Any

import h5netcdf
import h5py
import numpy as np
import xarray as xr

__all__ = ["netcdf_content"]


def netcdf_content(dataset: xr.Dataset, *, single: bool = False) -> memoryview:
    """Content of a netCDF-4 file of a dataset without encoding, uncompressed, no fill values; as `xarray` writes it.

    Where `single`, variables in float64 are written in float32, but for coordinates.
    Raises TypeError or ValueError for variables or attributes that netCDF does not hold.
    """
    short = {name for name, variable in dataset.data_vars.items() if single and variable.dtype == float}
    plain = all(_is_plain(variable) for variable in dataset.variables.values())
    if not plain or set(dataset.coords) - set(dataset.dims):
        none: dict[str, Any] = {"_FillValue": None}
        encoding = {name: none | ({"dtype": "f4"} if name in short else {}) for name in dataset.data_vars}
        return dataset.to_netcdf(engine="h5netcdf", encoding=encoding)
    content = io.BytesIO()
    with h5netcdf.File(content, "w") as file:
        file.attrs.update(dataset.attrs)
        file.dimensions = dict(dataset.sizes)
        for name, variable in dataset.variables.items():
            text = variable.dtype.kind in "OU"
            values = variable.values.astype(object) if text else variable.values
            kind = h5py.string_dtype() if text else np.dtype("f4") if name in short else variable.dtype
            made = file.create_variable(str(name), variable.dims, kind, data=values)
            made.attrs.update(variable.attrs)
    return content.getbuffer()


def _is_plain(variable: xr.Variable) -> bool:
    """Whether a variable holds real numbers or text."""
    values: np.ndarray[Any, Any] = variable.values
    return values.dtype.kind in "fiuU" or (
        values.dtype.kind == "O" and all(isinstance(value, str) for value in values.flat)
    )

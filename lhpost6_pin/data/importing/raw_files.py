"""Open a data file of a test in any readable format, recognised by its content (MATLAB v4 by its suffix)."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from ...core.errors import RecordError
from ...core.files import reason_of
from .hdf5 import read_hdf5, read_netcdf3
from .matlab import read_mat, read_mat73
from .mts469d import is_469d, read_469d
from .raw import RawTest, need_package
from .tdms import read_tdms
from .text_tables import read_parquet, read_table

__all__ = ["READABLE", "load_raw"]

READABLE = "MTS 469D (binary or text), CSV or other text, MATLAB .mat, HDF5, netCDF, TDMS, Parquet"


class _Format(NamedTuple):
    """A binary format that a library reads; `read` takes content, file and the format's name."""

    magic: bytes
    article: str
    name: str
    read: Callable[[bytes, str, str], RawTest | tuple[RawTest, ...]]
    package: str = ""  # of the extra `formats`


_MATLAB = _Format(b"MATLAB 5.0", "a", "MATLAB file", read_mat)
_FORMATS = (
    _MATLAB,
    _Format(b"MATLAB 7.3", "a", "MATLAB v7.3 file", read_mat73),
    _Format(b"\x89HDF\r\n\x1a\n", "an", "HDF5 file", read_hdf5),
    _Format(b"CDF\x01", "a", "netCDF file", read_netcdf3),
    _Format(b"CDF\x02", "a", "netCDF file", read_netcdf3),
    _Format(b"TDSm", "a", "TDMS file", read_tdms, "nptdms"),
    _Format(b"PAR1", "a", "Parquet file", read_parquet, "pyarrow"),
)


def load_raw(path: Path | str) -> tuple[RawTest, ...]:
    """Read all channels of a file, those of one sampling together.

    Raises RecordError naming the file, and where known the channel, line or sample, for whatever cannot be read.
    """
    path = Path(path)
    source = str(path)
    if path.is_dir():
        raise RecordError(f"{source}: is a folder; name the data files in it")
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise RecordError(f"{source}: no such file") from None
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        raise RecordError(f"{source}: cannot be read: {reason_of(error)}") from error
    if not content.strip():
        raise RecordError(f"{source}: is empty")
    known = next((form for form in _FORMATS if content.startswith(form.magic)), None)
    if known is None and path.suffix.lower() == ".mat":  # v4 has no magic
        known = _MATLAB
    if is_469d(content):
        return (read_469d(content, source),)
    if known is not None:
        return _read(known, content, source)
    if b"\0" in content[:4096] and content[:2] not in (b"\xff\xfe", b"\xfe\xff"):  # and no text in UTF-16
        raise RecordError(f"{source}: unknown format; readable are {READABLE}")
    return (read_table(content, source),)


def _read(form: _Format, content: bytes, source: str) -> tuple[RawTest, ...]:
    if form.package:
        need_package(form.package, f"{source}: reading a {form.name}")
    try:
        found = form.read(content, source, form.name)
    except RecordError:
        raise
    except Exception as error:  # a damaged file makes the libraries raise nearly anything
        what = f"not {form.article} {form.name}, or damaged: {error}"
        raise RecordError(f"{source}: {what}; export it again") from error
    return found if isinstance(found, tuple) else (found,)

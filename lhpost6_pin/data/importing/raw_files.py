"""Open a data file of a test, whatever its format; the content decides, the suffix hardly."""

from collections.abc import Callable
from pathlib import Path

from ...core.errors import RecordError
from ...core.files import reason_of
from .hdf5 import read_hdf5, read_netcdf3
from .matlab import read_mat, read_mat73
from .mts469d import is_469d, read_469d
from .raw import RawTest
from .tdms import read_tdms
from .text_tables import read_parquet, read_table

__all__ = ["READABLE", "load_raw"]

READABLE = "MTS 469D (binary or text), CSV or other text, MATLAB .mat, HDF5, netCDF, TDMS, Parquet"

_Reader = Callable[[bytes, str], RawTest | tuple[RawTest, ...]]

_MAGIC: tuple[tuple[bytes, _Reader], ...] = (
    (b"MATLAB 5.0", read_mat),
    (b"MATLAB 7.3", read_mat73),
    (b"\x89HDF\r\n\x1a\n", read_hdf5),
    (b"CDF\x01", read_netcdf3),
    (b"CDF\x02", read_netcdf3),
    (b"TDSm", read_tdms),
    (b"PAR1", read_parquet),
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
    found = _reader(content, path)(content, source)
    return found if isinstance(found, tuple) else (found,)


def _reader(content: bytes, path: Path) -> _Reader:
    if is_469d(content):
        return read_469d
    for magic, reader in _MAGIC:
        if content.startswith(magic):
            return reader
    if path.suffix.lower() == ".mat":  # v4 has no magic
        return read_mat
    utf16 = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    if b"\0" in content[:4096] and not utf16:
        raise RecordError(f"{path}: is in no format known here; readable are {READABLE}")
    return read_table

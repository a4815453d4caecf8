"""Shipped data, reading TOML, and atomic writing of files."""

import errno
import hashlib
import os
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from .errors import UnknownNameError

__all__ = ["find_shipped", "models_folder", "read_toml", "reason_of", "refuse_folder", "shipped"]
__all__ += ["shipped_specimens", "sources_digest", "write_whole"]


_SPECIMENS = (".urdf", ".toml", ".npz", ".mat")
"""Files of specimens; of several with one name the first counts."""


def models_folder() -> Path:
    """Folder of machine files, URDFs and ground motions: inside the installed package, else beside it."""
    package = Path(__file__).parents[1]
    installed = package / "models"
    return installed if installed.is_dir() else package.parent / "models"


@cache
def sources_digest(*folders: Path) -> str:
    """Digest of modules and data files in folders, the package's by default: another state of it may make others."""
    digest = hashlib.sha256()
    folders = folders or (Path(__file__).parents[1], models_folder())
    for pattern in ("*.py", "*.toml"):
        for source in sorted(one for folder in folders for one in folder.rglob(pattern)):
            digest.update(source.read_bytes())
    return digest.hexdigest()


def shipped(folder: str = "", suffix: str = ".toml") -> dict[str, Path]:
    """Files in a folder of the shipped data, by name."""
    return {path.stem: path for path in sorted((models_folder() / folder).glob(f"*{suffix}"))}


def shipped_specimens() -> dict[str, Path]:
    """Shipped specimens by name; a TOML beside a URDF states its joints and is no specimen of its own."""
    return {name: path for suffix in reversed(_SPECIMENS) for name, path in shipped("specimens", suffix).items()}


def find_shipped(kind: str, name: str, folder: str = "", suffix: str = ".toml") -> Path:
    """File of the shipped data by name.

    Raises UnknownNameError, in which `kind` names the kind of file; it proposes also a file of the user's with that
    stem.
    """
    known = shipped(folder, suffix)
    if name not in known:
        own = f"{name}{suffix}"
        raise UnknownNameError(kind, name, [*known, *([own] if Path(own).is_file() else [])])
    return known[name]


def read_toml(path: "Path | str") -> dict[str, Any]:
    """Content of a TOML file; raises OSError, or ValueError naming the key or line."""
    try:
        tree = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        _refuse_long_numbers(tree, "")
    except RecursionError:
        raise ValueError("nested too deeply") from None
    return tree


def _refuse_long_numbers(value: object, key: str) -> None:
    """Raise ValueError for whole numbers beyond TOML's 64 bits; Python reads longer ones, but cannot print them all."""
    if isinstance(value, dict):
        for name, item in value.items():
            _refuse_long_numbers(item, f"{key}.{name}".lstrip("."))
    elif isinstance(value, list):
        for item in value:
            _refuse_long_numbers(item, key)
    elif isinstance(value, int) and value.bit_length() > 63:
        raise ValueError(f"{key} is a whole number of more than 64 bits")


def reason_of(error: Exception) -> str:
    """Message of the operating system for a failed file operation, without Python's error number."""
    return getattr(error, "strerror", None) or str(error)


def refuse_folder(folder: "Path | str") -> None:
    """Raise OSError naming the path in the way if no file can be written below `folder`; leaves nothing on disk.

    A long computation checks its folder first and makes it with the first result.
    """
    path = Path(folder).absolute()
    with suppress(FileNotFoundError, NotADirectoryError):
        os.lstat(path)  # raises for a name that is too long
    nearest = next(p for p in (path, *path.parents) if os.path.lexists(p))
    reason = 0 if nearest.is_dir() else errno.ENOTDIR
    if not reason:
        try:
            tempfile.TemporaryFile(dir=nearest).close()  # permissions do not suffice: /proc takes no files of root's
        except OSError as error:
            reason = errno.EACCES if error.errno == errno.ENOENT else error.errno or errno.EACCES
    if reason:
        raise OSError(reason, os.strerror(reason), str(nearest))


@contextmanager
def write_whole(path: "Path | str") -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` only if the block succeeds.

    An interrupted or failed write leaves the previous file, never an incomplete one.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=target.suffix)
    os.close(handle)
    beside = Path(name)
    try:
        yield beside
        umask = os.umask(0)
        os.umask(umask)
        beside.chmod(0o666 & ~umask)  # mkstemp makes private files; results get the ordinary permissions
        beside.replace(target)
    except OSError as error:
        if error.errno and error.filename is None:  # the error of a full disk names no file
            error.filename = str(target)
        raise
    finally:
        beside.unlink(missing_ok=True)

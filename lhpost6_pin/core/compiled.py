"""The `compiled` decorator: numba with a disk cache that is private, always fresh and optional.

The cache folder is keyed by the text of every module with a compiled function and of those whose constants it imports,
and by the versions of numba and Python: an edit of these, or of a function that they call, invalidates the cache; an
edit of any other module does not. The folder belongs to one user, because numba's cache consists of pickles, and
reading another user's would execute his code. Without a writable folder, functions compile in memory, with a warning.
"""

import hashlib
import logging
import os
import platform
import re
import shutil
import stat
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from .files import refuse_folder

__all__ = ["BOOLEAN", "INTEGER", "MATRIX", "SCALAR", "VECTOR"]
__all__ += ["cache_folder", "compiled", "compiled_inline", "compiled_source", "copy_scaled", "entry_point"]
__all__ += ["tuple_type"]

log = logging.getLogger(__name__)

BOOLEAN, INTEGER, SCALAR = numba.boolean, numba.int64, numba.float64
VECTOR, MATRIX = SCALAR[::1], SCALAR[:, ::1]
"""Types of arguments, for `entry_point`: arrays are contiguous, in C order."""

_F = TypeVar("_F", bound=Callable[..., Any])
_CONSTANT_IMPORT = re.compile(r"^from (\.+)([\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
_COMPILED = b"@compiled", b"@intrinsic"
"""Marks of a module of compiled code."""
_KEEP = 4
"""Number of cache folders of older sources that are kept, newest first."""
_ROOM = 50e6
"""Free bytes required for the cache: four times its full size."""


@cache
def source_key() -> str:
    """Digest of the sources of compiled code and of the versions of compiler and interpreter."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for source in sorted(_compiled_sources(package)):
        digest.update(source.relative_to(package).as_posix().encode())
        digest.update(source.read_bytes())
    digest.update(f"{numba.__version__} {platform.python_version()} {platform.machine()}".encode())
    return digest.hexdigest()[:16]


def _compiled_sources(package: Path) -> set[Path]:
    """Modules with a compiled or intrinsic function, and those whose constants (names in capitals) they import."""
    found: set[Path] = set()
    texts = ((path, path.read_bytes()) for path in package.rglob("*.py"))
    remaining = [path for path, text in texts if any(mark in text for mark in _COMPILED)]
    while remaining:
        source = remaining.pop()
        if source in found:
            continue
        found.add(source)
        for dots, module, names in _CONSTANT_IMPORT.findall(source.read_text(encoding="utf-8")):
            if any(name.isupper() for name in re.findall(r"\w+", names)):
                stem = source.parents[len(dots) - 1].joinpath(*filter(None, module.split(".")))
                remaining += [p for p in (stem.with_suffix(".py"), stem / "__init__.py") if p.is_file()]
    return found


@cache
def cache_folder() -> Path | None:
    """Folder of the compiled code of this source, or None where no private folder can be written.

    Tried in turn: $LHPOST6_CACHE_DIR, $XDG_CACHE_HOME, ~/.cache, and a folder named after the user in the
    temporary directory.
    """
    for base in _candidates():
        folder = base / source_key()
        with suppress(OSError):
            base.mkdir(parents=True, exist_ok=True, mode=0o700)  # in two steps: parents=True gives the mode to the last
            folder.mkdir(exist_ok=True, mode=0o700)
            refuse_folder(folder)
            if _private(base) and shutil.disk_usage(folder).free > _ROOM:
                _drop_old(base, folder)
                return folder
    log.warning(
        "no private folder with 50 MB free for compiled code can be written: this run compiles anew (about half a "
        "minute); set LHPOST6_CACHE_DIR to a folder of your own to keep it"
    )
    return None


def compiled(function: _F) -> _F:
    """Compile a function with numba (no Python objects, GIL released), cached on disk.

    Multiply-adds may fuse and divisions become products with a reciprocal, so rounding differs from that of the pure
    Python original, ``.py_func``, which is the reference in tests.
    """
    return _jit(function)


def compiled_inline(function: _F) -> _F:
    """As `compiled`, inlined in every compiled caller: for parts of a step that return numbers and make no array.

    An array argument is seven words: to pass a dozen of them once a step costs as much as the work of the function, and
    so does counting references; the caller holds the arrays, so none may be returned. Views of `core.packed` may.
    """
    return _jit(function, forceinline=True, _nrt=False)


def compiled_source(function: _F) -> _F:
    """As `compiled`, its source inlined in compiled callers: for a part that a run compiles in one caller only.

    As such it is compiled once; a part called, or inlined by `compiled_inline`, is compiled for itself as well.
    """
    return _jit(function, inline="always")


def tuple_type(kind: type[tuple[Any, ...]], *fields: Any) -> Any:
    """Type of a NamedTuple whose fields are of these types, as an argument."""
    return numba.types.NamedTuple(fields, kind)


def entry_point(function: Callable[..., Any], types: tuple[Any, ...]) -> Callable[..., Any]:
    """Compiled code of a function for arguments of these types, without the dispatcher's look at each: half a call.

    Nothing checks the arguments: an array of another type or order is read as if it were of this one.
    """
    return cast(Any, function).compile(types)


def _jit(function: _F, **more: Any) -> _F:
    """Compiled function; where compiled code calls it, of a second copy without the wrapper for calls from Python.

    The wrapper is a fifth of what a function takes to compile, and most are called by compiled code alone. Both copies
    are compiled at their first call, each with a cache of its own.
    """
    called = _dispatcher(function, "", more)
    part = cache(lambda: _dispatcher(function, "parts", {**more, "no_cpython_wrapper": True}))
    # what numba asks the function that compiled code names, for types and for code; without this it would work as well
    called.get_call_template = lambda args, kws: part().get_call_template(args, kws)
    called.get_overload = lambda signature: part().get_overload(signature)
    return cast(_F, called)


def _dispatcher(function: Callable[..., Any], subfolder: str, more: dict[str, Any]) -> Any:
    """Dispatcher of numba for a function, with its cache in a subfolder."""
    folder = cache_folder()
    config = cast(Any, numba.config)
    before = config.CACHE_DIR
    config.CACHE_DIR = "" if folder is None else str(folder / subfolder)
    fastmath = {"contract", "nsz", "arcp"}
    options: Any = {"error_model": "numpy", "nogil": True, "fastmath": fastmath, **more}
    options["no_cfunc_wrapper"] = True  # nothing calls compiled functions from C; each wrapper is compiled, too
    try:
        return numba.njit(cache=folder is not None, **options)(function)
    finally:
        config.CACHE_DIR = before


def _candidates() -> list[Path]:
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    found = []
    if chosen := os.environ.get("LHPOST6_CACHE_DIR"):
        found.append(Path(chosen) / f"user-{user}")
    if xdg := os.environ.get("XDG_CACHE_HOME"):
        found.append(Path(xdg) / "lhpost6_pin")
    home = os.path.expanduser("~")
    if home not in ("~", "/"):
        found.append(Path(home) / ".cache" / "lhpost6_pin")
    found.append(Path(tempfile.gettempdir()) / f"lhpost6_pin-{user}")
    return found


def _private(folder: Path) -> bool:
    """True if the folder is a real folder of this user that no one else may write."""
    if not hasattr(os, "getuid"):
        return True
    info = folder.lstat()
    others = stat.S_IWGRP | stat.S_IWOTH
    return stat.S_ISDIR(info.st_mode) and info.st_uid == os.getuid() and not info.st_mode & others


def _drop_old(base: Path, current: Path) -> None:
    """Remove the caches of old sources, so that a developer's folder does not grow without bound."""
    others = [p for p in base.iterdir() if p.is_dir() and p != current]
    for old in sorted(others, key=lambda p: p.stat().st_mtime, reverse=True)[_KEEP:]:
        shutil.rmtree(old, ignore_errors=True)


@compiled_inline
def copy_scaled(factor, x, out):  # type: ignore[no-untyped-def]
    """Fill out (n,) with `factor` times x (n,).

    numba takes seconds to compile the first `out[:] = x` of a process: for the text of the error that shapes differ.
    """
    for k in range(out.size):
        out[k] = factor * x[k]

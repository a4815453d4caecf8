"""Write a machine's plant as an FMU."""

import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from importlib import metadata
from pathlib import Path

from ...core.errors import SimulationError
from ...core.files import write_whole
from ...core.optional import INSTALL
from ...machine.machine import Machine
from .machine_file import save_machine_file

__all__ = ["export_fmu"]

_PROGRAM = Path(__file__).with_name("lhpost6_fmu.py")

_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{name}</title></head><body>
<h1>{name}</h1>
<p>{title}. FMI 2.0 for co-simulation, made from {origin}; all its numbers are in
<code>resources/machine.json</code>.</p>
<p>It runs in a 64-bit Python on Linux or Windows that has <code>lhpost6-pin</code> of the version in
<code>modelDescription.xml</code>. A Python program such as FMPy brings that Python itself. Any other program must
find it: on Linux its shared library comes first (<code>LD_PRELOAD=libpython3.12.so</code>, the version at hand) and its
<code>python3</code> first on <code>PATH</code>.</p>
<p>Communication steps are whole multiples of 1/2048 s. Licences are beside this page.</p>
</body></html>
"""

_WRAPPER = """
The libraries under binaries/ contain CPPFMU (https://github.com/viproma/cppfmu), under the Mozilla Public License 2.0.
"""


def export_fmu(machine: Machine, path: Path | str) -> None:
    """Write the plant of a machine as an FMU (FMI 2.0, co-simulation) that holds every number of the machine.

    Inputs are one spool command per actuator (``spool_command_H1``, ...) and the wrench of a specimen outside
    (``interface_wrench_fx``, ...); outputs are displacement, force, spool position and chamber pressures of each
    actuator, displacement, velocity and acceleration of the platen, pose, velocity and acceleration of the interface in
    axes of the platen (``interface_pose_x``, ...), and a status. Steps are whole multiples of 1/2048 s. The FMU holds
    no Python: where it runs, a Python of this platform with lhpost6_pin must be found by the program that imports it.

    Raises SimulationError without pythonfmu or for a path that does not end in .fmu, and whatever is wrong with the
    machine.
    """
    target = Path(path)
    if target.suffix != ".fmu":
        raise SimulationError(f"{target}: the name of an FMU ends in .fmu")
    try:
        from pythonfmu.builder import FmuBuilder
    except ImportError:
        raise SimulationError(f"an FMU is made by pythonfmu: {INSTALL['pythonfmu']}") from None
    with tempfile.TemporaryDirectory() as folder, write_whole(target) as beside, _own_imports():
        FmuBuilder.build_FMU(
            _PROGRAM,
            dest=beside,
            project_files=save_machine_file(machine, Path(folder)),
            documentation_folder=_write_pages(machine, Path(folder) / "documentation"),
            canHandleVariableCommunicationStepSize=False,
        )


@contextmanager
def _own_imports() -> Iterator[None]:
    """Undo what the builder does to Python's imports."""
    path = list(sys.path)
    try:
        yield
    finally:
        sys.path[:] = path
        sys.modules.pop(_PROGRAM.stem, None)


def _write_pages(machine: Machine, folder: Path) -> Path:
    """Write the FMU's documentation: a page, and the licences of what is in it."""
    licences = folder / "licenses"
    licences.mkdir(parents=True)
    facts = {"name": machine.name, "title": machine.title, "origin": machine.parameters.origin}
    page = _PAGE.format(**{key: escape(value) for key, value in facts.items()})
    (folder / "index.html").write_text(page, encoding="utf-8")
    for package, note in (("lhpost6-pin", ""), ("pythonfmu", _WRAPPER)):
        found = [f for f in metadata.files(package) or () if f.name == "LICENSE"]
        text = "".join(f.read_text() for f in found) or f"{package}: see its package\n"
        (licences / f"{package}.txt").write_text(text + note, encoding="utf-8")
    return folder

"""The option --out of commands, and the directory that it names."""

import logging
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import RecordError
from ..core.files import refuse_folder

__all__ = ["RUN_FILES", "Out", "ResumedOut", "folder_for"]

log = logging.getLogger(__name__)

RUN_FILES = ("record.nc", "report.html")
"""What a run leaves in its directory."""

Out = Annotated[
    Path | None,
    typer.Option(help="Directory of the results; default: out/NAME. Earlier files are replaced, with a warning."),
]
ResumedOut = Annotated[
    Path | None,
    typer.Option(help="Directory of the results; default: out/NAME. What was interrupted there is resumed."),
]


def folder_for(out: Path | None, name: str, *files: str, inputs: Iterable[Path] = (), own: str = "") -> Path:
    """Directory of the results, out/NAME by default; raises OSError at once if it cannot be written.

    Those of `files`, which the command will write, that are there already are a warning, unless a file `own` beside
    them shows that they are of the same results, which are resumed. RecordError for one of its `inputs` among them.
    """
    folder = out or Path("out") / name
    written = {(folder / file).resolve() for file in files}
    for path in inputs:
        if path.resolve() in written:
            raise RecordError(f"{path} would be replaced by its own results; choose another directory with --out")
    refuse_folder(folder)
    earlier = [file for file in files if (folder / file).exists()]
    if earlier and not (own and (folder / own).exists()):
        what = f"{', '.join(earlier[:3])}{f' and {len(earlier) - 3} more' * (len(earlier) > 3)}"
        log.warning("%s: %s of an earlier command will be replaced; --out names another directory", folder, what)
    return folder

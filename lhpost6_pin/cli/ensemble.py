"""The command that runs an ensemble: motions, scales, specimens and controllers on machines of uncertain numbers."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import ParameterError
from ..core.names import ENGINES
from ..core.units import numbers_in
from . import options as opt
from .app import command, print_result, progress_bar, repeating_command
from .completion import complete_motion, completing
from .motion_options import (
    FileChannels,
    FileRotate,
    FileRotations,
    FileStep,
    FileUnit,
    HighPass,
    LowPass,
    MatchSpectrum,
    RotateBy,
    SpectrumDamping,
    Taper,
    TimeScale,
    is_file,
)

if TYPE_CHECKING:
    from ..studies.plan import EnsemblePlan

__all__ = ["ensemble"]


@command()
def ensemble(
    plan: Annotated[
        list[str],
        typer.Argument(
            help=r"Plan (a TOML file with \[\[motion]]), or motions, each by name or from one file.",
            autocompletion=complete_motion,
        ),
    ],
    machines: Annotated[
        int | None, typer.Option(min=1, help="Machines drawn from the stated uncertainties; 1, the default: as stated.")
    ] = None,
    scales: Annotated[str | None, typer.Option(help="Scales of every motion, such as 0.5,0.75,1; default: 1.")] = None,
    specimen: Annotated[
        list[str] | None,
        typer.Option(help="Specimen, by name or file; none: the bare table, the default. May be repeated."),
    ] = None,
    controller: Annotated[
        list[str] | None,
        typer.Option(help="Controller settings, by name or file; default: the machine's. May be repeated."),
    ] = None,
    machine: Annotated[str | None, typer.Option(help="Shipped machine name, or a TOML file.")] = None,
    override: Annotated[Path | None, typer.Option(help="TOML file with parameters to replace, effects to add.")] = None,
    uncertain: Annotated[
        list[str] | None,
        typer.Option(help="Pattern of the numbers that are drawn, such as 'hydraulics.*'; may be repeated."),
    ] = None,
    draw: Annotated[
        str | None,
        typer.Option(
            help="Design of the draws: lhs or sobol (a power of two machines).",
            autocompletion=completing(lambda: ("lhs", "sobol")),
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the draws.")] = None,
    quantities: Annotated[
        str | None,
        typer.Option(help="Groups of results kept: tracking, limits, strengths, forces, spectra, base."),
    ] = None,
    axes: Annotated[str | None, typer.Option(help="Axes of motions named here, such as xyz, x, or x=y.")] = None,
    high_pass: HighPass = None,
    low_pass: LowPass = None,
    time_scale: TimeScale = None,
    taper: Taper = None,
    rotate_by: RotateBy = None,
    match_spectrum: MatchSpectrum = None,
    spectrum_damping: SpectrumDamping = None,
    dt: FileStep = None,
    unit: FileUnit = None,
    channels: FileChannels = None,
    rotate: FileRotate = None,
    rotation_factor: FileRotations = None,
    engine: Annotated[
        str | None,
        typer.Option(
            help="fused or pinocchio; default: the fastest that can.", autocompletion=completing(lambda: ENGINES)
        ),
    ] = None,
    jobs: opt.Processes = -1,
    dask: Annotated[
        str | None, typer.Option(help="Run on a Dask cluster: its address, or local for one on this computer.")
    ] = None,
    out: opt.ResumedOut = None,
    json: opt.Json = False,
) -> None:
    """Run a plan of many runs: motions x scales x specimens x controllers x machines; writes ensemble.nc and a report.

    Interrupted, the same command goes on where it stopped.
    """
    from ..show.ensemble_tables import ensemble_entries, print_ensemble
    from ..show.report.ensemble_report import write_ensemble_report
    from ..studies.ensemble import run_ensemble
    from ..studies.plan_file import beside
    from ..studies.store import RESULTS, open_results
    from ..studies.summary import summarise

    here = partial(beside, Path.cwd())
    given = {
        "machines": machines,
        "scales": _numbers(scales),
        "specimen": [{"name": here(name)} for name in specimen or ()] or None,
        "controller": [{"name": here(name)} for name in controller or ()] or None,
        "machine": None if machine is None else here(machine),
        "override": None if override is None else str(override.absolute()),
        "uncertain": uncertain or None,
        "draw": draw,
        "seed": seed,
        "quantities": [word.strip() for word in quantities.split(",")] if quantities is not None else None,
        "engine": engine,
    }
    processing = {
        "axes": axes,
        "high_pass": high_pass,
        "low_pass": low_pass,
        "time_scale": time_scale,
        "taper": taper,
        "rotate_by": rotate_by,
        "match_spectrum": None if match_spectrum is None else str(match_spectrum),
        "spectrum_damping": spectrum_damping,
        "dt": dt,
        "unit": unit,
        "channels": channels,
        "rotate": rotate,
        "rotation_factor": rotation_factor,
    }
    processing = {key: value for key, value in processing.items() if value is not None}
    made = _plan(plan, processing, {key: value for key, value in given.items() if value is not None})
    folder = opt.folder_for(out, made.name.replace("/", "_"), "report.html", own=RESULTS)
    count = len(made.blocks)
    blocks = f"{count} block of runs" if count == 1 else f"{count} blocks of runs"
    with progress_bar(f"{made.name}: {blocks} on {made.machine.name}") as progress:
        path = run_ensemble(made, folder, jobs=jobs, dask=dask, progress=progress)
    with open_results(path) as results:
        found = summarise(results, made.numbers)
        files = [path, write_ensemble_report(results, found, folder / "report.html", repeating_command())]
        print_result(json, lambda: ensemble_entries(found), lambda: print_ensemble(found), files)
    if found.failures or found.stopped:
        raise typer.Exit(1)


def _numbers(text: str | None) -> list[float] | None:
    if text is None:
        return None
    numbers = numbers_in(text, "1")
    if numbers is None:
        raise ParameterError(f"--scales {text}: write numbers with commas, such as 0.5,0.75,1")
    return numbers


def _plan(words: list[str], processing: dict[str, Any], given: dict[str, Any]) -> "EnsemblePlan":
    """The plan in a file, with the options given in place of its entries; or of motions with these options."""
    from ..studies.plan_file import OF_FILES, load_plan, plan_from

    if Path(words[0]).suffix == ".toml":
        if len(words) > 1:
            raise ParameterError(f"one plan at a time; got {', '.join(words)}")
        if processing:
            flag = next(iter(processing))
            raise ParameterError(
                f"--{flag.replace('_', '-')} is for motions named on the command line; a plan states {flag} of each"
            )
        return load_plan(Path(words[0]), given)
    of_files = {key: processing.pop(key) for key in OF_FILES if key in processing}
    files = [word for word in words if is_file(word)]
    if of_files and not files:
        raise ParameterError(
            f"{', '.join(words)}: --{next(iter(of_files)).replace('_', '-')} is for motions from files, and none is one"
        )
    motions = [{"files": [word], **of_files} if word in files else {"name": word} for word in words]
    entries: dict[str, Any] = {"name": f"{'_'.join(Path(word).stem for word in words)}_ensemble", **given}
    entries["motion"] = [one | processing for one in motions]
    return plan_from(entries, Path(), "ensemble")

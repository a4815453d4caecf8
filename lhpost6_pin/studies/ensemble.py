"""An ensemble: all runs of a plan, over workers, into one file; an interrupted one goes on where it stopped."""

from pathlib import Path

from ..core.arrays import Array
from ..core.progress import Progress
from .plan import Block, EnsemblePlan
from .runs import BlockInputs, block_inputs, run_block
from .store import BlockStore
from .workers import results_of, workers

__all__ = ["run_ensemble"]


def run_ensemble(
    plan: EnsemblePlan, folder: Path, *, jobs: int = -1, dask: str | None = None, progress: Progress | None = None
) -> Path:
    """Make all runs of a plan and write their results to a folder; the path of the file (`store.open_results`).

    Results are the same bit by bit for any number of `jobs` (processes, -1: one a core), on a Dask cluster (address,
    or `workers.LOCAL`), and after an interruption. A run that fails is a row with its reason.

    Raises ParameterError if the folder holds another ensemble, or is being written, or the cluster does not respond.
    """
    store, report = BlockStore(folder, plan), progress or (lambda share: None)
    if store.whole:
        report(1.0)
        return store.results
    with store.locked(), workers(jobs, dask):
        missing, every = store.missing(), len(plan.blocks)
        for done, (block, values) in enumerate(
            results_of(_numbered, ((block, block_inputs(plan, block)) for block in missing)), every - len(missing) + 1
        ):
            store.write(block, values)
            report(done / every)
        return store.assemble()


def _numbered(block: Block, inputs: BlockInputs) -> tuple[Block, dict[str, Array]]:
    """A block with its results: they come in the order in which they end."""
    return block, run_block(inputs)

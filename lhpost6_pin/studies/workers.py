"""Workers of a study: processes on this machine, or a Dask cluster; joblib is the door to both.

    with workers(jobs, dask):
        for result in results_of(function, tasks):
            ...

Results come in the order in which they end.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from joblib import Parallel, cpu_count, delayed, parallel_config

from ..core.errors import ParameterError
from ..core.optional import INSTALL

__all__ = ["LOCAL", "results_of", "workers"]

LOCAL = "local"
"""Address of a cluster that is started on this machine, a process for each job, and closed at the end."""


@contextmanager
def workers(jobs: int = -1, dask: str | None = None) -> Iterator[None]:
    """Where `results_of` computes: `jobs` processes (-1: one a core), or the Dask cluster at an address or `LOCAL`.

    Raises ParameterError where Dask is not installed or nothing responds at the address.
    """
    if dask is None:
        with parallel_config("loky", n_jobs=jobs, inner_max_num_threads=1):
            yield
        return
    with _client(jobs, dask), parallel_config("dask"):
        yield


def results_of(function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
    """Results of a function for the arguments of each task, as they come; few tasks wait at a time."""
    yield from Parallel(return_as="generator_unordered")(delayed(function)(*task) for task in tasks)


@contextmanager
def _client(jobs: int, address: str) -> Iterator[None]:
    try:
        from dask.distributed import Client, LocalCluster
    except ImportError:
        raise ParameterError(f"--dask {address}: needs Dask: {INSTALL['distributed']}") from None
    if address != LOCAL:
        try:
            client = Client(address, timeout="10s")
        except (OSError, ValueError) as error:
            raise ParameterError(
                f"--dask {address}: no scheduler responds there ({error}); start one with `dask scheduler`, or name "
                f"{LOCAL}"
            ) from error
        with client:
            yield
        return
    count = cpu_count() if jobs < 0 else jobs
    with LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster):
        yield

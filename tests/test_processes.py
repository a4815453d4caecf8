"""Work on parts by forked processes."""

import logging
import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from lhpost6_pin.core.errors import RecordError
from lhpost6_pin.core.processes import by_processes
from lhpost6_pin.core.threads import by_threads

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="by threads elsewhere")


def test_results_come_in_the_order_of_the_parts_from_other_processes():
    data = np.arange(5.0)  # which no part is sent

    def of_part(part: int) -> tuple[int, float]:
        return os.getpid(), data[part]

    ids, values = zip(*by_processes(of_part, range(5), jobs=2), strict=True)
    assert values == tuple(data)
    assert os.getpid() not in ids
    assert list(by_processes(of_part, [], jobs=2)) == []


def test_of_many_parts_the_first_is_computed_here_once():
    def place(_: int) -> int:
        return os.getpid()

    first, second = (list(by_processes(place, range(9), jobs=2)) for _ in range(2))
    assert first[0] == os.getpid()
    assert os.getpid() not in {*first[1:], *second}


def test_the_error_of_a_part_is_raised_and_ends_the_work():
    def failing(part: int) -> int:
        if part == 1:
            raise RecordError("a.nc: sample 3 is not finite")
        return part

    results = by_processes(failing, range(4), jobs=2)
    assert next(results) == 0
    with pytest.raises(RecordError, match=r"a\.nc: sample 3"):
        next(results)


def test_what_is_logged_is_logged_here(caplog):
    def warn(part: int) -> int:
        logging.getLogger("lhpost6_pin.test").warning("part %d", part)
        return part

    with caplog.at_level(logging.WARNING):
        assert list(by_processes(warn, range(3), jobs=2)) == [0, 1, 2]
    assert [record.getMessage() for record in caplog.records] == ["part 0", "part 1", "part 2"]


def test_a_process_uses_no_threads_and_no_further_processes():
    def inner(_: int) -> tuple[int, str]:
        return os.getpid(), threading.current_thread().name

    def outer(_: int) -> list[tuple[int, str]]:
        return [(os.getpid(), "MainThread"), *by_threads(inner, range(2), 2), *by_processes(inner, range(2), 2)]

    for own in by_processes(outer, range(2), jobs=2):
        assert len(set(own)) == 1


def test_a_thread_forks_no_process():
    with ThreadPoolExecutor(1) as pool:
        ids = pool.submit(lambda: list(by_processes(lambda _: os.getpid(), range(3), jobs=2))).result()
    assert set(ids) == {os.getpid()}


def test_floating_point_errors_are_handled_as_the_caller_does():
    def divide(_: int) -> float:
        return float((np.ones(1) / np.zeros(1))[0])

    with np.errstate(divide="ignore"):
        assert list(by_processes(divide, range(2), jobs=2)) == [np.inf] * 2
    with np.errstate(divide="raise"), pytest.raises(FloatingPointError):
        list(by_processes(divide, range(2), jobs=2))


@pytest.mark.parametrize(("jobs", "stated"), [(1, None), (-1, "1")])
def test_one_job_and_workers_of_joblib_fork_no_process(monkeypatch, jobs, stated):
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    if stated:
        monkeypatch.setenv("OMP_NUM_THREADS", stated)
    assert set(by_processes(lambda _: os.getpid(), range(2), jobs)) == {os.getpid()}

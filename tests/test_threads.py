"""Work on parts by threads."""

import threading

import numpy as np
import pytest

from lhpost6_pin.core.threads import by_threads


def test_results_come_in_the_order_of_the_parts():
    waits = [threading.Event() for _ in range(2)]

    def late(part: int) -> int:
        """The first part waits for the second, where there are threads for both."""
        if part == 1:
            waits[1].set()
        elif part == 0:
            waits[1].wait(0.5)
        return part

    assert list(by_threads(late, range(6))) == list(range(6))
    assert list(by_threads(late, [])) == []


def test_the_error_of_a_part_is_raised():
    def failing(part: int) -> int:
        if part == 3:
            raise ValueError("part 3")
        return part

    with pytest.raises(ValueError, match="part 3"):
        list(by_threads(failing, range(5)))


def test_floating_point_errors_are_handled_as_the_caller_does():
    def divide(part: int) -> float:
        return float((np.ones(1) / np.zeros(1))[0])

    with np.errstate(divide="ignore"):
        assert list(by_threads(divide, range(3))) == [np.inf] * 3
    with np.errstate(divide="raise"), pytest.raises(FloatingPointError):
        list(by_threads(divide, range(3)))


@pytest.mark.parametrize(("processors", "stated"), [({0}, "4"), ({0, 1}, "1")])
def test_one_processor_and_workers_of_joblib_work_without_threads(monkeypatch, processors, stated):
    monkeypatch.setattr("os.sched_getaffinity", lambda _: processors)
    monkeypatch.setenv("OMP_NUM_THREADS", stated)
    assert list(by_threads(lambda _: threading.current_thread().name, range(2))) == ["MainThread"] * 2


def test_two_processors_work_with_threads(monkeypatch):
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    assert "MainThread" not in by_threads(lambda _: threading.current_thread().name, range(2))


@pytest.mark.parametrize("jobs", [1, 3])
def test_no_more_threads_than_jobs_work_at_once(jobs):
    """With three, all three parts wait for each other; alone, one after the other would wait forever."""
    together, threads = threading.Barrier(jobs), set()

    def meet(part: int) -> int:
        threads.add(threading.get_ident())
        together.wait(10.0)
        return part

    assert list(by_threads(meet, range(3), jobs)) == [0, 1, 2]
    assert len(threads) == jobs

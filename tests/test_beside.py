"""Work beside the main thread."""

import subprocess
import sys
import threading

import pytest

from lhpost6_pin.core.beside import beside, import_all


def test_a_function_is_run_with_its_arguments_and_its_error_is_passed_over(capsys, monkeypatch):
    raised: list[object] = []
    monkeypatch.setattr(threading, "excepthook", raised.append)
    done = threading.Event()

    def fails(found: list[int], value: int) -> None:
        found.append(value)
        done.set()
        raise RuntimeError

    found: list[int] = []
    beside(fails, found, 3)
    assert done.wait(10.0)
    for thread in threading.enumerate():
        if thread.name == "fails":
            thread.join(10.0)
    assert found == [3] and not raised and not capsys.readouterr().err


def test_modules_are_imported_in_their_order(monkeypatch):
    for name in ("wave", "this_module_is_missing"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    beside(import_all, "wave", "this_module_is_missing")
    for thread in threading.enumerate():
        if thread.name == "import_all":
            thread.join(10.0)
    assert "wave" in sys.modules


@pytest.mark.long
@pytest.mark.parametrize("after", [0.0, 0.1, 0.2, 0.3, 0.4])
def test_a_process_that_ends_meanwhile_ends_as_it_would_without(after):
    """Threads that the end of the process ended aborted it, one time in thirty, within the libraries of xarray."""
    code = f"""
import sys, time
from lhpost6_pin.core.beside import beside, import_all
beside(import_all, "xarray", "lhpost6_pin.data.netcdf", "lhpost6_pin.show.run_results")
time.sleep({after})
sys.exit(3)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (3, "")

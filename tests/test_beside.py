"""Work beside the main thread."""

import sys
import threading

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
            assert thread.daemon
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

"""The cache of compiled code: private, fresh after an edit, shared by processes, and never a must."""

import json
import logging
import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lhpost6_pin
from lhpost6_pin.control import controlled, load_controller
from lhpost6_pin.core import compiled as module
from lhpost6_pin.core.compiled import VECTOR, cache_folder, compiled, compiled_inline, entry_point
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.core.packed import array_view, table_view
from lhpost6_pin.machine.machine import load_machine
from lhpost6_pin.simulation.compile_ahead import SIGNATURES
from lhpost6_pin.simulation.simulate import ClosedLoop, simulate

pytestmark = pytest.mark.long

PACKAGE = Path(lhpost6_pin.__file__).parent
POSIX = pytest.mark.skipif(not hasattr(os, "getuid"), reason="ownership and permission bits are POSIX")

FLOW = """
from lhpost6_pin.laws.orifice import port_flow
print(port_flow(1.0, 2.0, 2.0, 5e6, 0.0, 1e6, 1.0)[0])
"""
"""Calls through two functions: `port_flow` and `signed_root`."""

WHERE = "from lhpost6_pin.core.compiled import cache_folder; print(cache_folder())"
KEY = "from lhpost6_pin.core.compiled import source_key; print(source_key())"


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the package's compiled core, to edit; returns its folder."""
    folder = tmp_path / "installed" / "lhpost6_pin"
    shutil.copytree(PACKAGE, folder, ignore=shutil.ignore_patterns("__pycache__", "motions", "report"))
    return folder


def start(code: str, installed: Path, **environment: str | None) -> "subprocess.Popen[str]":
    """Start Python on the package at `installed`; a variable that is None is unset."""
    paths = {"XDG_CACHE_HOME": None, "LHPOST6_CACHE_DIR": None, "PYTHONPATH": str(installed.parent)}
    env = {k: v for k, v in {**os.environ, **paths, **environment}.items() if v is not None}
    piped = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-B", "-c", code], env=env, cwd=installed.parent, **piped)


def finish(process: "subprocess.Popen[str]") -> str:
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    return out.strip()


def outcome(code: str, installed: Path, **environment: str | None) -> str:
    return finish(start(code, installed, **environment))


def swap(file: Path, old: str, new: str):
    """Edit a file so that its size and time stay: what numba's own cache goes by."""
    before, text = file.stat(), file.read_text()
    assert old in text and len(old) == len(new)
    file.write_text(text.replace(old, new))
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))


def test_no_module_is_touched_and_an_edit_is_never_met_by_stale_code_not_even_in_a_caller(copy: Path, tmp_path: Path):
    """A read-only installation stays untouched."""
    cache, before = str(tmp_path / "cache"), sorted(copy.rglob("*"))
    for _ in range(2):  # the second time from the cache
        assert outcome(FLOW, copy, LHPOST6_CACHE_DIR=cache) == "4000.0"
    assert sorted(copy.rglob("*")) == before and list((tmp_path / "cache").rglob("*.port_flow-*.nbc"))
    swap(copy / "laws" / "orifice.py", "return math.copysign(root, x)", "return math.copysign(5.e3, x)")
    assert outcome(FLOW, copy, LHPOST6_CACHE_DIR=cache) == "10000.0"


def test_the_key_follows_what_compiled_code_is_made_of_and_nothing_else(copy: Path):
    keys = [outcome(KEY, copy)]
    # a law, a caller, constants, views
    for edited in ("laws/stribeck.py", "effects/evaluate.py", "effects/registry.py", "core/packed.py"):
        with (copy / edited).open("a") as handle:
            handle.write("# edited\n")
        keys.append(outcome(KEY, copy))
    assert len(set(keys)) == len(keys)
    (copy / "a_new_plain_module.py").write_text("x = 1\n")
    for plain in ("core/errors.py", "mechanics/plant.py", "machine/machine.py"):  # imported by callers, no constants
        with (copy / plain).open("a") as handle:
            handle.write("# edited\n")
    assert outcome(KEY, copy) == keys[-1]


@POSIX
def test_the_folder_is_its_owners_alone_whatever_the_umask(copy: Path, tmp_path: Path):
    before = os.umask(0o002)  # children inherit it
    try:
        folder = Path(outcome(WHERE, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache")))
    finally:
        os.umask(before)
    assert folder.parent == tmp_path / "cache" / f"user-{os.getuid()}"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert not folder.parent.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH)


@POSIX
def test_without_a_writable_cache_a_private_folder_in_the_temporary_directory_serves(copy: Path, tmp_path: Path):
    # below a plain file nobody, not even root, can make a folder
    nowhere = {"LHPOST6_CACHE_DIR": "/dev/null/a", "XDG_CACHE_HOME": "/dev/null/b", "HOME": "/dev/null"}
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    folder = Path(outcome(WHERE, copy, **nowhere, TMPDIR=str(temporary)))
    assert folder.parent == temporary / f"lhpost6_pin-{os.getuid()}"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@POSIX
def test_a_folder_that_others_may_write_is_refused(copy: Path, tmp_path: Path):
    shared = tmp_path / "cache" / f"user-{os.getuid()}"
    shared.mkdir(parents=True)
    shared.chmod(0o777)
    folder = outcome(WHERE, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache"), XDG_CACHE_HOME=str(tmp_path / "xdg"))
    assert Path(folder).is_relative_to(tmp_path / "xdg")


@POSIX
def test_a_link_or_another_users_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    mine = tmp_path / "mine"
    mine.mkdir(mode=0o700)
    assert module._private(mine)
    link = tmp_path / "link"
    link.symlink_to(mine)
    assert not module._private(link)
    monkeypatch.setattr(os, "getuid", lambda: mine.stat().st_uid + 1)
    assert not module._private(mine)


def test_two_processes_fill_one_cache_at_once(copy: Path, tmp_path: Path):
    both = [start(FLOW, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache")) for _ in range(2)]
    assert [finish(p) for p in both] == ["4000.0", "4000.0"]


def test_old_caches_do_not_pile_up(copy: Path, tmp_path: Path):
    folder = Path(outcome(WHERE, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache")))
    for i in range(9):
        (folder.parent / f"old{i}").mkdir()
    outcome(WHERE, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache"))
    left = list(folder.parent.iterdir())
    assert folder in left
    assert len(left) == 5


def test_where_nothing_can_be_written_functions_compile_in_memory_and_a_warning_says_so(monkeypatch, caplog):
    monkeypatch.setattr(module, "_candidates", lambda: [Path("/dev/null/a"), Path("/dev/null/b")])
    cache_folder.cache_clear()
    try:
        with caplog.at_level(logging.WARNING):
            double = compiled(_twice)
        assert double(2.0) == 4.0
        assert double.py_func is _twice
        assert not double.stats.cache_path
    finally:
        cache_folder.cache_clear()
    assert "LHPOST6_CACHE_DIR" in caplog.text


def _twice(x: float) -> float:
    return 2.0 * x


def test_what_is_compiled_ahead_of_a_run_is_what_its_steps_call():
    """Another signature would be compiled for nothing, and the right one again."""
    plant, rest, controller = controlled(load_machine(), load_controller("lhpost6"))
    drive = np.zeros((4, controller.columns))
    for engine, functions in SIGNATURES.items():
        simulate(plant, ClosedLoop(controller, drive, rest), samples=4, engine=engine)
        for function, signature in functions.items():
            assert function.signatures == [signature], function.__name__


_PAIR = np.dtype([("left", np.float64), ("right", np.float64, (2,))])


@compiled_inline
def _parts(packed):  # type: ignore[no-untyped-def]
    count = packed.size // 2
    return array_view(packed, 0, (count // 2, 2)), table_view(packed, _PAIR, count, packed.size)


@compiled
def _exchange(packed):  # type: ignore[no-untyped-def]
    """Row sums of the first half of a packed array into the records of its second, and their sums into its first."""
    numbers, pairs = _parts(packed)
    for i in range(pairs.size):
        total = pairs[i].left + pairs[i].right[0] + pairs[i].right[1]
        pairs[i].left = numbers[i].sum()
        numbers[i, 1] = total


def test_views_of_a_packed_array_are_of_its_memory_and_do_not_free_it():
    """The array keeps its only reference, whatever the number of calls: neither leaked nor freed."""
    values, expected, held = np.arange(12.0), np.arange(12.0), []
    numbers, pairs = expected[:6].reshape(3, 2), expected[6:].view(_PAIR)
    for _ in range(3):
        _exchange(values)
        held.append(sys.getrefcount(values))
        sums = numbers.sum(axis=1)[:2]
        numbers[:2, 1] = pairs["left"] + pairs["right"].sum(axis=1)
        pairs["left"] = sums
    assert held == [held[0]] * 3
    np.testing.assert_array_equal(values, expected)


def test_an_entry_point_gives_what_the_function_gives():
    direct = entry_point(_exchange, (VECTOR,))
    one, other = np.arange(12.0), np.arange(12.0)
    direct(one)
    _exchange(other)
    np.testing.assert_array_equal(one, other)


@compiled
def _square(x):  # type: ignore[no-untyped-def]
    return x * x


@compiled
def _fourth_power(x):  # type: ignore[no-untyped-def]
    return _square(_square(x))


def test_what_compiled_code_calls_is_compiled_without_a_wrapper_and_can_still_be_called_from_python():
    """In either order: numba finds a function's copy for compiled code through two of its dispatcher's methods."""
    assert _fourth_power(3.0) == 81.0
    assert not _square.signatures, "the copy that Python calls was compiled for compiled code"
    assert _square(3.0) == 9.0
    assert _square.signatures
    assert _fourth_power(3) == 81


@pytest.mark.slow  # compiles a step
def test_doctor_says_whether_the_step_was_compiled_or_loaded(copy: Path, tmp_path: Path):
    """It asked the wrong one of two copies of a function, and would have said loaded after compiling for 20 s."""
    command = "import sys; from lhpost6_pin.cli.app import main; sys.argv[1:] = ['doctor', '--json']; main()"
    models = copy.parent / "models"
    models.symlink_to(models_folder())
    found = [json.loads(outcome(command, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache"))) for _ in range(2)]
    assert [one["compiled_now"] for one in found] == [True, False]

"""The cache of compiled code: private, fresh after an edit, shared by processes, and never a must."""

import logging
import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

import lhpost6_pin
from lhpost6_pin.core import compiled as module
from lhpost6_pin.core.compiled import cache_folder, compiled

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
    variables = {
        **os.environ,
        "XDG_CACHE_HOME": None,
        "LHPOST6_CACHE_DIR": None,
        "PYTHONPATH": str(installed.parent),
        **environment,
    }
    return subprocess.Popen(
        [sys.executable, "-B", "-c", code],
        env={k: v for k, v in variables.items() if v is not None},
        cwd=installed.parent,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process: "subprocess.Popen[str]") -> tuple[str, str]:
    """What it printed and what it complained of."""
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    return out.strip(), err


def run(code: str, installed: Path, **environment: str | None) -> tuple[str, str]:
    """Run Python on the package at `installed`."""
    return finish(start(code, installed, **environment))


def swap(file: Path, old: str, new: str) -> None:
    """Edit a file so that its size and time stay: what numba's own cache goes by."""
    before = file.stat()
    text = file.read_text()
    assert old in text
    assert len(old) == len(new)
    file.write_text(text.replace(old, new))
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))


def test_an_edit_is_never_met_by_stale_code_not_even_in_a_caller(copy: Path, tmp_path: Path) -> None:
    cache = str(tmp_path / "cache")
    assert run(FLOW, copy, LHPOST6_CACHE_DIR=cache)[0] == "4000.0"
    assert run(FLOW, copy, LHPOST6_CACHE_DIR=cache)[0] == "4000.0"  # from the cache
    swap(copy / "laws" / "orifice.py", "return math.copysign(root, x)", "return math.copysign(5.e3, x)")
    assert run(FLOW, copy, LHPOST6_CACHE_DIR=cache)[0] == "10000.0"


def test_compiled_code_is_kept_in_the_cache_and_nothing_beside_the_package(copy: Path, tmp_path: Path) -> None:
    """A read-only installation stays untouched."""
    before = sorted(copy.rglob("*"))
    run(FLOW, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache"))
    assert sorted(copy.rglob("*")) == before
    assert list((tmp_path / "cache").rglob("*.port_flow-*.nbc"))


def test_the_key_follows_what_compiled_code_is_made_of_and_nothing_else(copy: Path) -> None:
    keys = [run(KEY, copy)[0]]
    for edited in ("laws/stribeck.py", "effects/evaluate.py", "effects/registry.py"):  # a law, a caller, constants
        with (copy / edited).open("a") as handle:
            handle.write("# edited\n")
        keys.append(run(KEY, copy)[0])
    assert len(set(keys)) == len(keys)
    (copy / "a_new_plain_module.py").write_text("x = 1\n")
    for plain in ("core/errors.py", "mechanics/plant.py", "machine/machine.py"):  # imported by callers, no constants
        with (copy / plain).open("a") as handle:
            handle.write("# edited\n")
    assert run(KEY, copy)[0] == keys[-1]


@POSIX
def test_the_folder_is_its_owners_alone(copy: Path, tmp_path: Path) -> None:
    folder = Path(run(WHERE, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache"))[0])
    assert folder.parent == tmp_path / "cache" / f"user-{os.getuid()}"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert not folder.parent.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH)


@POSIX
def test_a_umask_that_lets_the_group_write_does_not_lose_the_cache(copy: Path, tmp_path: Path) -> None:
    before = os.umask(0o002)  # children inherit it
    try:
        folder = Path(run(WHERE, copy, XDG_CACHE_HOME=str(tmp_path / "xdg"))[0])
    finally:
        os.umask(before)
    assert folder.is_relative_to(tmp_path / "xdg")
    assert not folder.parent.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH)


@POSIX
def test_without_a_home_or_a_writable_cache_a_private_folder_in_the_temporary_directory_serves(
    copy: Path, tmp_path: Path
) -> None:
    # below a plain file nobody, not even root, can make a folder
    nowhere = {"LHPOST6_CACHE_DIR": "/dev/null/a", "XDG_CACHE_HOME": "/dev/null/b", "HOME": "/dev/null"}
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    folder = Path(run(WHERE, copy, **nowhere, TMPDIR=str(temporary))[0])
    assert folder.parent == temporary / f"lhpost6_pin-{os.getuid()}"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@POSIX
def test_a_folder_that_others_may_write_is_refused(copy: Path, tmp_path: Path) -> None:
    shared = tmp_path / "cache" / f"user-{os.getuid()}"
    shared.mkdir(parents=True)
    shared.chmod(0o777)
    folder = run(WHERE, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache"), XDG_CACHE_HOME=str(tmp_path / "xdg"))[0]
    assert Path(folder).is_relative_to(tmp_path / "xdg")


@POSIX
def test_a_link_or_another_users_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mine = tmp_path / "mine"
    mine.mkdir(mode=0o700)
    assert module._private(mine)
    link = tmp_path / "link"
    link.symlink_to(mine)
    assert not module._private(link)
    monkeypatch.setattr(os, "getuid", lambda: mine.stat().st_uid + 1)
    assert not module._private(mine)


def test_two_processes_fill_one_cache_at_once(copy: Path, tmp_path: Path) -> None:
    both = [start(FLOW, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache")) for _ in range(2)]
    assert [finish(p)[0] for p in both] == ["4000.0", "4000.0"]


def test_old_caches_do_not_pile_up(copy: Path, tmp_path: Path) -> None:
    folder = Path(run(WHERE, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache"))[0])
    for i in range(9):
        (folder.parent / f"old{i}").mkdir()
    run(WHERE, copy, LHPOST6_CACHE_DIR=str(tmp_path / "cache"))
    left = list(folder.parent.iterdir())
    assert folder in left
    assert len(left) == 5


def test_where_nothing_can_be_written_functions_compile_in_memory_and_a_warning_says_so(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
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

"""Files are written whole or not at all, and a folder that cannot take them is refused before the work."""

import errno
import os
import stat
from pathlib import Path
from unittest import mock

import pytest

from lhpost6_pin.core import files
from lhpost6_pin.core.files import models_folder, refuse_folder, write_whole


def left_in(folder: Path) -> list[str]:
    """Names of everything in a folder, hidden files too."""
    return sorted(p.name for p in folder.iterdir())


def test_a_file_appears_with_all_its_content_and_nothing_beside_it(tmp_path):
    with write_whole(tmp_path / "new" / "folder" / "a.txt") as beside:
        assert beside.suffix == ".txt"  # writers that look at the suffix see the right one
        beside.write_text("all of it")
        assert not (tmp_path / "new" / "folder" / "a.txt").exists()
    assert (tmp_path / "new" / "folder" / "a.txt").read_text() == "all of it"
    assert left_in(tmp_path / "new" / "folder") == ["a.txt"]


@pytest.mark.parametrize("trouble", [ValueError, OSError, KeyboardInterrupt, SystemExit])
def test_a_write_that_fails_leaves_what_stood_there_before(tmp_path, trouble):
    (tmp_path / "a.txt").write_text("before")
    for name in ("a.txt", "b.txt"):
        with pytest.raises(trouble), write_whole(tmp_path / name) as beside:
            beside.write_text("half of")
            raise trouble
    assert left_in(tmp_path) == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "before"


def test_files_get_the_permissions_that_the_users_umask_asks_for(tmp_path):
    before = os.umask(0o027)
    try:
        with write_whole(tmp_path / "a.txt") as beside:
            beside.write_text("for my group to read")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o640


def test_a_folder_that_can_be_made_is_not_refused_and_not_made(tmp_path):
    refuse_folder(tmp_path)
    refuse_folder(tmp_path / "not" / "yet" / "there")
    assert left_in(tmp_path) == []


def test_a_path_below_a_regular_file_a_link_to_nowhere_or_of_too_long_a_name_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    for path in ("file", "file/below", "file/far/below", "link/out"):
        with pytest.raises(NotADirectoryError) as caught:
            refuse_folder(tmp_path / path)
        assert caught.value.filename == str(tmp_path / path.split("/")[0])
    with pytest.raises(OSError, match="File name too long"):
        refuse_folder(tmp_path / ("a" * 300) / "out")
    assert left_in(tmp_path) == ["file", "link"]


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="a folder in which not even root can write")
def test_a_folder_that_takes_no_files_is_refused(tmp_path):
    for path in (Path("/proc"), Path("/proc/x"), Path("/proc/far/below")):
        with pytest.raises(PermissionError) as caught:
            refuse_folder(path)
        assert caught.value.filename == "/proc"


def test_what_the_disk_says_of_a_folder_is_passed_on(tmp_path, monkeypatch):
    fault = OSError(errno.EROFS, "Read-only file system", str(tmp_path / "some name"))
    monkeypatch.setattr(files.tempfile, "TemporaryFile", mock.Mock(side_effect=fault))
    with pytest.raises(OSError, match="Read-only file system") as caught:
        refuse_folder(tmp_path / "out")
    assert caught.value.errno == errno.EROFS and caught.value.filename == str(tmp_path)


def test_shipped_data_is_where_the_package_looks_for_it():
    assert (models_folder() / "lhpost6.toml").is_file()
    assert (models_folder() / "ground_motions" / "index.toml").is_file()

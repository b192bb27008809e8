"""Files are written whole or not at all."""

import errno
import os
from pathlib import Path

import pytest

from drake_shared.common.errors import InputError, RunError
from drake_shared.common.files import check_writable, models_directory, replacing


def test_the_file_appears_when_it_is_complete(tmp_path):
    with replacing(tmp_path / "deep" / "log.txt") as temporary:
        temporary.write_text("whole")
        assert not (tmp_path / "deep" / "log.txt").exists()
    assert (tmp_path / "deep" / "log.txt").read_text() == "whole"
    assert os.listdir(tmp_path / "deep") == ["log.txt"]


def test_the_temporary_file_is_in_the_same_folder_so_that_renaming_is_atomic(tmp_path):
    with replacing(tmp_path / "log.txt") as temporary:
        assert temporary.parent == tmp_path


def interrupted_write(path, error) -> None:
    """Writes half of a file and raises ``error``."""
    with replacing(path) as temporary:
        temporary.write_text("hal")
        raise error


def test_an_exception_leaves_no_new_file(tmp_path):
    with pytest.raises(ZeroDivisionError):
        interrupted_write(tmp_path / "log.txt", ZeroDivisionError())
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(errno.ENOSPC, "text of a library"), "No space left on device"),
        (OSError("first line\nsecond line"), "first line second line"),
    ],
)
def test_a_failed_write_keeps_the_old_file_and_gives_the_reason_in_one_line(tmp_path, error, reason):
    (tmp_path / "log.txt").write_text("old")
    with pytest.raises(RunError) as caught:
        interrupted_write(tmp_path / "log.txt", error)
    assert str(tmp_path / "log.txt") in str(caught.value)
    assert reason in str(caught.value)
    assert os.listdir(tmp_path) == ["log.txt"]
    assert (tmp_path / "log.txt").read_text() == "old"


def test_the_umask_sets_the_permissions(tmp_path):
    before = os.umask(0o027)
    try:
        with replacing(tmp_path / "log.txt") as temporary:
            temporary.write_text("x")
    finally:
        os.umask(before)
    assert (tmp_path / "log.txt").stat().st_mode & 0o777 == 0o640


def write(path: Path) -> None:
    with replacing(path) as temporary:
        temporary.write_text("x")


def test_a_file_where_the_folder_should_be_is_bad_input(tmp_path):
    (tmp_path / "taken").write_text("")
    for attempt in (lambda: write(tmp_path / "taken" / "x"), lambda: check_writable(tmp_path / "taken")):
        with pytest.raises(InputError) as caught:
            attempt()
        assert caught.value.source == str(tmp_path / "taken")


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs a folder that refuses every file")
def test_a_folder_without_write_permission_is_bad_input():
    with pytest.raises(InputError) as caught:
        check_writable("/proc")
    assert caught.value.source == "/proc"


def test_a_folder_where_the_file_should_be_is_bad_input_and_leaves_nothing(tmp_path):
    (tmp_path / "log.txt").mkdir()
    with pytest.raises(InputError) as caught:
        write(tmp_path / "log.txt")
    assert caught.value.source == str(tmp_path / "log.txt")
    assert os.listdir(tmp_path) == ["log.txt"]


def test_a_link_is_followed_and_stays_a_link(tmp_path):
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "v1.txt").write_text("old")
    link = tmp_path / "latest.txt"
    link.symlink_to(Path("store") / "v1.txt")
    write(link)
    assert link.is_symlink()
    assert (tmp_path / "store" / "v1.txt").read_text() == "x"
    assert os.listdir(tmp_path / "store") == ["v1.txt"]


def test_a_link_to_a_file_that_does_not_exist_yet_makes_that_file(tmp_path):
    (tmp_path / "later").symlink_to(tmp_path / "new.txt")
    write(tmp_path / "later")
    assert (tmp_path / "new.txt").read_text() == "x"
    assert (tmp_path / "later").is_symlink()


def test_devices_fifos_and_links_to_themselves_are_bad_input_and_stay(tmp_path):
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "null").symlink_to("/dev/null")
    for path in (tmp_path / "fifo", tmp_path / "loop", tmp_path / "null", Path("/dev/null")):
        with pytest.raises(InputError) as caught:
            write(path)
        assert caught.value.source == str(path)
    assert sorted(os.listdir(tmp_path)) == ["fifo", "loop", "null"]
    assert (tmp_path / "fifo").is_fifo()


def test_a_file_that_exists_keeps_its_permissions(tmp_path):
    (tmp_path / "private.txt").touch(0o600)
    write(tmp_path / "private.txt")
    assert (tmp_path / "private.txt").stat().st_mode & 0o777 == 0o600


def test_checking_a_folder_leaves_no_file_in_it(tmp_path):
    check_writable(tmp_path / "logs")
    assert os.listdir(tmp_path / "logs") == []


def test_the_folder_of_shipped_files_exists():
    assert (models_directory() / "robots" / "pioneer_p3dx.sdf").is_file()

"""A file is there whole or not at all."""

import errno
import os
from pathlib import Path

import pytest

from drake_shared.common.errors import InputError, RunError
from drake_shared.common.files import check_writable, models_directory, replacing


def test_appears_under_its_name_with_what_was_written(tmp_path):
    with replacing(tmp_path / "deep" / "log.txt") as temporary:
        temporary.write_text("whole")
        assert not (tmp_path / "deep" / "log.txt").exists()
    assert (tmp_path / "deep" / "log.txt").read_text() == "whole"
    assert os.listdir(tmp_path / "deep") == ["log.txt"]


def test_temporary_file_lies_in_the_same_folder_so_that_the_renaming_is_atomic(tmp_path):
    with replacing(tmp_path / "log.txt") as temporary:
        assert temporary.parent == tmp_path


def break_off(path, error=ZeroDivisionError) -> None:
    """Writes half a file."""
    with replacing(path) as temporary:
        temporary.write_text("hal")
        raise error


def test_an_exception_leaves_nothing_new(tmp_path):
    with pytest.raises(ZeroDivisionError):
        break_off(tmp_path / "log.txt")
    assert os.listdir(tmp_path) == []


def test_an_exception_leaves_the_old_file_as_it_was(tmp_path):
    (tmp_path / "log.txt").write_text("old")
    with pytest.raises(ZeroDivisionError):
        break_off(tmp_path / "log.txt")
    assert (tmp_path / "log.txt").read_text() == "old"
    assert os.listdir(tmp_path) == ["log.txt"]


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(errno.ENOSPC, "as a library has it"), "No space left on device"),
        (OSError("no number\nand two lines"), "no number and two lines"),
    ],
)
def test_writing_that_fails_is_said_in_one_line_and_leaves_the_old_file(tmp_path, error, reason):
    (tmp_path / "log.txt").write_text("old")
    with pytest.raises(RunError) as caught:
        break_off(tmp_path / "log.txt", error)
    assert str(caught.value) == f"{tmp_path / 'log.txt'}: cannot be written ({reason})"
    assert os.listdir(tmp_path) == ["log.txt"]
    assert (tmp_path / "log.txt").read_text() == "old"


def test_file_can_be_read_by_whom_the_umask_allows(tmp_path):
    before = os.umask(0o027)
    try:
        with replacing(tmp_path / "log.txt") as temporary:
            temporary.write_text("x")
    finally:
        os.umask(before)
    assert (tmp_path / "log.txt").stat().st_mode & 0o777 == 0o640


def test_a_file_in_the_way_of_the_folder_is_bad_input(tmp_path):
    (tmp_path / "taken").write_text("")
    with (
        pytest.raises(InputError, match="taken must be a folder to write to"),
        replacing(tmp_path / "taken/x"),
    ):
        pass
    with pytest.raises(InputError, match="taken must be a folder to write to"):
        check_writable(tmp_path / "taken")


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs a folder that nobody can write to")
def test_a_folder_that_cannot_be_written_to_is_bad_input():
    with pytest.raises(InputError, match="/proc must be a folder to write to"):
        check_writable("/proc")


def test_a_folder_in_place_of_the_file_is_bad_input_and_leaves_nothing(tmp_path):
    (tmp_path / "log.txt").mkdir()
    with (
        pytest.raises(InputError, match=r"log\.txt must be a file to write"),
        replacing(tmp_path / "log.txt") as temporary,
    ):
        temporary.write_text("x")
    assert os.listdir(tmp_path) == ["log.txt"]


def test_checking_a_folder_leaves_no_trace_in_it(tmp_path):
    check_writable(tmp_path / "logs")
    assert os.listdir(tmp_path / "logs") == []


def test_shipped_files_are_found():
    assert (models_directory() / "robots" / "pioneer_p3dx.sdf").is_file()

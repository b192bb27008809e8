"""The key of a port outlives the program, for a while and for its user only."""

import os
import stat

from drake_shared.cockpit.stored_key import LIFETIME, stored_key


def test_the_next_session_on_a_port_has_the_same_key(tmp_path):
    key = stored_key(8080, tmp_path)
    assert len(key) >= 24
    assert stored_key(8080, tmp_path) == key
    assert stored_key(8081, tmp_path) != key


def test_any_port_has_a_new_key_each_time(tmp_path):
    assert stored_key(0, tmp_path) != stored_key(0, tmp_path)
    assert not list(tmp_path.iterdir())


def test_only_the_user_can_read_the_file(tmp_path):
    stored_key(8080, tmp_path)
    (file,) = tmp_path.iterdir()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_an_old_key_is_replaced(tmp_path):
    key = stored_key(8080, tmp_path)
    (file,) = tmp_path.iterdir()
    past = file.stat().st_mtime - LIFETIME - 1
    os.utime(file, (past, past))
    assert stored_key(8080, tmp_path) != key


def test_a_key_that_others_can_read_or_that_is_none_is_not_used(tmp_path):
    key = stored_key(8080, tmp_path)
    (file,) = tmp_path.iterdir()
    file.chmod(0o644)
    assert stored_key(8080, tmp_path) != key
    file.chmod(0o600)
    for text in (b"", b"short", b"\xff" * 30):
        file.write_bytes(text)
        assert len(stored_key(8080, tmp_path)) >= 24


def test_a_link_is_not_followed(tmp_path):
    target = tmp_path / "target"
    target.write_text("untouched")
    (tmp_path / "key-8080").symlink_to(target)
    stored_key(8080, tmp_path)
    assert target.read_text() == "untouched"


def test_a_folder_that_cannot_be_written_gives_a_new_key(tmp_path):
    file = tmp_path / "file"
    file.touch()
    assert stored_key(8080, file) != stored_key(8080, file)

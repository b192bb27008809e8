"""Output to closed pipes, full disks and terminals that know few characters."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

BLOCK = "from drake_shared.common.console import say, tolerant_streams\nwith tolerant_streams():\n    "


def start(code: str, **options) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", BLOCK + code], stderr=subprocess.PIPE, text=True, **options
    )


def closed_pipe() -> int:
    """The end to write to of a pipe that nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    return writer


@pytest.mark.parametrize("code", ["print('x')", "print('x' * 1_000_000); print('never printed')"])
def test_a_closed_pipe_ends_the_block_quietly(code):
    writer = closed_pipe()
    process = start(code, stdout=writer)
    os.close(writer)
    assert process.communicate(timeout=60)[1] == ""
    assert process.returncode == 0


def test_another_pipe_that_breaks_is_no_reason_to_be_quiet():
    code = "import os; r, w = os.pipe(); os.close(r); os.write(w, b'x')"
    process = start(code, stdout=subprocess.PIPE)
    assert "BrokenPipeError" in process.communicate(timeout=60)[1]
    assert process.returncode == 1


def test_messages_that_nobody_reads_do_not_stop_the_work():
    writer = closed_pipe()
    code = BLOCK + "say('a'); say('b'); print('done')"
    done = subprocess.run([sys.executable, "-c", code], stderr=writer, stdout=subprocess.PIPE, text=True)
    os.close(writer)
    assert (done.returncode, done.stdout) == (0, "done\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_is_an_error():
    with open("/dev/full", "w") as full:
        process = start("print('x')", stdout=full)
        assert "RunError" in process.communicate(timeout=60)[1]
    assert process.returncode == 1


def test_characters_that_the_terminal_does_not_know_are_escaped():
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    process = start("print('K\\u00fcche'); say('\\u2248')", stdout=subprocess.PIPE, env=environment)
    assert process.communicate(timeout=60) == ("K\\xfcche\n", "\\u2248\n")
    assert process.returncode == 0

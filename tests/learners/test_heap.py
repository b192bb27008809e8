"""Whether freed memory is kept, measured by the pages that the system has to clear."""

import ctypes
import subprocess
import sys

import numpy as np
import pytest

from drake_shared.learners.heap import kept_memory

# In a process of its own: elsewhere a hole in the heap may be large enough for a block.
COUNTED = """
import resource
import numpy as np
from drake_shared.learners.heap import kept_memory

BLOCK = 2**20

def cleared():
    begun = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(50):
        np.ones(BLOCK // 8)
    pages = BLOCK // resource.getpagesize()
    return (resource.getrusage(resource.RUSAGE_SELF).ru_minflt - begun) / pages

with kept_memory():
    print(cleared())
print(cleared())
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="the C library is not glibc")
def test_freed_blocks_are_kept_until_the_end():
    told = subprocess.run([sys.executable, "-c", COUNTED], capture_output=True, text=True, check=True)
    kept, given_back = map(float, told.stdout.split())
    assert kept < 5
    assert given_back > 40


def test_another_c_library_is_left_alone(monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", lambda name: object())
    with kept_memory():
        assert np.ones(10).sum() == 10

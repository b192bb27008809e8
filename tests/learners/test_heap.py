"""Whether freed memory is kept, by counting the pages that the system has to clear."""

import ctypes
import resource

import numpy as np
import pytest

from drake_shared.learners.heap import kept_memory

BLOCK = 2**20
PAGES = BLOCK // resource.getpagesize()


def pages_cleared(times=50):
    begun = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(times):
        np.ones(BLOCK // 8)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - begun


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="the C library is not glibc")
def test_freed_blocks_are_kept_and_in_the_end_given_back():
    with kept_memory():
        assert pages_cleared() < 5 * PAGES
    assert pages_cleared() > 40 * PAGES


def test_where_the_c_library_is_another_nothing_is_done(monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", lambda name: object())
    with kept_memory():
        assert np.ones(BLOCK).sum() == BLOCK

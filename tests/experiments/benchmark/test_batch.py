"""Trials per second and memory."""

import math

from drake_shared.experiments.benchmark import batch


def test_quick_run(setup, check_result):
    result = batch.run(setup)
    check_result(result)
    rates = result.details["trials_per_second"]
    assert set(rates) == {"1", "2"}
    assert all(rate.median > 0.0 for rate in rates.values())
    memory = result.details["memory"]
    assert memory["trials"][-1] == 20
    assert len(memory["trials"]) == len(memory["megabytes"])
    assert math.isfinite(memory["growth"])


def test_memory_of_this_process_is_known():
    assert 10.0 < batch.resident_megabytes() < 1e6

"""The group that measures many trials in lock-step."""

from drake_shared.experiments.benchmark.lockstep import run


def test_ratios_are_positive_and_name_both_engines(setup):
    result = run(setup)
    assert all(ratio.spread.low > 0.0 for ratio in result.ratios)
    assert all("lock-step" in ratio.name for ratio in result.ratios)

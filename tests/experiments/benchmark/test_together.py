"""The group that measures the training of many learners."""

from drake_shared.experiments.benchmark.together import run


def test_a_learner_costs_more_alone_than_in_a_group(setup, check_result):
    result = run(setup)
    check_result(result)
    assert result.seconds["one after the other"].median > result.seconds["in groups"].median

"""What the estimator asks a learner: when, and for which part of its grid."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.learners import load_learner
from drake_shared.robots import Arm, DiffDrive
from drake_shared.systems.prepared_learner import MOMENTS, PreparedLearner


@pytest.fixture(scope="module")
def learner():
    return load_learner("two_obstacles")


@pytest.fixture(scope="module")
def prepared(learner):
    return PreparedLearner(learner, DiffDrive())


def test_queries_are_those_later_than_now_and_the_last_one_at_the_end(prepared):
    grid = prepared.grid
    assert prepared.first_after(grid[3] - 0.01) == 3
    assert prepared.first_after(grid[3]) == prepared.first_after(grid[3] - 1e-12) == 4
    assert prepared.first_after(grid[-1]) == prepared.first_after(grid[-1] + 5.0) == len(grid) - 1
    np.testing.assert_array_equal(prepared.later[4], grid[4:])
    assert prepared.duration == grid[-1]


def test_a_prediction_is_placed_on_the_whole_grid_after_what_is_past(prepared):
    later = np.ones((5, 2))
    whole = prepared.padded(later)
    assert whole.shape == (len(prepared.grid), 2)
    assert np.isnan(whole[:-5]).all()
    np.testing.assert_array_equal(whole[-5:], later)
    assert np.isnan(prepared.padded(later[:1])[:-1]).all()


def test_expected_positions_are_compared_at_even_moments_up_to_the_end(prepared, learner):
    path = learner.demonstrations[0]
    chosen = path.ravel()[prepared.moments].reshape(MOMENTS, 2)
    shares = np.arange(1, MOMENTS + 1) / MOMENTS
    np.testing.assert_allclose(chosen[-1], path[-1])
    for share, point in zip(shares, chosen, strict=True):
        np.testing.assert_array_equal(point, path[round(share * (len(path) - 1))])


@pytest.mark.parametrize(
    ("evidence", "allowed", "uses"),
    [("pose+command", True, True), ("pose+command", False, False), ("pose", True, False)],
)
def test_the_command_is_evidence_if_learner_and_caller_say_so(learner, evidence, allowed, uses):
    other = dataclasses.replace(learner, metadata={**learner.metadata, "evidence": evidence})
    assert PreparedLearner(other, DiffDrive(), use_human_command=allowed).uses_command == uses


@pytest.mark.parametrize(("clock", "has_progress"), [("progress", True), ("time", False)])
def test_the_clock_is_the_one_that_the_learner_was_trained_with(learner, clock, has_progress):
    other = dataclasses.replace(learner, metadata={**learner.metadata, "clock": clock})
    assert (PreparedLearner(other, DiffDrive()).clock is not None) == has_progress


def test_a_learner_of_another_size_of_position_is_refused(learner):
    with pytest.raises(InputError):
        PreparedLearner(learner, Arm())

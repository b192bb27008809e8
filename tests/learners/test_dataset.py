"""Demonstrations of any rate and length on one grid."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations, sampling_weights
from drake_shared.learners.dataset import data_record, make_dataset, make_grid, normalization


def one(times, positions, **options) -> Demonstration:
    return Demonstration(times=np.array(times), positions=np.array(positions, dtype=float), **options)


def test_the_grid_goes_from_0_to_t_in_tenths_of_a_second():
    np.testing.assert_allclose(make_grid(15.0), np.arange(151) * 0.1, atol=1e-12)
    assert make_grid(0.37)[-1] == 0.37
    assert len(make_grid(0.37)) == 21
    assert len(make_grid(1e5)) == 2001


def test_a_steady_motion_is_the_same_at_any_rate_and_step():
    varying = [0.0, 0.01, 0.5, 0.6, 1.9, 2.0]
    made = make_dataset(
        Demonstrations(
            items=(
                one([0.0, 2.0], [[0.0, 1.0], [4.0, 1.0]]),
                one(varying, [[2.0 * t, 1.0] for t in varying]),
                one(np.linspace(0, 2, 100_000), np.linspace([0.0, 1.0], [4.0, 1.0], 100_000)),
            )
        )
    )
    expected = np.stack([2.0 * made.grid, np.ones(21)], axis=-1)
    np.testing.assert_allclose(made.positions, np.broadcast_to(expected, (3, 21, 2)), atol=1e-12)


def test_time_counts_from_the_first_point_and_short_demonstrations_stay_at_their_end():
    late = one([100.0, 101.0], [[0.0, 0.0], [1.0, 0.0]])
    long = one([0.0, 2.0], [[0.0, 0.0], [2.0, 0.0]])
    made = make_dataset(Demonstrations(items=(late, long)))
    assert made.grid[-1] == 2.0
    np.testing.assert_allclose(made.positions[0, [0, 5, 10, 20], 0], [0.0, 0.5, 1.0, 1.0])


def test_the_duration_can_be_set():
    item = one([0.0, 1.0], [[0.0, 0.0], [1.0, 0.0]])
    assert make_dataset(Demonstrations(items=(item,)), duration=3.0).grid[-1] == 3.0
    with pytest.raises(InputError, match="duration must be positive"):
        make_dataset(Demonstrations(items=(item,)), duration=0.0)


def test_weights_follow_the_scores_unless_unknown_or_turned_off(make_bows):
    scored = make_bows([1.0, -1.0], scores=[0.1, 0.4])
    np.testing.assert_allclose(make_dataset(scored).weights, sampling_weights([0.1, 0.4]))
    np.testing.assert_allclose(make_dataset(scored, weighted=False).weights, 0.5)
    np.testing.assert_allclose(make_dataset(make_bows([1.0, -1.0])).weights, 0.5)


def test_spread_is_the_root_of_the_mean_variance(make_bows):
    made = make_dataset(make_bows([1.0, -1.0]))
    np.testing.assert_allclose(made.mean_path[:, 1], 0.0, atol=1e-12)
    # x does not vary; y varies by sin^2, whose mean over the 41 points is 20/41.
    assert made.spread == pytest.approx(np.sqrt(0.5 * 20 / 41))
    assert made.extent == 4.0


@pytest.mark.parametrize("heights", [[0.5], [0.5, 0.5]])
def test_without_a_spread_the_extent_gives_the_scale(make_bows, heights):
    assert make_dataset(make_bows(heights)).spread == pytest.approx(0.02 * 4.0)


def test_a_robot_that_stands_still_has_a_positive_scale():
    still = one([0.0, 1.0], [[3.0, 3.0], [3.0, 3.0]])
    assert make_dataset(Demonstrations(items=(still,))).spread > 0.0


def test_positions_are_counted_from_the_mean_path_or_from_the_middle_of_all(make_bows):
    made = make_dataset(make_bows([1.0, 0.0]))
    scale, reference = normalization(made, centred=True)
    assert scale == made.spread
    np.testing.assert_array_equal(reference, made.mean_path)
    scale, reference = normalization(made, centred=False)
    assert scale == made.spread
    np.testing.assert_allclose(reference, np.broadcast_to([2.0, 0.5], made.mean_path.shape))


def test_the_record_keeps_what_is_known_of_each_source(make_bows):
    demonstrations = make_bows([1.0, -1.0])
    provenance = {"operator": "fast", "seed": np.int64(3), "human_weight": 0.5, "route": None, "mood": "good"}
    items = (demonstrations[0], dataclasses.replace(demonstrations[1], provenance=provenance))
    known = Demonstrations(items=items)
    record = data_record(known, make_dataset(known))
    assert record["demonstrations"] == 2
    assert record["data_sha256"] == make_dataset(known).digest
    assert record["sources"] == [{}, {"operator": "fast", "seed": 3, "human_weight": 0.5}]
    assert type(record["sources"][1]["seed"]) is int


def test_the_digest_identifies_the_data(make_bows):
    same = [make_dataset(make_bows([1.0, -1.0])).digest for _ in range(2)]
    assert same[0] == same[1]
    assert make_dataset(make_bows([1.0, -1.1])).digest != same[0]
    assert make_dataset(make_bows([1.0, -1.0], scores=[0.0, 1.0])).digest != same[0]

"""Demonstrations that are unlike all others."""

import numpy as np

from drake_shared.learners.dataset import make_dataset
from drake_shared.learners.route_clustering import unlike_all_others


def unlike(demonstrations) -> list[int]:
    dataset = make_dataset(demonstrations)
    return unlike_all_others(dataset.positions)


def test_one_that_goes_elsewhere_is_found_among_many(make_bows):
    rng = np.random.default_rng(0)
    heights = [*rng.normal(1.0, 0.05, 8), *rng.normal(-1.0, 0.05, 8)]
    assert unlike(make_bows(heights)) == []
    assert unlike(make_bows([*heights[:5], 3.5, *heights[5:]])) == [5]


def test_three_on_each_route_and_ten_in_all_are_enough(make_bows):
    routes = [side * height for side in (0.3, 1.7, -1.5) for height in (0.98, 1.0, 1.02)]
    assert unlike(make_bows([*routes, 3.5])) == [9]
    assert unlike(make_bows([*routes[1:], 3.5])) == []
    assert unlike(make_bows([*routes[1:], 3.5, 3.45])) == []


def test_of_few_demonstrations_each_may_be_a_route(make_bows):
    assert unlike(make_bows([1.0, -1.0, 3.5])) == []
    assert unlike(make_bows([0.5])) == []

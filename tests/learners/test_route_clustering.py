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
    routes = [route + height for route in (-4.0, 0.0, 4.0) for height in (-0.01, 0.0, 0.01)]
    assert unlike(make_bows([*routes, 8.0])) == [9]
    assert unlike(make_bows([*routes[1:], 8.0])) == []
    assert unlike(make_bows([*routes[1:], 8.0, 8.0])) == []


def test_of_few_demonstrations_each_may_be_a_route(make_bows):
    assert unlike(make_bows([1.0, -1.0, 3.5])) == []
    assert unlike(make_bows([0.5])) == []

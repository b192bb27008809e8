"""The triangles of a strip: how wide it is, that it is level, and where it is left out."""

import math

import numpy as np
import pytest

from drake_shared.systems.strip_mesh import strip_mesh


def triangles(vertices, faces) -> np.ndarray:
    """Vector areas (m, 3) of the triangles, in [m^2]; they point to where the corners turn left."""
    corners = vertices.T[faces.T]
    return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, -1.9])
@pytest.mark.parametrize("rise", [0.0, 0.5])
def test_edges_lie_half_a_width_to_each_side_of_the_curve_at_its_height(angle, rise):
    way = np.array([math.cos(angle), math.sin(angle), rise])
    center = np.array([1.0, -2.0, 0.3]) + np.linspace(0.0, 3.0, 7)[:, None] * way
    width = np.linspace(0.1, 0.4, 7)
    vertices, _ = strip_mesh(center, width)
    left, right = vertices.T[0::2], vertices.T[1::2]
    to_the_left = np.array([-math.sin(angle), math.cos(angle), 0.0])
    np.testing.assert_allclose(left, center + width[:, None] * to_the_left, atol=1e-12)
    np.testing.assert_allclose(right, center - width[:, None] * to_the_left, atol=1e-12)


def test_triangles_cover_the_strip_once_and_face_the_same_way():
    center = np.linspace([0.0, 0.0, 0.0], [3.0, 0.0, 0.0], 7)
    areas = triangles(*strip_mesh(center, np.full(7, 0.2)))
    assert areas[:, 2].sum() == pytest.approx(3.0 * 0.4)
    assert (areas[:, 2] > 0.0).all()


def test_there_are_triangles_only_between_known_points():
    center = np.linspace([0.0, 0.0, 0.0], [5.0, 0.0, 0.0], 6)
    known = np.array([True, True, False, True, True, True])
    vertices, faces = strip_mesh(center, np.full(6, 0.5), known)
    spans = np.sort(vertices[0, faces], axis=0)[[0, -1]].T
    assert sorted(map(tuple, spans)) == [(0, 1), (0, 1), (3, 4), (3, 4), (4, 5), (4, 5)]


def test_a_curve_straight_up_has_no_width_and_no_nan():
    center = np.linspace([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], 4)
    vertices, _ = strip_mesh(center, np.full(4, 0.2))
    np.testing.assert_array_equal(vertices.T, np.repeat(center, 2, axis=0))

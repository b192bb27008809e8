"""Meshcat draws about the middle of the workspace."""

import numpy as np

from drake_shared.simulation.scene_drawing import center_scene


class FakeMeshcat:
    def __init__(self):
        self.places = {}

    def SetTransform(self, path, X):
        self.places[path] = X.translation()


def test_the_middle_of_the_workspace_is_drawn_at_the_origin(scenario):
    meshcat = FakeMeshcat()
    center_scene(meshcat, scenario)
    np.testing.assert_allclose(meshcat.places["/drake"], [-2.5, 0.0, 0.0], atol=1e-12)

"""Meshcat draws about the middle of the workspace."""

import subprocess
import sys

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


COLLECTED = """
import gc, threading
from pydrake.geometry import MeshcatParams
from drake_shared.simulation.scene_drawing import start_quiet_meshcat
circle = [start_quiet_meshcat(MeshcatParams(host="localhost", port=0))]
circle.append(circle)
del circle
other = threading.Thread(target=gc.collect)
other.start()
other.join()
"""


def test_another_thread_may_collect_a_meshcat():
    subprocess.run([sys.executable, "-c", COLLECTED], check=True)

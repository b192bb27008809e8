"""LogPlayback: each row from its time to the next."""

import math

import numpy as np
import pytest
from pydrake.geometry import GeometryFrame, SceneGraph

from drake_shared.systems.log_playback import LogPlayback

TIMES = 0.05 * np.arange(4)
SIZES = {"pose": 3, "human_weight": 1, "human_command": 2, "shared_command": 2}


@pytest.fixture
def playback():
    scene_graph = SceneGraph()
    source = scene_graph.RegisterSource("test")
    frame = scene_graph.RegisterFrame(source, GeometryFrame("robot"))
    rows = {
        name: np.arange(4.0 * size).reshape(4, size) + 100 * index
        for index, (name, size) in enumerate(SIZES.items())
    }
    dut = LogPlayback(times=TIMES, rows=rows, frame=frame)
    return dut, rows, frame


def test_gives_each_row_from_its_time_to_the_next(playback):
    dut, rows, _ = playback
    context = dut.CreateDefaultContext()
    for time, row in [(0.0, 0), (0.049, 0), (0.05, 1), (0.15000000000000002, 3), (9.0, 3)]:
        context.SetTime(time)
        for name, values in rows.items():
            np.testing.assert_array_equal(dut.GetOutputPort(name).Eval(context), values[row])


def test_times_counted_in_steps_are_not_late_by_rounding(playback):
    dut, rows, _ = playback
    context = dut.CreateDefaultContext()
    context.SetTime(3 * 0.05 - 1e-12)
    np.testing.assert_array_equal(dut.GetOutputPort("pose").Eval(context), rows["pose"][3])


def test_places_the_robots_frame_at_the_pose(playback):
    dut, rows, frame = playback
    context = dut.CreateDefaultContext()
    context.SetTime(0.1)
    X_WR = dut.GetOutputPort("geometry_pose").Eval(context).value(frame)
    x, y, yaw = rows["pose"][2]
    np.testing.assert_allclose(X_WR.translation(), [x, y, 0.0])
    np.testing.assert_allclose(X_WR.rotation().matrix()[:2, 0], [math.cos(yaw), math.sin(yaw)])

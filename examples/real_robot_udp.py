"""Drives a real robot from the page, over UDP.

Usage: python examples/udp_robot.py 9000 &
       python examples/real_robot_udp.py models/learners/two_obstacles_default.safetensors

Open the printed address and click Drive. The diagram is that of the simulation with UdpPlant in place of the
simulated plant. The robot moves only while a driver holds the driver lock and its pose is fresh.
"""

from __future__ import annotations

import argparse
import signal
import threading

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pydrake.geometry import Cylinder, Rgba
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, Multiplexer
from udp_plant import UdpPlant  # examples/udp_plant.py

from drake_shared import (
    ConfidenceBlender,
    IntentionEstimator,
    MouseInput,
    WaypointController,
    load_learner,
    load_scenario,
)
from drake_shared.cockpit import CockpitServer, DriverLock, describe_now, describe_scene, start_meshcat
from drake_shared.simulation.scene_drawing import center_scene
from drake_shared.systems.driver_presence import DriverPresence
from drake_shared.systems.pose_watchdog import PoseWatchdog

PERIOD = 0.05  # Control period, in [s].
POSE_TIMEOUT = 0.15  # s


def main() -> None:
    """Runs until interrupted, then writes the log."""
    parser = argparse.ArgumentParser()
    parser.add_argument("learner", help="file of a learner for the scenario two_obstacles")
    parser.add_argument("--robot", default="127.0.0.1:9000", help="HOST:PORT of the robot")
    parser.add_argument("--port", type=int, default=8080, help="port of the page")
    parser.add_argument("--log", default="real_robot.parquet", help="file to write the log to")
    options = parser.parse_args()
    host, _, robot_port = options.robot.partition(":")
    scenario, learner = load_scenario("two_obstacles"), load_learner(options.learner)
    meshcat, driver_lock = start_meshcat(), DriverLock()

    builder = DiagramBuilder()
    mouse = builder.AddSystem(MouseInput(robot=scenario.robot, source=driver_lock))
    presence = builder.AddSystem(DriverPresence())
    estimator = builder.AddSystem(IntentionEstimator(learner=learner, robot=scenario.robot, period=PERIOD))
    controller = builder.AddSystem(WaypointController(robot=scenario.robot))
    blender = builder.AddSystem(ConfidenceBlender())
    robot = builder.AddSystem(UdpPlant((host, int(robot_port)), period=PERIOD))
    watchdog = builder.AddSystem(PoseWatchdog(timeout=POSE_TIMEOUT))
    for source, output, target, name in (
        (robot, "pose", watchdog, "pose"),
        (robot, "pose_age", watchdog, "pose_age"),
        (watchdog, "checked_pose", estimator, "pose"),
        (watchdog, "checked_pose", controller, "pose"),
        (watchdog, "fresh", robot, "pose_fresh"),
        (mouse, "mouse", presence, "mouse"),
        (presence, "present", robot, "enable"),
        (mouse, "human_command", estimator, "human_command"),
        (mouse, "human_command", blender, "human_command"),
        (estimator, "intention", controller, "intention"),
        (estimator, "confidence", blender, "confidence"),
        (controller, "autonomous_command", blender, "autonomous_command"),
        (blender, "shared_command", robot, "wheel_command"),
    ):
        builder.Connect(source.GetOutputPort(output), target.GetInputPort(name))
    columns, ports = [], []
    for system, name, names in (
        (watchdog, "checked_pose", "x y yaw"),
        (mouse, "human_command", "human_left human_right"),
        (controller, "autonomous_command", "autonomous_left autonomous_right"),
        (blender, "shared_command", "shared_left shared_right"),
        (blender, "human_weight", "human_weight"),
        (estimator, "confidence", "confidence"),
        (presence, "present", "present"),
    ):
        ports.append(system.GetOutputPort(name))
        columns += names.split()
    values = builder.AddSystem(Multiplexer([port.size() for port in ports]))
    for index, port in enumerate(ports):
        builder.Connect(port, values.get_input_port(index))
    log_sink = LogVectorOutput(values.get_output_port(), builder, PERIOD)
    simulator = Simulator(builder.Build())
    context = simulator.get_context()

    center_scene(meshcat, scenario)
    meshcat.SetObject("robot", Cylinder(0.2, 0.1), Rgba(0.2, 0.2, 0.2))
    interrupted = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: interrupted.set())
    with CockpitServer(meshcat_url=meshcat.web_url(), driver_lock=driver_lock, port=options.port) as server:
        print(server.address, flush=True)
        server.publish("scene", describe_scene(scenario, mouse, learner))
        simulator.set_target_realtime_rate(1.0)
        while not interrupted.is_set():
            simulator.AdvanceTo(context.get_time() + PERIOD)
            row = values.get_output_port().Eval(values.GetMyContextFromRoot(context))
            phase = "ready" if driver_lock.holder is None else "driving"
            server.publish("trial", {"phase": phase, "number": 0, "mode": "shared", "result": None})
            server.publish("now", describe_now(dict(zip(columns, row, strict=True)), context.get_time()))
            if np.isfinite(row[0]):
                meshcat.SetTransform("robot", RigidTransform([*row[:2], 0.05]))
    log = log_sink.FindLog(context)
    table = {"t": log.sample_times()} | dict(zip(columns, log.data(), strict=True))
    pq.write_table(pa.table(table), options.log)


if __name__ == "__main__":
    main()

"""The example that drives a real robot: page, driver lock, UDP and back, with a simulated robot."""

import asyncio
import importlib.util
import itertools
import signal
import subprocess
import sys
import threading
from pathlib import Path
from urllib.parse import urlsplit

import aiohttp
import numpy as np
import pyarrow.parquet as pq
import pytest

ROOT = Path(__file__).parents[2]
TIMEOUT = 60.0


@pytest.fixture
def robot():
    spec = importlib.util.spec_from_file_location("udp_robot", ROOT / "examples" / "udp_robot.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    simulator = module.UdpRobotSimulator()
    thread = threading.Thread(target=simulator.run)
    thread.start()
    yield simulator
    simulator.stopped.set()
    thread.join()


@pytest.fixture
def program(robot, tmp_path):
    """The example in a process, its address, and its log."""
    log = tmp_path / "log.parquet"
    command = [sys.executable, str(ROOT / "examples" / "real_robot_udp.py")]
    command += [str(ROOT / "models" / "learners" / "two_obstacles_default.safetensors"), "--port", "0"]
    command += ["--robot", "{}:{}".format(*robot.address), "--log", str(log)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        yield process, process.stdout.readline().strip(), log
        process.kill()


class Client:
    """A scripted page that holds the stick forward."""

    def __init__(self, page: aiohttp.ClientWebSocketResponse):
        self._page = page

    async def drive_until(self, condition):
        await self._page.send_json({"type": "engage"})
        async with asyncio.timeout(TIMEOUT):
            while not condition():
                await self._page.send_json({"type": "move", "x": 0, "y": 0, "forward": 0.6, "turn": 0})
                await asyncio.sleep(0.02)


async def connect(http: aiohttp.ClientSession, address: str):
    async with http.get(address) as response:
        assert response.status == 200
    origin = f"http://127.0.0.1:{urlsplit(address).port}"
    return http.ws_connect(f"{origin}/drive", origin=origin)


def stopping_time(robot, since: float) -> float:
    """Time from ``since`` to the first zero command after it, less the longest stall of this machine."""
    history = np.array(robot.history)
    stop = next(t for t, left, right in history if t > since and left == right == 0.0)
    stall = max(after - before for before, after in itertools.pairwise(history[:, 0])) - 0.01
    return stop - since - stall


def test_the_client_drives_the_robot_which_stops_without_client_or_pose(robot, program):
    process, address, log = program

    async def talk():
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as http:
            assert not any(left or right for _, left, right in robot.history)
            async with await connect(http, address) as page:
                await Client(page).drive_until(lambda: np.hypot(*robot.pose[:2]) >= 0.5)
                left = robot.history[-1][0]
            await asyncio.sleep(0.5)
            after_leaving = stopping_time(robot, left)
            rest = robot.pose

            # The driver is there again, and the localisation freezes while the robot drives.
            async with await connect(http, address) as page:
                client = Client(page)
                await client.drive_until(lambda: np.hypot(*np.subtract(robot.pose, rest)[:2]) >= 0.1)
                robot.frozen = True
                frozen = robot.history[-1][0]
                await client.drive_until(lambda: robot.history[-1][0] > frozen + 0.6)
                after_freezing = stopping_time(robot, frozen)
                assert not any(robot.history[-1][1:])
        return after_leaving, after_freezing

    after_leaving, after_freezing = asyncio.run(talk())
    assert after_leaving <= 0.2
    assert after_freezing <= 0.15 + 0.2
    process.send_signal(signal.SIGINT)
    assert process.wait(TIMEOUT) == 0
    table = pq.read_table(log)
    x = table["x"].to_numpy()
    assert np.nanmax(x) > 0.4
    assert np.isnan(x[-1])
    assert table["human_weight"].to_numpy()[-1] == 1.0

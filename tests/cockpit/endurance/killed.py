"""Ends `drive` and `teach` by mouse at random moments, in every way, and counts what was lost.

Prints a report as JSON. Exit status 1: a trial or demonstration that had ended was lost, or more than the
last second of one under way, or a program did not end.
"""

from __future__ import annotations

import argparse
import asyncio
import collections
import contextlib
import json
import multiprocessing
import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

import aiohttp
from visitor import Visitor

from drake_shared.demonstrations import read_demonstrations
from drake_shared.simulation.journal import recover_trials
from drake_shared.simulation.log import read_log

SIGNALS = (signal.SIGHUP, signal.SIGTERM, signal.SIGKILL, signal.SIGINT)
LAST = 1.0
"""What may be missing of the trial under way after SIGKILL, in [s]."""
PATIENCE = 60.0
"""Time in [s] that a program may take to start or to end."""
LONGEST = 6.0
"""The latest moment at which a program is ended, in [s] from the first move."""

TASK = """\
name: short_floor
goal: {x: 1.0, y: 0.0, radius: 0.2}
workspace: {x_min: -0.5, x_max: 1.5, y_min: -0.8, y_max: 0.8}
routes:
- {name: straight, waypoints: [[0.0, 0.0], [1.0, 0.0]], sides: {}}
travel_time: 2.0
"""


def program(arguments: list[str], output) -> None:
    """Runs a command as in a terminal of its own; its address goes to the pipe ``output``."""
    from drake_shared.cli.main import main

    os.setsid()
    # In the background of a script, or under nohup, these are ignored, as the program then leaves them.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    os.dup2(output.fileno(), 1)
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    sys.exit(main(arguments))


class Hands:
    """Drives one trial after another to the goal, as a page does, until the program is gone."""

    def __init__(self) -> None:
        self.moved = asyncio.Event()
        self.time = 0.0
        """Of the trial under way, in [s], as the page last heard it."""
        self.lost = 0.0
        """What of it was not recovered, in [s]."""
        self.stalled = False
        """Whether the program did not end by itself."""
        self.begun = self.ended = self.reached = 0
        """Number of trials."""
        self._phase = ""
        self._mine = False

    async def drive(self, visitor: Visitor) -> None:
        with contextlib.suppress(aiohttp.ClientError, OSError):
            async with (
                aiohttp.ClientSession() as http,
                http.ws_connect(
                    f"http://127.0.0.1:{visitor.port}/drive",
                    origin=f"http://127.0.0.1:{visitor.port}",
                    headers={"Cookie": visitor.cookie},
                ) as page,
            ):
                listening = asyncio.create_task(self._listen(page))
                while not page.closed:
                    if not self._mine and self._phase in ("ready", "finished"):
                        await page.send_json({"type": "engage"})
                    elif self._mine:
                        await page.send_json({"type": "move", "x": 0, "y": 0, "forward": 1.0, "turn": 0})
                    await asyncio.sleep(0.02)
                await listening

    async def _listen(self, page: aiohttp.ClientWebSocketResponse) -> None:
        async for text in page:
            if text.type is not aiohttp.WSMsgType.TEXT:
                continue
            message = json.loads(text.data)
            if message["type"] == "seat":
                self._mine = message["state"] == "yours"
            elif message["type"] == "now" and self._phase == "driving":
                self.time = message["t"]
            elif message["type"] == "trial" and message["phase"] != self._phase:
                self._phase = message["phase"]
                if self._phase == "driving":
                    self.begun, self.time = self.begun + 1, 0.0
                    self.moved.set()
                if self._phase == "finished":
                    self.ended += 1
                    self.reached += message["result"]["status"] == "reached"

    @property
    def under_way(self) -> bool:
        """Whether a trial had begun and not ended when the page last heard of the program."""
        return self._phase in ("driving", "stopping")


async def end_at_random(process, reader, chance: random.Random) -> tuple[Hands, signal.Signals]:
    """Drives, and ends the program by a random signal at a random moment."""
    with os.fdopen(os.dup(reader.fileno())) as output:
        address = await asyncio.to_thread(output.readline)
        hands = Hands()
        driving = asyncio.create_task(hands.drive(Visitor(address.strip())))
        await asyncio.wait_for(hands.moved.wait(), PATIENCE)
        await asyncio.sleep(chance.uniform(0.0, LONGEST))
        number = chance.choice(SIGNALS)
        os.kill(process.pid, number)
        await asyncio.to_thread(process.join, PATIENCE)
        if process.is_alive():
            hands.stalled = True
            process.kill()
            await asyncio.to_thread(process.join)
        await asyncio.wait_for(driving, PATIENCE)
    return hands, number


def judge(folder: Path, teaching: bool, hands: Hands, number: signal.Signals) -> list[str]:
    """What was lost."""
    if hands.stalled:
        return ["nothing, but the program did not end"]
    recovered = recover_trials(folder)
    if number is not signal.SIGKILL and recovered:
        return [f"nothing, but {recovered[0].name} had to be recovered"]
    lost = []
    demonstrations = folder / "demos.parquet"
    if teaching:
        kept = len(read_demonstrations(demonstrations)) if demonstrations.exists() else 0
        ended = hands.reached
    else:
        logs = set(folder.glob("short_floor_*.parquet")) - set(recovered)
        kept = sum(len(read_log(path)["t"]) > 0 for path in logs)
        ended = hands.ended
    if kept < ended:
        lost.append(f"{ended - kept} trials that had ended")
    if number is signal.SIGKILL and hands.under_way and kept == ended:
        driven = max((float(read_log(path)["t"][-1]) for path in recovered), default=0.0)
        hands.lost = max(hands.time - driven, 0.0)
        if hands.lost > LAST:
            lost.append(f"{hands.lost:.2f} s of the trial under way")
    return lost


def run(rounds: int, seed: int) -> dict:
    """Ends programs ``rounds`` times."""
    chance = random.Random(seed)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(
        ["drake_shared.cli.main", "drake_shared.cli.drive", "drake_shared.cockpit"]
    )
    broken, ended, begun, most_lost = [], 0, 0, 0.0
    signals: collections.Counter[str] = collections.Counter()
    started = time.monotonic()
    for index in range(rounds):
        teaching = bool(index % 2)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            task = folder / "task.yaml"
            task.write_text(TASK)
            common = ["--scenario", str(task), "--port", "0", "--no-open"]
            drive = ["drive", *common, "--record", name]
            teach = [
                "teach",
                *common,
                "--operator",
                "mouse",
                "--count",
                "9",
                "--out",
                f"{name}/demos.parquet",
            ]
            reader, writer = context.Pipe(duplex=False)
            process = context.Process(target=program, args=(teach if teaching else drive, writer))
            process.start()
            writer.close()
            hands, number = asyncio.run(end_at_random(process, reader, chance))
            what = f"round {index}, {'teach' if teaching else 'drive'}, {number.name}"
            broken += [f"{what}: lost {lost}" for lost in judge(folder, teaching, hands, number)]
            ended, begun = ended + hands.ended, begun + hands.begun
            most_lost = max(most_lost, hands.lost)
            signals[number.name] += 1
    return {
        "rounds": rounds,
        "signals": dict(signals),
        "most_lost": round(most_lost, 2),
        "trials_begun": begun,
        "trials_ended": ended,
        "seconds": round(time.monotonic() - started, 1),
        "broken": broken,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=200, help="how often a program is ended")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    report = run(options.rounds, options.seed)
    print(json.dumps(report, indent=1))
    return int(bool(report["broken"]))


if __name__ == "__main__":
    sys.exit(main())

"""Late control steps of simulated participants who drive at once: together.py [PARTICIPANTS [TRIALS]]

A server runs a study in which each participant drives under shared control, in a process of their own. They
connect as their pages would, without browsers, which run on other machines. Reports the share of late control
steps, the latency, and the load of the machine, on which nothing else should run.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import tempfile
from pathlib import Path

import aiohttp
import yaml

from drake_shared.study.protocol import plan
from drake_shared.study.server import StudyServer, run_study
from drake_shared.study.simulated import simulated_behaviours
from drake_shared.study.simulated_hand import SimulatedHand
from drake_shared.study.store import StudyData

SHARED = {"config": {"driver": "shared"}}
STUDY = {
    "name": "together",
    "learner": "two_obstacles",
    "conditions": {"one": SHARED, "two": SHARED},
    "design": "between",
    "practice": 0,
    "texts": {"consent": "-"},
    "measures": {"primary": [{"name": "completion_time", "smallest_effect": 0.5}]},
    "most_ping": 5.0,
}
PERIOD = 0.02


async def drive(address: str, hand: SimulatedHand) -> None:
    """Drives all trials of a block through the websocket of its page."""
    origin = address.partition("/?")[0]
    jar = aiohttp.CookieJar(unsafe=True)
    async with aiohttp.ClientSession(cookie_jar=jar) as http:
        async with http.get(address) as answer:
            await answer.read()
        async with http.ws_connect(f"{origin}/drive", headers={"Origin": origin}) as socket:
            stick, seat, back = (0.0, 0.0), "free", None

            async def listen() -> None:
                nonlocal stick, seat, back
                async for frame in socket:
                    message = json.loads(frame.data)
                    stick = hand.see(message) or stick
                    seat = message["state"] if message["type"] == "seat" else seat
                    back = message["back"] if message["type"] == "study" else back

            listening = asyncio.create_task(listen())
            while back is None and not listening.done():
                if seat != "yours":
                    await socket.send_json({"type": "engage"})
                    await asyncio.sleep(0.2)
                else:
                    move = {"type": "move", "x": 0.0, "y": 0.0, "forward": stick[0], "turn": stick[1]}
                    await socket.send_json(move)
                    await asyncio.sleep(PERIOD)
            listening.cancel()


async def take_part(link: str, hand: SimulatedHand) -> None:
    """Agrees, drives when asked to, and is done."""
    async with aiohttp.ClientSession() as http:
        given: dict = {"ping": 0.001}
        while True:
            async with http.post(f"{link}/step", json={"page": "only", **given}) as answer:
                shown = await answer.json()
            if shown["do"] == "drive":
                await drive(shown["address"], hand)
            elif shown["do"] == "text" and shown["step"] is None:
                return
            given = {"step": shown["step"], "answers": {"agreed": True}} if shown["do"] == "text" else {}
            await asyncio.sleep(0.2)


def main() -> None:
    given = [int(text) for text in sys.argv[1:]]
    count, trials = [*given, *(4, 6)[len(given) :]]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "study.yaml").write_text(yaml.safe_dump(STUDY | {"participants": count, "trials": trials}))
        plan(folder)
        data = StudyData(folder)
        server = StudyServer(data, simulated=True)
        behaviours = simulated_behaviours(count, seed=1)

        async def visit() -> None:
            hands = [SimulatedHand(data.study.load_scenario(), behaviour) for behaviour in behaviours]
            links = [server.address_of(name) for name in data.steps]
            await asyncio.gather(*(take_part(*pair) for pair in zip(links, hands, strict=True)))

        run_study(server, lambda _: None, visit)
        entries = [(trial.metadata["study"], trial) for _, trial in data.trials()]
    steps = sum(len(trial["t"]) - 1 for _, trial in entries)
    late = sum(entry["late_share"] * (len(trial["t"]) - 1) for entry, trial in entries)
    worst = max(entry["late_share"] for entry, _ in entries)
    latency = max(entry["latency_p99"] for entry, _ in entries)
    reached = sum(trial.status == "reached" for _, trial in entries)
    print(f"{count} participants at once, {len(entries)} trials, {reached} reached the goal, {steps} steps:")
    print(f"{late / steps:.2%} late, at most {worst:.2%} in a trial; latency p99 {1000 * latency:.0f} ms")
    print(f"load of the last minute {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    main()

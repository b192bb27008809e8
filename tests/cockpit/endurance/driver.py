"""A scripted driver without a browser, in a process of its own.

Usage: driver.py ADDRESS SECONDS. Prints a line when it begins to drive, drives one trial after another, and
prints the results as JSON.
"""

from __future__ import annotations

import asyncio
import json
import math
import struct
import sys
import time

import aiohttp
from aiohttp import WSMsgType
from visitor import Visitor

MOVES_A_SECOND = 60.0
_PING_EVERY = 3  # moves
_PATIENCE = 30.0  # s until the first trial
_STICK = {"type": "stick", "gain": 0.004, "dead_zone": 0.0, "return_time": 0.0}


class Driver:
    """Drives as a page does."""

    def __init__(self, seconds: float) -> None:
        self.trials = 0
        self.round_trips: list[float] = []
        self.errors: list[str] = []
        self._lock_state = ""
        self._phase = ""
        self._start = time.monotonic()
        self._end = self._start + _PATIENCE
        self._seconds = seconds

    async def drive(self, visitor: Visitor) -> None:
        url = f"{visitor.origin}/drive"
        headers = {"Cookie": visitor.cookie}
        async with (
            aiohttp.ClientSession() as http,
            http.ws_connect(url, origin=visitor.origin, headers=headers, autoping=False) as page,
        ):
            listening = asyncio.create_task(self._listen(page))
            await self._hold(page)
            listening.cancel()

    async def _hold(self, page: aiohttp.ClientWebSocketResponse) -> None:
        engaged = False
        moves = 0
        while time.monotonic() < self._end and not page.closed:
            if engaged and self._lock_state == "free":
                engaged = False
            if not engaged and self._lock_state == "free" and self._phase in ("ready", "finished"):
                await page.send_json({"type": "engage"})
                await page.send_json(_STICK)
                engaged, self._lock_state = True, "requested"
            if self._lock_state == "yours":
                now = time.monotonic() - self._start
                forward, turn = 0.6 + 0.2 * math.sin(now), 0.5 * math.sin(0.7 * now)
                await page.send_json({"type": "move", "x": 0, "y": 0, "forward": forward, "turn": turn})
            moves += 1
            if moves % _PING_EVERY == 0:
                await page.ping(struct.pack("d", time.monotonic()))
            await asyncio.sleep(1.0 / MOVES_A_SECOND)
        if page.closed:
            self.errors.append(f"the driver was disconnected: {page.close_code}")
            return
        await page.send_json({"type": "release"})
        while self._phase in ("driving", "stopping") and not page.closed:
            await asyncio.sleep(0.02)

    async def _listen(self, page: aiohttp.ClientWebSocketResponse) -> None:
        async for message in page:
            if message.type is WSMsgType.PING:
                await page.pong(message.data)
            elif message.type is WSMsgType.PONG:
                if len(message.data) == 8:
                    self.round_trips.append(time.monotonic() - struct.unpack("d", message.data)[0])
            elif message.type is WSMsgType.TEXT:
                self._receive(json.loads(message.data))

    def _receive(self, message: dict) -> None:
        if message["type"] == "seat":
            self._lock_state = message["state"]
            if message["refused"]:
                self.errors.append("the driver was refused the lock")
        elif message["type"] == "trial":
            if message["phase"] == "driving" != self._phase:
                if not self.trials:
                    print("driving", flush=True)
                    self._end = time.monotonic() + self._seconds
                self.trials += 1
            self._phase = message["phase"]


def main(address: str, seconds: str) -> None:
    driver = Driver(float(seconds))
    try:
        asyncio.run(driver.drive(Visitor(address)))
    except (aiohttp.ClientError, OSError) as error:
        driver.errors.append(f"the driver was disconnected: {error!r}")
    print(
        json.dumps(
            {
                "trials": driver.trials,
                "round_trips": [round(1000 * value, 3) for value in driver.round_trips],
                "errors": driver.errors,
            }
        )
    )


if __name__ == "__main__":
    main(*sys.argv[1:])

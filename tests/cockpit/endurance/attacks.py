"""Attacks on the cockpit's server while someone drives.

Usage: attacks.py NAME ADDRESS SECONDS. Prints what was done as JSON.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import random
import sys
import time
from collections.abc import Awaitable, Callable

from visitor import Visitor, drop, frame

MESSAGES_A_SECOND = 200
"""More than ten thousand in a minute."""
SILENT, SLOW, DROPS_A_SECOND = 200, 48, 50

_GONE = (ConnectionError, OSError, asyncio.IncompleteReadError, TimeoutError)
_MOVE = '{"type": "move", "x": 12, "y": -7.5, "forward": 0.25, "turn": -1}'
_KNOWN = (
    _MOVE,
    '{"type": "release"}',
    '{"type": "assist", "on": true}',
    '{"type": "stick", "gain": 0.004, "dead_zone": 0.02, "return_time": 0.5}',
    # Not a valid one: a page with the key may acquire a free lock, which is no attack.
    '{"type": "engage", "as": "root"}',
)
_PIECES = ("NaN", "1e999", "-0", "null", "[[[[", '"\\ud800"', "{}", "\x00", "é", '"type"', "9" * 300, ",")


class Tally:
    """Counts the actions of an attack and collects errors."""

    def __init__(self, seconds: float) -> None:
        self.counts: dict[str, int] = {}
        self.errors: list[str] = []
        self._end = time.monotonic() + seconds

    @property
    def goes_on(self) -> bool:
        return time.monotonic() < self._end

    @property
    def left(self) -> float:
        return max(self._end - time.monotonic(), 0.0)

    def count(self, what: str, number: int = 1) -> None:
        self.counts[what] = self.counts.get(what, 0) + number

    async def paced(self, rate: float):
        """Yields 0, 1, ... at ``rate`` per second until the end of the attack."""
        start = time.monotonic()
        for index in itertools.count():
            await asyncio.sleep(max(start + index / rate - time.monotonic(), 0.0))
            if not self.goes_on:
                return
            yield index


def mutated(chance: random.Random) -> bytes:
    """Returns a random or mutated message."""
    kind = chance.randrange(5)
    if kind == 0:
        return chance.randbytes(chance.randrange(1, 1000))
    text = chance.choice(_KNOWN)
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(text) + 1)
        if kind == 1:
            text = text[:at] + chance.choice(_PIECES) + text[at:]
        elif kind == 2:
            text = text[:at]
        elif kind == 3:
            text = text[:at] + chr(chance.randrange(1, 0x3000)) + text[at + 1 :]
        else:
            text = text[:at] + text[chance.randrange(len(text) + 1) :]
    return text.encode()


async def random_messages(visitor: Visitor, tally: Tally) -> None:
    """Random and mutated messages, one connection after another."""

    async def talk(seed: int, rate: float) -> None:
        chance = random.Random(seed)
        socket = None
        async for _ in tally.paced(rate):
            opcode = chance.choice((1, 1, 1, 1, 2, 0, 8, 9, 10, 3, 15))
            try:
                if socket is None:
                    socket = await visitor.websocket("/drive" if chance.random() < 0.9 else "/")
                    tally.count("connections" if socket else "refused")
                if socket is None:
                    continue
                reader, writer = socket
                message = mutated(chance)
                data = frame(message[:125] if opcode > 7 else message, opcode=opcode)
                writer.write(data if chance.random() < 0.95 else chance.randbytes(20))
                await writer.drain()
                tally.count("messages")
                with contextlib.suppress(TimeoutError):
                    while await asyncio.wait_for(reader.read(65536), 0.002):
                        pass
                    raise ConnectionResetError
            except _GONE:
                if socket is not None:
                    drop(socket[1])
                socket = None

    talkers = 8
    await asyncio.gather(*(talk(seed, MESSAGES_A_SECOND / talkers) for seed in range(talkers)))


async def oversized_frames(visitor: Visitor, tally: Tally) -> None:
    """Oversized frames, fragments, headers and bodies."""
    block = b" " * 65536

    async def pour(path: str, head: bytes, piece: bytes) -> None:
        socket = await visitor.websocket(path)
        tally.count("connections" if socket else "refused")
        if socket is None:
            return
        _, writer = socket
        try:
            writer.write(head)
            for _ in range(160):
                writer.write(piece)
                async with asyncio.timeout(1.0):
                    await writer.drain()
                tally.count("bytes", len(piece))
        finally:
            drop(writer)

    async def ask(head: bytes, body: bytes) -> None:
        _, writer = await visitor.connect()
        try:
            writer.write(head)
            for _ in range(160):
                writer.write(body)
                async with asyncio.timeout(1.0):
                    await writer.drain()
                tally.count("bytes", len(body))
        finally:
            drop(writer)

    kinds: tuple[Callable[[], Awaitable[None]], ...] = (
        lambda: pour("/drive", frame(b"", declared=2**20), block),
        lambda: pour("/drive", frame(b"", declared=2**62), block),
        lambda: pour("/drive", frame(b"", declared=15_000), block[:64]),
        lambda: pour("/drive", frame(b"", fin=False), frame(block[:1000], opcode=0, fin=False)),
        lambda: pour("/drive", frame(block[:16_000]), frame(block[:16_000])),
        lambda: pour("/", frame(b"", opcode=2, declared=2**62), block),
        lambda: pour("/", b"", frame(block[:60_000], opcode=2)),
        lambda: ask(b"GET / HTTP/1.1\r\n", b"X-Long: " + block + b"\r\n"),
        lambda: ask(b"GET /", block),
        lambda: ask(visitor.request("/", "Content-Length: 100000000", method="POST"), block),
        lambda: ask(
            visitor.request("/drive", "Transfer-Encoding: chunked", method="PUT"), b"10000\r\n" + block
        ),
    )
    async for index in tally.paced(20.0):
        with contextlib.suppress(*_GONE):
            async with asyncio.timeout(5.0):
                await kinds[index % len(kinds)]()
        tally.count("attempts")


async def silence(visitor: Visitor, tally: Tally) -> None:
    """Two hundred connections that send nothing or half a request, and never close."""

    async def stay(index: int) -> None:
        greetings = (b"", b"", b"GET / HTTP/1.1\r\nHost: ", visitor.upgrade("/drive"), visitor.upgrade("/"))
        while tally.goes_on:
            with contextlib.suppress(*_GONE):
                reader, writer = await visitor.connect()
                tally.count("connections")
                writer.write(greetings[index % len(greetings)])
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(tally.left):
                        while await reader.read(65536):
                            pass
                drop(writer)
            await asyncio.sleep(min(0.5, tally.left))

    async def come_by() -> None:
        """Requests with the key, which must be answered throughout."""
        async for _ in tally.paced(2.0):
            try:
                async with asyncio.timeout(2.0):
                    reader, writer = await visitor.connect()
                    writer.write(visitor.request("/cockpit/main.js", "Connection: close"))
                    answer = await reader.readline()
                    writer.close()
                if b" 200 " not in answer:
                    tally.errors.append(f"a request with the key was answered {answer!r}")
            except _GONE as error:
                tally.errors.append(f"a request with the key failed: {error!r}")
            tally.count("requests")

    await asyncio.gather(come_by(), *(stay(index) for index in range(SILENT)))


async def slow_readers(visitor: Visitor, tally: Tally) -> None:
    """Pages and downloads that read almost nothing."""
    reader, writer = await visitor.connect()
    writer.write(visitor.request("/", "Connection: close"))
    part = (await reader.read(-1)).partition(b'src="cas-v1/')[2][:64].decode()
    writer.close()

    async def read_slowly(index: int) -> None:
        asks = (visitor.upgrade("/"), visitor.upgrade("/drive"), visitor.request(f"/cas-v1/{part}"))
        while tally.goes_on:
            with contextlib.suppress(*_GONE):
                reader, writer = await visitor.connect(buffer=2048)
                tally.count("connections")
                writer.write(asks[index % len(asks)])
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(tally.left):
                        # Half of them read a little, the others nothing.
                        while index % 2 == 0 or await reader.read(64):
                            await asyncio.sleep(0.2)
                drop(writer)
            await asyncio.sleep(min(0.5, tally.left))

    await asyncio.gather(*(read_slowly(index) for index in range(SLOW)))


async def churn(visitor: Visitor, tally: Tally) -> None:
    """Connections opened and reset, fifty a second."""
    asks = (b"", visitor.upgrade("/drive"), visitor.upgrade("/"), visitor.request("/"))
    lingering: set[asyncio.Task] = set()

    async def come_and_go(index: int) -> None:
        with contextlib.suppress(*_GONE):
            reader, writer = await visitor.connect()
            writer.write(asks[index % len(asks)])
            if asks[index % len(asks)] and index % 8 < 4:
                async with asyncio.timeout(2.0):
                    await reader.read(1000)
            drop(writer)
            tally.count("connections")

    async for index in tally.paced(DROPS_A_SECOND):
        task = asyncio.create_task(come_and_go(index))
        lingering.add(task)
        task.add_done_callback(lingering.discard)
    await asyncio.gather(*lingering)


async def flood(visitor: Visitor, tally: Tally) -> None:
    """Pages that send valid messages and pings as fast as they can."""
    words = (_MOVE, '{"type": "assist", "on": true}', '{"type": "release"}')
    burst = [frame(word.encode()) * 20 for word in words] + [frame(b"?", opcode=9) * 20]

    async def talk(path: str, data: bytes) -> None:
        while tally.goes_on:
            with contextlib.suppress(*_GONE):
                socket = await visitor.websocket(path)
                if socket is None:
                    tally.count("refused")
                    await asyncio.sleep(0.2)
                    continue
                reader, writer = socket
                drain = asyncio.create_task(_read_all(reader))
                try:
                    while tally.goes_on:
                        writer.write(data)
                        async with asyncio.timeout(min(tally.left + 0.01, 5.0)):
                            await writer.drain()
                        tally.count("bytes", len(data))
                finally:
                    drain.cancel()
                    drop(writer)

    await asyncio.gather(*(talk("/drive", data) for data in burst), talk("/", burst[3]))


async def _read_all(reader: asyncio.StreamReader) -> None:
    with contextlib.suppress(*_GONE):
        while await reader.read(65536):
            pass


async def nothing(visitor: Visitor, tally: Tally) -> None:
    """Does nothing, for comparison."""
    await asyncio.sleep(tally.left)


ATTACKS = {
    "nothing": nothing,
    "random_messages": random_messages,
    "oversized_frames": oversized_frames,
    "silence": silence,
    "slow_readers": slow_readers,
    "churn": churn,
    "flood": flood,
}


def main(name: str, address: str, seconds: str) -> None:
    tally = Tally(float(seconds))
    asyncio.run(ATTACKS[name](Visitor(address), tally))
    print(json.dumps({"did": tally.counts, "errors": sorted(set(tally.errors))}))


if __name__ == "__main__":
    main(*sys.argv[1:])

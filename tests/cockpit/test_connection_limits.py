"""No route answers without the key, under another name or from another page; connections are limited."""

import asyncio
import contextlib
import re
import socket
from urllib.parse import urlsplit

import aiohttp
import pytest

from drake_shared.cockpit.access import is_loopback
from drake_shared.cockpit.connection_limits import ConnectionLimiter
from drake_shared.cockpit.driver_lock import DriverLock
from drake_shared.cockpit.meshcat_proxy import start_meshcat
from drake_shared.cockpit.rate_limiter import RateLimiter
from drake_shared.cockpit.server import CockpitServer


@pytest.fixture(scope="module")
def meshcat():
    return start_meshcat()


@pytest.fixture(scope="module")
def server(meshcat):
    with CockpitServer(meshcat_url=meshcat.web_url(), driver_lock=DriverLock(), port=0) as server:
        yield server


# A path for each route. A test below fails until a new route is listed here.
PATHS = {
    "/": "/",
    "/favicon.ico": "/favicon.ico",
    "/cas-v1/{name}": "/cas-v1/" + 64 * "0",
    "/drive": "/drive",
    "/cockpit": "/cockpit/main.js",
    "/drives/{number}": "/drives/1",
    # No route.
    None: "/nothing/here",
}
WEBSOCKET = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Version": "13",
}
# Changes of an accepted request, each of which must make the server refuse it.
BAD_REQUESTS = {
    "no key": {"Cookie": None},
    "wrong key": {"Cookie": "drake_shared_{port}=wrong"},
    "key of another port": {"Cookie": "drake_shared_1={token}"},
    "key in the address only": {"Cookie": None, "?": "k={token}"},
    "other name": {"Host": "evil.example:{port}"},
    "other name, its own Origin": {"Host": "evil.example:{port}", "Origin": "http://evil.example:{port}"},
    "other address": {"Host": "203.0.113.7:{port}"},
    "other site": {"Origin": "http://evil.example"},
    "other port": {"Origin": "http://localhost:1"},
    "other scheme": {"Origin": "https://localhost:{port}"},
    "opaque origin": {"Origin": "null"},
    "script of another site": {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Dest": "script"},
    "picture of another port": {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Dest": "image"},
    "frame of another port": {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Dest": "iframe"},
    "websocket without Origin": WEBSOCKET,
}
METHODS = ("GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS", "PATCH")


def requests(server):
    """Yields the name, headers and query of an accepted request and of every bad one."""
    token = server.address.partition("?k=")[2]
    good = {"Host": f"localhost:{server.port}", "Cookie": f"drake_shared_{server.port}={token}"}
    yield "good", good, ""
    for name, change in BAD_REQUESTS.items():
        changed = {k: v and v.format(port=server.port, token=token) for k, v in (good | change).items()}
        query = changed.pop("?", "")
        yield name, {k: v for k, v in changed.items() if v is not None}, query
        if "Upgrade" not in changed:
            origin = {"Origin": f"http://localhost:{server.port}"}
            headers = origin | WEBSOCKET | {k: v for k, v in changed.items() if v is not None}
            yield f"{name}, as a websocket", headers, query


def test_every_route_is_listed(server):
    known = {route.resource.canonical for route in server.routes}
    assert known == {route for route in PATHS if route is not None}
    assert {route.method for route in server.routes} <= {"GET", "HEAD"}


def test_no_route_answers_a_bad_request(server, client):
    async def talk(http):
        wrong = []
        for path in PATHS.values():
            for name, headers, query in requests(server):
                for method in METHODS if "Upgrade" not in headers else ("GET",):
                    # The one route that accepts the key in the address.
                    if (path, name.partition(",")[0]) == ("/", "key in the address only"):
                        continue
                    url = f"http://127.0.0.1:{server.port}{path}?{query}"
                    async with http.request(method, url, headers=headers, allow_redirects=False) as answer:
                        if (answer.status != 403) != (name == "good"):
                            wrong.append((path, name, method, answer.status))
                        assert answer.headers["X-Frame-Options"] == "DENY"
                        assert answer.headers["Cross-Origin-Resource-Policy"] == "same-origin"
                        assert "Access-Control-Allow-Origin" not in answer.headers
        return wrong

    assert client(talk) == []


def test_a_link_from_another_site_works_with_the_key(server, client):
    async def talk(http):
        async with http.get(server.address):
            pass
        headers = {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
        async with http.get(f"http://127.0.0.1:{server.port}/", headers=headers) as answer:
            return answer.status

    assert client(talk) == 200


def other_addresses() -> list[str]:
    """Returns the addresses of this computer that other computers can reach."""
    found = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None)}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # Nothing is sent.
            found.add(probe.getsockname()[0])
        except OSError:
            pass
    return sorted(address for address in found if not is_loopback(address.partition("%")[0]))


def test_drakes_own_port_is_reachable_from_this_computer_only(meshcat):
    address = urlsplit(meshcat.web_url())
    assert is_loopback(address.hostname)
    socket.create_connection((address.hostname, address.port), timeout=5.0).close()
    for other in other_addresses():
        with pytest.raises(OSError, match=r"refused|unreachable"):
            socket.create_connection((other, address.port), timeout=5.0)


def test_pages_do_not_learn_drakes_own_port(server, client, meshcat):
    async def talk(http):
        texts = []
        async with http.get(server.address) as answer:
            texts += [await answer.text(), str(answer.headers)]
        (part,) = re.findall(r'src="(cas-v1/[0-9a-f]+)"', texts[0])
        async with http.get(f"http://127.0.0.1:{server.port}/{part}") as answer:
            texts += [await answer.text(), str(answer.headers)]
        return texts

    address = urlsplit(meshcat.web_url())
    for text in client(talk):
        assert address.hostname not in text
        assert f":{address.port}" not in text


async def with_limiter(act, **options):
    """Runs ``act`` with a connection limiter before a server that accepts every request."""

    async def answer(request):
        return aiohttp.web.Response(text="hello")

    listener = socket.create_server(("127.0.0.1", 0))
    limiter = ConnectionLimiter(listener, **options)
    app = aiohttp.web.Application(middlewares=[limiter.mark_authenticated])
    app.router.add_get("/", answer)
    runner = aiohttp.web.AppRunner(app)
    await runner.setup()
    accepting = asyncio.create_task(limiter.accept(runner.server))
    try:
        return await act(limiter, listener.getsockname()[1])
    finally:
        accepting.cancel()
        await runner.cleanup()
        listener.close()


def test_connections_without_a_request_are_closed_and_others_stay():
    now = [100.0]

    async def act(limiter, port):
        silent = await asyncio.open_connection("127.0.0.1", port)
        half = await asyncio.open_connection("127.0.0.1", port)
        half[1].write(b"GET / HTTP/1.1\r\nHost: x\r\n")
        async with aiohttp.ClientSession() as http, http.get(f"http://127.0.0.1:{port}/") as answer:
            assert await answer.text() == "hello"
            limiter.close_expired()
            assert len(limiter) == 3
            now[0] += 4.0
            limiter.close_expired()
            assert len(limiter) == 1
            for reader, _ in (silent, half):
                with contextlib.suppress(ConnectionResetError):
                    assert await reader.read() == b""
        for _, writer in (silent, half):
            writer.close()

    asyncio.run(asyncio.wait_for(with_limiter(act, key_timeout=3.0, clock=lambda: now[0]), 10.0))


def test_idle_connections_do_not_lock_anybody_out():
    async def act(limiter, port):
        silent = [await asyncio.open_connection("127.0.0.1", port) for _ in range(20)]
        async with aiohttp.ClientSession() as http, http.get(f"http://127.0.0.1:{port}/") as answer:
            assert await answer.text() == "hello"
            assert len(limiter) <= 4
        for _, writer in silent:
            writer.close()

    asyncio.run(asyncio.wait_for(with_limiter(act, max_connections=4), 10.0))


def test_the_rate_limiter_allows_a_burst_and_then_the_rate():
    now, slept = [0.0], []

    async def sleep(seconds):
        slept.append(seconds)
        now[0] += seconds

    async def take(number):
        for _ in range(number):
            await limiter.acquire()

    limiter = RateLimiter(rate=10.0, burst=5, clock=lambda: now[0], sleep=sleep)
    asyncio.run(take(5))
    assert slept == []
    asyncio.run(take(20))
    assert now[0] == pytest.approx(2.0)
    now[0] += 100.0
    slept.clear()
    asyncio.run(take(5))
    assert slept == []

"""The server without a browser: access, the driver lock, and clients that violate the protocol."""

import asyncio
import json
import re
import socket
from urllib.parse import urlsplit

import aiohttp
import pytest
from aiohttp import WSMsgType

from drake_shared.cockpit.driver_lock import DriverLock
from drake_shared.cockpit.meshcat_proxy import start_meshcat
from drake_shared.cockpit.messages import MAX_BYTES
from drake_shared.cockpit.server import CockpitServer
from drake_shared.common.errors import InputError


@pytest.fixture(scope="module")
def meshcat():
    return start_meshcat()


@pytest.fixture
def server(meshcat):
    with CockpitServer(meshcat_url=meshcat.web_url(), driver_lock=DriverLock(), port=0) as server:
        yield server


def origin_of(server: CockpitServer) -> str:
    return f"http://127.0.0.1:{server.port}"


async def authenticate(http: aiohttp.ClientSession, server: CockpitServer) -> None:
    async with http.get(server.address) as answer:
        assert answer.status == 200


def connect(http: aiohttp.ClientSession, server: CockpitServer, **options):
    options = {"origin": origin_of(server)} | options
    return http.ws_connect(f"{origin_of(server)}/drive", **options)


async def receive(page: aiohttp.ClientWebSocketResponse, topic: str) -> dict:
    while True:
        message = await page.receive_json()
        if message["type"] == topic:
            return message


def move(**fields) -> str:
    return json.dumps({"type": "move", "x": 0, "y": 0, "forward": 0, "turn": 0} | fields)


ENGAGE = json.dumps({"type": "engage"})


def test_the_key_becomes_a_cookie_and_leaves_the_address(server, client):
    async def talk(http):
        async with http.get(server.address, allow_redirects=False) as answer:
            assert answer.status == 303
            assert answer.headers["Location"] == "/"
            cookie = answer.headers["Set-Cookie"]
        async with http.get(server.address) as answer:
            return cookie, str(answer.url), await answer.text(), answer.headers

    cookie, url, page, headers = client(talk)
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert "k=" not in url
    assert headers["X-Frame-Options"] == "DENY"
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert "unsafe-eval'" not in headers["Content-Security-Policy"].replace("wasm-unsafe-eval", "")
    assert "MeshCat.Viewer" in page
    assert page.count("/cockpit/main.js") == 1


def test_all_files_of_the_page_are_served_locally(server, client):
    async def talk(http):
        await authenticate(http, server)
        async with http.get(f"{origin_of(server)}/") as answer:
            page = await answer.text()
        (part,) = re.findall(r'src="(cas-v1/[0-9a-f]+)"', page)
        own = ["main.js", "connection.js", "mouse.js", "axes.js", "panel.js", "overlay.html", "cockpit.css"]
        kinds = {}
        for path in [part, *(f"cockpit/{name}" for name in own)]:
            async with http.get(f"{origin_of(server)}/{path}") as answer:
                assert answer.status == 200, path
                kinds[path.rpartition("/")[2]] = answer.content_type
        assert "http:" not in page.replace("http://www.w3.org", "").partition("<script")[0]
        return kinds[part.rpartition("/")[2]], kinds["main.js"], kinds["cockpit.css"]

    meshcat, main, css = client(talk)
    assert meshcat in ("text/javascript", "application/javascript")
    assert main in ("text/javascript", "application/javascript")
    assert css == "text/css"


@pytest.mark.parametrize("path", ["/", "/?k=wrong", "/drive", "/cockpit/main.js", "/favicon.ico"])
def test_nothing_is_served_without_the_key(server, client, path):
    async def talk(http):
        async with http.get(f"{origin_of(server)}{path}") as answer:
            return answer.status, await answer.text()

    status, text = client(talk)
    assert status == 403
    assert "drake-shared printed" in text


@pytest.mark.parametrize("path", ["/cockpit/../server.py", "/cockpit/%2e%2e/server.py", "/cas-v1/../x"])
def test_nothing_but_the_page_is_served(server, client, path):
    async def talk(http):
        await authenticate(http, server)
        from yarl import URL

        async with http.get(URL(f"{origin_of(server)}{path}", encoded=True)) as answer:
            return answer.status

    assert client(talk) == 404


@pytest.mark.parametrize("path", ["/drive", "/"])
@pytest.mark.parametrize(
    "origin", [None, "http://localhost:1", "http://evil.example", "https://localhost:{port}", "null"]
)
def test_a_foreign_page_gets_no_websocket_even_with_the_cookie(server, client, origin, path):
    async def talk(http):
        await authenticate(http, server)
        given = origin and origin.format(port=server.port)
        try:
            async with http.ws_connect(f"{origin_of(server)}{path}", origin=given):
                return 101
        except aiohttp.WSServerHandshakeError as error:
            return error.status

    assert client(talk) == 403


def test_a_foreign_host_name_is_refused(server, client):
    async def talk(http):
        await authenticate(http, server)
        async with http.get(
            f"{origin_of(server)}/", headers={"Host": f"evil.example:{server.port}"}
        ) as answer:
            return answer.status

    assert client(talk) == 403


def test_a_forwarded_port_works(server, client):
    async def talk(http):
        path = server.address.partition("/?")[2]
        headers = {"Host": "localhost:9999"}
        async with http.get(f"{origin_of(server)}/?{path}", headers=headers, allow_redirects=False) as answer:
            return answer.status

    assert client(talk) == 303


def test_a_sample_reaches_the_driver_lock(server, client, until):
    async def talk(http):
        await authenticate(http, server)
        async with connect(http, server) as page:
            assert (await receive(page, "seat"))["state"] == "free"
            await page.send_str(ENGAGE)
            assert (await receive(page, "seat"))["state"] == "yours"
            await page.send_str(move(x=12, y=-7, forward=0.25))
            while server.driver_lock.latest().x != 12:
                await asyncio.sleep(0.002)
            return server.driver_lock.latest()

    sample = client(talk)
    assert (sample.engaged, sample.y, sample.forward) == (True, -7, 0.25)
    until(lambda: server.driver_lock.holder is None, "a free driver lock")


def test_a_second_window_may_watch_but_not_drive(server, client):
    async def talk(http):
        await authenticate(http, server)
        async with connect(http, server) as first, connect(http, server) as second:
            await receive(second, "seat")
            await first.send_str(ENGAGE)
            assert (await receive(second, "seat"))["state"] == "taken"
            await second.send_str(ENGAGE)
            refusal = await receive(second, "seat")
            assert (refusal["state"], refusal["refused"]) == ("taken", True)
            await second.send_str(move(x=500))
            await second.send_str(json.dumps({"type": "assist", "on": False}))
            assert (await receive(second, "seat"))["refused"]
            server.publish("now", {"t": 1.5})
            assert (await receive(second, "now"))["t"] == 1.5
            sample = server.driver_lock.latest()
            await first.close()
            assert (await receive(second, "seat"))["state"] == "free"
            return sample, server.driver_lock.latest().engaged, server.driver_lock.assist

    sample, engaged_afterwards, assist = client(talk)
    assert sample.x == 0
    assert not engaged_afterwards
    assert assist


@pytest.mark.parametrize(
    ("bad", "code"),
    [
        ("nonsense", 1008),
        (move().replace('"x": 0', '"x": NaN'), 1008),
        (move(forward=7), 1008),
        (move() + " " * 2000, 1009),
        (move() + " " * 100_000, 1009),
        (b"\x93\xff\xff", 1003),
    ],
    ids=["not JSON", "NaN", "out of range", "oversized", "huge", "binary"],
)
def test_a_bad_message_disconnects_the_page_and_the_drive_goes_on(server, client, bad, code):
    async def talk(http):
        await authenticate(http, server)
        async with connect(http, server) as driver, connect(http, server) as other:
            await driver.send_str(ENGAGE)
            await driver.send_str(move(x=5))
            await (other.send_bytes(bad) if isinstance(bad, bytes) else other.send_str(bad))
            while (message := await other.receive()).type is WSMsgType.TEXT:
                pass
            await driver.send_str(move(x=6))
            while server.driver_lock.latest().x != 6:
                await asyncio.sleep(0.002)
            return message, server.driver_lock.latest().engaged

    message, engaged = client(talk)
    assert message.type in (WSMsgType.CLOSE, WSMsgType.CLOSED)
    assert message.data == code
    assert message.extra or len(bad) > 16 * MAX_BYTES
    assert engaged


def test_a_driver_who_sends_a_bad_message_loses_the_lock(server, client):
    async def talk(http):
        await authenticate(http, server)
        async with connect(http, server) as driver:
            await driver.send_str(ENGAGE)
            await driver.send_str(move(turn=1))
            await driver.send_str("{")
            while (await driver.receive()).type is WSMsgType.TEXT:
                pass
            while server.driver_lock.holder is not None:
                await asyncio.sleep(0.002)
            return server.driver_lock.latest()

    sample = client(talk)
    assert (sample.engaged, sample.turn) == (False, 0)


def test_a_driver_who_sends_nothing_loses_the_lock(meshcat, client):
    lock = DriverLock(lost_after=0.2)
    with CockpitServer(meshcat_url=meshcat.web_url(), driver_lock=lock, port=0) as server:

        async def talk(http):
            await authenticate(http, server)
            async with connect(http, server) as driver:
                await driver.send_str(ENGAGE)
                while (message := await driver.receive()).type is WSMsgType.TEXT:
                    pass
                return message

        message = client(talk)
    assert (message.data, message.extra) == (1008, "no heartbeat")
    assert lock.holder is None


def test_messages_of_a_page_never_reach_drake(server, client, meshcat):
    async def talk(http):
        await authenticate(http, server)
        async with http.ws_connect(
            f"{origin_of(server)}/", origin=origin_of(server), max_msg_size=0
        ) as scene:
            assert (await scene.receive()).type is WSMsgType.BINARY
            # One such byte would abort the process; a gamepad message would steer the gamepad's readers.
            await scene.send_bytes(b"\xc1")
            await scene.send_bytes(
                b"\x83\xa4type\xa7gamepad\xa4name\xa0\xa7gamepad\x82\xa5index\x00\xa4axes\x91\x01"
            )
        async with http.get(f"{origin_of(server)}/") as answer:
            return answer.status

    assert client(talk) == 200
    assert meshcat.GetGamepad().index is None


def test_a_late_page_receives_the_newest_message_of_every_topic(server, client):
    for t in range(1000):
        server.publish("now", {"t": t})
    server.publish("trial", {"phase": "ready"})

    async def talk(http):
        await authenticate(http, server)
        async with connect(http, server) as page:
            return (await receive(page, "now"))["t"], (await receive(page, "trial"))["phase"]

    assert client(talk) == (999, "ready")


def test_a_port_in_use_is_an_input_error(server, meshcat):
    other = CockpitServer(meshcat_url=meshcat.web_url(), driver_lock=DriverLock(), port=server.port)
    with pytest.raises(InputError, match=f"port {server.port}"):
        other.start()


@pytest.mark.parametrize(
    ("options", "message"), [({"port": 70000}, "--port"), ({"host": "203.0.113.7"}, "--host")]
)
def test_an_invalid_address_is_an_input_error(meshcat, options, message):
    server = CockpitServer(meshcat_url=meshcat.web_url(), driver_lock=DriverLock(), **options)
    with pytest.raises(InputError, match=message):
        server.start()


def test_stopping_closes_the_pages_and_ends_the_thread(meshcat, client):
    server = CockpitServer(meshcat_url=meshcat.web_url(), driver_lock=DriverLock(), port=0)
    server.start()

    async def talk(http):
        await authenticate(http, server)
        async with connect(http, server) as page:
            await receive(page, "seat")
            await asyncio.get_running_loop().run_in_executor(None, server.stop)
            while (message := await page.receive()).type is WSMsgType.TEXT:
                pass
            return message.data, message.extra

    assert client(talk) == (1001, "ended")
    server.publish("now", {"t": 0})  # No page is left; nothing happens.


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "localhost", "::1"])
def test_the_address_is_the_one_that_is_bound(meshcat, client, host):
    """Another program may listen under the same name, on the other loopback address."""
    with CockpitServer(meshcat_url=meshcat.web_url(), driver_lock=DriverLock(), host=host, port=0) as server:
        shown = urlsplit(server.address)
        expected = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)[0][4][0]
        assert shown.hostname == expected
        with socket.create_connection((shown.hostname, shown.port)) as connection:
            assert connection.getpeername()[0] == expected

        async def talk(http):
            async with http.get(server.address) as answer:
                return answer.status

        assert client(talk) == 200

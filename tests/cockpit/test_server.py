"""The server without a browser: who gets in, who drives, and what happens to those who misbehave."""

import asyncio
import json
import re

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
    with CockpitServer(meshcat_url=meshcat.web_url(), seat=DriverLock(), port=0) as server:
        yield server


def origin_of(server: CockpitServer) -> str:
    return f"http://localhost:{server.port}"


async def enter(http: aiohttp.ClientSession, server: CockpitServer) -> None:
    async with http.get(server.address) as answer:
        assert answer.status == 200


def connect(http: aiohttp.ClientSession, server: CockpitServer, **options):
    options = {"origin": origin_of(server)} | options
    return http.ws_connect(f"{origin_of(server)}/drive", **options)


async def hear(page: aiohttp.ClientWebSocketResponse, topic: str) -> dict:
    while True:
        message = await page.receive_json()
        if message["type"] == topic:
            return message


def move(**fields) -> str:
    return json.dumps({"type": "move", "x": 0, "y": 0, "forward": 0, "turn": 0} | fields)


ENGAGE = json.dumps({"type": "engage"})


def test_the_key_leaves_a_cookie_and_goes_from_the_address(server, client):
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


def test_every_part_of_the_page_is_served_from_here(server, client):
    async def talk(http):
        await enter(http, server)
        async with http.get(f"{origin_of(server)}/") as answer:
            page = await answer.text()
        (part,) = re.findall(r'src="(cas-v1/[0-9a-f]+)"', page)
        own = ["main.js", "connection.js", "pad.js", "axes.js", "panel.js", "overlay.html", "cockpit.css"]
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
def test_without_the_key_nothing_is_shown(server, client, path):
    async def talk(http):
        async with http.get(f"{origin_of(server)}{path}") as answer:
            return answer.status, await answer.text()

    status, text = client(talk)
    assert status == 403
    assert "drake-shared printed" in text


@pytest.mark.parametrize("path", ["/cockpit/../server.py", "/cockpit/%2e%2e/server.py", "/cas-v1/../x"])
def test_nothing_but_the_page_is_served(server, client, path):
    async def talk(http):
        await enter(http, server)
        from yarl import URL

        async with http.get(URL(f"{origin_of(server)}{path}", encoded=True)) as answer:
            return answer.status

    assert client(talk) == 404


@pytest.mark.parametrize("path", ["/drive", "/"])
@pytest.mark.parametrize(
    "origin", [None, "http://localhost:1", "http://evil.example", "https://localhost:{port}", "null"]
)
def test_a_page_from_elsewhere_gets_no_socket_even_with_the_cookie(server, client, origin, path):
    async def talk(http):
        await enter(http, server)
        given = origin and origin.format(port=server.port)
        try:
            async with http.ws_connect(f"{origin_of(server)}{path}", origin=given):
                return 101
        except aiohttp.WSServerHandshakeError as error:
            return error.status

    assert client(talk) == 403


def test_a_name_that_points_here_but_is_not_ours_is_refused(server, client):
    async def talk(http):
        await enter(http, server)
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


def test_a_sample_comes_to_the_seat(server, client):
    async def talk(http):
        await enter(http, server)
        async with connect(http, server) as page:
            assert (await hear(page, "seat"))["state"] == "free"
            await page.send_str(ENGAGE)
            assert (await hear(page, "seat"))["state"] == "yours"
            await page.send_str(move(x=12, y=-7, forward=0.25))
            while server.seat.latest().x != 12:
                await asyncio.sleep(0.002)
            return server.seat.latest()

    sample = client(talk)
    assert (sample.engaged, sample.y, sample.forward) == (True, -7, 0.25)
    assert server.seat.holder is None


def test_a_second_window_may_watch_but_not_drive(server, client):
    async def talk(http):
        await enter(http, server)
        async with connect(http, server) as first, connect(http, server) as second:
            await hear(second, "seat")
            await first.send_str(ENGAGE)
            assert (await hear(second, "seat"))["state"] == "taken"
            await second.send_str(ENGAGE)
            refusal = await hear(second, "seat")
            assert (refusal["state"], refusal["refused"]) == ("taken", True)
            await second.send_str(move(x=500))
            await second.send_str(json.dumps({"type": "assist", "on": False}))
            assert (await hear(second, "seat"))["refused"]
            server.publish("now", {"t": 1.5})
            assert (await hear(second, "now"))["t"] == 1.5
            sample = server.seat.latest()
            await first.close()
            assert (await hear(second, "seat"))["state"] == "free"
            return sample, server.seat.latest().engaged, server.seat.assist

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
    ids=["no JSON", "NaN", "out of range", "oversized", "huge", "binary"],
)
def test_who_talks_nonsense_is_thrown_out_and_the_drive_goes_on(server, client, bad, code):
    async def talk(http):
        await enter(http, server)
        async with connect(http, server) as driver, connect(http, server) as other:
            await driver.send_str(ENGAGE)
            await driver.send_str(move(x=5))
            await (other.send_bytes(bad) if isinstance(bad, bytes) else other.send_str(bad))
            while (message := await other.receive()).type is WSMsgType.TEXT:
                pass
            await driver.send_str(move(x=6))
            while server.seat.latest().x != 6:
                await asyncio.sleep(0.002)
            return message, server.seat.latest().engaged

    message, engaged = client(talk)
    assert message.type in (WSMsgType.CLOSE, WSMsgType.CLOSED)
    assert message.data == code
    assert message.extra or len(bad) > 16 * MAX_BYTES
    assert engaged


def test_a_driver_who_talks_nonsense_loses_the_seat(server, client):
    async def talk(http):
        await enter(http, server)
        async with connect(http, server) as driver:
            await driver.send_str(ENGAGE)
            await driver.send_str(move(turn=1))
            await driver.send_str("{")
            while (await driver.receive()).type is WSMsgType.TEXT:
                pass
            while server.seat.holder is not None:
                await asyncio.sleep(0.002)
            return server.seat.latest()

    sample = client(talk)
    assert (sample.engaged, sample.turn) == (False, 0)


def test_a_silent_driver_loses_the_seat(meshcat, client):
    seat = DriverLock(silent_after=0.2)
    with CockpitServer(meshcat_url=meshcat.web_url(), seat=seat, port=0) as server:

        async def talk(http):
            await enter(http, server)
            async with connect(http, server) as driver:
                await driver.send_str(ENGAGE)
                while (message := await driver.receive()).type is WSMsgType.TEXT:
                    pass
                return message

        message = client(talk)
    assert (message.data, message.extra) == (1008, "no sign of life")
    assert seat.holder is None


def test_what_a_page_says_to_drake_never_reaches_it(server, client, meshcat):
    async def talk(http):
        await enter(http, server)
        async with http.ws_connect(
            f"{origin_of(server)}/", origin=origin_of(server), max_msg_size=0
        ) as scene:
            assert (await scene.receive()).type is WSMsgType.BINARY
            # One such byte would end the process; a gamepad from a page would steer whoever reads it.
            await scene.send_bytes(b"\xc1")
            await scene.send_bytes(
                b"\x83\xa4type\xa7gamepad\xa4name\xa0\xa7gamepad\x82\xa5index\x00\xa4axes\x91\x01"
            )
        async with http.get(f"{origin_of(server)}/") as answer:
            return answer.status

    assert client(talk) == 200
    assert meshcat.GetGamepad().index is None


def test_a_late_page_is_told_how_things_stand_and_a_slow_one_the_newest(server, client):
    for t in range(1000):
        server.publish("now", {"t": t})
    server.publish("trial", {"phase": "ready"})

    async def talk(http):
        await enter(http, server)
        async with connect(http, server) as page:
            return (await hear(page, "now"))["t"], (await hear(page, "trial"))["phase"]

    assert client(talk) == (999, "ready")


def test_a_port_in_use_is_said_with_the_way_out(server, meshcat):
    other = CockpitServer(meshcat_url=meshcat.web_url(), seat=DriverLock(), port=server.port)
    with pytest.raises(InputError, match=rf"port {server.port} is in use .*--port"):
        other.start()


@pytest.mark.parametrize(
    ("options", "message"), [({"port": 70000}, "--port"), ({"host": "203.0.113.7"}, "--host")]
)
def test_an_address_that_cannot_be_listened_on_is_said(meshcat, options, message):
    server = CockpitServer(meshcat_url=meshcat.web_url(), seat=DriverLock(), **options)
    with pytest.raises(InputError, match=message):
        server.start()


def test_the_end_is_told_to_pages_and_the_thread_ends(meshcat, client):
    server = CockpitServer(meshcat_url=meshcat.web_url(), seat=DriverLock(), port=0)
    server.start()

    async def talk(http):
        await enter(http, server)
        async with connect(http, server) as page:
            await hear(page, "seat")
            await asyncio.get_running_loop().run_in_executor(None, server.stop)
            while (message := await page.receive()).type is WSMsgType.TEXT:
                pass
            return message.data, message.extra

    assert client(talk) == (1001, "ended")
    server.publish("now", {"t": 0})  # Nobody is left, and nothing happens.

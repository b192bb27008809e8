"""The page through a proxy that speaks TLS, and under other names."""

import asyncio
import contextlib
import ssl
import subprocess

import aiohttp
import pytest
from aiohttp import web

from drake_shared.cockpit.access import Access
from drake_shared.cockpit.driver_lock import DriverLock
from drake_shared.cockpit.meshcat_proxy import start_meshcat
from drake_shared.cockpit.server import CockpitServer
from drake_shared.common.errors import InputError

NAME = "lab.example"
_HOP = {"connection", "upgrade", "keep-alive", "transfer-encoding", "content-encoding", "content-length"}


@pytest.fixture(scope="module")
def meshcat():
    return start_meshcat()


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    """A certificate for the name, and the contexts of a server that has it and a client that trusts it."""
    folder = tmp_path_factory.mktemp("tls")
    subprocess.run(
        [
            *(
                "openssl",
                "req",
                "-x509",
                "-newkey",
                "ec",
                "-pkeyopt",
                "ec_paramgen_curve:prime256v1",
                "-nodes",
            ),
            *("-keyout", folder / "key.pem", "-out", folder / "cert.pem", "-days", "1"),
            *("-subj", f"/CN={NAME}", "-addext", f"subjectAltName=DNS:{NAME}"),
        ],
        check=True,
        capture_output=True,
    )
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(folder / "cert.pem", folder / "key.pem")
    return server, ssl.create_default_context(cafile=str(folder / "cert.pem"))


class Resolver(aiohttp.abc.AbstractResolver):
    """Finds every name on this computer."""

    async def resolve(self, host, port=0, family=0):
        return [{"hostname": host, "host": "127.0.0.1", "port": port, "family": 2, "proto": 0, "flags": 0}]

    async def close(self):
        pass


async def passed_on(source, target) -> None:
    """Passes on the messages of a websocket until it closes, and then closes the other."""
    async for message in source:
        await target.send_str(message.data)
    await target.close()


@contextlib.asynccontextmanager
async def tls_proxy(upstream: int, context: ssl.SSLContext, *, keeps_host: bool):
    """A reverse proxy for pages and websockets, like that of nginx; yields its port."""

    async def forward(request: web.Request) -> web.StreamResponse:
        url = f"http://127.0.0.1:{upstream}{request.raw_path}"
        headers = {name: value for name, value in request.headers.items() if name.lower() not in _HOP}
        if not keeps_host:
            headers["Host"] = f"127.0.0.1:{upstream}"
        async with aiohttp.ClientSession(cookie_jar=aiohttp.DummyCookieJar()) as http:
            if request.headers.get("Upgrade", "").lower() == "websocket":
                headers = {k: v for k, v in headers.items() if not k.lower().startswith("sec-websocket")}
                try:
                    async with http.ws_connect(url, headers=headers) as inside:
                        outside = web.WebSocketResponse()
                        await outside.prepare(request)
                        await asyncio.gather(passed_on(inside, outside), passed_on(outside, inside))
                        return outside
                except aiohttp.WSServerHandshakeError as error:
                    return web.Response(status=error.status)
            async with http.get(url, headers=headers, allow_redirects=False) as answer:
                kept = [(k, v) for k, v in answer.headers.items() if k.lower() not in _HOP]
                response = web.Response(status=answer.status, body=await answer.read())
                for name, value in kept:
                    response.headers.add(name, value)
                return response

    app = web.Application()
    app.router.add_route("*", "/{path:.*}", forward)
    runner = web.AppRunner(app, shutdown_timeout=0.1)
    await runner.setup()
    site = web.TCPSite(runner, "127.0.0.1", 0, ssl_context=context)
    await site.start()
    try:
        yield runner.addresses[0][1]
    finally:
        await runner.cleanup()


async def visit(server: CockpitServer, certificate, *, keeps_host: bool) -> tuple[int, int, str]:
    """Status of the page and of its websocket through the proxy, and the text of the page."""
    context, trust = certificate
    async with (
        tls_proxy(server.port, context, keeps_host=keeps_host) as port,
        aiohttp.ClientSession(connector=aiohttp.TCPConnector(resolver=Resolver(), ssl=trust)) as http,
    ):
        key = server.address.partition("?")[2]
        async with http.get(f"https://{NAME}:{port}/?{key}") as answer:
            status, text = answer.status, await answer.text()
        try:
            async with http.ws_connect(f"https://{NAME}:{port}/drive", origin=f"https://{NAME}") as page:
                await page.receive_json()
                return status, 101, text
        except aiohttp.WSServerHandshakeError as error:
            return status, error.status, text


@pytest.mark.parametrize("keeps_host", [True, False])
def test_the_page_is_driven_through_a_proxy_that_speaks_tls(meshcat, certificate, keeps_host):
    with CockpitServer(
        meshcat_url=meshcat.web_url(), driver_lock=DriverLock(), port=0, proxy=f"https://{NAME}/"
    ) as server:
        assert server.address.startswith(f"https://{NAME}/?k=")
        status, websocket, _ = asyncio.run(visit(server, certificate, keeps_host=keeps_host))
    assert (status, websocket) == (200, 101)


def test_without_the_option_the_refusal_names_it(meshcat, certificate):
    with CockpitServer(meshcat_url=meshcat.web_url(), driver_lock=DriverLock(), port=0) as server:
        status, websocket, text = asyncio.run(visit(server, certificate, keeps_host=True))
    assert (status, websocket) == (403, 403)
    assert "--behind-proxy" in text
    assert "--allow-host" in text


def test_the_page_of_another_site_is_refused_behind_a_proxy(meshcat, client):
    with CockpitServer(
        meshcat_url=meshcat.web_url(), driver_lock=DriverLock(), port=0, proxy=f"https://{NAME}"
    ) as server:

        async def talk(http):
            found = {}
            async with http.get(f"http://127.0.0.1:{server.port}/?{server.address.partition('?')[2]}"):
                pass
            for origin in (f"https://{NAME}", f"http://{NAME}", f"https://{NAME}:1", "https://evil.example"):
                try:
                    url = f"http://127.0.0.1:{server.port}/drive"
                    async with http.ws_connect(url, origin=origin):
                        found[origin] = 101
                except aiohttp.WSServerHandshakeError as error:
                    found[origin] = error.status
            return found

        assert client(talk) == {
            f"https://{NAME}": 101,
            f"http://{NAME}": 403,
            f"https://{NAME}:1": 403,
            "https://evil.example": 403,
        }


@pytest.mark.parametrize(("allowed", "status"), [((), 403), (("Robot.Lab",), 303)])
def test_a_further_name_must_be_allowed(meshcat, client, allowed, status):
    with CockpitServer(
        meshcat_url=meshcat.web_url(), driver_lock=DriverLock(), port=0, allowed_hosts=allowed
    ) as server:

        async def talk(http):
            headers = {"Host": f"robot.lab:{server.port}"}
            async with http.get(server.address, headers=headers, allow_redirects=False) as answer:
                return answer.status

        assert client(talk) == status


@pytest.mark.parametrize(
    "proxy", ["lab.example", "ftp://lab.example", "https://", "https://a/b", "https://a:x"]
)
def test_a_proxy_must_be_an_origin(proxy):
    with pytest.raises(InputError) as caught:
        Access(host="127.0.0.1", proxy=proxy)
    assert caught.value.source == "--behind-proxy"


@pytest.mark.parametrize(
    ("proxy", "origin"),
    [
        ("https://LAB.example:443/", "https://lab.example"),
        ("https://lab.example:8443", "https://lab.example:8443"),
        ("http://[::1]:80", "http://[::1]"),
    ],
)
def test_an_origin_is_written_as_browsers_do(proxy, origin):
    assert Access(host="127.0.0.1", proxy=proxy).proxy == origin

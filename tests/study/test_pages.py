"""The pages of a study: links, order of steps, the experimenter's actions, and participants side by side."""

import asyncio
import contextlib
import functools
import json
import os
import random
import socket
import threading
import time
import urllib.error
import urllib.request

import pytest
import yaml

from drake_shared.cli.main import main
from drake_shared.cockpit.chromium import CHROMIUM_ARGUMENTS, find_chromium
from drake_shared.common.errors import InputError
from drake_shared.study.dry_run import simulate
from drake_shared.study.links import EXPERIMENTER
from drake_shared.study.protocol import plan
from drake_shared.study.questionnaires import Questionnaire
from drake_shared.study.server import StudyServer
from drake_shared.study.store import StudyData

PATIENCE = 240.0  # Simulations start in processes of their own, which a loaded machine does slowly.
SHORT = """
name: short
duration: 60.0
travel_time: 2.0
control_period: 0.05
goal: {x: 0.5, y: 0.0, radius: 0.2}
workspace: {x_min: -1.0, x_max: 2.0, y_min: -1.0, y_max: 1.0}
obstacles: []
routes:
- {name: straight, waypoints: [[0.0, 0.0], [0.5, 0.0]], sides: {}}
"""


@contextlib.contextmanager
def in_thread(serve):
    """Runs ``serve(started)``, a coroutine, in a thread until the block ends."""
    started = threading.Event()
    running: dict = {}

    async def run() -> None:
        running["loop"], running["task"] = asyncio.get_running_loop(), asyncio.current_task()
        await serve(started.set)

    def main() -> None:
        with contextlib.suppress(asyncio.CancelledError):
            asyncio.run(run())

    thread = threading.Thread(target=main)
    thread.start()
    assert started.wait(PATIENCE)
    try:
        yield
    finally:
        running["loop"].call_soon_threadsafe(running["task"].cancel)
        thread.join()


@contextlib.contextmanager
def serving(data: StudyData, **options):
    server = StudyServer(data, **options)
    with in_thread(server.serve):
        yield server


def free_ports(count: int) -> int:
    """The first of ``count`` consecutive ports that are free."""
    draw = random.Random()
    while True:
        first = draw.randrange(20_000, 60_000)
        with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
            for port in range(first, first + count):
                stack.enter_context(socket.create_server(("127.0.0.1", port)))
            return first


def forwarding(ports: dict[int, int]):
    """A proxy that leads each port to another one, as nginx does for the machines behind it."""

    async def pipe(source, target) -> None:
        with contextlib.closing(target), contextlib.suppress(OSError):
            while data := await source.read(65_536):
                target.write(data)
                await target.drain()

    async def serve(started) -> None:
        async def forward(inner: int, reader, writer) -> None:
            # Closed also where the block ends: a writer that outlives its loop warns, and a warning fails.
            with contextlib.closing(writer), contextlib.suppress(OSError):
                there = await asyncio.open_connection("127.0.0.1", inner)
                await asyncio.gather(pipe(reader, there[1]), pipe(there[0], writer))

        servers = [
            await asyncio.start_server(functools.partial(forward, inner), "127.0.0.1", outer)
            for outer, inner in ports.items()
        ]
        started()
        try:
            await asyncio.Event().wait()
        finally:
            for server in servers:
                server.close()

    return in_thread(serve)


@pytest.fixture
def study(small):
    """Driving a short way, between participants, with a rating after the block."""
    data = yaml.safe_load((small / "study.yaml").read_text())
    (small / "short.yaml").write_text(SHORT)
    form = {"elements": [{"type": "rating", "name": "ease", "title": "Easy?", "isRequired": True}]}
    (small / "ease.json").write_text(json.dumps(form | {"scores": {"ease": {"weights": {"ease": 1}}}}))
    data |= {"scenario": "short.yaml", "design": "between", "trials": 1, "practice": 0}
    data |= {"questionnaires": {"block": ["ease.json"]}, "most_ping": 5.0}
    data["measures"] = {"primary": [{"name": "completion_time", "smallest_effect": 0.5}]}
    (small / "study.yaml").write_text(yaml.safe_dump(data))
    plan(small)
    return small


def post(address: str, path: str, **given) -> dict:
    request = urllib.request.Request(
        f"{address}/{path}", json.dumps(given).encode(), {"Content-Type": "application/json"}
    )
    with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
        return json.load(answer)


def test_steps_come_in_order_and_an_answer_is_taken_once(study):
    data = StudyData(study)
    with serving(data) as server:
        link = server.address_of("P01")
        assert post(link, "step", page="a")["do"] == "ping"
        shown = post(link, "step", page="a", ping=0.001)
        assert (shown["step"], shown["consent"]) == ("000_consent", True)
        shown = post(link, "step", page="a", step="000_consent", answers={"agreed": True})
        assert shown["step"] == "001_introduction"
        assert post(link, "step", page="a", step="000_consent", answers={})["step"] == "001_introduction"
    with serving(StudyData(study)) as server:
        # After a crash of the server the link leads to the same place.
        assert post(server.address_of("P01"), "step", page="b", ping=0.001)["step"] == "001_introduction"
    assert data.completed("P01") == data.steps["P01"][:1]


def test_a_link_is_used_once_at_a_time_and_others_are_unknown(study):
    with serving(StudyData(study)) as server:
        link = server.address_of("P01")
        post(link, "step", page="a", ping=0.001)
        assert post(link, "step", page="b", ping=0.001)["do"] == "refused"
        assert post(link, "step", page="a")["do"] == "text"
        for wrong in (
            f"{link}x",
            link.replace("/p/", "/e/"),
            server.address_of(EXPERIMENTER).replace("/e/", "/p/"),
        ):
            with pytest.raises(urllib.error.HTTPError) as caught:
                post(wrong, "step", page="a")
            assert caught.value.code in (404, 405)
            caught.value.close()


def test_no_other_page_shows_or_keeps_that_of_a_participant(study):
    with (
        serving(StudyData(study)) as server,
        urllib.request.urlopen(server.address_of("P01"), timeout=PATIENCE) as answer,
    ):
        headers = answer.headers
    assert headers["X-Frame-Options"] == "DENY"
    assert headers["Cache-Control"] == "no-store"
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert "script-src 'self'" in headers["Content-Security-Policy"]


def test_a_machine_that_is_too_far_away_is_told_so(study):
    with serving(StudyData(study)) as server:
        shown = post(server.address_of("P01"), "step", page="a", ping=6.0)
        assert shown["do"] == "refused"
        assert "6000 ms" in shown["text"]


def test_experimenter_sees_notes_pauses_and_excludes(study):
    data = StudyData(study)
    with serving(data) as server:
        link, own = server.address_of("P01"), server.address_of(EXPERIMENTER)
        post(link, "step", page="a", ping=0.001)
        post(own, "state", participant="P01", do="note", text="wears glasses")
        post(own, "state", participant="P01", do="pause")
        assert post(link, "step", page="a")["do"] == "wait"
        state = post(own, "state", participant="P01", do="next")["participants"][0]
        assert state["notes"] == ["wears glasses"]
        assert (state["where"], state["present"], state["paused"]) == ("000_consent", True, False)
        assert post(link, "step", page="a")["step"] == "000_consent"
        post(own, "state", participant="P01", do="exclude", text="left")
        assert post(link, "step", page="a")["step"] is None
    assert data.ended("P01") == data.ended("P01") | {"kind": "excluded", "reason": "left"}


def test_who_does_not_agree_takes_no_part(study):
    data = StudyData(study)
    with serving(data) as server:
        link = server.address_of("P02")
        post(link, "step", page="a", ping=0.001)
        assert post(link, "step", page="a", withdraw=True)["step"] is None
    assert data.ended("P02")["kind"] == "withdrawn"
    assert data.completed("P02") == []


def test_a_clock_that_is_set_forward_does_not_free_a_link(study, monkeypatch):
    with serving(StudyData(study)) as server:
        link, now = server.address_of("P01"), time.time()
        post(link, "step", page="a", ping=0.001)
        monkeypatch.setattr(time, "time", lambda: now + 86_400.0)
        assert post(link, "step", page="b", ping=0.001)["do"] == "refused"


@pytest.mark.parametrize(
    ("options", "field"), [({"participants": ["P1"]}, "--participants"), ({"proxy": "lab.example"}, "")]
)
def test_what_a_server_is_asked_to_serve_is_checked(study, options, field):
    with pytest.raises(InputError) as caught:
        StudyServer(StudyData(study), **options)
    assert caught.value.field == field


def test_simulated_data_are_not_continued_by_people(study):
    list(simulate(StudyData(study), 1))
    with pytest.raises(InputError):
        StudyServer(StudyData(study))


@pytest.fixture
def browser():
    path = find_chromium()
    if path is None:
        if os.environ.get("CI"):
            pytest.fail("no Chromium: install it or set DRAKE_SHARED_CHROMIUM")
        pytest.skip("no Chromium: install it or set DRAKE_SHARED_CHROMIUM")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(CHROMIUM_ARGUMENTS))
        yield browser
        browser.close()


def until(condition, page) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, f"waited for {page.url}: {page.inner_text('body')[:500]}"
        page.wait_for_timeout(50)


def begin_to_drive(page, key: str = "ArrowUp") -> None:
    page.wait_for_url(lambda url: "/p/" not in url)
    page.wait_for_selector("#drive:enabled")
    page.click("#drive")
    page.keyboard.down(key)


@pytest.mark.browser
def test_two_participants_take_part_through_a_proxy_to_two_servers_with_reloads(study, browser, violations):
    data = StudyData(study)
    # Each server has a port for its pages and one more for the trials of each participant, as has the proxy.
    size = len(data.steps) + 1
    inside, outside = free_ports(2 * size), free_ports(2 * size)
    places = {"P01": 0, "P03": size}
    with contextlib.ExitStack() as stack:
        stack.enter_context(forwarding({outside + n: inside + n for n in range(2 * size)}))
        servers = {
            name: stack.enter_context(
                serving(
                    data,
                    port=inside + offset,
                    participants=[name],
                    proxy=f"http://127.0.0.1:{outside + offset}",
                )
            )
            for name, offset in places.items()
        }
        with pytest.raises(urllib.error.HTTPError) as caught:
            post(servers["P01"].address_of("P03"), "step", page="x")
        caught.value.close()
        pages = []
        for name, server in servers.items():
            page = browser.new_context(viewport={"width": 800, "height": 600}).new_page()
            page.set_default_timeout(1000 * PATIENCE)
            page.goto(server.address_of(name))
            pages.append(page)
        for page in pages:
            page.get_by_role("button", name="I agree").click()
            page.get_by_text("Drive to the goal.").wait_for()
        assert violations(pages[0]) == []
        pages[0].reload()
        for page in pages:
            page.get_by_role("button", name="Continue").click()
        # The first one reloads the page while driving, on the spot, so that no goal is reached before on a
        # loaded machine: the trial is driven again.
        begin_to_drive(pages[0], "ArrowLeft")
        pages[0].wait_for_selector("#deck[data-phase=driving]")
        assert f":{outside + 1}/" in pages[0].url
        assert not pages[0].is_visible("#assist-row, #task, #intro, #arbitration")
        pages[0].reload()
        pages[0].keyboard.up("ArrowLeft")
        until(lambda: data.notes("P01"), pages[0])
        for page in pages:
            begin_to_drive(page)
        for page in pages:
            page.wait_for_url(lambda url: "/p/" in url)
            page.keyboard.up("ArrowUp")
            page.get_by_text("4", exact=True).click()
            page.get_by_role("button", name="Continue").click()
            page.get_by_text("Thank you for taking part.").wait_for()
        pages[0].goto(servers["P01"].address_of(EXPERIMENTER))
        pages[0].get_by_text("finished").first.wait_for()
        assert violations(pages[0]) == []
    trials = [trial.metadata["study"] for _, trial in data.trials()]
    assert [trial["participant"] for trial in trials] == list(places)
    for trial in trials:
        assert data.next_step(trial["participant"]) is None
        assert trial["latency_p99"] >= trial["latency_p50"] > 0.0
        assert 0.0 <= trial["late_share"] <= 1.0
    assert {answers["ease"] for _, answers in data.answers()} == {4}


@pytest.mark.browser
def test_a_simulated_participant_drives_and_answers_on_the_page(study, tmp_path, monkeypatch):
    if find_chromium() is None:
        pytest.skip("no Chromium: install it or set DRAKE_SHARED_CHROMIUM")
    design = yaml.safe_load((study / "study.yaml").read_text())
    design["questionnaires"]["block"] = ["raw_tlx", "demographics"]
    (study / "study.yaml").write_text(yaml.safe_dump(design))
    plan(study)
    drawn = Questionnaire.simulated_answers

    def highest(self, random):
        ratings = {item["name"]: item["rateMax"] for item in self.items if item["type"] == "rating"}
        return drawn(self, random) | ratings

    monkeypatch.setattr(Questionnaire, "simulated_answers", highest)
    pictures = tmp_path / "pictures"
    command = ["study", "run", str(study), "--simulate", "1", "--page", "--port", "0"]
    assert main([*command, "--pictures", str(pictures)]) == 0
    data = StudyData(study)
    assert data.next_step("P01") is None
    ((_, trial),) = data.trials()
    assert trial.status == "reached"
    assert trial.metadata["study"]["simulated"]
    asked = {step.questionnaire: answers for step, answers in data.answers()}
    assert list(asked) == ["raw_tlx", "demographics"]
    assert set(asked["raw_tlx"].values()) == {20}
    assert len(list(pictures.glob("P01_*.png"))) >= 6
    assert main([*command[:4], "1"]) == 0  # Headless runs continue what pages began.

"""Simulated participants at the pages of a study, in Chromium; needs Playwright (the extra ``browser``)."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
from pathlib import Path

import numpy as np
from playwright.async_api import Error, Page, ViewportSize, async_playwright

from drake_shared.cockpit.chromium import CHROMIUM_ARGUMENTS, find_chromium
from drake_shared.common.errors import InputError, RunError
from drake_shared.study.questionnaires import Questionnaire
from drake_shared.study.server import StudyServer
from drake_shared.study.simulated import simulated_behaviours
from drake_shared.study.simulated_hand import SimulatedHand
from drake_shared.study.steps import Step
from drake_shared.study.store import StudyData

_PERIOD = 0.05
_PATIENCE = 120.0
"""Longest time for a step beside that of a trial, in [s]."""
_VIEW: ViewportSize = {"width": 1280, "height": 800}
# A gamepad, whose axes a participant moves. The page learns from its first readings where they rest, and
# counts deflections past 0.15.
_GAMEPAD = """
window.axes = [0, 0];
const pad = {id: "simulated", index: 0, connected: true, mapping: "standard", buttons: []};
navigator.getGamepads = () => [{...pad, axes: window.axes}];
"""
_REST = 40
"""Periods in whose first half the stick rests, and is then pushed, until the trial starts."""
_DEAD_ZONE = 0.15
_DRIVING = 60
"""Period of a trial in which a picture is taken."""


async def simulate_on_page(
    server: StudyServer, data: StudyData, count: int, *, pictures: Path | None = None
) -> None:
    """Takes the first participants of a server through its pages, one after another.

    They click, answer at random, and drive with a gamepad as `SimulatedHand` does.

    Args:
        server: For simulated participants; it must be serving.
        data: Of the study.
        count: Number of participants.
        pictures: Folder for a picture of the page at each step; None: no pictures.

    Raises:
        InputError: There is no Chromium.
        RunError: A page does not go on to the next step.
    """
    path = find_chromium()
    if path is None:
        raise InputError("study run", "--page", "needs Chromium: install it, or set DRAKE_SHARED_CHROMIUM")
    behaviours = dict(
        zip(data.steps, simulated_behaviours(len(data.steps), seed=data.study.seed), strict=True)
    )
    scenario = data.study.load_scenario()
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=path, args=list(CHROMIUM_ARGUMENTS))
        for name in server.participants[:count]:
            context = await browser.new_context(viewport=_VIEW)
            hand = SimulatedHand(scenario, behaviours[name])
            participant = _Participant(data, name, await context.new_page(), hand, pictures)
            await participant.take_part(server.address_of(name))
            await context.close()
        await browser.close()


class _Participant:
    """A simulated participant at a page."""

    def __init__(
        self, data: StudyData, name: str, page: Page, hand: SimulatedHand, pictures: Path | None
    ) -> None:
        self._data, self._name, self._page, self._hand, self._pictures = data, name, page, hand, pictures
        self._asked = data.study.load_questionnaires()
        self._deflection = (0.0, 0.0)
        page.set_default_timeout(1000.0 * _PATIENCE)
        page.on("websocket", lambda socket: socket.on("framereceived", self._see))

    def _see(self, frame: str | bytes) -> None:
        if isinstance(frame, str):  # Those of the scene are bytes.
            self._deflection = self._hand.see(json.loads(frame)) or self._deflection

    async def take_part(self, address: str) -> None:
        """Completes all steps that are left."""
        await self._page.add_init_script(_GAMEPAD)
        await self._page.goto(address)
        while (step := self._data.next_step(self._name)) is not None and step.kind != "thanks":
            try:
                await self._complete(step)
            except Error as error:
                reason = error.message.partition("\n")[0]
                raise RunError(f"{self._name}: the page does not complete {step.name} ({reason})") from error
        await self._page.wait_for_selector("#content[data-step=end]")
        await self._take_picture("thanks")

    async def _complete(self, step: Step) -> None:
        page, longest = self._page, _PATIENCE
        if step.kind == "trial":
            longest += self._hand.longest
            await page.wait_for_selector("#drive:enabled")
            await self._take_picture(step.name)
            await page.click("#drive")
        else:
            await page.wait_for_selector(f'#content[data-step="{step.name}"]')
            if step.questionnaire is not None:
                random = np.random.default_rng([self._data.study.seed, step.index, *self._name.encode()])
                await _answer(page, self._asked[step.questionnaire], random)
            await self._take_picture(step.name)
            await page.get_by_role("button", name="I agree" if step.kind == "consent" else "Continue").click()
        for count in range(round(longest / _PERIOD)):
            if self._data.next_step(self._name) != step:
                return
            if step.kind == "trial":
                rests = not self._hand.driving and count % _REST < _REST // 2
                axes = [0.0 if rests else -_past_dead_zone(value) for value in reversed(self._deflection)]
                with contextlib.suppress(Error):  # The page goes on when the block is over.
                    await page.evaluate("axes => { window.axes = axes; }", axes)
                    if count == _DRIVING:
                        await self._take_picture(f"{step.name}_driving")
            await asyncio.sleep(_PERIOD)
        raise RunError(f"{self._name}: the page does not complete {step.name} within {longest:g} s")

    async def _take_picture(self, name: str) -> None:
        if self._pictures is not None:
            path = self._pictures / f"{self._name}_{name}.png"
            await self._page.screenshot(path=path, full_page="/p/" in self._page.url)


async def _answer(page: Page, asked: Questionnaire, random: np.random.Generator) -> None:
    answers = asked.simulated_answers(random)
    for item in asked.items:
        question, value = page.locator(f'[data-name="{item["name"]}"]'), answers[item["name"]]
        match item["type"]:
            case "rating" | "radiogroup":
                await question.locator("label").filter(has=page.locator(f'input[value="{value}"]')).click()
            case "boolean":
                await question.get_by_text("Yes" if value else "No", exact=True).click()
            case "comment":
                await question.locator("textarea").fill(str(value))
            case _:
                await question.locator("input").fill(str(value))


def _past_dead_zone(deflection: float) -> float:
    return math.copysign(_DEAD_ZONE + (1.0 - _DEAD_ZONE) * abs(deflection), deflection)

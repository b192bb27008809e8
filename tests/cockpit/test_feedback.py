"""Rumble and tone in the page, and that they end with the driver."""

import numpy as np
import pytest

from drake_shared.arbitration.feedback import Feedback
from drake_shared.simulation.config import SharedControlConfig

pytestmark = pytest.mark.browser

# A gamepad that records what it is made to do; its stick rests.
GAMEPAD = """
window.effects = [];
const pad = {
  connected: true, mapping: "standard", index: 0, id: "recording", timestamp: 0,
  axes: [0, 0, 0, 0], buttons: [],
  vibrationActuator: {
    effects: ["dual-rumble", "trigger-rumble"],
    playEffect: (kind, effect) => { window.effects.push({ kind, at: performance.now(), ...effect });
                                    return Promise.resolve("complete"); },
    reset: () => { window.effects.push({ kind: "reset", at: performance.now() }); return Promise.resolve(); },
  },
};
navigator.getGamepads = () => [pad, null, null, null];
"""


@pytest.fixture
def driven(browser_context, start_cockpit, long_floor, route_learner, until):
    """A page whose driver pushes to the side, so that the agent disagrees."""
    config = SharedControlConfig(feedback=Feedback(rumble=True, tone=True, resistance=0.2))
    cockpit = start_cockpit(long_floor, route_learner(long_floor), config=config)
    page = browser_context.new_page()
    page.add_init_script(GAMEPAD)
    page.goto(cockpit.address)
    page.wait_for_selector("#deck[data-phase=ready]")
    page.evaluate("viewer.animate = () => {}; do_reconnect = false; viewer.connection.close()")
    page.click("#drive:enabled")
    page.wait_for_selector("body[data-driver-lock=yours]")
    page.keyboard.down("ArrowUp")
    page.keyboard.down("ArrowLeft")
    until(lambda: np.any(cockpit.command > 0), "the robot to be driven")
    return page, cockpit


def test_a_conflict_is_felt_on_the_side_of_the_agent_and_ends_with_the_driver(driven):
    page, cockpit = driven
    # The driver turns left; the agent goes straight on. At first only the speeds differ.
    to_the_right = "window.effects.find((one) => one.rightTrigger > one.leftTrigger)"
    page.wait_for_function(f"() => {to_the_right}")
    page.keyboard.up("ArrowLeft")
    page.keyboard.up("ArrowUp")
    first = page.evaluate(to_the_right)
    assert 0.0 < first["strongMagnitude"] <= 1.0
    assert first["duration"] <= 200.0
    page.keyboard.press("Escape")
    page.wait_for_selector("#deck[data-phase=finished]")
    trial = cockpit.next_trial()
    assert trial["conflict"].max() >= first["strongMagnitude"] - 1e-4
    assert trial.metadata["config"]["feedback"] == {"rumble": True, "tone": True, "resistance": 0.2}
    effects = page.evaluate("window.effects")
    assert effects[-1]["kind"] == "reset"


def test_a_tone_without_messages_ends_within_200_ms(browser_context, cockpit):
    """Rendered offline: what is heard at a time of the audio's clock does not depend on the load."""
    page = browser_context.new_page()
    page.goto(cockpit.address)
    samples = page.evaluate(
        """async () => {
          const { Feedback } = await import("/cockpit/feedback.js");
          const contexts = [];
          window.AudioContext = class extends OfflineAudioContext {
            constructor() {
              super(2, 22050, 44100); // Half a second.
              contexts.push(this);
            }
          };
          const feedback = new Feedback();
          feedback.setScene({ feedback: { rumble: false, tone: true } });
          feedback.start();
          feedback.render([0.8, -1, 1]);
          const sound = await contexts[0].startRendering();
          return [0, 1].map((channel) => [...sound.getChannelData(channel)]);
        }"""
    )
    left, right = np.abs(samples).reshape(2, -1, 441).max(axis=2)  # The loudest in each 10 ms.
    assert left[5] > 0.05
    assert right[9] < 0.1 * left[9]  # The agent turns further to the left.
    assert max(left[20:].max(), right[20:].max()) < 0.01

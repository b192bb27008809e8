"""The page with an arm: the wheel lifts and lowers the tip, a click switches the plane."""

import pytest

from drake_shared.scenario import load_scenario
from drake_shared.systems.tip_input import TipInput

pytestmark = pytest.mark.browser


# Base and tip, as Meshcat places them.
BASE_IN_VIEW = """() => {
  const { THREE } = window.MeshCat;
  const links = [];
  viewer.scene.traverse((node) => { if (node.isMesh && /link|tip/.test(pathOf(node))) links.push(node); });
  return links.length > 5 && links.every((link) => {
    const middle = new THREE.Box3().setFromObject(link).getCenter(new THREE.Vector3());
    const { x, y } = middle.project(viewer.camera);
    return Math.abs(x) < 1 && Math.abs(y) < 1;
  });
  function pathOf(node) { return node ? `${pathOf(node.parent)}/${node.name}` : ""; }
}"""


@pytest.fixture(scope="module")
def cockpit(start_lasting_cockpit):
    scenario = load_scenario("table_three_cups")

    def operator(source):
        return TipInput(robot=scenario.robot, source=source)

    return start_lasting_cockpit(scenario, operator=operator)


def test_wheel_and_click_move_the_tip_as_the_page_says(cockpit, lasting_context, until):
    page = lasting_context.new_page()
    page.goto(cockpit.address)
    page.wait_for_selector("#drive:not([disabled])")
    assert page.get_attribute('[data-view="free"]', "aria-pressed") == "true"
    assert "x-y" in page.inner_text("#plane")
    # The whole arm is in view, base and all.
    page.wait_for_function(BASE_IN_VIEW)
    # The lines of the map are thinner than what they are around, also on a table of a metre.
    page.wait_for_selector(".setup-map .goal", state="attached")
    goal = page.locator(".setup-map .goal").first
    thickness, radius = goal.evaluate(
        "node => [parseFloat(getComputedStyle(node).strokeWidth), +node.getAttribute('r')]"
    )
    assert 0.0 < thickness < radius
    page.evaluate("document.getElementById('intro').hidden = true")
    page.click("#drive")
    until(lambda: cockpit.driver_lock.holder is not None, "a driver")
    page.mouse.move(400, 200)
    for _ in range(3):
        page.mouse.wheel(0, 100)
    until(lambda: cockpit.driver_lock.latest().up < -0.05, "the wheel")
    page.mouse.down()
    page.mouse.up()
    until(lambda: cockpit.driver_lock.latest().vertical, "the other plane")
    page.wait_for_function("document.getElementById('plane').textContent.includes('y-z')")
    page.keyboard.press("Escape")
    until(lambda: cockpit.driver_lock.holder is None, "a free lock")
    trial = cockpit.next_trial()
    # A command is that of the plane in its row; only the wheel moves the tip up or down in x-y.
    assert (trial["human_vz"][trial["plane"] == 0.0] <= 0.0).all()
    assert not trial["human_vx"][trial["plane"] == 1.0].any()

"""The page of a replay in a real browser: everything in view, the player, and a task far from the origin."""

import numpy as np
import pytest

from drake_shared.analysis.replay import write_replay
from drake_shared.simulation.trial import Trial

pytestmark = pytest.mark.browser

# Visible parts that leave the window, are cut off, or overlap.
FAULTS = """() => {
  const faults = [];
  const parts = ["#replay-header", "#meshcat-pane", "#replay-player"].map((id) => document.querySelector(id));
  const texts = [...document.querySelectorAll(
    "#replay-header *, #replay-player *:not(path, option), .scene-bar > *, .scene-labels span")];
  for (const element of [...parts, ...texts].filter((part) => part.checkVisibility())) {
    const { left, right, top, bottom } = element.getBoundingClientRect();
    if (left < -0.5 || top < -0.5 || right > innerWidth + 0.5 || bottom > innerHeight + 0.5) {
      faults.push(`${element.id || element.className || element.tagName} leaves the window`);
    }
  }
  const [header, pane, player] = parts.map((part) => part.getBoundingClientRect());
  if (header.bottom > pane.top + 0.5 || pane.bottom > player.top + 0.5) faults.push("parts overlap");
  if (pane.height < 200) faults.push("the scene is too low");
  if (document.documentElement.scrollWidth > innerWidth) faults.push("the page scrolls");
  return faults;
}"""
LABELS = (
    "() => [...document.querySelectorAll('.scene-labels span:not([hidden])')].map((span) => span.innerText)"
)


@pytest.fixture(scope="module")
def folder(human_trial, _two_obstacles, route_learner, tmp_path_factory):
    folder = tmp_path_factory.mktemp("replays")
    write_replay(human_trial, folder / "near.html", learner=route_learner(_two_obstacles))
    moved = moved_by(human_trial, 500_000.0, 4_400_000.0)
    write_replay(moved, folder / "far.html", learner=None)
    write_replay(human_trial, folder / "plain.html", learner=None)
    return folder


def moved_by(trial: Trial, east: float, north: float) -> Trial:
    """The same trial somewhere else, such as at the coordinates of a map."""
    columns = dict(trial.columns)
    columns |= {"x": trial["x"] + east, "y": trial["y"] + north}

    shift = {"x": east, "x_min": east, "x_max": east, "y": north, "y_min": north, "y_max": north}

    def move(value, name=None):
        if name in shift:
            return value + shift[name]
        if name == "waypoints":
            return [[x + east, y + north] for x, y in value]
        if isinstance(value, dict):
            return {key: move(item, key) for key, item in value.items()}
        return [move(item) for item in value] if isinstance(value, list) else value

    scenario = move(trial.metadata["scenario"])
    return Trial(columns=columns, metadata=trial.metadata | {"scenario": scenario})


@pytest.fixture(scope="module")
def page(lasting_context, folder):
    page = lasting_context.new_page()
    page.errors = []
    page.on("pageerror", lambda error: page.errors.append(str(error)))
    page.goto((folder / "near.html").as_uri())
    page.wait_for_function("() => document.querySelector('.scene-labels span:not([hidden])')")
    return page


def drawn(page):
    """Waits until the page has drawn the whole scene once more."""
    page.evaluate("() => { window.drawn = 0; viewer.render_callback = () => window.drawn++; }")
    # After a change of size, one frame that is asked for draws the picture of the robot only.
    page.wait_for_function("() => { viewer.set_dirty(); return window.drawn > 0; }")


@pytest.mark.parametrize("size", [(1280, 720), (390, 844)])
def test_everything_is_in_view(page, size):
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.wait_for_function(f"() => innerWidth === {size[0]}")
    drawn(page)
    assert page.evaluate(FAULTS) == []
    assert {"Start", "Goal"} <= set(page.evaluate(LABELS))


@pytest.mark.parametrize(("theme", "size"), [("light", (1280, 720)), ("dark", (390, 844))])
def test_axe_core_finds_no_fault(page, theme, size, violations):
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.emulate_media(color_scheme=theme)
    page.wait_for_selector(f"[data-theme={theme}]")
    page.wait_for_selector(".scene-labels [data-kind=route]:not([hidden])")
    assert violations(page) == []


def test_outcome_and_figures_are_those_of_the_trial(page, human_trial):
    assert page.inner_text("#replay-outcome") == "Goal reached"
    text = page.inner_text("#replay-measures")
    assert f"{human_trial['t'][-1]:.1f} s" in text
    assert f"{human_trial['clearance'].min():.2f} m" in text
    assert page.inner_text("#replay-title").startswith("two_obstacles")


def test_the_slider_moves_robot_values_and_curves_cursor(page, human_trial):
    row = 100
    time = float(human_trial["t"][row])
    page.evaluate(
        """(time) => {
          const slider = document.querySelector("#replay-time");
          slider.value = time;
          slider.dispatchEvent(new Event("input"));
        }""",
        time,
    )
    x, y = page.evaluate(
        """() => {
          const robot = viewer.scene_tree.find(["drake", "scene", "robot"]).object;
          return [robot.position.x, robot.position.y];
        }"""
    )
    np.testing.assert_allclose([x, y], human_trial.positions[row], atol=1e-3)
    assert page.inner_text("#replay-clock").startswith(f"{time:.1f}")
    assert page.inner_text("#replay-weight") == f"{100 * human_trial['human_weight'][row]:.0f} %"


def test_it_plays_at_the_chosen_speed_and_stops_at_the_end(page, human_trial):
    end = float(human_trial["t"][-1])
    page.select_option("#replay-speed", "4")
    page.evaluate(
        """(time) => {
          const slider = document.querySelector("#replay-time");
          slider.value = time;
          slider.dispatchEvent(new Event("input"));
        }""",
        end - 1.0,
    )
    page.click("#replay-play")
    page.wait_for_selector("#replay-play[aria-label=Play]")
    assert float(page.input_value("#replay-time")) == pytest.approx(end, abs=1e-3)
    assert page.errors == []


def test_far_from_the_origin_the_picture_is_the_same(lasting_context, folder):
    """Single precision has steps of 3 cm at 500 km and of 0.5 m at 4,400 km."""
    pictures = []
    for name in ("plain", "far"):
        page = lasting_context.new_page()
        page.goto((folder / f"{name}.html").as_uri())
        page.wait_for_function("() => document.querySelector('.scene-labels span:not([hidden])')")
        page.wait_for_function(
            "() => viewer.scene_tree.find(['drake', 'scene', 'robot']).object.children.length > 3"
        )
        pixels = page.evaluate(
            """() => {
              const gl = viewer.renderer.getContext();
              viewer.render();
              const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
              const pixels = new Uint8Array(4 * width * height);
              gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
              return [...pixels.filter((_, i) => i % 61 === 0)];
            }"""
        )
        pictures.append(np.array(pixels, dtype=int))
        page.close()
    assert len(np.unique(pictures[0])) > 20
    assert np.mean(np.abs(pictures[0] - pictures[1]) > 40) < 0.02

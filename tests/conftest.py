"""What several tests need: scenarios, a learner without training, a step of a system, and axe-core."""

import copy
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import slipcover
import torch
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page
from pydrake.systems.framework import Context, LeafSystem
from threadpoolctl import threadpool_limits

from drake_shared.robots import Arm
from drake_shared.scenario import Goal, Route, Scenario, Workspace, load_scenario
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings

# SlipCover replaces functions that it has counted often, while they run. On Python 3.11 that keeps their
# frames, and with them Contexts that Drake has destroyed, until Python looks for cycles. If a test creates a
# Context at such an address, Drake's bindings take it for the old one and destroy it: one run of the suite in
# three crashed. The option against it does not reach the processes of pytest-xdist.
if hasattr(slipcover.Slipcover, "deinstrument_seen"):
    slipcover.Slipcover.deinstrument_seen = lambda self: None

# Their files take longest. They come first, so that no process is left with one of them at the end.
_LONG = ("experiments", "cockpit", "study", "docs", "analysis", "cli", "learners")


def pytest_configure() -> None:
    # A shell lets its background jobs ignore interrupts, and nohup the end of the terminal. Tests send both
    # to themselves and to subprocesses.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    folders = {name: place for place, name in enumerate(_LONG)}
    root = Path(__file__).parent
    items.sort(key=lambda item: folders.get(item.path.relative_to(root).parts[0], len(folders)))


class FakeLearner:
    """Predicts one route at an even pace, with a given variance.

    Args:
        route: Positions (N, 2) expected on the grid, in [m].
        variance: In [m^2]; a number, or an array that broadcasts to the grid (N, 2).
        clock: "time" or "progress".
    """

    name = "fake"
    preset = "test"

    def __init__(
        self, route: np.ndarray, *, period: float = 0.1, variance=0.01, gain: float = 40.0, clock="time"
    ):
        self.grid = np.arange(len(route)) * period
        self.duration = float(self.grid[-1])
        self.confidence_gain = gain
        self.demonstrations = np.asarray(route, dtype=float)[None]
        self.metadata = {"clock": clock, "id": "fake"}
        self.calls: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.variance = variance

    def predict(self, times, positions, query_times):
        self.calls.append((times.copy(), positions.copy(), query_times.copy()))
        index = np.searchsorted(self.grid, np.asarray(query_times) - 1e-9)
        variance = np.broadcast_to(self.variance, self.demonstrations[0].shape)
        return self.demonstrations[0][index].copy(), variance[index].copy()


@pytest.fixture(scope="session")
def violations() -> Callable[[Page], list[str]]:
    """What axe-core finds on a page: the rule, the elements and what to do."""

    def find(page: Page) -> list[str]:
        found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
        return [
            f"{item['id']}: {node['target']} {node['failureSummary']}"
            for item in found
            for node in item["nodes"]
        ]

    return find


@pytest.fixture(scope="session", autouse=True)
def _one_thread() -> Iterator[None]:
    """Several processes run the tests, and for arrays this small a second thread is slower."""
    torch.set_num_threads(1)
    with threadpool_limits(1):
        yield


@pytest.fixture(scope="session")
def fake_learner() -> type[FakeLearner]:
    return FakeLearner


@pytest.fixture(scope="session")
def _two_obstacles() -> Scenario:
    return load_scenario("two_obstacles")


@pytest.fixture
def scenario(_two_obstacles) -> Scenario:
    """The two-obstacle task, to be changed at will."""
    return copy.deepcopy(_two_obstacles)


@pytest.fixture
def open_floor() -> Scenario:
    """Four metres straight ahead with nothing in the way."""
    return Scenario(
        name="open_floor",
        goal=Goal(x=4.0, y=0.0),
        workspace=Workspace(x_min=-1.0, x_max=5.0, y_min=-2.0, y_max=2.0),
        routes=[Route(name="straight", waypoints=[[0.0, 0.0], [4.0, 0.0]])],
    )


@pytest.fixture(scope="session")
def route_learner() -> Callable[..., FakeLearner]:
    """A fake learner of one route of a scenario, driven in the scenario's travel time."""

    def make(scenario: Scenario, route: str | None = None, **options) -> FakeLearner:
        path = (scenario.routes[0] if route is None else scenario.route(route)).path(scenario.start)
        grid = np.arange(round(scenario.duration / 0.1) + 1) * 0.1
        share = np.clip(grid / scenario.travel_time, 0.0, 1.0)
        return FakeLearner(path.position(path.length * share), **options)

    return make


@pytest.fixture(scope="session")
def step() -> Callable[[LeafSystem, Context], None]:
    """Applies the periodic update of a discrete system to its Context."""

    def apply(system: LeafSystem, context: Context) -> None:
        update = system.EvalUniquePeriodicDiscreteUpdate(context)
        context.get_mutable_discrete_state().SetFrom(update)

    return apply


@pytest.fixture(scope="session")
def human_trial(_two_obstacles) -> Iterator[Trial]:
    """The surrogate operator alone on the first route of the two-obstacle task."""
    simulation = Simulation(_two_obstacles)
    return simulation.run(TrialSettings(driver="human", route="left_right", seed=5))


@pytest.fixture(scope="session")
def six_joint_arm(tmp_path_factory) -> Arm:
    """The shipped arm with its third joint fixed, and other names of base and tip."""
    text = Arm().model_path().read_text(encoding="utf-8")
    text = text.replace('name="joint3" type="revolute"', 'name="joint3" type="fixed"')
    text = text.replace('"link0"', '"pedestal"').replace('"tip"', '"pen"')
    start = text.index('  <transmission name="t3">')
    file = tmp_path_factory.mktemp("arm") / "six.urdf"
    file.write_text(text[:start] + text[text.index('  <transmission name="t4">') :], encoding="utf-8")
    return Arm(model=str(file), base="pedestal", tip="pen", home=[0.0, 0.045, -1.2174, 0.0, 1.8792, 0.0])

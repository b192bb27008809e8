"""IntentionEstimator with learners of known predictions: eq. (1), clocks, evidence, errors."""

import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from drake_shared.common.errors import InputError, RunError
from drake_shared.learners import Modes
from drake_shared.robots import DiffDrive
from drake_shared.simulation.config import config_for
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.systems.intention_estimator import IntentionEstimator

GRID = np.arange(0.0, 10.05, 0.1)
# Straight on at 0.5 m/s.
WAY = np.stack([0.5 * GRID, np.zeros_like(GRID)], axis=-1)


class Bench:
    """One IntentionEstimator and its Context."""

    def __init__(self, learner, **options):
        self.dut = IntentionEstimator(learner=learner, **options)
        self.context = self.dut.CreateDefaultContext()
        self.at(0.0, 0.0)

    def at(self, x: float, y: float, yaw: float = 0.0, *, time: float | None = None) -> "Bench":
        self.dut.GetInputPort("pose").FixValue(self.context, [x, y, yaw])
        if time is not None:
            self.context.SetTime(time)
        return self

    def commanded(self, *command: float) -> "Bench":
        self.dut.GetInputPort("human_command").FixValue(self.context, command)
        return self

    def step(self) -> "Bench":
        update = self.dut.EvalUniquePeriodicDiscreteUpdate(self.context)
        self.context.get_mutable_discrete_state().SetFrom(update)
        return self

    def eval(self, port: str):
        return self.dut.GetOutputPort(port).Eval(self.context)

    @property
    def intention(self):
        return self.eval("intention")

    @property
    def confidence(self) -> float:
        return self.eval("confidence").item()

    @property
    def mean_variance(self) -> float:
        return self.eval("mean_variance").item()

    @property
    def influence(self) -> list[float]:
        return self.eval("influence").tolist()


def test_equation_1_by_hand(fake_learner):
    # Four points: at t = 1 two are to come, with variances of 0.1 and 0.3 in x, 0.2 and 0.6 in y.
    variance = np.array([[9.0, 9.0], [9.0, 9.0], [0.1, 0.2], [0.3, 0.6]])
    bench = Bench(fake_learner(WAY[:4], period=1.0, variance=variance, gain=5.0)).at(0, 0, time=1.0)
    assert bench.mean_variance == pytest.approx(0.3)
    assert bench.confidence == pytest.approx(1 / (5.0 * 0.3))


def test_confidence_is_1_where_the_variance_is_small(fake_learner):
    bench = Bench(fake_learner(WAY, variance=1e-3, gain=40.0))
    assert bench.mean_variance == pytest.approx(1e-3)
    assert bench.confidence == 1.0


def test_at_the_end_the_last_query_alone_counts(fake_learner):
    variance = np.array([[9.0, 9.0], [9.0, 9.0], [9.0, 9.0], [0.3, 0.6]])
    bench = Bench(fake_learner(WAY[:4], period=1.0, variance=variance))
    for time in (2.5, 3.0, 7.0):
        bench.at(0, 0, time=time)
        assert bench.mean_variance == pytest.approx(0.45)
        assert bench.intention.first == 3
        assert bench.intention.time == min(time, 3.0)


def test_k_is_a_parameter_of_the_context(fake_learner):
    learner = fake_learner(WAY, variance=0.1, gain=40.0)
    bench = Bench(learner)
    other = bench.dut.CreateDefaultContext()
    bench.dut.SetLearner(bench.context, learner, confidence_gain=80.0)
    bench.dut.GetInputPort("pose").FixValue(other, [0, 0, 0])
    assert bench.confidence == pytest.approx(1 / 8)
    assert bench.dut.GetOutputPort("confidence").Eval(other) == pytest.approx(1 / 4)


def test_the_learner_is_a_parameter_of_the_context(fake_learner):
    bench = Bench(fake_learner(WAY, variance=0.1))
    other = bench.dut.CreateDefaultContext()
    bench.dut.SetLearner(other, fake_learner(WAY + np.array([0.0, 1.0]), variance=0.2, gain=10.0))
    bench.dut.GetInputPort("pose").FixValue(other, [0, 0, 0])
    assert bench.mean_variance == pytest.approx(0.1)
    assert bench.dut.GetOutputPort("mean_variance").Eval(other) == pytest.approx(0.2)
    assert bench.dut.GetOutputPort("confidence").Eval(other) == pytest.approx(0.5)
    assert bench.dut.GetOutputPort("intention").Eval(other.Clone()).mean[-1].tolist() == [5.0, 1.0]


def test_variance_of_nan_gives_confidence_of_nan(fake_learner):
    bench = Bench(fake_learner(WAY, variance=math.nan))
    assert math.isnan(bench.confidence)
    assert math.isnan(bench.mean_variance)


def test_entries_at_or_before_now_are_nan_and_the_later_ones_are_the_learners(fake_learner):
    intention = Bench(fake_learner(WAY, variance=0.1)).at(1.0, 0.0, time=2.0).intention
    assert intention.time == 2.0
    assert intention.first == 21
    assert intention.times.shape == GRID.shape
    assert intention.mean.shape == intention.variance.shape == WAY.shape
    assert np.isnan(intention.mean[:21]).all()
    assert np.isnan(intention.variance[:21]).all()
    np.testing.assert_array_equal(intention.mean[21:], WAY[21:])
    np.testing.assert_array_equal(intention.variance[21:], 0.1)


def test_rounding_of_times_does_not_make_a_query_later_than_now(fake_learner):
    bench = Bench(fake_learner(WAY))
    for step in range(201):
        intention = bench.at(0, 0, time=step * 0.05).intention
        assert intention.times[intention.first] > step * 0.05 + 1e-6 or intention.first == 100


def test_the_learner_gets_the_position_now_and_the_queries_to_come(fake_learner):
    learner = fake_learner(WAY)
    Bench(learner).at(1.2, 0.3, time=2.05).eval("intention")
    ((times, positions, queries),) = learner.calls
    np.testing.assert_array_equal(times, [2.05])
    np.testing.assert_array_equal(positions, [[1.2, 0.3]])
    np.testing.assert_array_equal(queries, GRID[21:])


def test_all_outputs_come_from_one_prediction(fake_learner):
    learner = fake_learner(WAY)
    bench = Bench(learner)
    for _ in range(3):
        for port in ("intention", "confidence", "mean_variance", "influence"):
            bench.eval(port)
    assert len(learner.calls) == 1
    bench.at(0.1, 0.0).eval("intention")
    assert len(learner.calls) == 2
    bench.at(0.1, 0.0, time=0.05).eval("confidence")
    assert len(learner.calls) == 3


@pytest.mark.parametrize("clock", ["time", "progress"])
def test_one_prediction_a_step_in_a_trial(open_floor, route_learner, clock):
    learner = route_learner(open_floor, clock=clock)
    simulation = Simulation(open_floor, learner=learner, config=config_for("test", end="duration"))
    learner.calls.clear()
    trial = simulation.run(TrialSettings())
    assert len(trial["t"]) == open_floor.steps + 1
    assert open_floor.steps <= len(learner.calls) <= open_floor.steps + 1


def test_an_output_does_not_change_after_it_was_read(fake_learner):
    bench = Bench(fake_learner(WAY)).at(0, 0, time=1.0)
    kept = bench.intention
    mean = kept.mean.copy()
    bench.step().at(3.0, 1.0, time=6.0).eval("intention")
    np.testing.assert_array_equal(kept.mean, mean)


def test_by_time_now_is_the_time(fake_learner):
    bench = Bench(fake_learner(WAY, clock="time")).at(4.0, 0.0)
    for time in (0.0, 1.05, 9.0):
        bench.context.SetTime(time)
        assert bench.intention.time == time


def test_by_progress_now_is_the_time_of_the_place_that_was_reached(fake_learner):
    bench = Bench(fake_learner(WAY, clock="progress"))
    assert bench.at(0.4, 0.0, time=7.0).intention.time == pytest.approx(0.8, abs=0.1)
    bench.step()
    assert bench.at(0.8, 0.0, time=7.05).intention.time == pytest.approx(1.6, abs=0.1)


def test_by_progress_a_late_starter_is_at_the_start(fake_learner):
    bench = Bench(fake_learner(WAY, clock="progress"))
    for count in range(60):
        assert bench.at(0.0, 0.0, time=0.05 * count).intention.time == pytest.approx(0.0, abs=0.11)
        bench.step()


def test_progress_does_not_run_back(fake_learner):
    bench = Bench(fake_learner(WAY, clock="progress")).at(0.5, 0.0).step()
    reached = bench.intention.time
    assert bench.at(0.1, 0.0).intention.time == reached


def test_progress_belongs_to_the_context(fake_learner):
    bench = Bench(fake_learner(WAY, clock="progress")).at(0.5, 0.0).step()
    fresh = bench.dut.CreateDefaultContext()
    bench.dut.GetInputPort("pose").FixValue(fresh, [0.0, 0.0, 0.0])
    assert bench.dut.GetOutputPort("intention").Eval(fresh).time < 0.2 < bench.intention.time


def test_alone_in_a_diagram_it_predicts_once_a_period(fake_learner):
    learner = fake_learner(WAY)
    builder = DiagramBuilder()
    dut = builder.AddSystem(IntentionEstimator(learner=learner, period=0.05))
    pose = builder.AddSystem(ConstantVectorSource([1.0, 0.0, 0.0]))
    builder.Connect(pose.get_output_port(), dut.GetInputPort("pose"))
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(1.0)
    context = dut.GetMyContextFromRoot(simulator.get_context())
    assert dut.GetOutputPort("intention").Eval(context).time == pytest.approx(1.0)
    assert len(learner.calls) <= 21


class Pointing:
    """Predicts a path straight ahead at the y of the last observation."""

    name, preset, confidence_gain, demonstrations = "pointing", "test", 10.0, None
    grid, duration = GRID, 10.0

    def __init__(self, evidence: str | None = "pose+command", variances: tuple[float, float] = (0.05, 0.05)):
        self.metadata = {"clock": "time", "evidence": evidence}
        self.variances = variances
        self.shown: list[np.ndarray] = []

    def predict(self, times, positions, query_times):
        self.shown.append(positions.copy())
        ahead = np.column_stack([query_times, np.full_like(query_times, positions[-1, 1])])
        return ahead, np.full_like(ahead, self.variances[min(len(times), 2) - 1])


def test_a_command_is_evidence_for_learners_that_use_it():
    plain, using = Bench(Pointing(None)).commanded(3.0, 5.0), Bench(Pointing()).commanded(3.0, 5.0)
    assert plain.intention.mean[-1, 1] == 0.0
    assert using.intention.mean[-1, 1] > 0.0


@pytest.mark.parametrize("use", [True, False])
def test_a_trial_may_leave_out_the_command_whichever_the_learner_is(use):
    learner = Pointing()
    bench = Bench(learner).commanded(3.0, 5.0)
    for other in (learner, Pointing()):
        bench.dut.SetLearner(bench.context, other, use_human_command=use)
        assert (bench.intention.mean[-1, 1] > 0.0) == use


def test_a_command_points_to_where_it_leads():
    learner = Pointing()
    robot = DiffDrive()
    wheels = robot.wheel_speeds(0.5, 1.0)
    Bench(learner, robot=robot, reach=0.8).at(1.0, 2.0, 0.3).commanded(*wheels).eval("intention")
    pointed = learner.shown[-1]
    np.testing.assert_array_equal(pointed[0], [1.0, 2.0])
    radius = 0.5
    np.testing.assert_allclose(
        pointed[1],
        [1.0 + radius * (math.sin(1.1) - math.sin(0.3)), 2.0 - radius * (math.cos(1.1) - math.cos(0.3))],
    )


class PointingAtOnce(Pointing):
    """Offers all predictions of a step at once, and no single one."""

    def predict_prefixes(self, times, positions, query_times):
        one_by_one = super().predict
        return [one_by_one(times[:n], positions[:n], query_times) for n in range(1, len(times) + 1)]

    def predict(self, times, positions, query_times):
        raise AssertionError("called for one prediction")


@pytest.mark.parametrize("command", [(3.0, 5.0), (0.0, 0.0)])
def test_predictions_of_several_prefixes_at_once_give_the_same_estimate(command):
    one_by_one, at_once = Bench(Pointing()).commanded(*command), Bench(PointingAtOnce()).commanded(*command)
    for port in ("confidence", "mean_variance", "influence"):
        np.testing.assert_array_equal(at_once.eval(port), one_by_one.eval(port))
    np.testing.assert_array_equal(at_once.intention.mean, one_by_one.intention.mean)


@pytest.mark.parametrize(
    ("alone", "pointed", "expected"),
    [
        pytest.param(0.05, 0.02, 0.05, id="without the command"),
        pytest.param(0.02, 0.05, 0.05, id="with the command"),
        pytest.param(1e-4, 1e-4, None, id="squared distance of both means"),
    ],
)
def test_variance_is_the_largest_of_without_and_with_the_command_and_the_squared_distance_of_both_means(
    alone, pointed, expected
):
    bench = Bench(Pointing(variances=(alone, pointed))).commanded(3.0, 5.0)
    shift = bench.intention.mean[-1, 1]
    assert 0.005 < shift**2 < 0.02
    np.testing.assert_allclose(bench.intention.variance[1:, 0], max(alone, pointed))
    np.testing.assert_allclose(bench.intention.variance[1:, 1], expected or shift**2)
    assert bench.influence[1] == pytest.approx(shift)


def test_control_returns_to_a_human_who_points_elsewhere_although_every_prediction_is_certain():
    """Both predictions have a negligible variance; only the distance between their means is large."""
    bench = Bench(Pointing(variances=(1e-6, 1e-6)), reach=1.6)
    assert bench.commanded(5.0, 5.0).confidence == 1.0
    for radius in (0.5, 1.0):
        # In 1.6 s an arc to the left at 1 rad/s leads radius (1 - cos 1.6) aside, in y alone.
        aside = radius * (1.0 - math.cos(1.6))
        confidence = bench.commanded(*DiffDrive().wheel_speeds(radius, 1.0)).confidence
        assert confidence == pytest.approx(1.0 / (10.0 * aside**2 / 2.0), rel=1e-4)
        assert confidence < 0.8


@pytest.mark.parametrize("command", [(0.0, 0.0), (-2.0, 2.0), (0.1, 0.1), (math.nan, 1.0), (math.inf, 1.0)])
def test_a_command_that_hardly_moves_the_robot_is_not_an_observation(command):
    learner = Pointing()
    bench = Bench(learner).commanded(*command)
    bench.eval("intention")
    assert len(learner.shown) == 1
    assert bench.influence[1] == 0.0


def test_without_a_command_the_pose_is_the_only_observation():
    learner = Pointing()
    assert Bench(learner).intention.mean[-1, 1] == 0.0
    assert len(learner.shown) == 1


def test_influence_of_the_pose_is_the_distance_by_which_it_moved_the_expected_path():
    bench = Bench(Pointing(None)).at(0.0, 0.0)
    assert bench.influence == [0.0, 0.0]
    bench.step().at(0.0, 0.3, time=0.05)
    assert bench.influence == pytest.approx([0.3, 0.0])
    bench.step()
    assert bench.influence == pytest.approx([0.0, 0.0])


def test_influence_is_finite_for_a_prediction_of_nan(fake_learner):
    bench = Bench(fake_learner(np.full_like(WAY, math.nan), variance=math.nan)).step()
    assert bench.influence == [0.0, 0.0]


class Forking(Pointing):
    """Predicts to the right and, more probable, to the left; the driver follows the left one."""

    def predict_modes(self, times, positions, query_times):
        mean, variance = self.predict(times, positions, query_times)
        means = mean + np.array([[[0.0, -1.0]], [[0.0, 1.0]]])
        variances = np.stack([variance, 2.0 * variance])
        modes = Modes(probability=np.array([0.3, 0.7]), mean=means, variance=variances, aim=1)
        return mean, variance, modes


class Sideways:
    """Moves the points of every path to the left, the later in the trial the further."""

    def __call__(self, poses, paths, times, now):
        self.poses, self.times, self.now = poses, times, now
        moved = 0.1 * times
        return paths + np.stack([np.zeros_like(moved), moved], axis=-1), moved


@pytest.mark.parametrize(("learner", "count"), [(Pointing, 1), (Forking, 2)])
def test_a_repaired_path_is_as_unsure_as_it_was_moved_far(learner, count):
    repair = Sideways()
    plain, repaired = (Bench(learner(), repair=item).at(1.0, 0.0, time=2.0) for item in (None, repair))
    before, after = plain.intention, repaired.intention
    to_come = GRID[GRID > 2.0 + 1e-9]
    first = len(GRID) - len(to_come)
    np.testing.assert_allclose(repair.poses, [[1.0, 0.0, 0.0]] * count)
    np.testing.assert_allclose(repair.times, [to_come] * count)
    np.testing.assert_allclose(repair.now, [2.0] * count)
    aside = np.stack([np.zeros_like(to_come), 0.1 * to_come], axis=-1)
    wider = np.square(0.1 * to_come)[:, None]
    np.testing.assert_allclose(after.mean[first:], before.mean[first:] + aside)
    np.testing.assert_allclose(after.variance[first:], before.variance[first:] + wider)
    assert repaired.mean_variance == pytest.approx(plain.mean_variance + wider.mean())
    if learner is Forking:
        # The agent helps along the mode that the driver follows.
        np.testing.assert_allclose(before.mean[first:], before.modes.mean[1])
        np.testing.assert_allclose(after.modes.mean, before.modes.mean + aside)
        np.testing.assert_allclose(after.modes.variance, before.modes.variance + wider)
        np.testing.assert_array_equal(repaired.eval("modes").mean, after.modes.mean)


class Broken(Pointing):
    """Predicts what ``spoil`` makes of mean and variance."""

    name = "broken"

    def __init__(self, spoil):
        super().__init__()
        self._spoil = spoil

    def predict(self, times, positions, query_times):
        return self._spoil(*super().predict(times, positions, query_times))


def _raise(mean, variance):
    raise ZeroDivisionError("inside the learner")


@pytest.mark.parametrize(
    "spoil",
    [
        _raise,
        lambda mean, variance: (mean, variance[:, 0]),
        lambda mean, variance: (mean[1:], variance),
        lambda mean, variance: (mean, -variance),
        lambda mean, variance: (mean, 0.0 * variance),
        lambda mean, variance: (mean.tolist(), variance),
    ],
)
def test_a_broken_prediction_names_the_learner_and_the_time(spoil):
    bench = Bench(Broken(spoil)).at(0.0, 0.0, time=1.25)
    with pytest.raises(RunError, match=r"'broken'.*1\.25"):
        bench.eval("confidence")


def test_a_learner_that_returns_views_of_one_buffer_is_refused():
    buffer = np.zeros((2, len(GRID), 2))

    def reuse(mean, variance):
        buffer[0, : len(mean)], buffer[1, : len(mean)] = mean, variance
        return buffer[0, : len(mean)], buffer[1, : len(mean)]

    with pytest.raises(RunError, match="broken"):
        Bench(Broken(reuse)).commanded(3.0, 5.0).eval("confidence")


def test_a_learner_of_another_size_of_positions_is_refused(fake_learner):
    learner = fake_learner(WAY)
    learner.demonstrations = np.zeros((1, len(GRID), 3))
    with pytest.raises(InputError, match="fake"):
        IntentionEstimator(learner=learner)


@pytest.mark.parametrize("pose", [(math.nan, 0.0, 0.0), (0.0, 0.0, math.inf)])
def test_an_unknown_pose_gives_no_confidence(fake_learner, pose):
    bench = Bench(fake_learner(WAY, clock="progress")).at(*pose)
    assert bench.confidence == 0.0
    assert bench.mean_variance == math.inf
    assert np.isnan(bench.intention.mean).all()
    assert bench.influence == [0.0, 0.0]

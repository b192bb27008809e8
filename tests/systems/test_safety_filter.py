"""SafetyFilter: no contact where braking avoids it, minimal changes, and no robot that is stuck."""

import dataclasses
import math

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.geometry import QueryObject, SceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_shared.analysis.metrics import metrics
from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import motion, speeds_after
from drake_shared.scenario.obstacles import Box, Circle, ObstacleDistance, register_obstacles
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.systems.diff_drive_plant import DiffDrivePlant
from drake_shared.systems.moving_obstacles import AddMovingObstacles
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.safety_filter import SafetyFilter

ROBOT = DiffDrive()
FOOTPRINT = ROBOT.footprint_radius
FASTEST = ROBOT.max_wheel_speed
CLEARANCE = 0.05
PERIOD = 0.05
WALL = Box(name="wall", x=1.0, y=0.0, length=0.2, width=4.0)


class Bench:
    """A plant among obstacles behind a filter, stepped by hand; the filter knows the paths if ``known``."""

    def __init__(self, obstacles, *, known: bool = True, **options):
        builder = DiagramBuilder()
        scene_graph = builder.AddSystem(SceneGraph())
        register_obstacles(scene_graph, [item for item in obstacles if not item.path])
        moving = AddMovingObstacles(builder, scene_graph, obstacles)
        plant = DiffDrivePlant(robot=ROBOT, period=PERIOD, obstacles_move=moving is not None)
        self.plant = builder.AddSystem(plant)
        options["obstacles"] = obstacles if known else ()
        self.dut = builder.AddSystem(SafetyFilter(robot=ROBOT, period=PERIOD, **options))
        query = scene_graph.get_query_output_port()
        builder.Connect(query, self.plant.GetInputPort("geometry_query"))
        builder.Connect(query, self.dut.GetInputPort("geometry_query"))
        for name in ("pose", "wheel_speed"):
            builder.Connect(self.plant.GetOutputPort(name), self.dut.GetInputPort(name))
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.dut.GetMyMutableContextFromRoot(self.root)
        self._plant_context = self.plant.GetMyMutableContextFromRoot(self.root)
        self._steps = 0

    def reset(self, x, y, yaw, wheels=(0.0, 0.0), steps=0) -> "Bench":
        self._steps = steps
        self.root.SetTime(steps * PERIOD)
        self.plant.SetPose(self._plant_context, [x, y, yaw])
        self._plant_context.SetDiscreteState(1, np.array(wheels, dtype=float))
        return self

    def filtered(self, command) -> np.ndarray:
        self.dut.GetInputPort("wheel_command").FixValue(self.context, command)
        return self.dut.GetOutputPort("safe_command").Eval(self.context).copy()

    def step(self, command, *, filtered: bool = True) -> "Bench":
        applied = self.filtered(command) if filtered else command
        self.plant.GetInputPort("wheel_command").FixValue(self._plant_context, applied)
        update = self.plant.EvalUniquePeriodicDiscreteUpdate(self._plant_context)
        self._plant_context.get_mutable_discrete_state().SetFrom(update)
        self._steps += 1
        self.root.SetTime(self._steps * PERIOD)
        return self

    @property
    def pose(self) -> np.ndarray:
        return self.plant.GetOutputPort("pose").Eval(self._plant_context).copy()

    @property
    def wheels(self) -> np.ndarray:
        return self.plant.GetOutputPort("wheel_speed").Eval(self._plant_context).copy()

    @property
    def clearance(self) -> float:
        return self.plant.GetOutputPort("clearance").Eval(self._plant_context).item()

    @property
    def contact(self) -> bool:
        return bool(self.plant.GetOutputPort("contact").Eval(self._plant_context)[0])

    @property
    def state(self) -> tuple:
        """Arguments of :meth:`reset` that restore this state."""
        return *self.pose, self.wheels, self._steps

    def away_from_nearest(self) -> np.ndarray:
        """The direction away from the nearest obstacle."""
        query = self.plant.GetInputPort("geometry_query").Eval(self._plant_context)
        found = query.ComputeSignedDistanceToPoint(np.array([*self.pose[:2], 0.0]))
        return min(found, key=lambda item: item.distance).grad_W[:2]

    def drive(self, commands, *, filtered: bool = True) -> bool:
        """Whether the robot touches an obstacle under ``commands``."""
        return any(self.step(command, filtered=filtered).contact for command in commands)


def some_obstacles(rng, count: int) -> list:
    x, y = rng.uniform(-2.0, 2.0, (2, count))
    radius, length, width = rng.uniform([[0.05], [0.1], [0.1]], [[0.4], [1.2], [0.5]], (3, count))
    yaw = rng.uniform(-math.pi, math.pi, count)
    return [
        Circle(name=f"{k}", x=x[k], y=y[k], radius=radius[k])
        if k % 2
        else Box(name=f"{k}", x=x[k], y=y[k], length=length[k], width=width[k], yaw=yaw[k])
        for k in range(count)
    ]


@dataclasses.dataclass
class StaticOutcomes:
    """Outcomes of random cases, filtered and unfiltered."""

    cases: int = 0
    excluded: int = 0
    collided_unfiltered: int = 0
    collided: int = 0
    came_too_near: int = 0


def run_among_static(count: int, *, seed: int, per_world: int = 50, steps: int = 60) -> StaticOutcomes:
    """Drives ``count`` random starts among random obstacles for 3 s each, half of them at full speed.

    Cases in which even full braking collides are excluded. A count of 10,000 gives the documented figures.
    """
    rng = np.random.default_rng(seed)
    done = StaticOutcomes()
    while done.cases < count:
        bench = Bench(some_obstacles(rng, rng.integers(6, 13)), clearance=CLEARANCE)
        for _ in range(min(per_world, count - done.cases)):
            while bench.reset(*rng.uniform(-1.5, 1.5, 2), rng.uniform(-math.pi, math.pi)).clearance < 1e-3:
                pass
            pose = bench.pose
            wheels = rng.uniform(-FASTEST, FASTEST, 2) if rng.random() < 0.5 else np.repeat(FASTEST, 2)
            commands = np.repeat(rng.uniform(-FASTEST, FASTEST, (steps // 20, 2)), 20, axis=0)
            if rng.random() < 0.5:
                commands[:] = FASTEST
            done.cases += 1
            least = bench.reset(*pose, wheels).clearance
            for _ in range(18):
                least = min(least, bench.step((0.0, 0.0), filtered=False).clearance)
            if least < 1e-5:
                done.excluded += 1
                continue
            done.collided_unfiltered += bench.reset(*pose, wheels).drive(commands, filtered=False)
            bench.reset(*pose, wheels)
            for command in commands:
                if bench.step(command).contact:
                    done.collided += 1
                    break
                # From a bad start the robot may come as near as full braking does.
                done.came_too_near += bench.clearance < CLEARANCE - 2e-6 and least > CLEARANCE
    return done


def random_states(count: int, *, seed: int):
    """Benches in states, with commands, where braking barely keeps the clearance."""
    rng = np.random.default_rng(seed)
    for _ in range(count // 25):
        obstacles = some_obstacles(rng, 12)
        bench, distance = Bench(obstacles, clearance=CLEARANCE), ObstacleDistance(obstacles)
        found = 0
        while found < 25:
            bench.reset(
                *rng.uniform(-2.5, 2.5, 2), rng.uniform(-math.pi, math.pi), rng.uniform(4, FASTEST, 2)
            )
            if not CLEARANCE < bench.clearance < CLEARANCE + 0.5:
                continue
            if not CLEARANCE < least_gap(bench, (0.0, 0.0), distance, steps=2) < CLEARANCE + 0.1:
                continue
            if CLEARANCE < least_gap(bench, (0.0, 0.0), distance) < CLEARANCE + 0.05:
                found += 1
                yield bench, distance, rng.uniform(0.0, FASTEST, 2)


def least_gap(bench: Bench, command, distance: ObstacleDistance, *, steps: int = 60) -> float:
    """The least gap in one step of ``command`` and full braking after it, by the plant's exact motion."""
    pose, wheels = tuple(bench.pose.tolist()), tuple(bench.wheels.tolist())
    change = ROBOT.max_wheel_acceleration * PERIOD
    reached = tuple(np.clip(command, np.subtract(wheels, change), np.add(wheels, change)).tolist())
    path = [pose]
    for target, duration, count in ((reached, PERIOD / 5, 5), ((0.0, 0.0), 0.9 / steps, steps)):
        for _ in range(count):
            path += motion(ROBOT, path[-1], wheels, target, duration)
            wheels = speeds_after(ROBOT, wheels, target, duration)
    return float(distance(np.array(path)[:, :2]).min()) - FOOTPRINT


def test_no_contact_if_braking_avoids_it_where_a_third_would_collide():
    done = run_among_static(60, seed=1, per_world=20)
    assert done.collided == 0
    assert done.came_too_near == 0
    assert done.excluded < 0.3 * done.cases
    assert done.collided_unfiltered >= 0.3 * (done.cases - done.excluded)


def test_changes_a_command_only_if_braking_after_it_would_come_too_near():
    changed = 0
    for bench, distance, command in random_states(150, seed=2):
        gap = least_gap(bench, command, distance)
        if np.array_equal(bench.filtered(command), command):
            assert gap > CLEARANCE - 2e-6
        else:
            changed += 1
            # Between the points of a path the gap is only bounded from below.
            assert gap < CLEARANCE + 2e-3
    assert changed > 7


def some_moving_obstacles(rng) -> list:
    """Six obstacles, every second one on a piecewise straight path, at 0.2 to 1 m/s."""
    obstacles = some_obstacles(rng, 6)
    for item in obstacles[::2]:
        heading = rng.uniform(-math.pi, math.pi) + np.cumsum(rng.uniform(-2.0, 2.0, 4))
        durations = rng.uniform(0.5, 1.5, 4)
        legs = rng.uniform(0.2, 1.0) * durations * np.array([np.cos(heading), np.sin(heading)])
        x, y = np.cumsum(legs, axis=1)
        turns = np.transpose([np.cumsum(durations), item.x + x, item.y + y])
        item.path = [[0.0, item.x, item.y], *turns.tolist()]
    return obstacles


@dataclasses.dataclass
class MovingOutcomes:
    """Outcomes of random cases among moving obstacles, filtered and unfiltered."""

    cases: int = 0
    excluded: int = 0
    collided_unfiltered: int = 0
    hit: int = 0
    drove_into: int = 0
    avoidable: int = 0
    came_too_near: int = 0
    needlessly: int = 0


def run_among_moving(count: int, *, seed: int, known: bool = True, per_world: int = 20) -> MovingOutcomes:
    """Drives ``count`` random starts among moving obstacles for 2 s each, half of them at full speed.

    Cases in which a braking robot is hit before it is at rest are excluded. A robot that is hit drove into
    the obstacle if its own motion, in the step of the contact, led towards it at over 5 cm/s. A contact is
    avoidable if braking in that step avoids it, and coming too near is needless if braking does not. A count
    of 1,000 gives the documented figures.
    """
    rng = np.random.default_rng(seed)
    done = MovingOutcomes()
    while done.cases < count:
        obstacles = some_moving_obstacles(rng)
        bench = Bench(obstacles, known=known, clearance=CLEARANCE)
        for _ in range(per_world):
            while bench.reset(*rng.uniform(-1.5, 1.5, 2), rng.uniform(-math.pi, math.pi)).clearance < 1e-3:
                pass
            pose = bench.pose
            wheels = rng.uniform(-FASTEST, FASTEST, 2) if rng.random() < 0.5 else np.repeat(FASTEST, 2)
            commands = np.repeat(rng.uniform(-FASTEST, FASTEST, (2, 2)), 20, axis=0)
            if rng.random() < 0.5:
                commands[:] = FASTEST
            done.cases += 1
            bench.reset(*pose, wheels)
            while bench.wheels.any() and not bench.step((0.0, 0.0), filtered=False).contact:
                pass
            if bench.contact:
                done.excluded += 1
                continue
            done.collided_unfiltered += bench.reset(*pose, wheels).drive(commands, filtered=False)
            bench.reset(*pose, wheels)
            for command in commands:
                before = bench.state
                if bench.step(command).contact:
                    moved = bench.pose[:2] - before[:2]
                    done.hit += 1
                    done.drove_into += bool(bench.away_from_nearest() @ moved < -0.05 * PERIOD)
                    done.avoidable += not bench.reset(*before).step((0.0, 0.0), filtered=False).contact
                    break
                if bench.clearance < CLEARANCE - 2e-6:
                    after = bench.state
                    done.came_too_near += 1
                    bench.reset(*before)
                    gaps = [bench.step((0.0, 0.0), filtered=False).clearance for _ in range(20)]
                    # Between the steps a gap is less by some millimetres.
                    done.needlessly += min(gaps) >= CLEARANCE + 5e-3
                    bench.reset(*after)
    return done


def test_among_moving_obstacles_the_robot_may_be_hit_but_drives_into_none():
    done = run_among_moving(40, seed=7)
    assert done.drove_into == done.avoidable == done.needlessly == 0
    assert done.excluded < 0.3 * done.cases
    assert done.collided_unfiltered > 0.2 * (done.cases - done.excluded)
    assert done.hit < 0.5 * done.collided_unfiltered


def test_without_the_paths_the_robot_drives_into_moving_obstacles():
    done = run_among_moving(40, seed=7, known=False)
    assert done.drove_into > 0.2 * done.hit > 0


def cart(*path) -> Circle:
    """A round obstacle on a path of waypoints [t, x, y]."""
    return Circle(name="cart", x=path[0][1], y=path[0][2], radius=0.2, path=[list(point) for point in path])


@pytest.mark.parametrize("gap", [1e-4, 0.02, CLEARANCE, 0.06, 0.3])
@pytest.mark.parametrize("speed", [0.1, 0.3, 1.0, 2.0])
def test_backing_away_from_an_approaching_obstacle_is_unchanged(gap, speed):
    x = 0.2 + FOOTPRINT + gap
    bench = Bench([cart((0.0, x, 0.0), (2.0, x - 2.0 * speed, 0.0))], clearance=CLEARANCE).reset(
        0.0, 0.0, 0.0
    )
    for _ in range(20):
        np.testing.assert_array_equal(bench.filtered((-FASTEST, -FASTEST)), (-FASTEST, -FASTEST))
        if bench.step((-FASTEST, -FASTEST)).contact:
            break
    assert bench.pose[0] < 0.0


def test_a_robot_ahead_of_a_faster_obstacle_is_not_slowed():
    bench = Bench([cart((0.0, -1.0, 0.0), (4.0, 5.0, 0.0))], clearance=CLEARANCE)
    bench.reset(0.0, 0.0, 0.0, (FASTEST, FASTEST))
    for _ in range(60):
        np.testing.assert_array_equal(bench.filtered((FASTEST, FASTEST)), (FASTEST, FASTEST))
        if bench.step((FASTEST, FASTEST)).contact:
            break
    assert 1.5 < bench.pose[0] < 3.0


def test_stands_still_when_an_oncoming_obstacle_arrives():
    bench = Bench([cart((0.0, 3.0, 0.0), (6.0, -3.0, 0.0))], clearance=CLEARANCE).reset(0.0, 0.0, 0.0)
    xs = [0.0]
    while len(xs) < 60 and not bench.contact:
        xs.append(bench.step((FASTEST, FASTEST)).pose[0])
    assert bench.contact
    assert xs[-1] > 0.5
    assert xs[-1] == pytest.approx(xs[-3], abs=1e-3)


def test_follows_a_moving_obstacle_at_a_distance_that_is_too_short_for_a_static_one():
    """At 0.9 m/s the robot needs 0.3 m to stop, more than the gap to a cart ahead at the same speed."""
    ahead = cart((0.0, 0.65, 0.0), (5.0, 5.15, 0.0))
    speed = 0.9 / ROBOT.wheel_radius
    for known in (True, False):
        bench = Bench([ahead], known=known, clearance=CLEARANCE).reset(0.0, 0.0, 0.0, (speed, speed))
        kept = [np.array_equal(bench.step((speed, speed)).wheels, (speed, speed)) for _ in range(40)]
        assert all(kept) == known


def test_an_obstacle_at_the_end_of_its_path_is_equivalent_to_a_static_one():
    rng = np.random.default_rng(9)
    for _ in range(10):
        standing = some_obstacles(rng, 6)
        arrived = [
            dataclasses.replace(item, path=[[0.0, item.x + 1.0, item.y], [1.0, item.x, item.y]])
            for item in standing
        ]
        benches = Bench(standing, clearance=CLEARANCE), Bench(arrived, clearance=CLEARANCE)
        for _ in range(20):
            pose = *rng.uniform(-1.5, 1.5, 2), rng.uniform(-math.pi, math.pi)
            wheels, command = rng.uniform(-FASTEST, FASTEST, (2, 2))
            if benches[0].reset(*pose, wheels).clearance > CLEARANCE:
                safe = [bench.reset(*pose, wheels, steps=20).filtered(command) for bench in benches]
                np.testing.assert_allclose(safe[1], safe[0], rtol=0, atol=1e-9)


def test_stops_in_front_of_a_wall_at_the_clearance():
    bench = Bench([WALL], clearance=0.08).reset(-2.0, 0.0, 0.0)
    assert not bench.drive(np.full((120, 2), FASTEST))
    assert bench.clearance == pytest.approx(0.08, abs=1e-3)
    assert bench.clearance >= 0.08 - 2e-6
    assert np.abs(bench.wheels).max() < 1e-2
    assert bench.pose[2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("gap", [1e-4, 0.02, CLEARANCE])
@pytest.mark.parametrize("back", [(-FASTEST, -FASTEST), (-6.0, -3.0), (-1.0, -2.0)])
def test_backing_away_from_a_wall_is_unchanged(gap, back):
    bench = Bench([WALL], clearance=CLEARANCE).reset(0.9 - FOOTPRINT - gap, 0.0, 0.0)
    for _ in range(10):
        np.testing.assert_array_equal(bench.filtered(back), back)
        bench.step(back)
    assert bench.clearance > gap + 0.02


@pytest.mark.parametrize("gap", [1e-4, 0.02, CLEARANCE])
def test_turning_on_the_spot_near_a_wall_is_unchanged(gap):
    bench = Bench([WALL], clearance=CLEARANCE).reset(0.9 - FOOTPRINT - gap, 0.0, 0.0)
    for _ in range(20):
        np.testing.assert_array_equal(bench.filtered((-4.0, 4.0)), (-4.0, 4.0))
        bench.step((-4.0, 4.0))
    assert bench.pose[2] > 1.0


def test_a_robot_inside_the_clearance_is_not_pushed_further_in():
    bench = Bench([WALL], clearance=CLEARANCE).reset(0.9 - FOOTPRINT - 0.02, 0.0, 0.0)
    gap = bench.clearance
    for _ in range(40):
        assert bench.step((FASTEST, 0.8 * FASTEST)).clearance >= gap - 1e-5


def test_in_front_of_a_wall_the_turn_remains():
    bench = Bench([WALL], clearance=CLEARANCE).reset(0.9 - FOOTPRINT - CLEARANCE, 0.0, 0.0)
    assert not bench.drive(np.tile([4.0, 8.0], (10, 1)))
    assert bench.pose[2] > 0.2


def test_passing_an_obstacle_at_the_clearance_is_unchanged():
    pillar = Circle(name="pillar", x=1.0, y=0.25 + FOOTPRINT + CLEARANCE + 0.01, radius=0.25)
    bench = Bench([pillar], clearance=CLEARANCE).reset(-0.5, 0.0, 0.0)
    for _ in range(50):
        np.testing.assert_array_equal(bench.filtered((FASTEST, FASTEST)), (FASTEST, FASTEST))
        bench.step((FASTEST, FASTEST))
    assert bench.pose[0] > 1.5


def test_without_obstacles_the_command_is_unchanged_bit_for_bit():
    bench = Bench([], clearance=CLEARANCE)
    np.testing.assert_array_equal(bench.filtered((100.0, -3.3)), (100.0, -3.3))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_not_finite_counts_as_zero(value):
    for obstacles in ([], [WALL]):
        np.testing.assert_array_equal(Bench(obstacles).reset(0.5, 0, 0).filtered((value, 0.5)), (0.0, 0.5))


def test_intervention_is_the_change_of_the_command():
    bench = Bench([WALL], clearance=CLEARANCE).reset(0.9 - FOOTPRINT - CLEARANCE, 0.0, 0.0)
    safe = bench.filtered((5.0, 5.0))
    np.testing.assert_allclose(safe, [0.0, 0.0], atol=1e-2)
    intervention = bench.dut.GetOutputPort("intervention")
    np.testing.assert_array_equal(intervention.Eval(bench.context), safe - (5.0, 5.0))
    bench.filtered((-5.0, -5.0))
    np.testing.assert_array_equal(intervention.Eval(bench.context), [0.0, 0.0])


def test_clearance_is_a_parameter_of_the_context_and_none_disables_the_filter():
    bench = Bench([WALL]).reset(0.9 - FOOTPRINT - CLEARANCE, 0.0, 0.0)
    assert bench.filtered((5.0, 5.0))[0] < 0.1
    bench.dut.set_clearance(bench.context, None)
    np.testing.assert_array_equal(bench.filtered((5.0, 5.0)), (5.0, 5.0))
    bench.dut.set_clearance(bench.context, 0.01)
    assert bench.filtered((5.0, 5.0))[0] > 0.1
    assert bench.diagram.CreateDefaultContext() is not bench.root


@pytest.mark.parametrize("clearance", [0.0, -0.1, 1.5, math.nan, math.inf])
def test_refuses_a_clearance_out_of_range(clearance):
    with pytest.raises(InputError, match="clearance"):
        SafetyFilter(robot=ROBOT, clearance=clearance)
    dut = SafetyFilter(robot=ROBOT)
    with pytest.raises(InputError, match="clearance"):
        dut.set_clearance(dut.CreateDefaultContext(), clearance)


@pytest.mark.parametrize("period", [0.0, -1.0, math.nan])
def test_refuses_a_period_that_is_not_positive_and_finite(period):
    with pytest.raises(ValueError, match="period"):
        SafetyFilter(robot=ROBOT, period=period)


def test_has_no_state():
    dut = SafetyFilter(robot=ROBOT)
    assert dut.CreateDefaultContext().num_total_states() == 0
    dut.GetInputPort("geometry_query").FixValue(dut.CreateDefaultContext(), Value(QueryObject()))


def straight_on(scenario, **options):
    operator = RecordedInput(commands=np.full((300, 2), FASTEST))
    config = SharedControlConfig(driver="human", end="duration", **options)
    return Simulation(scenario, operator=operator, config=config).run(TrialSettings())


def test_a_trial_logs_the_safe_command_beside_the_shared_one(scenario):
    trial = straight_on(scenario, safety_clearance=0.1)
    assert list(trial.columns)[-2:] == ["safe_left", "safe_right"]
    assert trial.metadata["safety_clearance"] == 0.1
    np.testing.assert_array_equal(trial.commands("shared"), trial.commands("human"))
    measured = metrics(trial)
    assert not measured["collision"]
    assert measured["clearance"] >= 0.1 - 2e-6
    assert measured["dissimilarity"] == 0.0
    changed = np.linalg.norm(trial.commands("safe") - trial.commands("shared"), axis=1)[:-1]
    assert measured["safety_change"] == pytest.approx(changed.mean())
    assert measured["safety_share"] == pytest.approx(np.mean(changed > 0))
    assert 0.1 < measured["safety_share"] < 1.0


def test_a_trial_without_the_filter_collides_and_logs_no_safe_command(scenario):
    trial = straight_on(scenario)
    assert trial["contact"].any()
    assert "safe_left" not in trial.columns
    assert "safety_clearance" not in trial.metadata
    assert "safety_change" not in metrics(trial)


@pytest.mark.parametrize(("safety", "touched"), [(None, True), (0.1, False)])
def test_in_a_trial_the_robot_yields_to_a_crossing_cart(open_floor, safety, touched):
    open_floor.obstacles = [cart((0.0, 1.5, -2.0), (6.0, 1.5, 4.0))]
    trial = straight_on(open_floor, safety_clearance=safety)
    assert trial["contact"].any() == touched
    assert trial["x"][-1] > 3.0


def test_a_safe_trial_keeps_every_bit(scenario):
    settings = TrialSettings(driver="human", route="left_right", seed=5)
    free = Simulation(scenario).run(settings)
    kept = Simulation(scenario, config=SharedControlConfig(safety_clearance=0.01)).run(settings)
    for name, values in free.columns.items():
        np.testing.assert_array_equal(kept[name], values, err_msg=name)

"""Mispredictions on purpose: what was never taught, a change of mind, and an obstacle nobody knew of."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.arbitration import DEFAULT
from drake_shared.engine import Task
from drake_shared.errors import InputError
from drake_shared.experiments.drawing import BLACK, COLOURS, draw_scene, new_figure
from drake_shared.experiments.matched import by_learner, groups, settings, taught
from drake_shared.experiments.report import number, with_interval
from drake_shared.experiments.section import Experiment, Picture, Section, Size, Table
from drake_shared.experiments.setting import (
    as_demonstrations,
    measured,
    scenario_of,
    simulation_of,
    train_all,
    training_cost,
)
from drake_shared.experiments.statistics import Claim, at_least, interval
from drake_shared.obstacles import Circle
from drake_shared.operators import changes_of_route, named_operator
from drake_shared.paths import Path
from drake_shared.scenario import Route, Scenario, check_scenario, clearance_scorer
from drake_shared.trial import Simulation, Trial, TrialSettings

PRESETS = ("paper", "default")
OPERATORS = ("primary", "stubborn")
CASES = {
    "unseen": "a route never taught",
    "changed": "a change of route",
    "obstacle": "a new obstacle",
    "narrow": "less room round it",
}
ARMS = {"on": "with authority", "off": "without"}
# Of preset and arm, in the order of reading, with the label of each.
_COMPARED = {
    ("none", "human"): "human alone",
    **{(preset, arm): f"{preset}, {words}" for preset in PRESETS for arm, words in ARMS.items()},
}
LEAST = 95.0
"""Intent success that is asked for, in %."""
_HALF = 0.5
_PARTED, _NEAR, _WATCHED = 0.15, 1.0, 2.0
_RADIUS, _LEAST_CLEARANCE = 0.15, 0.08
# Beside the pillar, for the robot on its way round, in [m].
_ROOMS = {"obstacle": 0.3, "narrow": 0.15}
_PLACES = np.linspace(0.2, 0.8, 25)
_SPACING = 0.02
# Three trials take each route of the shipped scenarios once.
_GROUP, _TRIALS = 5, 3
_TRIAL_SECONDS, _ALONE_SECONDS = 0.08, 0.045


@dataclasses.dataclass(frozen=True, kw_only=True)
class Drive:
    """What is driven in a trial of a case.

    Attributes:
        world: The scenario as it is; with a new obstacle, that is its last.
        route, then: What the operator means, and what after a change of mind.
        variant: Case and index among its `variants`; None in the scenario as it was taught.
    """

    world: Scenario
    route: str
    then: str | None = None
    variant: tuple[str, int] | None = None

    def path(self, name: str) -> Path:
        """The curve of a route."""
        return self.world.route(name).path(self.world.start)


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """One for the human alone, and one for each preset and five learners of each kind."""
    told = {"scenario": scenario, "trials": min(size.trials, _TRIALS)}
    whom = [("none", list(range(size.learners)))]
    whom += [(preset, learners) for preset in PRESETS for learners in groups(size.learners, _GROUP)]
    return [
        Task(
            "drake_shared.experiments.mispredictions:run_cases",
            {**told, "preset": preset, "learners": learners},
        )
        for preset, learners in whom
    ]


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    preset, count = task.arguments["preset"], len(task.arguments["learners"])
    trials = count * task.arguments["trials"] * len(CASES) * len(OPERATORS)
    if preset == "none":
        return _ALONE_SECONDS * trials
    # Taught all routes, and all but one.
    return training_cost(preset, 2 * count) + 0.2 * count + len(ARMS) * _TRIAL_SECONDS * trials


def run_cases(scenario: str | None, preset: str, learners: list[int], trials: int) -> dict[str, Any]:
    """Trials of each case and operator, with and without authority; the same for all presets.

    Args:
        scenario: File or name.
        preset: Of the learners; "none": the human is alone.
        learners: Their indices; they fix demonstrations, trainings and trials.
        trials: Of each case, operator and arm.

    Returns:
        The rows, and of the first trial of learner 0 in each case, by the primary operator, the paths.
    """
    arms = ("human",) if preset == "none" else tuple(ARMS)
    rows, drawn = [], {}
    for index, (whole, partial) in zip(learners, _trained(scenario, preset, learners), strict=True):
        for case in CASES:
            learner = partial if case == "unseen" else whole
            for operator in OPERATORS:
                for number_of_trial in range(trials):
                    drive = drive_of(scenario, case, index, number_of_trial)
                    told = settings(scenario, operator, index, number_of_trial)
                    for arm in arms:
                        trial = _run(scenario, drive, arm, learner, told)
                        rows.append(
                            measured(
                                trial,
                                case=case,
                                preset=preset,
                                arm=arm,
                                operator=operator,
                                learner=index,
                                strayed=strayed(drive, trial),
                                **recovery(trial, moment(scenario, drive, case, trial)),
                            )
                        )
                        if (index, operator, number_of_trial) == (0, OPERATORS[0], 0):
                            drawn[f"{case} {arm}"] = np.round(trial.positions, 3)
    return {"rows": rows, "drawn": drawn}


def drive_of(scenario: str | None, case: str, learner: int, trial: int) -> Drive:
    """What is driven: the route this learner was not taught, a change, or round a new obstacle, in turn."""
    world = scenario_of(scenario)
    if case == "unseen":
        return Drive(world=world, route=_untaught(world, learner).name)
    if case == "changed":
        changes = changes_of_route(world)
        route, then = changes[trial % len(changes)]
        return Drive(world=world, route=route.name, then=then.name)
    changed = variants(scenario, case)
    variant = trial % len(changed)
    return Drive(world=changed[variant], route=changed[variant].routes[0].name, variant=(case, variant))


@functools.cache
def variants(scenario: str | None, case: str = "obstacle") -> tuple[Scenario, ...]:
    """The scenario with a pillar in the way of a route that now goes round it, one for each possible route.

    The pillar stands where most room is left to go round it; routes with no such place are left out.

    Raises:
        InputError: There is no place on any route.
    """
    world = scenario_of(scenario)
    found = []
    for route in world.routes:
        possible = [
            _with_obstacle(world, route, share, side * _ROOMS[case])
            for share in _PLACES
            for side in (1.0, -1.0)
        ]
        clearance, best = max(possible, key=lambda one: one[0])
        if best is not None and clearance >= _LEAST_CLEARANCE:
            found.append(best)
    if not found:
        raise InputError(f"scenario {world.name}", "routes", "must hold one with room round a new obstacle")
    return tuple(found)


def moment(scenario: str | None, drive: Drive, case: str, trial: Trial) -> float | None:
    """When the misprediction begins to matter, in [s]; None if it never did.

    unseen: the robot comes, by its nearest point on the operator's route, to where that is first farther
    than 0.15 m from every other route. changed: the operator changes. obstacle, narrow: the robot's
    centre is first within 1 m of the new obstacle's edge.
    """
    if case == "changed":
        return trial.metadata["behaviour"]["switch_time"]
    if case in _ROOMS:
        new = drive.world.obstacles[-1]
        apart = np.hypot(*(trial.positions - (new.x, new.y)).T) - new.bounding_radius()
        there = apart <= _NEAR
    else:
        own, parting = _points(drive.path(drive.route)), _parting(scenario, drive.route)
        if parting is None:
            return None
        there = _distances(trial.positions, own).argmin(axis=1) >= parting
    return float(trial["t"][there.argmax()]) if there.any() else None


def recovery(trial: Trial, begun: float | None) -> dict[str, Any]:
    """What became of the human's weight w after the moment ``begun``, in [s].

    Returns:
        weight: "above" if w was above 0.5 throughout the 2 s from that moment (or what was left), "never" if
            it fell and did not come back before the end, "back" if it did, "unmet" if there was no such
            moment. recovery: where it came back, the time from the moment to that, in [s], else NaN.
    """
    if begun is None or begun > trial["t"][-1]:
        return {"weight": "unmet", "recovery": math.nan}
    since = trial["t"] >= begun - 1e-9
    times, human = trial["t"][since], trial["human_weight"][since] > _HALF
    if human[times <= begun + _WATCHED].all():
        return {"weight": "above", "recovery": math.nan}
    fell = int(np.argmin(human))
    if not human[fell:].any():
        return {"weight": "never", "recovery": math.nan}
    return {"weight": "back", "recovery": float(times[fell + int(np.argmax(human[fell:]))] - begun)}


def strayed(drive: Drive, trial: Trial) -> float:
    """Largest distance of the robot from the route meant at the time, in [m]."""
    distance = _distances(trial.positions, _points(drive.path(drive.route))).min(axis=1)
    if drive.then is not None:
        after = trial["t"] >= trial.metadata["behaviour"]["switch_time"]
        distance[after] = _distances(trial.positions[after], _points(drive.path(drive.then))).min(axis=1)
    return float(distance.max())


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Figures, a table for each operator, and the claims."""
    rows = [row for result in results for row in result["rows"]]
    trials = min(size.trials, _TRIALS)
    unmet = sum(row["weight"] == "unmet" for row in rows if row["arm"] != "human")
    shared = sum(row["arm"] != "human" for row in rows)
    return Section(
        title="Mispredictions on purpose",
        text=[
            "Ways to make the agent wrong. A route never taught: the learner has demonstrations of all "
            "routes but one, and the operator takes that one, each route in turn over learners. A change "
            f"of route: the operator leaves one for another after {number(_switch_time(scenario))} s. A new "
            f"obstacle: a pillar of {number(_RADIUS)} m radius stands on the route as it was taught, and the "
            "operator, who knows of it, goes round; the learner knows the old way only and no obstacles. "
            "The way round is laid once with more room and once with less, since what assistance may cost "
            f"hangs on it: {_rooms(scenario)}.",
            f"{size.learners} learners of each preset, as many again for the route never taught, and "
            f"{trials} trials with each of the simulated operators {' and '.join(OPERATORS)} in each case. "
            "In every arm the routes and seeds are the same: the human alone, shared control in which the "
            "human is kept in charge (with authority: usual with preset default), and the blend of eq. (2) "
            "by itself (without: usual with preset paper). Intervals are 95% bootstrap over learners; those "
            "of claims are adjusted for the number of cases, and take both operators' trials together.",
            "Time until w, the human's weight, is back above 0.5 counts from the moment at which the "
            "misprediction begins to matter: the robot comes to where the operator's route is more than "
            f"{number(_PARTED)} m from every route taught; the operator changes; the robot is within "
            f"{number(_NEAR)} m of the new obstacle's edge. It ends where w is first above 0.5 after it was "
            f"not; where w was above throughout the first {number(_WATCHED)} s the trial counts as above all "
            "along, and where it did not come back before the trial ended, as never. "
            f"In {unmet} of {shared} shared trials that moment never came. A small w "
            "is no harm by itself: an agent that goes by the command may be confident and right. How "
            "far the robot strayed is its largest distance from the route meant at the time, "
            "after a change from the new one, which "
            "begins with the distance between the two.",
        ],
        pictures=[
            Picture.of(
                _successes(rows),
                "Intent success by case, arm and operator: means with 95% bootstrap intervals over learners.",
            ),
            Picture.of(
                _recoveries(rows),
                "Share of trials in which w is above 0.5, by the time since the misprediction began to "
                "matter: a line starts at the share that was above all along, and what it lacks of 100% at "
                "the right never came back.",
            ),
            Picture.of(
                _paths(scenario, results),
                "The first trial of the first learner in each case, primary operator. Dotted: the route "
                "meant, after a change in grey the one left; the darker pillar is new.",
            ),
        ],
        tables=[_table(rows, operator) for operator in OPERATORS],
        claims=claims(rows),
        data={"mispredictions": rows},
    )


def claims(rows: Sequence[Mapping[str, Any]]) -> list[Claim]:
    """With authority: intent success of at least 95% in each case, and no collision the human had not."""
    level = 1.0 - 0.05 / len(CASES)
    found = [
        at_least(
            f"Intent success with authority is at least {number(LEAST)}%: {words} (preset {preset}; the "
            f"number is what is above {number(LEAST)})",
            100.0 * by_learner(rows, "intent_success", case=case, preset=preset, arm="on") - LEAST,
            least=0.0,
            unit="points",
            level=level,
        )
        for preset in PRESETS
        for case, words in CASES.items()
    ]
    return found + [_no_new_collision(rows, preset) for preset in PRESETS]


def _no_new_collision(rows: Sequence[Mapping[str, Any]], preset: str) -> Claim:
    def key(row: Mapping[str, Any]) -> tuple[Any, ...]:
        return tuple(row[name] for name in ("case", "operator", "learner", "seed"))

    alone = {key(row) for row in rows if row["arm"] == "human" and row["collision"]}
    shared = [
        {"learner": row["learner"], "new": row["collision"] and key(row) not in alone}
        for row in rows
        if row["preset"] == preset and row["arm"] == "on"
    ]
    count = sum(row["new"] for row in shared)
    return Claim(
        text=f"With authority there is no collision that the human alone had not: {count} of {len(shared)} "
        f"trials (preset {preset}; the number is their share, negative)",
        estimate=interval(-100.0 * by_learner(shared, "new")),
        smallest=0.0,
        unit="%",
        # One is enough to refute it.
        verdict="reversed" if count else "holds",
    )


def _trained(scenario: str | None, preset: str, learners: Sequence[int]) -> list[tuple[Any, Any]]:
    """Of each index a learner of all routes and one of all but one, all trained side by side."""
    if preset == "none":
        return [(None, None)] * len(learners)
    whole = [taught(scenario, index) for index in learners]
    world = scenario_of(scenario)
    partial = [
        as_demonstrations(
            scenario,
            [item for item in one if item.provenance["route"] != _untaught(world, index).name],
        )
        for index, one in zip(learners, whole, strict=True)
    ]
    trained = train_all([*whole, *partial], [*learners, *learners], preset=preset)
    return list(zip(trained[: len(whole)], trained[len(whole) :], strict=True))


def _untaught(world: Scenario, learner: int) -> Route:
    return world.routes[learner % len(world.routes)]


def _run(scenario: str | None, drive: Drive, arm: str, learner: Any, told: Mapping[str, Any]) -> Trial:
    behaviour = told["behaviour"]
    if drive.then is not None:
        behaviour = dataclasses.replace(behaviour, switch_time=_switch_time(scenario))
    given = TrialSettings(
        mode="human" if arm == "human" else "shared",
        seed=told["seed"],
        route=drive.route,
        then=drive.then,
        behaviour=behaviour,
    )
    return _simulation(scenario, drive.variant, arm == "on").run(given, learner=learner)


@functools.cache
def _simulation(scenario: str | None, variant: tuple[str, int] | None, authority: bool) -> Simulation:
    if variant is None:
        return simulation_of(scenario, DEFAULT, authority)
    case, index = variant
    return Simulation(variants(scenario, case)[index], authority=authority)


def _rooms(scenario: str | None) -> str:
    """The clearance of the ways round, in words."""
    said = []
    for case in _ROOMS:
        found = [
            clearance_scorer(world)(_points(world.routes[0].path(world.start)))
            for world in variants(scenario, case)
        ]
        said.append(f"{number(min(found))} to {number(max(found))} m of clearance ({CASES[case]})")
    return " and ".join(said)


def _switch_time(scenario: str | None) -> float:
    return named_operator("switching").behaviour_in(scenario_of(scenario)).switch_time


def _with_obstacle(world: Scenario, route: Route, share: float, room: float) -> tuple[float, Scenario | None]:
    """The route round a pillar at a share of its length, with so much room to the left, or right if negative.

    Returns:
        Its clearance, in [m], and the scenario; minus infinity and None if it cannot be driven.
    """
    path = route.path(world.start)
    along = share * path.length
    x, y, yaw, _ = path.frame(along)
    aside = math.copysign(_RADIUS + world.robot.footprint_radius + abs(room), room)
    whole = (0.0, path.length)
    arcs = [path.nearest(*point, between=whole) for point in route.waypoints]
    inner = zip(arcs[1:-1], route.waypoints[1:-1], strict=True)
    points = [(arc, point) for arc, point in inner if abs(arc - along) > abs(aside)]
    points.append((along, [x - aside * math.sin(yaw), y + aside * math.cos(yaw)]))
    waypoints = [route.waypoints[0], *(point for _, point in sorted(points)), route.waypoints[-1]]
    pillar = Circle(name="new_obstacle", x=x, y=y, radius=_RADIUS)
    sides = {**route.sides, pillar.name: "left" if room > 0 else "right"}
    changed = dataclasses.replace(
        world,
        name=f"{world.name}_{route.name}_blocked",
        obstacles=[*world.obstacles, pillar],
        routes=[dataclasses.replace(route, waypoints=waypoints, sides=sides)],
    )
    try:
        check_scenario(changed)
    except InputError:
        return -math.inf, None
    return clearance_scorer(changed)(_points(changed.routes[0].path(world.start))), changed


@functools.cache
def _parting(scenario: str | None, name: str) -> int | None:
    """Index of the first of a route's points that is apart from all other routes."""
    world = scenario_of(scenario)
    own = _points(world.route(name).path(world.start))
    others = [_points(route.path(world.start)) for route in world.routes if route.name != name]
    apart = _distances(own, np.concatenate(others)).min(axis=1) > _PARTED
    return int(apart.argmax()) if apart.any() else None


def _points(path: Path) -> np.ndarray:
    """Points (m, 2) along a path, in [m]."""
    return path.position(np.linspace(0.0, path.length, int(path.length / _SPACING) + 1))


def _distances(positions: np.ndarray, points: np.ndarray) -> np.ndarray:
    """From each position (n, 2) to each point (m, 2): shape (n, m), in [m]."""
    apart = positions[:, None, :] - points
    return np.hypot(apart[..., 0], apart[..., 1])


def _successes(rows: Sequence[Mapping[str, Any]]) -> Any:
    figure, axes = new_figure(2.7, columns=len(CASES), sharey=True)
    for place, (case, words) in zip(axes, CASES.items(), strict=True):
        for operator, offset, face in zip(OPERATORS, (-0.13, 0.13), (None, "white"), strict=True):
            for height, (preset, arm) in enumerate(_COMPARED):
                found = interval(
                    100.0
                    * by_learner(rows, "intent_success", case=case, preset=preset, arm=arm, operator=operator)
                )
                colour = COLOURS.get(preset, BLACK)
                place.errorbar(
                    [found.mean],
                    [height + offset],
                    xerr=[[found.mean - found.low], [found.high - found.mean]],
                    color=colour,
                    marker="o",
                    markersize=4.5,
                    markerfacecolor=face or colour,
                    capsize=2,
                    linewidth=1.2,
                )
        place.axvline(LEAST, color="0.7", linestyle=":", linewidth=1)
        place.set_title(words, fontsize=9)
        place.set(xlim=(-4, 104))
        place.set_xlabel("intent success, %", fontsize=9)
        place.grid(axis="y", color="0.93")
        place.set_axisbelow(True)
    axes[0].set_yticks(range(len(_COMPARED)), list(_COMPARED.values()), fontsize=8)
    axes[0].invert_yaxis()
    handles = [
        axes[0].plot([], [], color="0.3", marker="o", linestyle="", markersize=4.5, markerfacecolor=face)[0]
        for face in ("0.3", "white")
    ]
    figure.legend(handles, OPERATORS, loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    return figure


def _recoveries(rows: Sequence[Mapping[str, Any]]) -> Any:
    figure, axes = new_figure(4.2, rows=len(OPERATORS), columns=len(CASES), sharex=True, sharey=True)
    met = [row for row in rows if row["arm"] != "human" and row["weight"] != "unmet"]
    latest = max((row["recovery"] for row in met if row["weight"] == "back"), default=1.0)
    for line, operator in zip(axes, OPERATORS, strict=True):
        for place, (case, words) in zip(line, CASES.items(), strict=True):
            for preset, arm in list(_COMPARED)[1:]:
                told = {"case": case, "preset": preset, "arm": arm, "operator": operator}
                own = [row for row in met if all(row[name] == value for name, value in told.items())]
                if not own:
                    continue
                above = sum(row["weight"] == "above" for row in own)
                back = sorted(row["recovery"] for row in own if row["weight"] == "back")
                shares = 100.0 * np.arange(above, above + len(back) + 1) / len(own)
                place.step(
                    [0.0, *back, latest],
                    [*shares, shares[-1]],
                    where="post",
                    color=COLOURS[preset],
                    # Lines often coincide: the one shows beneath the other.
                    linestyle="-" if arm == "on" else "--",
                    linewidth=2.8 if arm == "on" else 1.2,
                    alpha=0.5 if arm == "on" else 1.0,
                    label=_COMPARED[preset, arm],
                )
            place.set_title(f"{words},\n{operator}", fontsize=9)
            place.set(ylim=(-3, 103), xlim=(0.0, latest))
        line[0].set_ylabel("w above 0.5, % of trials", fontsize=9)
    for place in axes[-1]:
        place.set_xlabel("time since the moment, s", fontsize=9)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=4,
        frameon=False,
        fontsize=8,
    )
    return figure


def _paths(scenario: str | None, results: Sequence[Any]) -> Any:
    drawn = {
        (result["rows"][0]["preset"], *name.split()): np.array(path)
        for result in results
        for name, path in result["drawn"].items()
    }
    figure, axes = new_figure(3.6, rows=len(PRESETS), columns=len(CASES), sharex=True, sharey=True)
    styles = {"human": (BLACK, "-"), "on": (COLOURS["shared"], "-"), "off": (COLOURS["agent"], "--")}
    for line, (case, words) in zip(axes.T, CASES.items(), strict=True):
        drive = drive_of(scenario, case, 0, 0)
        for place, preset in zip(line, PRESETS, strict=True):
            draw_scene(place, drive.world)
            if case in _ROOMS:
                place.patches[len(drive.world.obstacles) - 1].set_facecolor("0.45")
            place.plot(*_points(drive.path(drive.route)).T, ":", color="0.6" if drive.then else BLACK, lw=1.2)
            if drive.then is not None:
                place.plot(*_points(drive.path(drive.then)).T, ":", color=BLACK, lw=1.2)
            for arm, (colour, style) in styles.items():
                path = drawn["none" if arm == "human" else preset, case, arm]
                place.plot(*path.T, color=colour, linestyle=style, linewidth=1.3, zorder=3)
            space = drive.world.workspace
            place.set(xlim=(space.x_min + 0.3, space.x_max - 0.2), ylim=(space.y_min, space.y_max))
            place.set_title(f"{words},\n{preset}", fontsize=9)
            place.label_outer()
    handles = [
        axes[0, 0].plot([], [], color=colour, linestyle=style, linewidth=1.3)[0]
        for colour, style in styles.values()
    ]
    labels = ["human alone", *ARMS.values()]
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return figure


def _table(rows: Sequence[Mapping[str, Any]], operator: str) -> Table:
    cells = []
    for case, words in CASES.items():
        for (preset, arm), label in _COMPARED.items():
            told = {"case": case, "preset": preset, "arm": arm, "operator": operator}
            own = [row for row in rows if all(row[name] == value for name, value in told.items())]
            row = [words, label]
            for measure, factor in (("intent_success", 100.0), ("collision", 100.0), ("strayed", 1.0)):
                row.append(_told(factor * by_learner(own, measure)))
            if arm == "human":
                row += ["–", "–", "–"]
            else:
                met = [each for each in own if each["weight"] != "unmet"]
                row.append(_told(by_learner(met, "recovery")))
                row += [
                    number(100.0 * np.mean([each["weight"] == kind for each in met])) if met else "–"
                    for kind in ("above", "never")
                ]
            cells.append(row)
    return Table(
        caption=f"Operator {operator}: means and 95% bootstrap intervals over learners. The time is over the "
        "trials in which w fell and came back; the last two columns are shares of all trials.",
        head=[
            *("case", "control", "intent success, %", "collisions, %", "strayed, m"),
            *("w back above 0.5 after, s", "above all along, %", "never back, %"),
        ],
        rows=cells,
    )


def _told(values: np.ndarray) -> str:
    found = interval(values)
    return with_interval(found) if found.count else "–"


EXPERIMENT = Experiment(name="mispredictions", tasks=tasks, cost=cost, report=report)

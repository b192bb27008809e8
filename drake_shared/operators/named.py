"""The simulated operators by name, each with its model and source.

Their results are not evidence about people.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType

from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import Behaviour
from drake_shared.robots import Arm, Robot
from drake_shared.scenario import Route, Scenario

# Share of the travel time at which a switching operator changes its route: about half-way to the goal's edge,
# and early enough to pass the next obstacle on the other side.
_SWITCH = 0.45


@dataclasses.dataclass(frozen=True, kw_only=True)
class NamedOperator:
    """A simulated operator with a name.

    Attributes:
        behaviour: Parameters.
        model: What the operator does, in one line.
        source: Of the model or its parameters.
        switches: Whether the operator changes to another route half-way.
    """

    behaviour: Behaviour
    model: str
    source: str
    switches: bool = False

    def behaviour_in(self, scenario: Scenario) -> Behaviour:
        """The behaviour, with the time of the change of route in ``scenario``."""
        if not self.switches:
            return self.behaviour
        return dataclasses.replace(self.behaviour, switch_time=_SWITCH * scenario.travel_time)


OPERATORS: Mapping[str, NamedOperator] = MappingProxyType(
    {
        "primary": NamedOperator(
            behaviour=Behaviour(),
            model="steers along a smooth route by the pose seen 0.2 s ago, with a little coloured noise",
            source="smooth start and end: Flash and Hogan 1985; delay: Saunders and Knill 2005",
        ),
        "noisy": NamedOperator(
            behaviour=Behaviour(random_share=0.3),
            model="gives a random command with probability 0.3 in each step",
            source="noisy pilot of Reddy, Dragan and Levine 2018 (0.15), Yoneda et al. 2023 (0.3 to 0.6)",
        ),
        "laggy": NamedOperator(
            behaviour=Behaviour(lag=0.7),
            model="repeats the last command with probability 0.7 in each step",
            source="laggy pilot of Reddy, Dragan and Levine 2018 (0.8), Yoneda et al. 2023 (0.85); "
            "less here, since more seldom reaches the goal alone",
        ),
        "delayed": NamedOperator(
            behaviour=Behaviour(delay=0.4),
            model="steers by the pose seen 0.4 s ago",
            source="twice the upper end of the visual-motor delay of Saunders and Knill 2005",
        ),
        "signal-noise": NamedOperator(
            behaviour=Behaviour(signal_noise=0.1),
            model="noise with a standard deviation that grows with the command, 10% of it",
            source="signal-dependent noise of Harris and Wolpert 1998; the share is ours",
        ),
        "late-slow": NamedOperator(
            behaviour=Behaviour(late_start=1.0, speed_factor=0.9),
            model="starts 1 s late and drives 10% slower",
            source="ours: a late operator lets an agent that goes by time run ahead",
        ),
        "switching": NamedOperator(
            behaviour=Behaviour(),
            model="changes to another route half-way, at 45% of the travel time",
            source="ours: a misprediction with which no published system is tested",
            switches=True,
        ),
        "stubborn": NamedOperator(
            behaviour=Behaviour(stubbornness=0.5),
            model="adds half of the difference between the intended command and the arbiter's output",
            source="ours, linear; people adapt to assistance: arXiv 2410.00181",
        ),
        "yielding": NamedOperator(
            behaviour=Behaviour(yielding=0.7),
            model="gives up to 70% of the command as assistance takes over",
            source="ours, linear; people adapt to assistance: arXiv 2410.00181",
        ),
        "resting": NamedOperator(
            behaviour=Behaviour(pause_time=4.0, pause=2.0),
            model="gives no command from 4 s to 6 s, and then continues as planned",
            source="ours: hands off, as in the intervention share of arXiv 2204.07026",
        ),
        "unskilled": NamedOperator(
            behaviour=Behaviour(noise=0.75),
            model="coloured noise of 0.75 rad/s on each wheel",
            source="ours: enough to fail alone at times",
        ),
    }
)
"""Those of a differential drive, by name."""

ARM_OPERATORS: Mapping[str, NamedOperator] = MappingProxyType(
    {
        "steady": NamedOperator(
            behaviour=Behaviour(noise=0.01),
            model="moves the tip along a route by the position seen 0.2 s ago, with noise of 1 cm/s",
            source="delay: Saunders and Knill 2005",
        ),
        "unsteady": NamedOperator(
            behaviour=Behaviour(delay=0.25, noise=0.04, skill=0.2),
            model="noise of 4 cm/s, 0.25 s of delay and a fifth of the skill",
            source="ours: enough to fail alone at times",
        ),
        "aims-ahead": NamedOperator(
            behaviour=Behaviour(delay=0.25, noise=0.08, aim_ahead=0.08),
            model="steers to the point 8 cm ahead on the route, with noise of 8 cm/s",
            source="ours: aiming corrects noise that following does not",
        ),
        "switches-planes": NamedOperator(
            behaviour=Behaviour(delay=0.25, noise=0.08, aim_ahead=0.08, plane_switch_time=0.7),
            model="moves x-y or y-z with two axes, and takes 0.7 s to switch between them",
            source="mode switching of Herlant, Holladay and Srinivasa 2016; the time is ours",
        ),
    }
)
"""Those of an arm, by name."""


def operators_for(robot: Robot) -> Mapping[str, NamedOperator]:
    """The named operators of a robot."""
    return ARM_OPERATORS if isinstance(robot, Arm) else OPERATORS


def named_operator(name: str) -> NamedOperator:
    """The operator of that name, of a differential drive.

    Raises:
        InputError: No operator has that name.
    """
    if name not in OPERATORS:
        raise InputError("operator", "", f"must be one of {', '.join(OPERATORS)}", repr(name))
    return OPERATORS[name]


def changes_of_route(scenario: Scenario) -> list[tuple[Route, Route]]:
    """Each route that can be left half-way for another, with the next one that can still be driven.

    A route can still be driven if it passes the obstacles of the first half on the same sides; a route to the
    same goal with the same sides everywhere is not a change.

    Raises:
        InputError: No route can be left for another.
    """
    changes = []
    for index, route in enumerate(scenario.routes):
        path = scenario.path_of(route)
        whole = (0.0, path.length)
        behind = [
            item.name
            for item in scenario.static_obstacles
            if path.nearest(item.x, item.y, between=whole) < 0.5 * path.length
        ]
        others = scenario.routes[index + 1 :] + scenario.routes[:index]
        possible = (
            other
            for other in others
            if (other.sides != route.sides or scenario.goal_of(other) is not scenario.goal_of(route))
            and all(other.sides[name] == route.sides[name] for name in behind)
        )
        then = next(possible, None)
        if then is not None:
            changes.append((route, then))
    if not changes:
        raise InputError(
            f"scenario {scenario.name}", "routes", "must hold one that can be left half-way for another"
        )
    return changes

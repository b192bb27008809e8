"""Arbiters that reason about the routes which a driver may take."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.routes import Routes, routes_of
from drake_shared.arbitration.rule import ArbitrationRule
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.learners.route_clustering import group_by_route
from drake_shared.robots import DiffDrive, Robot
from drake_shared.scenario import Scenario
from drake_shared.scenario.route_planner import plan_routes
from drake_shared.systems.rule_arbiter import RuleArbiter


class RouteArbiter(RuleArbiter):
    """A `RuleArbiter` of a differential drive whose rule depends on the routes; a base class.

    The routes are those of the learner's demonstrations, and one for each further way of passing the known
    obstacles. A subclass implements :meth:`MakeRouteRule`, and calls :meth:`DeclareRule` once it can.

    Args:
        scenario: Start, goals and static obstacles.
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.
        optional_inputs, logged: See :class:`~drake_shared.systems.rule_arbiter.RuleArbiter`.

    Raises:
        InputError: The robot is not a differential drive.
    """

    state_size = 4096

    def __init__(
        self,
        *,
        scenario: Scenario,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
        optional_inputs: Sequence[str] = (),
        logged: Sequence[str] = (),
    ) -> None:
        super().__init__(
            robot=robot, period=period, driver=driver, optional_inputs=optional_inputs, logged=logged
        )
        if not isinstance(self.robot, DiffDrive):
            raise InputError(type(self).__name__, "robot", "must be a differential drive")
        self.scenario, self.drive = scenario, self.robot
        # Planned once: it takes longer than all else that a new learner costs.
        self._planned = plan_routes(scenario)
        self._made: tuple[Learner | None, ArbitrationRule] | None = None

    def MakeRouteRule(self, routes: Routes) -> ArbitrationRule:
        """The rule for ``routes``."""
        raise NotImplementedError

    def MakeRule(self, learner: Learner | None) -> ArbitrationRule:
        """The rule for the routes that were demonstrated to ``learner``, and for further ones.

        Raises:
            InputError: No way leads to the goal.
        """
        # A rule has no state, so that trials can share it; making one takes as long as half a trial.
        if self._made is None or self._made[0] is not learner:
            paths = [] if learner is None else demonstrated_paths(learner)
            self._made = learner, self.MakeRouteRule(routes_of(self.scenario, paths, self._planned))
        return self._made[1]


def demonstrated_paths(learner: Learner) -> list[NDArray[np.float64]]:
    """The mean path (N, 2), in [m], of each route that was demonstrated to a learner, if that is known."""
    if learner.demonstrations is None:
        return []
    positions = np.asarray(learner.demonstrations)
    return [positions[group].mean(axis=0) for group in group_by_route(positions)]

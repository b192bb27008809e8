"""Arbitration by the posterior of the driver's route and noise."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import Context, State as DrakeState, ValueProducer

from drake_shared.arbitration.fusion import Fusion, FusionModel, State
from drake_shared.arbitration.routes import routes_of
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.learners.dataset import scale_of
from drake_shared.learners.route_clustering import group_by_route
from drake_shared.robots import DiffDrive, Robot
from drake_shared.scenario import Scenario
from drake_shared.scenario.route_planner import plan_routes
from drake_shared.systems.arbiter import Arbiter

T = TypeVar("T")


class PosteriorFusion(Arbiter):
    """Infers the driver's route and noise from the commands, and fuses them with the command of each route.

    .. pydrake_system::

        name: PosteriorFusion
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        - pose
        output_ports:
        - shared_command
        - human_weight

    Inputs, outputs and parameters are those of :class:`~drake_shared.systems.arbiter.Arbiter`. The routes are
    those of the learner's demonstrations, and one for each further way of passing the known obstacles; see
    `drake_shared.arbitration.fusion`. The agent's own command and confidence play no part.

    State:
        The joint probability of route, noise and its time constant, and what the next update compares with.

    Args:
        scenario: Start, goal and static obstacles.
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.
        model: Of a driver, see :class:`~drake_shared.arbitration.fusion.FusionModel`.

    Raises:
        InputError: The robot is not a differential drive, a field is out of range, or no way leads to the
            goal.
    """

    def __init__(
        self,
        *,
        scenario: Scenario,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
        model: FusionModel | None = None,
    ) -> None:
        super().__init__(robot=robot, period=period, driver=driver, optional_inputs=("pose",))
        if not isinstance(self.robot, DiffDrive):
            raise InputError("PosteriorFusion", "robot", "must be a differential drive")
        self._scenario = scenario
        self._model = model or FusionModel()
        # Planned once: it takes longer than all else that a new learner costs.
        self._planned = plan_routes(scenario)
        self._pose_port = self.GetInputPort("pose")
        fusion = self._fusion_for([])
        initial = fusion.initial_state(1)
        self._fusion_index = int(self.DeclareAbstractParameter(Value(_Shared(fusion))))
        self._memory_index = int(self.DeclareAbstractState(Value(_Shared(initial))))
        nothing = _Shared(_Step(weight=1.0, command=(), after=initial))
        self._step_cache = self.DeclareCacheEntry(
            "fusion_step",
            ValueProducer(lambda: Value(nothing), self._calc_step),
            {self.all_input_ports_ticket(), self.pa_ticket(), self.xa_ticket()},
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)
        self.DeclareForcedUnrestrictedUpdateEvent(self._update)

    @property
    def configuration(self) -> dict[str, Any]:
        """The model of a driver."""
        return dataclasses.asdict(self._model)

    def SetLearner(self, context: Context, learner: Learner) -> None:
        """Sets the learner whose demonstrated routes the driver of ``context`` may intend."""
        fusion = self._fusion_for(demonstrated_paths(learner))
        context.get_mutable_abstract_parameter(self._fusion_index).set_value(_Shared(fusion))
        memory = context.get_mutable_abstract_state(self._memory_index)
        memory.set_value(_Shared(fusion.initial_state(1)))

    def GetRouteProbability(self, context: Context) -> NDArray[np.float64]:
        """Probability (K + 1,) of each route after this step's command, and of none of them."""
        fusion: Fusion = context.get_abstract_parameter(self._fusion_index).get_value().content
        return fusion.route_probability(self._step(context).after)[:, 0]

    def DoCalcWeight(self, context: Context) -> float:
        """The mean human share over all hypotheses."""
        return self._step(context).weight

    def DoCalcCommand(
        self, context: Context, weight: float, human: Sequence[float], autonomous: Sequence[float]
    ) -> Sequence[float]:
        """The fused command."""
        if weight == 1.0:
            return human
        return self._step(context).command

    def _step(self, context: Context) -> _Step:
        step: _Step = self._step_cache.Eval(context).content
        return step

    def _fusion_for(self, paths: Sequence[NDArray[np.float64]]) -> Fusion:
        assert isinstance(self.robot, DiffDrive)
        return Fusion(
            self._model,
            routes_of(self._scenario, paths, self._planned),
            robot=self.robot,
            period=self.period,
            travel_time=self._scenario.travel_time,
        )

    def _calc_step(self, context: Context, output: Value) -> None:
        fusion: Fusion = context.get_abstract_parameter(self._fusion_index).get_value().content
        before: State = context.get_abstract_state(self._memory_index).get_value().content
        pose = self._pose_port.Eval(context)[:, None]
        human = self._human_port.Eval(context)[:, None]
        with np.errstate(invalid="ignore"):
            weight, command, after = fusion.step(before, pose, human)
        output.set_value(_Shared(_Step(weight.item(), command[:, 0].tolist(), after)))

    def _update(self, context: Context, state: DrakeState) -> None:
        after = _Shared(self._step(context).after)
        state.get_mutable_abstract_state().get_mutable_value(self._memory_index).set_value(after)


def demonstrated_paths(learner: Learner) -> list[NDArray[np.float64]]:
    """The mean path (N, 2), in [m], of each route that was demonstrated to a learner, if that is known."""
    if learner.demonstrations is None:
        return []
    positions = np.asarray(learner.demonstrations)
    spread, extent = scale_of(positions)
    groups = group_by_route(positions, spread=spread, extent=extent)
    return [positions[group].mean(axis=0) for group in groups]


class _Step(NamedTuple):
    weight: float
    command: Sequence[float]
    after: State


@dataclasses.dataclass(frozen=True, slots=True)
class _Shared(Generic[T]):
    """Content that nobody writes to, so that all Contexts can share it: Drake copies values often."""

    content: T

    def __deepcopy__(self, memo: dict[int, object]) -> _Shared[T]:
        return self

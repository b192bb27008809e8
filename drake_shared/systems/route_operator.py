"""What simulated operators share, whatever the robot: their inputs, the intended route, and the answer."""

from __future__ import annotations

from typing import Generic, TypeVar

from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem

from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.imperfections import answered
from drake_shared.scenario import Route, Scenario

P = TypeVar("P")


class RouteOperator(LeafSystem, Generic[P]):
    """A simulated operator that follows a route; a base class.

    A subclass implements :meth:`PathOf`, and declares state, outputs and updates.

    .. pydrake_system::

        name: RouteOperator
        input_ports:
        - pose
        - noise
        - chance
        - human_weight
        - shared_command

    Inputs:
        pose (C): The robot's configuration.
        noise (M): Samples of a standard normal distribution, fresh ones each period, as from a RandomSource.
        chance (M + 2): Samples of a uniform distribution over [0, 1), likewise. Used only by an operator that
            lags or gives random commands.
        human_weight (1): w of the arbiter. Used only by an operator that yields; 1 if left open.
        shared_command (M): The arbiter's output for the last command, in the robot's units. Used only by an
            operator that is stubborn; the command itself if left open.

    Parameters (of the Context):
        route, behaviour: See :meth:`SetBehaviour`.

    Args:
        scenario: Gives routes and robot.
        fastest: Largest element of a command, in the robot's units.

    Raises:
        InputError: The scenario has no route.
    """

    def __init__(self, *, scenario: Scenario, fastest: float) -> None:
        super().__init__()
        if not scenario.routes:
            raise InputError(f"scenario {scenario.name}", "routes", "must name at least one route")
        self._scenario, self._fastest = scenario, fastest
        size = len(scenario.robot.command_names)
        self._pose_port = self.DeclareVectorInputPort("pose", len(scenario.robot.configuration_names))
        self._noise_port = self.DeclareVectorInputPort("noise", size)
        self._chance_port = self.DeclareVectorInputPort("chance", size + 2)
        self._weight_port = self.DeclareVectorInputPort("human_weight", 1)
        self._shared_port = self.DeclareVectorInputPort("shared_command", size)
        first = _IntendedRoute(self.PathOf(scenario.routes[0]))
        # Access by int takes half the time of access by Drake's index types.
        self._route_index = int(self.DeclareAbstractParameter(Value(first)))
        self._behaviour_index = int(self.DeclareAbstractParameter(Value(Behaviour())))

    def PathOf(self, route: Route) -> P:
        """The curve of a route of the scenario."""
        raise NotImplementedError

    def SetBehaviour(
        self, context: Context, *, route: Route, behaviour: Behaviour, then: Route | None = None
    ) -> None:
        """Sets the route that the operator of ``context`` intends, and how it drives.

        Args:
            context: Of this system.
            route: Of the scenario.
            behaviour: Delay, noise and the like; noise in the robot's units.
            then: Route to which the operator changes at ``behaviour.switch_time``.
        """
        paths = [self.PathOf(item) for item in (route, then) if item is not None]
        context.get_mutable_abstract_parameter(self._route_index).set_value(_IntendedRoute(*paths))
        context.get_mutable_abstract_parameter(self._behaviour_index).set_value(behaviour)

    def intention(self, context: Context) -> tuple[Behaviour, P]:
        """How the operator of ``context`` drives, and the curve that it follows now."""
        behaviour: Behaviour = context.get_abstract_parameter(self._behaviour_index).get_value()
        route: _IntendedRoute[P] = context.get_abstract_parameter(self._route_index).get_value()
        return behaviour, route.path(changed=context.get_time() >= behaviour.switch_time)

    def answer(
        self, context: Context, behaviour: Behaviour, intended: list[float], last: list[float]
    ) -> list[float]:
        """The intended command, changed by the arbiter's output for the last command."""
        shared, weight = last, 1.0
        if behaviour.stubbornness and self._shared_port.HasValue(context):
            shared = self._shared_port.Eval(context).tolist()
        if behaviour.yielding and self._weight_port.HasValue(context):
            weight = self._weight_port.Eval(context).item()
        return answered(behaviour, intended, last, shared, weight, self._fastest)


class _IntendedRoute(Generic[P]):
    """The curve of a route, perhaps with another one to change to."""

    def __init__(self, first: P, then: P | None = None) -> None:
        self._first = first
        self._then = then

    def path(self, *, changed: bool) -> P:
        """The curve that the operator follows before, or after, the change."""
        return self._then if changed and self._then is not None else self._first

    def __deepcopy__(self, memo: dict[int, object]) -> _IntendedRoute[P]:
        # Immutable, and Drake copies the parameters of a Context often.
        return self

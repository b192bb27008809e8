"""Parameters of a simulated operator, with their sources."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.robots import Arm, Robot

LONGEST_DELAY = 1.0
"""Longest reaction delay, in [s]: simulated operators remember poses no longer."""

_SHARES = ("random_share", "lag", "yielding")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Behaviour:
    """Parameters of a simulated operator.

    Attributes:
        delay: From seeing to the command, in [s]. 0.12 to 0.2 s is the visual-motor delay of people
            (Saunders and Knill 2005).
        noise: Standard deviation of the noise on each element of the command, in its unit: [rad/s] for
            wheels, [m/s] for the tip of an arm.
        noise_time: Time constant of the noise, in [s].
        skill: Share of an error in direction and position that is corrected; 1 is a good driver, 0 a blind
            one.
        late_start: Time before the first command, in [s].
        speed_factor: 1 takes the scenario's travel time; 1.3 is 30% faster.
        switch_time: When the operator changes to the second route, if there is one, in [s].
        pause_time: When the operator stops giving commands, in [s].
        pause: Duration of that, in [s]; 0: the operator never stops.
        signal_noise: Standard deviation of further noise, relative to the command: the noise of muscles grows
            with their activity (Harris and Wolpert 1998).
        random_share: Probability in a step of a random command in place of the intended one: the "noisy"
            pilot of Reddy et al. 2018 (0.15).
        lag: Probability in a step of repeating the last command instead: their "laggy" pilot (0.8).
        stubbornness: Share that is added of the difference between the command intended in the last step and
            the arbiter's output: an operator who resists assistance.
        yielding: How much the operator gives up control to assistance: the command is multiplied by
            1 - yielding (1 - w), w being the human weight of the last step. People do behave otherwise once
            assisted (arXiv 2410.00181).
        aim_ahead: Distance ahead on the route of the position to which the operator of an arm steers, in
            [m]; 0 follows the route.
        plane_switch_time: Time in which the operator of an arm switches between its planes x-y and y-z, in
            [s], moving one of them at a time; 0 moves all three axes at once.

    Raises:
        InputError: A value is not finite, negative, or out of its range.
    """

    delay: float = 0.2
    noise: float = 0.1
    noise_time: float = 0.5
    skill: float = 1.0
    late_start: float = 0.0
    speed_factor: float = 1.0
    switch_time: float = 0.0
    pause_time: float = 0.0
    pause: float = 0.0
    signal_noise: float = 0.0
    random_share: float = 0.0
    lag: float = 0.0
    stubbornness: float = 0.0
    yielding: float = 0.0
    aim_ahead: float = 0.0
    plane_switch_time: float = 0.0

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError("operator", field.name, "must be finite and not negative", value)
        if self.delay > LONGEST_DELAY:
            raise InputError("operator", "delay", f"must be at most {LONGEST_DELAY} s", self.delay)
        for name in ("noise_time", "speed_factor"):
            if getattr(self, name) == 0:
                raise InputError("operator", name, "must be positive", 0)
        for name in _SHARES:
            if getattr(self, name) > 1:
                raise InputError("operator", name, "must be at most 1", getattr(self, name))

    def __deepcopy__(self, memo: dict[int, Any]) -> Behaviour:
        # Frozen, and Drake copies the parameters of a Context often.
        return self


_STEADY = Behaviour(noise=0.01)


def behaviour_for(robot: Robot, behaviour: Behaviour) -> Behaviour:
    """``behaviour``, but for an arm its own in place of the default, whose noise is meant for wheels."""
    return _STEADY if isinstance(robot, Arm) and behaviour == Behaviour() else behaviour

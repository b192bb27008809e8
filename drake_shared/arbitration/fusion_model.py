"""The model of a driver with which posterior fusion reads commands."""

from __future__ import annotations

import dataclasses
import math

from drake_shared.common.errors import InputError

_SHARES = ("prior_none", "switching_to_none", "gradual")


@dataclasses.dataclass(frozen=True, kw_only=True)
class FusionModel:
    """The model of a driver. A turn is half the difference of the wheels' speeds, a speed half their sum.

    Raises:
        InputError: A value is out of range.
    """

    look_ahead: float = 0.6
    """Time ahead on a route of the point to which the agent steers, in s."""
    driver_look_ahead: float = 1.0
    """The same for the driver, in s."""
    delay: float = 0.2
    """Reaction delay of the driver, in s."""
    meant: float = 0.45
    """Standard deviation of what drivers on a demonstrated route mean beyond that steering, in rad/s."""
    meant_planned: float = 0.8
    """The same on a route that was planned, of which the agent knows only the side of each obstacle."""
    meant_rate: float = 3.0
    """Rate at which the former changes, in 1/s."""
    none_turn: float = 1.3
    """Standard deviation of the turn of a driver on none of the routes, in rad/s."""
    none_rate: float = 2.5
    """Rate at which that turn changes, in 1/s."""
    speed: float = 2.5
    """Standard deviation of what drivers mean beyond the speed of the routes, in rad/s."""
    speed_rate: float = 1.5
    """Rate at which that changes, in 1/s."""
    largest_turn: float = 3.0
    """Largest turn that drivers are expected to give, in rad/s."""
    tail: float = 4.0
    """Degrees of freedom of the distribution of sudden changes; few: jerks say little."""
    prior_planned: float = 0.3
    """Prior probability of a route that was planned, and of the straight line to a goal, relative to one of a
    route that was demonstrated."""
    prior_none: float = 0.03
    """Prior probability of none of these."""
    switching: float = 0.2
    """Rate at which drivers change their destination, in 1/s."""
    switching_to_none: float = 0.05
    """Share of these changes that lead to none of the known ones."""
    gradual: float = 0.15
    """Share of these changes that are gradual; the others are sudden."""
    drifting: float = 0.05
    """Rate at which the noise of a driver changes, in 1/s."""
    blocked_time: float = 0.2
    """Time constant with which a destination behind an obstacle is given up, in s."""
    held_time: float = 0.5
    """Time after which a robot that an obstacle stops turns to the likeliest free route by itself, in s."""
    noises: tuple[float, ...] = (0.1, 0.3, 0.6, 0.9, 1.3, 1.8)
    """Standard deviations of the noise on each wheel's command that are considered, in rad/s."""
    noise_times: tuple[float, ...] = (0.1, 0.25, 0.5, 1.0, 2.0)
    """Time constants of the noise that are considered, in s."""
    noise_prior: tuple[float, ...] = ()
    """Prior weight of each pair of both, noise by noise, such as those of one person; empty: all alike."""
    noise_memory: float = 0.5
    """Time after which the noise found counts as another observation of who drives, in s."""
    false_notices: float = 1800.0
    """Least mean time between false notices that another driver than that person has taken over, in s."""

    @property
    def meant_planned_rate(self) -> float:
        """Rate at which what is meant on a planned route changes, in 1/s.

        Drivers are as smooth there: were they rougher, each step of a smooth drive would speak against it.
        """
        return self.meant_rate * float((self.meant / self.meant_planned) ** (2.0 / 3.0))

    def __post_init__(self) -> None:
        pairs, weights = len(self.noises) * len(self.noise_times), self.noise_prior
        are_weights = len(weights) == pairs and all(0.0 <= item < math.inf for item in weights)
        if weights and not (are_weights and any(weights)):
            expected = f"must be {pairs} finite weights, not all of them zero"
            raise InputError("fusion", "noise_prior", expected, weights)
        for field in dataclasses.fields(self):
            if field.name == "noise_prior":
                continue
            value = getattr(self, field.name)
            values = value if isinstance(value, tuple) else (value,)
            most = 1.0 if field.name in _SHARES else math.inf
            if not values or not all(0.0 < item < most for item in values):
                expected = "must be from 0 to 1" if field.name in _SHARES else "must be positive and finite"
                raise InputError("fusion", field.name, expected, value)
        if self.false_notices <= self.noise_memory:
            expected = "must be longer than noise_memory"
            raise InputError("fusion", "false_notices", expected, self.false_notices)

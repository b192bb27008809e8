"""How a simulated operator drives: plain numbers, each with where it comes from."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from drake_shared.common.errors import InputError

# The longest reaction delay that a simulated operator's memory for poses allows, in [s].
LONGEST_DELAY = 1.0

_SHARES = ("random_share", "lag", "yielding")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Behaviour:
    """How a simulated operator drives.

    Attributes:
        delay: From what is seen to the command, in [s]. 0.12 to 0.2 s is the visual-motor delay of people
            (Saunders and Knill 2005).
        noise: Standard deviation of the noise on each wheel's command, in [rad/s].
        noise_time: Time constant of the noise, in [s].
        skill: How much of an error in direction and position is corrected; 1 is a good driver, 0 a blind one.
        late_start: Time before the first command, in [s].
        speed_factor: 1 takes the scenario's travel time; 1.3 is 30% faster.
        switch_time: When the operator changes to the other route in mind, if there is one, in [s].
        pause_time, pause: When the operator gives nothing for a while, in [s], and for how long, in [s].
        signal_noise: Standard deviation of further noise, per size of the command: the noise of muscles
            grows with what they do (Harris and Wolpert 1998).
        random_share: Probability in a step of a random command in place of the one meant: the "noisy" pilot
            of Reddy et al. 2018 (0.15).
        lag: Probability in a step of doing as in the last one instead: their "laggy" pilot (0.8).
        stubbornness: How much is added of the difference between what was wanted in the last step and what
            assistance made of it: someone who fights assistance.
        yielding: How much the hand lets go where assistance takes over: the command is multiplied by
            1 - yielding (1 - w), w being the human weight of the last step. People do behave otherwise once
            assisted (arXiv 2410.00181).
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

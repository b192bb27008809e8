"""The settings of one trial."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.blend import DRIVERS
from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import Behaviour
from drake_shared.simulation.log import Trial

# Drake's random generator takes seeds below this.
_SEEDS = 2**32


@dataclasses.dataclass(frozen=True, kw_only=True)
class TrialSettings:
    """Settings that differ from trial to trial.

    Attributes:
        driver: "shared", "human" or "agent"; the config's if None.
        seed: Of the simulated operator's noise.
        route: Name of the route that the operator intends; for a person, the instructed one. None: unknown.
        then: Name of the route to which a simulated operator changes at ``behaviour.switch_time``, if any.
        behaviour: Of a simulated operator.
        recording: Shape (n, M), commands in the robot's units for
            :class:`~drake_shared.systems.recorded_input.RecordedInput`.
        confidence_gain: K of eq. (1), in [1/m^2]; the config's if None.

    Raises:
        InputError: A value is out of range.
    """

    driver: str | None = None
    seed: int = 0
    route: str | None = None
    then: str | None = None
    behaviour: Behaviour = dataclasses.field(default_factory=Behaviour)
    recording: NDArray[np.float64] | None = None
    confidence_gain: float | None = None

    def __post_init__(self) -> None:
        if self.driver not in (None, *DRIVERS):
            raise InputError("trial", "driver", f"must be one of {', '.join(DRIVERS)}", repr(self.driver))
        if not 0 <= self.seed < _SEEDS:
            raise InputError("trial", "seed", f"must be from 0 to {_SEEDS - 1}", self.seed)
        gain = self.confidence_gain
        if gain is not None and not (math.isfinite(gain) and gain > 0):
            raise InputError("trial", "confidence_gain", "must be positive and finite", gain)


def settings_of_log(trial: Trial) -> TrialSettings:
    """The settings with which a logged trial was run, without a recording.

    With `drake_shared.simulation.config.config_of_log`, scenario and learner they give the same trial again.

    Raises:
        InputError: The log's metadata hold no valid settings.
    """
    metadata = trial.metadata
    behaviour = metadata.get("behaviour", {})
    try:
        return TrialSettings(
            driver=metadata["mode"],
            seed=metadata.get("seed", 0),
            route=metadata.get("route"),
            then=metadata.get("then"),
            behaviour=Behaviour(**behaviour),
            confidence_gain=metadata.get("confidence_gain"),
        )
    except (KeyError, TypeError) as error:
        raise InputError("the log", "metadata", f"must hold the settings of a trial ({error})") from error

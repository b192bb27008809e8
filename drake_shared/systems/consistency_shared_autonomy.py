"""Arbitration by consistency shared autonomy (Sun et al. 2025)."""

from __future__ import annotations

import functools

import numpy as np

from drake_shared.arbitration import consistency
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.learners.consistency.model import ConsistencyModel, consistency_scalings, noise_level
from drake_shared.learners.no_learner import NoLearner
from drake_shared.robots import Robot
from drake_shared.systems.rule_arbiter import RuleArbiter

# Time in which a command leads to the displacement that is denoised, in [s]: the agent's look-ahead.
_HORIZON = 0.6


class ConsistencySharedAutonomy(RuleArbiter):
    """Takes the driver's command for a noisy demonstrated one, and denoises it in one step.

    .. pydrake_system::

        name: ConsistencySharedAutonomy
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        - pose
        output_ports:
        - shared_command
        - human_weight

    Inputs, outputs and parameters are those of :class:`~drake_shared.systems.arbiter.Arbiter`. A small
    network is trained on the demonstrations that the learner holds when a trial with it begins; see
    `drake_shared.arbitration.consistency`, which names the source. Training takes a few seconds and needs
    torch. The agent's own command and confidence play no part. The command is that toward where the denoised
    action leads, and so no convex combination of commands.

    Args:
        degree: Of noising: 0, where the human drives alone, to 1, where the command is that of the
            demonstrations, whatever the human does. The default is the best one on the four scenes with which
            `drake-shared compare` tunes, with 60 demonstrations.
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.

    Raises:
        InputError: ``degree`` is out of range.
    """

    def __init__(
        self,
        *,
        degree: float = 0.25,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
    ) -> None:
        super().__init__(robot=robot, period=period, driver=driver, optional_inputs=("pose",))
        if not (isinstance(degree, int | float) and 0.0 <= degree <= 1.0):
            raise InputError("ConsistencySharedAutonomy", "degree", "must be from 0 to 1", repr(degree))
        self._degree = float(degree)
        self.DeclareRule()

    @property
    def configuration(self) -> dict[str, float]:
        """Degree of noising."""
        return {"degree": self._degree}

    def MakeRule(self, learner: Learner | None) -> consistency.ConsistencySharedAutonomy:
        """The rule with the demonstrations of ``learner``; without a learner the human drives alone.

        Raises:
            InputError: The learner does not hold its demonstrations.
        """
        model = None if learner is None or isinstance(learner, NoLearner) else model_of(learner)
        return consistency.ConsistencySharedAutonomy(
            robot=self.robot,
            horizon=_HORIZON,
            denoise=None if model is None else functools.partial(model.denoised, degree=self._degree),
            share=consistency_scalings(noise_level(self._degree))[0],
        )


def model_of(learner: Learner) -> ConsistencyModel:
    """The consistency model of a learner's demonstrations, the same bits every time.

    Raises:
        InputError: The learner does not hold its demonstrations.
    """
    if learner.demonstrations is None:
        expected = "must hold its demonstrations for arbitration 'consistency'"
        raise InputError("arbitration", "learner", expected, repr(learner.name))
    paths, grid = (np.asarray(values, float) for values in (learner.demonstrations, learner.grid))
    return _trained(paths.tobytes(), grid.tobytes(), paths.shape)


# Trials with the same learner follow each other, also in other diagrams.
@functools.lru_cache(maxsize=8)
def _trained(paths: bytes, grid: bytes, shape: tuple[int, ...]) -> ConsistencyModel:
    # Only training needs torch, which takes a second to import.
    from drake_shared.learners.consistency.training import demonstrated_actions, train_consistency

    taught = np.frombuffer(paths).reshape(shape)
    return train_consistency(*demonstrated_actions(taught, np.frombuffer(grid), horizon=_HORIZON))

"""An ensemble of CNMPs: what they disagree about is not known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.learners.cnmp.file import cnmps_from_file, cnmps_to_file
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.metadata_fields import number_of


class EnsembleLearner:
    """Several CNMPs, taught the same from different seeds (Lakshminarayanan et al. 2017). A `Learner`.

    The mean is the mean of theirs; the variance is the mean of theirs plus the variance of their means: where
    demonstrations say little the members fill in each as it likes, and their disagreement shows it.

    Args:
        members: At least one, on one grid.
        confidence_gain: K of eq. (1), in [1/m^2].
        metadata: Whatever else its file says.
    """

    name = "ensemble"

    def __init__(
        self, *, members: Sequence[CnmpLearner], confidence_gain: float, metadata: Mapping[str, Any]
    ) -> None:
        self.members = list(members)
        first = self.members[0]
        self.grid, self.duration, self.preset = first.grid, first.duration, first.preset
        self.demonstrations = first.demonstrations
        self.confidence_gain = confidence_gain
        self.metadata = dict(metadata)

    def predict(
        self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean (Q, 2) in [m] and variance (Q, 2) in [m^2] at ``query_times`` (Q,); see `Learner`."""
        said = [member.predict(times, positions, query_times) for member in self.members]
        means = np.stack([mean for mean, _ in said])
        within = np.mean([variance for _, variance in said], axis=0)
        return means.mean(axis=0), within + means.var(axis=0)

    def to_file(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Tensors and description for `save_learner`."""
        tensors, descriptions = cnmps_to_file([member.model for member in self.members], "member")
        return tensors, {
            **self.metadata,
            "preset": self.preset,
            "duration": self.duration,
            "members": descriptions,
        }

    @classmethod
    def from_file(
        cls, path: Any, tensors: Mapping[str, NDArray[Any]], description: Mapping[str, Any]
    ) -> EnsembleLearner:
        """The learner of a file, for `load_learner`.

        Raises:
            InputError: Something in it does not fit.
        """
        models = cnmps_from_file(path, tensors, description, "member")
        return cls(
            members=[CnmpLearner(model) for model in models],
            confidence_gain=number_of(path, description, "confidence_gain"),
            metadata={name: value for name, value in description.items() if name != "members"},
        )

    def scaled(self, factor: float) -> EnsembleLearner:
        """The same with the standard deviations of each member times ``factor``."""
        return EnsembleLearner(
            members=[member.scaled(factor) for member in self.members],
            confidence_gain=self.confidence_gain,
            metadata=self.metadata,
        )

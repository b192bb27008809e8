"""Training a context-based echo state network: two ridge regressions."""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from drake_shared.common.arrays import path_at
from drake_shared.common.errors import InputError
from drake_shared.common.threads import single_threaded
from drake_shared.demonstrations import Demonstrations, align
from drake_shared.learners.augmentation import low_frequency_basis, make_neighborhoods, unexplained
from drake_shared.learners.calibration import LEAST_CONFIDENCE, calibrate
from drake_shared.learners.cesn.context import encode, features, within
from drake_shared.learners.cesn.learner import CesnLearner
from drake_shared.learners.cesn.reservoir import echo_states
from drake_shared.learners.cnmp.parameters import find_parameters
from drake_shared.learners.dataset import Dataset, data_record, make_dataset

Array = NDArray[np.float64]
# Arrays with a row for each context: half as large as float64, and twice as fast.
Floats = NDArray[np.float32]

MAX_MODES = 8
# Modes smaller than this, relative to the first, are left out.
_MIN_MODE = 0.02
_HIDDEN_PER_MODE, MAX_HIDDEN = 200, 800
_CONTEXTS_PER_HIDDEN, _MIN_CONTEXTS = 20, 8_000
# Up to so many demonstrations take turns at every sample of times, so that none is sampled more than another.
_FEW = 8
_RIDGE = 0.01
# Range of the gains of the random layer's units: some respond to a whole route, some to parts of it.
_GAINS = (0.25, 2.0)
_BIAS = 1.5
# Scoring steps are damped, and a squared residual counts as at most this many times its expected value.
_SCORING_STEPS, _SCORING_RATE, _MAX_RATIO = 8, 0.7, 4.0
_INTERVAL, _INTERVAL_SIGMAS = 0.9, 1.645
_SINGLE_SHARE = 0.2


def train_cesn(
    demonstrations: Demonstrations, *, preset: str = "default", weighted: bool = True, seed: int = 0
) -> CesnLearner:
    """Trains a network. The same demonstrations and seed give the same bits on the same kind of processor.

    Args:
        demonstrations: At least one.
        preset: "default" or "paper": the clock and the evidence in the metadata, as for the CNMP.
        weighted: Whether scores, where all demonstrations have one, weight them in the mean.
        seed: Of the reservoir, of the random layer and of all samples.

    Raises:
        InputError: An argument or a score is invalid.
    """
    begun = time.perf_counter()
    chosen = find_parameters(preset)
    if seed < 0:
        raise InputError("train", "seed", "must be 0 or more", seed)
    if chosen.clock == "progress":
        demonstrations = align(demonstrations)
    dataset = make_dataset(demonstrations, weighted=weighted)
    # A second thread would change the bits.
    with single_threaded():
        fit = _Fit(dataset, seed)
        resolution = 0.5 * fit.noise * dataset.spread
        gain = calibrate(fit.learner(preset), demonstrations, resolution=resolution)
    record = {
        **data_record(demonstrations, dataset),
        "versions": {
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "python": platform.python_version(),
        },
        "contexts": fit.contexts,
        "hidden": fit.hidden,
        "widened": fit.widening,
        "weighted": weighted,
        "seed": seed,
        "seconds": round(time.perf_counter() - begun, 3),
    }
    metadata = {
        "scenario": demonstrations.scenario,
        "clock": chosen.clock,
        "evidence": chosen.evidence,
        "training": record,
    }
    max_variance = 1.0 / (LEAST_CONFIDENCE * gain)
    return fit.learner(preset, confidence_gain=gain, metadata=metadata, max_variance=max_variance)


class _Fit:
    """The regressions on one set of demonstrations, in normalized units and phases.

    Args:
        dataset: The training data.
        seed: Of all samples.
    """

    def __init__(self, dataset: Dataset, seed: int) -> None:
        # Contexts are sampled alike for both presets, by the parameters that were measured for the CNMP.
        self._parameters = find_parameters("default")
        self._dataset = dataset
        self._size = dataset.positions.shape[2]
        self._rng = np.random.default_rng(seed)
        self.noise = self._parameters.noise
        self._states = echo_states(self._rng)
        self._states32 = self._states.astype(np.float32)
        self._paths = _at_phases((dataset.positions - dataset.mean_path) / dataset.spread, len(self._states))
        farthest = float(np.sqrt(np.square(self._paths).sum(axis=-1).max()))
        self._reach = farthest + 3.0 * self.noise
        self._modes = _principal_modes(self._paths)
        self._neighbors, gains = make_neighborhoods(
            self._paths, reach=self._parameters.blending, widening=self._parameters.widening
        )
        self._deviations = np.sqrt(self._neighbors) * gains[:, None]
        self._low_frequency = self._parameters.wandering * unexplained(self._neighbors)
        self._basis = low_frequency_basis(len(self._states))
        size = self._modes.shape[-1]
        self.hidden = min(MAX_HIDDEN, _HIDDEN_PER_MODE * size)
        self.contexts = max(_MIN_CONTEXTS, _CONTEXTS_PER_HIDDEN * self.hidden)
        unit_gains = np.exp(self._rng.uniform(math.log(_GAINS[0]), math.log(_GAINS[1]), self.hidden))
        self._layer = (
            (self._rng.standard_normal((2 * size, self.hidden)) * unit_gains).astype(np.float32),
            (self._rng.uniform(-_BIAS, _BIAS, self.hidden) * unit_gains).astype(np.float32),
        )
        self._floor = self._parameters.sigma_floor
        self._mean_readout = self._fit_mean()
        self._spread_readout, self._log_variance = self._fit_variance()
        self.widening = self._find_widening()
        self._log_variance += 2.0 * np.log(self.widening)

    def learner(
        self,
        preset: str,
        *,
        confidence_gain: float = 1.0,
        metadata: dict[str, Any] | None = None,
        max_variance: float | None = None,
    ) -> CesnLearner:
        """The learner; see `drake_shared.learners.cnmp.optimization.Optimization.export`."""
        dataset, parameters = self._dataset, self._parameters
        noise = self.noise * dataset.spread
        readout = np.concatenate([self._mean_readout, self._spread_readout], axis=1)
        return CesnLearner(
            preset=preset,
            grid=dataset.grid,
            reference=dataset.mean_path,
            scale=dataset.spread,
            modes=self._modes,
            noise=self.noise,
            reach=self._reach,
            states=self._states,
            hidden_weights=self._layer[0],
            hidden_bias=self._layer[1],
            readout=readout.reshape(len(readout), 2 * self._size, -1),
            log_variance=self._log_variance.astype(float),
            sigma_floor=self._floor,
            demonstrations=dataset.positions,
            weights=dataset.weights,
            doubt_reach=parameters.doubt_from * noise,
            doubt_gain=(max_variance or dataset.spread**2) / (parameters.doubt_within * noise) ** 2,
            confidence_gain=confidence_gain,
            metadata=metadata or {},
        )

    def _sample(self) -> tuple[Floats, Floats, NDArray[np.intp]]:
        """Features (C, F) of contexts, their paths (C, D, P), and the demonstration of each, (C,)."""
        rng, size = self._rng, self._size
        count, most = self.contexts, self._parameters.observations
        turns = len(self._paths) if len(self._paths) <= _FEW else 1
        chosen = np.arange(count) % turns if turns > 1 else rng.integers(len(self._paths), size=count)
        deviations = rng.standard_normal((count, len(self._paths))) * self._deviations[chosen]
        parts = self._neighbors[chosen] * (1.0 - deviations.sum(axis=1, keepdims=True)) + deviations
        paths = (parts @ self._paths.reshape(len(self._paths), -1)).reshape(count, *self._paths.shape[1:])
        amounts = rng.standard_normal((count, size, len(self._basis)))
        amounts *= self._low_frequency[chosen, None, None]
        paths += (amounts @ self._basis).transpose(0, 2, 1)
        samples = -(-count // turns)
        when = np.repeat(rng.integers(len(self._states), size=(samples, most)), turns, axis=0)[:count]
        number = np.repeat(rng.integers(1, most + 1, samples), turns)[:count]
        number[: int(_SINGLE_SHARE * count)] = 1
        observed = paths[np.arange(count)[:, None], when]
        observed += self.noise * rng.standard_normal(observed.shape)
        modes = self._modes[when]
        modes[np.arange(most) >= number[:, None]] = 0.0
        code = encode(modes, within(observed, self._reach), self.noise).astype(np.float32)
        return features(code, *self._layer), paths.transpose(0, 2, 1).astype(np.float32, order="C"), chosen

    def _fit_mean(self) -> Floats:
        """Ridge regression of the readout (F, D S) of the mean, with weighted demonstrations."""
        rows, paths, chosen = self._sample()
        weights = (self._dataset.weights * len(self._dataset.weights)).astype(np.float32)[chosen, None]
        return _ridge(rows, weights)(self._by_states(paths))

    def _fit_variance(self) -> tuple[Floats, Floats]:
        """Gamma regression of the squared residuals with a logarithmic link.

        With that link every scoring step is the same ridge regression with other targets, so that one
        factorization serves them all. All demonstrations count alike.

        Returns:
            The readout (F, D S), and what its logarithms are added to, shape (D, P).
        """
        rows, paths, _ = self._sample()
        squares = np.square(paths - self._of_states(rows @ self._mean_readout))
        squares += np.float32(self._floor**2)
        base = np.log(squares.mean(axis=0))
        solve = _ridge(rows)
        logs = np.broadcast_to(base, squares.shape)
        for _step in range(_SCORING_STEPS):
            ratio = squares * np.exp(-logs)
            np.minimum(ratio, _MAX_RATIO, out=ratio)
            ratio -= 1.0
            ratio *= _SCORING_RATE
            ratio += logs - base
            readout = solve(self._by_states(ratio))
            logs = self._of_states(rows @ readout)
            logs += base
            self._bound(logs)
        return readout, base

    def _find_widening(self) -> float:
        """The factor, 1 or more, by which 90% intervals of new contexts cover 90% of the residuals."""
        rows, paths, _ = self._sample()
        logs = self._of_states(rows @ self._spread_readout)
        logs += self._log_variance
        self._bound(logs)
        sizes = np.square(paths - self._of_states(rows @ self._mean_readout)) * np.exp(-logs)
        return max(1.0, float(np.sqrt(np.quantile(sizes, _INTERVAL))) / _INTERVAL_SIGMAS)

    def _bound(self, logs: Floats) -> None:
        """Clips logarithms of variances to those of the floor and of the reach, in place."""
        np.clip(logs, 2.0 * math.log(self._floor), 2.0 * math.log(self._reach), out=logs)

    def _by_states(self, paths: Floats) -> Floats:
        """The readouts (C, D S) of the states that approximate paths (C, D, P)."""
        return (paths @ self._states32).reshape(len(paths), -1)

    def _of_states(self, readouts: Floats) -> Floats:
        """The paths (C, D, P) that readouts (C, D S) give."""
        return readouts.reshape(len(readouts), self._size, -1) @ self._states32.T


def _ridge(rows: Floats, weights: Floats | None = None) -> Callable[[Floats], Floats]:
    """Of features (C, F) with weights (C, 1): the function that fits targets (C, T) by a readout (F, T)."""
    weighted = rows if weights is None else weights * rows
    penalty = np.full(rows.shape[1], _RIDGE)
    penalty[0] = 0.0
    factor = cho_factor((weighted.T @ rows).astype(float) / len(rows) + np.diag(penalty))

    def fit(targets: Floats) -> Floats:
        readout: Floats = cho_solve(factor, weighted.T @ targets / len(rows)).astype(np.float32)
        return readout

    return fit


def _at_phases(paths: Array, count: int) -> Array:
    """Resamples paths (m, N, D) of even steps at ``count`` even phases: shape (m, P, D)."""
    phases, grid = np.linspace(0.0, 1.0, count), np.linspace(0.0, 1.0, paths.shape[1])
    return np.stack([path_at(path, grid, phases) for path in paths])


def _principal_modes(paths: Array) -> Array:
    """Principal modes (P, D, K) of centred paths (m, P, D), each times its standard deviation."""
    amounts, sizes, modes = np.linalg.svd(paths.reshape(len(paths), -1), full_matrices=False)
    count = max(1, min(MAX_MODES, int((sizes > _MIN_MODE * sizes[0]).sum())))
    # Signs that do not change when the task is turned or mirrored.
    signs = np.sign(amounts[np.abs(amounts[:, :count]).argmax(axis=0), np.arange(count)])
    scaled = (sizes[:count] * signs / np.sqrt(len(paths)))[:, None] * modes[:count]
    return np.ascontiguousarray(scaled.reshape(count, *paths.shape[1:]).transpose(1, 2, 0))

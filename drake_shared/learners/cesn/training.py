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
from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.augmentation import left_unknown, make_blend, wander_basis
from drake_shared.learners.calibration import LEAST_CONFIDENCE, calibrate
from drake_shared.learners.cesn.learner import CesnLearner
from drake_shared.learners.cesn.model import CesnModel, encode, features, within
from drake_shared.learners.cesn.reservoir import echo_states
from drake_shared.learners.cnmp.parameters import find_parameters
from drake_shared.learners.dataset import Dataset, data_record, make_dataset

Array = NDArray[np.float64]
# What there is one of for each context: half as large, and twice as fast.
Floats = NDArray[np.float32]

MOST_MODES = 8
# Modes smaller than this, relative to the first, are no way of driving.
_LEAST_MODE = 0.02
_HIDDEN_PER_MODE, MOST_HIDDEN = 200, 800
_CONTEXTS_PER_HIDDEN, _FEWEST_CONTEXTS = 20, 8_000
# So few demonstrations take turns at every draw of times: none is drawn more often than another by chance.
_FEW = 8
_RIDGE = 0.01
# Of the random layer's weights, one for each unit: some see a whole way as one, some tell its parts apart.
_GAINS = (0.25, 2.0)
_BIAS = 1.5
# Scoring steps are small, and a residual much larger than expected counts as this many times its variance.
_SCORING_STEPS, _SCORING_RATE, _BOLDEST = 8, 0.7, 4.0
_INTERVAL, _INTERVAL_SIGMAS = 0.9, 1.645
_SINGLE_SHARE = 0.2


def train_cesn(
    demonstrations: Demonstrations,
    *,
    preset: str = "default",
    weighted: bool = True,
    seed: int = 0,
) -> CesnLearner:
    """Trains one. The same demonstrations and seed give the same bits on the same kind of processor.

    Args:
        demonstrations: At least one.
        preset: "default" or "paper": the clock and the evidence that consumers are to use, as for the CNMP.
        weighted: Whether scores, where all have one, decide which demonstrations the mean leans to.
        seed: Of the reservoir, of the random layer and of all that is drawn.

    Raises:
        InputError: An argument or a score is not what it must be.
    """
    begun = time.perf_counter()
    chosen = find_parameters(preset)
    if seed < 0:
        raise InputError("train", "seed", "must be 0 or more", seed)
    dataset = make_dataset(demonstrations, weighted=weighted)
    metadata: dict[str, Any] = {
        "scenario": demonstrations.scenario,
        "clock": chosen.clock,
        "evidence": chosen.evidence,
    }
    # A second thread would change the bits.
    with single_threaded():
        fit = _Fit(dataset, seed)
        first = fit.learner(preset, metadata, confidence_gain=1.0)
        gain = calibrate(first, demonstrations, resolution=0.5 * fit.noise * dataset.spread)
    metadata["training"] = {
        **data_record(demonstrations, dataset),
        "versions": {
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "python": platform.python_version(),
        },
        "contexts": fit.contexts,
        "hidden": fit.hidden,
        "widened": fit.widened,
        "weighted": weighted,
        "seed": seed,
        "seconds": round(time.perf_counter() - begun, 3),
    }
    return fit.learner(preset, metadata, confidence_gain=gain, doubtful=1.0 / (LEAST_CONFIDENCE * gain))


class _Fit:
    """The regressions on one set of demonstrations, in normalised units and phases.

    Args:
        dataset: What to learn.
        seed: Of everything drawn.
    """

    def __init__(self, dataset: Dataset, seed: int) -> None:
        # What a context is drawn from is the same for both presets; the CNMP's measured values serve.
        self._drawn = find_parameters("default")
        self._dataset = dataset
        self._rng = np.random.default_rng(seed)
        self.noise = self._drawn.noise
        self._states = echo_states(self._rng)
        self._states32 = self._states.astype(np.float32)
        self._paths = _at_phases((dataset.positions - dataset.mean_path) / dataset.spread, len(self._states))
        farthest = float(np.sqrt(np.square(self._paths).sum(axis=-1).max()))
        self._reach = farthest + 3.0 * self.noise
        self._modes = _principal_modes(self._paths)
        self._shares, gains = make_blend(
            self._paths, reach=self._drawn.blending, widening=self._drawn.widening
        )
        self._strays = np.sqrt(self._shares) * gains[:, None]
        self._unknown = self._drawn.wandering * left_unknown(self._shares)
        self._wander = wander_basis(len(self._states))
        size = self._modes.shape[-1]
        self.hidden = min(MOST_HIDDEN, _HIDDEN_PER_MODE * size)
        self.contexts = max(_FEWEST_CONTEXTS, _CONTEXTS_PER_HIDDEN * self.hidden)
        unit_gains = np.exp(self._rng.uniform(math.log(_GAINS[0]), math.log(_GAINS[1]), self.hidden))
        self._layer = (
            (self._rng.standard_normal((2 * size, self.hidden)) * unit_gains).astype(np.float32),
            (self._rng.uniform(-_BIAS, _BIAS, self.hidden) * unit_gains).astype(np.float32),
        )
        self._floor = self._drawn.sigma_floor
        self._mean_readout = self._fit_mean()
        self._spread_readout, self._log_variance = self._fit_variance()
        self.widened = self._widening()
        self._log_variance += 2.0 * np.log(self.widened)

    def learner(
        self,
        preset: str,
        metadata: dict[str, Any],
        *,
        confidence_gain: float,
        doubtful: float | None = None,
    ) -> CesnLearner:
        """What was learnt; ``doubtful`` is the variance that leaves hardly any confidence, in [m^2]."""
        dataset, drawn = self._dataset, self._drawn
        noise = self.noise * dataset.spread
        readout = np.concatenate([self._mean_readout, self._spread_readout], axis=1)
        model = CesnModel(
            preset=preset,
            grid=dataset.grid,
            reference=dataset.mean_path,
            scale=dataset.spread,
            modes=self._modes,
            noise=self.noise,
            reach=self._reach,
            states=self._states,
            hidden_weights=self._layer[0].astype(float),
            hidden_bias=self._layer[1].astype(float),
            readout=readout.reshape(len(readout), 4, -1),
            log_variance=self._log_variance.astype(float),
            sigma_floor=self._floor,
            demonstrations=dataset.positions,
            weights=dataset.weights,
            doubt_reach=drawn.doubt_from * noise,
            doubt_gain=(doubtful or dataset.spread**2) / (drawn.doubt_within * noise) ** 2,
            confidence_gain=confidence_gain,
            metadata=metadata,
        )
        return CesnLearner(model)

    def _draw(self) -> tuple[Floats, Floats, NDArray[np.intp]]:
        """Features (C, F) of contexts, their paths (C, 2, P + 1), and whose way each goes, (C,)."""
        rng, drawn = self._rng, self._drawn
        count, most = self.contexts, drawn.observations
        turns = len(self._paths) if len(self._paths) <= _FEW else 1
        chosen = np.arange(count) % turns if turns > 1 else rng.integers(len(self._paths), size=count)
        strays = rng.standard_normal((count, len(self._paths))) * self._strays[chosen]
        parts = self._shares[chosen] * (1.0 - strays.sum(axis=1, keepdims=True)) + strays
        paths = (parts @ self._paths.reshape(len(self._paths), -1)).reshape(count, *self._paths.shape[1:])
        amounts = rng.standard_normal((count, 2, len(self._wander))) * self._unknown[chosen, None, None]
        paths += (amounts @ self._wander).transpose(0, 2, 1)
        draws = -(-count // turns)
        when = np.repeat(rng.integers(len(self._states), size=(draws, most)), turns, axis=0)[:count]
        number = np.repeat(rng.integers(1, most + 1, draws), turns)[:count]
        number[: int(_SINGLE_SHARE * count)] = 1
        seen = paths[np.arange(count)[:, None], when]
        seen += self.noise * rng.standard_normal(seen.shape)
        modes = self._modes[when]
        modes[np.arange(most) >= number[:, None]] = 0.0
        code = encode(modes, within(seen, self._reach), self.noise).astype(np.float32)
        return features(code, *self._layer), paths.transpose(0, 2, 1).astype(np.float32, order="C"), chosen

    def _fit_mean(self) -> Floats:
        """Ridge regression of the readout (F, 2 D) of the mean, leaning to the better demonstrations."""
        read, paths, chosen = self._draw()
        lean = (self._dataset.weights * len(self._dataset.weights)).astype(np.float32)[chosen, None]
        return _ridge(read, lean)(self._by_states(paths))

    def _fit_variance(self) -> tuple[Floats, Floats]:
        """Gamma regression of the squared residuals with a logarithmic link.

        With that link every scoring step is the same ridge regression, of other targets: one factorisation
        serves them all. All demonstrations count alike.

        Returns:
            The readout (F, 2 D), and what its logarithms are counted from, shape (2, P + 1).
        """
        read, paths, _ = self._draw()
        squares = np.square(paths - self._of_states(read @ self._mean_readout))
        squares += np.float32(self._floor**2)
        base = np.log(squares.mean(axis=0))
        solve = _ridge(read)
        logs = np.broadcast_to(base, squares.shape)
        for _step in range(_SCORING_STEPS):
            surprise = squares * np.exp(-logs)
            np.minimum(surprise, _BOLDEST, out=surprise)
            surprise -= 1.0
            surprise *= _SCORING_RATE
            surprise += logs - base
            readout = solve(self._by_states(surprise))
            logs = self._of_states(read @ readout)
            logs += base
            self._bound(logs)
        return readout, base

    def _widening(self) -> float:
        """A factor on the intervals, 1 or more: 90% of new contexts' residuals are in the 90% interval."""
        read, paths, _ = self._draw()
        logs = self._of_states(read @ self._spread_readout)
        logs += self._log_variance
        self._bound(logs)
        sizes = np.square(paths - self._of_states(read @ self._mean_readout)) * np.exp(-logs)
        return max(1.0, float(np.sqrt(np.quantile(sizes, _INTERVAL))) / _INTERVAL_SIGMAS)

    def _bound(self, logs: Floats) -> None:
        """Makes logarithms of variances at least the floor's and at most that of the reach."""
        np.clip(logs, 2.0 * math.log(self._floor), 2.0 * math.log(self._reach), out=logs)

    def _by_states(self, paths: Floats) -> Floats:
        """The readouts (C, 2 D) of the states that come closest to paths (C, 2, P + 1)."""
        return (paths @ self._states32).reshape(len(paths), -1)

    def _of_states(self, readouts: Floats) -> Floats:
        """What readouts (C, 2 D) make of the states: shape (C, 2, P + 1)."""
        return readouts.reshape(len(readouts), 2, -1) @ self._states32.T


def _ridge(read: Floats, weights: Floats | None = None) -> Callable[[Floats], Floats]:
    """Of features (C, F), weighted (C, 1): the function that fits targets (C, T) by a readout (F, T)."""
    weighed = read if weights is None else weights * read
    penalty = np.full(read.shape[1], _RIDGE)
    penalty[0] = 0.0
    factor = cho_factor((weighed.T @ read).astype(float) / len(read) + np.diag(penalty))
    return lambda targets: cho_solve(factor, weighed.T @ targets / len(read)).astype(np.float32)


def _at_phases(paths: Array, count: int) -> Array:
    """Paths (m, N, 2) of even steps at ``count`` even phases: shape (m, P + 1, 2)."""
    phases, grid = np.linspace(0.0, 1.0, count), np.linspace(0.0, 1.0, paths.shape[1])
    return np.stack([path_at(path, grid, phases) for path in paths])


def _principal_modes(paths: Array) -> Array:
    """How centred paths (m, P + 1, 2) vary: shape (P + 1, 2, K), each mode times its standard deviation."""
    amounts, sizes, modes = np.linalg.svd(paths.reshape(len(paths), -1), full_matrices=False)
    count = max(1, min(MOST_MODES, int((sizes > _LEAST_MODE * sizes[0]).sum())))
    # Signs that turning or mirroring the room leaves as they are.
    signs = np.sign(amounts[np.abs(amounts[:, :count]).argmax(axis=0), np.arange(count)])
    scaled = (sizes[:count] * signs / np.sqrt(len(paths)))[:, None] * modes[:count]
    return np.ascontiguousarray(scaled.reshape(count, *paths.shape[1:]).transpose(1, 2, 0))

"""A consistency model: one step from a noisy action to a demonstrated one.

Source: Song, Dhariwal, Chen and Sutskever, "Consistency models", ICML 2023, with the noise levels and the
preconditioning of Karras, Aittala, Aila and Laine, "Elucidating the design space of diffusion-based
generative models", NeurIPS 2022.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.learners.fields import Layer

Floats = NDArray[np.float64]

# Noise levels in units in which demonstrated actions have the standard deviation `DATA_SPREAD`, as published.
LEAST_NOISE, MOST_NOISE, DATA_SPREAD = 0.002, 80.0, 0.5
LOG_SCALE = 0.25
"""The network sees the logarithm of a noise level times this."""
_RHO = 7.0
_HARMONICS = 3


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ConsistencyModel:
    """The consistency function of the actions that were demonstrated at each position.

    An action is the displacement of a position of size D within a time, the same for all actions.

    Attributes:
        layers: Of the network.
        origin: Shape (D,), middle of the demonstrated positions, in [m].
        extent: Largest distance of a demonstrated coordinate from it, in [m].
        mean: Shape (D,), of the demonstrated actions, in [m].
        scale: Unit of normalized actions, in [m].
    """

    layers: tuple[Layer, ...]
    origin: Floats
    extent: float
    mean: Floats
    scale: float

    def denoised(self, position: Floats, action: Floats, degree: float) -> Floats:
        """The demonstrated action (D,), in [m], to which a noisy one belongs.

        Args:
            position: Shape (D,), in [m].
            action: Shape (D,), in [m].
            degree: Of its noise; see `noise_level`. At 0 the action is returned.
        """
        noise = noise_level(degree)
        skip, out, inner = consistency_scalings(noise)
        noisy = (action - self.mean) / self.scale
        place = position_features((position - self.origin) / self.extent)
        values = np.concatenate([inner * noisy, [LOG_SCALE * np.log(noise)], place]).astype(np.float32)
        *hidden, (weights, bias) = self.layers
        for hidden_weights, hidden_bias in hidden:
            values = np.maximum(values @ hidden_weights + hidden_bias, np.float32(0.0))
        clean = skip * noisy + out * (values @ weights + bias).astype(float)
        return np.asarray(self.mean + self.scale * clean)


def noise_level(degree: Any) -> Any:
    """Standard deviation of the noise, from 0.002 to 80, of a degree from 0 to 1 (Karras et al., eq. 5)."""
    low, high = LEAST_NOISE ** (1.0 / _RHO), MOST_NOISE ** (1.0 / _RHO)
    return (low + degree * (high - low)) ** _RHO


def denoiser_scalings(noise: Any) -> tuple[Any, Any, Any]:
    """c_skip, c_out and c_in of a denoiser (Karras et al., table 1)."""
    square = noise**2 + DATA_SPREAD**2
    return DATA_SPREAD**2 / square, noise * DATA_SPREAD / square**0.5, 1.0 / square**0.5


def consistency_scalings(noise: Any) -> tuple[Any, Any, Any]:
    """c_skip, c_out and c_in of a consistency function (Song et al., appendix C).

    At the least noise they make it the identity: c_skip is 1 and c_out 0.
    """
    above, inner = noise - LEAST_NOISE, 1.0 / (noise**2 + DATA_SPREAD**2) ** 0.5
    return DATA_SPREAD**2 / (above**2 + DATA_SPREAD**2), DATA_SPREAD * above * inner, inner


def position_features(position: Floats) -> Floats:
    """Normalized positions (..., D) and their Fourier features, shape (..., 7 D)."""
    angles = position[..., None, :] * (0.5 * np.pi * np.arange(1, _HARMONICS + 1)[:, None])
    waves = np.concatenate([np.sin(angles), np.cos(angles)], axis=-2)
    return np.concatenate([position, waves.reshape(*position.shape[:-1], -1)], axis=-1)

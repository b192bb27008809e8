"""The rule of Robot-Trajectron V2: predicted modes are corrected by the driver's command, and one is chosen.

Source: Song et al., "Robot-Trajectron V2", arXiv 2509.19954: p(intent | command) is proportional to
p(command | intent) p(intent | context). The modes are Gaussians over the velocity to come.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

COMMAND_VARIANCE = 0.05
"""Of the noise of a driver's velocity, in [m^2/s^2], as published."""
LEAST_DENSITY = 1e-5
"""Added to the density of a command, so that no mode is lost for good, as published."""


def corrected_modes(
    probability: Floats,
    mean: Floats,
    variance: Floats,
    velocity: Floats,
    *,
    command_variance: float = COMMAND_VARIANCE,
) -> tuple[Floats, Floats, Floats]:
    """The modes after the driver's command.

    Args:
        probability: Shape (C, n).
        mean: Of the velocity of each mode, shape (C, D, n), in [m/s].
        variance: Shape (C, D, n), in [m^2/s^2]; the coordinates are independent.
        velocity: To which the driver's command leads, shape (D, n), in [m/s].
        command_variance: In [m^2/s^2].

    Returns:
        Probability (C, n): pi (N(u; mu, Sigma) + 1e-5), normalised. Mean (C, D, n): mu + K (u - mu) with
        K = Sigma / (Sigma + R). And K (C, D, n), the driver's share of it.
    """
    gain = variance / (variance + command_variance)
    log = -0.5 * (np.square(velocity - mean) / variance + np.log(2.0 * np.pi * variance))
    odds = probability * (np.exp(log.sum(axis=1)) + LEAST_DENSITY)
    return odds / odds.sum(axis=0), mean + gain * (velocity - mean), gain


def obstacle_cost(distance: Floats, *, contact: float, near: float) -> Floats:
    """Cost of a place at ``distance`` from an obstacle, as published: 30 (1/d - 1/near), or 9999 in contact.

    Args:
        distance: From the robot's middle to the nearest obstacle, in [m].
        contact: Distance at which the robot touches, in [m].
        near: Distance beyond which there is no cost, in [m].
    """
    away = np.maximum(distance, 1e-9)
    return np.where(distance < contact, 9999.0, np.maximum(30.0 * (1.0 / away - 1.0 / near), 0.0))

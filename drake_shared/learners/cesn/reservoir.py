"""The reservoir of an echo state network: a fixed random recurrent network driven by the phase."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

UNITS = 100
STEPS = 150
"""Of the reservoir, from the start of a task to its end, whatever its duration."""
_CONNECTIONS = 10
_SPECTRAL_RADIUS = 0.9
# Fast units distinguish moments, slow ones the parts of a task.
_LEAKS = (0.05, 0.9)
_INPUT = 4.0
# Directions in which the states vary less than this, relative to the first, are mostly rounding errors.
_MIN_SIZE = 1e-5


def echo_states(seed: int | np.random.Generator) -> NDArray[np.float64]:
    """The states of a reservoir of leaky units while the phase of a task goes from 0 to 1.

    x[k+1] = (1 - a) x[k] + a tanh(W x[k] + V (1, 2 s[k] - 1)), from rest (Jaeger 2001), s being the phase. W
    is sparse and of spectral radius 0.9; each unit has its own leak a.

    Args:
        seed: Of W, V and a.

    Returns:
        Shape (STEPS + 1, D): the principal directions of the states and a constant, orthonormal. A linear
        readout of these is one of the states, but its ridge penalty is isotropic.
    """
    rng = np.random.default_rng(seed)
    weights = rng.standard_normal((UNITS, UNITS)) * (rng.random((UNITS, UNITS)) < _CONNECTIONS / UNITS)
    weights *= _SPECTRAL_RADIUS / np.abs(np.linalg.eigvals(weights)).max()
    leak = np.exp(rng.uniform(np.log(_LEAKS[0]), np.log(_LEAKS[1]), UNITS))
    inward = rng.uniform(-_INPUT, _INPUT, (UNITS, 2))
    states = np.zeros((STEPS + 1, UNITS))
    for step, phase in enumerate(np.linspace(0.0, 1.0, STEPS + 1)[:-1]):
        drive = np.tanh(weights @ states[step] + inward @ (1.0, 2.0 * phase - 1.0))
        states[step + 1] = (1.0 - leak) * states[step] + leak * drive
    directions, sizes, _ = np.linalg.svd(np.column_stack([np.ones(STEPS + 1), states]), full_matrices=False)
    return np.ascontiguousarray(directions[:, sizes > _MIN_SIZE * sizes[0]])

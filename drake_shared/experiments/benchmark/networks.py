"""The network of a CNMP in torch, torch.compile and onnxruntime, and its matrix products in numpy alone.

Each network takes the encoder's input for one observation and returns the raw output of the decoder for the
last queries of the learner's grid.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch.nn import functional

from drake_shared.learners.cnmp.layers import time_features
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.fields import Layer

Floats = NDArray[np.float32]
Network = Callable[[Floats], Floats]
"""From the encoder's input (1, F + 2) to mean and raw spread (Q, 4), normalised."""


class Predictor:
    """A network with the code around it that a prediction needs, the same for every contender.

    Args:
        model: The learner's model.
        first: Index of the first query on its grid.
        make: Makes the network.
    """

    def __init__(self, model: CnmpLearner, first: int, make: Callable[[CnmpLearner, int], Network]) -> None:
        self._model = model
        self._reference = model.reference[first:]
        self.network = make(model, first)

    def encode(self, time: float, position: ArrayLike) -> Floats:
        """The encoder's input (1, F + 2) for a position (2,) in [m], observed at ``time``, in [s]."""
        model = self._model
        features = time_features([time], float(model.grid[-1]), model.harmonics)
        reference = [np.interp(time, model.grid, model.reference[:, axis]) for axis in (0, 1)]
        offset = (np.asarray(position) - reference) / model.scale
        return np.concatenate([features, offset[None]], axis=1).astype(np.float32)

    def predict(self, time: float, position: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean (Q, 2) in [m] and variance (Q, 2) in [m^2], without the variance for unfamiliar positions."""
        raw = self.network(self.encode(time, position)).astype(np.float64)
        mean = raw[:, :2] * self._model.scale + self._reference
        sigma = np.logaddexp(raw[:, 2:], 0.0) * self._model.scale + self._model.sigma_floor
        sigma *= self._model.sigma_scale
        return mean, sigma * sigma


class TorchNetwork(torch.nn.Module):
    """The network in torch.

    Args:
        model: The learner's model.
        first: Index of the first query on its grid.
        precompute: Whether the part of the decoder's first layer that depends on time alone is computed in
            advance, as the learner does; published codes concatenate the code and the time of every query.
    """

    by_time: torch.Tensor
    by_code: torch.Tensor

    def __init__(self, model: CnmpLearner, first: int, *, precompute: bool) -> None:
        super().__init__()
        self.encoder, self.decoder = _sequential(model.encoder), _sequential(model.decoder)
        self.bayesian = model.aggregation == "bayesian"
        self.precompute = precompute
        code_size = model.encoder[-1][1].size
        features = time_features(model.grid[first:], float(model.grid[-1]), model.harmonics)
        by_time = torch.from_numpy(features.astype(np.float32))
        if precompute:
            weights, bias = map(torch.from_numpy, model.decoder[0])
            by_time = by_time @ weights[code_size:] + bias
            self.register_buffer("by_code", weights[:code_size].T.contiguous())
        self.register_buffer("by_time", by_time)

    def forward(self, encoded: torch.Tensor) -> torch.Tensor:
        """From the encoder's input (1, F + 2) to the decoder's output (Q, 4)."""
        code = self.encoder(encoded)
        if self.bayesian:
            mean, raw = code.chunk(2, dim=1)
            precision = functional.softplus(raw)
            variance = 1.0 / (1.0 + precision)
            code = torch.cat([variance * precision * mean, variance], dim=1)
        if self.precompute:
            output: torch.Tensor = self.decoder[1:](self.by_time + functional.linear(code, self.by_code))
        else:
            output = self.decoder(torch.cat([code.expand(len(self.by_time), -1), self.by_time], dim=1))
        return output


def make_published(model: CnmpLearner, first: int) -> Network:
    """The network in torch as published codes have it, in eager mode."""
    return _numpy_in_and_out(TorchNetwork(model, first, precompute=False))


def make_torch(model: CnmpLearner, first: int) -> Network:
    """The network in torch with the time part precomputed, in eager mode."""
    return _numpy_in_and_out(TorchNetwork(model, first, precompute=True))


def make_compiled(model: CnmpLearner, first: int) -> Network:
    """The same network compiled by torch.compile, which needs a C++ compiler."""
    return _numpy_in_and_out(torch.compile(TorchNetwork(model, first, precompute=True), dynamic=False))


def make_onnx(model: CnmpLearner, first: int) -> Network:
    """The same network in onnxruntime, on one thread."""
    import onnxruntime

    example = torch.zeros(1, model.encoder[0][0].shape[0])
    module = TorchNetwork(model, first, precompute=True).eval()
    with warnings.catch_warnings():
        # The exporter itself uses deprecated functions.
        warnings.simplefilter("ignore")
        program = torch.onnx.export(module, (example,), input_names=["encoded"], dynamo=True, verbose=False)
    assert program is not None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(
        program.model_proto.SerializeToString(), options, providers=["CPUExecutionProvider"]
    )

    def run(encoded: Floats) -> Floats:
        output: Floats = session.run(None, {"encoded": encoded})[0]
        return output

    return run


def matrix_shapes(model: CnmpLearner, first: int, *, precompute: bool) -> list[tuple[int, int, int]]:
    """Rows, inputs and outputs of each matrix product of a prediction from one observation."""
    queries = len(model.grid) - first
    shapes = [(1, *weights.shape) for weights, _ in model.encoder]
    (inputs, hidden), *rest = (weights.shape for weights, _ in model.decoder)
    code_size = model.encoder[-1][1].size
    shapes.append((1, code_size, hidden) if precompute else (queries, inputs, hidden))
    return [*shapes, *((queries, *shape) for shape in rest)]


def make_products(model: CnmpLearner, first: int, *, precompute: bool) -> Callable[[], None]:
    """The matrix products of a prediction in float32, into arrays allocated in advance, and nothing else."""
    products = [
        (np.ones((rows, inputs), np.float32), np.ones((inputs, outputs), np.float32))
        for rows, inputs, outputs in matrix_shapes(model, first, precompute=precompute)
    ]
    results = [left @ right for left, right in products]

    def multiply() -> None:
        for (left, right), out in zip(products, results, strict=True):
            np.matmul(left, right, out=out)

    return multiply


def _sequential(layers: Sequence[Layer]) -> torch.nn.Sequential:
    modules: list[torch.nn.Module] = []
    for weights, bias in layers:
        layer = torch.nn.Linear(*weights.shape)
        layer.load_state_dict({"weight": torch.tensor(weights.T), "bias": torch.tensor(bias)})
        modules += [layer, torch.nn.ReLU()]
    return torch.nn.Sequential(*modules[:-1])


def _numpy_in_and_out(module: Callable[[torch.Tensor], torch.Tensor]) -> Network:
    def run(encoded: Floats) -> Floats:
        with torch.inference_mode():
            output: Floats = module(torch.from_numpy(encoded)).numpy()
            return output

    return run

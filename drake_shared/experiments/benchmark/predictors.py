"""The arithmetic of a CNMP's prediction by other means: bare numpy products, torch, torch.compile, ONNX.

Each takes one observation and gives the raw output of the decoder for the last queries of the learner's
grid. All but the plain network in torch, which is what published codes do, know what the learner knows: the
time part of the decoder's first layer does not depend on the observation and is computed beforehand.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from drake_shared.learners.cnmp.model import CnmpModel
from drake_shared.learners.cnmp.time_features import time_features
from drake_shared.learners.layers import aggregate

Floats = NDArray[np.float32]
_ONE = np.ones((1, 1), np.float32)
Network = Callable[[Floats], Floats]
"""Takes the encoder's input (1, F + 2), gives mean and raw spread (Q, 4), normalised."""


class Predictor:
    """A network, with what makes a prediction of it: the same for every contender.

    Args:
        model: What the learner predicts by.
        first: Index of the first query on its grid.
        make: Makes the network from both.
    """

    def __init__(self, model: CnmpModel, first: int, make: Callable[[CnmpModel, int], Network]) -> None:
        self._model = model
        self._reference = model.reference[first:]
        self.network = make(model, first)

    def encode(self, time: float, position: ArrayLike) -> Floats:
        """The encoder's input (1, F + 2) for a position (2,) in [m], seen at ``time``, in [s]."""
        model = self._model
        features = time_features([time], float(model.grid[-1]), model.harmonics)
        where = [np.interp(time, model.grid, model.reference[:, axis]) for axis in (0, 1)]
        offset = (np.asarray(position) - where) / model.scale
        return np.concatenate([features, offset[None]], axis=1).astype(np.float32)

    def predict(self, time: float, position: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean (Q, 2), in [m], and variance (Q, 2), in [m^2]; without what distance from the data adds."""
        raw = self.network(self.encode(time, position)).astype(np.float64)
        mean = raw[:, :2] * self._model.scale + self._reference
        sigma = np.logaddexp(raw[:, 2:], 0.0) * self._model.scale + self._model.sigma_floor
        sigma *= self._model.sigma_scale
        return mean, sigma * sigma


def time_part(model: CnmpModel, first: int) -> Floats:
    """What time alone adds to the decoder's first layer, for the grid from ``first`` on; (Q, H)."""
    weights, bias = model.decoder[0]
    code_size = model.encoder[-1][0].shape[1]
    features = time_features(model.grid[first:], float(model.grid[-1]), model.harmonics)
    return features.astype(np.float32) @ weights[code_size:] + bias


def code_weights(model: CnmpModel) -> Floats:
    """The code's part of the decoder's first layer, (R, H)."""
    code_size = model.encoder[-1][0].shape[1]
    return np.ascontiguousarray(model.decoder[0][0][:code_size])


class BareProducts:
    """The matrix products of a prediction, in float32 and into arrays made beforehand.

    Calling it computes the network; :meth:`multiply` does nothing but the products, of the same arrays.
    """

    def __init__(self, model: CnmpModel, first: int) -> None:
        self._aggregation = model.aggregation
        self._hidden = time_part(model, first)
        self._inner = [*model.encoder, (code_weights(model), None)]
        self._outer = model.decoder[1:]
        rows = np.zeros((1, model.encoder[0][0].shape[0]), np.float32)
        self._products: list[tuple[Floats, Floats, Floats]] = []
        for weights, _ in self._inner:
            self._products.append((rows, weights, np.zeros((1, weights.shape[1]), np.float32)))
            rows = self._products[-1][2]
        rows = self._after_first = np.zeros_like(self._hidden)
        for weights, _ in self._outer:
            self._products.append((rows, weights, np.zeros((len(rows), weights.shape[1]), np.float32)))
            rows = self._products[-1][2]

    def multiply(self) -> None:
        """The products alone."""
        for rows, weights, out in self._products:
            np.matmul(rows, weights, out=out)

    def __call__(self, encoded: Floats) -> Floats:
        """The network; see `Network`."""
        self._products[0][0][:] = encoded
        count = len(self._inner)
        for index, (rows, weights, out) in enumerate(self._products[:count]):
            np.matmul(rows, weights, out=out)
            bias = self._inner[index][1]
            if bias is not None:
                out += bias
            if index < count - 2:
                np.maximum(out, 0.0, out=out)
            elif index == count - 2:
                out[:] = aggregate(out, self._aggregation)
        np.add(self._hidden, self._products[count - 1][2], out=self._after_first)
        for (rows, weights, out), (_, bias) in zip(self._products[count:], self._outer, strict=True):
            np.maximum(rows, 0.0, out=rows)
            np.matmul(rows, weights, out=out)
            out += bias
        return self._products[-1][2].copy()


class PlainProducts:
    """The matrix products of a network as published codes have it: nothing is known beforehand."""

    def __init__(self, model: CnmpModel, first: int) -> None:
        queries = len(model.grid) - first
        self._products: list[tuple[Floats, Floats, Floats]] = []
        for layers, count in ((model.encoder, 1), (model.decoder, queries)):
            for weights, _ in layers:
                rows = np.ones((count, weights.shape[0]), np.float32)
                self._products.append((rows, weights, np.zeros((count, weights.shape[1]), np.float32)))

    def multiply(self) -> None:
        """The products alone."""
        for rows, weights, out in self._products:
            np.matmul(rows, weights, out=out)


class PlainTorchNetwork(torch.nn.Module):
    """The network in torch as published codes have it: the code stands beside the time of every query."""

    features: torch.Tensor

    def __init__(self, model: CnmpModel, first: int) -> None:
        super().__init__()
        features = time_features(model.grid[first:], float(model.grid[-1]), model.harmonics)
        self.encoder = torch.nn.ModuleList(_linear(weights, bias) for weights, bias in model.encoder)
        self.decoder = torch.nn.ModuleList(_linear(weights, bias) for weights, bias in model.decoder)
        self.register_buffer("features", torch.from_numpy(features.astype(np.float32)))
        self.aggregation = model.aggregation

    def forward(self, encoded: torch.Tensor) -> torch.Tensor:
        """From the encoder's input (1, F + 2) to the decoder's output (Q, 4)."""
        code = _torch_aggregate(_torch_layers(self.encoder, encoded), self.aggregation)
        rows = torch.cat([code.expand(len(self.features), -1), self.features], dim=1)
        return _torch_layers(self.decoder, rows)


class TorchNetwork(torch.nn.Module):
    """The network in torch, with the time part of the decoder's first layer computed beforehand."""

    hidden: torch.Tensor

    def __init__(self, model: CnmpModel, first: int) -> None:
        super().__init__()
        self.encoder = torch.nn.ModuleList(_linear(weights, bias) for weights, bias in model.encoder)
        self.code = _linear(code_weights(model), None)
        self.decoder = torch.nn.ModuleList(_linear(weights, bias) for weights, bias in model.decoder[1:])
        self.register_buffer("hidden", torch.from_numpy(time_part(model, first)))
        self.aggregation = model.aggregation

    def forward(self, encoded: torch.Tensor) -> torch.Tensor:
        """From the encoder's input (1, F + 2) to the decoder's output (Q, 4)."""
        code = _torch_aggregate(_torch_layers(self.encoder, encoded), self.aggregation)
        return _torch_layers(self.decoder, torch.relu(self.hidden + self.code(code)))


def make_plain_torch(model: CnmpModel, first: int) -> Network:
    """The network in torch as published codes have it, run op by op."""
    return _numpy_in_and_out(PlainTorchNetwork(model, first))


def make_torch(model: CnmpModel, first: int) -> Network:
    """The network in torch, run op by op."""
    return _numpy_in_and_out(TorchNetwork(model, first))


def make_compiled(model: CnmpModel, first: int) -> Network:
    """The network compiled by torch.compile, which needs a C++ compiler."""
    return _numpy_in_and_out(torch.compile(TorchNetwork(model, first), dynamic=False))


def make_onnx(model: CnmpModel, first: int) -> Network:
    """The network in onnxruntime, on one thread."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(
        onnx_graph(model, first), options, providers=["CPUExecutionProvider"]
    )

    def run(encoded: Floats) -> Floats:
        return session.run(None, {"encoded": encoded})[0]

    return run


def onnx_graph(model: CnmpModel, first: int) -> bytes:
    """The network as an ONNX file holds it."""
    from onnx import TensorProto, checker, helper, numpy_helper

    nodes, constants = [], []

    def constant(name: str, values: Floats) -> str:
        constants.append(numpy_helper.from_array(np.ascontiguousarray(values), name))
        return name

    def node(kind: str, inputs: list[str], output: str) -> str:
        nodes.append(helper.make_node(kind, inputs, [output]))
        return output

    def layers(stack, prefix: str, rows: str, *, relu_first: bool) -> str:
        for index, (weights, bias) in enumerate(stack):
            if relu_first or index:
                rows = node("Relu", [rows], f"{prefix}{index}_relu")
            inputs = [rows, constant(f"{prefix}{index}_weights", weights)]
            rows = node("Gemm", [*inputs, constant(f"{prefix}{index}_bias", bias)], f"{prefix}{index}")
        return rows

    hidden = time_part(model, first)
    code = layers(model.encoder, "encoder", "encoded", relu_first=False)
    if model.aggregation == "bayesian":
        nodes.append(helper.make_node("Split", [code], ["said", "raw"], axis=1, num_outputs=2))
        precision = node("Softplus", ["raw"], "precision")
        variance = node("Reciprocal", [node("Add", [precision, constant("one", _ONE)], "all")], "variance")
        mean = node("Mul", [node("Mul", [precision, "said"], "weighed"), variance], "mean")
        nodes.append(helper.make_node("Concat", [mean, variance], ["code"], axis=1))
        code = "code"
    code = node("MatMul", [code, constant("code_weights", code_weights(model))], "code_part")
    rows = node("Add", [constant("time_part", hidden), code], "first")
    rows = layers(model.decoder[1:], "decoder", rows, relu_first=True)
    width = model.encoder[0][0].shape[0]
    graph = helper.make_graph(
        nodes,
        "cnmp",
        [helper.make_tensor_value_info("encoded", TensorProto.FLOAT, [1, width])],
        [helper.make_tensor_value_info(rows, TensorProto.FLOAT, [len(hidden), 4])],
        constants,
    )
    file = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    checker.check_model(file)
    return file.SerializeToString()


def _linear(weights: Floats, bias: Floats | None) -> torch.nn.Linear:
    layer = torch.nn.Linear(weights.shape[0], weights.shape[1], bias=bias is not None)
    with torch.no_grad():
        layer.weight.copy_(torch.from_numpy(np.ascontiguousarray(weights.T)))
        if bias is not None:
            layer.bias.copy_(torch.from_numpy(bias))
    return layer


def _torch_layers(layers: torch.nn.ModuleList, rows: torch.Tensor) -> torch.Tensor:
    *inner, last = layers
    for layer in inner:
        rows = torch.relu(layer(rows))
    return last(rows)


def _torch_aggregate(codes: torch.Tensor, aggregation: str) -> torch.Tensor:
    """One code (C,) for all observations (n, C); see `drake_shared.learners.cnmp.network.aggregate`."""
    if aggregation == "mean":
        return codes.mean(dim=0)
    said, raw = codes.chunk(2, dim=1)
    precision = torch.nn.functional.softplus(raw)
    variance = 1.0 / (1.0 + precision.sum(dim=0))
    return torch.cat([variance * (precision * said).sum(dim=0), variance])


def _numpy_in_and_out(module: Callable[[torch.Tensor], torch.Tensor]) -> Network:
    def run(encoded: Floats) -> Floats:
        with torch.inference_mode():
            return module(torch.from_numpy(encoded)).numpy()

    return run

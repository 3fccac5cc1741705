"""Tiny ONNX models for tests: constant outputs of any shape, and one that finds painted blobs exactly."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

KINDS = {"float": TensorProto.FLOAT, "int32": TensorProto.INT32, "uint8": TensorProto.UINT8}


def constant_model(
    path: Path, outputs: dict[str, NDArray], *, shape: Sequence[int | str] = (1, 3, 64, 64), kind: str = "float"
) -> Path:
    """Write a model that takes a picture and gives the same outputs for all of them."""
    nodes, ports = [], []
    for name, values in outputs.items():
        tensor = numpy_helper.from_array(np.ascontiguousarray(values), name)
        nodes.append(helper.make_node("Constant", [], [name], value=tensor))
        ports.append(helper.make_tensor_value_info(name, tensor.data_type, list(values.shape)))
    picture = helper.make_tensor_value_info("picture", KINDS[kind], list(shape))
    return _written(path, helper.make_graph(nodes, "constant", [picture], ports))


def _written(path: Path, graph: onnx.GraphProto) -> Path:
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path

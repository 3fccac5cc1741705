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
    path: Path,
    outputs: dict[str, NDArray],
    *,
    shape: Sequence[int | str] = (1, 3, 64, 64),
    kind: str = "float",
    beside: dict[str, Sequence[int]] | None = None,
) -> Path:
    """Write a model that takes a picture, and whole numbers `beside` it, and gives the same outputs for all of them."""
    nodes, ports = [], []
    for name, values in outputs.items():
        tensor = numpy_helper.from_array(np.ascontiguousarray(values), name)
        nodes.append(helper.make_node("Constant", [], [name], value=tensor))
        ports.append(helper.make_tensor_value_info(name, tensor.data_type, list(values.shape)))
    picture = helper.make_tensor_value_info("picture", KINDS[kind], list(shape))
    others = [helper.make_tensor_value_info(n, TensorProto.INT64, list(s)) for n, s in (beside or {}).items()]
    return _written(path, helper.make_graph(nodes, "constant", [picture, *others], ports))


def _written(path: Path, graph: onnx.GraphProto) -> Path:
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path


def blob_model(path: Path, colours: Sequence[tuple[int, int, int]], size_px: tuple[int, int]) -> Path:
    """Write a model that finds the box of all pixels of each colour exactly: rows of corners, score and class.

    Args:
        path: File to write.
        colours: Red, green, blue of each person, far from each other and from the ground.
        size_px: Width and height of its input.
    """
    n, (width, height) = len(colours), size_px
    constants = {
        "colours": np.array(colours, dtype=np.float32).reshape(n, 3, 1, 1) / 255,
        "near": np.array(0.15, dtype=np.float32),
        "one": np.array(1.0, dtype=np.float32),
        "of_colour": np.array([1], dtype=np.int64),
        "of_rows": np.array([1], dtype=np.int64),
        "of_columns": np.array([2], dtype=np.int64),
        "of_picture": np.array([1, 2], dtype=np.int64),
        "person": np.zeros((n, 1), dtype=np.float32),
        "first": np.array([0], dtype=np.int64),
    }
    node = helper.make_node
    nodes = [
        node("Sub", ["picture", "colours"], ["off"]),
        node("Abs", ["off"], ["apart"]),
        node("ReduceMax", ["apart"], ["farthest"], axes=[1], keepdims=0),
        node("Less", ["farthest", "near"], ["is_there"]),
        node("Cast", ["is_there"], ["mask"], to=TensorProto.FLOAT),
        node("ReduceMax", ["mask"], ["columns"], axes=[1], keepdims=0),
        node("ReduceMax", ["mask"], ["rows"], axes=[2], keepdims=0),
        node("ReduceMax", ["rows"], ["score"], axes=[1], keepdims=1),
    ]
    sides = []
    for name, profile, is_last in (
        *(("left", "columns", 0), ("top", "rows", 0)),
        *(("right", "columns", 1), ("bottom", "rows", 1)),
    ):
        nodes += [
            node("ArgMax", [profile], [f"{name}_at"], axis=1, keepdims=1, select_last_index=is_last),
            node("Cast", [f"{name}_at"], [f"{name}_px"], to=TensorProto.FLOAT),
        ]
        if is_last:
            nodes.append(node("Add", [f"{name}_px", "one"], [f"{name}_end"]))
        sides.append(f"{name}_end" if is_last else f"{name}_px")
    nodes += [
        node("Concat", [*sides, "score", "person"], ["table"], axis=1),
        node("Unsqueeze", ["table", "first"], ["people"]),
    ]
    used = {name for one in nodes for name in one.input}
    graph = helper.make_graph(
        nodes,
        "blobs",
        [helper.make_tensor_value_info("picture", TensorProto.FLOAT, [1, 3, height, width])],
        [helper.make_tensor_value_info("people", TensorProto.FLOAT, [1, n, 6])],
        [numpy_helper.from_array(values, name) for name, values in constants.items() if name in used],
    )
    return _written(path, graph)

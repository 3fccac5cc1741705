"""A network in a file of ONNX: what goes in and comes out, and its run by onnxruntime on one processor or GPU."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.errors import InputError, UsageError, Where
from vsd_analytics.owners import is_there


@dataclass(frozen=True, slots=True)
class Port:
    """An input or output of a network.

    Attributes:
        name: As the file has it.
        shape: Sizes of its axes; None = any.
        kind: Type of the numbers, such as `float` or `int32`.
    """

    name: str
    shape: tuple[int | None, ...]
    kind: str

    def __str__(self) -> str:
        sizes = ", ".join("?" if size is None else str(size) for size in self.shape)
        return f"{self.name} {self.kind}[{sizes}]"


@dataclass(frozen=True, slots=True)
class Signature:
    """Inputs and outputs of a network, which show of what family it is."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]

    def __str__(self) -> str:
        return f"{', '.join(map(str, self.inputs))} -> {', '.join(map(str, self.outputs))}"

    def output(self, *names: str) -> Port | None:
        """Return the first output with one of some names."""
        return next((port for port in self.outputs if port.name in names), None)

    @property
    def picture_px(self) -> tuple[int, int] | None:
        """Return width and height of the pictures that go in; None where the file leaves them open."""
        shape = self.inputs[0].shape
        if len(shape) != 4:
            return None
        height, width = shape[1:3] if self.is_channels_last else shape[2:4]
        return None if height is None or width is None else (width, height)

    @property
    def is_channels_last(self) -> bool:
        """Return whether colours are the last axis of a picture and not the first."""
        shape = self.inputs[0].shape
        return len(shape) == 4 and shape[3] in {1, 3} and shape[1] not in {1, 3}


NO_TELEMETRY: Final = "ORT_DISABLE_TELEMETRY"
"""Without this variable, set before it is loaded, onnxruntime keeps a file of events and sends it to its maker."""


class Network:
    """A network ready to run.

    Args:
        path: A file of ONNX.
        providers: Names of onnxruntime's execution providers, the first that is there is taken; None = the GPU's
            where the installed onnxruntime has one, else the processor's.
        n_threads: Processor threads.

    Raises:
        UsageError: onnxruntime is not installed, or has none of the providers (E101).
        InputError: There is no such file (E201), or it is no network that can be run (E215).
    """

    def __init__(self, path: Path, *, providers: Sequence[str] | None = None, n_threads: int = 1) -> None:
        os.environ[NO_TELEMETRY] = "1"
        try:
            import onnxruntime
        except ImportError as error:
            raise UsageError(
                "a detector needs more packages", why=str(error), fix="pip install 'vsd-analytics[detector]'"
            ) from None
        if not is_there(path):
            raise InputError(f"there is no file {path}", code="E201", where=Where(str(path)), fix="check the path")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = n_threads
        options.inter_op_num_threads = 1
        options.log_severity_level = 3
        chosen = chosen_providers(onnxruntime.get_available_providers(), providers)
        try:
            self._session: Any = onnxruntime.InferenceSession(str(path), options, providers=chosen)
        except Exception as error:  # onnxruntime's own classes have no common root but this
            raise InputError(
                f"cannot run {path.name} as a network",
                code="E215",
                where=Where(str(path)),
                why=str(error).splitlines()[0][:300],
                fix="give a model exported to ONNX",
            ) from None
        self.path = path
        self.signature = Signature(
            tuple(_port(port) for port in self._session.get_inputs()),
            tuple(_port(port) for port in self._session.get_outputs()),
        )

    @property
    def provider(self) -> str:
        """Return the execution provider that runs it."""
        return str(self._session.get_providers()[0])

    def run(self, inputs: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return all outputs by name.

        Raises:
            InputError: The network fails on this input (E215).
        """
        names = [port.name for port in self.signature.outputs]
        try:
            values = self._session.run(names, dict(inputs))
        except Exception as error:
            raise InputError(
                f"{self.path.name} fails on a picture",
                code="E215",
                where=Where(str(self.path)),
                why=str(error).splitlines()[0][:300],
                fix="vsd engine probe shows what is understood; say otherwise in a TOML beside the model",
            ) from None
        return dict(zip(names, map(np.asarray, values), strict=True))


GPU_PROVIDERS = ("CUDAExecutionProvider", "ROCMExecutionProvider", "CoreMLExecutionProvider")
"""Taken by themselves, in this order. TensorRT compiles for minutes, so only who asks gets it."""


def chosen_providers(available: Sequence[str], wanted: Sequence[str] | None) -> list[str]:
    """Return the execution providers to use, the best first.

    Args:
        available: Of the installed onnxruntime.
        wanted: Names, with or without `ExecutionProvider`; None = a GPU where there is one, else the processor.

    Raises:
        UsageError: A provider is not there (E101).
    """
    processor = "CPUExecutionProvider"
    if wanted is None:
        return [*(name for name in GPU_PROVIDERS if name in available), processor]
    by_name = {name.lower().removesuffix("executionprovider"): name for name in available}
    short = [name.lower().removesuffix("executionprovider") for name in wanted]
    if missing := [name for name, key in zip(wanted, short, strict=True) if key not in by_name]:
        raise UsageError(
            f"onnxruntime has no provider {missing[0]!r} here",
            why=f"it has {', '.join(sorted(by_name))}",
            fix="install the onnxruntime of that device, such as onnxruntime-gpu, or leave out --provider",
        )
    return list(dict.fromkeys([*(by_name[key] for key in short), processor]))


def _port(port: Any) -> Port:
    shape = tuple(size if isinstance(size, int) and size > 0 else None for size in port.shape)
    return Port(port.name, shape, port.type.removeprefix("tensor(").removesuffix(")"))

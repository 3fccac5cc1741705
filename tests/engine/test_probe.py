"""`vsd engine probe`, and where a network runs."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from engine.blob_video import COLOURS, SIZE, Walk, box_of, painted
from engine.detector_models import blob_model, constant_model
from engine.vsd_in_a_shop import Vsd, in_shop

from vsd_analytics.engine.network import Network, chosen_providers
from vsd_analytics.errors import UsageError


@pytest.fixture
def vsd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    blob_model(tmp_path / "blobs.onnx", COLOURS[:2], SIZE)
    cv2.imwrite(str(tmp_path / "door.png"), painted([Walk(lambda _: (0.0, 8.0))], 0.0))
    return in_shop(tmp_path, capsys)  # there is no vsd.toml: a probe needs none


def test_probe_says_what_it_understood_and_draws_whom_it_found(tmp_path: Path, vsd: Vsd) -> None:
    code, printed, err = vsd("engine", "probe", str(tmp_path / "blobs.onnx"), str(tmp_path / "door.png"))
    assert (code, err) == (0, "")
    left, top, right, bottom = box_of((0.0, 8.0))
    assert "blobs.onnx: yolo, boxes" in printed
    assert "picture float[1, 3, 240, 320] -> people float[1, 2, 6]" in printed
    assert "door.png: 1 people" not in printed
    assert f"score 1.00  {left}, {top} to {right}, {bottom}" in printed
    drawn = cv2.imread(str(tmp_path / "door-probe.jpg"))
    assert drawn.shape == (SIZE[1], SIZE[0], 3)
    edge = drawn[(top + bottom) // 2, left - 1 : left + 2].astype(int)
    assert (edge[:, 0] - edge[:, 2]).max() > 60  # blue, where the box's edge is
    code, printed, _ = vsd("engine", "probe", str(tmp_path / "blobs.onnx"), str(tmp_path / "door.png"), "--json")
    assert json.loads(printed)["people"][0]["box_px"] == [left, top, right, bottom]


def test_probe_of_an_empty_picture_says_what_to_try(tmp_path: Path, vsd: Vsd) -> None:
    cv2.imwrite(str(tmp_path / "empty.png"), painted([], 0.0))
    code, printed, err = vsd("engine", "probe", str(tmp_path / "blobs.onnx"), str(tmp_path / "empty.png"))
    assert code == 0
    assert "empty.png: 0 people" in printed
    assert "--score 0.2" in err
    assert "blobs.toml" in err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["blobs.onnx", "none.png"], "there is no file"),
        (["none.onnx", "door.png"], "there is no file"),
        (["blobs.onnx", "blobs.onnx"], "cannot read blobs.onnx as a picture"),
        (["blobs.onnx", "door.png", "--out", "door.png"], "--out is the picture itself"),
        (["plain.onnx", "door.png"], "no known family"),
    ],
)
def test_what_cannot_be_probed_is_refused(
    words: list[str], says: str, tmp_path: Path, vsd: Vsd, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    constant_model(tmp_path / "plain.onnx", {"x": np.zeros((2, 2), dtype=np.float32)})
    code, _, err = vsd("engine", "probe", *words)
    assert code == 2
    assert says in err


def test_a_gpu_is_taken_where_there_is_one_and_what_is_asked_for_must_be_there() -> None:
    gpu, processor = "CUDAExecutionProvider", "CPUExecutionProvider"
    assert chosen_providers([processor], None) == [processor]
    assert chosen_providers(["TensorrtExecutionProvider", gpu, processor], None) == [gpu, processor]
    assert chosen_providers([gpu, processor], ["cpu"]) == [processor]
    assert chosen_providers([gpu, processor], ["CUDAExecutionProvider"]) == [gpu, processor]
    with pytest.raises(UsageError, match="no provider 'cuda'"):
        chosen_providers([processor], ["cuda"])


def test_the_network_is_given_to_the_provider_that_was_chosen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import onnxruntime

    given: list[list[str]] = []
    plain = onnxruntime.InferenceSession

    def on_a_fake_gpu(path: str, options: object, *, providers: list[str]) -> object:
        given.append(providers)
        return plain(path, options, providers=["CPUExecutionProvider"])

    available = ["CUDAExecutionProvider", "CPUExecutionProvider"]
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: available)
    monkeypatch.setattr(onnxruntime, "InferenceSession", on_a_fake_gpu)
    Network(blob_model(tmp_path / "blobs.onnx", COLOURS[:1], SIZE))
    assert given == [available]


def test_without_onnxruntime_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(UsageError) as refused:
        Network(tmp_path / "blobs.onnx")
    assert refused.value.fix == "pip install 'vsd-analytics[detector]'"

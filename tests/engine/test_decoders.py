"""What comes out of each family of networks, against outputs that its rule of encoding makes of known people."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from engine.detector_models import constant_model
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vsd_analytics.engine.decoders.cells import cells_of
from vsd_analytics.engine.decoders.families import FAMILIES
from vsd_analytics.engine.detector import Detector
from vsd_analytics.engine.people import COCO_17
from vsd_analytics.errors import InputError

SIZE = (128, 96)
"""Width and height differ, so that none stands for the other."""
PERSON, DOG = 0, 1
Outputs = dict[str, NDArray]


class Known:
    """People whose boxes, scores and joints are known, in pixels of the input; and a dog that is none."""

    def __init__(self, seed: int, n: int = 3) -> None:
        rng = np.random.default_rng(seed)
        # one a column, so that no two share a cell or overlap
        left = np.arange(n) * 40.0 + rng.uniform(2, 8, n)
        top = rng.uniform(5, 20, n)
        self.box = np.column_stack([left, top, left + rng.uniform(18, 26, n), top + rng.uniform(40, 60, n)])
        self.score = rng.uniform(0.6, 0.95, n)
        self.joints = (
            self.box[:, None, :2] + rng.uniform(0.1, 0.9, (n, 17, 2)) * (self.box[:, 2:] - self.box[:, :2])[:, None]
        )
        self.joint_score = np.where(rng.random((n, 17)) < 0.3, 0.1, 0.9)

    @property
    def middle(self) -> NDArray:
        return (self.box[:, :2] + self.box[:, 2:]) / 2

    @property
    def size(self) -> NDArray:
        return self.box[:, 2:] - self.box[:, :2]


def row_of(known: Known, corner: NDArray, stride: NDArray, *, to_middle_px: float = 8) -> list[int]:
    """Return the cell of stride 16 that is nearest to each person's middle."""
    centre = corner + to_middle_px
    at = [np.flatnonzero((stride == 16) & (np.abs(centre - m).max(axis=1) <= 8))[0] for m in known.middle]
    assert len(set(at)) == len(at)
    return at


def class_scores(n_rows: int, rows: list[int], score: NDArray, n_classes: int, person: int) -> NDArray:
    scores = np.full((n_rows, n_classes), 0.01)
    scores[rows, person] = score
    scores[n_rows - 1, (person + 1) % n_classes] = 0.99  # a dog
    return scores


def nanodet(known: Known) -> Outputs:
    corner, stride = cells_of(SIZE, (8, 16, 32), begin=0.0)
    rows = row_of(known, corner, stride)
    scores = class_scores(len(corner), rows, known.score, 80, PERSON)
    bins = np.zeros((len(corner), 4, 11))
    for row, box in zip(rows, known.box, strict=True):
        centre = corner[row] + stride[row] / 2
        for side, length in enumerate(np.r_[centre - box[:2], box[2:] - centre] / stride[row]):
            low = int(length)  # two bins whose mean is the length
            share = np.full(11, 1e-9)
            share[low], share[low + 1] = 1 - (length - low), length - low
            bins[row, side] = np.log(np.maximum(share, 1e-9))
    outputs = {}
    for step in (32, 8, 16):  # no order of the file is relied on
        outputs[f"cls_{step}"] = scores[stride == step][None]
        outputs[f"dis_{step}"] = bins.reshape(len(corner), 44)[stride == step][None]
    return outputs


def nanodet_plus(known: Known) -> Outputs:
    corner, stride = cells_of(SIZE, (8, 16, 32, 64), begin=0.0)
    rows = row_of(known, corner, stride, to_middle_px=0)
    scores = class_scores(len(corner), rows, known.score, 80, PERSON)
    bins = np.zeros((len(corner), 4, 8))
    for row, box in zip(rows, known.box, strict=True):
        for side, length in enumerate(np.r_[corner[row] - box[:2], box[2:] - corner[row]] / stride[row]):
            low = int(length)
            share = np.full(8, 1e-9)
            share[low], share[low + 1] = 1 - (length - low), length - low
            bins[row, side] = np.log(np.maximum(share, 1e-9))
    return {"output": np.concatenate([scores, bins.reshape(len(corner), 32)], axis=1)[None]}


def yolox(known: Known) -> Outputs:
    corner, stride = cells_of(SIZE, (8, 16, 32), begin=0.0)
    rows = row_of(known, corner, stride)
    values = np.zeros((len(corner), 85))
    values[:, 4] = 1.0
    values[:, 5:] = class_scores(len(corner), rows, known.score / 0.99, 80, PERSON)
    values[rows, 4] = 0.99
    values[rows, :2] = (known.middle - corner[rows]) / stride[rows, None]
    values[rows, 2:4] = np.log(known.size / stride[rows, None])
    return {"output": values[None]}


def yolox_in_pixels(known: Known) -> Outputs:
    outputs = yolox(known)["output"]
    corner, stride = cells_of(SIZE, (8, 16, 32), begin=0.0)
    outputs[0, :, :2] = outputs[0, :, :2] * stride[:, None] + corner
    outputs[0, :, 2:4] = np.exp(outputs[0, :, 2:4]) * stride[:, None]
    return {"output": outputs}


def yolo(known: Known) -> Outputs:
    corner, stride = cells_of(SIZE, (8, 16, 32), begin=0.0)
    rows = row_of(known, corner, stride)
    values = np.concatenate(
        [np.full((len(corner), 4), 10.0), class_scores(len(corner), rows, known.score, 80, PERSON)], axis=1
    )
    values[rows, :4] = np.concatenate([known.middle, known.size], axis=1)
    return {"output0": values.T[None]}


def yolo_with_joints(known: Known) -> Outputs:
    corner, stride = cells_of(SIZE, (8, 16, 32), begin=0.0)
    rows = row_of(known, corner, stride)
    values = np.zeros((len(corner), 56))
    values[rows, :4] = np.concatenate([known.middle, known.size], axis=1)
    values[rows, 4] = known.score
    values[rows, 5:] = np.concatenate([known.joints, known.joint_score[..., None]], axis=2).reshape(len(rows), 51)
    return {"output0": values.T[None]}


def yolov5(known: Known) -> Outputs:
    corner, stride = cells_of(SIZE, (8, 16, 32), begin=0.0)
    rows = [row * 3 for row in row_of(known, corner, stride)]
    values = np.zeros((3 * len(corner), 85))
    values[:, 4] = 1.0
    values[:, 5:] = class_scores(len(values), rows, known.score, 80, PERSON)
    values[rows, :4] = np.concatenate([known.middle, known.size], axis=1)
    return {"output0": values[None]}


def final_rows(known: Known, n_columns: int) -> NDArray:
    rows = np.zeros((300, n_columns))
    n = len(known.box)
    rows[:n, :4], rows[:n, 4], rows[:n, 5] = known.box, known.score, PERSON
    rows[n, :6] = [5, 5, 30, 30, 0.9, DOG]
    return rows


def yolo_final(known: Known) -> Outputs:
    return {"output0": final_rows(known, 6)[None]}


def yolo_final_with_joints(known: Known) -> Outputs:
    rows = final_rows(known, 57)
    n = len(known.box)
    rows[:n, 6:] = np.concatenate([known.joints, known.joint_score[..., None]], axis=2).reshape(n, 51)
    return {"output0": rows[None]}


def rtmdet(known: Known) -> Outputs:
    n = len(known.box)
    boxes = np.concatenate([np.column_stack([known.box, known.score]), [[5, 5, 30, 30, 0.9]]])
    return {"dets": boxes[None], "labels": np.array([[PERSON] * n + [DOG]], dtype=np.int64)}


def rtmo(known: Known) -> Outputs:
    joints = np.concatenate([known.joints, known.joint_score[..., None]], axis=2)
    return {"dets": np.column_stack([known.box, known.score])[None], "keypoints": joints[None]}


def queries(known: Known, n_classes: int, person: int, *, names: tuple[str, str], softmax: bool = False) -> Outputs:
    n, n_queries = len(known.box), 20
    boxes = np.full((n_queries, 4), 0.5)
    boxes[:n] = np.concatenate([known.middle, known.size], axis=1) / np.tile(SIZE, 2)
    if softmax:
        logits = np.full((n_queries, n_classes), -20.0)
        logits[:, -1] = 0.0  # nobody
        logits[:n, person] = np.log(known.score / (1 - known.score))
    else:
        logits = np.full((n_queries, n_classes), -8.0)
        logits[:n, person] = np.log(known.score / (1 - known.score))
    logits[n, person + 1] = 3.0  # a dog
    return {names[0]: boxes[None], names[1]: logits[None]}


def rfdetr(known: Known) -> Outputs:
    return queries(known, 91, 1, names=("dets", "labels"))


def rtdetr(known: Known) -> Outputs:
    return dict(reversed(queries(known, 80, 0, names=("pred_boxes", "logits")).items()))


def detr(known: Known) -> Outputs:
    return queries(known, 92, 1, names=("pred_boxes", "logits"), softmax=True)


def movenet(known: Known) -> Outputs:
    rows, n = np.zeros((6, 56)), len(known.box)
    size = np.array(SIZE)
    joints = np.concatenate([(known.joints / size)[..., ::-1], known.joint_score[..., None]], axis=2)
    rows[:n, :51] = joints.reshape(n, 51)
    rows[:n, 51:55] = (known.box / np.tile(size, 2))[:, [1, 0, 3, 2]]
    rows[:n, 55] = known.score
    return {"output_0": rows[None]}


NCHW, NHWC = (1, 3, SIZE[1], SIZE[0]), (1, SIZE[1], SIZE[0], 3)
ENCODERS: dict[str, tuple[Callable[[Known], Outputs], str, bool]] = {
    "NanoDet": (nanodet, "nanodet", False),
    "NanoDet-Plus": (nanodet_plus, "nanodet", False),
    "YOLOX": (yolox, "yolox", False),
    "YOLOX in pixels": (yolox_in_pixels, "yolox", False),
    "YOLO": (yolo, "yolo", False),
    "YOLO with joints": (yolo_with_joints, "yolo", True),
    "YOLOv5": (yolov5, "yolo", False),
    "YOLO, final": (yolo_final, "yolo", False),
    "YOLO, final, with joints": (yolo_final_with_joints, "yolo", True),
    "RTMDet": (rtmdet, "rtmdet", False),
    "RTMO": (rtmo, "rtmo", True),
    "RF-DETR": (rfdetr, "detr", False),
    "RT-DETR": (rtdetr, "detr", False),
    "DETR": (detr, "detr", False),
    "MoveNet": (movenet, "movenet", True),
}


def model_of(path: Path, name: str, known: Known) -> Path:
    outputs = {
        key: values if values.dtype.kind == "i" else values.astype(np.float32)
        for key, values in ENCODERS[name][0](known).items()
    }
    is_movenet = name == "MoveNet"
    return constant_model(path, outputs, shape=NHWC if is_movenet else NCHW, kind="int32" if is_movenet else "float")


@pytest.mark.parametrize("name", ENCODERS)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_signature_chooses_the_decoder_and_its_people_are_the_encoded_ones(
    name: str, seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    known = Known(seed)
    _, family, has_joints = ENCODERS[name]
    detector = Detector(model_of(tmp_path_factory.mktemp("model") / "model.onnx", name, known))
    assert (detector.decoder.family, detector.decoder.has_joints) == (family, has_joints)
    found = detector.people(np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8))
    order = np.argsort(found.box[:, 0])
    np.testing.assert_allclose(found.box[order], known.box, atol=0.02)
    np.testing.assert_allclose(found.score[order], known.score, atol=1e-4)
    if not has_joints:
        assert not np.isfinite(found.joints).any()
        return
    sure = known.joint_score > 0.5
    of_coco = found.joints[order][:, list(COCO_17)]
    np.testing.assert_allclose(of_coco[sure], known.joints[sure], atol=0.02)
    assert np.isnan(of_coco[~sure]).all()


@pytest.mark.parametrize("name", ENCODERS)
def test_a_picture_with_nobody_on_it_has_nobody(name: str, tmp_path: Path) -> None:
    detector = Detector(model_of(tmp_path / "model.onnx", name, Known(3)), least_score=0.99)
    found = detector.people(np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8))
    assert (found.box.shape, len(found.score), found.joints.shape[0]) == ((0, 4), 0, 0)


@pytest.mark.parametrize("name", ENCODERS)
def test_people_are_in_pixels_of_a_picture_of_another_size_and_shape(name: str, tmp_path: Path) -> None:
    known = Known(3)
    detector = Detector(model_of(tmp_path / "model.onnx", name, known))
    picture = np.zeros((384, 384, 3), dtype=np.uint8)  # higher than the input's proportions
    found = detector.people(picture)
    order = np.argsort(found.box[:, 0])
    match detector.decoder.preparation.fit:
        case "stretch":
            expected = known.box * np.tile([384 / SIZE[0], 384 / SIZE[1]], 2)
        case "centre":
            expected = (known.box - [16, 0, 16, 0]) * 4
        case _:
            expected = known.box * 4
    inside = np.clip(expected, 0, 384)
    seen = (inside[:, 2] - inside[:, 0] >= 1) & (inside[:, 3] - inside[:, 1] >= 1)
    np.testing.assert_allclose(found.box[order], inside[seen], atol=0.1)


def test_a_model_of_no_family_is_refused_with_its_signature_and_notes_that_make_it_work(tmp_path: Path) -> None:
    known = Known(5)
    rows = np.column_stack([known.score, known.box[:, :2], known.size]).astype(np.float32)
    model = constant_model(tmp_path / "mine.onnx", {"people": rows}, shape=NCHW)
    with pytest.raises(InputError) as refused:
        Detector(model)
    assert refused.value.code == "E216"
    assert "picture float[1, 3, 96, 128] -> people float[3, 5]" in str(refused.value.why)
    fix = str(refused.value.fix)
    assert "mine.toml" in fix
    notes = "\n".join(fix.splitlines()[1:])
    notes = notes.replace('"people[0:4]"', '"people[1:5]"').replace('"people[4]"', '"people[0]"')
    notes = notes.replace('layout = "corners"', 'layout = "size"')
    (tmp_path / "mine.toml").write_text(notes)
    found = Detector(model).people(np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8))
    np.testing.assert_allclose(found.box[np.argsort(found.box[:, 0])], known.box, atol=0.01)


@pytest.mark.parametrize(
    ("notes", "says"),
    [
        ("family = ", "Invalid value"),
        ('famly = "yolo"', "no key 'famly'"),
        ("size_px = [64]", "size_px must be 2 numbers"),
        ("sd = [0, 1, 1]", "sd must be 3 numbers"),
        ('fit = "middle"', "corner or centre or stretch"),
        ("person = true", "whole number"),
    ],
)
def test_a_mistake_in_the_notes_is_named(notes: str, says: str, tmp_path: Path) -> None:
    model = model_of(tmp_path / "model.onnx", "YOLO", Known(1))
    (tmp_path / "model.toml").write_text(notes)
    with pytest.raises(InputError) as refused:
        Detector(model)
    assert refused.value.code == "E217"
    assert says in str(refused.value.why)


def test_notes_choose_family_class_and_colours(tmp_path: Path) -> None:
    known = Known(2)
    model = model_of(tmp_path / "model.onnx", "YOLO", known)
    (tmp_path / "model.toml").write_text('person = 1\ncolours = "bgr"\nsize_px = [128, 96]\nfit = "stretch"')
    detector = Detector(model)
    assert (detector.decoder.preparation.is_rgb, detector.decoder.preparation.fit) == (False, "stretch")
    found = detector.people(np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8))
    assert found.score.round(2).tolist() == [0.99]  # the dog
    (tmp_path / "model.toml").write_text('family = "detr"')
    with pytest.raises(InputError, match="no known family"):
        Detector(model)


def test_every_family_is_proved_here() -> None:
    assert {family for _, family, _ in ENCODERS.values()} | {"boxes"} == set(FAMILIES)


def test_a_file_that_is_no_network_is_refused(tmp_path: Path) -> None:
    (tmp_path / "model.onnx").write_bytes(b"no model")
    with pytest.raises(InputError) as refused:
        Detector(tmp_path / "model.onnx")
    assert refused.value.code == "E215"
    with pytest.raises(InputError, match="there is no file"):
        Detector(tmp_path / "other.onnx")


def test_a_network_that_takes_the_size_of_the_picture_gets_it_and_other_inputs_are_refused(tmp_path: Path) -> None:
    known = Known(4)
    outputs = {key: values.astype(np.float32) for key, values in detr(known).items()}
    mask = {"pixel_mask": (1, SIZE[1], SIZE[0])}
    model = constant_model(tmp_path / "detr.onnx", outputs, shape=NCHW, beside=mask)
    assert len(Detector(model).people(np.zeros((SIZE[1], SIZE[0], 3), dtype=np.uint8))) == len(known.box)
    model = constant_model(tmp_path / "asks.onnx", outputs, shape=NCHW, beside={"text": (1, 16)})
    with pytest.raises(InputError) as refused:
        Detector(model)
    assert "it takes more than a picture" in str(refused.value.why)

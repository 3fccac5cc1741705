from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
import pytest

from vsd_analytics.ingest.reading.adapter import Source
from vsd_analytics.simulate.cameras import CAMERAS, NOISE_SD_M
from vsd_analytics.simulate.frame_messages import day_text, track_ids, write_messages
from vsd_analytics.simulate.people import SimulatedDay
from vsd_analytics.simulate.shop import DEPTH_M, SHOP_AFTER, WIDTH_M


class Person(msgspec.Struct, forbid_unknown_fields=True):
    """A person of a frame message, floor metres."""

    id: str
    x_m: float
    y_m: float


class Frame(msgspec.Struct, forbid_unknown_fields=True):
    """The VSD frame message, version 1, as the demo's engine sends it."""

    v: Literal[1]
    camera: str
    ts: datetime
    seq: int
    engine: str
    quality: Literal["metric", "body", "relative"]
    persons: list[Person]


def frames(text: bytes) -> list[Frame]:
    decode = msgspec.json.Decoder(Frame).decode
    return [decode(line) for line in text.splitlines()]


def test_every_message_is_valid_and_every_frame_is_there(after: SimulatedDay) -> None:
    made = day_text(after, CAMERAS[0], seed=1, first_seq=500)
    messages = frames(made.text)
    assert len(messages) == after.n_frames == made.n_messages
    assert [round(m.ts.timestamp() * 1000) for m in messages] == after.frame_ms.tolist()
    assert [m.seq for m in messages] == list(range(500, 500 + after.n_frames))
    assert {m.camera for m in messages} == {"cam-1"}
    assert sum(len(m.persons) for m in messages) == made.n_persons
    assert not messages[0].persons, "heartbeat before opening"
    assert all(len({p.id for p in m.persons}) == len(m.persons) for m in messages)
    assert all(m.ts.utcoffset() is not None for m in messages)


def test_lost_frames_are_absent_and_use_up_their_number(after: SimulatedDay) -> None:
    lost = np.zeros(after.n_frames, dtype=np.bool_)
    lost[1000:2000] = True
    kept, whole = day_text(after, CAMERAS[1], seed=1, lost=lost), day_text(after, CAMERAS[1], seed=1)
    lines = whole.text.splitlines()
    assert kept.text.splitlines() == lines[:1000] + lines[2000:]


def test_each_camera_reports_everybody_in_its_picture_with_noise_of_five_centimetres(before: SimulatedDay) -> None:
    for camera in CAMERAS:
        messages = frames(day_text(before, camera, seed=1).text)
        seen = camera.sees(before.x_m, before.y_m)
        rows = np.flatnonzero(seen)[np.argsort(before.frame[seen], kind="stable")]
        assert [len(m.persons) for m in messages] == np.bincount(before.frame[rows], minlength=before.n_frames).tolist()
        x, y = np.array([[p.x_m, p.y_m] for m in messages for p in m.persons]).T
        for error in (x - before.x_m[rows], y - before.y_m[rows]):
            assert abs(error.mean()) < 0.001
            assert error.std() == pytest.approx(NOISE_SD_M, rel=0.02)


def test_cameras_overlap_with_independent_noise_and_see_most_of_the_floor() -> None:
    xs, ys = np.meshgrid(np.arange(0.05, WIDTH_M, 0.1), np.arange(0.05, DEPTH_M, 0.1))
    free = SHOP_AFTER.is_free(xs, ys)
    n_cameras = np.sum([c.sees(xs, ys) for c in CAMERAS], axis=0)
    assert 0.8 < (n_cameras > 0)[free].mean() < 0.97
    assert n_cameras[free].max() >= 3
    storeroom = (xs > 20.5) & (ys > 11.5)
    assert not n_cameras[storeroom].any()
    assert not n_cameras[(xs > 23) & (ys < 2)].any()


def test_track_ids_change_when_somebody_comes_back_into_view() -> None:
    person = np.array([0, 0, 0, 0, 1, 1, 2])
    frame = np.array([5, 6, 9, 10, 2, 3, 3])
    assert track_ids(person, frame).tolist() == [3, 3, 4, 4, 1, 1, 2]
    assert len(track_ids(np.zeros(0, np.int64), np.zeros(0, np.int64))) == 0


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda c: c.camera_id)
def test_homography_takes_pixels_back_to_the_floor(camera) -> None:  # type: ignore[no-untyped-def]
    xs, ys = (v.ravel() for v in np.meshgrid(np.linspace(0, WIDTH_M, 49), np.linspace(0, DEPTH_M, 33)))
    seen = camera.sees(xs, ys)
    u, v, _ = camera.project(xs[seen], ys[seen], np.zeros(seen.sum()))
    x, y, w = camera.homography @ np.stack([u, v, np.ones_like(u)])
    assert x / w == pytest.approx(xs[seen], abs=1e-6)
    assert y / w == pytest.approx(ys[seen], abs=1e-6)
    assert u.max() - u.min() > 1000, "the floor fills the picture"
    # the picture lies below the horizon, so what it shows of the floor is bounded
    corners = camera.homography @ np.array([[0, 1280, 0, 1280], [0, 0, 720, 720], [1, 1, 1, 1.0]])
    assert (np.sign(corners[2]) == np.sign(corners[2][0])).all()


@pytest.mark.parametrize("name", ["a.jsonl", "a.jsonl.gz", "a.jsonl.zst"])
def test_written_messages_read_back(tmp_path: Path, name: str) -> None:
    messages = [{"v": 1, "camera": "cam-1", "persons": []}, {"v": 1, "camera": "cam-2", "persons": [{"id": "<b>"}]}]
    path = write_messages(tmp_path / "new" / name, messages)
    first = path.read_bytes()
    with Source(path).open() as f:
        assert [msgspec.json.decode(line) for line in f.read().splitlines()] == messages
    assert write_messages(path, messages).read_bytes() == first

"""Processor milliseconds a frame from a picture to the store, step by step.

Run `VSD_REALDATA=... python tests/benchmarks/bench_detector.py`; the table is in docs/detectors.md. The Oxford clip
goes through NanoDet with one thread. Times are of the processor, so that other programs on the machine matter little.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from vsd_analytics.cli.detection import store_messages
from vsd_analytics.cli.project import Project
from vsd_analytics.engine.bodies import Bodies, body_sizes_px, people_with_bodies
from vsd_analytics.engine.detections import joined
from vsd_analytics.engine.detector import Detector, within
from vsd_analytics.engine.floor_method import locate
from vsd_analytics.engine.messages import frame_messages
from vsd_analytics.engine.people_of_pictures import PeopleOfPictures, SeenFrame
from vsd_analytics.engine.pictures import VideoFile
from vsd_analytics.engine.suppression import each_once
from vsd_analytics.engine.tiles import tiles_for
from vsd_analytics.engine.tracker import tracked

SITE = """[site]
id = "street"
name = "Street"
timezone = "Europe/London"
[[floor]]
id = "ground"
name = "Ground"
[[camera]]
id = "cam-1"
name = "Street"
"""
spent_s: defaultdict[str, float] = defaultdict(float)


@contextmanager
def spent(step: str) -> Iterator[None]:
    begin = time.process_time()
    yield
    spent_s[step] += time.process_time() - begin


def main() -> None:
    data = Path(os.environ.get("VSD_REALDATA") or Path(__file__).parents[3] / "shared" / "data")
    matrix = np.loadtxt(data / "oxtown" / "H_image_to_ground_m.txt")
    detector = Detector(data / "detector_models" / "nanodet_416.onnx")
    video = VideoFile(data / "oxtown" / "oxford_clip_frames_0_99.mp4")
    tiles = tiles_for(video.size_px, input_px=(416, 416), body_px=body_sizes_px(matrix, video.size_px))
    every, shots, preparation = PeopleOfPictures(), video.pictures(25), detector.decoder.preparation
    while True:
        with spent("decode the video"):
            shot = next(shots, None)
        if shot is None or shot.picture is None:
            break
        parts = []
        for tile in tiles:
            with spent(f"prepare the input, {len(tiles)} tiles"):
                tensor, placed = preparation.tensor(tile.cut(shot.picture))
            with spent(f"network, {len(tiles)} tiles"):
                outputs = detector.network.run({detector.network.signature.inputs[0].name: tensor})
            with spent("decode outputs, one box a person"):
                part = within(placed.back(detector.decoder.decode(outputs, least_score=0.45)), tile)
                parts.append(part.rows(~tile.is_cut(part, video.size_px)))
        with spent("decode outputs, one box a person"):
            every.add(SeenFrame(shot.number, shot.ms, each_once(joined(parts))))
    people, n = every.people(), len(every.frames)
    with spent("whole bodies"):
        people = people_with_bodies(people, Bodies(matrix, video.size_px))
    # the tracker works harder at one frame a second: the clip's frames are taken as that
    ts_ms = 1_794_207_600_000 + 1000 * np.arange(n)
    with spent("track ids, at one frame a second"):
        people = tracked(people, homography=matrix, picture_px=video.size_px, ts_ms=ts_ms)
    with spent("places and pairs"):
        seen = locate(replace(people), homography=matrix, picture_px=video.size_px, within_m=4.0, name="known")
        text = b"".join(line + b"\n" for line in frame_messages(seen, camera="cam-1", ts_ms=ts_ms))
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "vsd.toml").write_text(SITE)
        with spent("store"):
            store_messages(Project(folder, now_text="2026-11-20T12:00", quiet=True), text, name="cam-1.jsonl")
    print("| step | ms a frame |\n|---|--:|")
    for step, seconds in spent_s.items():
        print(f"| {step} | {1000 * seconds / n:.1f} |")
    without_video = sum(s for step, s in spent_s.items() if step != "decode the video")
    print(f"| all, without the video | {1000 * without_video / n:.0f} |")
    per_s = without_video / n + 25 * spent_s["decode the video"] / n
    print(
        f"\nA camera of 25 pictures a second, one of which is looked at: {per_s:.2f} of a core; {1 / per_s:.1f} a core."
    )
    print(
        f"A camera that sends one picture a second: {(without_video + spent_s['decode the video']) / n:.2f} of a core."
    )


if __name__ == "__main__":
    main()

"""From pictures to episodes: painted people, a tiny model that finds them exactly, and what the store says of them."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import cv2
import numpy as np
import pytest
from engine.blob_video import CAMERA, COLOURS, SIZE, Walk, box_of, painted, write_blob_video
from engine.detector_models import blob_model
from engine.vsd_in_a_shop import Vsd, in_shop
from site_text import site_text

from vsd_analytics.engine.frame_pictures import SUFFIXES
from vsd_analytics.engine.pictures import VIDEO_SUFFIXES

START = datetime(2026, 11, 9, 8, tzinfo=UTC)
RATES = {"cam-1": 5.0, "cam-2": 12.5, "cam-3": 29.97}
NEAR_S, AWAY_S, CYCLE_S = 12, 8, 60
"""Once a minute two people come to 1.2 m from each other and stay for 12 s."""


def approach(camera: int) -> list[Walk]:
    """Return one who stands, one who comes near at 1.1 m/s and goes again, and one far from both."""

    def comes(time_s: float) -> tuple[float, float]:
        second = (time_s + 7 * camera) % CYCLE_S
        away = min(abs(second - 30), CYCLE_S - abs(second - 30))
        return (-1.0 + 1.2 + 1.1 * min(max(away - NEAR_S / 2, 0.0), 3.0), 8.0)

    return [Walk(lambda _: (-1.0, 8.0)), Walk(comes), Walk(lambda t: (3.0 + 0.3 * np.sin(t / 9), 13.0))]


def due(second: int, fps: float) -> int:
    """Return the first frame that is not more than half a millisecond before a second."""
    return int(np.ceil((second - 0.0005) * fps - 1e-9))


def truth(camera: int, seconds: int, fps: float) -> list[tuple[int, int]]:
    """Return the first and last whole second of each time the two are closer than 2 m in a processed frame."""
    walks = approach(camera)
    near = []
    for second in range(seconds):
        a, b = (walk.at(due(second, fps) / fps) for walk in walks[:2])
        near.append(np.hypot(a[0] - b[0], a[1] - b[1]) < 2.0)
    edges = np.flatnonzero(np.diff(np.r_[0, np.array(near, dtype=int), 0]))
    return list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True))


@pytest.fixture
def three_cameras(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    (tmp_path / "vsd.toml").write_text(site_text(*RATES))
    vsd = in_shop(tmp_path, capsys)
    for k, camera in enumerate(RATES):
        aside = np.array([[1, 0, 50.0 * k], [0, 1, 0], [0, 0, 1]])  # each camera has a floor of its own
        np.savetxt(tmp_path / f"{camera}.txt", aside @ CAMERA.homography())
        assert vsd("calibrate", camera, "--matrix", str(tmp_path / f"{camera}.txt"))[0] == 0
    blob_model(tmp_path / "blobs.onnx", COLOURS[:3], SIZE)
    return vsd


@pytest.mark.parametrize("minutes", [1, pytest.param(10, marks=pytest.mark.long)])
def test_everybody_is_found_at_the_right_time_and_episodes_are_the_planned_ones(
    minutes: int, tmp_path: Path, three_cameras: Vsd
) -> None:
    seconds = 60 * minutes
    for k, (camera, fps) in enumerate(RATES.items()):
        video = write_blob_video(tmp_path / f"{camera}.avi", approach(k), seconds=seconds, fps=fps)
        out = tmp_path / f"{camera}.jsonl"
        words = ["engine", "run", str(video), "--camera", camera, "--detector", str(tmp_path / "blobs.onnx")]
        code, _, err = three_cameras(*words, "--track", "--start", "2026-11-09T09:00", "--out", str(out))
        assert (code, err) == (0, "")
        messages = [json.loads(line) for line in out.read_text().splitlines()]
        assert len(messages) == seconds
        for second, message in enumerate(messages):
            assert len(message["persons"]) == 3
            assert message["seq"] == second  # pictures that were not taken leave no gap
            true_at = START + timedelta(seconds=due(second, fps) / fps)
            assert abs(datetime.fromisoformat(message["ts"]) - true_at) <= timedelta(milliseconds=1)
        assert three_cameras("ingest", str(out))[0] == 0
    code, printed, err = three_cameras("sql", "select count(*) as n from internal.message_gaps", "--json")
    assert (code, json.loads(printed)["rows"]) == (0, [{"n": 0}]), err
    query = "select camera_id, epoch_ms(started) as started_ms, epoch_ms(ended) as ended_ms from episodes order by all"
    code, printed, err = three_cameras("sql", query, "--json")
    assert code == 0, err
    rows = json.loads(printed)["rows"]
    start_ms = round(START.timestamp() * 1000)
    found = {
        camera: [
            (round((row["started_ms"] - start_ms) // 1000), round((row["ended_ms"] - start_ms) // 1000))
            for row in rows
            if row["camera_id"] == camera
        ]
        for camera in RATES
    }
    assert found == {camera: truth(k, seconds, fps) for k, (camera, fps) in enumerate(RATES.items())}


def test_a_run_that_was_killed_goes_on_and_gives_the_same_bytes(
    tmp_path: Path, three_cameras: Vsd, monkeypatch: pytest.MonkeyPatch
) -> None:
    from vsd_analytics.engine.detector import Detector

    video = write_blob_video(tmp_path / "door.avi", approach(0), seconds=20, fps=5)
    words = ["engine", "run", str(video), "--camera", "cam-1", "--detector", str(tmp_path / "blobs.onnx"), "--track"]
    words += ["--start", "2026-11-09T09:00"]
    assert three_cameras(*words, "--out", str(tmp_path / "whole.jsonl"))[0] == 0
    looked = 0
    people = Detector.people

    def dies_at_the_eighth(self: Detector, *args: object, **more: object) -> object:
        nonlocal looked
        looked += 1
        if looked == 8:
            raise KeyboardInterrupt
        return people(self, *args, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(Detector, "people", dies_at_the_eighth)
    out = tmp_path / "stopped.jsonl"
    assert three_cameras(*words, "--out", str(out))[0] != 0
    assert not out.exists()
    with (tmp_path / "stopped.jsonl.part").open("ab") as journal:
        journal.write(b'{"frame": 40, "ms":')  # a line that a kill tore
    looked = 100
    code, _, err = three_cameras(*words, "--out", str(out))
    assert (code, looked) == (0, 113)
    assert "going on after frame 30" in err
    assert out.read_bytes() == (tmp_path / "whole.jsonl").read_bytes()
    assert not (tmp_path / "stopped.jsonl.part").exists()


def test_a_picture_that_cannot_be_read_is_missing_and_named_and_no_empty_frame(
    tmp_path: Path, three_cameras: Vsd
) -> None:
    folder = tmp_path / "door"
    folder.mkdir()
    for k in range(6):
        cv2.imwrite(str(folder / f"door-{k:04d}.png"), painted(approach(0), float(k)))
    (folder / "door-0002.png").write_bytes(b"\x89PNG broken")
    cv2.imwrite(str(folder / "door-0004.png"), np.zeros((60, 80, 3), np.uint8))
    words = ["engine", "run", str(folder), "--camera", "cam-1", "--detector", str(tmp_path / "blobs.onnx")]
    out = tmp_path / "frames.jsonl"
    code, printed, err = three_cameras(*words, "--start", "2026-11-09T09:00", "--hz", "2", "--out", str(out))
    assert (code, err) == (1, "")
    assert "2 pictures cannot be read: door-0002.png, door-0004.png" in printed
    messages = [json.loads(line) for line in out.read_text().splitlines()]
    assert [m["seq"] for m in messages] == [0, 1, 3, 5]
    assert messages[2]["ts"] == "2026-11-09T08:00:01.500Z"


def test_a_video_that_ends_early_says_which_frames_are_missing(tmp_path: Path, three_cameras: Vsd) -> None:
    video = write_blob_video(tmp_path / "door.avi", approach(0), seconds=20, fps=5)
    data = video.read_bytes()
    video.write_bytes(data[: len(data) * 6 // 10])
    words = ["engine", "run", str(video), "--camera", "cam-1", "--detector", str(tmp_path / "blobs.onnx")]
    code, printed, _ = three_cameras(*words, "--start", "2026-11-09T09:00", "--out", str(tmp_path / "f.jsonl"))
    assert code in {0, 1}
    n = len((tmp_path / "f.jsonl").read_text().splitlines())
    assert 8 <= n <= 13
    if code == 1:
        assert "to 99" in printed


def test_one_picture_and_pictures_with_times_in_their_names(tmp_path: Path, three_cameras: Vsd) -> None:
    words = ["--camera", "cam-1", "--detector", str(tmp_path / "blobs.onnx"), "--out", str(tmp_path / "f.jsonl")]
    cv2.imwrite(str(tmp_path / "one.png"), painted(approach(0), 30.0))
    assert three_cameras("engine", "run", str(tmp_path / "one.png"), *words, "--start", "2026-11-09T09:00")[0] == 0
    assert (
        three_cameras("engine", "run", str(tmp_path / "one.png"), *words, "--overlay", str(tmp_path / "look"))[0] == 0
    )
    drawn = cv2.imread(str(tmp_path / "look" / "frame-00000000.jpg"))
    assert np.abs(drawn[200, 10].astype(int) - 120).max() < 10  # the picture's own ground
    assert three_cameras("engine", "run", str(tmp_path / "one.png"), *words, "--start", "2026-11-09T09:00")[0] == 0
    (message,) = [json.loads(line) for line in (tmp_path / "f.jsonl").read_text().splitlines()]
    assert (message["ts"], len(message["persons"])) == ("2026-11-09T08:00:00.000Z", 3)
    folder = tmp_path / "timed"
    folder.mkdir()
    for k in range(3):
        cv2.imwrite(str(folder / f"{round(START.timestamp()) + 2 * k}.png"), painted(approach(0), float(k)))
    assert three_cameras("engine", "run", str(folder), *words)[0] == 0
    messages = [json.loads(line) for line in (tmp_path / "f.jsonl").read_text().splitlines()]
    assert [m["ts"][-9:-5] for m in messages] == ["0:00", "0:02", "0:04"]


def test_what_has_no_time_never_reaches_the_store_and_no_calibration_is_said_before_the_work(
    tmp_path: Path, three_cameras: Vsd
) -> None:
    video = write_blob_video(tmp_path / "door.avi", approach(0), seconds=2, fps=5)
    words = ["engine", "run", str(video), "--camera", "cam-1", "--detector", str(tmp_path / "blobs.onnx")]
    code, _, err = three_cameras(*words)
    assert (code, "--start 2026-11-09T08:00" in err) == (2, True)
    (tmp_path / "people.csv").write_text("frame,left,top,right,bottom\n0,100,50,120,110\n")
    code, _, err = three_cameras("engine", "run", str(tmp_path / "people.csv"), "--camera", "cam-1")
    assert (code, "--start 2026-11-09T08:00 --hz 1" in err) == (2, True)
    assert not (tmp_path / "store" / "frames").exists()
    (tmp_path / "vsd.toml").write_text(site_text("cam-9"))
    words[4] = "cam-9"
    code, _, err = three_cameras(*words, "--start", "2026-11-09T09:00")
    assert (code, "vsd calibrate cam-9 --draw" in err) == (2, True)
    assert not list(tmp_path.glob("*.part")) + list(tmp_path.glob(".*.part"))  # nothing was detected


def test_somebody_who_never_moves_is_named_and_left_out_on_request(
    tmp_path: Path, three_cameras: Vsd, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vsd_analytics.engine.statues.LEAST_S", 10.0)  # of a video of 20 s
    around = [Walk(lambda t: (2.5 * np.sin(t / 2) + 1, 13.0)), Walk(lambda t: (2.5 * np.cos(t / 2) + 1, 10.0))]
    video = write_blob_video(tmp_path / "door.avi", [*approach(0)[:1], *around], seconds=20, fps=5)
    out = tmp_path / "frames.jsonl"
    words = ["engine", "run", str(video), "--camera", "cam-1", "--detector", str(tmp_path / "blobs.onnx")]
    words += ["--start", "2026-11-09T09:00", "--out", str(out)]
    code, printed, _ = three_cameras(*words)
    left, top, right, bottom = box_of((-1.0, 8.0))
    assert f"somebody never moves, at {(left + right) // 2}, {(top + bottom) // 2} in the picture (100%" in printed
    assert all(len(json.loads(line)["persons"]) == 3 for line in out.read_text().splitlines())
    code, printed, _ = three_cameras(*words, "--without-statues")
    assert (code, "left out" in printed) == (0, True)
    assert all(len(json.loads(line)["persons"]) == 2 for line in out.read_text().splitlines())


def crossings(k: int) -> Walk:
    """Return one who crosses the floor every 6 s, somewhere else each time."""

    def at(time_s: float) -> tuple[float, float]:
        way, since = divmod(time_s + 1.5 * k, 6.0)
        rng = np.random.default_rng([k, int(way)])
        begin, turn = rng.uniform([-1.5, 8.0], [1.5, 10.0]), rng.uniform(0, 2 * np.pi)
        return (float(begin[0] + since * 0.4 * np.cos(turn)), float(begin[1] + since * 0.5 * np.sin(turn)))

    return Walk(at)


def without_calibration(folder: Path, camera: str) -> None:
    for path in (folder / "calibration").glob(f"{camera}*"):
        path.unlink()


def test_a_measured_calibration_is_not_replaced_by_one_from_people(tmp_path: Path, three_cameras: Vsd) -> None:
    """It would hold for all records of the camera, and its distances are less certain."""
    video = write_blob_video(tmp_path / "door.avi", approach(0), seconds=1, fps=5)
    before = {p.name: p.read_bytes() for p in (tmp_path / "calibration").iterdir()}
    words = ["engine", "run", str(video), "--camera", "cam-1", "--detector", str(tmp_path / "blobs.onnx")]
    code, _, err = three_cameras(*words, "--start", "2026-11-09T09:00", "--from-people")
    assert (code, "leave --from-people out" in err) == (2, True)
    assert {p.name: p.read_bytes() for p in (tmp_path / "calibration").iterdir()} == before


def test_people_of_the_same_video_calibrate_the_camera_first(tmp_path: Path, three_cameras: Vsd) -> None:
    without_calibration(tmp_path, "cam-1")
    video = write_blob_video(tmp_path / "door.avi", [crossings(k) for k in range(3)], seconds=100, fps=5)
    out = tmp_path / "frames.jsonl"
    words = ["engine", "run", str(video), "--camera", "cam-1", "--detector", str(tmp_path / "blobs.onnx")]
    code, printed, err = three_cameras(
        *words, "--hz", "5", "--start", "2026-11-09T09:00", "--from-people", "--out", str(out)
    )
    assert code == 0, printed
    assert err.startswith("warning[W406]")  # three people, however often they come
    assert err.count("\n") == 1
    first = json.loads(out.read_text().splitlines()[0])
    truth = sorted(crossings(k).at(0.0)[1] for k in range(3))
    assert sorted(p["y_m"] for p in first["persons"]) == pytest.approx(truth, rel=0.15)
    assert (tmp_path / "calibration" / "cam-1-from-people.json").exists()


def test_too_few_people_are_refused_and_nothing_is_written(tmp_path: Path, three_cameras: Vsd) -> None:
    without_calibration(tmp_path, "cam-1")
    video = write_blob_video(tmp_path / "door.avi", approach(0), seconds=10, fps=5)
    out = tmp_path / "frames.jsonl"
    words = ["engine", "run", str(video), "--camera", "cam-1", "--detector", str(tmp_path / "blobs.onnx")]
    code, _, err = three_cameras(*words, "--start", "2026-11-09T09:00", "--from-people", "--out", str(out))
    assert (code, "E411" in err, out.exists()) == (2, True, False)
    code, _, err = three_cameras("calibrate", "cam-1", "--from-people", str(video))
    assert (code, "--detector MODEL.onnx --from-people" in err) == (2, True)


def test_no_picture_and_no_film_is_written_unless_an_overlay_is_asked_for(tmp_path: Path, three_cameras: Vsd) -> None:
    if shutil.which("strace") is None:
        pytest.skip("strace is not installed")
    video = write_blob_video(tmp_path / "door.avi", approach(0), seconds=6, fps=5)
    trace = tmp_path / "trace"
    words = ["engine", "run", str(video), "--camera", "cam-1", "--detector", str(tmp_path / "blobs.onnx"), "--track"]
    vsd = [
        sys.executable,
        "-c",
        "from vsd_analytics.cli import main; main()",
        "-C",
        str(tmp_path),
        "--now",
        "2026-11-20T12:00",
    ]
    traced = [
        "strace",
        "-f",
        "-qq",
        "-o",
        str(trace),
        "-e",
        "trace=open,openat,creat,rename,renameat,renameat2,connect",
    ]
    subprocess.run([*traced, *vsd, *words, "--start", "2026-11-09T09:00"], check=True, timeout=120)
    opened = r'(?:open|openat|creat)\((?:AT_FDCWD, )?"([^"]+)", [^)]*(?:O_WRONLY|O_RDWR|O_CREAT)'
    written = re.findall(opened, trace.read_text())
    kept = {Path(name) for name in written if not name.startswith(("/dev/", "/proc/"))}
    assert {p for p in kept if tmp_path not in p.parents and "__pycache__" not in str(p)} == set()
    pixels = {p for p in kept if p.suffix.lower() in SUFFIXES | VIDEO_SUFFIXES | {".npy", ".raw", ".pkl"}}
    assert not pixels
    assert "AF_INET" not in trace.read_text()  # nothing is sent to anybody
    pictures = {p.name for p in tmp_path.rglob("*") if p.suffix.lower() in SUFFIXES}
    assert pictures == {f"{camera}-overlay.png" for camera in RATES}  # the empty grid of each calibration


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["door.avi"], "nothing finds people in them"),
        (["people.csv", "--detector", "blobs.onnx"], "no video, picture or folder of pictures"),
        (["people.csv", "--tile", "100"], "--tile belongs to --detector"),
        (["people.csv", "--from-people"], "--from-people belongs to --detector"),
        (["door.avi", "--detector", "blobs.onnx", "--method", "monoloco"], "that another program found"),
        (["door.avi", "--detector", "blobs.onnx", "--size", "320x240"], "that another program found"),
        (["door.avi", "--detector", "blobs.onnx", "--provider", "abacus"], "no provider 'abacus'"),
        (["none.avi", "--detector", "blobs.onnx"], "there is no file"),
    ],
)
def test_what_does_not_go_together_is_refused_with_a_fix(
    words: list[str], says: str, tmp_path: Path, three_cameras: Vsd, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "people.csv").write_text("frame,left,top,right,bottom\n0,10,10,20,60\n")
    write_blob_video(tmp_path / "door.avi", approach(0), seconds=1, fps=5)
    code, _, err = three_cameras("engine", "run", *words, "--camera", "cam-1", "--out", "f.jsonl")
    assert code == 2
    assert says in err
    assert "fix:" in err

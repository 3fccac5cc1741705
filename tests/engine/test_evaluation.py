"""`vsd evaluate`: what counts as hit, false and missed; pooled and by frame; intervals; what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from engine.vsd_in_a_shop import Vsd, shop

from vsd_analytics.engine.evaluation import Evaluation, evaluate
from vsd_analytics.engine.scores import Hits, frame_mean, pooled
from vsd_analytics.engine.truth import read_messages, read_positions
from vsd_analytics.errors import InputError

TRUTH = "frame,track_id,x_m,y_m\n0,a,0,0\n0,b,1,0\n0,c,2.5,0\n0,d,9,9\n1,a,0,0\n1,b,2,0\n2,a,0,0\n2,b,1,0\n"
"""Violations: a-b and b-c in frame 0, a-b in frame 2; 2 m in frame 1 is not closer than 2 m."""


def message(
    frame: int, people: dict[str, tuple[float, float] | None], pairs: list[tuple[str, str, float]] | None
) -> str:
    persons = [{"id": who, **({} if at is None else {"x_m": at[0], "y_m": at[1]})} for who, at in people.items()]
    body = {"v": 1, "camera": "cam-1", "ts": f"2026-11-09T08:00:{frame:02d}Z", "seq": frame, "persons": persons}
    if pairs is not None:
        body["pairs"] = [{"a": a, "b": b, "distance_m": d} for a, b, d in pairs]
    return json.dumps(body)


def compared(folder: Path, lines: list[str], truth: str = TRUTH) -> Evaluation:
    (folder / "frames.jsonl").write_text("\n".join(lines))
    (folder / "truth.csv").write_text(truth)
    positions = read_positions(folder / "truth.csv")
    return evaluate(read_messages(folder / "frames.jsonl", clock=positions.clock), positions, distance_m=2.0)


def test_pairs_that_were_sent_are_hits_false_or_missed(tmp_path: Path) -> None:
    nowhere = dict.fromkeys("abcd")
    done = compared(
        tmp_path,
        [
            message(0, nowhere, [("b", "a", 1.4), ("c", "d", 1.0), ("b", "c", 2.2)]),
            message(1, {"a": None, "b": None}, [("a", "b", 1.9)]),
            message(2, {"a": None, "b": None}, []),
        ],
    )
    scores = done.pairs[0]  # hit a-b; false c-d, a-b of frame 1; missed b-c and a-b of frame 2
    assert (done.n_true_pairs, done.n_found_pairs) == (3, 3)
    assert (scores.precision.value, scores.recall.value) == pytest.approx((1 / 3, 1 / 3))
    persons = done.persons[0]  # true a b c, a b; found a b c d, a b of frame 1
    assert (persons.precision.value, persons.recall.value) == pytest.approx((3 / 6, 3 / 5))
    assert done.distance_bias == pytest.approx(np.median([1.4, 2.2 / 1.5, 1.9 / 2]) - 1)


def test_pairs_are_derived_from_metres_where_none_are_sent(tmp_path: Path) -> None:
    done = compared(tmp_path, [message(0, {"a": (5, 5), "b": (5, 6), "c": (5, 7.9)}, None)])
    assert done.pairs[0].f1.value == 1.0
    assert done.n_unprocessed == 2
    assert done.n_distances == 3


def test_empty_list_of_pairs_says_there_are_none_also_beside_metres(tmp_path: Path) -> None:
    done = compared(tmp_path, [message(0, {"a": (5, 5), "b": (5, 6)}, [])])
    assert done.n_found_pairs == 0
    assert done.pairs[0].recall.value == 0.0


def test_person_who_was_not_detected_makes_missed_pairs(tmp_path: Path) -> None:
    done = compared(tmp_path, [message(0, {"a": (5, 5), "c": (7.5, 5)}, None)])
    assert (done.n_true_pairs, done.pairs[0].recall.value) == (2, 0.0)


def test_pair_with_a_person_who_is_not_in_the_truth_is_false(tmp_path: Path) -> None:
    done = compared(tmp_path, [message(2, {"a": (0, 0), "b": (1, 0), "ghost": (0, 1)}, None)])
    assert (done.n_found_pairs, done.pairs[0].precision.value) == (3, pytest.approx(1 / 3))


def test_frames_without_truth_say_nothing(tmp_path: Path) -> None:
    done = compared(tmp_path, [message(2, {"a": (0, 0), "b": (1, 0)}, None), message(7, {"x": (0, 0)}, None)])
    assert (done.n_frames, done.n_unlabelled, done.pairs[0].precision.value) == (1, 1, 1.0)


def test_instants_are_compared_where_the_truth_has_them(tmp_path: Path) -> None:
    truth = "ts,track_id,x_m,y_m\n2026-11-09T08:00:03Z,a,0,0\n2026-11-09T08:00:03Z,b,1,0\n"
    done = compared(tmp_path, [message(3, {"a": (0, 0), "b": (1, 0)}, None)], truth)
    assert (done.n_frames, done.pairs[0].f1.value) == (1, 1.0)


def test_frame_mean_and_pooled_scores_are_those_of_hand_counts() -> None:
    hits = Hits(hit=np.array([3, 0, 0]), false=np.array([1, 2, 0]), missed=np.array([0, 1, 0]))
    assert pooled(hits).f1.value == pytest.approx(6 / (6 + 3 + 1))
    assert frame_mean(hits).precision.value == pytest.approx((0.75 + 0) / 2)  # nothing was found in the third
    assert frame_mean(hits).recall.value == pytest.approx((1 + 0) / 2)
    assert np.isnan(pooled(Hits(*np.zeros((3, 4), dtype=np.int64))).f1.value)


def test_interval_covers_the_rate_of_scenes_that_stay_alike_for_a_while() -> None:
    """Frames repeat in runs of 25; the interval by blocks covers, one by frames would be five times too narrow."""
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(80):
        hit = np.repeat(rng.random(120) < 0.8, 25).astype(np.int64)
        precision = pooled(Hits(hit, 1 - hit, np.zeros_like(hit))).precision
        covered += precision.lo <= 0.8 <= precision.hi
    assert 0.88 <= covered / 80 <= 0.99


@pytest.mark.parametrize(
    ("line", "what"),
    [
        (message(50, {"a": (0, 0)}, None), "no frame in common"),
        (message(0, {"other": (0, 0)}, None), "no track id in common"),
    ],
)
def test_files_of_different_recordings_are_refused(line: str, what: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=what) as refused:
        compared(tmp_path, [line])
    assert refused.value.code == "E412"


def test_command_prints_the_scores_and_the_same_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vsd: Vsd = shop(tmp_path, capsys)
    (tmp_path / "frames.jsonl").write_text(message(0, {"a": (5, 5), "b": (5, 6)}, None))
    (tmp_path / "truth.csv").write_text(TRUTH)
    command = ["evaluate", str(tmp_path / "frames.jsonl"), "--truth", str(tmp_path / "truth.csv"), "--distance", "2"]
    code, text, _ = vsd(*command)
    assert code == 0
    assert "1 frames, 2 true and 1 found violations" in text
    found = json.loads(vsd(*command, "--json")[1])
    assert found["pairs"]["pooled"]["recall"]["value"] == 0.5
    assert found["persons"]["frame_mean"]["precision"]["value"] == 1.0
    (tmp_path / "frames.jsonl").write_text("not a message\n")
    code, _, err = vsd(*command)
    assert code == 2
    assert "E204" in err


def placed(folder: Path, vsd: Vsd, *words: str) -> dict:
    """Return what is printed for messages without ids: a and b .3 m off, c not found, one who is not in the truth."""
    body = {"v": 1, "camera": "cam-1", "ts": "2026-11-09T08:00:00Z", "seq": 0}
    at = [(1.3, 0.0), (0.3, 0.0), (8.0, 9.9), (1.0, -1.4)]
    body["persons"] = [{"x_m": x, "y_m": y} for x, y in at]
    (folder / "frames.jsonl").write_text(json.dumps(body))
    (folder / "truth.csv").write_text("frame,track_id,x_m,y_m\n0,a,0,0\n0,b,1,0\n0,c,2.5,0\n0,d,9,9\n")
    files = [str(folder / "frames.jsonl"), "--truth", str(folder / "truth.csv")]
    code, printed, err = vsd("evaluate", *files, *words, "--json")
    assert code == 0, err
    return json.loads(printed)


def test_persons_without_ids_are_compared_by_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vsd = shop(tmp_path, capsys)
    done = placed(tmp_path, vsd, "--by", "place")
    detection, pairs = done["detection"]["pooled"], done["pairs"]["pooled"]
    assert (detection["recall"]["value"], detection["precision"]["value"]) == (0.5, 0.5)
    assert (done["n_true_pairs"], done["n_found_pairs"]) == (2, 3)  # a-b found; b-c missed; two with the stranger false
    assert pairs["recall"]["value"] == 0.5
    assert pairs["precision"]["value"] == pytest.approx(1 / 3, abs=1e-5)
    wide = placed(tmp_path, vsd, "--by", "place", "--within", "1.5")["detection"]["pooled"]
    assert wide["recall"]["value"] == 1.0  # as many as possible: the one between b and c is c then, the stranger is b


def test_nobody_counts_in_areas_that_are_ignored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vsd = shop(tmp_path, capsys)
    corners = [(0, -3), (3, -3), (3, -1), (0, -1)]
    (tmp_path / "areas.csv").write_text(
        "area,x_m,y_m\n" + "".join(f"south,{x},{y}\n" for x, y in corners) + "far,7,8\nfar,10,8\nfar,10,11\nfar,7,11\n"
    )
    done = placed(tmp_path, vsd, "--by", "place", "--ignore", str(tmp_path / "areas.csv"))
    assert done["n_uncounted"] == {"found": 2, "true": 1}
    detection, pairs = done["detection"]["pooled"], done["pairs"]["pooled"]
    assert detection["precision"]["value"] == 1.0
    assert detection["recall"]["value"] == pytest.approx(2 / 3, abs=1e-5)
    assert (pairs["precision"]["value"], pairs["recall"]["value"]) == (1.0, 0.5)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--within", "2"], "--within belongs to --by place"),
        (["--ignore", "cellar"], "there is no area 'cellar'"),
        (["--ignore", "none.csv"], "cannot read none.csv"),
        (["--size", "640x480"], "--size belongs to a data set"),
    ],
)
def test_options_of_places_and_areas_that_do_not_fit_are_refused(
    words: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vsd = shop(tmp_path, capsys)
    (tmp_path / "frames.jsonl").write_text(message(0, {"a": (0, 0)}, None))
    (tmp_path / "truth.csv").write_text(TRUTH)
    code, _, err = vsd("evaluate", str(tmp_path / "frames.jsonl"), "--truth", str(tmp_path / "truth.csv"), *words)
    assert code == 2
    assert says in err

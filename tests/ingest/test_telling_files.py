"""What columns hold, how distances, ids and calibrations fit together: each mistake is warned of or refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from odd_files import STEPS, Odd, plain, rows, text
from oddest_files import times, with_column
from telling_files import PAIRS, TELLING, back_by_an_hour, hung, in_frames_of_a_second, numbered, pairs
from test_odd_files import by_identity, in_store
from walks import project

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.geometry.homography import to_image

CALIBRATION = np.array([[0.016, 0.0, 0.0], [0.0, -0.0175, 12.0], [0.0, 0.0, 1.0]])
"""Pixels to metres of a made-up camera that sees the hall from above."""


def check(root: Path, file: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, str]:
    code = run(cli, ["-C", str(root), "--now", "2025-12-01", "check", str(file), *options])
    return code, "".join(capsys.readouterr())


@pytest.mark.parametrize("odd", TELLING, ids=lambda odd: odd.name)
def test_a_file_that_only_its_content_gives_away_is_right_or_warned_of(
    odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = project(tmp_path / "project")
    toml = (root / "vsd.toml").read_text().replace('plan = "plan.svg"\nplan_m_per_px = 0.1\n', "")
    (root / "vsd.toml").write_text(toml.replace("picture_px = [1280, 720]\n", "") + "[privacy]\npseudonyms = false\n")
    code = run(cli, ["-C", str(root), "--now", "2025-12-01", "ingest", str(odd.write(tmp_path)), *odd.options])
    said = "".join(capsys.readouterr())
    assert odd.says in said
    assert code == 0 if odd.rows is not None and not odd.says else code in (1, 2), said
    if odd.rows is not None:
        assert by_identity(in_store(root)) == by_identity(list(odd.rows)), said


def test_ids_that_number_the_people_of_a_frame_are_warned_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = check(project(tmp_path / "p"), numbered()(tmp_path), capsys)
    assert code == 1
    assert "they number the people of a frame" in said


def test_pairs_further_apart_than_is_stored_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, said = check(project(tmp_path / "p"), pairs(lambda d: d)(tmp_path), capsys)
    assert "of the pairs are more than 2.5 m apart" in said


@pytest.mark.parametrize(("share", "is_doubted"), [(1.0, False), (None, True)])
def test_distances_that_are_shares_of_the_largest_are_warned_of(
    share: float | None, is_doubted: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    largest = share or max(d for _, _, d in PAIRS)
    _, said = check(project(tmp_path / "p"), pairs(lambda d: d / largest)(tmp_path), capsys)
    assert ("the largest is exactly 1" in said) == is_doubted, said


@pytest.mark.parametrize(
    ("calibration", "says"),
    [
        (CALIBRATION, None),
        (np.diag([3.0, 3.0, 1.0]) @ CALIBRATION, "by the calibration, "),
        (CALIBRATION[[1, 0, 2]], "by the calibration, "),
    ],
)
def test_pixels_are_compared_with_the_floor_of_their_calibration(
    calibration: np.ndarray, says: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = project(tmp_path / "p", more='clock = "UTC"\nhomography = "h.txt"')
    np.savetxt(root / "h.txt", calibration)
    uv = to_image(CALIBRATION, [(s.x_m, s.y_m) for s in STEPS], picture_px=(1280, 720))
    lines = [f"{s.at.isoformat()},{s.track},{u:.2f},{v:.2f}" for s, (u, v) in zip(STEPS, uv, strict=True)]
    (root / "a.csv").write_text("ts,track_id,u_px,v_px\n" + "\n".join(lines) + "\n")
    code, said = check(root, root / "a.csv", capsys)
    assert (says is None) == ("by the calibration, " not in said), said
    assert code == (0 if says is None else 1), said


@pytest.mark.parametrize(("n", "is_doubted"), [(1, False), (3, True)])
def test_several_frames_of_one_second_are_seen_through_the_calibration(
    n: int, is_doubted: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = project(tmp_path / "p", more='clock = "UTC"\nhomography = "h.txt"')
    np.savetxt(root / "h.txt", CALIBRATION)
    _, said = check(root, in_frames_of_a_second(n)(tmp_path), capsys)
    assert ("times have several frames" in said) == is_doubted, said


@pytest.mark.parametrize(
    ("name", "cell", "limit"),
    [
        ("score", 0.9, "score >= 0.4"),
        ("Score (%)", 90, '"Score (%)\\" >= 40'),
        ("score", 200, None),
        ("score", "90%", None),
    ],
)
def test_the_limit_that_the_card_proposes_is_one_of_the_column(
    name: str, cell: object, limit: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, said = check(project(tmp_path / "p"), with_column(name, lambda s: cell)(tmp_path), capsys)
    assert ("can be a limit" in said) == (limit is not None)
    assert limit is None or limit in said


def test_shares_of_a_picture_beyond_its_edge_are_told_from_pixels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = project(tmp_path / "p")
    toml = (root / "vsd.toml").read_text().replace("picture_px = [1280, 720]\n", "")
    (root / "vsd.toml").write_text(toml)
    shares = text("a.csv", ("ts", "track_id", "u_px", "v_px"), rows(lambda s: [*plain(s)[:2], s.x_m / 20, s.y_m / 5]))
    _, said = check(root, shares(tmp_path), capsys)
    assert "--size WIDTHxHEIGHT if they are shares of 1" in said


def test_an_hour_set_back_is_not_answered_with_a_zone_which_would_not_help(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = project(tmp_path / "p")
    toml = (root / "vsd.toml").read_text()
    zone = toml.split('timezone = "')[1].split('"')[0]
    naive = times(lambda s: back_by_an_hour(s).replace(tzinfo=None), STEPS)
    for options in ((), ("--zone", zone)):
        said = check(root, naive(tmp_path), capsys, *options)[1]
        fix = said.partition("goes back by an hour")[2].partition("fix: ")[2].partition("\n")[0]
        assert fix.startswith("export times with their offset"), said


@pytest.mark.parametrize(("seconds", "digits", "is_doubted"), [(60, 3, True), (59, 3, False), (200, 2, False)])
def test_a_picture_that_hangs_is_warned_of(
    seconds: int, digits: int, is_doubted: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, said = check(project(tmp_path / "p"), hung(seconds, digits)(tmp_path), capsys)
    assert ("for 60 s nobody in view moves by a digit, from line 356 on" in said) == is_doubted
    assert ("moves by a digit" in said) == is_doubted

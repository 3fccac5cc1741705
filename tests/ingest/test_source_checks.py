"""Mistakes that spoil every record are seen before anything is stored; honest files pass without a word."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from walks import Step, project, walks

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.checks.time_checks import open_share
from vsd_analytics.ingest.intake.pipeline import SourceResult, ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.ingest.reading.units import unit_in_name

NOW = datetime(2025, 12, 1, tzinfo=UTC)
OURS = {"x_m": "x", "y_m": "y", "track_id": "id"}


@dataclass(frozen=True)
class Taken:
    result: SourceResult
    n_new: int
    n_second: int

    @property
    def codes(self) -> list[str]:
        assert self.result.card is not None
        return [d.code for d in self.result.card.warnings]

    @property
    def fix(self) -> str:
        assert self.result.card is not None
        return self.result.card.warnings[0].fix


def take(folder: Path, header: str, rows: Sequence[str], *, more: str = "", name: str = "a.csv", **given: Any) -> Taken:
    root = project(folder / "project", more=more)
    path = root / name
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    result = ingest(load_site(root), [path], IngestOptions(**given), now=NOW)
    counts = result.fold.tables.get("observations") or result.fold.tables.get("pairs")
    return Taken(result.sources[0], result.fold.n_new, 0 if counts is None else counts.n_second)


def rows_of(row: Callable[[Step], str], **changes: Any) -> list[str]:
    return [row(step) for step in walks(**changes)]


def test_an_honest_table_is_stored_without_a_doubt(tmp_path: Path) -> None:
    taken = take(tmp_path, "ts,track_id,x_m,y_m", rows_of(lambda s: f"{s.at.isoformat()},{s.track},{s.x_m},{s.y_m}"))
    assert (taken.codes, taken.n_new, taken.result.error) == ([], 360, None)
    card = taken.result.card
    assert card is not None
    assert (card.n_ids, card.life_s, card.interval_s, card.floor_bounds_m) == (6, 59.0, 1.0, (0.0, 20.0, 0.0, 12.0))


def test_errors_of_positions_many_times_a_second_are_no_speed(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    noisy = [(s, *rng.normal((s.x_m, s.y_m), 0.15).round(3)) for s in walks(seconds=20, hz=10)]
    rows = [f"{s.at.isoformat(timespec='milliseconds')},{s.track},{x},{y}" for s, x, y in noisy]
    taken = take(tmp_path, "ts,track_id,x_m,y_m", rows)
    assert taken.codes == []
    assert taken.result.card is not None
    assert taken.result.card.speed_m_s == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(("unit", "metres"), [("mm", 0.001), ("cm", 0.01), ("ft", 0.3048)])
def test_a_column_that_names_its_unit_is_converted(tmp_path: Path, unit: str, metres: float) -> None:
    rows = rows_of(lambda s: f"{s.at.isoformat()},{s.track},{s.x_m / metres:.6f},{s.y_m / metres:.6f}")
    renames = {"x_m": f"x_{unit}", "y_m": f"Y ({unit})", "track_id": "id"}
    taken = take(tmp_path, f"ts,id,x_{unit},Y ({unit})", rows, map=renames)
    assert (taken.codes, taken.n_new) == ([], 360)
    assert taken.result.card is not None
    assert [c.unit for c in taken.result.card.columns if c.ours in ("x_m", "y_m")] == [unit, unit]
    assert taken.result.card.floor_m is not None
    assert 0 < taken.result.card.floor_m[0] < taken.result.card.floor_m[1] < 20


@pytest.mark.parametrize("factor", [1000.0, 100.0, 64.0])
def test_millimetres_centimetres_and_pixels_as_metres_are_refused(tmp_path: Path, factor: float) -> None:
    rows = rows_of(lambda s: f"{s.at.isoformat()},{s.track},{s.x_m * factor},{s.y_m * factor}")
    taken = take(tmp_path, "ts,id,x,y", rows, map=OURS)
    assert taken.result.error is not None
    assert (taken.result.error.code, taken.n_new, set(taken.codes)) == ("E211", 0, {"W220"})
    sure = take(tmp_path, "ts,id,x,y", rows, map=OURS, is_sure=True)
    assert set(sure.codes) == {"W220"}
    assert sure.n_new + sum(sure.result.n_rejected.values()) == 360  # beyond coordinate_max_m they are quarantined


@pytest.mark.parametrize(("factor", "is_stored"), [(1.0, True), (1000.0, False)])
def test_a_concourse_of_half_a_kilometre_is_no_wrong_unit_where_people_walk(
    tmp_path: Path, factor: float, is_stored: bool
) -> None:
    """Without a plan, only how fast people move tells a large floor from millimetres."""
    root = project(tmp_path / "project")
    text = (root / "vsd.toml").read_text(encoding="utf-8")
    (root / "vsd.toml").write_text(text.replace('plan = "plan.svg"\nplan_m_per_px = 0.1\n', ""), encoding="utf-8")
    rows = rows_of(lambda s: f"{s.at.isoformat()},{s.track},{(s.x_m + 80 * s.track) * factor},{s.y_m * factor}")
    path = root / "a.csv"
    path.write_text("\n".join(["ts,track_id,x_m,y_m", *rows]) + "\n", encoding="utf-8")
    found = ingest(load_site(root), [path], IngestOptions(), now=NOW)
    card = found.sources[0].card
    assert card is not None
    assert {d.code for d in card.warnings} == {"W220"}
    assert (found.sources[0].error is None, found.fold.n_new) == (is_stored, 360 if is_stored else 0)


def test_a_stated_unit_converts_columns_that_name_none(tmp_path: Path) -> None:
    rows = rows_of(lambda s: f"{s.at.isoformat()},{s.track},{s.x_m * 1000},{s.y_m * 1000}")
    assert take(tmp_path, "ts,id,x,y", rows, map=OURS, unit="mm").codes == []
    contradicted = take(
        tmp_path, "ts,id,x_cm,y_cm", rows, map={"x_m": "x_cm", "y_m": "y_cm", "track_id": "id"}, unit="mm"
    )
    assert contradicted.result.error is not None
    assert "x_cm" in contradicted.result.error.what


def test_a_column_that_names_pixels_is_never_metres(tmp_path: Path) -> None:
    rows = [f"2025-11-25T09:00:0{i}Z,1,{i},2" for i in range(5)]
    taken = take(tmp_path, "ts,id,x_px,y_px", rows, map={"x_m": "x_px", "y_m": "y_px", "track_id": "id"})
    assert (taken.codes[0], taken.n_new) == ("W220", 0)


def test_feet_read_as_metres_are_seen_beside_the_plan(tmp_path: Path) -> None:
    rows = rows_of(lambda s: f"{s.at.isoformat()},{s.track},{s.x_m / 0.3048},{s.y_m / 0.3048}")
    assert take(tmp_path, "ts,id,x,y", rows, map=OURS).codes[:1] == ["W220"]


def test_shares_of_a_plan_read_as_metres_are_refused(tmp_path: Path) -> None:
    rows = rows_of(lambda s: f"{s.at.isoformat()},{s.track},{s.x_m / 20},{s.y_m / 12}")
    taken = take(tmp_path, "ts,id,x,y", rows, map=OURS)
    assert (taken.codes, taken.n_new) == (["W220"], 0)


def test_pairs_in_millimetres_are_refused_and_converted(tmp_path: Path) -> None:
    rows = [f"2025-11-25T09:00:{i:02d}Z,1,2,{1200 + i}" for i in range(20)]
    assert take(tmp_path, "ts,track_a,track_b,distance_m", rows).codes == ["W220"]
    renames = {"distance_m": "distance_mm"}
    assert take(tmp_path, "ts,track_a,track_b,distance_mm", rows, map=renames).n_new == 20


def test_several_cameras_are_not_stored_as_one(tmp_path: Path) -> None:
    rows = rows_of(lambda s: f"{s.at.isoformat()},north-{s.track % 3},{s.track},{s.x_m},{s.y_m}")
    taken = take(tmp_path, "ts,camera,track_id,x_m,y_m", rows)
    assert (taken.codes, taken.n_new) == (["W221"], 0)
    assert "--map camera_id=camera" in taken.fix
    one = take(tmp_path, "ts,camera,track_id,x_m,y_m", rows, where="camera = 'north-1'")
    assert (one.codes, one.n_new, one.result.n_dropped["by --where"]) == ([], 120, 240)


def test_a_column_with_one_camera_is_named_as_ignored(tmp_path: Path) -> None:
    rows = rows_of(lambda s: f"{s.at.isoformat()},north,{s.track},{s.x_m},{s.y_m}")
    taken = take(tmp_path, "ts,camera,track_id,x_m,y_m", rows)
    assert (taken.codes, taken.n_new) == ([], 360)
    assert taken.result.card is not None
    assert taken.result.card.ignored == ("camera",)


@pytest.mark.parametrize(("values", "is_refused"), [("person car", True), ("0 2", True), ("person 0", False)])
def test_rows_that_are_no_persons_are_not_counted(tmp_path: Path, values: str, is_refused: bool) -> None:
    kinds = values.split()
    rows = rows_of(lambda s: f"{s.at.isoformat()},{s.track},{s.x_m},{s.y_m},{kinds[s.track == 1]},0.{s.track}")
    header = "ts,track_id,x_m,y_m,class_name,confidence"
    taken = take(tmp_path, header, rows)
    assert (taken.codes, taken.n_new) == ((["W222"], 0) if is_refused else ([], 360))
    assert taken.result.card is not None
    assert taken.result.card.confidence == "confidence"
    filtered = take(tmp_path / "f", header, rows, where="class_name != '2' and class_name != 'car' and confidence > .3")
    assert (filtered.codes, filtered.n_new) == ([], 180)


def test_times_on_no_stated_clock_are_shown_in_both_readings(tmp_path: Path) -> None:
    rows = rows_of(lambda s: f"{s.at:%Y-%m-%d %H:%M:%S},{s.track},{s.x_m},{s.y_m}")
    header = "ts,track_id,x_m,y_m"
    taken = take(tmp_path / "a", header, rows, more='engine_ids = ["north"]')
    assert (taken.codes, taken.n_new) == (["W223"], 360)
    assert taken.result.card is not None
    assert "10:00" in taken.result.card.warnings[0].what
    assert "09:00" in taken.result.card.warnings[0].why
    for name, given in (("b", {"more": 'clock = "UTC"'}), ("c", {"zone": "Europe/Berlin", "more": "hz = 1.0"})):
        assert take(tmp_path / name, header, rows, **given).codes == []
    berlin = take(tmp_path / "d", header, rows, zone="Europe/Berlin").result
    assert berlin.first_ms == int(datetime(2025, 11, 25, 8, tzinfo=UTC).timestamp() * 1000)


def test_the_share_in_opening_hours_follows_the_site(tmp_path: Path) -> None:
    import numpy as np

    site = load_site(project(tmp_path))
    local_h = np.array([7.9, 8.0, 19.9, 20.0]) + 24 * 20_417  # a Tuesday
    assert open_share((local_h * 3_600_000).astype(np.int64), site) == 0.5
    assert open_share(((local_h + 5 * 24) * 3_600_000).astype(np.int64), site) == 0.0  # a Sunday


@pytest.mark.parametrize(
    ("n_offsets", "first_h", "last_h", "said"),
    [
        (0, 8, 20, None),
        (1, 8, 20, "counted local time as UTC"),
        (2, 8, 20, "subtract"),
        (1, 10, 17, None),  # no hour that it reaches is closed
        (0, 10, 20.4, None),  # staff who stay on
        (0, 6, 20, None),  # before opening: no offset of this zone brings them inside
    ],
)
def test_an_offset_that_would_bring_all_records_into_opening_hours_is_doubted(
    tmp_path: Path, n_offsets: int, first_h: float, last_h: float, said: str | None
) -> None:
    """The site opens from 8 to 20 o'clock, and is an hour ahead of UTC."""
    midnight = datetime(2025, 11, 25, tzinfo=ZoneInfo("Europe/Berlin"))
    instants = [midnight + timedelta(minutes=m) for m in range(int(first_h * 60), int(last_h * 60))]
    rows = [
        f"{int(at.timestamp()) + n_offsets * 3600},{who},{3 + who + k % 7 / 10:.1f},{4 + k % 5 / 10:.1f}"
        for k, at in enumerate(instants)
        for who in range(3)
    ]
    taken = take(tmp_path, "ts,track_id,x_m,y_m", rows)
    assert taken.result.card is not None
    doubts = [d for d in taken.result.card.warnings if "opening hours" in d.what]
    assert [said in d.why for d in doubts] == [True] if said else doubts == []


def test_dates_without_times_are_refused_and_joined_with_their_times(tmp_path: Path) -> None:
    rows = rows_of(lambda s: f"{s.at:%Y-%m-%d},{s.at:%H:%M:%S},{s.track},{s.x_m},{s.y_m}")
    header = "date,time,track_id,x_m,y_m"
    taken = take(tmp_path, header, rows, map={"ts": "date"})
    assert (taken.codes, taken.n_new, taken.fix) == (["W224"], 0, "--map ts=date+time")
    joined = take(tmp_path, header, rows, map={"ts": "date+time"})
    assert (joined.codes, joined.n_new, joined.result.first_ms) == ([], 360, int(walks()[0].at.timestamp() * 1000))


@pytest.mark.parametrize("has_ids", [True, False])
def test_whole_minutes_are_refused_and_a_stated_period_is_believed(tmp_path: Path, has_ids: bool) -> None:
    rows = rows_of(lambda s: f"{s.at:%Y-%m-%dT%H:%MZ},{s.track if has_ids else ''},{s.x_m},{s.y_m}", seconds=180)
    taken = take(tmp_path, "ts,track_id,x_m,y_m", rows)
    assert (taken.codes[0], taken.n_new) == ("W224", 0)
    assert taken.result.card is not None
    assert "whole minutes" in taken.result.card.warnings[0].what + taken.result.card.warnings[0].why
    stated = take(tmp_path, "ts,track_id,x_m,y_m", rows, period_s=60.0)
    assert "W224" not in stated.codes
    assert stated.n_new == (18 if has_ids else 1080)


@pytest.mark.parametrize("is_scattered", [False, True])
def test_frames_that_show_parts_of_the_people_are_reported_with_their_period(
    tmp_path: Path, is_scattered: bool
) -> None:
    """One person of each second is seen .3 s after the others, as range sensors write times; nobody is left out."""

    def row(step: Step) -> str:
        is_late = is_scattered and step.at.second % 6 + 1 == step.track
        at = step.at + timedelta(seconds=0.3 if is_late else 0)
        return f"{at:%Y-%m-%dT%H:%M:%S.%fZ},{step.track},{step.x_m},{step.y_m}"

    taken = take(tmp_path, "ts,track_id,x_m,y_m", rows_of(row, seconds=120))
    assert taken.codes == (["W224"] if is_scattered else [])
    assert not is_scattered or "--period 1 " in taken.fix
    assert taken.n_new == 720


def test_a_missing_id_is_reported_with_the_column_that_looks_like_one(tmp_path: Path) -> None:
    rows = rows_of(lambda s: f"{s.at.isoformat()},{s.track},{s.x_m},{s.y_m}")
    taken = take(tmp_path, "ts,person_id,x_m,y_m", rows)
    assert (taken.codes, taken.n_new, taken.fix) == (["W225"], 360, "--map track_id=person_id")
    without = take(tmp_path / "b", "ts,_,x_m,y_m", rows)
    assert (without.codes, without.n_new) == (["W225"], 360)


def test_ids_of_rows_are_replaced_by_the_column_that_names_tracks(tmp_path: Path) -> None:
    rows = [f"{s.at.isoformat()},{i},{s.track},{s.x_m},{s.y_m}" for i, s in enumerate(walks())]
    taken = take(tmp_path, "ts,track_id,oid,x_m,y_m", rows)
    assert taken.codes == ["W225"]
    assert taken.fix.endswith("--map track_id=oid")


def test_ids_of_rows_are_no_tracks(tmp_path: Path) -> None:
    rows = [f"{s.at.isoformat()},{i},{s.x_m},{s.y_m}" for i, s in enumerate(walks())]
    assert take(tmp_path, "ts,track_id,x_m,y_m", rows).codes == ["W225"]


def test_shares_of_the_picture_are_no_pixels(tmp_path: Path) -> None:
    rows = rows_of(
        lambda s: f"{s.at.isoformat()},{s.track},{s.x_m / 20 - 0.02},{s.y_m / 24},{s.x_m / 20 + 0.02},{s.y_m / 12}"
    )
    header = "ts,track_id,left,top,right,bottom"
    taken = take(tmp_path, header, rows)
    assert (taken.codes, taken.n_new) == (["W226"], 0)
    assert "--size 1280x720" in taken.fix
    scaled = take(tmp_path, header, rows, size_px=(1280, 720))
    assert (scaled.codes, scaled.n_new) == ([], 360)
    assert scaled.result.card is not None
    assert scaled.result.card.pixels is not None
    assert 600 < scaled.result.card.pixels[1] <= 1280


def test_metres_and_other_resolutions_do_not_fit_the_picture(tmp_path: Path) -> None:
    for factor in (1.0, 300.0):
        rows = rows_of(lambda s, f=factor: f"{s.at.isoformat()},{s.track},{s.x_m * f},{s.y_m * f}")
        assert take(tmp_path, "ts,track_id,u_px,v_px", rows).codes == ["W226"]


def test_check_counts_second_sightings_as_ingest_leaves_them_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = project(tmp_path / "p")
    rows = rows_of(lambda s: f"{s.at:%Y-%m-%dT%H:%MZ},{s.track},{s.x_m},{s.y_m}", seconds=120)
    (root / "a.csv").write_text("\n".join(["ts,track_id,x_m,y_m", *rows]) + "\n")
    shared = ["-C", str(root), "--now", "2025-12-01"]
    assert run(cli, [*shared, "check", str(root / "a.csv"), "--json"]) == 1
    checked = json.loads(capsys.readouterr().out)
    assert run(cli, [*shared, "ingest", str(root / "a.csv"), "--yes", "--json"]) == 1
    stored = json.loads(capsys.readouterr().out)["stored"]["observations"]
    assert checked["counted"]["observations"] == {k: stored[k] for k in ("new", "known", "second_sightings")}
    assert (stored["new"], stored["second_sightings"]) == (12, 708)
    assert [d["code"] for d in checked["sources"][0]["card"]["warnings"]] == ["W224"]
    assert checked["sources"][0]["card"]["rows"][0]["theirs"]["track_id"] == "1"


def test_the_card_comes_before_the_first_import_of_a_new_kind_of_table_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = project(tmp_path / "p")
    lines = rows_of(lambda s: f"{s.at.isoformat()},{s.track},{s.x_m},{s.y_m}")
    printed = []
    for name, header in (("a", "ts,track_id,x_m,y_m"), ("b", "ts,track_id,x_m,y_m"), ("c", "Time,track_id,x_m,y_m")):
        (root / f"{name}.csv").write_text("\n".join([header, *lines]) + "\n")
        renames = ["--map", "ts=time"] if header.startswith("Time") else []
        run(cli, ["-C", str(root), "--now", "2025-12-01", "ingest", str(root / f"{name}.csv"), *renames])
        printed.append("columns " in capsys.readouterr().out)
    assert printed == [True, False, True]


def test_units_are_found_in_names() -> None:
    named = {
        "x_mm": "mm", "X (cm)": "cm", "posMillimeters": "mm", "xMM": "mm", "y_feet": "ft", "world_x_m": "m",
        "u_px": "px", "x": None, "m": None, "time_ms": None, "gym": None, "room": None,
        "foot_x": None, "footPointY": None, "feet.x": None, "pos_feet": "ft", "x_foot": "ft",
    }  # fmt: skip
    assert {name: unit_in_name(name) for name in named} == named


@pytest.mark.parametrize(("per_metre", "unit"), [(1000, "mm"), (100, "cm")])
def test_the_unit_in_which_people_walk_is_proposed_first(tmp_path: Path, per_metre: int, unit: str) -> None:
    rows = rows_of(lambda s: f"{s.at.isoformat()},{s.track},{s.x_m * per_metre:.1f},{s.y_m * per_metre:.1f}")
    taken = take(tmp_path, "ts,track_id,x,y", rows, map={"x_m": "x", "y_m": "y"})
    assert taken.codes[0] == "W220"
    assert taken.fix.startswith(f"--unit {unit} (or ")


def test_ids_that_name_several_cameras_are_doubted(tmp_path: Path) -> None:
    rows = rows_of(lambda s: f"{s.at.isoformat()},cam-{1 + s.track % 2}_{s.track},{s.x_m},{s.y_m}")
    taken = take(tmp_path, "ts,track_id,x_m,y_m", rows)
    assert (taken.codes, taken.n_new) == (["W221"], 0)


@pytest.mark.parametrize(("ours", "is_doubted"), [(("left", "top"), True), (("center_x", "center_y"), False)])
def test_a_list_xywh_that_is_read_from_its_corner_may_be_the_centre(
    tmp_path: Path, ours: tuple[str, str], is_doubted: bool
) -> None:
    root = project(tmp_path / "p")
    message = '{{"ts": "{}", "id": {}, "xywh": [{}, {}, 40, 110]}}\n'
    text = "".join(message.format(s.at.isoformat(), s.track, s.x_m * 50, s.y_m * 50) for s in walks())
    (root / "a.jsonl").write_text(text)
    given = {"ts": "ts", "track_id": "id", "width": "xywh.2", "height": "xywh.3"}
    given |= dict(zip(ours, ("xywh.0", "xywh.1"), strict=True))
    options = IngestOptions(format="json", map=given)
    (source,) = ingest(load_site(root), [root / "a.jsonl"], options, now=NOW).sources
    assert source.card is not None
    assert any("write its centre under this name" in d.what for d in source.card.warnings) == is_doubted

"""`vsd whatif` from engine output to text, JSON, receipt and score, on a hall with a known crowd."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vsd_analytics.answer import Answers
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.predictions import LayoutPrediction, PredictedRange, add_prediction, read_predictions
from vsd_analytics.config.project import load_site
from vsd_analytics.figures.share.answers import share
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.warehouse.warehouse import open_warehouse
from vsd_analytics.whatif.answers import whatif_answers
from vsd_analytics.whatif.closeness import n_close
from vsd_analytics.whatif.floor_records import ALONE, records_of
from vsd_analytics.whatif.place_times import floor_key, place_times, recorded_place
from vsd_analytics.whatif.prediction import RELATIONS, layout_effects, reach_farther, receipt
from vsd_analytics.whatif.scores import LoggedPrediction, prediction_answers, site_record

FIRST = datetime(2026, 11, 2, 9, tzinfo=UTC)  # a Monday
DAYS = "2026-11-02..2026-11-03"
TOML = """
[site]
id = "hall"
name = "Hall"
timezone = "UTC"
opening = { mon-sun = "09:00-10:00" }

[[floor]]
id = "ground"
name = "Ground floor"

[[camera]]
id = "cam-1"
name = "Hall"
floor = "ground"

[[area]]
id = "middle"
name = "Middle"
floor = "ground"
polygon = [[8, 0], [12, 0], [12, 6], [8, 6]]

[[fixture]]
id = "wall"
name = "Wall"
floor = "ground"
polygon = [[0, 6.5], [20, 6.5], [20, 7], [0, 7]]
kind = "wall"

[[fixture]]
id = "stand"
name = "Stand"
floor = "ground"
polygon = [[15, 5.5], [16, 5.5], [16, 6.2], [15, 6.2]]
"""
EDITS = """
[[fixture]]
id = "display"
name = "Display <b>"
polygon = [[9.5, 4.0], [10.5, 4.0], [10.5, 5.4], [9.5, 5.4]]

[[fixture]]
id = "stand"
remove = true

[[fixture]]
id = "cellar"
polygon = [[60, 60], [61, 60], [61, 61]]
"""


def frames() -> Iterator[dict[str, Any]]:
    """Yield an hour of two days with a frame a second: couples and single people who cross the hall."""
    rng = np.random.default_rng(8)
    for d in range(2):
        people = [(rng.uniform(0, 3580), rng.uniform(0.5, 5.8), rng.random() < 0.4) for _ in range(400)]
        for s in range(3600):
            rows = []
            for k, (start, y, is_couple) in enumerate(people):
                if 0 <= (x := 1.2 * (s - start)) <= 20:
                    rows.append((f"{d}-{k}", x, y))
                    if is_couple:
                        rows.append((f"{d}-{k}-b", x, y + 0.7))
            yield {
                "v": 1, "camera": "cam-1", "seq": d * 3600 + s,
                "ts": (FIRST + timedelta(days=d, seconds=s)).strftime("%Y-%m-%dT%H:%M:%S.000Z"),
                "persons": [{"id": i, "x_m": round(x, 3), "y_m": round(y, 3)} for i, x, y in rows],
            }  # fmt: skip


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whatif")
    (folder / "vsd.toml").write_text(TOML, encoding="utf-8")
    (folder / "edit.toml").write_text(EDITS, encoding="utf-8")
    messages = folder / "frames.jsonl"
    messages.write_text("\n".join(json.dumps(frame) for frame in frames()), encoding="utf-8")
    ingest(load_site(folder), [messages], IngestOptions(), now=FIRST + timedelta(days=30))
    return folder


def vsd(project: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = run(cli, ["-C", str(project), "--now", "2026-11-10T08:00:00Z", *arguments])
    out = capsys.readouterr()
    return code, out.out, out.err


def test_each_edit_is_answered_by_itself_and_leaves_a_receipt(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = vsd(project, capsys, "whatif", str(project / "edit.toml"), "--range", DAYS, "--json")
    told = json.loads(out)
    display, stand, cellar = told["answers"]["whatif"]["rows"]
    assert code == 0
    assert [row["edit_outcome"] for row in (display, stand, cellar)] == ["range", "refused", "range"]
    assert 0 < display["n_touched"]["value"] < display["n_near"]["value"]
    places = {(row["number"], row["place_id"]): row for row in told["answers"]["whatif_places"]["rows"]}
    around, middle, floor = (places[1, key]["predicted_change"] for key in ("around", "middle", "floor:ground"))
    assert around["lo"] < 0 < around["hi"]
    assert places[1, "around"]["direction"] == "no_direction"
    assert floor["hi"] - floor["lo"] < around["hi"] - around["lo"]
    assert middle["lo"] < 0 < middle["hi"]
    assert places[2, "around"]["predicted_change"]["value"] is None
    null = places[3, "floor:ground"]["predicted_change"]
    assert (null["lo"], null["hi"]) == (-0.013, 0.013)
    assert told["receipt"]["number"] == 1
    assert told["receipt"]["refusals"] == {"2": "whatif.removed"}
    [way] = [row for row in told["answers"]["whatif_ways"]["rows"] if row["way_name"] == "Wall"]
    assert (way["free_m"], way["under_m"]) == (pytest.approx(1.1), 1.2)
    again = vsd(project, capsys, "whatif", str(project / "edit.toml"), "--range", DAYS, "--json")
    assert json.loads(again[1])["receipt"]["number"] == 1  # the same prediction is one receipt


def test_text_says_what_is_claimed_and_what_is_not(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = vsd(project, capsys, "whatif", str(project / "edit.toml"), "--range", DAYS)
    assert code == 0
    assert "“Display <b>” is in the way of" in out
    assert "no direction is claimed" in out
    assert "1.1 m to “Wall” (under 1.2 m)" in out
    assert "people have never walked there" in out
    assert "No change is expected" in out
    assert "\n1: “Display <b>” is in the way of" in out
    assert "\n3: “cellar”" in out
    assert "vsd log add TEXT --area ID --prediction 1" in err


def test_two_edits_of_one_kind_have_a_sentence_each(
    project: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    edit = tmp_path / "edit.toml"
    posts = ("[[9, 3], [9.2, 3], [9.2, 3.2]]", "[[11, 1], [11.2, 1], [11.2, 1.2]]")
    edit.write_text(
        "".join(f'[[fixture]]\nid = "post-{k}"\nname = "Post"\npolygon = {p}\n' for k, p in enumerate(posts))
    )
    code, out, _ = vsd(project, capsys, "whatif", str(edit), "--range", DAYS, "--no-receipt")
    assert code == 0
    assert "\n1: “Post” is in the way" in out
    assert "\n2: “Post” is in the way" in out


def test_places_of_one_fixture_are_compared_and_two_days_show_no_best_one(
    project: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    edit = tmp_path / "edit.toml"
    shape = "[[0, 0], [1, 0], [1, 1], [0, 1]]"
    edit.write_text(
        f'[[fixture]]\nid = "post"\npolygon = {shape}\nplaces = [[9, 3], [9, 5.2], [18, 6.0]]\n', encoding="utf-8"
    )
    code, out, _ = vsd(project, capsys, "whatif", str(edit), "--range", DAYS, "--no-receipt", "--json")
    assert code == 0
    tables = json.loads(out)["answers"]
    rows = tables["whatif_choices"]["rows"]
    assert [row["edit_name"] for row in rows] == ["post 1", "post 2", "post 3"]
    touched = [row["n_touched"]["value"] for row in tables["whatif"]["rows"]]
    assert [row["touched_per_day"]["value"] * 2 for row in rows] == touched
    assert rows[1]["standing"] == "narrow"  # 0.8 m to the wall
    assert rows[0]["touched_hi"]["value"] is None
    assert "needs at least 5 days, has 2" in str(tables["whatif_choices"]["notes"])


def test_only_refusals_end_with_one_and_leave_no_receipt(
    project: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    edit = tmp_path / "edit.toml"
    edit.write_text("[[one_way]]\nline = [[10, 0], [10, 6]]\n", encoding="utf-8")
    before = read_predictions(load_site(project))
    code, out, _ = vsd(project, capsys, "whatif", str(edit), "--range", DAYS)
    assert code == 1
    assert "was never measured" in out
    assert read_predictions(load_site(project)) == before


def test_time_too_close_is_that_of_the_weekly_figures(project: Path) -> None:
    site = load_site(project)
    days = date(2026, 11, 2), date(2026, 11, 3)
    with open_warehouse(site, *days, relations=RELATIONS) as warehouse:
        records = records_of(warehouse, "ground", *days, (-99, -99, 99, 99))
        found = place_times(warehouse, "ground", *days)[floor_key("ground")]
    is_close = n_close(records.frames, records.x_m, records.y_m, within_m=2.0) > 0
    mine = recorded_place(records, np.ones(is_close.size, np.bool_), is_close)
    assert mine.total_close_s == pytest.approx(found.total_close_s, rel=1e-3)
    assert mine.exposure_s == pytest.approx(found.exposure_s, rel=1e-3)
    couples = np.unique(records.track[records.company != ALONE]).size
    assert couples > 200


_LOCATED = """
select located.camera_id, site_days.site_day, located.track_id, located.ts_ms, located.x_mm, located.y_mm,
    located.weight_ms, located.is_owned, calendar.local_date
from located
inner join calendar on located.ts_ms // 900000 = calendar.quarter
inner join site_days on located.ts_ms // 900000 = site_days.quarter
where calendar.is_open and located.x_mm between 5000 and 12500 and located.y_mm between 1000 and 4000
order by located.ts_ms, located.x_mm, located.y_mm
"""


@pytest.mark.parametrize("accelerated", ["0", "1"])
def test_records_of_a_part_are_those_that_the_query_of_located_has(
    project: Path, accelerated: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VSD_ACCELERATED", accelerated)
    days = date(2026, 11, 2), date(2026, 11, 3)
    with open_warehouse(load_site(project), *days, relations=RELATIONS) as warehouse:
        found = records_of(warehouse, "ground", *days, (5.0, 1.0, 12.5, 4.0))
        rows = warehouse.rows(_LOCATED)
    order = np.lexsort((found.y_m, found.x_m, found.t_s))
    assert len(rows) > 1000
    for name, column, factor in (("t_s", "ts_ms", 1000), ("x_m", "x_mm", 1000), ("weight_s", "weight_ms", 1000)):
        assert getattr(found, name)[order].tolist() == [row[column] / factor for row in rows]
    assert found.is_owned[order].tolist() == [row["is_owned"] for row in rows]
    assert found.day[order].tolist() == [row["local_date"].toordinal() for row in rows]
    ids = [(row["camera_id"], row["site_day"], row["track_id"]) for row in rows]
    assert len(set(zip(found.track[order].tolist(), ids, strict=True))) == len(set(ids)) == np.unique(found.track).size
    frames = [(row["camera_id"], row["ts_ms"]) for row in rows]
    assert len(set(zip(found.frame[order].tolist(), frames, strict=True))) == len(set(frames))
    assert np.unique(found.frame).size == len(set(frames))


def test_an_edit_has_one_answer_alone_and_beside_others(
    project: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """The records of all edits of a file are loaded together."""
    one = '[[fixture]]\nid = "post"\npolygon = [[9, 3], [9.2, 3], [9.2, 3.2]]\n'
    other = '[[fixture]]\nid = "far"\npolygon = [[1, 1], [1.2, 1], [1.2, 1.2]]\n'
    answers = []
    for name, text in (("one", one), ("both", one + other)):
        (tmp_path / name).write_text(text, encoding="utf-8")
        _, out, _ = vsd(project, capsys, "whatif", str(tmp_path / name), "--range", DAYS, "--no-receipt", "--json")
        tables = json.loads(out)["answers"]
        answers.append([row for t in ("whatif", "whatif_places") for row in tables[t]["rows"] if row["number"] == 1])
    assert answers[0] == answers[1]


def test_who_stays_at_the_old_place_is_known_also_where_the_new_one_is_far_away(
    project: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "vsd.toml").write_text(TOML, encoding="utf-8")
    (tmp_path / "edit.toml").write_text(
        '[[fixture]]\nid = "stand"\npolygon = [[1, 5.5], [2, 5.5], [2, 6.2], [1, 6.2]]\n', encoding="utf-8"
    )
    people = [{"id": "stays", "x_m": 15.5, "y_m": 5.0}, {"id": "beside", "x_m": 15.5, "y_m": 4.2}]
    rows = [{**frame, "persons": people} for frame, _ in zip(frames(), range(60), strict=False)]
    (tmp_path / "frames.jsonl").write_text("\n".join(map(json.dumps, rows)), encoding="utf-8")
    ingest(load_site(tmp_path), [tmp_path / "frames.jsonl"], IngestOptions(), now=FIRST + timedelta(days=30))
    _, out, _ = vsd(tmp_path, capsys, "whatif", str(tmp_path / "edit.toml"), "--no-receipt", "--json")
    [row] = json.loads(out)["answers"]["whatif_stays"]["rows"]
    assert (row["n_stays"]["value"], row["close_share"]["value"]) == (2, 1)


def test_purged_days_and_people_without_track_ids_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "vsd.toml").write_text(TOML, encoding="utf-8")
    (tmp_path / "edit.toml").write_text(EDITS, encoding="utf-8")
    messages = tmp_path / "frames.jsonl"
    rows = [{**frame, "persons": [{"x_m": 10.0, "y_m": 4.5}]} for frame, _ in zip(frames(), range(60), strict=False)]
    messages.write_text("\n".join(map(json.dumps, rows)), encoding="utf-8")
    ingest(load_site(tmp_path), [messages], IngestOptions(), now=FIRST + timedelta(days=30))
    code, _, err = vsd(tmp_path, capsys, "whatif", str(tmp_path / "edit.toml"))
    assert code == 2
    assert "no track id" in err
    code, _, err = vsd(tmp_path, capsys, "purge", "--older-than", "2d", "--force")
    assert code == 0, err
    code, _, err = vsd(tmp_path, capsys, "whatif", str(tmp_path / "edit.toml"), "--range", "2026-11-02..2026-11-02")
    assert code == 2
    assert "were purged" in err


def test_few_people_are_hidden_from_readers(project: Path, tmp_path: Path) -> None:
    site = load_site(project)
    days = date(2026, 11, 2), date(2026, 11, 2)
    from vsd_analytics.config.layout_edits import read_edits

    (tmp_path / "edit.toml").write_text(
        '[[fixture]]\nid = "post"\npolygon = [[10, 3], [10.01, 3], [10.01, 3.01]]\n', encoding="utf-8"
    )
    edits = read_edits(tmp_path / "edit.toml", site, last_day=days[1])
    with open_warehouse(site, *days, relations=RELATIONS) as warehouse:
        found = layout_effects(warehouse, edits, *days)
    effect = replace(found.effects[0], n_touched=3)  # type: ignore[type-var]
    exact = Answers(whatif_answers(replace(found, effects=(effect,)), site, around="around"))
    assert exact["whatif"].rows[0]["n_touched"].value == 3  # type: ignore[union-attr]
    shared = share(exact, below=5)
    assert shared["whatif"].rows[0]["n_touched"].value is None  # type: ignore[union-attr]
    assert shared["whatif"].rows[0]["touched_share"].value is None  # type: ignore[union-attr]
    assert "close_min_per_open_h" not in {c.name for c in shared["whatif_places"].columns}


def test_a_log_entry_names_its_receipt(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vsd(project, capsys, "whatif", str(project / "edit.toml"), "--range", DAYS)
    add = ("log", "add", "display put up", "--at", "2026-11-10T07:00", "--area", "middle")
    code, _, err = vsd(project, capsys, *add, "--prediction", "99")
    assert code == 2
    assert "there is no prediction 99" in err
    assert vsd(project, capsys, *add, "--prediction", "1")[0] == 0
    assert json.loads((project / "log.jsonl").read_text(encoding="utf-8"))["prediction"] == 1
    code, out, _ = vsd(project, capsys, "whatif", "--scores", "--json")
    told = json.loads(out)["answers"]
    assert code == 0
    [row] = told["prediction_scores"]["rows"]
    assert (row["number"], row["entry"], row["area_id"], row["held"]) == (1, 1, "middle", None)
    assert "0 of 0 predictions held; 1 are not due" in str(told["prediction_scores"]["notes"])


@pytest.mark.parametrize(("theta", "n_weeks", "held"), [(0.95, 4, True), (0.7, 4, False), (0.95, 3, None)])
def test_a_prediction_held_where_the_ratio_measured_lies_in_its_range(
    project: Path, theta: float, n_weeks: int, held: bool | None
) -> None:
    from types import SimpleNamespace

    site = load_site(project)
    made = date(2026, 11, 2)
    ranges = (PredictedRange(1, "middle", -0.1, 0.05), PredictedRange(1, "around", -0.1, 0.05))
    receipt = LayoutPrediction(made, "", "", "", "", made, made, "ground", ranges, {})
    running = SimpleNamespace(value=theta, n_weeks=n_weeks)
    found: Any = SimpleNamespace(running=running, reason=None, area_id="middle", area_name="Middle")
    _, scores, _ = prediction_answers([receipt], [LoggedPrediction(1, 1, found)], site, today=made)
    [row] = scores.rows
    assert row["held"] is held
    n_due = int(held is not None)
    assert scores.notes[0][1].values == {"held": int(held is True), "scored": n_due, "open": 1 - n_due}


def came_out(change: float, *, number: int = 1, n_weeks: int = 4) -> LoggedPrediction:
    from types import SimpleNamespace

    running = SimpleNamespace(value=1 + change, n_weeks=n_weeks)
    figure: Any = SimpleNamespace(running=running, reason=None, area_id="middle", area_name="Middle")
    return LoggedPrediction(number, 1, figure)


def receipt_of(lo: float, hi: float) -> LayoutPrediction:
    made = date(2026, 11, 2)
    ranges = (PredictedRange(1, "middle", lo, hi), PredictedRange(1, "around", lo, hi))
    return LayoutPrediction(made, "", "", "", "", made, made, "ground", ranges, {})


@pytest.mark.parametrize(
    ("changes", "n_held", "wider_by"),
    [
        ([], 0, 0.0),
        ([0.0] * 9 + [0.4], 9, 0.0),  # nine of ten: as often as a range is to hold
        ([0.0] * 8 + [-0.4, 0.3], 8, 0.2),  # nine of ten would have held with 0.2 more on both sides
        ([0.25], 0, 0.15),
    ],
)
def test_a_site_where_fewer_than_nine_of_ten_held_has_ranges_that_would_have_held_as_many(
    changes: list[float], n_held: int, wider_by: float
) -> None:
    logged = [came_out(change) for change in changes] + [came_out(9.0, n_weeks=3)]  # the last one is not due
    record = site_record([receipt_of(-0.1, 0.1)], logged)
    assert (record.n_scored, record.n_held) == (len(changes), n_held)
    assert record.wider_by == pytest.approx(wider_by)
    again = site_record([receipt_of(-0.1 - record.wider_by, 0.1 + record.wider_by + 1e-9)], logged)
    assert again.n_held >= 0.9 * again.n_scored


def test_the_record_of_the_site_and_the_shipped_one_are_listed_and_enter_later_ranges(project: Path) -> None:
    site = load_site(project)
    answers = prediction_answers([receipt_of(-0.1, 0.1)], [came_out(0.25)], site, today=date(2026, 12, 24))
    rows = {row["record_of"]: row for row in answers[2].rows}
    assert set(rows) == {"site", "exit", "entrance", "opening", "scene"}
    assert rows["site"]["n_held"].value == 0  # type: ignore[union-attr]
    assert rows["site"]["wider_by"].value == pytest.approx(0.15)  # type: ignore[union-attr]
    assert rows["opening"]["wider_by"].value is None  # type: ignore[union-attr]
    from vsd_analytics.config.layout_edits import read_edits

    days = date(2026, 11, 2), date(2026, 11, 3)
    edits = read_edits(project / "edit.toml", site, last_day=days[1])
    with open_warehouse(site, *days, relations=RELATIONS) as warehouse:
        found = layout_effects(warehouse, edits, *days)
    wider = reach_farther(found, 0.15)
    ends = [[(r.lo, r.hi) for r in receipt(p, made=days[1], settings="").ranges] for p in (found, wider)]
    assert len(ends[0]) > 3
    assert ends[1] == [(pytest.approx(lo - 0.15), pytest.approx(hi + 0.15)) for lo, hi in ends[0]]
    assert reach_farther(found, 0.0) is found


def test_a_receipt_is_never_altered_and_a_broken_line_is_named(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_text(TOML, encoding="utf-8")
    site = load_site(tmp_path)
    made = date(2026, 11, 2)
    one = LayoutPrediction(
        made, "a", "", "", "", made, made, "ground", (PredictedRange(1, "middle", -0.1, 0.05),), {2: "x"}
    )
    two = replace(one, edit="b")
    assert [add_prediction(site, p) for p in (one, two, one)] == [1, 2, 1]
    assert read_predictions(site) == (one, two)
    file = tmp_path / "predictions.jsonl"
    file.write_text(file.read_text(encoding="utf-8") + '{"made": 3}\n', encoding="utf-8")
    with pytest.raises(Exception, match=r"line 3 of predictions.jsonl is not a receipt"):
        add_prediction(site, replace(one, edit="c"))

"""Person-time that one version of a week held back is told by no later version, though many came in the meantime."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from report import ingested_worlds as w

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.site.model import Site

MANY = {w.QUEUE: 30, w.DOOR: 30}
ALONE_H, BUSY_H, OTHER_H = 9, 10, 11


def one_person_at_nine() -> list[dict[str, Any]]:
    """One person is there for some minutes of the first hour of each day, and many in both later hours."""
    stream = []
    for k, message in enumerate(w.messages(lambda _, hour: {} if hour == ALONE_H else MANY, is_alone=False)):
        is_there = k % (3 * 180) < 39
        stream.append({**message, "persons": [w.person("alone", *w.ALONE)] if is_there else message["persons"]})
    return stream


def shared(site: Site, capsys: pytest.CaptureFixture[str], *, now: str = "2026-11-20T12:00:00Z") -> dict[str, Any]:
    arguments = ["-C", str(site.root), "--now", now, "report", "--week", "2026-W46", "--json"]
    assert run(cli, arguments) == 0
    report: dict[str, Any] = json.loads(capsys.readouterr().out)
    return report["reports"][0] if "reports" in report else report


def times_by_hour(report: dict[str, Any]) -> dict[int, list[float | None]]:
    found: dict[int, list[float | None]] = {}
    for cell in report["when"]["cells"]:
        found.setdefault(int(cell["start"][11:13]), []).append(cell["close_time_share"])
    return found


def test_hours_stay_without_a_time_when_many_people_of_them_arrive_late(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The hour beside was hidden with that of one person; given later, it would leave the time of this one."""
    site = w.world(tmp_path / "shop", w.toml(cameras=("cam-1", "cam-2")), one_person_at_nine())
    first = times_by_hour(shared(site, capsys))
    assert set(first[ALONE_H]) == {None}
    assert first[BUSY_H].count(None) == 1, "one goes with all of them"
    late = w.messages(lambda _, hour: MANY if hour == ALONE_H else {}, camera="cam-2", is_alone=False)
    w.add(site, late, name="late")
    again = times_by_hour(shared(site, capsys))
    assert (set(again[ALONE_H]), again[BUSY_H], again[OTHER_H]) == ({None}, first[BUSY_H], first[OTHER_H])
    (tmp_path / "shop" / "shared.jsonl").unlink()
    assert None not in times_by_hour(shared(site, capsys))[BUSY_H], "without memory it would leave"


def test_areas_stay_without_a_time_when_many_people_of_them_arrive_late(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One person stands on the rest of the floor, whose time is hidden with that of an area."""

    def hidden() -> set[str | None]:
        rows = shared(site, capsys)["answers"]["areas"]["rows"]
        return {row["area_id"] for row in rows if row["close_time_share"]["value"] is None}

    site = w.world(tmp_path / "shop", w.toml(cameras=("cam-1", "cam-2")), w.messages(w.steady(MANY)))
    first = hidden()
    assert None in first
    assert len(first) == 2
    many = [w.person(f"late-{k}", w.ALONE[0] - 0.4 * k, w.ALONE[1]) for k in range(8)]
    late = ({**message, "persons": many} for message in w.messages(w.steady({}), camera="cam-2", is_alone=False))
    w.add(site, late, name="late")
    assert hidden() == first
    (tmp_path / "shop" / "shared.jsonl").unlink()
    assert hidden() == set(), "without memory they would leave"


def test_an_area_that_waits_for_the_end_of_its_week_has_its_time_then(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A page of the running week holds back areas whose people are still few; the week's own page loses nothing."""

    def few_at_first(day: int, hour: int) -> dict[Any, int]:
        many = {w.QUEUE: 30, w.DOOR: 30} if day > 3 else {w.QUEUE: 30}
        return many | ({w.DOOR: 1} if day < 3 and hour == ALONE_H else {})

    def hidden(now: str) -> set[str | None]:
        rows = shared(site, capsys, now=now)["answers"]["areas"]["rows"]
        return {row["area_id"] for row in rows if row["close_time_share"]["value"] is None}

    site = w.world(tmp_path / "shop", w.toml(), w.messages(few_at_first, is_alone=False))
    end = "2026-11-20T12:00:00Z"
    without = hidden(end)
    (tmp_path / "shop" / "shared.jsonl").unlink()
    assert "door" in hidden("2026-11-13T07:00:00Z")
    assert "door" not in without
    assert hidden(end) == without

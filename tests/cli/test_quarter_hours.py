"""`vsd hours --minutes 15`: the quarter-hours of an hour add up to it, and what was not recorded is unknown."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

CONFIG = """
[site]
id = "shop"
name = "Shop"
timezone = "{zone}"
opening = {{ mon-sun = "08:30-20:00" }}

[[floor]]
id = "ground"
name = "Ground floor"

[[camera]]
id = "cam"
name = "Cam"
"""
START = datetime(2026, 11, 9, 9, 5, tzinfo=UTC)
COUNTS = ("person_records", "violation_records", "n_violations", "exposure_s", "violation_s")
Vsd = Callable[..., tuple[int, str, str]]


def messages() -> str:
    """Return frames of 100 minutes, a second each: two people meet every five minutes; 20 minutes are missing."""
    lines = []
    for second in range(6000):
        if 2400 <= second < 3600:
            continue
        apart_m = 1.0 if second % 300 < 30 else 5.0
        persons = [{"id": "a", "x_m": 1.0, "y_m": 1.0}, {"id": "b", "x_m": 1.0 + apart_m, "y_m": 1.0}]
        ts = (START + timedelta(seconds=second)).isoformat()
        lines.append(json.dumps({"v": 1, "camera": "cam", "ts": ts, "persons": persons}))
    return "\n".join(lines)


@pytest.fixture(params=["UTC", "Asia/Kolkata"])
def vsd(request: pytest.FixtureRequest, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    (tmp_path / "vsd.toml").write_text(CONFIG.format(zone=request.param))

    def call(*arguments: str | Path) -> tuple[int, str, str]:
        code = run(cli, ["-C", str(tmp_path), "--now", "2026-11-20T00:00:00Z", *map(str, arguments)])
        out, err = capsys.readouterr()
        return code, out, err

    (tmp_path / "a.jsonl").write_text(messages())
    assert call("ingest", tmp_path / "a.jsonl")[0] == 0
    return call


def rows(vsd: Vsd, *arguments: str) -> list[dict[str, Any]]:
    code, out, _ = vsd("hours", "--range", "2026-11-09", *arguments, "--json")
    assert code == 0
    (found,) = (value for key, value in json.loads(out).items() if key in ("hours", "quarter_hours"))
    return list(found)


def test_quarter_hours_add_up_to_their_hour(vsd: Vsd) -> None:
    hours, quarters = rows(vsd), rows(vsd, "--minutes", "15")
    assert len(quarters) == 4 * len(hours) == 96
    assert rows(vsd, "--minutes", "60") == hours
    assert sum(h["n_violations"] or 0 for h in hours) == 16
    for i, hour in enumerate(hours):
        own = quarters[4 * i : 4 * i + 4]
        assert own[0]["start"] == hour["start"]
        for name in COUNTS:
            known = [q[name] for q in own if q[name] is not None]
            assert hour[name] == (pytest.approx(sum(known)) if known else None), name
        assert sum(q["recorded_s"] for q in own) == pytest.approx(hour["recorded_s"])
        assert sum(q["open_s"] for q in own) == hour["open_s"]


def test_a_quarter_hour_without_data_is_unknown_and_one_recorded_in_part_says_so(vsd: Vsd) -> None:
    of = {q["start"][11:16]: q for q in rows(vsd, "--minutes", "15")}
    first = "09:45" if "09:45" in of and of["09:45"]["recorded_s"] == 0 else "15:15"
    assert of[first]["state"] == "no_data"
    assert all(of[first][name] is None for name in COUNTS)
    assert {q["state"] for q in of.values()} >= {"full", "no_data", "closed"}
    assert 0 < min(q["recorded_s"] for q in of.values() if q["recorded_s"]) < 900


def test_the_same_rows_by_sql_and_as_text(vsd: Vsd) -> None:
    code, out, _ = vsd("hours", "--range", "2026-11-09", "--minutes", "15")
    assert code == 0
    assert "no_data" in out
    code, out, _ = vsd(
        "sql", "select sum(n_violations) as n from quarter_hours", "--range", "2026-11-09", "--format", "csv"
    )
    assert (code, out.split()) == (0, ["n", "16"])


@pytest.mark.parametrize(
    ("arguments", "fix"),
    [(["--minutes", "10"], "--minutes 15"), (["--minutes", "15", "--by", "camera"], "leave out --by")],
)
def test_other_lengths_are_refused_with_a_fix(vsd: Vsd, arguments: list[str], fix: str) -> None:
    code, _, err = vsd("hours", "--range", "2026-11-09", *arguments)
    assert code == 2
    assert "E101" in err
    assert fix in err

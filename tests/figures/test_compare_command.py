"""`vsd compare` from engine output to what is on the screen: a planted redesign, and a recalibration inside it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.plans import DaysInTurn, Plan, add_plan
from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.stats.decomposition import concentration

FIRST = datetime(2026, 11, 2, 9, tzinfo=UTC)  # a Monday
AREAS = ("queue", "door", "aisle", "fruit", "bakery", "back")
WEEKS = 2
STEP_MS = 10_000


def toml() -> str:
    blocks = [
        '[site]\nid = "shop"\nname = "Shop"\ntimezone = "UTC"\nopening = { mon-sun = "09:00-10:00" }',
        "[report]\nmin_exposure_h = 1.0",
        "[analysis]\nwashout_days = 0",
        '[[floor]]\nid = "ground"\nname = "Ground floor"',
        '[[camera]]\nid = "cam-1"\nname = "Hall"\nfloor = "ground"',
    ]
    for k, name in enumerate(AREAS):
        x = 20 * k
        ring = [[x, 0], [x + 8, 0], [x + 8, 8], [x, 8]]
        blocks.append(f'[[area]]\nid = "{name}"\nname = "{name.title()}"\nfloor = "ground"\npolygon = {ring}')
    return "\n\n".join(blocks) + "\n"


def frames() -> Iterator[dict[str, Any]]:
    """Yield two weeks of an open hour a day: in each area one person alone, and pairs; half of the queue's go."""
    rng = np.random.default_rng(5)
    for d in range(7 * WEEKS):
        slots = {name: rng.permutation(90)[: round(40 * (0.5 if name == "queue" and d >= 7 else 1))] for name in AREAS}
        start = FIRST + timedelta(days=d)
        for ms in range(0, 3_600_000, STEP_MS):
            slot, into = divmod(ms, 40_000)
            people = []
            for k, name in enumerate(AREAS):
                people.append((f"alone-{k}", 20 * k + 6.5, 6.5))
                if into <= STEP_MS and slot in slots[name]:
                    people += [(f"{d}-{k}-{slot}-{s}", 20 * k + 2 + 1.5 * s, 2.0) for s in (0, 1)]
            yield {
                "v": 1,
                "camera": "cam-1",
                "ts": (start + timedelta(milliseconds=ms)).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
                "engine": "acme 1.0",
                "quality": "metric",
                "persons": [{"id": i, "u_px": round(100 * x, 1), "v_px": round(100 * y, 1)} for i, x, y in people],
            }


def calibrate(root: Path, *since: tuple[float, str]) -> None:
    folder = root / "calibration"
    folder.mkdir(parents=True, exist_ok=True)
    entries = []
    for k, (scale, start) in enumerate(since):
        np.savetxt(folder / f"cam-1-{k}.txt", np.diag([scale / 100, scale / 100, 1.0]))
        entries.append(f'[[calibration]]\nhomography = "calibration/cam-1-{k}.txt"\nfrom = {start}\n')
    (folder / "cam-1.toml").write_text("".join(entries), encoding="utf-8")


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("redesign")
    (root / "vsd.toml").write_text(toml(), encoding="utf-8")
    calibrate(root, (1.0, "2026-10-01T00:00:00+00:00"))
    entries = (
        {"at": "2026-11-09T07:00:00+00:00", "text": "moved the queue", "area": "queue"},
        {"at": "2026-11-10T07:00:00+00:00", "text": "new staff", "area": None},
    )
    (root / "log.jsonl").write_text("".join(json.dumps(e) + "\n" for e in entries), encoding="utf-8")
    (root / "engine.jsonl").write_text("".join(json.dumps(m) + "\n" for m in frames()), encoding="utf-8")
    result = ingest(
        load_site(root),
        [root / "engine.jsonl"],
        IngestOptions(format="frames"),
        now=datetime(2027, 1, 1, tzinfo=UTC),
    )
    assert result.n_rejected == 0
    return root


def hand_map(n_queue: int) -> np.ndarray:
    """Return person-seconds of a day by cell, with so many pairs in the queue."""
    made = np.zeros((32, 4 * 20 * len(AREAS)))
    for k, name in enumerate(AREAS):
        made[26, 80 * k + 26] += 3600
        for s in (0, 1):
            made[8, 80 * k + 8 + 6 * s] += 20 * (n_queue if name == "queue" else 40)
    return made


def vsd(root: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    capsys.readouterr()
    code = run(cli, ["-C", str(root), "--now", "2026-11-20T12:00:00Z", *arguments])
    return code, capsys.readouterr().out


def test_the_planted_redesign_is_found(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out = vsd(project, capsys, "compare", "--change", "1", "--json")
    found = json.loads(out)
    [change] = found["answers"]["logged_change"]["rows"]
    assert (code, change["design"], change["is_credible"]) == (0, "beside", True)
    assert change["comparison_area_ids"] == list(AREAS[1:])
    assert (change["before_first"], change["before_last"]) == ("2026-11-02", "2026-11-08")
    effects = {row["effect"]: row for row in found["answers"]["change_effects"]["rows"]}
    per_open_h, per_person_h = (effects[f"violations_per_{unit}"] for unit in ("open_h", "person_h"))
    assert per_open_h["effect_change"]["value"] == pytest.approx(-0.5, rel=0.02)
    assert "effect_verdict" not in per_open_h, "a change has one verdict, the running one"
    ratio = 0.5 * (3600 + 40 * 40) / (3600 + 20 * 40)
    assert 1 + per_person_h["effect_change"]["value"] == pytest.approx(ratio, rel=0.01)
    assert per_person_h["n_comparison_areas"] == 5
    assert per_person_h["by_placebo"]["value"] == per_person_h["effect_change"]["value"]
    code, out = vsd(project, capsys, "compare", "--change", "1")
    assert code == 0
    assert "Logged change, 2026-11-02 to 2026-11-15" in out
    assert "moved the queue" in out
    assert re.search(r"violations per open hour +-50%", out)
    assert "cannot tell yet" in out, "one week before is too little for a verdict"
    assert "1 of the requested 4 weeks are stored on both sides" in out


def test_an_area_left_alone_has_no_effect(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out = vsd(project, capsys, "compare", "--change", "2", "--area", "back", "--json")
    found = json.loads(out)
    assert code == 1
    assert found["answers"]["change_effects"]["nothing"].startswith("needs a whole week after the change, and 6 days")
    assert vsd(project, capsys, "compare", "--change", "2", "--json")[0] == 2, "the whole site has no comparison"


def test_two_weeks_and_their_areas(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out = vsd(project, capsys, "compare", "last-1", "last", "--json")
    found = json.loads(out)
    assert code == 0
    answers = found["answers"]
    areas = {p["area_id"] or p["kind"]: p for p in answers["compared_places"]["rows"]}
    assert areas["queue"]["violations_per_open_h_verdict"] == "clear_fall"
    assert areas["door"]["violations_per_open_h_verdict"] == "cannot_tell"
    n_before, n_now = 6 * 40, 5 * 40 + 20
    floor = areas["floor"]
    assert [floor[f"n_compared_{when}"]["value"] for when in ("before", "after")] == [7 * n_before, 7 * n_now]
    assert floor["violations_per_open_h_change"]["value"] == pytest.approx(n_now / n_before - 1, rel=1e-5)
    causes = {c["cause"]: c for c in answers["change_causes"]["rows"]}
    changes = {name: c["cause_change"]["value"] for name, c in causes.items()}
    assert changes["close_time"] == pytest.approx(n_now / n_before - 1, rel=1e-5)
    product = np.prod([1 + changes[name] for name in ("crowding", "layout", "behaviour")])
    assert product == pytest.approx(n_now / n_before, rel=1e-4)
    parts = [causes[name]["cause_part"]["value"] for name in ("crowding", "layout", "behaviour")]
    assert sum(parts) == pytest.approx(changes["close_time"], rel=1e-4)
    periods = answers["compared_periods"]["rows"]
    for period, n in zip(periods, (40, 20), strict=True):
        chance = concentration(hand_map(n), cell_m=0.25, distance_m=2.0)
        assert period["layout_chance"]["value"] == pytest.approx(chance, rel=1e-5)
        assert period["close_pair_h"]["value"] == pytest.approx(7 * (5 * 40 + n) * 20 / 3600, rel=1e-5)
    assert periods[0]["layout_chance"] != periods[1]["layout_chance"]
    printed = vsd(project, capsys, "compare", "last-1", "last")[1]
    # six people alone all hour, and pairs of whom both are too close for 20 s
    close_s = {n: n * 2 * 20 for n in (n_before, n_now)}
    shares = [f"{s / (6 * 3600 + s):.0%}" for s in close_s.values()]
    assert [share in floor_line(printed, "share of time too close") for share in shares] == [True, True]
    minutes = floor_line(printed, "person-minutes too close per open hour")
    assert [f"{s / 60:.0f}" in minutes for s in close_s.values()] == [True, True], minutes
    code, out = vsd(project, capsys, "compare", "2026-11-02..2026-11-08", "2026-W46", "--area", "queue")
    assert code == 0
    assert "compared over 7 pairs of days, 7.0 camera-hours recorded in both" in out
    assert "levels are of all recorded hours of each period" not in out
    uneven = vsd(project, capsys, "compare", "2026-11-02..2026-11-08", "2026-11-09..2026-11-14")[1]
    assert "levels are of all recorded hours of each period, changes of the hours recorded in both" in uneven
    assert "without a partner of its weekday: 2026-11-08" in uneven
    assert "Queue" in out
    assert "Door" not in out


def floor_line(printed: str, rate: str) -> str:
    """Return the line of the floor in the table of a rate."""
    lines = printed.splitlines()
    [head] = [k for k, line in enumerate(lines) if f"{rate}: before" in line]
    assert lines[head + 1].startswith("Ground floor")
    return lines[head + 1]


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["last"], 2),
        (["last", "last"], 2),
        (["2026-W45", "soon"], 2),
        (["--change", "9"], 2),
        (["--change", "0"], 2),
        (["--change", "1", "last"], 2),
        (["--change", "1", "--area", "cellar"], 2),
        (["2026-W45", "2026-W46", "--area", "cellar"], 2),
        (["2026-W45", "2026-W46", "--floor", "roof"], 2),
        (["2026-W45", "2026-W47"], 1),
    ],
)
def test_what_cannot_be_compared_says_so(
    project: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], code: int
) -> None:
    found, out = vsd(project, capsys, "compare", *arguments, "--json")
    assert found == code
    told = json.loads(out)
    assert (told["code"] == "E101") if code == 2 else told["answers"]["compared_places"]["nothing"]


def test_recalibration_inside_the_weeks_is_refused(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    calibrate(project, (1.0, "2026-10-01T00:00:00+00:00"), (1.05, "2026-11-12T08:00:00+00:00"))
    try:
        code, out = vsd(project, capsys, "compare", "--change", "1", "--json")
        told = json.loads(out)
        effects = told["answers"]["change_effects"]
        assert (code, effects["state"], effects["rows"]) == (1, "not_measurable", [])
        assert "recalibrated between" in effects["nothing"]
        code, out = vsd(project, capsys, "compare", "last-1", "last")
        assert code == 1
        assert "recalibrated between the periods: cam-1" in out
    finally:
        calibrate(project, (1.0, "2026-10-01T00:00:00+00:00"))


def test_a_plan_needs_weeks_and_says_how_many(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out = vsd(project, capsys, "plan", "--area", "queue", "--effect", "-0.15", "--json")
    found = json.loads(out)
    choices = found["answers"]["plan_choices"]
    assert (code, choices["state"], found["stored"]) == (1, "not_enough_data", None)
    assert "needs at least 4 weeks before the change" in choices["nothing"]
    assert not (project / "plans.jsonl").exists()
    code, _ = vsd(project, capsys, "plan", "--area", "queue")
    assert code == 2
    code, out = vsd(project, capsys, "plan", "--json")
    assert (code, json.loads(out)["answers"]["plans"]["rows"]) == (0, [])


def test_days_in_turn_are_laid_out_and_read(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The queue has half of its pairs in the second week, whose days are those with the change here."""
    code, out = vsd(project, capsys, "plan", "--area", "queue", "--effect", "-0.3", "--in-turn", "--json")
    found = json.loads(out)
    assert (code, found["stored"], found["number"]) == (1, None, None)
    assert "needs at least 4 weeks" in found["answers"]["switchback_weeks"]["nothing"]
    for arguments in (("--weeks", "4"), ("--in-turn", "--weeks", "3")):
        assert vsd(project, capsys, "plan", "--area", "queue", "--effect", "-0.3", *arguments)[0] == 2
    assert vsd(project, capsys, "compare", "--in-turn", "1")[0] == 2
    days = [(FIRST.date() + timedelta(days=7 + k), FIRST.date() + timedelta(days=k)) for k in range(7)]
    plan = Plan(
        made=FIRST.date(), area="queue", effect=-0.3, power=0.8, first=FIRST.date(), last=FIRST.date(), weeks_before=4,
        weeks_after=2, power_then=0.5, theta_lo=0.5, theta_hi=0.9, compared_with=AREAS[1:],
        in_turn=DaysInTurn(1, tuple(days)),
    )  # fmt: skip
    try:
        add_plan(load_site(project), plan)
        code, out = vsd(project, capsys, "compare", "--in-turn", "1", "--json")
        [row] = json.loads(out)["answers"]["switchback"]["rows"]
        assert (code, row["in_turn_verdict"], row["p_value"]["value"]) == (0, "clear_fall", 0.015625)
        assert row["in_turn_change"]["value"] == pytest.approx(-0.5, abs=0.02)
        code, out = vsd(project, capsys, "compare", "--in-turn", "1")
        assert "clear fall" in out
        assert "does not act on the next day" in out
        assert vsd(project, capsys, "plan")[0] == 0
    finally:
        (project / "plans.jsonl").unlink(missing_ok=True)

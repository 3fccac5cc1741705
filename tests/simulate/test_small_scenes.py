from __future__ import annotations

from collections import Counter, defaultdict
from datetime import datetime
from itertools import pairwise
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from simulate.small_scenes import make_empty, make_pair, make_walk, make_week, merge, simulate_frames

from vsd_analytics.simulate.demo_project import opening

ROME = ZoneInfo("Europe/Rome")


def count_violations(messages: list[dict], *, gap_s: float = 3.0) -> Counter[str]:  # type: ignore[type-arg]
    """Count episodes under 2 m of at least 3 s per camera, the plainest way."""
    seen: dict[tuple[str, str, str], list[float]] = defaultdict(list)
    for m in messages:
        at = datetime.fromisoformat(m["ts"]).timestamp()
        people = m["persons"]
        for i, a in enumerate(people):
            for b in people[i + 1 :]:
                if np.hypot(a["x_m"] - b["x_m"], a["y_m"] - b["y_m"]) < 2.0:
                    seen[m["camera"], *sorted((a["id"], b["id"]))].append(at)
    counts: Counter[str] = Counter()
    for (camera, _, _), times in seen.items():
        breaks = [0, *(np.flatnonzero(np.diff(times) > gap_s) + 1), len(times)]
        counts[camera] += sum(times[e - 1] - times[s] >= 3.0 for s, e in pairwise(breaks))
    return counts


def test_a_pair_one_and_a_half_metres_apart_for_ten_seconds_is_one_violation() -> None:
    pair = make_pair(1.5, 10.0)
    assert len(pair) == 11
    assert pair[0]["ts"] == "2026-11-09T08:00:00.000Z"
    assert count_violations(pair) == {"cam-1": 1}
    assert not count_violations(make_pair(2.0, 10.0)).total(), "two metres are not closer than two metres"
    assert not count_violations(make_pair(1.5, 2.0)).total()


def test_a_walk_ends_where_it_should_at_constant_speed() -> None:
    walk = make_walk((0.0, 0.0), (12.0, 0.0), duration_s=10.0)
    x = [m["persons"][0]["x_m"] for m in walk]
    assert (x[0], x[-1]) == (0.0, 12.0)
    assert np.diff(x) == pytest.approx(1.2)


def test_merge_joins_people_of_one_camera_and_instant() -> None:
    frames = merge(
        make_empty(12.0),
        make_walk((0.0, 5.0), (10.0, 5.0), duration_s=10.0, track="3"),
        make_pair(1.5, 10.0, ids=("1", "2")),
        make_empty(3.0, camera="cam-2"),
    )
    assert len(frames) == 13 + 4
    assert [m["ts"] for m in frames] == sorted(m["ts"] for m in frames)
    assert [len(m["persons"]) for m in frames if m["camera"] == "cam-1"] == [3] * 11 + [0, 0]


def test_a_week_has_the_violations_it_says() -> None:
    week = make_week(cameras=("cam-1", "cam-2"), hotspot=(20.0, 8.0))
    counts = count_violations(week.messages, gap_s=5.0)
    assert counts == {"cam-1": 7 * 3 * 9, "cam-2": 7 * 3 * 9}
    assert sum(week.violations.values()) == counts.total()
    assert len(week.messages) == 2 * 7 * 3 * 1800


def test_a_week_with_an_outage_lacks_its_frames_and_violations_of_that_camera_only() -> None:
    start, end = datetime(2026, 11, 12, 10, tzinfo=ROME), datetime(2026, 11, 13, 10, tzinfo=ROME)
    week = make_week(cameras=("cam-1", "cam-2"), outage=("cam-2", start, end))
    counts = count_violations(week.messages, gap_s=5.0)
    assert counts == {"cam-1": 7 * 3 * 3, "cam-2": (7 * 3 - 3) * 3}
    assert week.violations["cam-2", start] == 0
    assert week.violations["cam-1", start] == 3
    down = [m for m in week.messages if m["camera"] == "cam-2" and start <= datetime.fromisoformat(m["ts"]) < end]
    assert not down


def test_frames_of_the_shop_come_camera_by_camera() -> None:
    opens, closes = opening(datetime(2026, 11, 15).date())
    frames = list(simulate_frames(opens, closes=closes, interval_s=10.0, cameras=("cam-2",), busy=0.5))
    assert len(frames) == 8.5 * 360
    assert {m["camera"] for m in frames} == {"cam-2"}
    assert any(m["persons"] for m in frames)

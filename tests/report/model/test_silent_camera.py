"""A camera that records nothing for a week: its floor is not known, and no number reads as a fall."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import shapely
from report import ingested_worlds as w

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.story import finish
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.wording.reasons import reason_text

VIEWS = {
    "1": [[0, 0], [10, 0], [10, 10], [0, 10]],
    "2": [[10, 0], [20, 0], [20, 10], [10, 10]],
    "3": [[0, 10], [10, 10], [10, 20], [0, 20]],
}
OWN, THIRD = {(13.0, 3.0): 10}, {(3.0, 13.0): 5}


@pytest.fixture(scope="module")
def silent(tmp_path_factory: pytest.TempPathFactory) -> WeekReport:
    """Three cameras beside each other; the second recorded the week before and nothing since."""
    config = w.toml(
        cameras=("cam-1", "cam-2", "cam-3"), areas={"queue": w.AREAS["queue"], "far": ("Far", (11, 1, 19, 5))}
    )
    for name, ring in VIEWS.items():
        config = config.replace(f'name = "Camera {name}"\n', f'name = "Camera {name}"\nview = {ring}\n')

    site = w.world(
        tmp_path_factory.mktemp("silent"),
        config,
        w.messages(w.steady({w.QUEUE: 20}), monday=w.BEFORE, is_alone=False),
        w.messages(w.steady({w.QUEUE: 20}), is_alone=False),
        w.messages(w.steady(THIRD), monday=w.BEFORE, camera="cam-3", is_alone=False),
        w.messages(w.steady(THIRD), camera="cam-3", is_alone=False),
        w.messages(w.steady(OWN), monday=w.BEFORE, camera="cam-2", is_alone=False),
    )
    return finish(w.report(site))


def test_the_headline_and_the_lead_name_what_is_missing(silent: WeekReport) -> None:
    assert [c.is_silent for c in silent.coverage.cameras] == [False, True, False]
    assert silent.story is not None
    assert silent.story.headline.endswith("without camera 2")
    assert "Camera 2 recorded nothing" in "".join(s.text for s in silent.story.lead)


@pytest.mark.parametrize(
    ("count", "has_before", "begins"),
    [(20, False, "25 violations"), (0, True, "No violations"), (1, True, "Very few violations")],
    ids=["first-week", "empty", "few"],
)
def test_a_week_that_is_compared_with_nothing_names_it_too(
    tmp_path: Path, count: int, has_before: bool, begins: str
) -> None:
    def counts(day: int, hour: int) -> dict[w.Place, int]:
        return (
            {} if not count or (count == 1 and (day or hour > 9)) else {w.QUEUE: count, **(THIRD if count > 1 else {})}
        )

    streams = [w.messages(counts), w.messages(w.steady({}), camera="cam-3")]
    if has_before:
        streams += [w.messages(w.steady(OWN), monday=w.BEFORE, camera=c) for c in ("cam-1", "cam-2", "cam-3")]
    report = finish(w.report(w.world(tmp_path, w.toml(cameras=("cam-1", "cam-2", "cam-3")), *streams)))
    assert report.story is not None
    assert report.story.headline.startswith(begins)
    assert report.story.headline.endswith("; camera 2 recorded nothing")
    assert "Camera 2 recorded nothing" in "".join(s.text for s in report.story.lead)


def test_its_floor_is_hatched_not_white(silent: WeekReport) -> None:
    hatched = shapely.union_all([shapely.Polygon(p[0], p[1:]) for p in silent.maps[0].unseen])
    assert hatched.contains(shapely.Point(13, 3))
    assert not hatched.contains(shapely.Point(3, 3))
    assert "or Camera 2 recorded nothing" in re.sub(r"<[^>]+>", " ", render_html(silent))


def test_an_area_that_only_it_sees_is_unknown_and_not_zero(silent: WeekReport) -> None:
    far = next(a for a in silent.areas if a.area_id == "far")
    assert (far.counted, far.violation_rate.value, far.violation_rate.change, far.share, far.difference) == (None,) * 5
    assert far.close_time_share is not None
    assert far.close_time_share.value is None
    assert reason_text(far.violation_rate.reason) == "nothing or too little was recorded"
    seen = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", render_html(silent)))
    assert "Far – – – – – 0%" in seen
    queue = next(a for a in silent.areas if a.area_id == "queue")
    assert queue.violation_rate.value == pytest.approx(20.0)


def test_the_weeks_count_the_same_cameras(silent: WeekReport) -> None:
    assert silent.trend is not None
    before, now = (week.violation_rate.value for week in silent.trend.weeks if week.violation_rate is not None)
    assert before == now == pytest.approx(25.0)
    assert silent.trend.left_out == ("Camera 2",)
    assert silent.level.violation_rate.previous == pytest.approx(25.0)

"""Lines and doors on the weekly page: where the site asks, what was counted, and what is unknown or hidden."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from figures.test_line_counts import LINE, shop, through, week
from figures.test_people_inside import DOORS, day_of
from report import ingested_worlds as w
from warehouse.small_projects import DAY, HOUR, T0, Frame, Person, beats

from vsd_analytics.config.project import load_site
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.json_and_csv import from_json, to_json
from vsd_analytics.report.pages.lines import LINES_MAX
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.report.pages.week import render_html

ASKING = "[report]\nshow_lines = true\n"
MORE = "".join(
    f'[[line]]\nid = "l{k}"\nname = "Line {k}"\npoints = [[{3 * k}, 0], [{3 * k + 2}, 0]]\n' for k in range(1, 5)
)


def report(root: Path, records: Sequence[Person | Frame], *, lines: str, language: str = "en") -> WeekReport:
    site = load_site(shop(root, records, lines=lines))
    return week_report(replace(site, language=language), w.MONDAY)


def section(page: str) -> str:
    begins = page.index('<section class="sec" id="lines"')
    return page[begins : page.index("</section>", begins)]


def words(part: str) -> list[str]:
    return re.sub(r"<svg.*?</svg>|<[^>]*>", " ", part, flags=re.DOTALL).split()


def every_day() -> list[Person | Frame]:
    return [r for d in range(7) for r in day_of(d, in_=50, out=50 if d else 42)]


@pytest.mark.parametrize(
    ("language", "said"),
    [
        ("en", ("Lines and doors", "To Shop: 350 (orange). To Street: 342 (blue).", "People inside, by the doors")),
        ("it", ("Linee e porte", "Verso Shop: 350 (arancione).", "Persone all’interno, secondo le porte")),
    ],
)
def test_the_page_has_lines_and_doors_within_its_words(tmp_path: Path, language: str, said: tuple[str, ...]) -> None:
    lines = DOORS.replace("[doors]", MORE + "[doors]") + ASKING
    found = report(tmp_path, every_day(), lines=lines, language=language)
    part = section(render_html(found))
    assert [text for text in said if text not in " ".join(words(part))] == []
    assert "&lt;b&gt;Door&lt;/b&gt;" in part
    assert part.count("<h3>") == LINES_MAX + 1, "the first lines, and people inside"
    assert len(words(part)) < 250
    rows = re.findall(r'<tr><th scope="row">(.*?)</th>(.*?)</tr>', part)
    cells = [re.findall(r">([^<]+)<", row) for _, row in rows]
    assert [name for name, _ in rows][1:] == [f"{n} {9 + d}" for d, n in enumerate(_days(language))]
    assert (cells[0][2], cells[1][3], cells[2][3]) == ("50", "8", "0"), "the most inside, and who is left over"


def _days(language: str) -> tuple[str, ...]:
    english = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
    return english if language == "en" else ("lun", "mar", "mer", "gio", "ven", "sab", "dom")


def test_only_a_site_that_asks_has_the_section_and_every_file_has_the_answers(tmp_path: Path) -> None:
    silent = report(tmp_path, week(in_=20, out=12), lines=LINE)
    assert 'id="lines"' not in render_html(silent)
    assert {"lines", "line_days", "line_hours"} <= {answer.name for answer in silent.answers}
    assert "doors" not in silent.answers, "no line of the floor has an inside"


def test_without_a_line_there_is_no_section(tmp_path: Path) -> None:
    found = report(tmp_path, week(in_=20, out=12), lines=ASKING)
    assert 'id="lines"' not in render_html(found)
    assert "lines" not in found.answers


def test_a_day_on_which_the_camera_was_down_is_hatched_and_said(tmp_path: Path) -> None:
    down = [r for r in week(in_=20, out=12, but=(3, 0)) if not T0 + 2 * DAY <= r.ts < T0 + 3 * DAY]
    part = section(render_html(report(tmp_path, down, lines=LINE + ASKING)))
    drawn = part[part.index("<svg") : part.index("</svg>")]
    assert drawn.count('fill="url(#hat)"') == 1
    assert drawn.count("stroke-dasharray") == 1, "to the street on Thursday nobody was seen"
    assert (drawn.count('<rect class="tn"'), drawn.count('<rect class="tn tw"')) == (5, 1)
    assert "82% of the open time was recorded; who crossed in the rest is missing." in part
    assert "Wed 11: –, –" in part, "unknown, and not zero"


def test_where_nothing_can_be_counted_a_reason_stands_for_the_drawing(tmp_path: Path) -> None:
    records = [*(r for d in range(7) for r in through(T0 + d * DAY, None)), *beats(T0, T0 + HOUR)]
    part = section(render_html(report(tmp_path, records, lines=LINE + ASKING)))
    assert "<svg" not in part
    assert re.search(r"No number: [a-z].*\.", part)


def test_few_people_are_hidden_and_the_other_way_is_shown(tmp_path: Path) -> None:
    records = [*week(in_=20, out=0), *through(T0 + 2 * DAY, "one", way=-1)]
    part = section(render_html(report(tmp_path, records, lines=LINE + ASKING)))
    assert "To Shop: 140 (orange). To Street (blue): fewer than 5 were counted." in part
    assert part[: part.index("</svg>")].count(">–</text>") == 7


def test_doors_without_an_empty_hour_say_what_lacks(tmp_path: Path) -> None:
    found = report(tmp_path, week(in_=20, out=12), lines=LINE + 'inside = "left"\n' + ASKING)
    part = section(render_html(found))
    assert "<table" not in part
    assert "add [doors] empty_at" in part


def test_a_page_made_from_the_file_is_the_same(tmp_path: Path) -> None:
    found = report(tmp_path, week(in_=20, out=12, but=(3, 0)), lines=DOORS + ASKING)
    assert section(render_html(from_json(to_json(found)))) == section(render_html(found))

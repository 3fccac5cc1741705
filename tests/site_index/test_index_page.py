"""The page: one file without script or request, sound in structure, hostile names as text, numbers from JSON files."""

from __future__ import annotations

import base64
import hashlib
import re
import subprocess
import sys
from dataclasses import fields, replace
from datetime import timedelta
from pathlib import Path
from urllib.parse import unquote

import pytest
from forbidden_words import forbidden_in
from jinja2 import Environment, meta
from report import model_classes as m
from report import sample_weeks as weeks
from report.pages.test_report_numbers import NUMBER, Text, allowed
from report.pages.test_report_page import Tree
from site_index import many_reports as many

from vsd_analytics.report.pages.json_and_csv import from_json
from vsd_analytics.resources import shipped
from vsd_analytics.site_index import week_bars
from vsd_analytics.site_index.floor_weeks import Catalogue, catalogue
from vsd_analytics.site_index.page import Index, Link, Row, WeekLine, Year, make_index, render_index
from vsd_analytics.site_index.read_reports import Entry, find_reports, read_report_json

TEMPLATES = sorted((shipped("reports") / "templates" / "index").glob("*.j2"))


def listed(*folders: Path) -> Catalogue:
    shelves = [find_reports(f / "reports", project=f.name, prefix=f"{f.name}/reports/") for f in folders]
    assert [p for s in shelves for p in s.problems] == []
    return catalogue(e for s in shelves for e in s.entries)


@pytest.fixture(scope="module")
def company(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("company")
    many.company(root)
    return root


@pytest.fixture(scope="module")
def page(company: Path) -> str:
    return render_index(listed(*(company / n for n in ("riverside", "harbour", "central"))))


def hostile(root: Path) -> Catalogue:
    """Return two floors full of hostile names, in a project with a hostile name."""
    folder = root / 'a"><b>#?%&'
    for k in range(2):
        made = weeks.hostile()
        site = replace(made.site, floor_id=f"f{k}", floors=("f0", "f1"))
        many.write(folder, replace(made, site=site), stem=f"{made.week.iso}-f{k}")
    shelf = find_reports(folder / "reports", project=folder.name, prefix="a/")
    return catalogue(shelf.entries)


def test_nothing_is_loaded_and_nothing_runs(page: str, company: Path) -> None:
    tree = Tree(page)
    assert not {tag for tag, _ in tree.elements} & {"script", "iframe", "object", "embed", "form", "base", "img"}
    assert re.findall(r"https?://(?!www\.w3\.org/2000/svg)", page) == []
    links = []
    for tag, attributes in tree.elements:
        assert "style" not in attributes, tag
        assert not [a for a in attributes if a.startswith("on")], tag
        address = attributes.get("href") or ""
        if tag == "a" and not address.startswith("#"):
            links.append(address)
    assert len(links) > 40
    for address in links:
        assert not re.match(r"[a-z]+:|/|\.\.", address)
        assert (company / unquote(address)).is_file(), address


def test_the_policy_allows_this_style_and_nothing_else(page: str) -> None:
    (style,) = re.findall(r"<style>(.*?)</style>", page, flags=re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    assert f"default-src 'none'; style-src 'sha256-{digest}'; img-src data:; base-uri 'none'" in page


def test_structure_is_sound(page: str) -> None:
    tree = Tree(page)
    assert page.startswith("<!doctype html>\n<html lang=")
    assert tree.headings == [1, 2, 2, 3]
    ids = [a["id"] for _, a in tree.elements if "id" in a]
    assert len(ids) == len(set(ids))
    for tag, attributes in tree.elements:
        if tag == "svg":
            assert attributes.get("aria-hidden") == "true" or attributes.get("aria-label"), attributes
        if tag == "th":
            assert attributes.get("scope") in ("row", "col")


def test_hostile_names_stay_text(tmp_path: Path, page: str) -> None:
    text = render_index(hostile(tmp_path))
    assert "<script" not in text
    assert "<img" not in text
    assert text.count("</style>") == 1
    assert "&lt;/style&gt;" in text
    assert {t for t, _ in Tree(text).elements} <= {t for t, _ in Tree(page).elements}


def test_size_stays_small(page: str) -> None:
    assert len(page.encode()) < 60_000


def strangers(folders: list[Path], text: str) -> set[str]:
    """Return the numbers on the page that no JSON file explains."""
    reports = [from_json(p.read_bytes()) for f in folders for p in sorted((f / "reports").glob("*.json"))]
    known = {n for r in reports for n in allowed(r)}
    known |= {n for r in reports for n in NUMBER.findall(r.story.headline if r.story else "")}
    known |= {f"{back}" for r in reports for back in (r.week.number, r.week.year)}
    first = min(r.week.monday for r in reports)
    window = [max(r.week.monday for r in reports) - timedelta(weeks=k) for k in range(10)]
    known |= {f"{monday.isocalendar().week}" for monday in window if monday >= first - timedelta(weeks=10)}
    seen = " \n".join(Text(text).texts)
    for name in sorted({line.text for r in reports for line in r.log} | {r.provenance.version for r in reports}):
        seen = seen.replace(name, " ")
    return set(NUMBER.findall(seen)) - known


def test_every_number_is_in_a_json_file(company: Path, page: str) -> None:
    assert strangers([company / n for n in ("riverside", "harbour", "central")], page) == set()


def test_the_gate_finds_a_number_that_is_not(company: Path, page: str) -> None:
    folders = [company / n for n in ("riverside", "harbour", "central")]
    assert strangers(folders, page.replace("</h1>", " by 987.6</h1>")) == {"987.6"}


@pytest.mark.parametrize("name", list(weeks.ALL))
def test_every_state_of_a_week_is_shown_without_a_value_of_python(tmp_path: Path, name: str) -> None:
    made = weeks.ALL[name]()
    many.write(tmp_path / "p", made)
    text = render_index(listed(tmp_path / "p"))
    visible = re.sub(r"<style>.*?</style>|<[^>]*>", " ", text, flags=re.DOTALL)
    assert re.findall(r"\b(None|nan|True|False|inf|Undefined|datetime)\b", visible) == []
    if name != "hostile":
        assert forbidden_in(visible) == []
    Tree(text)


ROWS = {
    "normal": ("121", "Clear fall, \u221214%", ["likely \u221218% to \u221210%", "Logged: Seasonal display"], "94%"),
    "too_incomplete": ("about 118", "Too incomplete to compare", ["below 60% of open hours recorded", "Logged"], "38%"),
    "not_over": ("about 118", "Not over yet", ["Logged"], "98%"),
    "no_data": ("\u2013", "No data", ["Nothing was received"], "0%"),
    "first_week": (
        "121",
        "No week before",
        ["comparisons start with the", "Busiest: Checkout queue, Sat 17:00"],
        "94%",
    ),
    "settings_changed": ("121", "A setting changed", ["distance_m: 1.5 m, then 2 m", "Busiest"], "94%"),
    "empty": ("0", "No violations", ["people were seen in 71 hours"], "100%"),
}


@pytest.mark.parametrize("name", list(ROWS))
def test_the_row_of_each_state(tmp_path: Path, name: str) -> None:
    many.write(tmp_path / "p", weeks.ALL[name]())
    (row,) = make_index(listed(tmp_path / "p")).rows
    rate, verdict, details, recorded = ROWS[name]
    assert (row.rate, row.verdict, row.recorded) == (rate, verdict, recorded)
    assert len(row.details) == len(details)
    assert all(said.startswith(expected) for said, expected in zip(row.details, details, strict=True))
    assert row.is_low is (name in ("no_data", "too_incomplete"))


def test_missing_weeks_look_missing_and_never_like_zero(company: Path) -> None:
    rows = {r.floor: r for r in make_index(listed(company / "harbour")).rows}
    row = rows["Canteen"]
    assert row.weeks[3] == "no report"
    assert row.weeks[5] == "no data"
    assert row.weeks[6] == "about 118"
    drawn = re.findall(r'class="(wk\w+(?: now)?)"', str(row.bars))
    assert drawn == ["wkg", "wkb", "wkb", "wkb", "wkd", "wkb", "wkx", "wkr", "wkb", "wkb", "wkn"]
    assert "no report, 95, no data, about 118" in str(row.bars)


def test_bars_share_a_scale_within_their_row_only(company: Path) -> None:
    for row in make_index(listed(company / "riverside", company / "central")).rows:
        heights = [float(h) for h in re.findall(r'class="wk[bn]"[^/]*height="([\d.]+)"', str(row.bars))]
        values = [float(w) for w in row.weeks]
        assert max(heights) == week_bars.HEIGHT
        for height, value in zip(heights, values, strict=True):
            assert height == pytest.approx(week_bars.HEIGHT * value / max(values), rel=0.02)


def test_a_setting_that_changed_is_a_divider(tmp_path: Path) -> None:
    many.write(tmp_path / "p", many.report(back=1))
    many.write(tmp_path / "p", many.report(weeks.settings_changed))
    index = make_index(listed(tmp_path / "p"))
    assert index.has_divider
    assert str(index.rows[0].bars).count('class="wkc"') == 1


def test_a_floor_that_was_not_reported_shows_its_last_week_and_says_so(tmp_path: Path) -> None:
    many.write(tmp_path / "p", many.report(address=many.GROUND), stem="2026-W46-ground")
    many.write(tmp_path / "p", many.report(back=3, address=many.FIRST), stem="2026-W43-first")
    ground, first = make_index(listed(tmp_path / "p")).rows
    assert (ground.week, first.week) == ("", "Last report: week 43, 2026")
    assert first.weeks[-4:] == ("121", "no report", "no report", "no report")


def test_sites_of_one_name_are_distinguished(tmp_path: Path) -> None:
    for name in ("north", "south"):
        many.write(tmp_path / name, many.report())
    rows = make_index(listed(tmp_path / "north", tmp_path / "south")).rows
    assert [r.site for r in rows] == ["Riverside Store (north)", "Riverside Store (south)"]


def test_of_two_json_files_of_a_week_the_later_counts_and_the_other_is_named(tmp_path: Path) -> None:
    old, new = many.report(value=100.0), many.report(value=200.0)
    many.write(tmp_path, replace(old, generated_at=old.generated_at - timedelta(days=3)), stem="2026-W46-ground")
    many.write(tmp_path, new)
    found = catalogue(find_reports(tmp_path / "reports", project="p").entries)
    assert [(p.code, p.where.file if p.where else "") for p in found.problems] == [("W514", "2026-W46-ground.json")]
    assert make_index(found).rows[0].rate == "200"


def test_years_are_apart_and_older_ones_fold(tmp_path: Path) -> None:
    for back in (0, 1, 50, 60):
        many.write(tmp_path / "p", many.report(back=back))
    index = make_index(listed(tmp_path / "p"))
    assert [(y.number, len(y.weeks), y.is_open) for y in index.years] == [(2026, 1, True), (2025, 2, False)]
    line = index.years[0].weeks[0]
    assert (line.name, line.span) == ("Week 45", "2 to 8 Nov")
    assert line.only is not None
    assert line.only.address == "p/reports/2026-W45.html"


def test_the_window_goes_over_the_turn_of_the_year(tmp_path: Path) -> None:
    many.write(tmp_path / "p", many.report(back=-10))
    assert make_index(listed(tmp_path / "p")).phrase == "Week 47, 2026 to week 3, 2027"


def test_pages_without_figures_are_all_there_is(tmp_path: Path) -> None:
    page = Entry(project="p", stem="2026-W46", report=None, links={"report": "2026-W46.html"})
    text = render_index(catalogue([page]))
    Tree(text)
    assert "Reports without figures" in text
    assert 'href="2026-W46.html"' in text


def test_rules_of_several_sites_are_all_named(tmp_path: Path) -> None:
    many.write(tmp_path / "a", many.report())
    many.write(tmp_path / "b", many.report(weeks.six_feet, address=many.HALL))
    rule = make_index(listed(tmp_path / "a", tmp_path / "b")).rule
    assert rule == "two people closer than 2\u00a0m or 1.83\u00a0m for at least 3 seconds"


@pytest.mark.parametrize("value", [-3.0, 1e308, 0.0])
def test_absurd_figures_are_drawn_within_the_bars(tmp_path: Path, value: float) -> None:
    path = many.write(tmp_path, many.report())
    twin = read_report_json(path)
    twin = replace(twin, level=replace(twin.level, violation_rate=m.Estimate(value=value)))
    drawn = str(week_bars.bars([(many.LAST, twin)], label="x"))
    assert all(0 <= float(v) <= week_bars.HEIGHT for v in re.findall(r'(?:height|y)="([-\d.e+]+)"', drawn))


def test_an_incomplete_week_without_a_violation_is_drawn_when_it_is_the_only_one(tmp_path: Path) -> None:
    twin = read_report_json(many.write(tmp_path, many.report()))
    level = replace(twin.level, violation_rate=m.Estimate(value=0.0))
    drawn = str(week_bars.bars([(many.LAST, replace(twin, state="too_incomplete", level=level))], label="x"))
    assert "wkr" in drawn


def test_long_texts_of_people_are_cut(tmp_path: Path) -> None:
    made = many.report(value=100.0, change=-0.3)
    many.write(tmp_path / "p", replace(made, log=(replace(made.log[1], text="moved " * 100),)))
    (row,) = make_index(listed(tmp_path / "p")).rows
    assert row.details[1].startswith("Logged: moved moved")
    assert row.details[1].endswith("moved\u2026")
    assert len(row.details[1]) <= 110


def test_only_what_was_logged_in_the_week_is_reported(tmp_path: Path) -> None:
    made = many.report(value=100.0, change=-0.3)
    before = replace(made.log[1], at=made.log[1].at - timedelta(weeks=1))
    many.write(tmp_path / "p", replace(made, log=(before,)))
    (row,) = make_index(listed(tmp_path / "p")).rows
    assert row.details[1].startswith("Busiest: ")


def test_a_change_of_an_area_stays_with_its_week(tmp_path: Path) -> None:
    made = many.report(value=100.0, change=-0.3)
    many.write(tmp_path / "p", made)
    many.write(tmp_path / "p", many.report(back=-1))
    (line,) = make_index(listed(tmp_path / "p")).years[0].weeks
    assert line.logged == (f"Logged: {made.log[1].text}",)


def test_equal_json_files_give_equal_bytes_in_another_process(company: Path) -> None:
    program = (
        "import sys, hashlib; sys.path[:0] = sys.argv[2:]\n"
        "from pathlib import Path\nfrom site_index.test_index_page import listed\n"
        "from vsd_analytics.site_index.page import render_index\n"
        "print(hashlib.sha256(render_index(listed(Path(sys.argv[1]))).encode()).hexdigest())"
    )
    tests = Path(__file__).resolve().parents[1]
    folder = company / "riverside"
    there = subprocess.run(
        [sys.executable, "-c", program, str(folder), str(tests), str(tests.parent)],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONHASHSEED": "77", "TZ": "Asia/Tokyo", "LANG": "de_DE.UTF-8"},
    )
    assert there.stdout.strip() == hashlib.sha256(render_index(listed(folder)).encode()).hexdigest()


def test_templates_use_exactly_the_documented_variables() -> None:
    environment = Environment(autoescape=True)
    used: set[str] = set()
    for path in TEMPLATES:
        used |= meta.find_undeclared_variables(environment.parse(re.sub(r"\|\s*\w+", "", path.read_text())))
        for expression in re.findall(r"{[{%](.*?)[%}]}", path.read_text(), flags=re.DOTALL):
            bare = re.sub(r'"[^"]*"|\'[^\']*\'', "", expression)
            assert re.findall(r"\s[-+*/%~]\s|\*\*|\bround\b|\bformat\b|\bsum\b|\bsafe\b", bare) == [], expression
    assert used - {"say", "html_tag"} == {f.name for f in fields(Index)}
    for kind in (Index, Row, Link, WeekLine, Year):
        documented = re.findall(r"^ {8}([\w, ]+): ", kind.__doc__ or "", flags=re.MULTILINE)
        assert {n.strip() for names in documented for n in names.split(",")} == {f.name for f in fields(kind)}


def test_a_floor_has_its_rate_by_people_and_by_floor_in_view_and_that_of_a_year_before(tmp_path: Path) -> None:
    folder = tmp_path / "shop"
    now = many.report(value=165.0, change=0.01)
    views = m.MapViews(cameras=(), shared=(), floor_m2=300.0, shared_m2=0.0, unseen_m2=50.0)
    many.write(folder, replace(now, views=views))
    many.write(folder, many.report(back=52, value=150.0, change=0.01))
    (row,) = make_index(listed(folder)).rows
    assert row.rates[1] == "66 per 100 m² in view"
    assert "A year before, in week 46, 2025: 150 per open hour" in row.details


def test_a_year_before_is_silent_where_another_distance_held_or_too_little_was_recorded(tmp_path: Path) -> None:
    gaps = many.report(back=52, share=0.3)
    gaps = replace(gaps, coverage=replace(gaps.coverage, cameras=()))
    for k, before in enumerate((gaps, many.report(back=52, value=150.0, change=0.01))):
        folder = tmp_path / f"shop{k}"
        many.write(folder, many.report(value=165.0, change=0.01))
        many.write(folder, replace(before, rules=replace(before.rules, distance_m=1.0 if k else 2.0)))
        (row,) = make_index(listed(folder)).rows
        assert not any("year before" in text for text in row.details)
        assert len(row.rates) == 1, "what cameras see is unknown"

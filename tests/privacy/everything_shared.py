"""Everything that leaves the operator's hands about some weeks, as text by output, for tests that compare two worlds.

What names the records themselves (hashes of inputs) is taken out: two worlds differ in it by definition.
"""

from __future__ import annotations

import importlib.util
import json
import re
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import duckdb

from vsd_analytics.figures.share.days import closed_days
from vsd_analytics.figures.today import first_day, today
from vsd_analytics.live.day_topics import day_figures
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import planner_pages
from vsd_analytics.report.pages.duckdb_file import export_duckdb
from vsd_analytics.report.pages.json_and_csv import figures_json, to_csv, to_json
from vsd_analytics.report.pages.mail import as_bytes, make_mail
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.report.pages.today import make_today_page, today_html
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.service.answers import ReportAnswers
from vsd_analytics.site.model import Site
from vsd_analytics.site_index.collect_reports import gather, sources_of
from vsd_analytics.site_index.floor_weeks import catalogue
from vsd_analytics.site_index.page import render_index
from vsd_analytics.warehouse.warehouse import open_warehouse

NOW = datetime(2027, 1, 1, tzinfo=UTC)
_DIGEST = re.compile(r"\b[0-9a-f]{12,64}\b")


def everything(site: Site, mondays: list[date], folder: Path) -> dict[str, str]:
    """Return every output by name, without hashes.

    Args:
        site: The project.
        mondays: First days of the weeks, in order, all of them over.
        folder: An empty folder for files.
    """
    found: dict[str, str] = {}
    reports = folder / "reports"
    reports.mkdir()
    for monday in mondays:
        report, week = week_report(site, monday, now=NOW), f"{monday:%G-W%V}"
        found[f"{week} json"] = to_json(report).decode()
        found[f"{week} page"] = render_html(report)
        found[f"{week} figures"] = json.dumps(figures_json(report))
        found |= {f"{week} {name}": table for name, table in to_csv(report).items()}
        mail = make_mail(report, sender="site@example.org", to=["manager@example.org"])
        found[f"{week} mail"] = as_bytes(mail).decode()
        [planner] = planner_pages(site, monday)
        found[f"{week} planner"] = render_planner(planner)
        (reports / f"{week}.json").write_text(found[f"{week} json"], encoding="utf-8")
        (reports / f"{week}.html").write_text(found[f"{week} page"], encoding="utf-8")
    found["index"] = render_index(catalogue(gather(sources_of([folder]), reports).entries))
    found["duckdb"] = _duckdb(site, mondays, folder / "weeks.duckdb")
    found |= _card(site, mondays[-1] + timedelta(days=4))
    found |= _http(site, mondays[-1])
    return {name: _DIGEST.sub("", text) for name, text in found.items()}


def _duckdb(site: Site, mondays: list[date], path: Path) -> str:
    export_duckdb(site, mondays[0], mondays[-1] + timedelta(days=6), out=path, now=NOW)
    with duckdb.connect(str(path), read_only=True) as con:
        names = [name for (name,) in con.execute("select table_name from duckdb_tables() order by 1").fetchall()]
        return "\n".join(f"{name}: {con.execute(f'select * from {name}').fetchall()}" for name in names)


def _card(site: Site, day: date) -> dict[str, str]:
    """Return the card of a morning, as page and as figures of the broker."""
    at = datetime(day.year, day.month, day.day, 8, tzinfo=site.zone)
    with open_warehouse(site, first_day(at), day + timedelta(days=1)) as warehouse:
        card = closed_days(today(warehouse, at, floor_id=site.floors[0].floor_id), site)
    return {
        "card": today_html(make_today_page(card, site)),
        "topics": json.dumps(day_figures(card, site, site.floors[0])),
    }


def _http(site: Site, monday: date) -> dict[str, str]:
    answers, at = ReportAnswers(site.root, now=NOW), (f"{monday:%G-W%V}", site.floors[0].floor_id)
    pages = {"report": answers.report, "page": answers.page, "figures": answers.figures, "planner": answers.planner}
    pages |= {"desk page": answers.desk_page, "desk planner": answers.desk_planner}
    told = {f"http {name}": page(*at).decode() for name, page in pages.items()} | {"http site": answers.site().decode()}
    if importlib.util.find_spec("mcp") is not None:
        from service.assistant import ask_everything

        told["mcp"] = ask_everything(answers, week=at[0])
    return told

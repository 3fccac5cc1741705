"""`vsd hotspots` and its files: GeoJSON in floor metres, CSV without formulas, small counts held back."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from planted_floors import LAST, QUEUE, planted, site_of, square

from vsd_analytics.answer import Answers, Reason, Value
from vsd_analytics.cli import hotspots as command
from vsd_analytics.cli import main
from vsd_analytics.cli.answers import answers_text
from vsd_analytics.figures.hotspot_answers import HOTSPOTS, cell_tests, hotspot_answers, outlines, window_holds
from vsd_analytics.figures.hotspots import FloorHotspots, hotspots
from vsd_analytics.figures.week.hidden_hotspots import without_small
from vsd_analytics.render.frame import arrow, csv_text
from vsd_analytics.render.geojson import geojson
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording.reasons import reason_text

HOT = np.maximum(square(5, 5), square(12, 6, ratio=6))
HOSTILE = '=cmd|" /C calc"!A0\n'


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site_of(tmp_path_factory.mktemp("floor"), areas=(replace(QUEUE, name=HOSTILE),))


def answers_of(found: FloorHotspots, site: Site) -> Answers:
    return Answers(hotspot_answers(found, window_holds(site, found, inputs="")))


@pytest.fixture(scope="module")
def found(site: Site) -> FloorHotspots:
    with planted(site, lambda day: HOT) as warehouse:
        return hotspots(warehouse)


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a project folder whose warehouse is a planted one of 35 days, the second place hot for the first 14."""
    (tmp_path / "vsd.toml").write_text(
        '[site]\nid = "shop"\nname = "Shop"\ntimezone = "UTC"\n[[floor]]\nid = "ground"\nname = "Ground floor"\n'
        '[[camera]]\nid = "cam"\nname = "Cam"\nview = [[0, 0], [16, 0], [16, 12], [0, 12]]\n'
        '[[area]]\nid = "queue"\nname = "Queue"\npolygon = [[3, 3], [7, 3], [7, 7], [3, 7]]\n',
        encoding="utf-8",
    )

    @contextmanager
    def opened(project: Any, *, week: str | None, days: str | None) -> Iterator[Warehouse]:
        def risk(day: int) -> np.ndarray:
            return HOT if day < 14 else square(5, 5)

        with planted(project.site, risk, n_days=49) as warehouse:
            warehouse.keep = lambda *marts: None  # type: ignore[method-assign]
            yield warehouse

    monkeypatch.setattr(command, "warehouse_of", opened)
    return tmp_path


Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def vsd(project: Path, capsys: pytest.CaptureFixture[str]) -> Run:
    def run(*arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["-C", str(project), "hotspots", *arguments])
        out, err = capsys.readouterr()
        return int(stop.value.code or 0), out, err

    return run


def test_table_tells_place_ratio_excess_and_since(vsd: Run) -> None:
    code, out, _ = vsd("--range", str(LAST))
    lines = out.splitlines()
    assert code == 0
    assert lines[0] == "Hotspots, 2026-10-19 to 2026-11-15"
    assert lines[2].split("  ")[0] == "rank"
    first = lines[3]
    assert first.startswith("1     Queue ")
    assert first.split()[-2:] == ["2026-10-11", "yes"]
    # columns are aligned
    assert first[lines[2].index("over what the crowd explains")].isdigit()
    days = out[out.index("Days looked at") :].splitlines()
    assert days[3].split()[0] == "28"


def test_what_is_gone_is_listed_below_with_its_ratio_now(vsd: Run) -> None:
    told = [vsd("--range", str(LAST - timedelta(days=7 * k)))[1] for k in range(6)]
    [gone] = [out for out in told if "Hotspots of earlier windows" in out]
    table = gone[gone.index("Hotspots of earlier windows") :].splitlines()
    row = dict(zip(re.split("  +", table[2]), re.split("  +", table[3]), strict=True))
    assert (row["change"], row["near"]) == ("resolved", "Queue")
    assert float(row["m away"]) > 0
    assert float(row["before"].split()[0]) > float(row["over what the crowd explains"].split()[0])


def test_json_has_answers_with_outlines_and_cells_come_when_asked(vsd: Run) -> None:
    told = json.loads(vsd("--range", str(LAST), "--json")[1])
    answers = told["answers"]
    assert (answers["hotspots"]["state"], answers["hotspots"]["nothing"]) == ("ok", None)
    [window] = answers["hotspot_window"]["rows"]
    assert window["n_days"] == 28
    rows = [*answers["hotspots"]["rows"], *answers["past_hotspots"]["rows"]]
    assert rows[0]["area_id"] == "queue"
    assert set(told["outlines"]) == {row["spot_id"] for row in rows}
    assert "cells" not in told
    cells = json.loads(vsd("--range", str(LAST), "--json", "--cells")[1])["cells"]
    assert {(c["cx"], c["cy"]) for c in cells if c["is_hot"]} >= {(4, 4), (5, 4), (4, 5), (5, 5)}


def test_too_little_data_is_an_answer_with_a_reason(vsd: Run) -> None:
    early = str(LAST - timedelta(days=40))
    code, out, _ = vsd("--range", early)
    assert code == 0
    assert "9 of the 28 days were recorded" in out
    told = json.loads(vsd("--range", early, "--json")[1])["answers"]
    assert (told["hotspots"]["state"], told["hotspots"]["rows"]) == ("not_enough_data", [])
    [window] = told["hotspot_window"]["rows"]
    assert (window["n_violations"]["value"], window["n_days"]) == (None, 9)
    assert window["n_violations"]["reason"] == told["hotspots"]["nothing"]
    code, out, err = vsd("--range", early, "--format", "csv")
    [header] = out.splitlines()
    assert header.split(",")[:3] == ["floor_id", "spot_id", "rank"]
    assert "9 of the 28 days" in err


def test_a_floor_without_a_hotspot_says_that_none_differs(found: FloorHotspots, site: Site) -> None:
    answers = answers_of(replace(found, spots=()), site)
    assert answers["hotspots"].nothing is None
    assert "no place differs from the rest beyond chance" in answers_text(answers, command.LAYOUTS)


def test_files_are_written(vsd: Run, project: Path) -> None:
    for kind in ("text", "json", "geojson", "csv"):
        code, out, _ = vsd("--range", str(LAST), "--format", kind, "--out", str(project / f"spots.{kind}"))
        assert (code, out) == (0, "")
        assert (project / f"spots.{kind}").read_text(encoding="utf-8")
    told = json.loads((project / "spots.geojson").read_text(encoding="utf-8"))
    assert told["type"] == "FeatureCollection"
    assert "floor metres" in told["coordinate_system"]
    assert all("floor metres" in feature["properties"]["coordinate_system"] for feature in told["features"])


def test_a_floor_there_is_not_is_refused_by_name(vsd: Run) -> None:
    code, _, err = vsd("--range", str(LAST), "--floor", "attic")
    assert code == 2
    assert "ground" in err


def test_geojson_has_valid_shapes_in_floor_metres(found: FloorHotspots, site: Site) -> None:
    answers = answers_of(found, site)
    told = geojson([answers["hotspots"], answers["past_hotspots"]], outlines(found), key="spot_id")
    assert "floor metres" in told["coordinate_system"]
    assert len(told["features"]) == len(found.spots) == 2
    for feature, spot in zip(told["features"], found.spots, strict=True):
        assert feature["properties"]["coordinate_system"] == told["coordinate_system"]
        shape = shapely.from_geojson(json.dumps(feature["geometry"]))
        assert shape.is_valid
        assert shape.area == spot.place.area_m2
        for polygon in feature["geometry"]["coordinates"]:
            assert all(ring[0] == ring[-1] for ring in polygon)
            assert shapely.LinearRing(polygon[0]).is_ccw
    # no corner that a straight line goes through
    ring = found.spots[0].place.polygons[0][0]
    for a, b, c in zip(ring, ring[1:], ring[2:], strict=False):
        assert (b[0] - a[0]) * (c[1] - b[1]) != (b[1] - a[1]) * (c[0] - b[0])


def test_csv_has_no_formula_and_no_control_character(found: FloorHotspots, site: Site) -> None:
    answers = answers_of(found, site)
    rows = list(csv.DictReader(io.StringIO(csv_text(answers["hotspots"]))))
    named = next(row for row in rows if row["area_id"] == "queue")
    assert named["name"].startswith("'=cmd")
    assert [row["rank"] for row in rows] == ["1", "2"]
    place = found.spots[0].place
    assert float(rows[0]["x_m"]) == pytest.approx(place.x_m, rel=1e-5)
    assert float(rows[0]["peak_x_m"]) == place.peak_x_m
    text = answers_text(answers, command.LAYOUTS)
    assert "=cmd" in text
    assert text.splitlines()[5] == ""  # two rows of a line each


def test_small_counts_are_held_back(found: FloorHotspots, site: Site) -> None:
    assert found.n is not None
    few = replace(found, spots=(found.spots[0], replace(found.spots[1], n=4)))
    shared = without_small(few, below=5, revealing=frozenset())
    assert [s.number for s in shared.spots] == [1]
    assert (
        reason_text(shared.notes[-1])
        == "1 left out: they have fewer than 5 violations, or would reveal a count so small"
    )
    assert cell_tests(shared) == []
    [window] = answers_of(shared, site)["hotspot_window"].rows
    assert window["n_violations"] == Value.missing(Reason("hidden.gives_away"))
    assert without_small(found, below=5, revealing=frozenset()).n is None
    assert without_small(found, below=5, revealing=frozenset()).spots == found.spots
    telling = frozenset({found.spots[0].spot_id})
    assert without_small(found, below=5, revealing=telling).spots == found.spots[1:]


def test_an_interval_that_is_missing_is_null_and_the_ratio_is_given(found: FloorHotspots, site: Site) -> None:
    first = replace(found.spots[0], lo=None, hi=None, excess_min_lo=None, excess_min_hi=None, ratio=2.123456789)
    answers = answers_of(replace(found, spots=(first,)), site)
    [row] = arrow(answers["hotspots"]).to_pylist()
    assert (row["excess_ratio"], row["excess_ratio_lo"]) == (2.123456789, None)
    assert "2.1  " in answers_text(answers, command.LAYOUTS)
    assert ",2.12346,,," in csv_text(answers["hotspots"])
    assert {c.name for c in HOTSPOTS} <= set(row)

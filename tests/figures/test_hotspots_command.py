"""`vsd hotspots` and its files: GeoJSON in floor metres, CSV without formulas, small counts held back."""

from __future__ import annotations

import csv
import io
import json
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

from vsd_analytics.cli import hotspots as command
from vsd_analytics.cli import main
from vsd_analytics.figures import hotspot_export
from vsd_analytics.figures.hotspots import FloorHotspots, hotspots
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording.reasons import reason_text

HOT = np.maximum(square(5, 5), square(12, 6, ratio=6))
HOSTILE = '=cmd|" /C calc"!A0\n'


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> FloorHotspots:
    site = site_of(tmp_path_factory.mktemp("floor"), areas=(replace(QUEUE, name=HOSTILE),))
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
    assert lines[0].startswith("Ground floor, 2026-10-19 to 2026-11-15: 28 days recorded, ")
    assert lines[2].split("  ")[0] == "No"
    first = lines[3]
    assert first.startswith(" 1  Queue ")
    assert first.endswith("2026-10-11 or earlier")
    assert " times" not in first
    # columns are aligned
    assert first[lines[2].index("times what its crowd explains")].isdigit()


def test_what_is_gone_is_listed_below_with_its_ratio_now(vsd: Run) -> None:
    told = [vsd("--range", str(LAST - timedelta(days=7 * k)))[1] for k in range(6)]
    (gone,) = [out for out in told if "standing out no more" in out]
    line = gone.splitlines()[-1]
    assert "times what its crowd explains, now " in line
    assert "m from Queue" in line


def test_json_is_one_object_and_cells_come_when_asked(vsd: Run) -> None:
    told = json.loads(vsd("--range", str(LAST), "--json")[1])
    assert (told["state"], told["reason"], told["n_days"]) == ("ok", None, 28)
    assert told["hotspots"][0]["id"] == "ground-x5-y5" or told["hotspots"][0]["area_id"] == "queue"
    assert "cells" not in told
    cells = json.loads(vsd("--range", str(LAST), "--json", "--cells")[1])["cells"]
    assert {(c["cx"], c["cy"]) for c in cells if c["is_hot"]} >= {(4, 4), (5, 4), (4, 5), (5, 5)}


def test_too_little_data_is_an_answer_with_a_reason(vsd: Run) -> None:
    early = str(LAST - timedelta(days=40))
    code, out, _ = vsd("--range", early)
    assert code == 0
    assert "not enough data: 9 of the 28 days" in out
    told = json.loads(vsd("--range", early, "--json")[1])
    assert (told["state"], told["hotspots"], told["n"]) == ("not_enough_data", [], None)
    code, out, err = vsd("--range", early, "--format", "csv")
    assert out.splitlines() == [",".join(hotspot_export.COLUMNS)]
    assert "not" in err or "9 of the 28 days" in err


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


def test_geojson_has_valid_shapes_in_floor_metres(found: FloorHotspots) -> None:
    told = hotspot_export.as_geojson(found)
    assert told["coordinate_system"] == hotspot_export.PLANE
    assert len(told["features"]) == len(found.spots) == 2
    for feature, spot in zip(told["features"], found.spots, strict=True):
        assert feature["properties"]["coordinate_system"] == hotspot_export.PLANE
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


def test_csv_has_no_formula_and_no_control_character(found: FloorHotspots) -> None:
    text = command._csv([hotspot_export.spot_row(s) for s in found.spots], hotspot_export.COLUMNS)
    rows = list(csv.DictReader(io.StringIO(text)))
    named = next(row for row in rows if row["area_id"] == "queue")
    assert named["place"].startswith("'=cmd")
    assert [row["number"] for row in rows] == ["1", "2"]
    assert float(rows[0]["x_m"]) == pytest.approx(found.spots[0].place.x_m, rel=1e-5)
    table = command._text(found)
    assert len(table.splitlines()) == 5
    assert "=cmd" in table


def test_small_counts_are_held_back(found: FloorHotspots) -> None:
    assert found.n is not None
    few = replace(found, spots=(found.spots[0], replace(found.spots[1], n=4)))
    shared = hotspot_export.without_small(few, below=5, revealing=frozenset())
    assert [s.number for s in shared.spots] == [1]
    assert (
        reason_text(shared.notes[-1])
        == "1 left out: they have fewer than 5 violations, or would reveal a count so small"
    )
    assert hotspot_export.as_dict(shared, with_cells=True)["cells"] == []
    assert hotspot_export.without_small(found, below=5, revealing=frozenset()).n is None
    assert hotspot_export.without_small(found, below=5, revealing=frozenset()).spots == found.spots
    telling = frozenset({found.spots[0].spot_id})
    assert hotspot_export.without_small(found, below=5, revealing=telling).spots == found.spots[1:]


def test_numbers_have_six_digits_and_missing_is_null(found: FloorHotspots) -> None:
    first = replace(found.spots[0], lo=None, hi=None, excess_min_lo=None, excess_min_hi=None, ratio=2.123456789)
    row = hotspot_export.spot_row(first)
    assert (row["ratio"], row["lo"]) == (2.12346, None)
    assert tuple(row) == hotspot_export.COLUMNS
    text = command._text(replace(found, spots=(first,)))
    assert "2.1  " in text
    assert ",," in command._csv([row], hotspot_export.COLUMNS)

"""The planner's map as a drawing: the floor's own metres, in layers, in SVG, DXF and GeoJSON, whatever names say."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import pytest
import shapely
from ezdxf.lldxf.encoding import decode_dxf_unicode
from planner import planted_shop as planted
from shapely.geometry import shape

from vsd_analytics.config.drawing import read_drawing
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData
from vsd_analytics.site.model import Site

pytestmark = pytest.mark.browser
SVG = "{http://www.w3.org/2000/svg}"
DRAWN = {"svg", "title", "desc", "defs", "pattern", "rect", "g", "text", "path"}
LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
Open = Callable[..., Any]


def saved(page: Any, kind: str, folder: Path) -> Path:
    page.wait_for_function("document.body.dataset.first")
    with page.expect_download() as waiting:
        page.click(f"#save-{kind}")
    file = folder / waiting.value.suggested_filename
    waiting.value.save_as(file)
    assert page.errors == []
    return file


def areas_of(site: Site) -> dict[str, shapely.Polygon]:
    return {a.name: shapely.Polygon(a.polygon) for a in site.areas}


def features(file: Path) -> list[dict[str, Any]]:
    return list(json.loads(file.read_text(encoding="utf-8"))["features"])


def of_layer(file: Path, layer: str) -> dict[str, Any]:
    return {f["properties"]["name"]: shape(f["geometry"]) for f in features(file) if f["properties"]["layer"] == layer}


def svg_layer(file: Path, name: str) -> ET.Element:
    root = ET.fromstring(file.read_text(encoding="utf-8"))
    return next(g for g in root.iter(f"{SVG}g") if g.get(LABEL) == name)


def test_areas_have_the_coordinates_of_the_floor_in_every_format(
    tab: Open, pages: dict[str, Path], shop: Site, exact: PlannerData, tmp_path: Path
) -> None:
    page, wanted = tab(pages["exact"].as_uri()), areas_of(shop)
    geojson, dxf, svg = (saved(page, kind, tmp_path) for kind in ("geojson", "dxf", "svg"))
    assert geojson.name == "shop-ground-2026-W46.geojson"
    for name, polygon in wanted.items():
        assert of_layer(geojson, "areas")[name].symmetric_difference(polygon).area < 0.02, name
    document = ezdxf.readfile(dxf)
    assert document.header["$INSUNITS"] == 6  # metres
    outlines = [
        shapely.Polygon([(v.dxf.location.x, v.dxf.location.y) for v in line.vertices])
        for line in document.modelspace().query('POLYLINE[layer=="AREAS"]')
    ]
    for name, polygon in wanted.items():
        assert min(o.symmetric_difference(polygon).area for o in outlines) < 0.02, name
    drawn = {str(p.findtext(f"{SVG}title")): str(p.get("d")) for p in svg_layer(svg, "areas")}
    for name, polygon in wanted.items():
        points = [tuple(map(float, p.split())) for p in drawn[name].strip("MZ").split("L")]
        assert shapely.Polygon([(x, -y) for x, y in points]).symmetric_difference(polygon).area < 0.02, name
    assert exact.shown is not None
    left, bottom, right, top = exact.shown.extent
    root = ET.fromstring(svg.read_text(encoding="utf-8"))
    x, _, width, height = map(float, str(root.get("viewBox")).split())
    assert (x, width) == (left, right - left)
    assert height >= top - bottom
    assert root.get("width") == f"{(right - left) * 10:g}mm"  # 1 to 100


def test_its_bands_are_those_of_the_map(tab: Open, pages: dict[str, Path], exact: PlannerData, tmp_path: Path) -> None:
    geojson = saved(tab(pages["exact"].as_uri()), "geojson", tmp_path)
    assert exact.shown is not None
    steps = list(exact.site.settings.heat_steps)
    drawn = [f for f in features(geojson) if f["properties"]["layer"].startswith("map-")]
    assert len(drawn) == len(exact.shown.bands)
    for band in exact.shown.bands:
        outline = shapely.MultiPolygon([(outer, holes) for outer, *holes in band.polygons])
        [found] = [f for f in drawn if f["properties"]["layer"] == f"map-{steps.index(band.lower) + 1}"]
        assert shape(found["geometry"]).is_valid
        assert shape(found["geometry"]).hausdorff_distance(outline) < 0.3  # corners are rounded on the page
        assert found["properties"]["name"]


def test_it_says_what_it_shows_and_what_was_not_recorded(tab: Open, pages: dict[str, Path], tmp_path: Path) -> None:
    page = tab(pages["exact"].as_uri() + "#show=difference&days=0000011&from=10&to=11")
    geojson, svg, dxf = (saved(page, kind, tmp_path) for kind in ("geojson", "svg", "dxf"))
    wanted = "Violations · Week 46, Week 45 · Difference · Saturday, Sunday · 10:00–11:00"
    assert json.loads(geojson.read_text())["shown"][0] == wanted
    assert wanted in [t.text for t in svg_layer(svg, "title")]
    notes = [decode_dxf_unicode(t.dxf.text) for t in ezdxf.readfile(dxf).modelspace().query('TEXT[layer=="TITLE"]')]
    assert wanted in notes
    signs = {f["properties"]["name"] for f in features(geojson) if f["properties"]["layer"].startswith("map-")}
    assert any("fewer" in name for name in signs) or any("more" in name for name in signs)
    for said in (json.loads(geojson.read_text())["shown"], notes, [t.text for t in svg_layer(svg, "title")]):
        assert any("do not share" in str(line) for line in said)  # the page is the operator's
    assert any("MAP_" in note and ("fewer" in note or "more" in note) for note in notes)


def test_a_drawing_is_a_plan_that_the_product_reads(tab: Open, pages: dict[str, Path], tmp_path: Path) -> None:
    dxf = saved(tab(pages["exact"].as_uri()), "dxf", tmp_path)
    drawing = read_drawing(dxf)
    assert drawing.unit == "m"
    assert drawing.bounds_m[2] - drawing.bounds_m[0] > 5


def test_names_are_texts_and_nothing_else(tab: Open, tmp_path: Path) -> None:
    site = planted.build(tmp_path / "hostile", name=planted.HOSTILE)
    html = tmp_path / "hostile.html"
    html.write_text(render_planner(planted.known(planted.with_settings(site, **planted.WHOLE))), encoding="utf-8")
    page = tab(html.as_uri())
    geojson, svg, dxf = (saved(page, kind, tmp_path) for kind in ("geojson", "svg", "dxf"))
    name = f"Door {planted.HOSTILE}"
    assert name in of_layer(geojson, "areas")
    root = ET.fromstring(svg.read_text(encoding="utf-8"))
    assert name in [str(t.text) for t in root.iter(f"{SVG}title")]
    assert {e.tag.removeprefix(SVG) for e in root.iter()} <= DRAWN
    assert any(
        planted.HOSTILE in decode_dxf_unicode(t.dxf.text) for t in ezdxf.readfile(dxf).modelspace().query("TEXT")
    )

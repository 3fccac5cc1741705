"""Draws the pictures of the documentation: `make screenshots`.

Makes the demo in a temporary folder, opens its report in a headless Chromium and writes `docs/images/report.png`, the
first part of the page. Of the canteen it writes the maps of the four weeks before and after its logged change,
`docs/images/before.png` and `after.png`, as `vsd heatmap` draws them.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from datetime import date
from pathlib import Path

WIDTH_PX, HEIGHT_PX = 1280, 1832
MAPS = {"before": "2026-09-13..2026-10-10", "after": "2026-10-14..2026-11-10"}
"""Days of the canteen that `vsd compare --change 1` compares."""
IMAGES = Path(__file__).resolve().parent / "images"


def demo_page(folder: Path) -> str:
    """Return the demo's report of its last week."""
    from vsd_analytics.config.project import load_site
    from vsd_analytics.report.pages.story import week_report
    from vsd_analytics.report.pages.week import render_html
    from vsd_analytics.simulate.demo import ingest_demo
    from vsd_analytics.simulate.demo_project import write_demo_project

    write_demo_project(folder, seed=4)
    site = load_site(folder)
    ingest_demo(site, sorted((folder / "engine").iterdir()), seed=4)
    return render_html(week_report(site, date(2026, 11, 9)))


def picture(page: Path) -> bytes:
    """Return the first part of a page as PNG bytes."""
    from playwright.sync_api import sync_playwright

    names = ("chromium", "chromium-browser", "google-chrome")
    chromium = next((path for name in names if (path := shutil.which(name))), None)
    if chromium is None:
        sys.exit("no Chromium on this machine")
    with sync_playwright() as engine:
        browser = engine.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        tab = browser.new_page(color_scheme="light", viewport={"width": WIDTH_PX, "height": HEIGHT_PX})
        tab.goto(page.as_uri())
        shot = tab.screenshot()
        browser.close()
    return small(shot)


def small(png: bytes) -> bytes:
    """Return a PNG file with at most 256 colours."""
    from PIL import Image

    image = Image.open(io.BytesIO(png)).convert("RGB")
    out = io.BytesIO()
    image.quantize(256, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
    return out.getvalue()


def canteen_maps(folder: Path) -> dict[str, bytes]:
    """Return the maps of the canteen before and after its change, as PNG bytes by name."""
    from vsd_analytics.cli import cli
    from vsd_analytics.cli.exit_codes import run

    assert run(cli, ["demo", str(folder), "--place", "canteen"]) == 0
    maps = {}
    for name, days in MAPS.items():
        file = folder / f"{name}.png"
        words = ["heatmap", "--range", days, "--cell", "0.25", "--format", "png", "--out", str(file)]
        assert run(cli, ["-C", str(folder), *words]) == 0
        maps[name] = small(file.read_bytes())
    return maps


def main() -> None:
    """Write the pictures into `docs/images`."""
    with tempfile.TemporaryDirectory() as name:
        page = Path(name) / "report.html"
        page.write_text(demo_page(Path(name) / "demo"), encoding="utf-8")
        pictures = {"report": picture(page), **canteen_maps(Path(name) / "canteen")}
    IMAGES.mkdir(exist_ok=True)
    for title, data in pictures.items():
        (IMAGES / f"{title}.png").write_bytes(data)
        print(f"docs/images/{title}.png   {len(data) / 1000:.0f} KB")


if __name__ == "__main__":
    main()

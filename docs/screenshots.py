"""Draws the pictures of the documentation: `make screenshots`.

Makes the demo in a temporary folder, opens its report in a headless Chromium and writes `docs/images/report.png`, the
first part of the page.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from datetime import date
from pathlib import Path

WIDTH_PX, HEIGHT_PX = 1280, 1832
IMAGES = Path(__file__).resolve().parent / "images"


def demo_page(folder: Path) -> str:
    """Return the demo's report of its last week."""
    from vsd_analytics.config import load_site
    from vsd_analytics.report.pages.story import week_report
    from vsd_analytics.report.pages.week import render_html
    from vsd_analytics.simulate import write_demo_project
    from vsd_analytics.simulate.demo import ingest_demo

    write_demo_project(folder, seed=4)
    site = load_site(folder)
    ingest_demo(site, sorted((folder / "engine").iterdir()), seed=4)
    return render_html(week_report(site, date(2026, 11, 9)))


def picture(page: Path) -> bytes:
    """Return the first part of a page as PNG bytes."""
    from PIL import Image
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
    image = Image.open(io.BytesIO(shot)).convert("RGB")
    out = io.BytesIO()
    image.quantize(256, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
    return out.getvalue()


def main() -> None:
    """Write `docs/images/report.png`."""
    with tempfile.TemporaryDirectory() as name:
        page = Path(name) / "report.html"
        page.write_text(demo_page(Path(name) / "demo"), encoding="utf-8")
        data = picture(page)
    IMAGES.mkdir(exist_ok=True)
    (IMAGES / "report.png").write_bytes(data)
    print(f"docs/images/report.png   {len(data) / 1000:.0f} KB")


if __name__ == "__main__":
    main()

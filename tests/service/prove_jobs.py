"""Measure what a manager's jobs take at the desk, in headless Chromium by keyboard alone, and print the table.

    python tests/service/prove_jobs.py PROJECT

PROJECT is a folder of `vsd demo`; the answer, the change and the target are written into a copy. The pages are made
once before, as they are after the first reader of a week.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from playwright.sync_api import sync_playwright
from service.desk_site import desk_app
from service.keyboard_jobs import do_jobs

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.report.pages.pdf import find_chromium
from vsd_analytics.service.http_server import HttpServer

ROUNDS = 3


def main(project: Path) -> None:
    """Print presses, keys and seconds (median of three rounds, each at a new copy) of each job."""
    found = []
    with sync_playwright() as engine:
        chromium = engine.chromium.launch(executable_path=find_chromium(environ=os.environ), args=["--no-sandbox"])
        for _ in range(ROUNDS):
            with tempfile.TemporaryDirectory() as folder:
                root = shutil.copytree(project, Path(folder) / "shop")
                run(cli, ["-C", str(root), "site", "build"])
                server = HttpServer(desk_app(root), host="127.0.0.1", port=0)
                server.start()
                context = chromium.new_context(permissions=["clipboard-read", "clipboard-write"])
                found.append(do_jobs(context.new_page(), f"http://127.0.0.1:{server.port}"))
                context.close()
                server.close()
        chromium.close()
    print("| job | buttons and links | keys | seconds |\n|---|--:|--:|--:|")
    for job, taken in found[0].items():
        seconds = sorted(one[job].seconds for one in found)[ROUNDS // 2]
        print(f"| {job} | {taken.presses} | {taken.keys} | {seconds:.1f} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

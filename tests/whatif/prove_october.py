"""The demo's October change, foreseen: the display leaves the entrance, and a share of its visitors goes with it.

Run `python tests/whatif/prove_october.py [--folder DIR]` (15 minutes; 3 with a folder that `vsd demo DIR --weeks 12`
made); the table is in docs/methods. Each share is a receipt, made from the two weeks before the move. What came is
read twice: by the running verdict of the logged change (`vsd whatif --scores`), and between two made-up worlds of the
four weeks after the move, one in which the display stayed: there the growth of the shop is in both.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import sys
import tempfile
from collections import Counter
from datetime import timedelta
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.spatial import cKDTree

from vsd_analytics.cli import cli, run
from vsd_analytics.simulate.cameras import CAMERAS
from vsd_analytics.simulate.demo_project import TIMEZONE, mondays_until, simulate_week
from vsd_analytics.simulate.history import shop_history
from vsd_analytics.simulate.shop import AREA_RECTS, DISPLAY_AFTER, polygon

SHARES: Final = (0.1, 0.2, 0.5)
"""In the made-up shop 55 % of the parties stop at the old place, and 12 % at the new one: 0.22 of them."""
GIVER, RECEIVER = "entrance", "checkout-queue"
WEEKS, SEED = 12, 4
BEFORE: Final = "2026-09-28..2026-10-11"
ASKED, READ = "2026-10-11T20:00:00Z", "2026-11-16T08:00:00Z"
WITHIN_M: Final = 2.0


def vsd(project: Path, now: str, *arguments: str) -> Any:
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        code = run(cli, ["-C", str(project), "--now", now, *arguments, "--json"])
    if code > 1:
        raise SystemExit(f"vsd {' '.join(arguments)}: {out.getvalue()}")
    return json.loads(out.getvalue())


def foreseen(project: Path, share: float) -> dict[str, Any]:
    """Return what `vsd whatif` says of the move, by the share that follows; it leaves a receipt."""
    edit = project / "move.toml"
    corners = [list(point) for point in polygon(DISPLAY_AFTER)]
    edit.write_text(f'[[fixture]]\nid = "display"\npolygon = {corners}\nfollow_share = {share}\n', encoding="utf-8")
    said: dict[str, Any] = vsd(project, ASKED, "whatif", str(edit), "--range", BEFORE)
    return said


def score(project: Path, number: int) -> dict[str, Any]:
    """Return how a receipt came out that the entry of the move names."""
    log = project / "log.jsonl"
    entries = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    for entry in entries:
        if entry["area"] == GIVER:
            entry["prediction"] = number
    log.write_text("".join(json.dumps(entry) + "\n" for entry in entries), encoding="utf-8")
    rows = vsd(project, READ, "whatif", "--scores")["answers"]["prediction_scores"]["rows"]
    return next(row for row in rows if row["area_id"] == GIVER)


def close_time(*, is_moved: bool) -> Counter[str]:
    """Return the person-frames too close in each area, in the four weeks after the move."""
    mondays = mondays_until("2026-W46", WEEKS)
    past = shop_history(mondays, cameras=tuple(c.camera_id for c in CAMERAS), timezone=TIMEZONE)
    assert past is not None
    close: Counter[str] = Counter()
    for monday in mondays[-5:-1]:
        moved_at = past.moved_at if is_moved else past.moved_at + timedelta(weeks=999)
        for day in simulate_week(monday, seed=SEED, interval_s=3.0, moved_at=moved_at, past=past):
            scale = 1e3  # frames lie far apart, so that only people of one frame are near each other
            pairs = cKDTree(np.column_stack([day.x_m, day.y_m, scale * day.frame])).query_pairs(
                WITHIN_M, output_type="ndarray"
            )
            is_close = np.zeros(day.x_m.size, np.bool_)
            is_close[pairs.ravel()] = True
            for area, (x0, y0, x1, y1) in AREA_RECTS.items():
                inside = (day.x_m > x0) & (day.x_m < x1) & (day.y_m > y0) & (day.y_m < y1)
                close[area] += int((is_close & inside).sum())
    return close


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--folder", type=Path)
    folder = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as temporary:
        project = folder or Path(temporary) / "shop"
        if folder is None:
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                run(cli, ["demo", str(project), "--weeks", str(WEEKS), "--seed", str(SEED)])
        stayed, moved = (close_time(is_moved=is_moved) for is_moved in (False, True))
        came = {area: moved[area] / stayed[area] - 1 for area in (GIVER, RECEIVER)}
        print("between the worlds: " + ", ".join(f"{area} {change:+.1%}" for area, change in came.items()))
        for share in SHARES:
            said = foreseen(project, share)
            places = {row["place_id"]: row for row in said["answers"]["whatif_places"]["rows"]}
            sentence = str(said["answers"]["whatif"]["notes"])
            scored = score(project, said["receipt"]["number"])
            measured = scored["measured_change"]["value"]
            print(f"share {share:g}: the sentence names the receiver: {'Checkout queue' in sentence}")
            for area in (GIVER, RECEIVER):
                change = places[area]["predicted_change"]
                print(
                    f"  {area}: {change['lo']:+.1%} to {change['hi']:+.1%}; stays leave "
                    f"{places[area]['n_stays_leave']['value']}, come {places[area]['n_stays_come']['value']}; "
                    f"between the worlds {came[area]:+.1%}, held {change['lo'] <= came[area] <= change['hi']}"
                )
            print(f"  {GIVER}, running verdict after {scored['n_weeks_after']} weeks: {measured:+.1%}, "
                  f"held {scored['held']}", flush=True)  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""How well `vsd whatif` foresees what another simulator does: 54 scenes of JuPedSim, before and after an edit.

Run `python tests/whatif/prove_scenes.py --seed 100` (10 minutes; JuPedSim: `pip install 'vsd-analytics[scenes]'`); the
table is in docs/methods. The tracks before go into a project by `vsd ingest`, and `vsd whatif` is asked; the tracks
after go into another, whose figures are the truth. The same people come before and after.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import io
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from tests.whatif.jupedsim_scenes import DOOR_X_M, LENGTH_M, Box, Scene, scenes, walked
from vsd_analytics.cli import cli, run
from vsd_analytics.config.project import load_site
from vsd_analytics.warehouse.warehouse import open_warehouse
from vsd_analytics.whatif.fixture_edits import AROUND
from vsd_analytics.whatif.place_times import floor_key, open_hours

BEGINS: Final = datetime(2026, 11, 2, 9, tzinfo=UTC)
DAY: Final = date(2026, 11, 2)
NOW: Final = "2026-11-10T08:00:00Z"
FLOOR: Final = floor_key("floor")
SITE: Final = """
[site]
id = "corridor"
name = "Corridor"
timezone = "UTC"
distance_m = {distance_m}

[[floor]]
id = "floor"
name = "Floor"

[[camera]]
id = "cam"
name = "Camera"
floor = "floor"

[[area]]
id = "middle"
name = "Middle"
floor = "floor"
polygon = {middle}
"""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What was said of a place, and what came.

    Attributes:
        place: "around", "middle", the floor, or "door".
        lo, hi: Predicted range of the change; None where refused.
        claim: -1 it falls, 1 it rises, 0 no change; None = no direction.
        came: Change of the figure after the edit.
        why: Code of the refusal.
    """

    place: str
    lo: float | None
    hi: float | None
    claim: int | None
    came: float
    why: str | None

    @property
    def held(self) -> bool:
        return self.lo is not None and self.hi is not None and self.lo <= self.came <= self.hi

    @property
    def is_wrong(self) -> bool:
        """Return whether a direction was claimed and another came."""
        if self.claim is None:
            return False
        return abs(self.came) > 0.013 if self.claim == 0 else self.claim * self.came <= 0


def outcomes(scene: Scene, folder: Path) -> list[Outcome] | None:
    """Return what was said of a scene and what came; None where people got stuck or through walls in the simulation."""
    try:
        (before, n_stuck), (after, n_stuck_after) = (walked(scene, after=is_after) for is_after in (False, True))
    except RuntimeError:  # JuPedSim: a point is outside of accessible area
        return None
    if n_stuck or n_stuck_after:
        return None
    projects = [_project(folder / name, scene, rows) for name, rows in (("before", before), ("after", after))]
    edit = folder / "edit.toml"
    edit.write_text(_edit(scene), encoding="utf-8")
    said, came = (_vsd(project, "whatif", str(edit), "--json", "--no-receipt")["answers"] for project in projects)
    if scene.old_door_m is not None:
        return [_door(said, came)]
    then_min, now_min = _close_min(projects[1], came), _close_min(projects[0], said)
    rows = {row["place_id"]: row for row in said["whatif_places"]["rows"]}
    return [_place(rows[key], then_min[key] / now_min[key] - 1) for key in (AROUND, "middle", FLOOR)]


def _place(row: dict[str, Any], came: float) -> Outcome:
    change = row["predicted_change"]
    claim = {"rise": 1, "fall": -1, "no_change": 0}.get(row["direction"] or "")
    return Outcome(row["place_id"], change.get("lo"), change.get("hi"), claim, came, _code(change))


def _door(said: dict[str, Any], came: dict[str, Any]) -> Outcome:
    [row], [then] = said["whatif_doors"]["rows"], came["whatif_doors"]["rows"]
    now_s, then_s = row["close_s_per_person"]["value"], then["close_s_per_person"]["value"]
    predicted = row["predicted_close_s"]
    if predicted["value"] is None:
        return Outcome("door", None, None, None, then_s / now_s - 1, _code(predicted))
    lo, hi = predicted["lo"] / now_s - 1, predicted["hi"] / now_s - 1
    return Outcome("door", lo, hi, 1 if lo > 0 else -1 if hi < 0 else None, then_s / now_s - 1, None)


def _code(value: dict[str, Any]) -> str | None:
    reason = value.get("reason")
    return reason["code"] if isinstance(reason, dict) else reason


def _project(folder: Path, scene: Scene, rows: pd.DataFrame) -> Path:
    """Make a project and ingest the tracks as a CSV file of positions in metres."""
    folder.mkdir()
    middle = _corners((8.0, 0.0, 20.0, scene.width_m))
    text = SITE.format(distance_m=2.0 if scene.old_door_m is None else 1.0, middle=middle)
    solid = {"lower": (0.0, -0.3, LENGTH_M, 0.0), "upper": (0.0, scene.width_m, LENGTH_M, scene.width_m + 0.3)}
    if scene.kind == "null":
        del solid["upper"]  # there is a bay
    if scene.old_box is not None:
        solid["display"] = scene.old_box
    for name, box in solid.items():
        text += f'\n[[fixture]]\nid = "{name}"\nname = "{name}"\nfloor = "floor"\npolygon = {_corners(box)}\n'
    (folder / "vsd.toml").write_text(text, encoding="utf-8")
    ts = (BEGINS + pd.to_timedelta(rows["t_s"], unit="s")).dt.strftime("%Y-%m-%dT%H:%M:%SZ")
    table = rows.assign(ts=ts).round({"x_m": 3, "y_m": 3}).sort_values(["t_s", "track_id"])
    table[["ts", "track_id", "x_m", "y_m"]].to_csv(folder / "positions.csv", index=False)
    _vsd(folder, "ingest", str(folder / "positions.csv"), "--camera", "cam", "--json")
    return folder


def _edit(scene: Scene) -> str:
    if scene.new_box is not None:
        return f'[[fixture]]\nid = "display"\nname = "Display"\npolygon = {_corners(scene.new_box)}\n'
    line = [[DOOR_X_M, 0.0], [DOOR_X_M, scene.width_m]]
    widths = f"width_m = {scene.old_door_m}\nnew_width_m = {scene.new_door_m}"
    return f'[[door]]\nname = "Door"\nline = {line}\nkind = "exit"\n{widths}\n'


def _corners(box: Box) -> list[list[float]]:
    x0, y0, x1, y1 = box
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]


def _vsd(project: Path, *arguments: str) -> dict[str, Any]:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(cli, ["-C", str(project), "--now", NOW, *arguments])
    if code > 1:
        raise SystemExit(f"vsd {arguments[0]}: {err.getvalue()}{out.getvalue()}")
    answer: dict[str, Any] = json.loads(out.getvalue())
    return answer


def _close_min(project: Path, answers: dict[str, Any]) -> dict[str, float]:
    """Return the person-minutes recorded too close, around the edit, in the area, and on the floor."""
    with open_warehouse(load_site(project), DAY, DAY, relations=("camera_hours",)) as warehouse:
        open_h = open_hours(warehouse, "floor", DAY, DAY)["cam"]
    return {r["place_id"]: open_h * r["close_min_per_open_h"]["value"] for r in answers["whatif_places"]["rows"]}


def share(n: int, of: int) -> str:
    """Return a share with its interval of 95 %."""
    if not of:
        return "none"
    interval = binomtest(n, of).proportion_ci(method="exact")
    return f"{n} of {of} = {n / of:.0%} ({interval.low:.0%} to {interval.high:.0%})"


def summary(found: Sequence[tuple[Scene, list[Outcome]]]) -> None:
    """Print the tables: by kind of edit, by place, and directions."""
    print("\nkind | scenes | answered | held | refused, by reason")
    for kind in dict.fromkeys(scene.kind for scene, _ in found):
        main = [outcomes_[0] for scene, outcomes_ in found if scene.kind == kind]
        said = [o for o in main if o.lo is not None]
        why = ", ".join(f"{n} {code}" for code, n in Counter(o.why for o in main if o.lo is None).items())
        print(f"{kind} | {len(main)} | {len(said)} | {share(sum(o.held for o in said), len(said))} | {why}")
    every = [(scene, o) for scene, outcomes_ in found for o in outcomes_]
    for place in dict.fromkeys(o.place for _, o in every):
        for ways in ("one way", "both ways", "all"):
            said = [
                o for scene, o in every
                if o.place == place and o.lo is not None and scene.kind != "null"
                and ways in ("all", "both ways" if scene.back_share else "one way")
            ]  # fmt: skip
            if said:
                width = np.median([(o.hi or 0) - (o.lo or 0) for o in said])
                print(f"{place}, {ways}: held {share(sum(o.held for o in said), len(said))}, width {width:.0%}")
    claimed = [o for _, o in every if o.claim is not None]
    print(f"directions and no change claimed: wrong {share(sum(o.is_wrong for o in claimed), len(claimed))}")
    main = [outcomes_[0] for _, outcomes_ in found]
    print(f"scenes {len(main)}, refused {share(sum(o.lo is None for o in main), len(main))}")


def main() -> int:
    """Simulate, ask, and print what came."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=100)
    if importlib.util.find_spec("jupedsim") is None:
        print("skipped: JuPedSim is not installed (pip install jupedsim)")
        return 0
    found, n_failed = [], 0
    for scene in scenes(parser.parse_args().seed):
        with tempfile.TemporaryDirectory() as folder:
            came = outcomes(scene, Path(folder))
        name = f"{scene.seed} {scene.kind}, {scene.model}, {scene.width_m:g} m, {scene.people_per_s:.2f}/s, "
        name += f"{scene.back_share:.0%} back"
        if came is None:
            n_failed += 1
            print(f"{name}: the simulation failed, left out")
            continue
        found.append((scene, came))
        for o in came:
            said = o.why if o.lo is None or o.hi is None else f"{o.lo:+.0%} to {o.hi:+.0%}"
            print(f"{name}: {o.place} {said}, came {o.came:+.1%}{' WRONG' if o.is_wrong else ''}", flush=True)
    summary(found)
    print(f"left out, since people got stuck or through walls: {n_failed}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

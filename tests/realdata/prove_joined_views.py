"""Follows WILDTRACK's and simulated people from camera to camera; prints how often that is wrong and what it brings.

Run `VSD_REALDATA=... python tests/realdata/prove_joined_views.py`; the tables are in docs/methods. Records go
through store, facts and marts as in a project. WILDTRACK's truth is its positions fused from all views; its boxes are
made from them, so they agree better than boxes of detectors do. Simulated cameras have biases, clocks, occlusion and
cut tracks.
"""

from __future__ import annotations

import json
import math
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from vsd_analytics.ingest.formats.wildtrack import VIEWS
from vsd_analytics.site.model import Area, Calibration, Camera, Site

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parent)]
from prove_cameras import load  # noqa: E402
from simulated_views import HALL_M, people_in_hall, seen_by_cameras  # noqa: E402
from warehouse.small_projects import T0, Frame, Person, make_site, open_days, put  # noqa: E402

Track = tuple[str, str]


@dataclass(frozen=True)
class Outcome:
    """What one run gave.

    Attributes:
        joined: Pairs of tracks that were joined, each with camera and track id.
        person_of: The first track of each joined track.
        owned: Camera and track of each record that is counted.
        visits: Entries that were seen, by area.
        followed: Visits with entry and exit, by area.
        dwell_s: Their dwell times.
        moves: People who leave an area and enter another one, by both.
        waits: Outcomes of waits, by outcome.
    """

    joined: Sequence[tuple[Track, Track]]
    person_of: dict[Track, Track]
    owned: Sequence[Track]
    visits: Counter[str]
    followed: Counter[str]
    dwell_s: Sequence[float]
    moves: Counter[tuple[str, str]]
    waits: Counter[str]


def outcome(site: Site, records: Sequence[Person]) -> Outcome:
    """Return what the marts of a new project say of records, each of whose instants has a heartbeat."""
    put(site, [*records, *(Frame(ts, camera) for camera, ts in sorted({(r.camera, r.ts) for r in records}))])
    with open_days(site) as warehouse:
        joined = warehouse.rows("select * from joined_tracks")
        persons = warehouse.rows("select * from joined_persons")
        owned = warehouse.rows("select camera_id, track_id from located where is_owned")
        visits = [v for v in warehouse.rows("select * from visits") if v["is_counted"] and v["has_entry"]]
        moves = warehouse.rows("select * from moves where next_area_id is not null and is_exit_counted")
        waits = warehouse.rows("select * from waits where is_counted and has_entry and not was_served")
    whole = [v for v in visits if v["has_exit"]]
    return Outcome(
        [((r["camera_id"], r["track_id"]), (r["other_camera_id"], r["other_track_id"])) for r in joined],
        {(r["camera_id"], r["track_id"]): (r["person_camera_id"], r["person_track_id"]) for r in persons},
        [(r["camera_id"], r["track_id"]) for r in owned],
        Counter(v["area_id"] for v in visits),
        Counter(v["area_id"] for v in whole),
        [v["dwell_s"] for v in whole],
        Counter((m["area_id"], m["next_area_id"]) for m in moves),
        Counter(w["outcome"] for w in waits),
    )


def person(track: str) -> str:
    """Return the true person of a track id, which the proof writes as person, "#", camera and number of the piece."""
    return track.partition("#")[0]


def idf1(found: Outcome) -> float:
    """Return IDF1 over the records that are counted: 2 IDTP / (true + found), identities matched one to one."""
    names = [found.person_of.get(track, track) for track in found.owned]
    true_ids, true_at = np.unique([person(track) for _, track in found.owned], return_inverse=True)
    ids, at = np.unique(["/".join(name) for name in names], return_inverse=True)
    both = np.zeros((len(true_ids), len(ids)))
    np.add.at(both, (true_at, at), 1)
    return float(both[linear_sum_assignment(both, maximize=True)].sum() / len(names))


def wilson_upper(k: int, n: int, z: float = 1.96) -> float:
    """Return the upper end of Wilson's 95 % interval of k of n."""
    if not n:
        return 1.0
    p = k / n
    return (p + z**2 / (2 * n) + z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))) / (1 + z**2 / n)


def false_of(found: Outcome) -> int:
    """Return how many joins are of two people."""
    return sum(person(a[1]) != person(b[1]) for a, b in found.joined)


def said(found: Outcome) -> str:
    """Return a row of the tables: joins, false ones, IDF1, visits, followed ones, median dwell, moves, waits."""
    n, k = len(found.joined), false_of(found)
    joins = f"{n:,} | {k} (at most {wilson_upper(k, n):.1%})" if n else "0 | -"
    dwell = f"{np.median(found.dwell_s):.1f}" if found.dwell_s else "-"
    waits = " / ".join(str(found.waits[outcome]) for outcome in ("served", "left", "cut"))
    return (
        f"{joins} | {idf1(found):.3f} | {found.visits.total()} | {found.followed.total()} | {dwell} | "
        f"{found.moves.total()} | {waits} |"
    )


HEAD = (
    "| run | joins | false | IDF1 | entries | whole visits | median dwell, s | moves | served / left / cut |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


def runs(site: Site, truth: Site, records: Sequence[Person], true_records: Sequence[Person]) -> None:
    """Print the rows of a site: cameras apart, joined, and one camera that sees all of them."""
    for name, own, rows in (
        ("apart", site, records),
        ("joined", replace(site, settings=site.settings.with_values({"join_views": True})), records),
        ("one camera that sees all", truth, true_records),
    ):
        with tempfile.TemporaryDirectory() as root:
            print(f"| {name} | {said(outcome(replace(own, root=Path(root)), rows))}", flush=True)


def rectangle(x0: float, y0: float, x1: float, y1: float) -> tuple[tuple[float, float], ...]:
    """Return the corners of a rectangle."""
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def areas(x: Sequence[float], y: Sequence[float]) -> tuple[Area, ...]:
    """Return three areas side by side: a hall, a queue, and where it is served."""
    shapes = [rectangle(x[k], y[0], x[k + 1], y[1]) for k in range(3)]
    hall, queue, till = (Area(name, name, "ground", s, has_visits=True) for name, s in zip(NAMES, shapes, strict=True))
    return (hall, replace(queue, is_queue=True, served_in="till"), till)


NAMES = ("hall", "queue", "till")


def wildtrack(folder: Path, *, cut_every: int) -> tuple[Site, Site, list[Person], list[Person]]:
    """Return what `runs` takes for WILDTRACK; a track of a view is cut after so many records (0: never)."""
    matrices = json.loads((folder / "H_image_to_ground_m.json").read_text())
    who, view, xy = load(folder, per_camera=True)
    true_who, _, true_xy = load(folder, per_camera=False)
    n_seen: Counter[tuple[str, object]] = Counter()
    records = []
    for (ms, name), camera, (x, y) in zip(who, view, xy, strict=True):
        piece = n_seen[camera, name] // cut_every if cut_every else 0
        n_seen[camera, name] += 1
        records.append(Person(T0 + int(str(ms)), f"{name}#{camera}{piece}", round(x * 1000), round(y * 1000), camera))
    true_records = [
        Person(T0 + int(str(ms)), f"{name}#", round(x * 1000), round(y * 1000))
        for (ms, name), (x, y) in zip(true_who, true_xy, strict=True)
    ]
    cameras = [
        Camera(
            v,
            v,
            "ground",
            hz=2.0,
            picture_px=(1920, 1080),
            calibrations=(Calibration(tuple(tuple(row) for row in matrices[v]), None, v),),
        )
        for v in VIEWS
    ]
    site = replace(make_site(Path(), cameras=cameras), areas=areas((-3, 1, 5, 9), (-9, 27)))
    return site, replace(make_site(Path()), areas=site.areas), records, true_records


def hall(*, people: int, couples: float, bias_m: float, clock_s: float, seed: int = 1) -> None:
    """Print the rows of a simulated hall with four cameras."""
    rng = np.random.default_rng(seed)
    walkers = people_in_hall(rng, people=people, couples=couples)
    cameras, rows = seen_by_cameras(rng, walkers, bias_m=bias_m, clock_s=clock_s)
    own = [Camera(name, name, "ground", hz=2.0, view=rectangle(*view)) for name, view in cameras.items()]
    site = replace(make_site(Path(), cameras=own), areas=areas((4, 8, 12, 16), (2, HALL_M[1] - 2)))
    records = [Person(T0 + ms, track, round(x * 1000), round(y * 1000), camera) for ms, track, camera, x, y in rows]
    true_records = [
        Person(T0 + int(ms), f"{w.name}#", round(x * 1000), round(y * 1000))
        for w in walkers
        for ms, x, y in zip(w.ms, w.x_m, w.y_m, strict=True)
    ]
    runs(site, replace(make_site(Path()), areas=site.areas), records, true_records)


def main() -> None:
    folder = Path(os.environ["VSD_REALDATA"]) / "wildtrack"
    for cut_every in (0, 20):
        print(f"\nWILDTRACK, tracks {f'cut after {cut_every} records' if cut_every else 'whole'}\n\n{HEAD}")
        runs(*wildtrack(folder, cut_every=cut_every))
    for people, couples in ((8, 0.0), (8, 1.0), (25, 0.3), (60, 0.3)):
        for bias_m, clock_s in ((0.1, 0.0), (0.2, 0.0), (0.3, 0.0), (0.5, 0.0), (0.1, 0.3), (0.1, 1.0)):
            print(f"\nHall, {people} people, {couples:.0%} couples, bias {bias_m} m, clocks {clock_s} s off\n\n{HEAD}")
            hall(people=people, couples=couples, bias_m=bias_m, clock_s=clock_s)


if __name__ == "__main__":
    main()

"""Real recordings through the public API: ingest, build, figures; against counts made with plain numpy."""

from __future__ import annotations

import csv
import gzip
import json
import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import UTC, date, datetime
from pathlib import Path

import pytest

from vsd_analytics.figures import operator_counts
from vsd_analytics.geometry.calibration_files import load_calibration
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import Warehouse, open_warehouse

pytestmark = pytest.mark.realdata

Find = Callable[[str], Path]
NOW = datetime(2026, 11, 20, tzinfo=UTC)
START = 1_767_258_000_000  # 2026-01-01 09:00 UTC, for recordings that have frame numbers and no clock
DAY = date(2026, 1, 1)


def one_camera(root: Path, camera: Camera, *, timezone: str = "UTC") -> Site:
    """Return a site of one camera that keeps the recording's own track ids."""
    settings = Settings().with_values({"pseudonyms": False})
    return Site("site", "Site", timezone, root, floors=(Floor("floor", "Floor"),), cameras=(camera,), settings=settings)


def take_in(site: Site, paths: Sequence[Path], options: IngestOptions) -> None:
    result = ingest(site, paths, options, now=NOW)
    assert [s.error for s in result.sources] == [None] * len(paths)


def totals(warehouse: Warehouse) -> tuple[int, int]:
    """Return person records and violation records of the range."""
    row = warehouse.rows("select sum(person_records) as p, sum(violation_records) as v from hours")[0]
    return int(row["p"]), int(row["v"])


# --- ATC: a shopping centre, three hours, records of one second spread over two files an hour ---

ATC = IngestOptions(format="positions", columns=("ts", "track_id", "x_m", "y_m", "speed", "angle"), period_s=1.0)
ATC_NAMES = [f"atc/atc-1024-{hour}_{part}.csv.gz" for hour in (9, 10, 11) for part in ("train", "test")]
ATC_DAY = date(2012, 10, 24)
ATC_HOURS = {9: 2_843, 10: 17_740, 11: 22_761}


def atc_files(realdata: Find, how: str, folder: Path) -> list[Path]:
    files = [realdata(name) for name in ATC_NAMES]
    if how == "in order":
        return files
    if how == "reversed":
        return files[::-1]
    lines = [line for f in files for line in gzip.decompress(f.read_bytes()).splitlines(keepends=True)]
    # split in three: every third line into the same file, so that each second is spread over all of them
    parts = [lines] if how == "concatenated" else [lines[k::3] for k in (2, 0, 1)]
    made = []
    for number, part in enumerate(parts):
        made.append(folder / f"part{number}.csv")
        made[-1].write_bytes(b"".join(part))
    return made


@pytest.mark.parametrize("how", ["in order", "reversed", "concatenated", "split in three"])
def test_atc_counts_are_exact_whatever_order_and_number_of_files(realdata: Find, tmp_path: Path, how: str) -> None:
    site = one_camera(tmp_path / "project", Camera("atc", "ATC", "floor"), timezone="Asia/Tokyo")
    take_in(site, atc_files(realdata, how, tmp_path), ATC)
    with open_warehouse(site, ATC_DAY, ATC_DAY) as warehouse:
        assert totals(warehouse) == (113_396, 43_344)
        rows = warehouse.rows("select local_hour, violation_records from hours where violation_records is not null")
        heat = operator_counts.heatmap(warehouse, at="midpoint")
    assert {r["local_hour"]: r["violation_records"] for r in rows} == ATC_HOURS
    with realdata("truth_heatmaps/dev_atc_h09_11.csv").open() as f:
        truth = Counter({(int(r["ix"]), int(r["iy"])): int(r["violations"]) for r in csv.DictReader(f)})
    found = Counter({(r.cx, r.cy): r.records for r in heat.itertuples() if r.records})
    elsewhere = sum(abs(truth[cell] - found[cell]) for cell in truth.keys() | found.keys()) / 2
    assert found.total() == truth.total() == 43_344
    assert elsewhere <= 0.005 * 43_344


# --- street scenes in metres, headerless tables separated by blanks ---

OBSMAT = ("frame", "track_id", "x_m", "z", "y_m", "vx", "vz", "vy")


@pytest.mark.parametrize(
    ("scene", "fps", "people", "violations"),
    [("seq_eth", 15.0, 8_908, 6_964), ("seq_hotel", 25.0, 6_544, 3_866), ("zara01", 25.0, 5_024, 3_640)],
)
def test_street_scenes_are_exact_in_millimetres(
    realdata: Find, tmp_path: Path, scene: str, fps: float, people: int, violations: int
) -> None:
    """Positions are stored in whole millimetres, which moves no pair over 2 m here."""
    site = one_camera(tmp_path, Camera("street", "Street", "floor"))
    options = IngestOptions(format="positions", columns=OBSMAT, fps=fps, start=START)
    take_in(site, [realdata(f"eth_ucy/{scene}/obsmat.txt.gz")], options)
    with open_warehouse(site, DAY, DAY) as warehouse:
        assert totals(warehouse) == (people, violations)


# --- Oxford Town Centre: boxes in pixels and a homography ---


def test_oxford_town_centre_boxes_give_the_truth_within_rounding(realdata: Find, tmp_path: Path) -> None:
    """Pixels are stored rounded to a quarter, floor positions to a millimetre: up to 2 of 20,439 records may change.

    The file's last line is cut; it stands in quarantine and does not count.
    """
    matrix = realdata("oxtown/H_image_to_ground_m.txt")
    calibration = load_calibration(matrix, kind="homography", valid_from=None)
    camera = Camera("street", "Street", "floor", calibrations=(calibration,), picture_px=(1920, 1080))
    site = one_camera(tmp_path, camera)
    names = {
        "track_id": "personNumber",
        "frame": "frameNumber",
        **{ours: f"body{ours.capitalize()}" for ours in ("left", "top", "right", "bottom")},
    }
    options = IngestOptions(format="positions", map=names, fps=25.0, start=START)
    result = ingest(site, [realdata("oxtown/TownCentre-groundtruth.top.gz")], options, now=NOW)
    assert result.n_rejected <= 1
    with open_warehouse(site, DAY, DAY) as warehouse:
        people, violations = totals(warehouse)
    assert people == 47_746
    assert abs(violations - 20_439) <= 2


# --- formats of their own ---


def test_wildtrack_is_exact_on_its_half_centimetre_grid(realdata: Find, tmp_path: Path) -> None:
    site = one_camera(tmp_path, Camera("square", "Square", "floor"))
    options = IngestOptions(format="wildtrack", camera="square", start=START)
    take_in(site, [realdata("wildtrack/annotations_positions_0_995.tar.gz")], options)
    with open_warehouse(site, DAY, DAY) as warehouse:
        assert totals(warehouse) == (4_785, 4_093)


@pytest.mark.parametrize(
    ("sequence", "fps", "people", "violations"),
    [("PETS09-S2L1", 7.0, 4_650, 1_072), ("TUD-Stadtmitte", 25.0, 1_156, 479)],
)
def test_motchallenge_world_columns_are_exact(
    realdata: Find, tmp_path: Path, sequence: str, fps: float, people: int, violations: int
) -> None:
    camera = sequence.lower()
    site = one_camera(tmp_path, Camera(camera, camera, "floor"))
    options = IngestOptions(format="motchallenge", camera=camera, coordinates="floor", fps=fps, start=START)
    take_in(site, [realdata("pets_mot/3DMOT2015Labels.zip")], options)
    with open_warehouse(site, DAY, DAY) as warehouse:
        assert totals(warehouse) == (people, violations)


# --- badges: pairs without positions ---


def test_badges_give_violations_over_many_days_and_no_exposure(realdata: Find, tmp_path: Path) -> None:
    """Contacts of an office, 20 s each: of people who meet nobody nothing is known, so person-time is unknown."""
    import zipfile

    with zipfile.ZipFile(realdata("sociopatterns/workplace_InVS_tij.dat.zip")) as archive:
        told = [line.split()[:3] for line in archive.read("tij_InVS.dat").decode().splitlines()]
    monday = int(datetime(2013, 6, 24, tzinfo=UTC).timestamp())
    contacts = {(int(t), *sorted((a, b))) for t, a, b in told}
    path = tmp_path / "contacts.csv"
    rows = (f"{monday + t},{a},{b},1.0\n" for t, a, b in sorted(contacts))
    path.write_text("ts,track_a,track_b,distance_m\n" + "".join(rows))
    site = one_camera(tmp_path / "project", Camera("office", "Office", "floor", hz=0.05), timezone="Europe/Paris")
    take_in(site, [path], IngestOptions(format="pairs"))
    with open_warehouse(site, date(2013, 6, 24), date(2013, 7, 5)) as warehouse:
        hours = warehouse.frame("select * from hours")
        episodes = warehouse.rows("select count(*) as n, sum(n_records) as records from episodes")[0]
    assert hours["violation_records"].sum() == len(contacts) == episodes["records"]
    assert hours["person_records"].isna().all()
    assert hours["exposure_s"].isna().all()
    days = {datetime.fromtimestamp(monday + t, tz=UTC).date() for t, _, _ in contacts}
    assert len(days) == 10
    runs: Counter[tuple[str, str]] = Counter()
    last: dict[tuple[str, str], int] = {}
    for t, a, b in sorted(contacts):
        runs[a, b] += t - last.get((a, b), -(10**9)) > 50
        last[a, b] = t
    assert episodes["n"] == runs.total()


def test_the_truth_file_says_the_same(realdata: Find) -> None:
    """The numbers above are those of the recordings' own truth file."""
    truth = json.loads(realdata("truth_dev.json").read_text())["positions"]
    told = {k: (v["person_frames"], v["pairs_lt_2m"]) for k, v in truth.items()}
    assert told["dev_atc_h09_11"] == (113_396, sum(ATC_HOURS.values()))
    assert told["oxtown_fullres_0_3089"] == (47_746, 20_439)
    assert told["dev_wildtrack_0_995"] == (4_785, 4_093)
    assert told["mot3d_PETS09-S2L1"][1] == 1_072
    assert told["ethucy_seq_eth"] == (8_908, 6_964)


def test_facts_of_a_copied_project_are_fresh(realdata: Find, tmp_path: Path) -> None:
    """A project can be moved: nothing in it depends on where it is."""
    site = one_camera(tmp_path / "here", Camera("street", "Street", "floor"))
    options = IngestOptions(format="positions", columns=OBSMAT, fps=25.0, start=START)
    take_in(site, [realdata("eth_ucy/zara01/obsmat.txt.gz")], options)
    with open_warehouse(site, DAY, DAY) as warehouse:
        assert warehouse.built.n_built == 1
    shutil.copytree(tmp_path / "here", tmp_path / "there")
    moved = one_camera(tmp_path / "there", Camera("street", "Street", "floor"))
    with open_warehouse(moved, DAY, DAY) as warehouse:
        assert (warehouse.built.n_built, totals(warehouse)) == (0, (5_024, 3_640))

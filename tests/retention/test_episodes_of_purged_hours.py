"""What several cameras saw stays one violation after its records are purged; older seals are read by the older rule."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
from aged_projects import DAYS, TERMS, TOML, make_project, messages, vsd, write

from vsd_analytics.config.project import load_site
from vsd_analytics.retention.purge import purge_range
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.warehouse import warehouse
from vsd_analytics.warehouse.warehouse import Warehouse

VIEWS = {"cam-1": "[[0, 0], [6, 0], [6, 4], [0, 4]]", "cam-2": "[[-1, 0], [7, 0], [7, 4], [-1, 4]]"}
NEW = (
    "before_ms",
    "after_ms",
    "n_owned",
    "owned_from_ms",
    "owned_to_ms",
    "n_owned_located",
    "owned_x2_mm",
    "owned_y2_mm",
)


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a project of two cameras that see the same people and give them ids of their own."""
    toml = TOML
    for camera, view in VIEWS.items():
        toml = toml.replace(f'id = "{camera}"\n', f'id = "{camera}"\nview = {view}\n')
    root = make_project(tmp_path_factory.mktemp("seen-twice") / "p", toml=toml)
    every: list[dict[str, Any]] = []
    for camera in VIEWS:
        for message in messages(camera=camera, day=DAYS[0], hours=(9, 10)):
            message["persons"] = [{**p, "id": f"{camera} {p['id']}"} for p in message["persons"]]
            every.append(message)
    vsd(root, "ingest", str(write(root.parent / "m.jsonl", every)))
    return root


@pytest.fixture
def purged(stored: Path, tmp_path: Path) -> Path:
    root = Path(shutil.copytree(stored, tmp_path / "p"))
    vsd(root, "purge", "--older-than", DAYS[2], "--force", "--reason", "retention")
    return root


def counted(root: Path) -> list[dict[str, Any]]:
    site = load_site(root)
    day = warehouse.stored_extent(site)
    assert day is not None
    with Warehouse(site, day.first_day, day.last_day) as opened:
        return opened.rows("select camera_id, started_ms, duration_s, x_m, y_m from violations order by started_ms")


def test_a_pair_two_cameras_saw_is_one_violation_before_and_after_a_purge(stored: Path, purged: Path) -> None:
    before = counted(stored)
    assert len(before) == 12  # six an hour, 50 s each
    assert {(r["duration_s"], r["x_m"]) for r in before} == {(50.0, 1.5)}
    assert counted(purged) == before


def test_a_camera_taken_out_of_sealed_hours_leaves_no_trace_of_its_pairs(purged: Path) -> None:
    site = load_site(purged)
    extent = warehouse.stored_extent(site)
    assert extent is not None
    with Warehouse(site, extent.first_day, extent.last_day) as opened:
        (ends,) = opened.rows("select min(hour) as first, max(hour) as last, count(*) as n from same_pairs")
    assert ends["n"] == 12
    purge_range(
        site, camera_id="cam-2", first_ms=ends["first"] * HOUR_MS, after_ms=(ends["last"] + 1) * HOUR_MS, terms=TERMS
    )
    with Warehouse(site, extent.first_day, extent.last_day) as opened:
        assert opened.rows("select count(*) as n from same_pairs") == [{"n": 0}]
        assert opened.rows("select distinct camera_id from episode_segments") == [{"camera_id": "cam-1"}]


def test_hours_sealed_before_these_columns_are_counted_by_the_mean_midpoint(stored: Path, tmp_path: Path) -> None:
    """What an older version sealed tells neither which records count nor who saw the same pair."""
    root = Path(shutil.copytree(stored, tmp_path / "p"))
    site = load_site(root)
    extent = warehouse.stored_extent(site)
    assert extent is not None
    with Warehouse(site, extent.first_day, extent.last_day, uses_days=False) as opened:
        opened.materialise("same_pairs", "episode_segments")
        opened.con.execute("delete from same_pairs")
        opened.con.execute(f"update episode_segments set {', '.join(f'{c} = null' for c in NEW)}")
        rows = opened.rows("select camera_id, duration_s, x_m from violations")
        cut = opened.rows("select count(is_cut) as n from episodes")
    assert len(rows) == 12
    assert len({r["camera_id"] for r in rows}) == 1
    assert {(r["duration_s"], r["x_m"]) for r in rows} == {(50.0, 1.5)}
    assert cut == [{"n": 0}]

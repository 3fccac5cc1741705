"""Replaying the quarantine: after fixing, the store is what it would be had the fixed site read the files."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
import walks
from click.testing import CliRunner
from raw_reading import NOW, small_site
from site_text import site_text

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.formats.frames import MessageRows
from vsd_analytics.ingest.intake import quarantine_writer as room
from vsd_analytics.ingest.intake.normalise import Normaliser
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.intake.quarantine_writer import Quarantine, SourceReading
from vsd_analytics.ingest.intake.replay import replay
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.schema import KEYS, TABLES
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Camera, ReadingRule, Site
from vsd_analytics.store import durable
from vsd_analytics.store.quarantine import QuarantineEntry, entries, files
from vsd_analytics.store.store import Store

HEADER = "ts,camera_id,track_id,x_m,y_m\n"
MESSAGE = (
    '{"v":1,"camera":"%s","ts":"2026-11-09T09:00:%02d%s","persons":[{"id":"a","x_m":%d,"y_m":2},{"id":"b","x_m":%d,'
    '"y_m":3}],"pairs":[{"a":"b","b":"a","distance_m":1.5}]}\n'
)
PLAIN = Settings().with_values({"pseudonyms": False})


def stored(site: Site) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of every table, sorted; each key once."""
    found = {}
    for table in TABLES:
        parts = Store(site.root / "store", site_id=site.site_id).parts(table)
        rows = [row for part in parts for row in pq.read_table(part.path).to_pylist()]
        names = [k for k in KEYS[table] if " " not in k]
        assert all(len({tuple(r[n] for n in names) for r in rows}) == len(rows) for _ in rows[:1])
        found[table] = sorted(rows, key=repr)
    return found


def with_camera(site: Site, **changes: Any) -> Site:
    return replace(site, cameras=(*site.cameras, Camera("cam-3", "Yard", "ground", engine_ids=("yard",), **changes)))


def left(site: Site) -> list[QuarantineEntry]:
    folder = site.root / "quarantine"
    return sorted((e for p in files(folder) for _, e in entries(p) if e is not None), key=lambda e: (e.source, e.line))


def tree(root: Path) -> dict[Path, bytes]:
    return {p: p.read_bytes() for p in root.rglob("*") if p.is_file() and p.name != ".lock"}


def frames_file(path: Path, zone: str = "Z") -> Path:
    cameras = ("cam-1", "yard", "cam-2", "yard")
    path.write_text("".join(MESSAGE % (c, k, zone, k, k + 1) for k, c in enumerate(cameras)) + '{"v":1,\n')
    return path


def table_file(path: Path, zone: str = "Z") -> Path:
    rows = [("cam-1", "a", "1"), ("yard", "b", "2"), ("yard", "c", "x"), ("cam-2", "d", "99999")]
    path.write_text(HEADER + "".join(f"2026-11-09T09:00:00{zone},{c},{t},{x},2\n" for c, t, x in rows))
    return path


@pytest.mark.parametrize("zone", ["Z", "", "+09:00"])
@pytest.mark.parametrize("write", [frames_file, table_file])
def test_a_camera_described_later_gives_the_store_of_a_site_that_always_had_it(
    write: Callable[[Path, str], Path], zone: str, tmp_path: Path
) -> None:
    before = small_site(tmp_path / "site", settings=PLAIN)
    path = write(tmp_path / ("a.jsonl" if write is frames_file else "a.csv"), zone)
    ingest(before, [path], IngestOptions(), now=NOW)
    fixed = with_camera(before, clock="Asia/Tokyo")
    found = replay(fixed, reason="unknown-camera")
    always = replace(fixed, root=tmp_path / "always")
    expected = ingest(always, [path], IngestOptions(), now=NOW)
    assert stored(fixed) == stored(always)
    assert found.n_left == 0
    assert found.n_solved == (8 if write is frames_file else 1)
    assert {e.reason for e in left(fixed)} == set(expected.sources[0].n_rejected)


def test_pseudonyms_of_replayed_rows_are_those_of_their_track(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site")
    (tmp_path / "a.csv").write_text(
        HEADER + "".join(f"2026-11-09T09:00:0{k}Z,{c},a,1,2\n" for k, c in enumerate(("left", "x")))
    )
    ingest(site, [tmp_path / "a.csv"], IngestOptions(), now=NOW)
    cameras = (replace(site.cameras[0], engine_ids=("left", "x")), site.cameras[1])
    replay(replace(site, cameras=cameras))
    assert len({r["track_id"] for r in stored(site)["observations"]}) == 1
    assert len(stored(site)["observations"]) == 2
    assert stored(site)["observations"][0]["track_id"] != "a"


def test_a_corrected_mapping_reads_lines_again_and_none_twice(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site", settings=PLAIN, ingest_map={"ts": "local"})
    path = tmp_path / "a.csv"
    path.write_text(
        "local,utc,camera_id,x_m,y_m\n" + "".join(f"{k}h,2026-11-09T09:00:0{k}Z,cam-1,{k},2\n" for k in range(5))
    )
    ingest(site, [path], IngestOptions(), now=NOW)
    assert {e.reason for e in left(site)} == {"not-a-time"}
    assert replay(site).n_bad == {"not-a-time": 5}
    fixed = replace(site, ingest_map={"ts": "utc"})
    found = replay(fixed)
    assert (found.n_solved, found.n_left, dict(found.n_records)) == (5, 0, {"observations": 5})
    assert files(site.root / "quarantine") == []
    always = replace(fixed, root=tmp_path / "always")
    ingest(always, [path], IngestOptions(), now=NOW)
    assert stored(fixed) == stored(always)


def test_a_corrected_source_of_vsd_toml_is_used_and_the_command_wins_over_it(tmp_path: Path) -> None:
    tills = ReadingRule(rule_id="tills", files=("a.csv",), map={"ts": "local"})
    site = replace(small_site(tmp_path / "site", settings=PLAIN), sources=(tills,))
    (tmp_path / "a.csv").write_text("local,utc,camera_id,x_m,y_m\n9h,2026-11-09T09:00:00Z,cam-1,1,2\n")
    ingest(site, [tmp_path / "a.csv"], IngestOptions(), now=NOW)
    assert replay(site, is_dry_run=True).n_bad == {"not-a-time": 1}
    fixed = replace(site, sources=(replace(tills, map={"ts": "utc"}),))
    assert replay(fixed, options=IngestOptions(map={"ts": "local"}), is_dry_run=True).n_bad == {"not-a-time": 1}
    assert (replay(fixed).n_solved, len(stored(fixed)["observations"])) == (1, 1)


def test_a_mapping_given_on_the_command_line_wins_over_that_of_the_ingest(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site", settings=PLAIN)
    path = tmp_path / "a.csv"
    path.write_text("local,utc,x_m,y_m\nnever,2026-11-09T09:00:00Z,1,2\n")
    ingest(site, [path], IngestOptions(map={"ts": "local"}, camera="cam-1"), now=NOW)
    wrong = replay(site, options=IngestOptions(map={"ts": "nothing"}))
    assert [e.code for e in wrong.errors] == ["E203"]
    assert wrong.n_bad == {"not-a-time": 1}
    assert replay(site, options=IngestOptions(map={"ts": "utc"})).n_left == 0
    assert [r["camera_id"] for r in stored(site)["observations"]] == ["cam-1"]


def test_a_headerless_table_is_read_with_its_columns_and_its_first_line_is_no_record_again(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site", settings=PLAIN)
    path = tmp_path / "a.txt"
    path.write_text("2026-11-09T09:00:00Z;4;1,5;2\n2026-11-09T09:00:01Z;a;2;3\n2026-11-09T09:00:02Z;b;3;4\n")
    ingest(site, [path], IngestOptions(columns=("ts", "x_m", "y_m", "_"), camera="cam-1"), now=NOW)
    assert [(e.line, e.first_line[-9:]) for e in left(site)] == [(2, "Z;4;1,5;2"), (3, "Z;4;1,5;2")]
    found = replay(site, options=IngestOptions(columns=("ts", "_", "x_m", "y_m")))
    assert (found.n_left, dict(found.n_records)) == (0, {"observations": 2})
    assert sorted(r["x_mm"] for r in stored(site)["observations"]) == [2000, 3000, 4000]


def test_a_record_without_camera_takes_the_one_that_is_given(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site", settings=PLAIN)
    (tmp_path / "a.csv").write_text(HEADER + "2026-11-09T09:00:00Z,,a,1,2\n")
    ingest(site, [tmp_path / "a.csv"], IngestOptions(), now=NOW)
    assert replay(site).n_bad == {"no-camera": 1}
    assert replay(site, options=IngestOptions(camera="left")).n_left == 0
    assert [r["camera_id"] for r in stored(site)["observations"]] == ["cam-1"]


def test_a_larger_limit_lets_what_is_in_it_go_and_keeps_the_rest_with_its_reason_now(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site", settings=PLAIN)
    rows = "".join(
        f"2026-11-09T09:00:00Z,{c},{x},{x},2\n" for c, x in (("cam-1", 20_000), ("cam-1", 80_000), ("no", 5))
    )
    (tmp_path / "a.csv").write_text(HEADER + rows)
    ingest(site, [tmp_path / "a.csv"], IngestOptions(), now=NOW)
    before = left(site)
    wider = replace(site, settings=PLAIN.with_values({"coordinate_max_m": 50_000.0}))
    found = replay(wider, now=NOW + timedelta(days=9))
    assert (found.n_solved, found.n_bad) == (1, {"out-of-range": 1, "unknown-camera": 1})
    assert [r["x_mm"] for r in stored(site)["observations"]] == [20_000_000]
    assert [(e.line, e.reason, e.at) for e in left(site)] == [(3, "out-of-range", NOW), (4, "unknown-camera", NOW)]
    assert "50000 m" in left(site)[0].detail
    assert left(site)[1] == before[2]


def test_a_record_from_the_future_does_not_become_right_by_waiting(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site", settings=PLAIN)
    (tmp_path / "a.csv").write_text(HEADER + "2026-11-25T09:00:00Z,cam-1,a,1,2\n")
    ingest(site, [tmp_path / "a.csv"], IngestOptions(), now=NOW)
    assert replay(site).n_bad == {"time-out-of-range": 1}
    assert replay(site, now=datetime(2026, 12, 24, tzinfo=UTC)).n_left == 0


def test_a_live_record_is_held_against_the_instant_it_came_at(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site", settings=PLAIN)
    rows = MessageRows(IngestOptions())
    payloads = [MESSAGE % ("yard", 1, "Z", 1, 2), MESSAGE % ("yard", 2, "Z", 1, 2), '{"v":1,\n"camera":"cam-1"\n}']
    for number, payload in enumerate(payloads, 1):
        rows.add(number, payload.encode())
    batch = rows.batch(0)
    normaliser = Normaliser(site, now=NOW, keys=None)
    came = datetime(2026, 11, 9, 9, 0, 5, tzinfo=UTC)
    for at in (came, came + timedelta(days=3)):
        normaliser.live_at(at)
        quarantine = Quarantine(site.root / "quarantine", source="mqtt:a", at=at, is_live=True)
        quarantine.add(normaliser.normalise(batch).rejected, reading=SourceReading("frames", first_line=""))
        quarantine.close()
    found = replay(with_camera(site))
    assert found.n_solved == 8
    assert found.n_bad == {"time-out-of-range": 8, "bad-message": 2}
    assert len(stored(site)["frames"]) == 2


def test_a_dry_run_changes_nothing_and_tells_what_would_be(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site")
    ingest(site, [frames_file(tmp_path / "a.jsonl")], IngestOptions(), now=NOW)
    before = tree(site.root)
    dry = replay(with_camera(site), is_dry_run=True)
    assert tree(site.root) == before
    wet = replay(with_camera(site))
    assert (dry.n_solved, dry.n_records, dry.n_bad) == (wet.n_solved, wet.n_records, wet.n_bad)
    assert dry.n_bad == {"bad-json": 1}


def test_what_is_not_chosen_and_what_stays_bad_is_not_touched(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site")
    ingest(site, [frames_file(tmp_path / "a.jsonl"), table_file(tmp_path / "b.csv")], IngestOptions(), now=NOW)
    before = tree(site.root / "quarantine")
    assert replay(site).n_solved == 0
    assert replay(with_camera(site), reason="none-such").n_chosen == 0
    assert replay(with_camera(site), source="c.csv").n_chosen == 0
    assert tree(site.root / "quarantine") == before
    assert replay(with_camera(site), source="b.csv").n_solved == 1
    after = tree(site.root / "quarantine")
    assert len([p for p in before if p in after and before[p] == after[p]]) == 1


def test_a_frame_with_one_bad_person_is_stored_and_the_person_stays(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site", settings=PLAIN)
    quarantine = Quarantine(site.root / "quarantine", source="mqtt:a", at=NOW)
    bad = MESSAGE % ("cam-1", 1, "Z", 1, 99_999)
    rejected = room.Rejected(7, "bad-json", "cut", bad, whole=bad.strip())
    quarantine.add([rejected], reading=SourceReading("frames", first_line=""))
    quarantine.close()
    found = replay(site)
    assert dict(found.n_records) == {"observations": 1, "frames": 1}
    assert {(e.line, e.reason, e.table, e.at) for e in left(site)} == {
        (7, "out-of-range", "observations", NOW),
        (7, "out-of-range", "pairs", NOW),
    }
    found = replay(replace(site, settings=PLAIN.with_values({"coordinate_max_m": 1e6})))
    assert (found.n_solved, len(stored(site)["observations"]), len(stored(site)["pairs"])) == (2, 2, 1)


def test_an_entry_changed_by_hand_stays_and_harms_no_other(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site", settings=PLAIN)
    ingest(site, [table_file(tmp_path / "b.csv")], IngestOptions(), now=NOW)
    (path,) = files(site.root / "quarantine")
    lines = path.read_text().splitlines()
    row = next(json.loads(line) for line in lines if "unknown-camera" in line)
    spoiled = [{**row, "row": {**row["row"], "x_m": "one"}}, {**row, "row": {"camera": "yard"}}]
    line = next(json.loads(line) for line in lines if "not-a-number" in line)
    spoiled.append({**line, "options": {"fps": "fast"}})
    spoiled.append({**line, "format": "../../etc"})
    path.write_text("\n".join([*lines, *map(json.dumps, spoiled)]) + "\n")
    found = replay(with_camera(site))
    assert found.n_solved == 1
    assert len(found.errors) == 2
    assert len(left(site)) == 6


def test_killed_anywhere_and_run_again_is_the_same_store_and_quarantine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Replay is cut off before every write, rename's effect included, and every unlink."""

    bad = small_site(tmp_path / "bad", settings=PLAIN)
    ingest(bad, [frames_file(tmp_path / "a.jsonl"), table_file(tmp_path / "b.csv")], IngestOptions(), now=NOW)

    def prepared(root: Path) -> Site:
        shutil.copytree(bad.root, root)
        return with_camera(replace(bad, root=root))

    whole = prepared(tmp_path / "whole")
    replay(whole)
    expected = stored(whole), [(e.line, e.reason) for e in left(whole)]
    n_points = 0
    real = {"publish": durable.publish, "remove": durable.remove}
    for is_after in (False, True):
        for point in range(100):
            site = prepared(tmp_path / f"cut-{is_after}-{point}")
            n_left = point

            def cut(name: str, *arguments: Any, is_after: bool = is_after, **more: Any) -> None:
                nonlocal n_left
                n_left -= 1
                if n_left == -1 and not is_after:
                    raise KeyboardInterrupt
                real[name](*arguments, **more)
                if n_left == -1:
                    raise KeyboardInterrupt

            with monkeypatch.context() as patched:
                for name in real:
                    step = lambda *a, name=name, **m: cut(name, *a, **m)  # noqa: E731
                    patched.setattr(durable, name, step)
                try:
                    replay(site)
                except KeyboardInterrupt:
                    n_points += 1
                else:
                    break
            replay(site)
            assert (stored(site), [(e.line, e.reason) for e in left(site)]) == expected
            assert list(site.root.rglob("*.tmp")) == []
    assert n_points > 20


CONFIG = site_text()


def test_list_and_replay_tell_people_and_programs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def vsd(*arguments: str | Path) -> tuple[int, str]:
        code = run(cli, ["-C", str(tmp_path), *map(str, arguments)])
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return code, out

    (tmp_path / "vsd.toml").write_text(CONFIG)
    assert vsd("quarantine", "list") == (0, "nothing is in quarantine\n")
    (tmp_path / "a.csv").write_text(HEADER + "2025-11-10T09:00:00Z,y\x1b[2Jard,a,1,2\n2025-11-10T09:00:00Z,cam-1,b,1\n")
    vsd("ingest", tmp_path / "a.csv")
    code, out = vsd("quarantine", "list")
    assert code == 1
    assert "unknown-camera: 1 stored; 1 can be replayed" in out
    assert f"--> {tmp_path / 'a.csv'}, line 2" in out
    assert "engine_ids" in out
    assert "\x1b" not in out
    code, out = vsd("quarantine", "list", "--json", "--reason", "wrong-number-of-fields", "--limit", "9")
    (told,) = json.loads(out)["reasons"]
    assert (told["kept"], told["replayable"], told["examples"][0]["line"]) == (1, 1, 3)
    code, out = vsd("quarantine", "replay", "--dry-run")
    assert (code, "nothing was written" in out) == (1, True)
    (tmp_path / "vsd.toml").write_text(CONFIG + 'engine_ids = ["y\\u001b[2Jard"]\n')
    code, out = vsd("quarantine", "replay", "--json")
    told = json.loads(out)
    assert (code, told["fixed"], told["still_bad"]) == (1, 1, {"wrong-number-of-fields": 1})
    assert told["stored"]["observations"]["new"] == 1
    code, out = vsd("quarantine", "replay", "--reason", "unknown-camera")
    assert (code, out.splitlines()[-1][:7]) == (0, "0 of 0 ")
    assert vsd("quarantine", "replay", "--camera", "nobody")[0] == 2
    assert vsd("quarantine", "replay", "--map", "tz=x")[0] == 2


def test_what_waited_in_the_spool_is_not_counted_among_the_replayed(tmp_path: Path) -> None:
    """An earlier run was stopped before it folded: its records are none of this run's."""
    root = tmp_path / "shop"
    root.mkdir()
    (root / "vsd.toml").write_text(site_text("cam-1", "cam-2", more="[privacy]\npseudonyms = false\n"))
    frames_file(root / "f.jsonl")
    ingest(load_site(root), [root / "f.jsonl"], IngestOptions(), now=NOW, is_folding=False)
    (root / "vsd.toml").write_text(
        site_text("cam-1", "cam-2", more='engine_ids = ["yard"]\n[privacy]\npseudonyms = false\n')
    )
    told = CliRunner().invoke(cli, ["-C", str(root), "quarantine", "replay"]).stdout
    assert "8 records that waited in the spool were stored first\n" in told
    assert "8 of 9 are good now, 8 records, 8 of them new to the store; 1 remain\n" in told
    told = CliRunner().invoke(cli, ["-C", str(root), "quarantine", "replay"]).stdout
    assert told.endswith("0 of 1 are good now, 0 records; 1 remain\n")


@pytest.mark.parametrize(
    ("says", "n_left"),
    [
        ('files = ["cam-2_*"]\ncamera = "cam-2"', 3),
        ('files = ["cam-*"]\ncamera_from_name = "{camera}_*.csv"', 0),
        ('files = ["cam-*"]\ncamera_from_name = "{camera}_c.csv"', 6),
    ],
)
def test_a_source_added_later_says_the_camera_of_records_without_one(says: str, n_left: int, tmp_path: Path) -> None:
    root = walks.project(tmp_path, "cam-1", "cam-2")
    names = ("cam-1_a.csv", "cam-2_b.csv")
    for name in names:
        rows = "".join(f"2025-11-25T09:00:0{second}Z,,{second},4\n" for second in range(3))
        (root / name).write_text(f"ts,camera_id,x_m,y_m\n{rows}")
    ingest(load_site(root), [root / name for name in names], IngestOptions(), now=walks.START)
    assert len(left(load_site(root))) == 6
    with (root / "vsd.toml").open("a") as toml:
        toml.write(f'[[source]]\nid = "named"\n{says}\n')
    site = load_site(root)
    replay(site)
    assert len(left(site)) == n_left
    seen = [(row["camera_id"], row["x_mm"]) for row in stored(site)["observations"]]
    wanted = [(camera, 1000 * second) for camera in ("cam-1", "cam-2") for second in range(3)]
    assert sorted(seen) == {0: wanted, 3: wanted[3:], 6: []}[n_left]

"""What a user says about a file is used or refused, and what is printed as a fix runs on the very file."""

from __future__ import annotations

import json
import shlex
import shutil
import sqlite3
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.ingest.formats.adapters import adapter, formats
from vsd_analytics.ingest.formats.tables import Tables
from vsd_analytics.ingest.reading.adapter import CHOICES, IngestOptions, Source
from vsd_analytics.ingest.reading.elapsed import elapsed_ms, unit_ms
from vsd_analytics.ingest.reading.instants import offset_in_name

TOML = '[site]\nid = "hall"\nname = "Hall"\ntimezone = "Europe/Berlin"\n[[camera]]\nid = "cam-1"\nname = "Hall"\n'
PEOPLE = "--persons people --map ts=t,track_id=id,x_m=x,y_m=y"
START = "--start 2025-11-10T09:00"


@pytest.fixture
def vsd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    (tmp_path / "vsd.toml").write_text(TOML)

    def call(options: str, text: str | None = None, name: str = "a.csv") -> tuple[int, dict[str, Any]]:
        if text is not None:
            (tmp_path / name).write_text(text)
        command = ["-C", str(tmp_path), "--now", "2026-11-28", "check", str(tmp_path / name), "--json"]
        code = run(cli, [*command, *shlex.split(options)])
        source = json.loads(capsys.readouterr().out)["sources"][0]
        return code, source

    return call


def codes(source: dict[str, Any]) -> list[str]:
    warnings = [] if source["card"] is None else [w["code"] for w in source["card"]["warnings"]]
    return [*warnings, *([source["error"]["code"]] if source["error"] else [])]


def table(head: str, row: str, n: int = 30) -> str:
    return head + "\n" + "".join(row.format(i=i, x=1 + i / 50) + "\n" for i in range(n))


def lines(message: str, n: int = 30) -> str:
    return "".join(message.replace("@", str(i)) + "\n" for i in range(n))


@pytest.mark.parametrize(
    ("head", "cell", "options", "first"),
    [
        ("ts", "2025-07-10T09:00:{i:02}Z", '--time-format "%Y-%m-%dT%H:%M:%SZ"', "11:00:00+02:00"),
        ("ts", "10/07/2025 09:00:{i:02} GMT", '--time-format "%d/%m/%Y %H:%M:%S GMT"', "11:00:00+02:00"),
        ("ts", "10/07/2025 09:00:{i:02} UTC", '--time-format "%d/%m/%Y %H:%M:%S %Z"', "11:00:00+02:00"),
        ("ts", "2025/07/10 09:00:{i:02} +0530", '--time-format "%Y/%m/%d %H:%M:%S +0530"', "05:30:00+02:00"),
        ("ts", "10/07/2025 09:00:{i:02}", '--time-format "%d/%m/%Y %H:%M:%S"', "09:00:00+02:00"),
        ("Seen at (UTC+01:00)", "2025-07-10 09:00:{i:02}", '--map "ts=Seen at (UTC+01:00)"', "10:00:00+02:00"),
        ("Seen at (UTC-05:30)", "2025-07-10 09:00:{i:02}", '--map "ts=Seen at (UTC-05:30)"', "16:30:00+02:00"),
    ],
)
def test_a_zone_in_a_format_or_a_header_counts(vsd: Any, head: str, cell: str, options: str, first: str) -> None:
    text = table(f"{head},track_id,x_m,y_m", cell + ",1,{x},2")
    _, source = vsd(f"{options} --camera cam-1 --zone Europe/Berlin", text)
    assert source["first"].endswith(first)


def test_a_year_in_a_name_is_no_offset() -> None:
    assert [offset_in_name(n) for n in ("run-2025", "export 2026-11-27", "time_utc", "ts")] == [None] * 4


@pytest.mark.parametrize(
    ("head", "cell", "more"),
    [
        ("time", "{i}", ""),
        ("time_ms", "{i}000", ""),
        ("time", "{i}000", "--time-format ms"),
        ("time", "{i}000000000", "--time-format ns"),
        ("time", "0:00:{i:02}", ""),
    ],
)
def test_times_since_the_beginning_are_read_with_start(vsd: Any, head: str, cell: str, more: str) -> None:
    options = f"--map ts={head},track_id=id,x_m=x,y_m=y --camera cam-1"
    text = table(f"{head},id,x,y", cell + ",1,{x},2")
    _, source = vsd(f"{options} {START} {more}", text)
    assert (source["first"], source["last"]) == ("2025-11-10T09:00:00+01:00", "2025-11-10T09:00:29+01:00")
    assert source["records"] == {"observations": 30}


def test_start_is_refused_for_times_that_are_instants(vsd: Any) -> None:
    text = table("ts,track_id,x_m,y_m", "2025-07-10T09:00:{i:02}Z,1,{x},2")
    assert codes(vsd(START, text)[1]) == ["E101"]


def test_elapsed_times_take_the_unit_of_their_name() -> None:
    assert [unit_ms(None, n) for n in ("t", "time_ms", "timestamp_us", "t_ns", "items")] == [1000, 1, 1e-3, 1e-6, 1000]
    assert [elapsed_ms(t, 1.0) for t in ("1:02:03.5", "02:03", "7", "x")] == [3_723_500, 123_000, 7, None]


MESSAGE = '{"t": 176276160@, "kind": "person", "people": [{"id": 1, "x": 1, "y": 2, "cls": "Person", "p": 0.8}]}'


def ten(message: str) -> str:
    return lines(message, 10)


@pytest.mark.parametrize(
    ("where", "code"),
    [
        ("clas = 'Person'", "E203"),
        ("people.cls = 'Person'", "E203"),
        ("cls = 'person'", "W212"),
        ("p >= 40", "W212"),
        ("kind = 'Person'", "W212"),
    ],
)
def test_a_filter_that_keeps_nobody_is_said_and_its_fix_keeps_people(vsd: Any, where: str, code: str) -> None:
    _, source = vsd(f'{PEOPLE} --where "{where}"', ten(MESSAGE), "a.jsonl")
    assert codes(source) == [code]
    if code == "W212":
        fix = source["card"]["warnings"][0]["fix"].removesuffix(" if they are the persons")
        again = vsd(f"{PEOPLE} {fix}", None, "a.jsonl")[1]
        assert again["records"]["observations"] == 10
        assert "W212" not in codes(again)


def test_a_message_of_another_kind_is_no_frame_without_people(vsd: Any) -> None:
    text = ten(MESSAGE) + MESSAGE.replace('"person"', '"vehicle"').replace("@", "99") + "\n"
    _, source = vsd(f"{PEOPLE} --where \"kind = 'person'\"", text, "a.jsonl")
    assert source["records"] == {"observations": 10, "frames": 10}


def test_messages_of_one_person_each_are_no_frames(vsd: Any) -> None:
    text = ten('{"t": 176276160@, "id": 1, "x": 1, "y": 2}\n{"t": 176276160@, "id": 2, "x": 5, "y": 2}')
    _, source = vsd("--format json --map ts=t,track_id=id,x_m=x,y_m=y", text, "a.jsonl")
    assert source["records"] == {"observations": 20}


@pytest.mark.parametrize(
    ("document", "options"),
    [
        ({"a": {"frames": [{"t": 1762761600, "people": [{"id": 1, "x": 1, "y": 2}]}]}}, "--persons a.frames.*.people"),
        ({"id": 1, "points": [{"t": 1762761600, "x": 1, "y": 2}]}, "--persons points"),
        ({"id": 1, "points": [[1762761600, 1, 2]]}, "--persons points --map ts=0,x_m=1,y_m=2"),
        ({"1762761600": [{"id": 1, "x": 1, "y": 2}]}, "--persons * --map ts=@key"),
        ({"hall/000.jpg": [{"id": 1, "x": 1, "y": 2}]}, f"--persons * --map frame=@key --fps 25 {START}"),
        ({"n": 0, "people": [{"id": 1, "x": 1, "y": 2}]}, f"--persons people --map frame=n --fps 25 {START}"),
    ],
)
def test_shapes_of_json_messages(vsd: Any, document: Any, options: str) -> None:
    shape = "x_m=x,y_m=y,track_id=id" + ("" if "frame=" in options else ",ts=t")
    _, source = vsd(
        f"--format json --map {shape} {options.replace('*', chr(39) + '*' + chr(39))}", json.dumps(document), "a.json"
    )
    assert source["records"]["observations"] == 1
    assert source["first"].startswith("2025-11-10T09:00:00") or "1762761600" in json.dumps(document)


P = [{"id": i, "x": 1.5 * i, "y": 2} for i in (1, 2)]


@pytest.mark.parametrize(
    "document",
    [
        {str(k): P for k in range(3)},
        {"frames": {str(k): P for k in range(3)}},
        {str(1762761600 + k): P for k in range(3)},
        {f"2025-11-10T08:00:0{k}Z": P for k in range(3)},
        {f"2025-11-10T08:00:0{k}Z": {"people": P} for k in range(3)},
        {str(k): {"7": {"x": 1, "y": 2}, "8": {"x": 3, "y": 4}} for k in range(3)},
        {"tracks": [{"id": 7, "path": [{"t": 1762761600 + k, "x": k, "y": 2} for k in range(6)]}]},
        [{"id": i, "path": [{"t": 1762761600 + k, "x": k, "y": 2} for k in range(3)]} for i in (1, 2)],
        [{"frames": [{"ts": 1762761600 + k, "objects": P} for k in range(3)]}],
    ],
)
def test_frames_by_keys_and_tracks_with_points_are_proposed_and_the_proposal_reads_all(vsd: Any, document: Any) -> None:
    source = vsd("", json.dumps(document), "a.json")[1]
    proposal = source["error"]["fix"].partition("probably: ")[2].partition("   (")[0]
    read = vsd(proposal, None, "a.json")[1]
    assert (read["records"]["observations"], read["quarantined"]) == (6, {})


def test_a_class_is_no_id(vsd: Any) -> None:
    text = "".join(f'{{"t": {1762761600 + k}, "people": [{{"name": "person", "x": 1, "y": 2}}]}}\n' for k in range(9))
    source = vsd("--persons people --map ts=t,x_m=x,y_m=y", text, "a.jsonl")[1]
    (fix,) = [w["fix"] for w in source["card"]["warnings"] if w["code"] == "W225"]
    assert fix.startswith("export the tracker's ids as track_id; ")
    assert "track_id=name" not in fix


def test_no_list_is_nobody_only_where_the_user_says_so(vsd: Any) -> None:
    text = '{"t":1762761600,"people":[{"id":1,"x":1,"y":2}]}\n{"t":1762761601}\n{"t":1762761602,"people":null}\n'
    assert vsd(PEOPLE, text, "a.jsonl")[1]["quarantined"] == {"bad-message": 2}
    said = vsd(f"{PEOPLE} --no-list-is-nobody", None, "a.jsonl")[1]
    assert (said["records"], said["quarantined"]) == ({"observations": 1, "frames": 3}, {})


MOT = "{i},1,300,500,380,700,.9,-1,-1,-1"
OF_MOT = f"--format motchallenge --camera cam-1 --fps 10 {START}"


def mot(row: str, first: int = 1) -> str:
    return "".join(row.format(i=i) + "\n" for i in range(first, 100 + first))


def test_the_fix_for_corners_in_motchallenge_text_runs(vsd: Any) -> None:
    source = vsd(OF_MOT, mot(MOT), "a.txt")[1]
    assert codes(source) == ["W226"]
    fix = source["card"]["warnings"][0]["fix"].removesuffix(" if they are")
    assert "W226" not in codes(vsd(f"{OF_MOT} {fix}", None, "a.txt")[1])


@pytest.mark.parametrize("sign", [" ", "\t", ";"])
def test_motchallenge_text_may_have_other_signs_between_its_numbers(vsd: Any, sign: str) -> None:
    text = mot(MOT.replace("380,700", "80,200").replace(",", sign))
    assert vsd(OF_MOT, text, "a.txt")[1]["records"] == {"observations": 100, "frames": 100}


def test_the_fix_for_exchanged_sides_runs(vsd: Any) -> None:
    options = f"--map frame=n,left=xmin,top=ymin,right=xmax,bottom=ymax --fps 25 --camera cam-1 {START}"
    source = vsd(options, table("n,xmin,ymin,xmax,ymax", "{i},300,500,260,600"))[1]
    assert codes(source)[0] == "W226"
    again = vsd(f"{options} {source['card']['warnings'][0]['fix']}")[1]
    assert again["records"] == {"observations": 30}


@pytest.mark.parametrize("name", [n for n in formats() if hasattr(adapter(n), "uses")])
def test_a_format_names_only_options_that_there_are(name: str) -> None:
    assert adapter(name).uses <= CHOICES.keys()  # type: ignore[attr-defined]


STATED: dict[str, str] = {
    "columns": "ts",
    "map": "ts=a",
    "where": "a = 1",
    "persons": "p",
    "unit": "mm",
    "zone": "Asia/Tokyo",
    "time_format": "%d.%m.%Y %H:%M",
    "period_s": "7",
    "fps": "3",
    "start": "2025-11-10T09:00",
    "first_frame": "5",
    "size_px": "9x9",
    "coordinates": "floor",
    "method": "four-corner",
    "resolution_px": "9x9",
    "threshold_m": "1.1",
}
"""A value of each option that only some formats read; those without one are flags."""


@pytest.mark.parametrize("name", formats())
def test_every_option_that_a_format_does_not_read_is_refused(vsd: Any, name: str) -> None:
    unused = [field for field in CHOICES if field not in adapter(name).uses]  # type: ignore[attr-defined]
    for field in unused:
        value = f" {shlex.quote(STATED[field])}" if field in STATED else ""
        source = vsd(f"--format {name} {CHOICES[field]}{value}", "a\n1\n")[1]
        assert codes(source) == ["E101"], field
        assert source["error"]["message"].startswith(CHOICES[field])
    assert unused


FILTERED: dict[str, tuple[str, str, str]] = {
    "table": ("ts,track_id,x_m,y_m,kind", "2025-07-10T09:00:{i:02}Z,1,{x},2,person", "kind"),
    "positions": ("ts,track_id,x_m,y_m,kind", "2025-07-10T09:00:{i:02}Z,1,{x},2,person", "kind"),
    "pairs": ("ts,track_a,track_b,distance_m,kind", "2025-07-10T09:00:{i:02}Z,1,2,1.5,person", "kind"),
    "kitti": ("", "{i} 3 Pedestrian 0 0 -1.5 300 150 340 260 1.7 0.6 0.8 -1.2 1.6 9.5 0.1", "type"),
    "supervision": (
        "x_min,y_min,x_max,y_max,class_id,confidence,tracker_id,class_name,frame_index",
        "100,50,140,200,0,0.9,1,person,{i}",
        "class_name",
    ),
    "json": ("", MESSAGE.replace("{", "{{").replace("}", "}}").replace("176276160@", "1762761{i:03}"), "cls"),
}
"""Header, row and a column that a filter may name, of each format that reads --where."""


@pytest.mark.parametrize("name", [n for n in formats() if "where" in adapter(n).uses])  # type: ignore[attr-defined]
def test_a_filter_that_keeps_nobody_is_said_for_every_format_and_stores_no_frame(
    vsd: Any, tmp_path: Path, name: str
) -> None:
    head, row, column = FILTERED[name]
    times = "" if name in ("table", "positions", "pairs", "json") else f"--fps 10 {START}"
    options = f"--format {name} {times} {PEOPLE if name == 'json' else ''}"
    text = table(head, row).removeprefix("\n")
    assert sum(vsd(options, text, "a.txt")[1]["records"].values()) >= 30
    options += f" --where \"{column} = 'nobody'\""
    assert codes(vsd(options, None, "a.txt")[1]) == ["W212"]
    project = ["-C", str(tmp_path), "--now", "2026-11-28"]
    assert run(cli, [*project, "ingest", str(tmp_path / "a.txt"), *shlex.split(options)]) != 0
    assert not list(tmp_path.rglob("*.parquet"))


def test_a_workbook_that_says_that_it_is_smaller_is_read_whole(vsd: Any, tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    import zipfile

    book = openpyxl.Workbook()
    book.active.append(["ts", "track_id", "x_m", "y_m"])
    for i in range(50):
        book.active.append([f"2025-11-10T08:00:{i:02}Z", 1, 1 + i / 50, 2])
    book.save(tmp_path / "whole.xlsx")
    with zipfile.ZipFile(tmp_path / "whole.xlsx") as old, zipfile.ZipFile(tmp_path / "a.xlsx", "w") as new:
        for entry in old.infolist():
            new.writestr(entry.filename, old.read(entry).replace(b'ref="A1:D51"', b'ref="A1:D11"'))
    assert vsd("", None, "a.xlsx")[1]["records"] == {"observations": 50}


def test_jupedsim_databases_are_read(vsd: Any, tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "a.sqlite") as database:
        database.execute("create table trajectory_data(frame integer, id integer, pos_x real, pos_y real)")
        database.execute("create table metadata(key text, value text)")
        database.execute("insert into metadata values('fps', '10')")
        rows = [(frame, person, 1 + frame / 10, 2 + person) for frame in range(50) for person in (1, 2) if frame != 7]
        database.executemany("insert into trajectory_data values(?, ?, ?, ?)", rows)
    database.close()
    source = vsd(START, None, "a.sqlite")[1]
    assert (source["format"], source["records"]) == ("jupedsim", {"observations": 98, "frames": 50})
    assert source["last"] == "2025-11-10T09:00:04+01:00"
    assert codes(vsd("", None, "a.sqlite")[1]) == ["E207"]


@pytest.mark.skipif(shutil.which("sqlite3") is None, reason="the command sqlite3 is not on this machine")
def test_the_fix_for_another_database_exports_its_table(vsd: Any, tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "a b.sqlite") as database:
        database.execute("create table notes(text)")
        database.execute("create table people(ts, track_id, x_m, y_m)")
        rows = [(f"2025-11-10T08:00:{i:02}Z", 1, 1 + i / 50, 2) for i in range(30)]
        database.executemany("insert into people values(?, ?, ?, ?)", rows)
    database.close()
    fix = vsd("", None, "a b.sqlite")[1]["error"]["fix"]
    subprocess.run(fix.removeprefix("export the table: "), shell=True, cwd=tmp_path, check=True)
    assert vsd("", None, "table.csv")[1]["records"] == {"observations": 30}


def test_ids_that_come_again_another_day_are_other_lives(vsd: Any) -> None:
    """They last a minute, and not from Monday to Friday."""
    rows = [
        f"2025-11-{day}T08:00:{i:02}Z,{p},{p + i / 50},{p}\n"
        for day in range(10, 15)
        for i in range(60)
        for p in (1, 2)
    ]
    source = vsd("", "ts,track_id,x_m,y_m\n" + "".join(rows))[1]
    assert source["card"]["life_s"] == 59.0


def test_kitti_labels_are_read(vsd: Any) -> None:
    tail = "0 0 -1.5 300 150 340 260 1.7 0.6 0.8 -1.2 1.6 9.5 0.1"
    text = "".join(f"{i} 3 Pedestrian {tail}\n{i} 4 Car {tail}\n" for i in range(20))
    source = vsd(f"--fps 10 {START}", text, "0001.txt")[1]
    assert (source["format"], source["records"], source["left_out"]) == (
        "kitti",
        {"observations": 20},
        {"by --where": 20},
    )


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ('<?xml version="1.0"?><viper xmlns="http://lamp.cfar.umd.edu/viper">', "ViPER"),
        ('<?xml version="1.0"?><annotations><version>1.1</version><meta>', "CVAT"),
        ("<fcd-export><timestep>", "SUMO"),
        ("pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1\n1 0 .4 1 2\n", "Vadere"),
        ("#group,false\n#datatype,string\n#default,\n,_time,_field,_value\n,2025-11-10T08:00:00Z,x,1\n", "InfluxDB"),
    ],
)
def test_the_refusal_names_what_is_not_read(vsd: Any, text: str, name: str) -> None:
    error = vsd("", text, "a.csv" if name == "InfluxDB" else "a.dat")[1]["error"]
    assert name in error["message"] + (error.get("why") or "")


def people_in_structs(folder: Path, name: str, *, in_lists: bool) -> None:
    """Write a Parquet or Feather file whose places are structs: of a person a row, or of a list of people."""
    times = [datetime(2025, 11, 10, 8, 0, second, tzinfo=UTC) for second in range(20)]
    people = [[{"id": p, "pos": {"x": 1.0 + s / 20, "y": 2.0 + p}} for p in range(s % 3)] for s in range(20)]
    if in_lists:
        rows = pa.table({"when": times, "meta": [{"cam": "cam-1"}] * 20, "people": people})
    else:
        flat = [(at, p) for at, each in zip(times, people, strict=True) for p in each]
        rows = pa.table({"when": [at for at, _ in flat], "who": [p for _, p in flat]})
    if name.endswith(".parquet"):
        pq.write_table(rows, folder / name, row_group_size=7)
    else:
        pyarrow.feather.write_feather(rows, folder / name)


@pytest.mark.parametrize("name", ["a.parquet", "a.feather"])
def test_structs_are_columns_with_dots_and_lists_of_people_are_frames(vsd: Any, tmp_path: Path, name: str) -> None:
    people_in_structs(tmp_path, name, in_lists=False)
    source = vsd("--map ts=when,track_id=who.id,x_m=who.pos.x,y_m=who.pos.y", None, name)[1]
    assert (source["records"], source["first"]) == ({"observations": 19}, "2025-11-10T09:00:01+01:00")
    people_in_structs(tmp_path, name, in_lists=True)
    source = vsd("", None, name)[1]
    assert codes(source) == ["E203"]
    fix = source["error"]["fix"].partition("probably: ")[2].partition("   (")[0]
    assert fix == "--persons people --map ts=when,camera_id=meta.cam,track_id=id,x_m=pos.x,y_m=pos.y"
    assert vsd(fix, None, name)[1]["records"] == {"observations": 19, "frames": 20}


@settings(max_examples=15)
@given(st.lists(st.none() | st.tuples(st.floats(0, 50), st.floats(0, 50)), min_size=1, max_size=40), st.integers(1, 9))
def test_a_struct_that_is_null_is_a_row_without_a_place(
    tmp_path_factory: pytest.TempPathFactory, places: list[tuple[float, float] | None], group: int
) -> None:
    path = tmp_path_factory.mktemp("structs") / "a.parquet"
    rows = [None if p is None else {"x": p[0], "y": p[1]} for p in places]
    kind = pa.struct([("x", pa.float64()), ("y", pa.float64())])
    table = pa.table({"ts": [1762761600 + i for i in range(len(rows))], "pos": pa.array(rows, kind)})
    pq.write_table(table, path, row_group_size=group)
    options = IngestOptions(camera="cam-1", map={"x_m": "pos.x", "y_m": "pos.y"})
    batches = list(Tables().read(Source(path), options))
    read = [(r["x_m"], r["y_m"]) for b in batches for r in b.table("observations").to_pylist()]
    assert read == [place or (None, None) for place in places]  # missing, and not 0, 0: quarantined like all such rows

"""Bad input through the command line: exit code 2 or a count of what was quarantined, and a message to act on."""

from __future__ import annotations

import gzip
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from site_text import site_text

import vsd_analytics
from vsd_analytics.cli import COMMANDS, cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.cli.explain import explanations
from vsd_analytics.errors import UsageError

CONFIG = site_text("cam-1", "cam-2")
HEADER = "ts,camera_id,track_id,x_m,y_m\n"
GOOD = "2026-11-09T09:00:00Z,cam-1,a,1,2\n"
PAIR = "2026-11-09T09:00:00Z,cam-1,a,b,1.5\n"
PAIRS = f"ts,camera_id,track_a,track_b,distance_m\n{PAIR}"
MESSAGE = '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","persons":[{"id":1,"x_m":1,"y_m":2}]}\n'

Vsd = Callable[..., tuple[int, str, str]]


@pytest.fixture
def vsd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    """Return a function that runs `vsd` in a small project and returns exit code, output and errors."""
    (tmp_path / "vsd.toml").write_text(CONFIG)

    def call(*arguments: str | Path) -> tuple[int, str, str]:
        given = ["-C", str(tmp_path), "--now", "2026-11-20T00:00:00Z", *map(str, arguments)]
        code = run(cli, given)
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return code, out, err

    return call


def _parquet(**columns: list[Any]) -> bytes:
    sink = pa.BufferOutputStream()
    pq.write_table(pa.table(columns), sink)
    data: bytes = sink.getvalue().to_pybytes()
    return data


def _message(**changes: Any) -> str:
    return json.dumps({**json.loads(MESSAGE), **changes}) + "\n"


# name of the file, content, code of the message, words it says, how to fix
REFUSED: dict[str, tuple[str, str | bytes | None, str, str, str]] = {
    "no such file": ("a.csv", None, "E201", "there is no file", "spelling"),
    "empty file": ("a.csv", "", "E202", "a.csv is empty", "export it again"),
    "empty gzip": ("a.jsonl.gz", gzip.compress(b"", mtime=0), "E202", "a.jsonl.gz is empty", "export it again"),
    "missing column": ("a.csv", HEADER.replace("x_m", "px") + GOOD, "E203", "no column 'x_m'", "--map x_m="),
    "pair without distance": ("a.csv", "ts,track_a,track_b\n1,2,3\n", "E203", "'distance_m'", "distance_m=THEIR_NAME"),
    "bytes with a quote": ("a.zip", b'PK\x03\x04"\r"\x00\xff\n', "E204", "not recognised", "export the table"),
    "headerless": ("a.csv", "1794214800,1,2,3\n", "E203", "no header", "--columns"),
    "no format": ("a.txt", "hello\n", "E204", "not recognised", "--format"),
    "Parquet cut in half": (
        "a.parquet",
        _parquet(ts=[1], x_m=[1], y_m=[1])[:300],
        "E205",
        "not a whole Parquet",
        "again",
    ),
    "gzip damaged at once": ("a.csv.gz", gzip.compress(HEADER.encode(), mtime=0)[:14], "E205", "damaged", "again"),
    "frame numbers only": ("a.csv", "frame,x_m,y_m\n1,2,3\n", "E207", "frame numbers but no times", "--hz 25 --start"),
    "no camera": ("a.csv", "ts,x_m,y_m\n1794214800,2,3\n", "E203", "no column 'camera_id'", "--camera"),
    "a list for numbers": ("a.parquet", _parquet(ts=[1], camera_id=["a"], x_m=[[1]], y_m=[1]), "E203", "type", "--map"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_that_cannot_be_used_is_refused_with_a_fix(vsd: Vsd, tmp_path: Path, name: str) -> None:
    file, content, error_code, words, fix = REFUSED[name]
    if content is not None:
        (tmp_path / file).write_bytes(content.encode() if isinstance(content, str) else content)
    for command in ("check", "ingest"):
        code, _, err = vsd(command, tmp_path / file)
        assert code == 2
        assert err.startswith(f"error[{error_code}]: ")
        assert words in err
        assert fix in next(line for line in err.splitlines() if line.startswith("  fix: "))
        assert f"more: vsd explain {error_code}" in err
    code, out, err = vsd("ingest", tmp_path / file, "--json")
    assert code == 2
    assert json.loads(out)["sources"][0]["error"]["code"] == error_code
    assert json.loads(out)["ok"] is False
    assert err == ""


BEYOND_NS = "time-out-of-range" if int(pd.__version__.partition(".")[0]) >= 3 else "not-a-time"
"""Before version 3, pandas read no time that nanoseconds since 1970 cannot hold."""

# name of the file, content, reason, line of the first bad record, good records stored, words of the message
QUARANTINED: dict[str, tuple[str, str | bytes, str, int, int, str]] = {
    "text in a number column": ("a.csv", HEADER + GOOD + GOOD.replace(",1,", ",abc,"), "not-a-number", 3, 1, "'abc'"),
    "NaN distance": ("a.csv", PAIRS + PAIR.replace("1.5", "NaN"), "not-a-number", 3, 1, "'NaN'"),
    "infinite distance": ("a.csv", PAIRS + PAIR.replace("1.5", "inf"), "not-a-number", 3, 1, "'inf'"),
    "negative distance": ("a.csv", PAIRS + PAIR.replace("1.5", "-1"), "negative-distance", 3, 1, "negative"),
    "year 1": ("a.csv", HEADER + GOOD + GOOD.replace("2026", "0001"), BEYOND_NS, 3, 1, "0001-11-09"),
    "year 9999": ("a.csv", HEADER + GOOD + GOOD.replace("2026", "9999"), BEYOND_NS, 3, 1, "9999-11-09"),
    "no time": ("a.csv", HEADER + GOOD + GOOD.replace("2026", "next"), "not-a-time", 3, 1, "not a time"),
    "unknown camera": ("a.csv", HEADER + GOOD + GOOD.replace("cam-1", "cam-7"), "unknown-camera", 3, 1, "cam-1, cam-2"),
    "path for a camera": ("a.csv", HEADER + GOOD.replace("cam-1", "../../x"), "unknown-camera", 2, 0, '["../../x"]'),
    "script for a camera": ("a.jsonl", MESSAGE + _message(camera="<script>"), "unknown-camera", 2, 2, "<script>"),
    "too few fields": ("a.csv", HEADER + GOOD + "1,2\n", "wrong-number-of-fields", 3, 1, "2 fields, 5 expected"),
    "truncated JSON line": ("a.jsonl", MESSAGE + MESSAGE[:40], "bad-json", 2, 2, "truncated"),
    "NaN in JSON": ("a.jsonl", MESSAGE + MESSAGE.replace('"x_m":1', '"x_m":NaN'), "bad-json", 2, 2, "invalid"),
    "wrong type in JSON": ("a.jsonl", MESSAGE + _message(persons=7), "bad-message", 2, 2, "vsd schema frame"),
    "long line": ("a.jsonl", MESSAGE + "x" * 2_000_000 + "\n", "line-too-long", 2, 2, "1,000,000 bytes"),
    "NUL": ("a.csv", HEADER + GOOD + GOOD.replace(",1,", ",1\x00,"), "not-a-number", 3, 1, "not a number"),
    "open quote": ("a.csv", HEADER + GOOD + GOOD.replace(",a,", ',"a,') + GOOD, "bad-quotes", 3, 1, "quotes"),
    "infinite position": ("a.parquet", _parquet(ts=[1794214800], camera_id=["cam-1"], x_m=[float("inf")], y_m=[1.0]),
                          "not-a-number", 1, 0, "'inf'"),
}  # fmt: skip


@pytest.mark.parametrize("name", QUARANTINED)
def test_a_bad_record_is_quarantined_counted_and_explained(vsd: Vsd, tmp_path: Path, name: str) -> None:
    file, content, reason, line, n_good, words = QUARANTINED[name]
    (tmp_path / file).write_bytes(content.encode() if isinstance(content, str) else content)
    code, out, err = vsd("ingest", tmp_path / file)
    assert code == 1
    assert f"{n_good} new record" in out
    assert re.search(
        rf"warning\[W210\]: \d records? quarantined: {reason}\n  --> {tmp_path / file}, line {line}\n", err
    )
    assert words in err
    assert "  fix: " in err
    kept = [json.loads(x) for p in (tmp_path / "quarantine").iterdir() for x in p.read_text().splitlines()]
    assert {k["reason"] for k in kept} == {reason}
    code, out, err = vsd("check", tmp_path / file, "--json")
    told = json.loads(out)
    assert (code, err, told["ok"], told["stored"]) == (1, "", True, {})
    assert told["sources"][0]["quarantined"] == {reason: len(kept)}
    assert told["sources"][0]["examples"][reason]["line"] == line


def test_records_before_the_damage_in_a_gzip_are_stored_and_the_damage_is_reported(vsd: Vsd, tmp_path: Path) -> None:
    rows = (f"2026-11-09T09:{k // 60 % 60:02}:{k % 60:02}Z,cam-1,{k},{k % 83 / 4},{k % 97 / 5}\n" for k in range(5000))
    whole = gzip.compress((HEADER + "".join(rows)).encode(), mtime=0)
    (tmp_path / "a.csv.gz").write_bytes(whole[: len(whole) // 2])
    code, out, err = vsd("ingest", tmp_path / "a.csv.gz")
    assert code == 2
    assert "error[E205]" in err
    stored = re.search(r"([\d,]+) new records stored", out)
    assert stored is not None
    assert 500 < int(stored[1].replace(",", "")) < 5000
    (tmp_path / "a.csv.gz").write_bytes(whole)
    assert "5,000 person records" in vsd("ingest", tmp_path / "a.csv.gz")[1]


@pytest.mark.parametrize("command", [("check",), ("ingest", "--dry-run")])
def test_checking_writes_nothing(vsd: Vsd, tmp_path: Path, command: tuple[str, ...]) -> None:
    (tmp_path / "a.jsonl").write_text(MESSAGE + "{broken\n" * 12_000)
    before = sorted(tmp_path.rglob("*"))
    code, out, _ = vsd(*command, tmp_path / "a.jsonl")
    assert code == 1
    assert "nothing was written" in out
    assert sorted(tmp_path.rglob("*")) == before


def test_a_clean_file_is_exit_code_0_and_says_so_once(vsd: Vsd, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(HEADER + GOOD)
    assert vsd("ingest", tmp_path / "a.csv")[0] == 0
    code, out, err = vsd("ingest", tmp_path / "a.csv")
    assert (code, err) == (0, "")
    assert out.endswith("0 new records stored, 1 was known already\n")


def test_control_characters_of_data_never_reach_the_terminal(vsd: Vsd, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(HEADER + GOOD.replace("cam-1", "\x1b[31mred\u202e\x07"))
    _, out, err = vsd("ingest", tmp_path / "a.csv")
    assert not set(out + err) & {"\x1b", "\x07", "\u202e"}
    assert "[31mred" in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["ingst"], "Did you mean 'ingest'?"),
        (["heat"], "Did you mean 'heatmap'?"),
        (["ingest"], "Missing argument 'FILES...'"),
        (["ingest", "a.csv", "--colums", "x"], "--columns"),
        (["ingest", "a.csv", "--period", "fast"], "--period"),
        (["ingest", "a.csv", "--period", "0"], "--period must be greater than 0"),
        (["ingest", "a.csv", "--period", "nan"], "--period must be greater than 0"),
        (["ingest", "a.csv", "--first-frame", "nan"], "--first-frame"),
        (["ingest", "a.csv", "--map", "ts"], "OURS=THEIRS"),
        (["ingest", "a.csv", "--map", "x_n=px"], "--map x_m=px"),
        (["ingest", "a.csv", "--camera", "cam-11"], "--camera cam-1"),
        (["ingest", "a.csv", "--start", "soon"], "--start"),
        (["ingest", "a.csv", "--resolution", "big"], "640x480"),
        (["ingest", "a.tar", "--per-camera", "--camera", "cam-1"], "leave out --camera"),
        (["--now", "soon", "check", "a.csv"], "--now"),
        (["site", "build", "--out", "pages/index.html"], "--out pages"),
    ],
)
def test_a_wrong_call_is_exit_code_2_and_says_how_to_call(vsd: Vsd, arguments: list[str], words: str) -> None:
    code, out, err = vsd(*arguments)
    assert (code, out) == (2, "")
    assert "error[E101]: " in err
    assert words in err
    code, out, err = vsd(*arguments, "--json")
    assert (code, err) == (2, "")
    told = json.loads(out)
    assert (told["ok"], told["code"]) == (False, "E101")
    assert words in f"{told['message']} {told['fix']}"


def test_no_project_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, ["-C", str(tmp_path), "ingest", "a.csv"]) == 2
    assert "error[E102]" in capsys.readouterr().err


def test_an_interrupt_is_exit_code_130(vsd: Vsd, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*arguments: object, **more: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("vsd_analytics.ingest.intake.pipeline.ingest", interrupted)
    (tmp_path / "a.csv").write_text(HEADER + GOOD)
    code, _, err = vsd("ingest", tmp_path / "a.csv")
    assert (code, err.strip()) == (130, "interrupted")


def test_an_internal_error_is_reported_without_a_traceback_unless_asked(
    vsd: Vsd, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*arguments: object, **more: object) -> None:
        raise ZeroDivisionError("of all things")

    monkeypatch.setattr("vsd_analytics.ingest.intake.pipeline.ingest", broken)
    code, _, err = vsd("ingest", tmp_path / "a.csv")
    assert code == 2
    assert "error[E900]" in err
    assert "ZeroDivisionError: of all things" in err
    with pytest.raises(ZeroDivisionError):
        vsd("-v", "ingest", tmp_path / "a.csv")


_ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}

_SLOW = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background starts with it ignored
from vsd_analytics.cli import main
from vsd_analytics.store.store import Store
def fold(self, **more):
    print("ready", flush=True)
    time.sleep(60)
Store.fold = fold
main()
"""


def test_ctrl_c_stops_an_ingest_and_nothing_acknowledged_is_lost(vsd: Vsd, tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(MESSAGE)
    (tmp_path / "b.jsonl").write_text(MESSAGE.replace("cam-1", "cam-2"))
    process = subprocess.Popen(
        [sys.executable, "-c", _SLOW, "-C", str(tmp_path), "ingest", str(tmp_path / "a.jsonl")],
        env=_ENVIRONMENT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=20)
    assert (process.returncode, err.strip()) == (130, "interrupted")
    assert "4 new records stored" in vsd("ingest", tmp_path / "b.jsonl")[1]


def test_a_command_without_its_words_prints_its_help_and_no_error_message(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in ([], ["log"]):
        assert run(cli, arguments) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.startswith("Usage: vsd")
        assert err.count("Usage:") == 1
        assert "error[" not in err


def test_a_table_under_any_name_is_read_once_its_columns_are_mapped(vsd: Vsd, tmp_path: Path) -> None:
    (tmp_path / "a.top").write_text("when who east north\n1794214800 7 1 2\n")
    assert vsd("check", tmp_path / "a.top")[0] == 2
    renames = "--map", "ts=when,track_id=who,x_m=east,y_m=north"
    code, out, _ = vsd("check", tmp_path / "a.top", "--camera", "cam-1", *renames)
    assert (code, "1 person record" in out) == (0, True)


def test_hours_by_camera_leave_out_closed_hours_without_data(vsd: Vsd, tmp_path: Path) -> None:
    config = CONFIG.replace('timezone = "Europe/Rome"', 'timezone = "Europe/Rome"\nopening = { mon = "10:00-12:00" }')
    (tmp_path / "vsd.toml").write_text(config)
    (tmp_path / "a.csv").write_text(HEADER + GOOD)
    vsd("ingest", tmp_path / "a.csv")
    out = vsd("hours", "--by", "camera", "--range", "2026-11-09")[1]
    assert re.findall(r"T(\d\d):00:00\S+ +(cam-\d)", out) == [(h, c) for h in ("10", "11") for c in ("cam-1", "cam-2")]


def test_coverage_names_its_days_and_halves_of_hours(vsd: Vsd, tmp_path: Path) -> None:
    config = CONFIG.replace('timezone = "Europe/Rome"', 'timezone = "Europe/Rome"\nopening = { mon = "10:00-12:30" }')
    (tmp_path / "vsd.toml").write_text(config)
    (tmp_path / "a.csv").write_text(HEADER + GOOD)
    vsd("ingest", tmp_path / "a.csv")
    lines = vsd("coverage", "--range", "2026-11-08..2026-11-09")[1].splitlines()
    head = lines.index("recorded") + 1
    assert lines[head].split() == ["camera", "2026-11-08", "2026-11-09"]
    assert lines[head + 1].split()[-2:] == ["–", "<0.1%"]
    assert "2.5" in "\n".join(lines).split(), "half an hour is no whole one"


def test_help_imports_nothing_heavy() -> None:
    script = (
        "import sys\n"
        "from vsd_analytics.cli.exit_codes import run\n"
        "from vsd_analytics.cli import cli\n"
        "code = run(cli, ['--help'])\n"
        "heavy = {'duckdb', 'pyarrow', 'cv2', 'matplotlib', 'pandas', 'numpy', 'scipy', 'jinja2'} & set(sys.modules)\n"
        "sys.exit(f'imported: {heavy}' if heavy or code else 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], env=_ENVIRONMENT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert all(name in done.stdout for name in COMMANDS)


def test_every_code_in_the_source_is_explained() -> None:
    package = Path(vsd_analytics.__file__).parent
    used = {c for p in package.rglob("*.py") for c in re.findall(r"\"([EW]\d{3})[\":]", p.read_text("utf-8"))}
    assert used - set(explanations()) == set()


def test_what_is_missing_in_the_table_of_a_query_is_a_dash(vsd: Vsd, tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(MESSAGE)
    vsd("ingest", tmp_path / "a.jsonl")
    values = "('x', 1, 1.5::double, true), (null, null, null, null)"
    out = vsd("sql", f"select * from (values {values}) as t (name, n, share, is_open)")[1]
    head, first, second = (line.split() for line in out.splitlines())
    assert head == ["name", "n", "share", "is_open"]
    assert first == ["x", "1", "1.5", "True"]
    assert second == ["–"] * 4


def test_control_characters_of_a_query_do_not_reach_the_terminal(vsd: Vsd, tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(MESSAGE)
    assert vsd("ingest", tmp_path / "a.jsonl")[0] == 0
    code, out, _ = vsd("sql", "select chr(27) || '[31mred' as a")
    assert (code, "\x1b" in out, "red" in out) == (0, False, True)


@pytest.mark.parametrize(
    "arguments",
    [
        ["hours", "--week", "9999-W52"],
        ["hours", "--week", "0001-W01"],
        ["hours", "--week", "last-9999"],
        ["hours", "--range", "0001-01-01..0001-01-02"],
        ["hours", "--range", "9999-12-30..9999-12-31"],
        ["report", "--week", "9999-W52"],
    ],
)
def test_days_at_the_ends_of_the_calendar_are_reported(vsd: Vsd, tmp_path: Path, arguments: list[str]) -> None:
    (tmp_path / "a.jsonl").write_text(MESSAGE)
    assert vsd("ingest", tmp_path / "a.jsonl")[0] == 0
    code, _, err = vsd(*arguments)
    assert (code, "E101" in err) == (2, True)


@pytest.mark.parametrize("now", ["0001-01-01", "9999-12-31T23:59:59"])
def test_clock_at_the_ends_of_the_calendar_is_reported(capsys: pytest.CaptureFixture[str], now: str) -> None:
    assert run(cli, ["--now", now, "report"]) == 2
    assert "E101" in capsys.readouterr().err


def test_doctor_finds_a_damaged_file_of_the_store(vsd: Vsd, tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(MESSAGE)
    assert vsd("ingest", tmp_path / "a.jsonl")[0] == 0
    assert "damaged" not in vsd("doctor")[1]
    part = next((tmp_path / "store" / "observations").rglob("*.parquet"))
    part.write_bytes(part.read_bytes()[:-9])
    code, out, _ = vsd("doctor")
    assert (code, "1 damaged file(s)" in out, part.name in out) == (1, True, True)


def test_the_demo_makes_a_project_of_its_own_and_refuses_another_ones_folder(tmp_path: Path) -> None:
    """`-C` would be an option that is not used; the printed command is the one that was meant."""
    with pytest.raises(UsageError) as refusal:
        cli.main(["-C", str(tmp_path), "demo", "shop"], standalone_mode=False)
    assert refusal.value.fix == f"vsd demo {tmp_path / 'shop'}"
    assert not (tmp_path / "shop").exists()

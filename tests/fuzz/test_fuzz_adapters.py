"""Damaged inputs end in quarantine or a refusal with a code, and the good rows around the damage are stored.

The long run of the same cases is `prove_fuzz.py`; what it found stands here in its smallest form.
"""

from __future__ import annotations

import gzip
import io
import random
import time
import zipfile
from collections.abc import Iterator
from functools import cache

import pyarrow as pa
import pytest
from fuzz_cases import WORLDS, compare, run_case
from fuzz_judge import HangError, Judge, Outcome, WrongRowsError, limited
from fuzz_worlds import CONFIG, START_MS, World, annotations, object_log, parquet, sequence, text_of, zipped
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vsd_analytics.ingest.formats import frames

BY_NAME = {w.name: w for w in WORLDS}
CAMERA = {"camera": "cam-1"}
QUICK = settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def judge(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Judge]:
    return Judge(tmp_path_factory.mktemp("fuzz"))


def undamaged(judge: Judge, world: World) -> Outcome:
    if world.name == "vsd.toml":
        return judge.config(text_of(world.lines))
    if not world.file:
        return judge.payloads(world.lines)
    if world.pack is None:
        return judge.folder_of(world, dict(world.files))
    return judge.file(world, world.pack(text_of(world.lines) if world.lines else world.files))


@cache
def stored(judge: Judge, name: str, *more: bytes) -> Outcome:
    """Ingest the lines of a world and some more, once for all examples of a test."""
    world = BY_NAME[name]
    return judge.file(world, text_of([*world.lines, *more]))


@pytest.mark.parametrize("name", BY_NAME)
def test_every_input_is_clean_before_it_is_damaged(judge: Judge, name: str) -> None:
    outcome = undamaged(judge, BY_NAME[name])
    assert (outcome.word, outcome.code) == ("clean", "")
    assert (outcome.rows.total() >= 10) == (name != "vsd.toml")


@pytest.mark.filterwarnings("error::SyntaxWarning", "error::RuntimeWarning")
@pytest.mark.parametrize(("first", "last"), [(0, 29), (30, 99), (100, 199), (200, 299)])
def test_damaged_inputs_are_reported_and_the_rows_around_the_damage_are_stored(
    judge: Judge, first: int, last: int
) -> None:
    words = {run_case(judge, number, seed=1).outcome.word for number in range(first, last + 1)}
    assert words == {"clean", "quarantined", "refused"}


TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\n"), max_size=60)
CELLS = st.lists(st.one_of(TEXT, st.integers().map(str), st.floats().map(str)), min_size=5, max_size=5)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | TEXT,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(TEXT | st.sampled_from(("id", "x_m")), inner, max_size=4)
    ),
    max_leaves=12,
)


@QUICK
@given(line=st.binary(max_size=200).filter(lambda b: b"\n" not in b))
@pytest.mark.parametrize(
    "name", ["frames: JSONL", "table: CSV", "motchallenge: gt.txt", "smart-social-distancing: log"]
)
def test_any_line_leaves_the_others_alone(judge: Judge, name: str, line: bytes) -> None:
    world = BY_NAME[name]
    compare(stored(judge, name, b"").rows, judge.file(world, text_of([*world.lines, line])).rows, world.tables)


@QUICK
@given(cells=CELLS)
def test_any_cells_of_a_row_leave_the_others_alone(judge: Judge, cells: list[str]) -> None:
    world = BY_NAME["table: CSV"]
    outcome = judge.file(world, text_of([*world.lines, ",".join(cells).encode()]))
    assert not stored(judge, world.name).rows - outcome.rows


@QUICK
@given(message=st.dictionaries(st.sampled_from(sorted(frames.FrameMessage.__struct_fields__)) | TEXT, JSON, max_size=8))
def test_any_message_leaves_the_others_alone(judge: Judge, message: dict[str, object]) -> None:
    import json

    world = BY_NAME["frames: MQTT payloads"]
    without = judge.payloads(world.lines)
    assert not without.rows - judge.payloads([*world.lines, json.dumps(message).encode()]).rows


# -- what the long run found, smallest ------------------------------------------------------------------------------


def table(judge: Judge, data: bytes, *, name: str = "a.csv", **options: object) -> Outcome:
    return judge.file(World("", name), data, name=name, **{**CAMERA, **options})


def test_gzip_with_damaged_blocks_is_refused_and_the_lines_before_are_stored(judge: Judge) -> None:
    rows = "".join(f"{START_MS + k},{k},{9 * random.Random(k).random()},{k % 7}\n" for k in range(20_000))
    packed = bytearray(gzip.compress(("ts,track_id,x_m,y_m\n" + rows).encode(), mtime=0))
    packed[-4000:-3000] = b"\xff" * 1000
    outcome = table(judge, bytes(packed), name="a.csv.gz")
    assert (outcome.word, outcome.code) == ("refused", "E205")
    assert outcome.rows.total() > 1000


@pytest.mark.parametrize("kind", ["us", "s"])
def test_a_time_beyond_the_calendar_for_an_id_or_a_time_spoils_its_row_only(judge: Judge, kind: str) -> None:
    wild = pa.array([-(2**50), 0], pa.int64()).cast(pa.timestamp(kind))
    columns = {"ts": [1_794_211_200, 1_794_211_201], "track_id": wild, "x_m": [1.0, 1.0], "y_m": [2.0, 2.0]}
    assert table(judge, parquet(pa.table(columns)), name="a.parquet").rows.total() == 2
    columns["x_m"] = [float("inf"), 1.0]
    assert table(judge, parquet(pa.table(columns)), name="a.parquet").rows.total() == 1


def test_text_of_parquet_that_is_no_utf8_spoils_its_row_only(judge: Judge) -> None:
    texts = pa.Array.from_buffers(pa.string(), 2, pa.array([b"\xff\xed", b"1.5"], pa.binary()).buffers())
    columns = {"ts": [1_794_211_200, 1_794_211_201], "track_id": texts, "x_m": texts, "y_m": [2.0, 2.0]}
    outcome = table(judge, parquet(pa.table(columns)), name="a.parquet")
    assert (outcome.word, outcome.rows.total()) == ("quarantined", 1)


def test_a_name_of_a_column_of_parquet_that_is_no_utf8_is_refused(judge: Judge) -> None:
    data = parquet(pa.table({"ts": [1_794_211_200], "x_m": [1.0], "y_m": [2.0]}), store_schema=False)
    assert table(judge, data.replace(b"x_m", b"\xed_m"), name="a.parquet").code in ("E203", "E205")
    assert table(judge, data, name="a.parquet").rows.total() == 1


@pytest.mark.parametrize("world", ["motchallenge: gt.txt", "wildtrack: folder"])
def test_frames_at_no_instant_are_quarantined(judge: Judge, world: str) -> None:
    options = {"start": START_MS, "fps": 0.001, "first_frame": 9e14, **CAMERA}
    mot, wild = BY_NAME["motchallenge: gt.txt"], BY_NAME["wildtrack: tar.gz"]
    if world.startswith("mot"):
        outcome = judge.file(mot, text_of(mot.lines), **options)
    else:
        assert wild.pack is not None
        outcome = judge.file(wild, wild.pack(wild.files), **options)
    assert (outcome.word, outcome.rows.total()) == ("quarantined", 0)


def test_a_sampling_period_below_a_millisecond_changes_no_time(judge: Judge) -> None:
    data = f"ts,track_id,x_m,y_m\n{START_MS},1,1,2\n".encode()
    assert table(judge, data, period_s=1e-300).rows == table(judge, data).rows


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("number", ["1e308", "-1.7e308", "9" * 400, "9" * 5000])
def test_a_time_too_large_for_a_double_spoils_its_row_only(judge: Judge, number: str) -> None:
    outcome = table(judge, f"ts,track_id,x_m,y_m\n{number},1,1,2\n{START_MS},2,1,2\n".encode())
    assert outcome.word == "quarantined"
    assert outcome.rows.total() <= 1


@pytest.mark.parametrize("number", ["9" * 400, "9" * 5000, "0x" + "f" * 5000, "-9223372036854775809"])
@pytest.mark.parametrize("key", ["polygon = [[0, 0], [5, 0], [5, {}]]", "unknown = {}", "name = {}"])
def test_a_whole_number_beyond_64_bits_in_the_configuration_is_reported(judge: Judge, key: str, number: str) -> None:
    text = CONFIG.partition("polygon")[0].replace('name = "Tills"\n', "") + key.format(number) + "\n"
    outcome = judge.config(text.encode())
    assert (outcome.word, outcome.code) == ("refused", "E103")


def test_damage_to_one_member_of_an_archive_leaves_the_others_alone(judge: Judge) -> None:
    smart = {"hall/objects_log/1.csv": b"no,header\n", "hall/objects_log/2.csv": object_log()}
    start, logs = {"start": START_MS, **CAMERA}, {"format": "smart-social-distancing", **CAMERA}
    clean = judge.file(World("", "a.zip"), zipped({"hall/objects_log/2.csv": object_log()}), **logs)
    outcome = judge.file(World("", "a.zip"), zipped(smart), **logs)
    assert (outcome.code, outcome.rows) == ("E203", clean.rows) != ("E203", {})
    files = annotations()
    first = sorted(files)[1]
    damaged = judge.file(World("", "a.zip"), _corrupted(files, first), **start)
    rest = judge.file(World("", "a.zip"), zipped({n: d for n, d in files.items() if n != first}), **start)
    assert (damaged.code, damaged.rows) == ("E205", rest.rows) != ("E205", {})
    sequences = {**sequence("HALL-01"), **sequence("HALL-02")}
    damaged = judge.file(World("", "a.zip"), _corrupted(sequences, "HALL-01/gt/gt.txt"), start=START_MS)
    rest = judge.file(World("", "a.zip"), zipped(sequence("HALL-02")), start=START_MS, camera="hall-02")
    assert damaged.code == "E205"
    assert not rest.rows - damaged.rows
    assert rest.rows


def _corrupted(files: dict[str, bytes], name: str) -> bytes:
    """Return a zip in which the checksum of one stored member is wrong."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for each, data in files.items():
            archive.writestr(each, data)
    data = bytearray(out.getvalue())
    at = data.find(files[name], data.find(name.encode()))
    data[at] ^= 1
    return bytes(data)


def test_the_judge_tells_rows_lost_and_a_hang(judge: Judge, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(HangError), limited(0.01):
        time.sleep(2)
    add, numbers = frames.MessageRows.add, range(0, 25 * len(WORLDS), len(WORLDS))
    for number in numbers:  # the rows without the damaged line are remembered
        run_case(judge, number, seed=1)

    def forgetful(self: frames.MessageRows, number: int, line: bytes) -> None:
        if number != 3:
            add(self, number, line)

    monkeypatch.setattr(frames.MessageRows, "add", forgetful)
    with pytest.raises(WrongRowsError):
        _ = [run_case(judge, number, seed=1) for number in numbers]

"""Whoever can write to the place and has no key makes work there, and neither destroys records nor adds any."""

from __future__ import annotations

import contextlib
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from exchange_world import NOW, START, World, make_world, message, stored, take_in
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.cluster import parts_of_nodes
from vsd_analytics.cluster.exchange import Exchange, exchange_of
from vsd_analytics.cluster.handing_on import HandedOn, hand_on
from vsd_analytics.cluster.receiving import Received, receive
from vsd_analytics.cluster.signatures import HandedFile, Signer
from vsd_analytics.errors import StoreError
from vsd_analytics.schema import SCHEMAS, TableName
from vsd_analytics.store import durable, outbox, quarantine
from vsd_analytics.store.day_chain import new_chain, read_chain
from vsd_analytics.store.secrets import DayKeys

GOOD = {"camera_id": "cam-1", "ts": START, "person": 0, "track_id": "0" * 16, "x_mm": 1000, "y_mm": 2000}
TABLES: tuple[TableName, ...] = ("frames", "observations")


def exchange(world: World) -> Exchange:
    route = world.site().exchange
    assert route is not None
    return exchange_of(route)


def send(world: World) -> HandedOn:
    return hand_on(world.site("north"), exchange(world), now=NOW)


def take(world: World) -> Received:
    return receive(world.site(), exchange(world), now=NOW)


def put(world: World, number: int) -> None:
    text = message("cam-1", START + timedelta(seconds=number), [("7", 1000 + number, 2000)])
    take_in(world.root, world.place, "north", text)


def files(world: World, pattern: str) -> list[Path]:
    return sorted((world.root / "place").glob(pattern))


def parts(world: World) -> list[Path]:
    return files(world, "nodes/north/*/*")


def signer(world: World) -> Signer:
    chain = read_chain(world.project("site") / "secrets")
    assert chain is not None
    return Signer(chain)


def forge_receipts(world: World) -> None:
    """Write a receipt for each file that the node holds, as version 1.1 and as a stranger with a key would."""
    stranger = Signer(new_chain())
    for path in outbox.ready(world.site("north").acknowledged):
        file = HandedFile.of_outbox(path, node="north")
        folder = world.root / "place" / "receipts" / "north"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / file.digest).write_bytes(b"received\n")
        (folder / Path(file.receipt).name).write_bytes(stranger.receipt(file, path.read_bytes()))


def swap_parts(world: World) -> None:
    there = parts(world)
    data = [path.read_bytes() for path in there]
    for path, other in zip(there, data[1:] + data[:1], strict=True):
        path.write_bytes(other)


def rename_parts(world: World) -> None:
    """Move parts to another table, another node and another stamp."""
    for number, path in enumerate(parts(world)):
        digest, tag = path.stem.partition("-")[0], path.stem.rpartition("-")[2]
        names = (
            path.parent.parent / "pairs" / path.name,
            world.root / "place" / "nodes" / "south" / path.parent.name / path.name,
            path.with_name(f"{digest}-{number:016x}-{tag}{path.suffix}"),
        )
        target = names[number % len(names)]
        target.parent.mkdir(parents=True, exist_ok=True)
        path.rename(target)


def cut_parts(world: World) -> None:
    for path in parts(world):
        path.write_bytes(path.read_bytes()[:-9])


def remove_parts(world: World) -> None:
    for path in parts(world):
        path.unlink()


def forge_part(world: World) -> None:
    """Put a part with a person of nobody there, unsigned and signed by a stranger."""
    data = part("observations", [GOOD])
    digest = durable.digest(data)
    folder = world.root / "place" / "nodes" / "north" / "observations"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{digest}.parquet").write_bytes(data)
    file = HandedFile("north", "observations", digest, "0" * 16, ".parquet")
    (folder / Path(Signer(new_chain()).name(file, data)).name).write_bytes(data)


def forge_days(world: World) -> None:
    """Let the notice forget all days, with the signature that it had."""
    path = world.root / "place" / "site.json"
    notice = json.loads(path.read_bytes())
    path.write_text(json.dumps({**notice, "days": ["2026-11-09"], "before": "2027-01-01"}))


def forge_node(world: World) -> None:
    path = world.root / "place" / "nodes" / "north" / "node.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"node": "north", "at": "2031-01-01T00:00:00Z", "n_waiting": 0, "version": "9"}))


class Copies:
    """Notes all files of the place, and puts those back that are gone: receipts, parts and notices of the past."""

    def __init__(self) -> None:
        self.data: dict[Path, bytes] = {}

    def keep(self, world: World) -> None:
        self.data |= {p: p.read_bytes() for p in files(world, "**/*") if p.is_file()}

    def put_back(self, world: World) -> None:
        for path, data in self.data.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)


FORGERIES: dict[str, Callable[[World], None]] = {
    f.__name__: f
    for f in (forge_receipts, swap_parts, rename_parts, cut_parts, remove_parts, forge_part, forge_days, forge_node)
}


def attempt(act: Callable[[World], object], world: World) -> None:
    with contextlib.suppress(StoreError):  # what is said there is not believed
        act(world)


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.sampled_from([*FORGERIES, "send", "take", "put", "keep", "put back"]), min_size=4, max_size=14))
def test_no_forgery_loses_or_adds_a_record(tmp_path_factory: pytest.TempPathFactory, steps: list[str]) -> None:
    world = make_world(tmp_path_factory.mktemp("forged") / "world", cameras=("cam-1",))
    copies, n_put = Copies(), 1
    take(world)
    put(world, 0)
    for step in steps:
        if step == "put":
            put(world, n_put)
            n_put += 1
        elif step in ("keep", "put back"):
            (copies.keep if step == "keep" else copies.put_back)(world)
        else:
            attempt({**FORGERIES, "send": send, "take": take}[step], world)
    for _ in range(3):  # left alone, the site says again what it says, and everything comes in
        take(world)
        send(world)
    frames, people = stored(world)
    assert [ms for _, ms, _ in frames] == [round((START.timestamp() + n) * 1000) for n in range(n_put)]
    assert [x for *_, x, _ in people] == [1000 + n for n in range(n_put)]
    assert outbox.ready(world.site("north").acknowledged) == []
    assert len(DayKeys(world.project("north") / "secrets").days()) == 1, "no key was destroyed"
    shutil.rmtree(world.root)


@pytest.fixture
def world(tmp_path: Path) -> World:
    made = make_world(tmp_path / "world", cameras=("cam-1",))
    take(made)
    return made


def test_a_node_gives_up_nothing_for_receipts_that_the_site_did_not_sign(world: World) -> None:
    put(world, 0)
    for _ in range(2):
        send(world)
        forge_receipts(world)
        remove_parts(world)
    assert (send(world).n_received, len(outbox.ready(world.site("north").acknowledged))) == (0, 3)
    assert take(world).fold.n_new == 2, "a forged receipt does not keep the site from writing its own"
    assert send(world).n_received == 3


def test_an_old_receipt_does_not_destroy_the_same_bytes_made_ready_later(world: World) -> None:
    put(world, 0)
    send(world)
    take(world)
    copies = Copies()
    copies.keep(world)
    saved = {p: p.read_bytes() for p in outbox.ready(world.site("north").acknowledged)}
    assert send(world).n_received == len(saved) == 3
    for path, data in saved.items():
        path.write_bytes(data)
    copies.put_back(world)
    assert send(world).n_received == 0
    assert len(outbox.ready(world.site("north").acknowledged)) == 3


def test_a_forged_list_of_days_destroys_no_key_and_says_what_to_do(world: World) -> None:
    put(world, 0)
    forge_days(world)
    with pytest.raises(StoreError, match="cannot be used") as caught:
        send(world)
    assert caught.value.code == "E319"
    assert "vsd node receive" in str(caught.value.why)
    assert len(DayKeys(world.project("north") / "secrets").days()) == 1
    take(world)
    assert send(world).n_written == 3


def test_a_site_of_1_1_is_not_obeyed_and_the_message_says_what_to_do(world: World) -> None:
    put(world, 0)
    path = world.root / "place" / "site.json"
    notice = json.loads(path.read_bytes())
    del notice["signature"]
    path.write_text(json.dumps(notice))
    forge_receipts(world)
    with pytest.raises(StoreError) as caught:
        send(world)
    assert "1.1" in str(caught.value.why)
    assert len(outbox.ready(world.site("north").acknowledged)) == 3


def test_parts_of_a_node_of_1_1_wait_and_come_in_when_it_is_upgraded(world: World) -> None:
    put(world, 0)
    for path in outbox.ready(world.site("north").acknowledged):
        target = world.root / "place" / "nodes" / "north" / path.parent.name / path.name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(path.read_bytes())
    assert set(take(world).held.values()) == {
        "it has no signature, as those of version 1.1: upgrade the node; it hands the records on again by itself"
    }
    send(world)
    assert take(world).fold.n_new == 2
    send(world)
    assert parts(world) == []


def test_what_nodes_say_counts_only_with_their_signature(world: World) -> None:
    put(world, 0)
    send(world)
    assert [n.node for n in take(world).nodes] == ["north"]
    forge_node(world)
    assert take(world).nodes == []


def part(table: TableName, rows: list[dict[str, object]], **options: object) -> bytes:
    """Return a part of a node, with whatever values."""
    schema = pa.schema([f.with_nullable(True) for f in SCHEMAS[table]])
    columns = {f.name: [row.get(f.name, "metric" if f.name == "quality" else None) for row in rows] for f in schema}
    columns["ts"] = [t if isinstance(t, datetime | int) else None for t in columns["ts"]]
    arrays = [
        pa.array(columns[f.name], pa.int64()).cast(f.type)
        if f.name == "ts" and any(isinstance(t, int) for t in columns["ts"])
        else pa.array(columns[f.name], f.type, from_pandas=False)
        for f in schema
    ]
    sink = pa.BufferOutputStream()
    pq.write_table(pa.table(arrays, schema=schema), sink, **options)
    return bytes(sink.getvalue())


def hand(world: World, table: TableName, data: bytes) -> str:
    """Put a part there that the node did sign: a node may be broken, or in other hands."""
    file = HandedFile("north", table, durable.digest(data), f"{1:016x}", ".parquet")
    name = signer(world).name(file, data)
    exchange(world).add(name, data)
    return name


BAD_ROWS = {
    "out-of-range": ("observations", {"x_mm": 2**31 - 1}),
    "not-a-number": ("observations", {"u_px": float("nan"), "v_px": 1.0}),
    "time-out-of-range": ("observations", {"ts": datetime(1980, 1, 1, tzinfo=UTC)}),
    "negative-number": ("observations", {"person": -5}),
    "unknown-quality": ("observations", {"quality": "perfect"}),
    "long-track-id": ("observations", {"track_id": "7" * 300}),
    "no-position": ("observations", {"x_mm": None}),
    "negative-number ": ("frames", {"n_persons": -5}),
    "too-many": ("frames", {"n_persons": 2**31 - 1}),
    "time-out-of-range ": ("frames", {"ts": NOW + timedelta(days=900)}),
    "time-out-of-range  ": ("frames", {"ts": 2**62}),
}


@pytest.mark.parametrize("reason", BAD_ROWS)
def test_a_bad_row_of_a_node_is_quarantined_and_good_ones_are_stored(
    world: World, reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    table, wrong = BAD_ROWS[reason]
    good = GOOD | {"n_persons": 1}
    if isinstance(wrong.get("ts"), int):
        good["ts"] = round(START.timestamp() * 1000)
    other = {"track_id": "1" * 16, "ts": START + timedelta(seconds=1)} if "ts" not in wrong else {}
    hand(world, table, part(table, [good, good | other | wrong]))
    done = take(world)
    assert (done.n_quarantined, done.fold.n_new, done.held) == ({reason.strip(): 1}, 1, {})
    folder = world.project("site") / quarantine.FOLDER
    [entry] = [e for p in quarantine.files(folder) for _, e in quarantine.entries(p)]
    assert entry is not None
    assert (entry.reason, entry.line, entry.source.split("/")[:2]) == (reason.strip(), 2, ["north", table])
    assert run(cli, ["-C", str(world.project("site")), "--now", NOW.isoformat(), "build"]) == 0
    assert "E900" not in capsys.readouterr().err


def bomb(n_rows: int) -> bytes:
    """Return a small part that unpacks to a gigabyte and more."""
    schema = SCHEMAS["observations"]
    columns = {f.name: pa.repeat(pa.scalar(None, f.type), n_rows) for f in schema}
    columns |= {
        "camera_id": pa.repeat("cam-1", n_rows),
        "ts": pa.repeat(pa.scalar(START, schema.field("ts").type), n_rows),
        "person": pa.array(np.zeros(n_rows, np.int32)),
        "track_id": pa.repeat("7" * 2000, n_rows),
        "quality": pa.repeat("metric", n_rows),
    }
    sink = pa.BufferOutputStream()
    made = pa.table(columns, schema=schema)
    pq.write_table(made, sink, compression="zstd", use_dictionary=False)
    return bytes(sink.getvalue())


def test_a_part_that_claims_too_much_is_named_and_waits(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    good = [GOOD | {"ts": START + timedelta(seconds=n)} for n in range(9)]
    data = part("observations", good, row_group_size=2)
    name = hand(world, "observations", data)
    for limit, word in (("PART_ROWS_MAX", "9 rows"), ("ROW_GROUPS_MAX", "5 groups")):
        with monkeypatch.context() as patch:
            patch.setattr(parts_of_nodes, limit, 1)
            held = take(world).held
        assert list(held) == [name]
        assert word in held[name]
    assert stored(world) == ([], [])
    assert take(world).fold.n_new == 9


@pytest.mark.parametrize("data", [b"", b"PAR1", b"PAR1" + bytes(100) + b"PAR1", part("frames", [GOOD])])
def test_a_part_that_is_none_is_named_and_waits(world: World, data: bytes) -> None:
    name = hand(world, "observations", data)
    assert list(take(world).held) == [name]
    assert run(cli, ["-C", str(world.project("site")), "--now", NOW.isoformat(), "node", "receive"]) == 1


MEASURED = """
import resource, sys
from datetime import datetime
from pathlib import Path
sys.path[:0] = sys.argv[3].split(":")
from exchange_world import NOW, World
from vsd_analytics.cluster.exchange import exchange_of
from vsd_analytics.cluster.receiving import receive
world = World(Path(sys.argv[1]), sys.argv[2])
site = world.site()
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
done = receive(site, exchange_of(site.exchange), now=NOW)
after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(len(done.held), done.fold.n_new, (after - before) // 1024)
"""


def test_a_bomb_is_refused_in_bounded_memory(world: World) -> None:
    """800,000 texts of 2,000 characters: 1.6 GB."""
    data = bomb(800_000)
    assert len(data) < 4 << 20
    hand(world, "observations", data)
    words = [sys.executable, "-c", MEASURED, str(world.root), world.place, ":".join(sys.path)]
    output = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    n_held, n_new, grown_mb = map(int, output.split())
    assert (n_held, n_new) == (1, 0)
    assert grown_mb < 300

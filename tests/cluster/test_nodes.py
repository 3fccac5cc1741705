"""Several nodes hand on to one site: each record once, nothing let go of without a receipt, one pseudonym a person."""

from __future__ import annotations

import json
import os
import random
from collections.abc import Callable
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from exchange_world import (
    NODES,
    NOW,
    START,
    Breaking,
    World,
    expected,
    litter,
    make_world,
    message,
    stored,
    take_in,
    traffic,
)

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.cluster.bucket import Bucket
from vsd_analytics.cluster.exchange import BucketExchange, Exchange, exchange_of
from vsd_analytics.cluster.handing_on import HandedOn, hand_on
from vsd_analytics.cluster.joining import invitation, join
from vsd_analytics.cluster.receiving import Received, receive
from vsd_analytics.doctor.nodes import examine_exchange
from vsd_analytics.errors import DiskError, StoreError
from vsd_analytics.live import folding
from vsd_analytics.retention.purge import Terms, forget_keys, purge_older, purge_range
from vsd_analytics.retention.purge_import import purge_import
from vsd_analytics.store import durable, outbox, quarantine
from vsd_analytics.store.imports import imports_of
from vsd_analytics.store.owners import OWNER
from vsd_analytics.store.secrets import DayKeys
from vsd_analytics.store.store import Store


@pytest.fixture
def world(tmp_path: Path) -> World:
    return make_world(tmp_path / "world")


def exchange(world: World) -> Exchange:
    route = world.site().exchange
    assert route is not None
    return exchange_of(route)


def send(world: World, node: str = "north", *, through: Exchange | None = None) -> HandedOn:
    return hand_on(world.site(node), through or exchange(world), now=NOW)


def take(world: World, *, through: Exchange | None = None) -> Received:
    return receive(world.site(), through or exchange(world), now=NOW)


def put(world: World, node: str = "north", *, at: datetime = START, camera: str = "cam-1", track: str = "7") -> int:
    """Let a node acknowledge one frame with one person; return the number of records."""
    return take_in(world.root, world.place, node, message(camera, at, [(track, 1000, 2000)]))


def prepared(world: World) -> None:
    """Let the site speak at the place, as it does before any node hands on."""
    take(world)


def quarantined(world: World) -> list[str]:
    folder = world.project("site") / quarantine.FOLDER
    return sorted(e.reason for p in quarantine.files(folder) for _, e in quarantine.entries(p) if e is not None)


def at_place(world: World) -> list[Path]:
    return sorted(p for p in (world.root / "place" / "nodes").glob("*/*/*") if not p.name.startswith("."))


def test_the_union_of_what_nodes_took_in_is_stored_once(world: World) -> None:
    sent = traffic(random.Random(3), n_frames=15, n_batches=2)
    prepared(world)
    for number in range(2):
        for node in NODES:
            take_in(world.root, world.place, node, "\n".join(sent.batches[node][number]))
            send(world, node)
        take(world)
    for node in NODES:
        send(world, node)
    assert stored(world) == expected(world, sent)
    assert sum(map(len, expected(world, sent))) > 80
    assert litter(world) == []


@pytest.mark.parametrize("side", ["node", "site"])
def test_a_link_that_breaks_before_any_call_loses_and_doubles_nothing(tmp_path: Path, side: str) -> None:
    for turn in range(1, 40, 4) if side == "site" else range(2, 40, 2):
        world = make_world(tmp_path / str(turn), cameras=("cam-1",))
        prepared(world)
        put(world, "north")
        put(world, "south")
        send(world, "south")
        broken = Breaking(exchange(world), turn, is_killing=False)
        if side == "node":
            has_broken = breaks(lambda link=broken, of=world: send(of, "north", through=link))
        else:
            send(world, "north")
            has_broken = breaks(lambda link=broken, of=world: take(of, through=link))
        for _ in range(2):
            send(world, "north")
            send(world, "south")
            take(world)
        send(world, "north")
        send(world, "south")
        assert [len(rows) for rows in stored(world)] == [1, 1]
        assert litter(world) == []
        if not has_broken:
            break
    assert turn > 5


def breaks(act: Callable[[], object]) -> bool:
    try:
        act()
    except StoreError as error:
        return error.code == "E319"
    return False


def test_a_node_lets_go_only_of_what_the_site_has_a_receipt_for(world: World) -> None:
    prepared(world)
    put(world)
    root = world.site("north").acknowledged
    first = send(world)
    assert (first.n_written, first.n_received, first.n_waiting) == (3, 0, 3)
    assert send(world).n_written == 0, "what lies at the place already is not sent again"
    assert len(outbox.ready(root)) == 3
    assert take(world).fold.n_new == 2
    after = send(world)
    assert (after.n_written, after.n_received, after.n_waiting) == (0, 3, 0)
    assert outbox.ready(root) == []


def test_a_node_without_a_link_acknowledges_on_and_hands_on_later(world: World) -> None:
    prepared(world)
    (world.root / "place").rename(world.root / "away")
    for second in range(3):
        assert put(world, at=START + timedelta(seconds=second)) == 2
        with pytest.raises(StoreError, match="cannot be used") as caught:
            send(world)
        assert caught.value.code == "E319"
    assert not (world.root / "place").exists(), "a disk that is not mounted must not be written beside"
    (world.root / "away").rename(world.root / "place")
    send(world)
    assert take(world).fold.n_new == 6


def test_many_segments_become_few_files_and_what_was_sent_is_not_packed_again(world: World) -> None:
    prepared(world)
    site = world.site("north")
    for second in range(5):
        put(world, at=START + timedelta(seconds=second))
    assert len(outbox.ready(site.acknowledged)) == 15
    store = Store(site.acknowledged, site_id=site.site_id)
    rows = [_rows(p) for p in outbox.ready(site.acknowledged) if p.parent.name == "frames"]
    for table in rows:
        store.append("frames", table, engines=["engine 1"])
    assert store.fold().n_to_hand_on == 5
    frames = [p for p in outbox.ready(site.acknowledged) if p.parent.name == "frames"]
    assert len(frames) == 6
    packed = max((_rows(p) for p in frames), key=lambda t: t.num_rows)
    assert packed.num_rows == 5
    assert set(packed[OWNER].to_pylist()) == {owner for table in rows for owner in table[OWNER].to_pylist()}
    assert b"engine 1" in packed.schema.metadata[b"vsd.engines"]


def _rows(path: Path):  # type: ignore[no-untyped-def]

    return pq.ParquetFile(path).read()


def test_a_site_that_cannot_store_writes_no_receipt(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    prepared(world)
    put(world)
    send(world)
    publish = durable.publish

    def full(path: Path, data: bytes, **options: bool) -> None:
        if "live" in path.parts:
            raise DiskError("the disk is full", code="E304")
        publish(path, data, **options)

    with monkeypatch.context() as patch:
        patch.setattr(durable, "publish", full)
        with pytest.raises(DiskError):
            take(world)
    assert list((world.root / "place").glob("receipts/*/*")) == []
    assert send(world).n_received == 0
    assert take(world).fold.n_new == 2


def test_a_node_whose_disk_is_full_lets_go_of_what_the_site_has(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    prepared(world)
    put(world)
    send(world)
    take(world)

    def full(_root: Path) -> int:
        raise DiskError("the disk is full", code="E304")

    with monkeypatch.context() as patch:
        patch.setattr(outbox, "make_ready", full)
        with pytest.raises(DiskError):
            send(world)
    assert outbox.ready(world.site("north").acknowledged) == []


def test_on_a_full_disk_what_came_is_made_ready_as_it_is(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    put(world)
    root = world.site("north").acknowledged
    frames = _rows(next(p for p in outbox.ready(root) if p.parent.name == "frames"))
    store = Store(root, site_id="shop")
    store.append("frames", frames, engines=["engine 1"])
    store.append("frames", frames, engines=["engine 2"])

    def full(*_: object, **__: object) -> None:
        raise DiskError("the disk is full", code="E304")

    with monkeypatch.context() as patch:
        patch.setattr(durable, "publish", full)
        assert store.fold().n_to_hand_on == 2
    prepared(world)
    send(world)
    assert take(world).fold.n_new == 2


def test_the_process_that_folds_beside_a_listener_makes_ready_on_a_node(
    world: World, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "nice", lambda n: n)  # it would hold for all later tests of this process
    put(world)
    root = world.site("north").acknowledged
    ready = outbox.ready(root)
    frames = _rows(next(p for p in ready if p.parent.name == "frames"))
    Store(root, site_id="shop").append("frames", frames, engines=["engine 1"])
    assert folding.main([str(root), "shop", "0"]) == 0
    assert json.loads(capsys.readouterr().out)["n_new"] == 0
    assert len(outbox.ready(root)) == len(ready) + 1
    assert outbox.n_waiting(root) == len(ready) + 1
    assert not (root / "frames").exists(), "a node has no parts"


def test_a_file_damaged_on_its_way_is_sent_again(world: World) -> None:
    prepared(world)
    put(world)
    send(world)
    for path in at_place(world):
        path.write_bytes(path.read_bytes()[:-7] + b"another")
    assert len(take(world).damaged) == 3
    assert stored(world) == ([], [])
    send(world)
    assert take(world).fold.n_new == 2


def test_a_copy_that_comes_after_the_receipt_is_not_stored_again(world: World) -> None:
    prepared(world)
    put(world)
    send(world)
    copies = {path: path.read_bytes() for path in at_place(world)}
    take(world)
    for path, data in copies.items():
        path.write_bytes(data)
    again = take(world)
    assert (again.n_again, again.n_files, again.fold.n_new) == (3, 0, 0)
    assert at_place(world) == []


def test_a_camera_the_site_does_not_know_waits_and_comes_when_it_is_described(world: World) -> None:
    prepared(world)
    toml = world.project("site") / "vsd.toml"
    text = toml.read_text()
    toml.write_text(text.replace('[[camera]]\nid = "cam-2"\nname = "Exit"\n', ""))
    put(world, camera="cam-2")
    send(world)
    held = take(world).held
    assert len(held) == 2
    assert all("cam-2" in why for why in held.values())
    assert send(world).n_waiting == 2, "the list of imports has its receipt"
    toml.write_text(text)
    assert take(world).fold.n_new == 2


def test_an_old_file_of_a_node_does_not_bring_back_what_the_site_erased(world: World) -> None:
    """It holds a record of the erased second, and one just after it, which is stored."""
    prepared(world)
    put(world)
    put(world, at=START + timedelta(seconds=1), track="8")
    send(world)
    first_ms = round(START.timestamp() * 1000)
    terms = Terms(now=NOW, reason="request 7")
    purge_range(world.site(), camera_id="cam-1", first_ms=first_ms, after_ms=first_ms + 1000, terms=terms)
    taken = take(world)
    assert taken.n_erased == 2, "a frame and a person"
    assert not taken.n_quarantined
    assert [[ts_ms for _, ts_ms, *_ in rows] for rows in stored(world)] == [[first_ms + 1000], [first_ms + 1000]]
    assert quarantined(world) == []


def test_late_records_of_a_sealed_hour_meet_the_rule_of_the_site(world: World) -> None:
    prepared(world)
    put(world)
    send(world)
    take(world)
    put(world, "south", track="8")
    send(world, "south")
    purge_older(world.site(), before=date(2026, 11, 10), terms=Terms(now=NOW, is_forced=True))
    done = take(world)
    assert (done.fold.n_new, done.n_quarantined) == (0, {"sealed-hour": 2})
    assert set(quarantined(world)) == {"sealed-hour"}
    assert send(world, "south").n_received == 3, "what is in quarantine is durable, so the node may let go of it"


def test_keys_are_forgotten_everywhere_and_records_of_the_day_are_refused_everywhere(world: World) -> None:
    prepared(world)
    put(world)
    put(world, "south", track="8")
    send(world)
    take(world)
    day = date(2026, 11, 9)
    later = datetime(2026, 11, 11, 12, tzinfo=UTC)
    assert DayKeys(world.project("site") / "secrets").days() == [day], "the site knows the days it received"
    found = forget_keys(world.site(), before=date(2026, 11, 11), terms=Terms(now=NOW))
    assert list(found.keys) == [day]
    take(world)
    send(world, "south")
    assert DayKeys(world.project("south") / "secrets").days() == []
    for who in ("site", "south"):
        with pytest.raises(StoreError) as caught:
            DayKeys(world.project(who) / "secrets").key(day)
        assert caught.value.code == "E303"
    done = take(world)
    assert done.n_quarantined == {"forgotten-day": 2}
    assert done.fold.n_new == 0
    put(world, "south", at=later, track="9")
    put(world, "west", at=later, track="9")
    for node in ("south", "west"):
        send(world, node)
    take(world)
    assert [len(rows) for rows in stored(world)] == [2, 2], "later days are named alike, also after forgetting"


def test_records_beyond_the_clock_of_the_site_go_to_quarantine(world: World) -> None:
    prepared(world)
    put(world)
    send(world)
    done = receive(world.site(), exchange(world), now=START - timedelta(days=9))
    assert done.n_quarantined == {"time-out-of-range": 2}
    assert stored(world) == ([], [])


def test_a_node_that_has_not_joined_takes_nothing_in(world: World) -> None:
    (world.project("north") / "secrets" / "chain.json").unlink()
    with pytest.raises(StoreError, match="has not joined") as caught:
        put(world)
    assert caught.value.code == "E320"


def test_a_node_with_another_secret_hands_nothing_on(tmp_path: Path, world: World) -> None:
    prepared(world)
    other = make_world(tmp_path / "other")
    route = world.site("north").exchange
    put(other)
    with pytest.raises(StoreError, match="another secret") as caught:
        hand_on(other.site("north"), exchange(world), now=NOW)
    assert route is not None
    assert caught.value.code == "E320"


@pytest.mark.parametrize(
    ("old", "new"), [('id = "shop"', 'id = "mall"'), ("Europe/Rome", "Europe/Lisbon"), ("[[floor]]", "day_starts = 3")]
)
def test_a_site_described_in_another_way_is_not_joined(world: World, old: str, new: str) -> None:
    toml = world.project("north") / "vsd.toml"
    text = toml.read_text()
    toml.write_text(text.replace(old, new if old != "[[floor]]" else 'day_starts = "03:00"\n[[floor]]', 1))
    with pytest.raises(StoreError) as caught:
        join(world.site("north"), invitation(world.site()), file="join.json")
    assert caught.value.code == "E320"


@pytest.mark.parametrize("data", [b"", b"{}", b"[1]", b"\xff", b'{"version":1,"site":"shop"}'])
def test_a_file_that_is_no_invitation_is_refused(world: World, data: bytes) -> None:
    with pytest.raises(StoreError) as caught:
        join(world.site("north"), data, file="join.json")
    assert caught.value.code == "E320"


def test_the_place_of_another_site_is_refused_by_both_sides(tmp_path: Path, world: World) -> None:
    prepared(world)
    put(world)
    (world.root / "place" / "site.json").write_text('{"site":"mall"}')
    for act in (lambda: send(world), lambda: take(world)):
        with pytest.raises(StoreError, match="cannot be used") as caught:
            act()
        assert caught.value.code == "E319"


def test_names_at_the_place_cannot_lead_out_of_the_store(world: World) -> None:
    prepared(world)
    put(world)
    send(world)
    good = at_place(world)[0]
    odd = world.root / "place" / "nodes" / "..evil" / good.parent.name
    odd.mkdir(parents=True)
    (odd / good.name).write_bytes(good.read_bytes())
    (good.parent / "not-a-hash.parquet").write_bytes(b"x")
    assert take(world).n_files == 3
    assert (odd / good.name).exists()


def test_commands_of_both_sides_and_what_they_say(world: World, capsys: pytest.CaptureFixture[str]) -> None:
    def vsd(who: str, *words: str) -> str:
        code = run(cli, ["-C", str(world.project(who)), "--now", NOW.isoformat(), *words])
        out, err = capsys.readouterr()
        assert code == 0, err
        return out + err

    (world.root / "f.jsonl").write_text(message("cam-1", START, [("7", 1000, 2000)]))
    vsd("site", "node", "receive")
    assert "2 records to hand on" in vsd("north", "ingest", str(world.root / "f.jsonl"))
    assert "3 files handed on, 0 received by the site, 3 waiting" in vsd("north", "node", "send")
    assert "2 new records stored" in vsd("site", "node", "receive")
    assert json.loads(vsd("north", "node", "send", "--json"))["received"] == 3
    assert "node north: " in vsd("site", "imports")
    vsd("site", "node", "receive")
    findings = {f.subject: f.state for f in examine_exchange(world.site(), now=NOW)}
    assert findings == {"receiving": "ok", "node north": "ok"}
    late = {f.subject: f.state for f in examine_exchange(world.site(), now=NOW + timedelta(hours=2))}
    assert late == {"receiving": "needs you", "node north": "needs you"}
    assert [f.state for f in examine_exchange(world.site("north"), now=NOW)] == ["ok"]
    assert [f.subject for f in examine_exchange(world.site("west"), now=NOW)] == ["handing on"]
    assert run(cli, ["-C", str(world.project("north")), "node", "receive"]) == 2
    assert run(cli, ["-C", str(world.project("site")), "node", "send"]) == 2
    assert run(cli, ["-C", str(world.project("north")), "node", "invite", "--out", str(world.root / "j.json")]) == 2


def test_an_import_of_a_node_can_be_taken_back_at_the_site(world: World) -> None:
    prepared(world)
    put(world)
    put(world, "south", track="8", at=START + timedelta(seconds=1))
    for node in ("north", "south"):
        send(world, node)
    take(world)
    listed = imports_of(world.project("site") / "store")
    assert {line.node for line in listed.values()} == {"north", "south"}
    [of_north] = [i for i, line in listed.items() if line.node == "north"]
    purge_import(world.site(), of_north, terms=Terms(now=NOW, is_forced=True))
    assert [len(rows) for rows in stored(world)] == [1, 1]


class MemoryBucket:
    """A server of S3 in memory, with conditional writes."""

    def __init__(self) -> None:
        self.objects: dict[str, bytes] = {}

    def put_object(self, *, Bucket: str, Key: str, Body: bytes, IfNoneMatch: str | None = None) -> None:
        if IfNoneMatch and Key in self.objects:
            raise RefusedError("PreconditionFailed")
        self.objects[Key] = bytes(Body)

    def get_object(self, *, Bucket: str, Key: str) -> dict[str, object]:
        import io

        if Key not in self.objects:
            raise RefusedError("NoSuchKey")
        return {"Body": io.BytesIO(self.objects[Key])}

    def list_objects_v2(self, *, Bucket: str, Prefix: str) -> dict[str, object]:
        return {"Contents": [{"Key": key} for key in self.objects if key.startswith(Prefix)], "IsTruncated": False}

    def delete_object(self, *, Bucket: str, Key: str) -> None:
        self.objects.pop(Key, None)


class RefusedError(Exception):
    def __init__(self, code: str) -> None:
        super().__init__(code)
        self.response = {"Error": {"Code": code}}


def test_a_bucket_carries_the_same_and_is_empty_afterwards(tmp_path: Path) -> None:
    world = make_world(tmp_path / "world", place="s3://exchange/shop")
    server = MemoryBucket()
    client: Bucket = server
    through = BucketExchange("s3://exchange/shop", client)
    sent = traffic(random.Random(5), n_frames=20, n_batches=1)
    take(world, through=through)
    for node in NODES:
        take_in(world.root, world.place, node, "\n".join(sent.batches[node][0]))
        send(world, node, through=through)
    take(world, through=through)
    for node in NODES:
        send(world, node, through=through)
    assert stored(world) == expected(world, sent)
    notices = [f"shop/nodes/{node}/node.json" for node in NODES]
    assert sorted(server.objects) == [*notices, "shop/site.json"]

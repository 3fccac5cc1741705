"""A site, three nodes and the place between them, with messages whose stored rows are known without the program."""

from __future__ import annotations

import json
import os
import random
import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from site_text import site_text

from vsd_analytics.cluster.exchange import Exchange, exchange_of, unusable
from vsd_analytics.cluster.handing_on import hand_on
from vsd_analytics.cluster.joining import invitation, join
from vsd_analytics.cluster.receiving import receive
from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.site.model import Site
from vsd_analytics.store import outbox
from vsd_analytics.store.secrets import DayKeys, namer

NODES = ("north", "south", "west")
CAMERAS = ("cam-1", "cam-2", "cam-3")
START = datetime(2026, 11, 9, 9, 59, 30, tzinfo=UTC)
NOW = datetime(2026, 11, 12, tzinfo=UTC)
Row = tuple[Any, ...]


@dataclass
class World:
    """Projects below one folder.

    Attributes:
        root: The folder.
        place: What `[exchange]` names.
    """

    root: Path
    place: str

    def project(self, who: str) -> Path:
        return self.root / who

    def site(self, who: str = "site") -> Site:
        return load_site(self.project(who), environ={})


def make_world(root: Path, *, place: str | None = None, cameras: Sequence[str] = CAMERAS) -> World:
    """Make a site and nodes that have joined it."""
    (root / "place").mkdir(parents=True)
    world = World(root, place or str(root / "place"))
    for who in ("site", *NODES):
        name = "" if who == "site" else f'node = "{who}"\n'
        world.project(who).mkdir()
        more = f'[exchange]\nplace = "{world.place}"\n{name}'
        (world.project(who) / "vsd.toml").write_text(site_text(*cameras, more=more))
    data = invitation(world.site())
    for who in NODES:
        join(world.site(who), data, file="join.json")
    return world


def message(camera: str, at: datetime, people: Sequence[tuple[str, int, int]]) -> str:
    persons = [{"id": track, "x_m": x / 1000, "y_m": y / 1000} for track, x, y in people]
    return json.dumps({"v": 1, "camera": camera, "ts": at.isoformat().replace("+00:00", "Z"), "persons": persons})


@dataclass
class Traffic:
    """What engines sent.

    Attributes:
        batches: By node, lists of messages in the order in which they come.
        frames: Every (camera, ts in ms, number of people) once.
        people: Every (camera, ts in ms, track of the engine, x in mm, y in mm) once.
    """

    batches: dict[str, list[list[str]]] = field(default_factory=dict)
    frames: set[Row] = field(default_factory=set)
    people: set[Row] = field(default_factory=set)


def traffic(rng: random.Random, *, n_frames: int, n_batches: int) -> Traffic:
    """Return messages of all cameras over two hours' ends, each at one to three nodes, some twice at the same one."""
    found = Traffic({node: [[] for _ in range(n_batches)] for node in NODES})
    for number in range(n_frames):
        at = START + timedelta(seconds=number)
        for camera in CAMERAS:
            people = [(str(i), rng.randint(0, 9000), rng.randint(0, 9000)) for i in range(rng.randint(0, 3))]
            text, ms = message(camera, at, people), round(at.timestamp() * 1000)
            found.frames.add((camera, ms, len(people)))
            found.people |= {(camera, ms, *person) for person in people}
            for node in rng.sample(NODES, rng.choice((1, 1, 2, 3))):
                for _ in range(rng.choice((1, 1, 1, 2))):
                    found.batches[node][rng.randrange(n_batches)].append(text)
    return found


def expected(world: World, sent: Traffic) -> tuple[list[Row], list[Row]]:
    """Return the rows of frames and observations that the site must have, from the messages alone."""
    keys = DayKeys(world.project("site") / "secrets")
    people = {(c, ms, namer(keys.key(_day(ms)), camera_id=c)(t), x, y) for c, ms, t, x, y in sent.people}
    return sorted(sent.frames), sorted(people)


def stored(world: World) -> tuple[list[Row], list[Row]]:
    """Return the rows of frames and observations that the site has, every one as often as a plain reader finds it."""
    columns = {
        "frames": ("camera_id", "ts", "n_persons"),
        "observations": ("camera_id", "ts", "track_id", "x_mm", "y_mm"),
    }
    found: list[list[Row]] = []
    for name, names in columns.items():
        rows: list[Row] = []
        for path in sorted((world.project("site") / "store" / name).rglob("*.parquet")):
            table = pq.ParquetFile(path).read(columns=list(names)).to_pydict()
            table["ts"] = [round(ts.timestamp() * 1000) for ts in table["ts"]]
            rows += zip(*(table[n] for n in names), strict=True)
        found.append(sorted(rows))
    return found[0], found[1]


def litter(world: World) -> list[str]:
    """Return what is still on its way: files in outboxes and at the place, and temporary files."""
    waiting = [p for node in NODES for p in outbox.ready(world.site(node).acknowledged)]
    waiting += [p for node in NODES for p in (world.project(node) / "outbox" / "live").rglob("*.parquet")]
    notices = ("site.json", "node.json")
    at_place = [p for p in (world.root / "place").rglob("*") if p.is_file() and p.name not in notices]
    return sorted(str(p.relative_to(world.root)) for p in (*waiting, *at_place, *world.root.rglob("*.tmp")))


def _day(ms: int) -> date:
    return (datetime.fromtimestamp(ms / 1000, tz=UTC) + timedelta(hours=1) - timedelta(hours=4)).date()


class Breaking:
    """An exchange whose link breaks, or whose process is killed, before its n-th call.

    Args:
        inner: The exchange.
        turn: The call; 0 = none.
        is_killing: Kill this process; else the link breaks.
    """

    def __init__(self, inner: Exchange, turn: int, *, is_killing: bool) -> None:
        self._inner, self._turn, self._is_killing, self.n_calls = inner, turn, is_killing, 0

    def _count(self) -> Exchange:
        self.n_calls += 1
        if self._turn and self.n_calls >= self._turn:
            if self._is_killing:
                os.kill(os.getpid(), signal.SIGKILL)
            raise unusable("the place", "the link is down")
        return self._inner

    def names(self, prefix: str) -> list[str]:
        return self._count().names(prefix)

    def read(self, name: str, *, most: int) -> bytes | None:
        return self._count().read(name, most=most)

    def add(self, name: str, data: bytes) -> None:
        self._count().add(name, data)

    def replace(self, name: str, data: bytes) -> None:
        self._count().replace(name, data)

    def remove(self, name: str) -> None:
        self._count().remove(name)


def take_in(root: Path, place: str, who: str, text: str, _ack: Callable[[Any], None] | None = None) -> int:
    """Ingest a file at a node; what is acknowledged when it returns is durable."""
    world = World(root, place)
    path = root / f"{who}.jsonl"
    path.write_text(text)
    done = ingest(world.site(who), [path], IngestOptions(), now=NOW)
    assert not done.n_rejected
    return sum(sum(source.n_records.values()) for source in done.sources)


def send(
    root: Path, place: str, who: str, turn: int = 0, is_killing: bool = False, _ack: Callable[[Any], None] | None = None
) -> int:
    """Do a round of a node, perhaps with a link that breaks; return the number of calls of the exchange."""
    site = World(root, place).site(who)
    assert site.exchange is not None
    exchange = Breaking(exchange_of(site.exchange), turn, is_killing=is_killing)
    hand_on(site, exchange, now=NOW)
    return exchange.n_calls


def take(
    root: Path, place: str, turn: int = 0, is_killing: bool = False, _ack: Callable[[Any], None] | None = None
) -> int:
    """Do a round of the site, likewise."""
    site = World(root, place).site()
    assert site.exchange is not None
    exchange = Breaking(exchange_of(site.exchange), turn, is_killing=is_killing)
    receive(site, exchange, now=NOW)
    return exchange.n_calls

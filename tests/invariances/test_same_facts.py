"""Duplicates, disorder, hours of delay and a change of the clocks give the facts of the clean stream, bit for bit."""

from __future__ import annotations

import json
import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import frame_streams as fs
import pytest

from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.warehouse import Warehouse

# the instant the clocks change, in the middle of the stream
CHANGES = {
    "an hour comes twice, in Rome": ("Europe/Rome", datetime(2026, 10, 25, 1, tzinfo=UTC)),
    "half an hour is skipped, on Lord Howe": ("Australia/Lord_Howe", datetime(2026, 10, 3, 15, 30, tzinfo=UTC)),
}
AUTUMN, SPRING = CHANGES
HOURS = 1.5


def start_of(change: datetime) -> datetime:
    return change - timedelta(hours=HOURS / 2)


def twin(site: Site, root: Path) -> Site:
    """Return an empty project with the same secrets, so that people get the same pseudonyms."""
    shutil.copytree(site.root / "secrets", root / "secrets")
    return fs.site(root, site.timezone)


@pytest.fixture(params=CHANGES, scope="module")
def known(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Site, datetime]:
    """Return a project with the clean stream, and when the clocks change in it."""
    zone, change = CHANGES[request.param]
    site = fs.site(tmp_path_factory.mktemp("clean"), zone)
    rejected, _ = fs.deliver(site, fs.clean(fs.frames(start_of(change), hours=HOURS)), every=None)
    assert not rejected
    return site, change


def marts(site: Site, change: datetime) -> str:
    day = change.astimezone(site.zone).date()
    with Warehouse(site, day - timedelta(days=1), day + timedelta(days=1)) as warehouse:
        return json.dumps(
            {name: warehouse.rows(f"select * from {name}") for name in relations("marts") if name != "heatmap"},
            default=str,
        )


def test_disturbed_stream_gives_the_facts_of_the_clean_one(known: tuple[Site, datetime], tmp_path: Path) -> None:
    """Built every forty minutes on the way, so that late records come into hours that were folded and built."""
    clean, change = known
    sent = fs.frames(start_of(change), hours=HOURS)
    stream = fs.disturbed(sent, zone=clean.zone, seed=7)
    assert len(stream) > 1.15 * len(sent)
    offsets = {json.loads(m.payload)["ts"][-6:] for m in stream}
    assert len(offsets) == 2, "the clocks change in the stream"

    site = twin(clean, tmp_path / "disturbed")
    rejected, builds = fs.deliver(site, stream, every=timedelta(minutes=40))
    assert not rejected
    assert sum("late data" in reason for b in builds for reason in b.reasons) >= 3
    assert len(fs.files(site, "store/observations")) > 2 * len(fs.files(clean, "store/observations"))
    assert fs.fact_rows(site) == fs.fact_rows(clean)
    assert marts(site, change) == marts(clean, change)

    stepwise = fs.files(site, "facts")
    shutil.rmtree(site.root / "facts")
    build(site)
    assert fs.files(site, "facts") == stepwise, "built on the way or at once: the same files"


@pytest.mark.parametrize("known", [SPRING], indirect=True)
def test_disorder_in_one_delivery_gives_the_very_files(known: tuple[Site, datetime], tmp_path: Path) -> None:
    clean, change = known
    site = twin(clean, tmp_path / "shuffled")
    fs.deliver(site, fs.disturbed(fs.frames(start_of(change), hours=HOURS), zone=clean.zone, seed=8), every=None)
    for folder in ("store", "facts"):
        assert fs.files(site, folder) == fs.files(clean, folder)


@pytest.mark.parametrize("known", [SPRING], indirect=True)
def test_facts_of_other_records_differ(known: tuple[Site, datetime], tmp_path: Path) -> None:
    """The comparison sees one person of one frame that is a centimetre off."""
    clean, change = known
    sent = fs.frames(start_of(change), hours=HOURS)
    index = next(i for i, frame in enumerate(sent) if len(frame["persons"]) > 2)
    sent[index]["persons"][0]["x_m"] += 0.01
    site = twin(clean, tmp_path / "other")
    fs.deliver(site, fs.clean(sent), every=None)
    assert fs.fact_rows(site) != fs.fact_rows(clean)


STEPS = {
    "hours ahead": lambda ts: ts + timedelta(hours=3),
    "a day and an hour behind": lambda ts: ts - timedelta(hours=25),
    "1970": lambda ts: datetime(1970, 1, 1, tzinfo=UTC) + (ts - datetime(2026, 1, 1, tzinfo=UTC)),
    "2099": lambda ts: ts.replace(year=2099),
    "seconds taken for milliseconds": lambda ts: datetime.fromtimestamp(ts.timestamp() / 1000, tz=UTC),
}


def test_stepped_clocks_are_quarantined_and_counted_and_change_nothing_else(tmp_path: Path) -> None:
    zone, change = CHANGES[AUTUMN]
    sent = fs.frames(start_of(change), hours=1)
    clean = fs.site(tmp_path / "clean", zone)
    fs.deliver(clean, fs.clean(sent), every=None)
    stream, n_wrong = fs.disturbed(sent, zone=ZoneInfo(zone), seed=9), 0
    for i, step in enumerate(STEPS.values()):
        for frame in sent[100 + i : 900 : 7]:
            stream.append(fs.message({**frame, "ts": step(frame["ts"])}, arrives=frame["ts"]))
            n_wrong += 1  # a message of another time is quarantined whole
    numbers = [json.dumps({**f, "ts": round(f["ts"].timestamp() * 1000)}).encode() for f in sent[:40]]
    stream += [fs.Message(sent[400]["ts"], payload) for payload in numbers]
    site = twin(clean, tmp_path / "stepped")
    rejected, _ = fs.deliver(site, sorted(stream, key=lambda m: m.arrives), every=timedelta(minutes=50))
    assert rejected == {"time-out-of-range": n_wrong, "bad-message": len(numbers)}
    assert fs.fact_rows(site) == fs.fact_rows(clean)
    dates = {p.name for p in (site.root / "store").rglob("date=*")}
    assert dates == {p.name for p in (clean.root / "store").rglob("date=*")}, "no folder of a wrong date"

"""What is killed: each job of the store, the project it starts from, and what must hold before and after a restart."""

from __future__ import annotations

import contextlib
import io
import json
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

from crash_points import Ack
from project_state import CAMERAS, PAGES, TRACKS, as_rows

CONFIG = """
[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"
[[floor]]
id = "ground"
name = "Ground floor"
[[camera]]
id = "cam-1"
name = "Entrance"
floor = "ground"
[[camera]]
id = "cam-2"
name = "Exit"
floor = "ground"
"""
DOOR = """
[[line]]
id = "door"
name = "Door"
counted_by = "counter"
left = "Shop"
right = "Street"
"""
START = datetime(2026, 11, 9, 9, 50, tzinfo=UTC)
DAYS = (date(2026, 11, 9), date(2026, 11, 10))
BAD = '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","persons":[{"x_m":"near"}]}'
NOW = "2026-11-20T00:00:00Z"
WEEK = "2026-W46"
CLOSED = "2026-11-10"


def _nothing_more(root: Path) -> None:
    pass


@dataclass(frozen=True)
class Job:
    """A job of a project.

    Attributes:
        name: As the tables name it.
        prepare: Makes the project it starts from.
        act: Does it.
        finish: Ends it when it is only a part of a run.
        is_named_alike: Two runs make files of the same names.
    """

    name: str
    prepare: Callable[[Path], None]
    act: Callable[[Path, Ack], Any]
    finish: Callable[[Path], None] = _nothing_more
    is_named_alike: bool = True


def messages(first: datetime, n_frames: int, *, with_pairs: bool = False) -> list[str]:
    """Return frame messages of both cameras, one a minute; three people walk past each other."""
    lines = []
    for i in range(n_frames):
        for k, camera in enumerate(CAMERAS):
            ts = (first + timedelta(minutes=i)).isoformat()
            i_m = (first - START) // timedelta(minutes=1) + i
            persons = [{"id": t, "x_m": 0.5 * j + 0.01 * i_m, "y_m": 1.0 + k} for j, t in enumerate(TRACKS[k : k + 3])]
            message = {"v": 1, "camera": camera, "ts": ts, "persons": persons}
            if with_pairs and camera == "cam-2":
                message["pairs"] = [{"a": TRACKS[1], "b": TRACKS[2], "distance_m": 0.5}]
            lines.append(json.dumps(message))
    return lines


def write_project(root: Path) -> None:
    root.mkdir(parents=True)
    (root / "vsd.toml").write_text(CONFIG)
    given = root.parent / "given"
    given.mkdir(exist_ok=True)
    (given / "first.jsonl").write_text("\n".join(messages(START, 20)))
    late = messages(START + timedelta(minutes=10), 12) + messages(START + timedelta(days=1), 2, with_pairs=True)
    (given / "second.jsonl").write_text("\n".join([*late, BAD]))


def vsd(root: Path, *arguments: str, ack: Ack = lambda value: None) -> str:
    """Run a command; its exit code must be 0, or 1 with a warning, else OSError with the message people see.

    Raises:
        RuntimeError: The message was not meant for people.
    """
    from vsd_analytics.cli import cli
    from vsd_analytics.cli.exit_codes import run
    from vsd_analytics.store.store import Store

    append = Store.append

    def append_and_tell(self: Store, table: Any, rows: Any, **options: Any) -> int:
        n_rows = append(self, table, rows, **options)
        ack(("rows", table, as_rows(rows)))
        return n_rows

    out, err = io.StringIO(), io.StringIO()
    Store.append = append_and_tell  # type: ignore[method-assign]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = run(cli, ["-C", str(root), "--now", NOW, *arguments])
    finally:
        Store.append = append  # type: ignore[method-assign]
    if code > 1:
        text = err.getvalue()
        raise (OSError if code == 2 and re.search(r"error\[E(?!900)", text) else RuntimeError)(text)
    return out.getvalue()


def _given(root: Path, name: str) -> Path:
    return root.parent / "given" / name


def tables(root: Path, file: Path) -> Iterator[tuple[Any, Any]]:
    """Return the rows that `vsd ingest` makes of a file."""
    from vsd_analytics.config.project import load_site
    from vsd_analytics.ingest.formats.frames import Frames
    from vsd_analytics.ingest.intake.normalise import Normaliser
    from vsd_analytics.ingest.intake.pipeline import with_site
    from vsd_analytics.ingest.reading.adapter import IngestOptions, Source

    site = load_site(root, environ={})
    normaliser = Normaliser(site, now=datetime.fromisoformat(NOW), keys=None)
    options = with_site(site, IngestOptions())
    for batch in Frames().read(Source(file), options):
        yield from ((t, rows) for t, rows in normaliser.normalise(batch).tables.items() if rows.num_rows)


def _store(root: Path) -> Any:
    from vsd_analytics.store.store import Store

    return Store(root / "store", site_id="shop")


def append(root: Path, ack: Ack, *, file: Path) -> None:
    """Append the rows of a file, as they are without pseudonyms."""
    store = _store(root)
    for table, rows in tables(root, file):
        store.append(table, rows)
        ack(("rows", table, as_rows(rows)))


def _append(root: Path, ack: Ack) -> None:
    append(root, ack, file=_given(root, "second.jsonl"))


def _fold(root: Path, ack: Ack = lambda value: None) -> None:
    _store(root).fold()


def _half_folded(root: Path) -> None:
    write_project(root)
    append(root, lambda value: None, file=_given(root, "first.jsonl"))
    _fold(root)
    _append(root, lambda value: None)


def _with_stale_facts(root: Path) -> None:
    write_project(root)
    vsd(root, "ingest", str(_given(root, "first.jsonl")))
    vsd(root, "build")
    vsd(root, "ingest", str(_given(root, "second.jsonl")))


def _with_weeks(root: Path) -> None:
    """Make facts of a week that is over, so that their files are joined, and of the week after the next."""
    write_project(root)
    old = [line for k in (14, 13, 11) for line in messages(START - timedelta(days=k), 3)]
    _given(root, "old.jsonl").write_text("\n".join(old))
    for name in ("old.jsonl", "first.jsonl"):
        vsd(root, "ingest", str(_given(root, name)))
    vsd(root, "build")


def _with_stale_week(root: Path) -> None:
    _with_weeks(root)
    late = messages(START - timedelta(days=13) + timedelta(hours=2), 3)
    _given(root, "late.jsonl").write_text("\n".join(late))
    vsd(root, "ingest", str(_given(root, "late.jsonl")))


def _with_first(root: Path) -> None:
    write_project(root)
    vsd(root, "ingest", str(_given(root, "first.jsonl")))


def make_keys(root: Path, ack: Ack) -> None:
    from vsd_analytics.store.secrets import DayKeys

    for day in DAYS:
        ack(("key", f"{day.isoformat()}.key", DayKeys(root / "secrets").key(day).hex()))


def fill_quarantine(root: Path, ack: Ack) -> None:
    from vsd_analytics.ingest.intake.quarantine_writer import Quarantine
    from vsd_analytics.ingest.reading.adapter import Rejected

    for source in ("a.jsonl", "b.jsonl"):
        quarantine = Quarantine(root / "quarantine", source=source)
        quarantine.add([Rejected("bad-json", line, "", f"text {line}") for line in range(3)])
        quarantine.flush()
        ack(("lines", source, [f"text {line}" for line in range(3)]))


def _build(root: Path, ack: Ack) -> str:
    return vsd(root, "build", ack=ack)


def _build_after(root: Path) -> None:
    """Compute again what a refusing disk did not leave of a week that a purge touched."""
    vsd(root, "build")


def _with_facts(root: Path) -> None:
    _with_stale_facts(root)
    vsd(root, "build")


def _with_few_days(root: Path) -> None:
    """Make fresh facts, and the week files of two relations."""
    _with_facts(root)
    vsd(root, "report", "--exact", "--week", WEEK)
    for name in PAGES:
        shutil.rmtree(root / name, ignore_errors=True)
    for folder in (root / "facts" / "weeks").iterdir():
        if folder.name not in ("footsteps", "exposure"):
            shutil.rmtree(folder)


def _with_superseded_days(root: Path, *commands: str) -> None:
    """Make pages and their week files, then close a day, which changes these, and remove those of a relation."""
    _with_facts(root)
    for command in commands:
        vsd(root, command, "--exact", "--week", WEEK)  # exact: what readers were given may not change with the day
    for name in PAGES:
        shutil.rmtree(root / name, ignore_errors=True)
    for name in ("footsteps", "exposure", "planner_cells"):
        shutil.rmtree(root / "facts" / "weeks" / name, ignore_errors=True)
    text = CONFIG.replace("[[floor]]", f'closed = ["{CLOSED}"]\n[[floor]]', 1)
    (root / "vsd.toml").write_text(text)


def _before_report(root: Path) -> None:
    _with_superseded_days(root, "report")


def _before_planner(root: Path) -> None:
    _with_superseded_days(root, "report", "planner")


def _report(root: Path, ack: Ack) -> str:
    return vsd(root, "report", "--exact", "--week", WEEK, "--format", "html,json", ack=ack)


def _planner(root: Path, ack: Ack) -> str:
    return vsd(root, "planner", "--exact", "--week", WEEK, ack=ack)


def add_to_log(root: Path, ack: Ack, *, text: str = "moved the exhibit") -> None:
    vsd(root, "log", "add", text, "--at", "2026-11-09T12:00")
    ack(("entry", "log", text))


def _with_log(root: Path) -> None:
    write_project(root)
    add_to_log(root, lambda value: None, text="opened")


def add_counts(root: Path, ack: Ack, *, name: str = "second.csv") -> None:
    """Add quarter-hours of a door counter; the second file goes on, and says another number of one of the first."""
    rows = {"first.csv": ["09:00,5,1", "09:15,3,0"], "second.csv": ["09:15,4,0", "09:30,7,2", "09:45,1,1"]}[name]
    _given(root, name).parent.mkdir(exist_ok=True)
    _given(root, name).write_text("\n".join(["time,in,out", *(f"2026-11-09T{row}" for row in rows)]))
    columns = ("--left", "in", "--right", "out", "--every", "15min", "--replace")
    vsd(root, "counts", "add", str(_given(root, name)), "--line", "door", *columns)
    ack(("counts", "door.parquet", (root / "counts" / "door.parquet").read_bytes()))


def remove_counts(root: Path, ack: Ack) -> None:
    vsd(root, "counts", "remove", "door")
    ack(("counts", "door.parquet", None))


def _with_counter(root: Path) -> None:
    write_project(root)
    (root / "vsd.toml").write_text(CONFIG + DOOR)


def _with_counts(root: Path) -> None:
    _with_counter(root)
    add_counts(root, lambda value: None, name="first.csv")


def _purge_by_age(root: Path, ack: Ack) -> str:
    return vsd(root, "purge", "--older-than", "2026-11-10", "--force", ack=ack)


def _purge_by_camera(root: Path, ack: Ack) -> str:
    return vsd(root, "purge", "--camera", "cam-1", "--range", "2026-11-09T11:05..2026-11-10", ack=ack)


def _purge_on_request(root: Path, ack: Ack) -> str:
    days = "2026-11-09T11:05..2026-11-10"
    return vsd(root, "purge", "--camera", "cam-1", "--range", days, "--reason", "request 7", ack=ack)


def _purge_in_week(root: Path, ack: Ack) -> str:
    return vsd(root, "purge", "--camera", "cam-1", "--range", "2026-10-27", "--force", ack=ack)


def _with_seals(root: Path) -> None:
    _with_few_days(root)
    _purge_by_age(root, lambda value: None)


def _purge_of_sealed(root: Path, ack: Ack) -> str:
    return vsd(root, "purge", "--camera", "cam-1", "--range", "2026-11-09", "--force", ack=ack)


def _forget_keys(root: Path, ack: Ack) -> str:
    return vsd(root, "purge", "--older-than", "2026-11-10", "--forget-keys", "--force", ack=ack)


def _ingest(root: Path, ack: Ack) -> str:
    return vsd(root, "ingest", str(_given(root, "second.jsonl")), ack=ack)


JOBS = {
    job.name: job
    for job in (
        Job("append", write_project, _append, finish=_fold),
        Job("fold", _half_folded, _fold),
        Job("build", _with_stale_facts, _build),
        Job("build of weeks", _with_stale_week, _build),
        Job("day keys", write_project, make_keys),
        Job("quarantine", write_project, fill_quarantine),
        Job("log add", _with_log, add_to_log),
        Job("first log add", write_project, add_to_log),
        Job("counts add", _with_counts, add_counts),
        Job("first counts add", _with_counter, add_counts),
        Job("counts remove", _with_counts, remove_counts),
        Job("report", _before_report, _report),
        Job("planner", _before_planner, _planner),
        Job("purge by age", _with_few_days, _purge_by_age),
        Job("purge by camera", _with_few_days, _purge_by_camera),
        Job("purge on request", _with_few_days, _purge_on_request),
        Job("purge in a week", _with_weeks, _purge_in_week, finish=_build_after),
        Job("purge of sealed", _with_seals, _purge_of_sealed),
        Job("forget keys", _with_seals, _forget_keys),
        Job("vsd ingest", _with_first, _ingest, is_named_alike=False),  # a new day's key is random
    )
}

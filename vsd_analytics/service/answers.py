"""What the service answers, without HTTP: the bytes that `vsd report` and `vsd planner` write."""

from __future__ import annotations

import hashlib
import json
import math
import os
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any, Final

from vsd_analytics.config.asked_questions import read_asked, remember
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import DiskError, ReportError, StoreError, UsageError, VsdError
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.json_and_csv import figures_json, to_csv, to_json
from vsd_analytics.report.pages.questions import choose, may_ask
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.service.live_pages import LivePages
from vsd_analytics.site.instants import parse_week
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.stored_days import stored_extent

TABLES: Final = ("hours", "areas", "hotspots")
ANSWERS_MAX: Final = 64
"""ReportAnswers in memory; the one that was not asked for longest goes first."""
LOOK_AGAIN_S: Final = 2.0
"""Time after which the project's files are looked at again."""
_INPUTS: Final = ("vsd.toml", "log.jsonl", "questions.jsonl", "purge.jsonl")
_FOLDERS: Final = ("store", "sealed", "calibration", "plans", "pictures")


class NotFoundError(VsdError):
    """There is no such week, floor, figure or table."""

    default_code = "E101"


class ReportAnswers:
    """The answers of one project, made when first asked for and again when the project's files changed.

    One answer is made at a time: a report uses all processors, and two at once would need the memory of both.

    Args:
        root: Folder of the project.
        now: Instant that reports print, and the present; None = they print the last record's.
        clock: Seconds that pass steadily.
        present: Tells the present where `now` is None: hours that are not over are not missing.
    """

    def __init__(
        self,
        root: Path,
        *,
        now: datetime | None = None,
        clock: Callable[[], float] = time.monotonic,
        present: Callable[[], datetime] = lambda: datetime.now(tz=UTC),
    ) -> None:
        self._root, self._now, self._clock = root, now, clock
        self._present = present if now is None else lambda: now
        self._lock = threading.Lock()
        self._site = load_site(root)
        self._state = self._state_now()
        self._looked_at = clock()
        self._made: OrderedDict[tuple[str, ...], Any] = OrderedDict()
        self._mistake: VsdError | None = None
        self._live = LivePages()

    def site(self) -> bytes:
        """Return the site as JSON: id, name, time zone, floors, cameras, areas, stored weeks."""
        with self._lock:
            site = self._fresh()
            weeks = _weeks(site)
        answer = {
            "site_id": site.site_id,
            "name": site.name,
            "time_zone": site.timezone,
            "distance_m": site.settings.distance_m,
            "mask_below": int(site.settings.mask_below),
            "floors": [{"floor_id": f.floor_id, "name": f.name} for f in site.floors],
            "cameras": [{"camera_id": c.camera_id, "name": c.name, "floor_id": c.floor_id} for c in site.cameras],
            "areas": [{"area_id": a.area_id, "name": a.name, "floor_id": a.floor_id} for a in site.areas],
            "weeks": weeks,
        }
        return _json(answer)

    def report(self, week: str, floor_id: str) -> bytes:
        """Return the JSON file of a week: what `vsd report --format json` writes.

        Raises:
            NotFoundError: There is no such week or floor.
        """
        return self._one("json", week, floor_id, to_json)

    def figures(self, week: str, floor_id: str) -> bytes:
        """Return all figures of a week by catalogue id."""
        return self._one("figures", week, floor_id, lambda report: _json({"figures": figures_json(report)}))

    def figure(self, week: str, floor_id: str, metric: str) -> bytes:
        """Return one figure of a week.

        Raises:
            NotFoundError: There is no such week, floor or figure.
        """
        figures = json.loads(self.figures(week, floor_id))["figures"]
        if metric not in figures:
            known = sorted(figures, key=lambda m: int(m[1:]))
            raise NotFoundError(f"there is no figure {metric!r}", why=f"this week has {', '.join(known)}")
        return _json(figures[metric])

    def table(self, week: str, floor_id: str, name: str) -> bytes:
        """Return a CSV table of a week: what `vsd report --format csv` writes.

        Raises:
            NotFoundError: There is no such week, floor or table.
        """
        if name not in TABLES:
            raise NotFoundError(f"there is no table {name!r}", why=f"the tables are {', '.join(TABLES)}")
        return self._one(f"csv {name}", week, floor_id, lambda report: to_csv(report)[f"{name}.csv"].encode())

    def page(self, week: str, floor_id: str) -> bytes:
        """Return the page of a week: what `vsd report` writes."""
        return self._one("html", week, floor_id, lambda report: render_html(report).encode())

    def desk_page(self, week: str, floor_id: str) -> bytes:
        """Return the page of a week as the desk shows it.

        The desk takes answers to the last question of a floor. The page of the last stored week asks it, and so it is
        noted; older pages have no buttons, and to look at them asks nothing.
        """

        def make(report: WeekReport) -> bytes:
            asked = choose(report) if may_ask(report) else None
            if asked is not None and report.week.monday == _monday(self._site, "last"):
                with suppress(DiskError):  # where nothing can be written, the page can still be read
                    remember(self._site, [asked])
            last = {one.floor_id: one for one in read_asked(self._site)}.get(floor_id)
            is_open = asked is not None and last is not None and asked.question_id == last.question_id
            return render_html(report, is_at_desk=True, is_open=is_open).encode()

        return self._one("html of the desk", week, floor_id, make)

    def site_now(self) -> Site:
        """Return the site as its files say now."""
        self.look_again()
        with self._lock:
            return self._fresh()

    def look_again(self) -> None:
        """Let no later answer be from before what was written just now."""
        with self._lock:
            self._looked_at = -math.inf

    def desk_planner(self, week: str, floor_id: str) -> bytes:
        """Return the planner of a week as the desk shows it, with links to the other pages there."""
        return self.planner(week, floor_id, is_at_desk=True)

    def planner(self, week: str, floor_id: str, *, is_at_desk: bool = False) -> bytes:
        """Return the planner of a week: what `vsd planner` writes."""
        from vsd_analytics.planner.page import render_planner
        from vsd_analytics.planner.planner_data import planner_pages

        def make(site: Site, monday: date) -> bytes:
            with _as_not_found():
                [data] = planner_pages(site, monday, floor_id=floor_id, clock=self._present())
            return render_planner(data, is_at_desk=is_at_desk).encode()

        return self._cached(f"planner {is_at_desk}", week, floor_id, make)

    def now(self) -> bytes:
        """Return the live page of the first floor."""
        return self.floor_now(self.site_now().floors[0].floor_id)

    def floor_now(self, floor_id: str, *, folder: str = "/now") -> bytes:
        """Return the live page of a floor, the same for a minute.

        Raises:
            NotFoundError: There is no such floor.
        """
        with self._lock:
            site = self._fresh()
            _check_floor(site, floor_id)
            at = self._present().astimezone(site.zone)
            key = ("now", folder, floor_id, f"{at:%Y-%m-%d %H:%M %z}")
            page: bytes = self._remembered(key, lambda: self._live.page(site, floor_id, at, folder=folder))
            return page

    def _one(self, kind: str, week: str, floor_id: str, make: Callable[[WeekReport], bytes]) -> bytes:
        def made(site: Site, monday: date) -> bytes:
            report = self._remembered(("report", f"{monday}", floor_id), lambda: self._report(site, monday, floor_id))
            return make(report)

        return self._cached(kind, week, floor_id, made)

    def _report(self, site: Site, monday: date, floor_id: str) -> WeekReport:
        with _as_not_found():
            return week_report(site, monday, floor_id=floor_id, now=self._now, clock=self._present())

    def _cached(self, kind: str, week: str, floor_id: str, make: Callable[[Site, date], bytes]) -> bytes:
        with self._lock:
            site = self._fresh()
            monday = _monday(site, week)
            _check_floor(site, floor_id)
            data: bytes = self._remembered((kind, f"{monday}", floor_id), lambda: make(site, monday))
            return data

    def _remembered(self, key: tuple[str, ...], make: Callable[[], Any]) -> Any:
        if key not in self._made:
            self._made[key] = make()
            while len(self._made) > ANSWERS_MAX:
                self._made.popitem(last=False)
        self._made.move_to_end(key)
        return self._made[key]

    def _state_now(self) -> tuple[str, int]:
        """Return the state of the project's files, and the hour: with each hour that ends, a running week changes."""
        return _state_of(self._root), int(self._present().timestamp()) // 3600

    def _fresh(self) -> Site:
        """Return the site; forget all answers when a file of the project changed, or an hour ended, since then.

        Raises:
            VsdError: The project cannot be read, at each request until a file of it is changed again: an answer from
                before would look as if the change was in force.
        """
        if self._clock() - self._looked_at >= LOOK_AGAIN_S:
            self._looked_at = self._clock()
            state = self._state_now()
            if state != self._state:
                self._state, self._mistake = state, None
                self._made.clear()
                try:
                    self._site = load_site(self._root)
                except VsdError as error:
                    self._mistake = error
        if self._mistake is not None:
            raise self._mistake
        return self._site


def _state_of(root: Path) -> str:
    """Return a hash of the times and sizes of what a report is made from.

    Of folders that only gain and lose whole files, the time of the folder is enough.
    """
    known = hashlib.blake2b(digest_size=16)
    paths = [root / name for name in _INPUTS]
    for name in _FOLDERS:
        folders = [Path(path) for path, _, _ in os.walk(root / name)]
        paths += folders
        if name in ("calibration", "plans", "pictures"):
            paths += [p for folder in folders for p in folder.iterdir()]
    for path in sorted(paths):
        try:
            stat = path.stat()
        except OSError:
            continue
        known.update(f"{path}\0{stat.st_mtime_ns}\0{stat.st_size}\n".encode())
    return known.hexdigest()


@contextmanager
def _as_not_found() -> Iterator[None]:
    """Answer that there is none of what may not leave: of a week that is not over, or not again."""
    try:
        yield
    except (ReportError, UsageError) as error:
        raise NotFoundError(error.what, why=error.why, code=error.code) from None


def _check_floor(site: Site, floor_id: str) -> None:
    floors = [f.floor_id for f in site.floors]
    if floor_id not in floors:
        raise NotFoundError(f"there is no floor {floor_id!r}", why=f"this site has {', '.join(floors)}")


def _weeks(site: Site) -> list[str]:
    extent = stored_extent(site)
    if extent is None:
        return []
    monday = extent.first_day - timedelta(days=extent.first_day.weekday())
    n_weeks = (extent.last_day - monday).days // 7 + 1
    return [f"{monday + timedelta(weeks=k):%G-W%V}" for k in range(n_weeks)]


def _monday(site: Site, week: str) -> date:
    """Return the Monday of a stored week.

    Raises:
        NotFoundError: It is no week, or nothing is stored of it.
    """
    extent = stored_extent(site)
    if extent is None:
        raise StoreError("nothing is stored yet", code="E301", fix="vsd ingest FILES...")
    last = extent.last_day - timedelta(days=extent.last_day.weekday())
    try:
        monday = parse_week(week, last=last)
    except UsageError as error:
        raise NotFoundError(error.what, why=error.why, fix="2026-W46, last or last-2") from None
    if not extent.first_day - timedelta(days=6) <= monday <= extent.last_day:
        stored = f"{extent.first_day} to {extent.last_day}"
        raise NotFoundError(f"nothing is stored of {monday:%G-W%V}", why=f"stored is {stored}")
    return monday


def _json(value: Any) -> bytes:
    return (json.dumps(value, sort_keys=True, ensure_ascii=False, allow_nan=False, indent=1) + "\n").encode()

"""The live pages of a site: what is usual is computed once an hour, what is there now once a minute."""

from __future__ import annotations

from datetime import datetime

from vsd_analytics.figures.now import READ_BEFORE, UsualDay, day_of, first_day, now, relations, usual_day
from vsd_analytics.service.now_page import render_now
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.provenance import are_made_up, engines
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import open_warehouse
from vsd_analytics.wording.languages import speaking


class LivePages:
    """Makes the live pages, and remembers what earlier days say for an hour: it costs a hundred times the rest."""

    def __init__(self) -> None:
        self._usual: dict[str, tuple[tuple[object, ...], UsualDay]] = {}

    def page(self, site: Site, floor_id: str, at: datetime, *, folder: str) -> bytes:
        """Return the page of a floor.

        Args:
            site: The site as its files say now.
            floor_id: Floor.
            at: The clock, in the site's zone.
            folder: Address below which the pages of floors are.
        """
        floor_now, is_made_up = None, False
        if stored_extent(site) is not None:
            usual = self._usual_day(site, floor_id, at)
            with open_warehouse(site, usual.day, at.date(), relations=relations(site)) as warehouse:
                floor_now = now(warehouse, usual, at)
            is_made_up = are_made_up(engines(site, usual.day, at.date()))
        with speaking(site.language):
            page = render_now(floor_now, site, floor_id=floor_id, at=at, folder=folder, is_made_up=is_made_up)
        return page.encode()

    def _usual_day(self, site: Site, floor_id: str, at: datetime) -> UsualDay:
        day = day_of(site, at)
        written = (site.root / "vsd.toml").stat().st_mtime_ns
        key = (day, at.hour, written)
        if floor_id not in self._usual or self._usual[floor_id][0] != key:
            with open_warehouse(site, first_day(day), day, relations=READ_BEFORE) as warehouse:
                self._usual[floor_id] = key, usual_day(warehouse, day, floor_id=floor_id)
        return self._usual[floor_id][1]

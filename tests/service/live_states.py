"""The live page in each of its states, from numbers of the tests' own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final
from zoneinfo import ZoneInfo

from vsd_analytics.answer import Reason
from vsd_analytics.figures.now import Fullest, Now, QueueNow, SilentNow
from vsd_analytics.figures.share.now import Band
from vsd_analytics.site.model import Area, Camera, Floor, Site

AT: Final = datetime(2026, 11, 14, 17, 20, tzinfo=ZoneInfo("Europe/Rome"))
HOSTILE: Final = '<script>document.title = "taken"</script>' + "x" * 60
BUSY: Final = Now(
    at=AT,
    floor_id="ground",
    is_open=True,
    opens=None,
    start=AT - timedelta(minutes=20),
    was_open=True,
    people=Band("above", None, 12.0, 30.0, 5),
    reason=None,
    queues=(
        QueueNow("till", "Tills", Band("above", None, None, 6.0, 5)),
        QueueNow("bread", HOSTILE, Band("few", None, None, None, 5)),
    ),
    fullest=Fullest(18, 7, 10),
    silent=(SilentNow("cam-1", AT - timedelta(minutes=65)), SilentNow("cam-2", None)),
    n_cameras=3,
    data_until=AT - timedelta(minutes=5),
)
QUIET: Final = replace(BUSY, queues=(), fullest=None, silent=())
CLOSED: Final = replace(QUIET, is_open=False, was_open=False, people=None, opens=AT + timedelta(hours=38, minutes=40))
FEW_WEEKS: Final = Reason("forecast.weeks", least=4, has=2)
STATES: Final[Mapping[str, Now | None]] = {
    "Nothing is stored yet": None,
    "Closed": CLOSED,
    "Open since 17:15": replace(QUIET, was_open=False, people=None),
    "No data today": replace(QUIET, people=None, data_until=None, silent=BUSY.silent),
    "No data since 17:15": replace(QUIET, people=None, silent=BUSY.silent, n_cameras=2),
    "Not known": replace(QUIET, people=None, reason=Reason("engine.no_positions")),
    "Fewer than 5 people": replace(QUIET, people=Band("few", None, None, 12.0, 5)),
    "Quieter than usual": replace(QUIET, people=Band("below", None, 12.0, 30.0, 5)),
    "As busy as usual": replace(QUIET, people=Band("within", None, 12.0, 30.0, 5)),
    "Busier than usual": BUSY,
    "About 20 people": replace(
        QUIET, people=Band(None, 20, None, None, 5), reason=Reason("forecast.weeks", least=4, has=2)
    ),
}
"""By the first words of each page."""


def site_of_two_floors(root: Path, **more: object) -> Site:
    """Return a site whose names try to be HTML."""
    floors = (Floor("ground", "Ground"), Floor("upper", HOSTILE))
    cameras = tuple(Camera(f"cam-{k}", f"Camera {k}", "ground") for k in (1, 2, 3))
    areas = (Area("till", "Tills", "ground", ((0, 0), (4, 0), (4, 4), (0, 4)), is_queue=True),)
    made = Site("shop", "Shop <b>", "Europe/Rome", root, floors=floors, cameras=cameras, areas=areas)
    return replace(made, **more)  # type: ignore[arg-type]

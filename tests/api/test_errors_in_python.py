"""What Python raises is fixed in Python: no option of a command, and the name that was meant."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from site_text import site_text

import vsd_analytics as vsd
from vsd_analytics.api.settings_asked import ASKED, site_with
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import UsageError, VsdError
from vsd_analytics.settings import SETTINGS
from vsd_analytics.site.model import Site

FRAME = pd.DataFrame({"ts": ["2026-11-16T10:00:00Z"] * 3, "x_m": [1.0, 2.0, 3.0], "y_m": [1.0, 2.0, 3.0]})
AREA = '[[area]]\nid = "queue"\nname = "Queue"\nfloor = "ground"\npolygon = [[0, 0], [1, 0], [1, 1]]\n'
WRONG: dict[str, tuple[Callable[[Any], Any], str]] = {
    "a folder": (lambda site: vsd.open("/"), 'vsd.open("FOLDER")'),
    "a week": (lambda site: site.week("2026-46"), 'week("last")'),
    "a range": (lambda site: site.days("yesterday"), '"2026-W46"'),
    "days in common": (lambda site: site.compare("2026-11-09", "2026-11-09"), "site.compare("),
    "a floor": (lambda site: site.compare("2026-11-09", "2026-11-10", floor_id="grund"), 'floor_id="ground"'),
    "a floor of a forecast": (lambda site: site.forecast(floor_id="grund"), 'floor_id="ground"'),
    "an area": (lambda site: site.compare("2026-11-09", "2026-11-10", area_ids=["queu"]), '"queue"'),
    "an area of a plan": (lambda site: site.plan("queu", effect=-0.1), '"queue"'),
    "an entry": (lambda site: site.change(7), "site.changes"),
    "weeks of a change": (lambda site: site.change(1, weeks=0), "weeks=4"),
    "weeks of a plan": (lambda site: site.plan("queue", effect=-0.1, weeks_max=-1), "weeks_max=4"),
    "half a week": (lambda site: site.plan("queue", effect=-0.1, weeks_max=1.5), "weeks_max=4"),
    "a map": (lambda site: site.week().heatmap("riks"), 'heatmap("risk")'),
    "a cell": (lambda site: site.week().heatmap(cell_m=0.3), "cell_m=0.5"),
    "a camera": (lambda site: site.week().tracks("cam2"), 'tracks("cam-2")'),
    "a column": (lambda site: site.week().hours["n_violation"], '"n_violations"'),
    "a table": (lambda site: site.week().sql("select * from hour"), "'hours'"),
    "a table that is computed": (lambda site: site.week().sql("select * from queue_hour"), "'queue_hours'"),
    "a table of a caller": (lambda site: site.week().sql("select * from til", tills=FRAME), "'tills'"),
    "a column of a query": (lambda site: site.week().sql("select n_violation from hours"), "week.hours.columns"),
    "no select": (lambda site: site.week().sql("drop table hours"), "week.sql("),
    "figures": (lambda site: site.week().context_figures("change"), 'context_figures("context_change")'),
    "a setting": (lambda site: site.week().at(distanc_m=1), "distance_m="),
    "a frame without times": (lambda site: site.ingest(FRAME.drop(columns="ts")), "frame.rename("),
    "a frame of no camera": (lambda site: site.ingest(FRAME), 'camera="'),
    "a frame of an unknown camera": (lambda site: site.ingest(FRAME, camera="cam2"), 'camera="cam-2"'),
    "a zone": (lambda site: site.ingest(FRAME, camera="cam-1", clock="Europe/Rom"), 'clock="Europe/Rome"'),
}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> vsd.OpenProject:
    root = tmp_path_factory.mktemp("shop")
    (root / "vsd.toml").write_text(site_text("cam-1", "cam-2", more=AREA), encoding="utf-8")
    rows = "".join(f"2026-11-09T10:00:{s:02d}Z,cam-1,{t},{t},1\n" for s in range(30) for t in (1, 2))
    (root / "a.csv").write_text(f"ts,camera_id,track_id,x_m,y_m\n{rows}", encoding="utf-8")
    assert run(cli, ["-C", str(root), "ingest", str(root / "a.csv"), "--yes"]) == 0
    return vsd.open(root)


@pytest.mark.parametrize("what", WRONG)
def test_the_fix_is_python(site: vsd.OpenProject, what: str) -> None:
    ask, meant = WRONG[what]
    with pytest.raises(VsdError) as caught:
        ask(site)
    said = str(caught.value)
    assert meant in said
    assert not re.search(r"(^|[\s(])(--[a-z]|vsd [a-z]+ )", said), "options and commands are of a terminal"


def test_a_number_of_weeks_may_be_one_of_numpy(site: vsd.OpenProject) -> None:
    assert site.plan("queue", effect=-0.1, weeks_max=np.int64(4)) == site.plan("queue", effect=-0.1, weeks_max=4)


def test_a_project_without_records_says_both_ways(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_text(site_text("cam-1"), encoding="utf-8")
    empty = vsd.open(tmp_path)
    for ask in (empty.week, lambda: empty.days("2026-11-09").hours):
        with pytest.raises(VsdError, match=r"site.ingest\(frame\), or vsd ingest FILES... in a terminal"):
            ask()


def test_days_outside_of_what_is_stored_say_so_and_what_is_there(site: vsd.OpenProject) -> None:
    said = "nothing is stored of these days; stored are 2026-11-09 to 2026-11-09"
    for days in (site.days("2020-01-01"), site.week("2030-W01")):
        assert said in repr(days)
        assert days.hours.note == said
        assert said in repr(days.hours)
    assert "nothing" not in repr(site.days("2026-11-08..2026-11-09")) + repr(site.week().hours)


def test_one_area_may_be_named_by_itself(site: vsd.OpenProject) -> None:
    of_list = site.compare("2026-11-09", "2026-11-10", area_ids=["queue"])
    assert site.compare("2026-11-09", "2026-11-10", area_ids="queue").columns == of_list.columns


# settings -------------------------------------------------------------------------------------------------------------

VALUES = st.one_of(
    st.floats(), st.integers(-(10**6), 10**6), st.booleans(), st.text(max_size=8), st.none(), st.binary(max_size=2),
    st.lists(st.floats(), max_size=3), st.lists(st.text(max_size=3), max_size=3).map(tuple),
    st.sampled_from([np.float64(1.5), np.int64(3), np.float32(2), np.array([1.0]), np.bool_(True), "all", "staff"]),
)  # fmt: skip


@given(st.sampled_from([s.name for s in SETTINGS]), VALUES)
def test_each_setting_is_in_force_or_refused_with_words_whatever_its_value(name: str, value: Any) -> None:
    shop = _shop()
    days = vsd.OpenProject(shop).days("2026-11-09")
    asked = None
    with suppress(UsageError):
        asked = days.at(**{name: value})
    if asked is None:
        with pytest.raises(UsageError, match=name):
            days.at(**{name: value})
        return
    held = getattr(asked.site.settings, name)
    assert held == value
    assert type(held) is type(getattr(shop.settings, name)), "1 and 1.0 are one setting, with one id"
    assert name in repr(asked)
    assert len(asked.site.settings.settings_id()) == 8


@pytest.mark.parametrize("name", ASKED)
def test_each_default_may_be_given(name: str) -> None:
    shop = _shop()
    default = getattr(shop.settings, name)
    assert site_with(shop, {name: default}).settings == shop.settings


def test_a_list_is_refused_by_name_and_not_as_a_number() -> None:
    days = vsd.OpenProject(_shop()).days("2026-11-09")
    for name, value in (("staff_classes", ("staff",)), ("heat_steps", [1, 2, 3, 4, 5])):
        with pytest.raises(UsageError, match=f"{name} is set in vsd.toml alone"):
            days.at(**{name: value})
    for value in (math.nan, math.inf):
        with pytest.raises(UsageError, match="is not between"):
            days.at(distance_m=value)


_SHOP: list[Site] = []


def _shop() -> Site:
    if not _SHOP:
        from tempfile import TemporaryDirectory

        with TemporaryDirectory() as folder:
            (Path(folder) / "vsd.toml").write_text(site_text("cam-1"), encoding="utf-8")
            _SHOP.append(load_site(folder))
    return _SHOP[0]

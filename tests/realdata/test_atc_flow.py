"""Entries, dwell and flow between five areas of a real shopping centre, beside a computation from the raw files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import date
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.stats
import shapely
from prove_atc import NOW, OPTIONS, TOML

from vsd_analytics.answer import value_of
from vsd_analytics.config.project import load_site
from vsd_analytics.figures.flow import flow
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.visits import visits
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.site.model import Area
from vsd_analytics.warehouse.warehouse import Warehouse

pytestmark = pytest.mark.realdata
DAY = date(2012, 10, 24)
BOXES = {
    "west": (-38.0, -6.0, -28.0, 3.0),
    "hall": (-22.0, -3.0, -8.0, 11.0),
    "neck": (1.0, -7.0, 10.0, 5.0),
    "corridor": (13.0, -17.0, 22.0, -7.0),
    "east": (31.0, -24.0, 41.0, -14.0),
}
GAP_S = 5.0


@dataclass(frozen=True)
class RawVisit:
    """A stay found in the raw file, and whether the person was seen outside before and after; `is_end`: never again."""

    area: str
    first_s: float
    last_s: float
    dwell_s: float
    is_entered: bool
    is_left: bool
    is_end: bool


def raw_visits(records: pd.DataFrame) -> list[RawVisit]:
    """Return the stays of one person, in the order of entering; who is back within 5 s never left."""
    t, place = records["t"].to_numpy(), records["area"].to_numpy()
    found = []
    for area in set(place) - {""}:
        inside = np.flatnonzero(place == area)
        for part in np.split(inside, np.flatnonzero(np.diff(t[inside]) > GAP_S) + 1):
            a, b = int(part[0]), int(part[-1])
            came = a > 0 and t[a] - t[a - 1] <= GAP_S
            went = b < len(t) - 1 and t[b + 1] - t[b] <= GAP_S
            start = (t[a] + t[a - 1]) / 2 if came else t[a]
            end = (t[b] + t[b + 1]) / 2 if went else t[b]
            found.append(RawVisit(area, t[a], t[b], end - start, came, went, b == len(t) - 1))
    return sorted(found, key=lambda v: v.first_s)


def raw_flow(people: Sequence[pd.DataFrame]) -> tuple[list[RawVisit], Counter[tuple[str, str]], Counter[str]]:
    """Return all visits, the moves from area to area, and those who leave each area."""
    every, moves, left = [], Counter[tuple[str, str]](), Counter[str]()
    for records in people:
        stays = raw_visits(records)
        every += stays
        way = [v for i, v in enumerate(stays) if v.last_s > max((w.last_s for w in stays[:i]), default=-np.inf)]
        left.update(v.area for v in way if not v.is_end)
        moves.update((v.area, w.area) for v, w in pairwise(way))
    return every, moves, left


def km_median(stays: Sequence[RawVisit]) -> float:
    """Return the median of the Kaplan-Meier curve of stays."""
    data = scipy.stats.CensoredData(
        uncensored=[v.dwell_s for v in stays if v.is_left], right=[v.dwell_s for v in stays if not v.is_left]
    )
    curve = scipy.stats.ecdf(data).sf
    return float(curve.quantiles[curve.probabilities <= 0.5][0])


@pytest.mark.parametrize("hour", [9, 10, 11])
def test_visits_dwell_and_flow_of_a_shopping_centre_are_those_of_its_raw_files(
    realdata: Callable[[str], Path], tmp_path: Path, hour: int
) -> None:
    """The first hour is that the figures were written with; the others were held back until all was done."""
    paths = [realdata(f"atc/atc-1024-{hour}_{part}.csv.gz") for part in ("train", "test")]
    names = ["t", "id", "x", "y", "speed", "angle"]
    raw = pd.concat([pd.read_csv(path, header=None, names=names) for path in paths])
    raw = raw.sort_values("t")
    raw["t"] = raw["t"].round()  # as the adapter does: stamps of one second vary by milliseconds
    raw["area"] = ""
    for name, box in BOXES.items():
        is_inside = shapely.contains_xy(shapely.box(*box), raw["x"], raw["y"])
        raw.loc[is_inside, "area"] = name
    every, moves, left = raw_flow([of for _, of in raw.groupby("id")])

    (tmp_path / "vsd.toml").write_text(TOML.format(plan=realdata("atc/atc-occu.png")), encoding="utf-8")
    site = load_site(tmp_path)
    areas = [
        Area(n, n, "floor", ((x0, y0), (x1, y0), (x1, y1), (x0, y1)), has_visits=True)
        for n, (x0, y0, x1, y1) in BOXES.items()
    ]
    site = replace(site, areas=tuple(areas), settings=site.settings.with_values({"mask_below": 1}))
    assert not any(s.error for s in ingest(site, paths, OPTIONS, now=NOW).sources)
    with Warehouse(site, DAY, DAY) as warehouse:
        period = Period(FloorHours(warehouse, floor=site.floors[0]), DAY, DAY)
        stays, found = visits(period), flow(period)
    assert found is not None
    for of, moved in zip(stays.rows, found.areas, strict=True):
        name = moved.area.area_id
        median = value_of(of, "dwell_median_s").value
        own = [v for v in every if v.area == name and v.is_entered]
        assert value_of(of, "n_visits").value == len(own) > 80
        assert median == pytest.approx(km_median(own), abs=1.0)
        # a last record outside may share the whole second of the one inside
        assert moved.following.n == pytest.approx(left[name], rel=0.03)
        assert {to.areas[0].area_id: to.share.n for to in moved.to} == {
            b: n for (a, b), n in moves.items() if a == name
        }
        gone_on = sum(n for (a, _), n in moves.items() if a == name), sum(to.share.n for to in moved.to)
        medians = f"{km_median(own):.1f} | {median:.1f}"
        print(  # the table in docs/methods/visits-and-flow.md
            f"| {hour} | {name} | {len(own)} | {value_of(of, 'n_visits').value} | {medians} | {left[name]} "
            f"| {moved.following.n} | {gone_on[0]} | {gone_on[1]} |"
        )
    # where people come and go where no area is, the flows do not add up to the arrivals: most came from the east end
    east = found.areas[-1].inflow
    assert east.value is not None
    print(f"came into east, over what the flows bring: {east.value:.1f}")
    assert east.value > 1.5

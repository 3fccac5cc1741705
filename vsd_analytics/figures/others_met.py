"""Others met by a person in a day (M31), and people with 15 minutes too close to one of them (M34).

A person is a track id: one camera's, of one site day. Where ids are cut, a person starts again with each, so both
figures are given only of cameras whose ids last (as for M9), and are lower bounds.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from datetime import date

import numpy as np

from vsd_analytics.figures.episodes import SEED
from vsd_analytics.stats.groups import ShareEstimate, share_by_days
from vsd_analytics.stats.others_met import CountQuantiles, count_quantiles
from vsd_analytics.warehouse.warehouse import Warehouse


@dataclass(frozen=True, slots=True)
class OthersMet:
    """Whom the people of a range met.

    Attributes:
        met: Different others closer than the legal distance, by person and day: median and 90 % quantile (M31).
        long_share: Share of people with `contact_s` or more too close to one other within a day (M34), with n and of.
    """

    met: CountQuantiles
    long_share: ShareEstimate


def others_met(warehouse: Warehouse, cameras: Collection[str], *, first: date, last: date) -> OthersMet:
    """Return how many others people met in a range, and the share of them with 15 minutes too close to one.

    Args:
        warehouse: Its days.
        cameras: Ids of the cameras whose track ids last (`groups.camera_lives`).
        first: First site day.
        last: Last site day.
    """
    settings = warehouse.site.settings
    rows = warehouse.table(
        "select site_day, n_met, longest_s::double as longest_s from met_days "
        "where camera_id in (select unnest($cameras::varchar[])) and site_day between $first and $last "
        "order by site_day, camera_id, track_id",
        {"cameras": sorted(cameras), "first": first, "last": last},
    )
    day = rows["site_day"].to_numpy().astype("datetime64[D]").astype(np.int64)
    is_long = rows["longest_s"].to_numpy() >= settings.contact_s
    _, code = np.unique(day, return_inverse=True)
    return OthersMet(
        met=count_quantiles(rows["n_met"].to_numpy(), day, seed=SEED, **settings.for_intervals),
        long_share=share_by_days(np.bincount(code, weights=is_long), np.bincount(code), **settings.for_intervals),
    )

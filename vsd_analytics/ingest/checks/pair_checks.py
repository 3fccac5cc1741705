"""Checks of distances that an engine measured itself (W220)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from vsd_analytics.ingest.checks.check_case import ROWS_MIN, Case, SourceCheck, SourceWarning, has_pair_columns
from vsd_analytics.ingest.checks.place_checks import unit_fix
from vsd_analytics.ingest.checks.sample import is_known

PAIR_MAX_M: Final = 50.0
"""No engine measures mostly pairs further apart than this."""
DIFFERS_M, DIFFERS_SHARE = 0.5, 0.5
"""A distance differs from that of the positions beside it by more than both: a length, and a share of it."""
VALUES_MIN: Final = 3
"""Fewer different distances are no measurements."""


def _distances(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    apart = sample.distance_m[~np.isnan(sample.distance_m)]
    if len(apart) < ROWS_MIN:
        return
    median, is_mapped = float(np.median(apart)), "distance_m" in case.columns.plan.theirs
    stored_m = case.site.settings.pair_max_m
    beyond = float((apart > stored_m).mean())
    if median > PAIR_MAX_M:
        what = f"half of the pairs are more than {median:,.0f} m apart"
        yield SourceWarning(
            what, "distances in millimetres or centimetres look like this", unit_fix(case), is_sure=True
        )
    elif is_mapped and len(apart) >= 5 * ROWS_MIN and len(values := np.unique(apart)) < VALUES_MIN:
        shown = " and ".join(f"{value:g}" for value in values)
        yield SourceWarning(
            f"all {len(apart):,} distances are {shown} m",
            "a mark that two people are close, or a limit, is no distance between them",
            "map the column that holds the measured distance (--map); contacts of worn sensors have none",
            is_sure=bool((apart == 0).any()),  # a mark; one value above 0 may be the limit of a contact
        )
    elif len(apart) >= 5 * ROWS_MIN and float(apart.max()) == 1 and float(apart.min()) >= 0:
        yield SourceWarning(
            "all distances are 0 to 1, and the largest is exactly 1",
            "shares of a largest distance, and risks, look like this; everybody would be within a metre",
            "map the column that holds metres (--map)",
            is_note=True,
        )
    elif beyond > 0.5:
        yield SourceWarning(
            f"{beyond:.0%} of the pairs are more than {stored_m:g} m apart (half of all within {median:,.1f} m), "
            "and are not stored",
            "so it should be where the engine writes all pairs; distances in feet look like this too",
            "--unit ft (or in, cm) if they are; up to where pairs are stored: pair_max_m under [rule]",
            is_note=True,
        )
    both = np.column_stack([sample.distance_m, sample.places_m])
    both = both[is_known(both)]
    if not is_mapped or len(both) < ROWS_MIN:
        return
    differ = np.abs(both[:, 0] - both[:, 1])
    is_other = (differ > DIFFERS_M) & (differ > DIFFERS_SHARE * both.min(axis=1))
    if is_other.mean() > 0.2:
        yield SourceWarning(
            f"{is_other.mean():.0%} of the distances are not those of the positions beside them "
            f"(half within {np.median(both[:, 0]):,.2f} m, and half within {np.median(both[:, 1]):,.2f} m)",
            "the distances or the positions are in another unit, or of other people",
            "give each column a name with its unit, such as distance_cm; a unit that you state holds for all of them",
            is_sure=True,
        )


PAIR_CHECKS: Final = (
    SourceCheck("W220", has_pair_columns, _distances, "distances of pairs that are no metres, or no distances"),
)

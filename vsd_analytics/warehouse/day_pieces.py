"""Which days have their marts computed together: as many as have few bytes of facts.

All facts that the marts of a piece read lie in memory at once. So a piece is bounded, however many days are new.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from datetime import date, timedelta

from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.build_result import BuildResult

PIECE_BYTES = 24_000_000
"""Of files of facts. Each piece also reads the day before it and the day after it, so small ones cost more time."""
_EPOCH = date(1970, 1, 1)


def pieces(days: Sequence[date], n_bytes: Mapping[int, int], *, most: int) -> list[list[date]]:
    """Return days in order as runs of consecutive days, each with at most so many bytes, or of one day.

    Args:
        days: The days, in order.
        n_bytes: Bytes by UTC day number; 0 where none are known.
        most: Bytes of a piece.
    """
    runs: list[list[date]] = []
    room = 0
    for day in days:
        own = n_bytes.get((day - _EPOCH).days, 0)
        room -= own
        if runs and room >= 0 and day - runs[-1][-1] == timedelta(days=1):
            runs[-1].append(day)
        else:
            runs.append([day])
            room = most - own
    return runs


def fact_sizes(site: Site, built: BuildResult, facts: Collection[str]) -> dict[int, int]:
    """Return the bytes of the files of some facts by UTC day number; files that are not there count nothing."""
    sizes: Counter[int] = Counter()
    for name in facts:
        fresh = built.paths.get(name, {})
        n_days = Counter(fresh.values())  # the file of a week has several
        sealed = ((hour // 24, path) for hour, path in built.sealed.fact_paths(site, name))
        for day, path in (*fresh.items(), *sealed):
            try:
                sizes[day] += path.stat().st_size // n_days.get(path, 1)
            except FileNotFoundError:
                continue
    return dict(sizes)

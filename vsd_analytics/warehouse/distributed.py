"""What a build hands to other processes and machines: one UTC day, a pure function of immutable files.

A unit of work reads stored parts, facts of the day before and after, and the description of the site, writes nothing,
and returns the bytes of fact files. So a unit can run twice, or be lost with its machine, and nothing is wrong: only
the build that handed it out publishes what comes back, under the locks it holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from vsd_analytics.errors import StoreError
from vsd_analytics.site.model import Site
from vsd_analytics.store.durable import publish

Work = Callable[[Site, int], Mapping[str, bytes]]
"""A unit of work: site and UTC day number to the bytes of files, by their paths below the project folder."""
DistributedRun = Callable[[Work, Site, Sequence[int]], Iterator[tuple[int, Mapping[str, bytes]]]]
"""Runs a unit for each of some days wherever it likes; yields each day once, in any order, with its files."""


def publish_days(
    work: Work,
    site: Site,
    wanted: Mapping[int, Iterable[Path]],
    distributed: DistributedRun,
    *,
    on_day: Callable[[int], object],
) -> None:
    """Hand out days and publish the files that come back.

    Args:
        work: The unit of work.
        site: The project.
        wanted: By UTC day number, the paths of the files that its unit must return; in the order in which the days are
            handed out. Those that take longest come first: else workers wait for the last one.
        distributed: Where the units run.
        on_day: Called with each day that is done.

    Raises:
        StoreError: E315, a unit returned other files: it ran in another version, or read other records.
    """
    for day, files in distributed(work, site, list(wanted)):
        paths = {site.root / name: data for name, data in files.items()}
        if paths.keys() != set(wanted[day]):
            raise StoreError(
                "a worker computed other facts than this build asked for",
                code="E315",
                why="it runs another version of this program, or sees other files of the store",
                fix="install the same version on every machine, mount the project folder at the same path, then run "
                "the same command again: the days that were done stay",
            )
        for path, data in paths.items():
            publish(path, data, is_synced=False)
        on_day(day)

"""Units of a build on the workers of a Spark master."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import islice

from pyspark import SparkConf, SparkContext

from vsd_analytics.errors import StoreError
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.distributed import DistributedRun, Work

AHEAD = 2
"""Days handed out at once for each core. Spark returns the results of a series together, so the days are two series of
one for each core: while the last days of one are computed, or published, workers have the other."""
N_SERIES = 2

_RAISED = re.compile(r"^[\w.]*(?:Error|Exception): .*$", re.MULTILINE)
"""The last line of a traceback of Python within the words of Java."""


@contextlib.contextmanager
def connected(address: str) -> Iterator[DistributedRun]:
    """Connect to a Spark master, and yield what hands out units to its workers; see `workers`."""
    conf = SparkConf().setMaster(address).setAppName("vsd build").set("spark.ui.enabled", "false")
    conf.set("spark.driver.maxResultSize", "0").set("spark.log.level", "ERROR")
    os.environ.setdefault("PYSPARK_PYTHON", sys.executable)  # else workers take the first python3 they find
    try:
        context = SparkContext(conf=conf)
    except Exception as error:  # py4j and the gateway raise classes of their own
        raise _failed(f"Spark does not start with master {address}", str(error)) from None
    try:

        def distributed(work: Work, site: Site, days: Sequence[int]) -> Iterator[tuple[int, Mapping[str, bytes]]]:
            n_days = AHEAD * max(1, context.defaultParallelism) // N_SERIES
            series = iter([days[first : first + n_days] for first in range(0, len(days), n_days)])

            def results(some: Sequence[int]) -> list[tuple[int, Mapping[str, bytes]]]:
                return list(context.parallelize(some, len(some)).map(lambda day: (day, work(site, day))).collect())

            with ThreadPoolExecutor(N_SERIES) as pool:
                running = deque(pool.submit(results, some) for some in islice(series, N_SERIES))
                try:
                    while running:
                        yield from running.popleft().result()
                        running.extend(pool.submit(results, some) for some in islice(series, 1))
                except Exception as error:
                    if "Py4J" not in type(error).__name__:
                        raise
                    raise _failed("Spark gave up one day", str(error)) from None
                finally:
                    context.cancelAllJobs()  # the pool waits for what still runs

        yield distributed
    finally:
        context.stop()


def _failed(what: str, why: str) -> StoreError:
    return StoreError(
        what,
        code="E316",
        why=" ".join((_RAISED.search(why) or [why])[0].split())[:300],
        fix="start the master and its workers, with SPARK_SCALA_VERSION=2.13 in their environment where Spark comes "
        "from PyPI, then run the same command again: the days that were done stay",
    )

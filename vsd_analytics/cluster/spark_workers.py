"""Units of a build on the workers of a Spark master."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence

from pyspark import SparkConf, SparkContext

from vsd_analytics.errors import StoreError
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.distributed import DistributedRun, Work

AHEAD = 4
"""Days handed out at once for each core: Spark returns the results of all of them together."""

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
            n_ahead = AHEAD * max(1, context.defaultParallelism)
            for first in range(0, len(days), n_ahead):
                some = days[first : first + n_ahead]
                try:
                    yield from context.parallelize(some, len(some)).map(lambda day: (day, work(site, day))).collect()
                except Exception as error:
                    if "Py4J" not in type(error).__name__:
                        raise
                    raise _failed("Spark gave up one day", str(error)) from None

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

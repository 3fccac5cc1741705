"""The engines that run units of a build: Dask (`tcp://`, `tls://`) and Spark (`spark://`)."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from vsd_analytics.errors import UsageError
from vsd_analytics.warehouse.distributed import DistributedRun


@contextlib.contextmanager
def workers(address: str) -> Iterator[DistributedRun]:
    """Connect to an engine, and yield what hands out units to its workers.

    Args:
        address: `tcp://HOST:PORT` or `tls://HOST:PORT` of a Dask scheduler; `spark://HOST:PORT` of a Spark master, or
            `local[N]` for N processes of Spark on this machine.

    Raises:
        UsageError: E101, no such kind of address, or its packages are not installed.
        StoreError: E316, nobody answers there, it has no workers, or its workers died over one day again and again.
    """
    is_dask = address.startswith(("tcp://", "tls://"))
    if not is_dask and not address.startswith(("spark://", "local[")):
        raise UsageError(
            f"--on cannot use {address!r}",
            why="it is neither a Dask scheduler nor a Spark master",
            fix="--on tcp://HOST:8786 (Dask), or --on spark://HOST:7077 (Spark)",
        )
    extra = "cluster" if is_dask else "spark"
    try:
        if is_dask:
            from vsd_analytics.cluster.dask_workers import connected
        else:
            from vsd_analytics.cluster.spark_workers import connected
    except ImportError as error:
        raise UsageError(
            f"--on {address} needs more packages", why=str(error), fix=f"pip install 'vsd-analytics[{extra}]'"
        ) from None
    with connected(address) as distributed:
        yield distributed

"""Units of a build on the workers of a Dask scheduler."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from uuid import uuid4

from distributed import Client, KilledWorker, as_completed

from vsd_analytics.errors import StoreError
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.distributed import DistributedRun, Work

TIMEOUT_S = 30
AHEAD = 2
"""Days handed out for each thread of a worker: one runs, one waits. Results of no more than these are in memory."""


@contextlib.contextmanager
def connected(address: str) -> Iterator[DistributedRun]:
    """Connect to a Dask scheduler, and yield what hands out units to its workers; see `workers`."""
    try:
        client = Client(address, timeout=TIMEOUT_S)
    except OSError as error:
        raise _unavailable(f"no Dask scheduler answers at {address}", str(error)) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=TIMEOUT_S)
        except TimeoutError as error:
            raise _unavailable(f"the Dask scheduler at {address} has no workers", str(error)) from None

        def distributed(work: Work, site: Site, days: Sequence[int]) -> Iterator[tuple[int, Mapping[str, bytes]]]:
            waiting, of_key = iter(days), dict[str, int]()

            def submit(day: int) -> object:
                future = client.submit(work, site, day, key=f"{work.__name__}-{day}-{uuid4().hex}")
                of_key[future.key] = day
                return future

            n_ahead = AHEAD * max(1, sum(client.nthreads().values()))
            running = as_completed([submit(day) for day in islice(waiting, n_ahead)])
            for future in running:
                day = of_key.pop(future.key)
                try:
                    yield day, future.result()
                except KilledWorker as error:
                    why = f"workers died over UTC day {day}: {error}"
                    raise _unavailable("workers died again and again over one day", why) from None
                future.release()
                for following in islice(waiting, 1):
                    running.add(submit(following))

        yield distributed


def _unavailable(what: str, why: str) -> StoreError:
    return StoreError(
        what,
        code="E316",
        why=" ".join(why.split())[:300],
        fix="start the scheduler and its workers (dask scheduler, dask worker), then run the same command again: the "
        "days that were done stay",
    )

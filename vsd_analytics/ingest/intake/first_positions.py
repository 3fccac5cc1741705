"""The first positions of a source as they are understood, for a picture of them."""

from __future__ import annotations

from vsd_analytics.ingest.checks.sample import SAMPLE_ROWS, Sample, sample_of
from vsd_analytics.ingest.formats.recognise import find_adapter
from vsd_analytics.ingest.intake.pipeline import options_for
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch, Source
from vsd_analytics.ingest.reading.limits import within_bounds
from vsd_analytics.ingest.reading.raw import n_rows
from vsd_analytics.site.model import Site


def first_positions(site: Site, source: Source, options: IngestOptions) -> Sample:
    """Return the records from which the card of a source is made.

    Raises:
        InputError: The source cannot be read.
    """
    options = options_for(site, source, options)
    reader = find_adapter(source, options)
    head: list[RawBatch] = []
    for batch in within_bounds(source, reader.read(source, options)):
        head.append(batch)
        if sum(n_rows(b.tables.values()) for b in head) >= SAMPLE_ROWS:
            break
    return sample_of(head, is_whole=False)

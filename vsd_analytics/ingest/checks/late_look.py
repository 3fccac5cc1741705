"""Records behind those of the card: whether they look wrong in a way in which the first ones did not (W229)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from vsd_analytics.ingest.checks.check_case import Case, SourceWarning
from vsd_analytics.ingest.checks.check_table import warnings_of
from vsd_analytics.ingest.checks.sample import SAMPLE_ROWS, sample_of
from vsd_analytics.ingest.reading.adapter import RawBatch
from vsd_analytics.ingest.reading.raw import n_rows
from vsd_analytics.ingest.reading.table_head import VALUES_MAX

EVERY: Final = 500_000
"""After so many records the newest `LATE_ROWS` are looked at, and once more at the end."""
LATE_ROWS: Final = 10_000
"""Fewer than of the first records: what went wrong in between shows in these too, and each look costs time."""
_SHOWN_MAX: Final = 5


@dataclass
class LateLook:
    """Looks at the newest records of a source from time to time, with the checks of its first ones.

    Attributes:
        case: That of the first records; None = there are none.
        warnings: What looked wrong in it.
    """

    case: Case | None = None
    warnings: Sequence[SourceWarning] = ()
    _newest: list[RawBatch] = field(default_factory=list)
    _values: dict[str, Counter[str]] = field(default_factory=dict)
    _n: int = 0
    _n_since: int = 0
    _found: dict[str, tuple[SourceWarning, int]] = field(default_factory=dict)

    def add(self, batch: RawBatch) -> None:
        """Take in one batch."""
        self._newest.append(batch)
        for name, values in batch.values.items():
            counter = self._values.setdefault(name, Counter())
            for value, n in values.items():
                if value in counter or len(counter) < VALUES_MAX:
                    counter[value] += n
        while len(self._newest) > 1 and self._n_held(self._newest[1:]) >= LATE_ROWS:
            del self._newest[0]
        self._n += n_rows(batch.tables.values())
        self._n_since += n_rows(batch.tables.values())
        if self._n_since >= EVERY:
            self._look()

    def notes(self, *, import_id: str) -> list[str]:
        """Return a warning for each thing that looks wrong in later records only."""
        if self._n > SAMPLE_ROWS and self._n_since:
            self._look()
        back = f"; take it back: vsd purge --import {import_id}" if import_id else ""
        shown = list(self._found.values())[:_SHOWN_MAX]
        return [f"W229: from about line {line:,} on, {d.what} ({d.code}): {d.why}; {d.fix}{back}" for d, line in shown]

    def _n_held(self, batches: Sequence[RawBatch]) -> int:
        return sum(n_rows(batch.tables.values()) for batch in batches)

    def _look(self) -> None:
        self._n_since = 0
        if self.case is None:
            return
        # the card has looked at the first ones: they would hide those behind them
        sample = sample_of(self._newest, is_whole=False, n_last=min(LATE_ROWS, self._n - SAMPLE_ROWS))
        head = self.case.head
        if head is not None:
            head = replace(head, values={**head.values, **self._values})
        with np.errstate(over="ignore", invalid="ignore"):
            late = warnings_of(replace(self.case, sample=sample, head=head))
        known = {d.code: d.is_sure for d in self.warnings}
        for warning in late:
            is_news = warning.code not in known or (warning.is_sure and not known[warning.code])
            if is_news and not (warning.is_note and warning.code != "W225"):
                first = int(sample.line.min()) if sample.n else 0
                self._found.setdefault(warning.code, (warning, first))

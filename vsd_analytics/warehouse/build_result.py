"""What a build of facts did, and which facts a range has after it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from vsd_analytics.warehouse.sealed import SealedRange


@dataclass(frozen=True, slots=True)
class BuildResult:
    """What a build did.

    Attributes:
        n_fresh: Hours whose facts were fresh already.
        reasons: Number of recomputed hours by reason, such as "new" or "settings changed".
        facts: Number of recomputed hours by fact. A fact that does not read what changed is not recomputed.
        fingerprints: Input fingerprint by UTC hour of all hours in the range, now fresh or sealed.
        day_fingerprints: Input fingerprint by UTC day number of the days of these hours and of their neighbours,
            without sealed days.
        paths: Fresh file by fact and UTC day number, of the days of the range and their neighbours. A day whose hours
            are all sealed has none.
        sealed: Hours and days whose records were purged. Their facts are never computed again.
        superseded_files: Fact files of the range that newer files replace.
    """

    n_fresh: int
    reasons: Counter[str]
    fingerprints: Mapping[int, str]
    day_fingerprints: Mapping[int, str]
    paths: Mapping[str, Mapping[int, Path]]
    sealed: SealedRange = field(default_factory=SealedRange)
    facts: Counter[str] = field(default_factory=Counter)
    superseded_files: Sequence[Path] = ()

    @property
    def n_built(self) -> int:
        """Return the number of recomputed hours."""
        return sum(self.reasons.values())

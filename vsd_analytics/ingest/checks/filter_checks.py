"""Checks of the filter that the user states: whom it keeps (W212, W222)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Final

import numpy as np

from vsd_analytics.config.row_filter import RowCondition
from vsd_analytics.ingest.checks.check_case import Case, SourceCheck, SourceWarning, always, has_columns, quoted
from vsd_analytics.ingest.reading.cell_values import is_number
from vsd_analytics.ingest.reading.column_hints import is_named_like
from vsd_analytics.ingest.reading.table_rows import LEFT_OUT
from vsd_analytics.ingest.reading.where import OPERATORS

_SHOWN_MAX: Final = 5


def _keeps_nobody(case: Case) -> Iterator[SourceWarning]:
    n_out = case.sample.n_dropped[LEFT_OUT]
    if case.sample.n or not n_out:
        return
    filtered = {} if case.head is None else case.head.filtered
    held = "; ".join(
        f"{name[:40]!r} holds {', '.join(value[:20] for value, _ in values.most_common(_SHOWN_MAX))}"
        for name, values in filtered.items()
        if values
    )
    conditions = () if case.head is None else case.head.plan.where
    kept = [_kept(condition, filtered.get(condition.column, Counter())) for condition in conditions]
    fix = f'--where "{" and ".join(text for text in kept if text)}"' if all(kept) and kept else ""
    yield SourceWarning(
        f"--where leaves out all {n_out:,} persons{f'; {held}' if held else ''}",
        "its hours would count as recorded, with nobody in view",
        f"{fix} if they are the persons" if fix else "compare values that are there",
        is_sure=case.options.where is not None,
    )


def _kept(condition: RowCondition, values: Counter[str]) -> str | None:
    """Return a comparison like one of a filter that some of the values fulfil, or None."""
    column, wanted = quoted(condition.column), condition.value
    if isinstance(wanted, float):
        numbers = [float(value) for value in values if is_number(value)]
        for factor in (1, 0.01, 100):
            limit = wanted * factor
            if any(OPERATORS[condition.sign](number, limit) for number in numbers):
                return f"{column} {condition.sign} {limit:g}"
        return None
    if any(OPERATORS[condition.sign](value.strip(), wanted) for value in values):
        alike = wanted
    else:
        alike = next((value for value in values if value.strip().lower() == wanted.lower()), "")
        alike = alike or (next(iter(values)) if len(values) == 1 and condition.sign in ("=", "==") else "")
    text = alike.strip().replace("'", "''")
    return f"{column} {condition.sign} '{text}'" if alike else None


def _confidences(case: Case) -> Iterator[SourceWarning]:
    for compared in case.columns.plan.where:
        column = compared.column
        if not is_named_like(column, "confidence") or not isinstance(compared.value, float):
            continue
        confidences = [float(v) for v in case.columns.filtered.get(column, ()) if is_number(v)]
        if confidences and 0 < compared.value <= 1 and np.median(confidences) > 1.5:
            are_percents = max(confidences) <= 100
            yield SourceWarning(
                f"--where compares {column[:80]!r} with {compared.value:g}, and it is "
                f"{min(confidences):g} to {max(confidences):g}",
                f"it holds {'percents' if are_percents else 'no shares'}, so the filter leaves out hardly any row",
                f"compare it with {compared.value * (100 if are_percents else max(confidences)):.3g}",
                is_sure=True,
            )


FILTER_CHECKS: Final = (
    SourceCheck("W212", always, _keeps_nobody, "a filter that keeps nobody"),
    SourceCheck("W222", has_columns, _confidences, "a limit of confidence in shares, where the column has percents"),
)

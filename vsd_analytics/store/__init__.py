"""Append-only Parquet: spool, fold, layout, secrets."""

from vsd_analytics.store.store import FoldResult, Store, TableCounts

__all__ = ["FoldResult", "Store", "TableCounts"]

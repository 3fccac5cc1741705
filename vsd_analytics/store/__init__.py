"""Append-only Parquet: spool, fold, layout, secrets."""

from vsd_analytics.store.store import Counts, FoldResult, Store

__all__ = ["Counts", "FoldResult", "Store"]

"""Append-only Parquet: spool, fold, layout, secrets."""

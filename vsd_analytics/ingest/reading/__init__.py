"""Bytes to tables: files, archives and messages of any engine as raw columns."""

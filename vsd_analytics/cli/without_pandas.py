"""Keeps pyarrow from importing pandas in a command that makes no frames: a quarter of a second of processor time."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType


class _NoPandas(MetaPathFinder):
    """A finder that says pandas is not installed."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Refuse pandas, and leave everything else to the other finders."""
        if fullname == "pandas":
            raise ModuleNotFoundError(fullname, name=fullname)
        return None


def answer_pyarrow() -> None:
    """Let pyarrow look for pandas now, and find none.

    With its first list and its first array pyarrow imports pandas, once, to learn how to recognise series. Afterwards
    pandas can be imported and `to_pandas` works, but `pyarrow.array` reads the gaps of a series as NaN instead of null.
    So this is for a process of our own. What was imported before stays.
    """
    if "pandas" in sys.modules:
        return
    import pyarrow as pa

    finder = _NoPandas()
    sys.meta_path.insert(0, finder)
    try:
        pa.chunked_array([pa.array([0])]).to_numpy()
    finally:
        sys.meta_path.remove(finder)

"""Memory that a build or a fold reuses: whatever the C library offers, Arrow's pool is what it was afterwards."""

from __future__ import annotations

import ctypes
from types import SimpleNamespace

import pyarrow as pa
import pytest

from vsd_analytics.store.reused_memory import reused_memory


def test_memory_is_handed_back_again_after_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, int]] = []
    trimmed: list[int] = []
    libc = SimpleNamespace(mallopt=lambda *option: asked.append(option), malloc_trim=trimmed.append)
    monkeypatch.setattr(ctypes, "CDLL", lambda name: libc)
    before = pa.default_memory_pool().backend_name
    with reused_memory():
        assert pa.default_memory_pool().backend_name == "system"
        during = dict(asked)
        assert not trimmed
    assert pa.default_memory_pool().backend_name == before
    assert trimmed == [0]
    assert all(value < during[option] for option, value in dict(asked).items())


def test_a_c_library_without_these_options_changes_arrows_pool_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda name: SimpleNamespace())
    before = pa.default_memory_pool().backend_name
    with reused_memory():
        assert pa.default_memory_pool().backend_name == "system"
    assert pa.default_memory_pool().backend_name == before

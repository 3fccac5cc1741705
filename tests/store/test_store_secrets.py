"""The per-day keys of pseudonyms."""

from __future__ import annotations

from datetime import date
from pathlib import Path

import pytest

from vsd_analytics.errors import StoreError
from vsd_analytics.store.secrets import KEY_BYTES, DayKeys, namer

DAY = date(2026, 11, 9)


def test_a_key_is_made_once_by_whoever_comes_first(tmp_path: Path) -> None:
    first = DayKeys(tmp_path / "secrets").key(DAY)
    assert len(first) == KEY_BYTES
    DayKeys(tmp_path / "secrets").put(DAY, b"x" * KEY_BYTES)
    assert DayKeys(tmp_path / "secrets").key(DAY) == first
    assert DayKeys(tmp_path / "secrets").key(date(2026, 11, 10)) != first


def test_keys_are_for_their_owner_only_and_leave_no_copy(tmp_path: Path) -> None:
    DayKeys(tmp_path / "secrets").key(DAY)
    assert [p.name for p in (tmp_path / "secrets").iterdir()] == ["2026-11-09.key"]
    assert (tmp_path / "secrets" / "2026-11-09.key").stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "secrets").stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("content", [b"", b"short", b"x" * (KEY_BYTES + 1)])
def test_a_damaged_key_is_refused_rather_than_hashed_with(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "2026-11-09.key").write_bytes(content)
    with pytest.raises(StoreError) as caught:
        DayKeys(tmp_path).key(DAY)
    assert caught.value.code == "E303"


def test_a_pseudonym_depends_on_key_camera_and_track_and_confuses_none() -> None:
    names = {
        namer(key, camera_id=camera)(track)
        for key in (b"k" * KEY_BYTES, b"l" * KEY_BYTES)
        for camera in ("cam-1", "cam-12")
        for track in ("2", "22", "\ud800")
    }
    assert len(names) == 12
    assert all(len(n) == 16 and set(n) <= set("0123456789abcdef") for n in names)

"""A small file system of its own, to be really full."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

BLOCK = 4096


@contextmanager
def small_disk(folder: Path, *, size_mb: int) -> Iterator[Path]:
    """Mount a file system in memory at a folder; skip the test where this user may not."""
    before = [] if os.geteuid() == 0 else ["sudo", "-n"]
    if any(shutil.which(tool) is None for tool in (*before[:1], "mount")):
        pytest.skip("no tool here mounts a small disk")
    folder.mkdir(parents=True)
    options = f"size={size_mb}m,mode=0777"
    done = subprocess.run(
        [*before, "mount", "-t", "tmpfs", "-o", options, "small", folder], capture_output=True, check=False
    )
    if done.returncode:
        pytest.skip(f"this user may mount no small disk: {done.stderr.decode(errors='replace').strip()}")
    try:
        yield folder
    finally:
        subprocess.run([*before, "umount", "--lazy", folder], check=True)


def fill(path: Path) -> Path:
    """Write a file until the disk has no block left; return it."""
    with path.open("wb", buffering=0) as file, contextlib.suppress(OSError):
        while file.write(bytes(BLOCK)):
            pass
    return path

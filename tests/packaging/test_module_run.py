"""`python -m vsd_analytics` is the command, where its script is not on the path."""

from __future__ import annotations

import subprocess
import sys

from vsd_analytics.version import VERSION


def test_the_module_runs_as_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "vsd_analytics", "--version"], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.strip() == f"vsd, version {VERSION}"

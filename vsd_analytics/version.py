"""The version, in one place that costs nothing to import."""

from __future__ import annotations

VERSION = "2.0.2"
